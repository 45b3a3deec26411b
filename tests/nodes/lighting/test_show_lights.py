"""Lines for lights and frusta: where NumPy says that they run, and nowhere else."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from rendergraph.nodes.shadows._light_views import light_views

import rendergraph as rg
from rendergraph.api import projection
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.facts import FrameScene

Floats = npt.NDArray[np.float64]
SIZE = (96, 72)


def drawn(session: rg.Session, scene: str, reads: dict[str, str], **params: Any) -> tuple[npt.NDArray[np.bool_], Any]:
    """Which pixels lines of one pixel changed, top row first, and the scene."""
    node = {
        "type": "show_lights",
        "inputs": {"depth": "gbuffer.depth", "color": "display.color"} | reads,
        "params": {"width": 1.0, "through": 1.0, **params},
    }
    loaded = rg.load("deferred", size=SIZE, scene=scene, sets=("sun.resolution=64", "display.curve=none"))
    loaded = loaded.patch({"nodes": {"shown": node}, "outputs": {"image": "shown.color"}})
    frame = session.render(loaded, taps=("display.color",), warm_up=False)
    return (frame["image"] != frame["display.color"]).any(axis=-1), loaded.link().scene


def distances(scene: Any, lines: Floats) -> Floats:
    """How far each pixel's middle is from the nearest of some lines, (n, 2, 3) in the world, in pixels."""
    camera = view_matrices(next(iter(scene.cameras.values())), SIZE)
    matrix = camera.projection @ camera.view
    homogeneous = np.concatenate([lines, np.ones((*lines.shape[:2], 1))], axis=-1) @ matrix.T
    kept = []
    for a, b in homogeneous:
        if max(a[3], b[3]) > 0.01:  # what is behind the eye is cut off
            a, b = (
                one if one[3] > 0.01 else one + (two - one) * (0.01 - one[3]) / (two[3] - one[3])
                for one, two in ((a, b), (b, a))
            )
            kept.append(((a[:2] / a[3] + 1) / 2 * SIZE, (b[:2] / b[3] + 1) / 2 * SIZE))
    ends = np.array(kept)
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]] + 0.5
    points = np.stack([x, SIZE[1] - y], axis=-1)
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    from_start = points[:, :, np.newaxis] - start
    share = np.clip((from_start * along).sum(-1) / np.maximum((along**2).sum(-1), 1e-12), 0, 1)
    return np.asarray(np.linalg.norm(from_start - share[..., np.newaxis] * along, axis=-1).min(axis=-1))


def test_a_frustum_has_twelve_edges(session: rg.Session) -> None:
    found, scene = drawn(session, "shadow_study", {"shadow_map": "sun.shadow_map"}, icons=False)
    camera = view_matrices(next(iter(scene.cameras.values())), SIZE)
    (view,) = light_views(scene.lights[0], FrameScene(scene), camera, 64)
    corners = projection.frustum_corners(view)
    edges = [(a, b) for a in range(8) for b in range(a) if (a ^ b).bit_count() == 1]
    far = distances(scene, corners[edges])
    assert found.sum() > 60
    assert far[found].max() < 1.6
    assert found[far < 0.3].all()


def test_a_spot_light_is_its_cones(session: rg.Session) -> None:
    """Rims at both angles, as far as half of the scene's half extent, and eight lines to the outer one."""
    found, scene = drawn(session, "cornell_box", {}, size=0.0)
    light = scene.lights[0]
    reach = 0.25 * np.linalg.norm(np.subtract(*scene.bounds))
    turns = np.linspace(0, 2 * np.pi, 17)

    def rim(angle: float) -> Floats:
        across = np.stack([np.cos(turns), 0 * turns, np.sin(turns)], axis=-1) * np.sin(angle)
        return np.asarray(np.array(light.position) + reach * (across + np.array(light.direction) * np.cos(angle)))

    rims = [rim(light.inner), rim(light.outer)]
    lines = [np.stack([one[:-1], one[1:]], axis=1) for one in rims]
    rays = [(light.position, end) for end in rims[1][:-1:2]]
    far = distances(scene, np.concatenate([*lines, np.array(rays)]))
    assert found.sum() > 60
    assert far[found].max() < 1.6
    assert found[far < 0.3].mean() > 0.95  # white lines on white change nothing
