"""What nodes ask of a frame's scene: found once, and for an object that moves, as if all were found anew."""

from __future__ import annotations

import numpy as np
from msgspec.structs import replace

from rendergraph.scene.facts import FrameScene
from rendergraph.scene.model import Mesh, Object, Scene

POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], np.float32)
MESHES = tuple(Mesh(f"m{k}", POINTS * (k + 1), np.zeros((1, 3), np.uint32), POINTS) for k in range(2))


def _placed(number: int, random: np.random.Generator, *, hidden: bool = False) -> Object:
    transform = np.eye(4)
    transform[:3] = random.normal(size=(3, 4))
    return Object(f"o{number}", number % 2, 0, transform, casts_shadow=number % 3 > 0, hidden=hidden)


def test_what_is_kept_of_the_frame_before_is_what_would_be_found() -> None:
    random = np.random.default_rng(1)
    objects = [_placed(number, random, hidden=number == 4) for number in range(9)]
    scene = Scene("s", objects=tuple(objects), meshes=MESHES)
    kept = FrameScene(scene)
    for frame in range(6):
        assert kept.corners.shape == (9, 8, 3)
        number = int(random.integers(9))
        objects[number] = _placed(number, random, hidden=frame == 3 or objects[number].hidden)
        scene = replace(scene, objects=tuple(objects))
        before, kept, fresh = kept.corners.copy(), FrameScene(scene, kept), FrameScene(scene)
        for name in ("corners", "shown", "casting"):
            np.testing.assert_array_equal(getattr(kept, name), getattr(fresh, name))
        assert kept.bounds == fresh.bounds
        np.testing.assert_allclose(kept.bounds, scene.bounds)
        assert (kept.corners != before).any(axis=(1, 2)).sum() == 1


def test_corners_are_those_of_the_transformed_box() -> None:
    transform = np.diag([1.0, 2.0, -1.0, 1.0])
    transform[:3, 3] = 5, 6, 7
    scene = FrameScene(Scene("s", objects=(Object("o", 0, 0, transform),), meshes=MESHES))
    assert scene.corners[0, 0].tolist() == [5, 6, 7]
    assert scene.corners[0, 1].tolist() == [5, 6, 4]
    assert scene.corners[0, 7].tolist() == [6, 10, 4]
    assert scene.bounds == ((5, 6, 4), (6, 10, 7))


def test_a_scene_of_nothing_has_bounds() -> None:
    assert FrameScene(Scene("s")).bounds == ((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
