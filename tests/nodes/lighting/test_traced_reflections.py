"""Traced reflections against a mirrored camera and in a furnace."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]

ROOM = """scene: 1
objects:
  mirror: {shape: plane, size: [20, 20], rotate_degrees: [90, 0, 0], material: mirror, hidden: HIDDEN}
  floor: {shape: plane, size: [20, 20], at: [0, -1, 0], material: grey}
  back: {shape: plane, size: [20, 20], rotate_degrees: [-90, 0, 0], at: [0, 0, 9], material: grey}
  ball: {shape: sphere, radius: 0.6, at: [-0.7, -0.4, 1.2], material: red}
  box: {shape: box, size: [0.7, 1.2, 0.7], at: [0.9, -0.4, 1.6], rotate_degrees: [0, 30, 0], material: metal}
  lamp: {shape: sphere, radius: 0.15, at: [0.2, 1.6, 1], material: lamp}
materials:
  mirror: {base_color: [1, 1, 1], metallic: 1, roughness: 0}
  grey: {base_color: [0.5, 0.5, 0.5], roughness: 0.8}
  red: {base_color: [0.8, 0.1, 0.1], roughness: 0.4}
  metal: {base_color: [0.9, 0.7, 0.3], roughness: 0.5, metallic: 1}
  lamp: {base_color: [0, 0, 0], roughness: 1, emissive: [3, 2, 1]}
lights: {sun: {type: directional, direction: [-0.3, -1, -0.4], intensity: 3}}
cameras:
  main: {eye: [0.3, 0.4, 4], target: [0.3, 0.2, 0], fov_y_degrees: 50, near: 0.1, far: 40}
  mirrored: {eye: [0.3, 0.4, -4], target: [0.3, 0.2, 0], fov_y_degrees: 50, near: 4.0, far: 40}
"""
"""A mirror at z = 0 that fills the picture, things in front of it, and the camera behind it that sees the same."""

REFLECTIONS: dict[str, Any] = {
    "nodes": {
        "mirror": {"type": "traced_reflections", "inputs": {"depth": "gbuffer.depth", "normal": "gbuffer.normal"}},
        "light": {"inputs": {"reflections": "mirror.reflections"}},
    },
    "outputs": {"image": None, "radiance": "light.radiance"},
}


def draw(
    session: rg.Session,
    scene: Path,
    port: str,
    *sets: str,
    pipeline: str = "deferred",
    patch: dict[str, Any] | None = None,
    size: tuple[int, int] = (48, 36),
    camera: str = "main",
) -> Floats:
    loaded = rg.load(pipeline, scene=scene, size=size, camera=camera, sets=sets, patches=[patch] if patch else [])
    return np.asarray(session.render(loaded, outputs=(), taps=(port,))[port], np.float64)


@pytest.fixture
def room(tmp_path: Path) -> dict[bool, Path]:
    """Scene files, by whether the mirror is there."""
    files = {there: tmp_path / f"room_{there}.yaml" for there in (True, False)}
    for there, file in files.items():
        file.write_text(ROOM.replace("HIDDEN", str(not there).lower()))
    return files


def test_a_mirror_shows_what_a_mirrored_camera_sees(session: rg.Session, room: dict[bool, Path]) -> None:
    sets = ("mirror.samples=1", "gbuffer.precision=full")
    found = draw(session, room[True], "mirror.reflections", *sets, patch=REFLECTIONS)
    truth = draw(session, room[False], "light.radiance", "shadows.type=traced_shadows", camera="mirrored")[:, ::-1]
    is_mirror = draw(session, room[True], "gbuffer.material", "gbuffer.precision=full")[..., 0] > 0.5
    is_mirror &= draw(session, room[True], "gbuffer.material", "gbuffer.precision=full")[..., 1] < 0.1
    judged = is_mirror & (truth[..., 3] == 1)
    assert judged.mean() > 0.6
    assert (found[..., 3] == 1).all()
    off = np.abs(found - truth)[..., :3].max(axis=-1)[judged]
    assert truth[..., 0][judged].max() > 2.9  # the lamp
    assert np.median(off) < 1e-3
    assert (off > 0.01).mean() < 0.03  # outlines, by rounding


def test_reflections_need_only_depth(session: rg.Session, room: dict[bool, Path]) -> None:
    """After the pre-pass of forward shading they are those of deferred shading, and lighting shows them."""
    patch = {
        "nodes": {
            "mirror": {"type": "traced_reflections", "inputs": {"depth": "prepass.depth"}},
            "light": {"inputs": {"reflections": "mirror.reflections"}},
        },
        "outputs": {"image": None, "radiance": "light.radiance"},
    }
    pictures = [
        draw(session, room[True], "light.radiance", "mirror.samples=1", pipeline=pipeline, patch=each)
        for pipeline, each in (("forward-prepass", patch), ("deferred", REFLECTIONS))
    ]
    off = np.abs(pictures[0] - pictures[1]).max(axis=-1)
    assert np.median(off) < 1e-3
    assert (off > 0.02).mean() < 0.03
    plain = draw(session, room[True], "light.radiance", pipeline="deferred")
    assert np.abs(pictures[1] - plain).mean() > 0.02


def test_a_furnace_is_reflected_as_it_is(session: rg.Session, tmp_path: Path) -> None:
    """Uniform light arrives in every lobe with the same radiance, of metals and of others, at any roughness.

    On plates in one plane, which do not see each other, seen from 27° to 74°.
    """
    objects, materials = [], []
    for number, (metallic, roughness) in enumerate((m, r) for m in (0, 1) for r in (0.0, 0.25, 0.5, 1.0)):
        at = [number % 4 * 2 - 3, number // 4 * 2 - 1, 0]
        objects.append(
            f"  b{number}: {{shape: plane, size: [2, 2], rotate_degrees: [90, 0, 0], at: {at}, material: m{number}}}"
        )
        color = "[0.9, 0.6, 0.3]"
        materials.append(f"  m{number}: {{base_color: {color}, metallic: {metallic}, roughness: {roughness}}}")
    file = tmp_path / "furnace.yaml"
    file.write_text(
        "scene: 1\nobjects:\n"
        + "\n".join(objects)
        + "\nmaterials:\n"
        + "\n".join(materials)
        + "\nlights: {none: {type: directional, direction: [0, -1, 0], intensity: 0}}\n"
        + "cameras: {main: {eye: [0, 0, 2.3], target: [0, 0, 0], fov_y_degrees: 82, near: 0.1, far: 10}}\n"
    )
    sets = ("mirror.samples=32", "mirror.ambient=1", "gbuffer.precision=full")
    found = draw(session, file, "mirror.reflections", *sets, patch=REFLECTIONS, size=(80, 40))
    assert (found[2:-2, 2:-2, 3] == 1).all()
    for number in range(8):
        y, x = 20 - number // 4 * 20, number % 4 * 20
        plate = found[y + 3 : y + 17, x + 3 : x + 17, :3]
        assert plate.mean(axis=(0, 1)) == pytest.approx([1, 1, 1], abs=0.02), number


def test_rough_surfaces_have_no_rays(session: rg.Session, room: dict[bool, Path]) -> None:
    sets = ("mirror.samples=1", "mirror.max_roughness=0.6", "gbuffer.precision=full")
    found = draw(session, room[True], "mirror.reflections", *sets, patch=REFLECTIONS)[..., 3]
    roughness = draw(session, room[True], "gbuffer.material", "gbuffer.precision=full")[..., 1]
    expected = np.clip(4 * (0.6 - roughness) / 0.6, 0, 1)
    np.testing.assert_allclose(found, expected, atol=2e-3)
    assert {0, 1} < set(np.unique(found))


@pytest.mark.nightly
@pytest.mark.slow
def test_a_reduced_scale_is_interpolated_and_samples_agree(session: rg.Session, room: dict[bool, Path]) -> None:
    glossy = room[True].with_name("glossy.yaml")
    text = room[True].read_text().replace("metallic: 1, roughness: 0}", "metallic: 1, roughness: 0.4}")
    glossy.write_text(text.replace("emissive: [3, 2, 1]", "emissive: [0, 0, 0]"))  # a small lamp is mostly noise
    many, few, half = (
        draw(session, glossy, "mirror.reflections", *sets, patch=REFLECTIONS, size=(48, 36))[..., :3]
        for sets in (("mirror.samples=16",), ("mirror.samples=4",), ("mirror.samples=8", "mirror.scale=0.5"))
    )
    for found in (few, half):  # at outlines the surfaces of fewer pixels stand for others
        many_blocks, blocks = (each.reshape(6, 6, 8, 6, 3).mean(axis=(1, 3)) for each in (many, found))
        assert np.median(blocks / many_blocks) == pytest.approx(1, abs=0.05)
        assert np.quantile(np.abs(blocks / many_blocks - 1), 0.75) < 0.3


@pytest.mark.nightly
def test_a_mirror_shows_what_is_behind_tinted_glass(session: rg.Session, tmp_path: Path) -> None:
    """A glowing wall through a thin pane, in the mirror: 96 % of it, tinted, as `path_traced` finds it."""
    (tmp_path / "pane.yaml").write_text("""scene: 1
objects:
  mirror: {shape: plane, size: [20, 20], rotate_degrees: [90, 0, 0], material: mirror}
  pane: {shape: plane, size: [60, 60], rotate_degrees: [-90, 0, 0], at: [0, 0, 3], material: pane}
  wall: {shape: plane, size: [90, 90], rotate_degrees: [-90, 0, 0], at: [0, 0, 5], material: glow}
materials:
  mirror: {base_color: [1, 1, 1], metallic: 1, roughness: 0}
  pane: {base_color: [1, 0.5, 0.2], transmission: 1, roughness: 0, double_sided: true}
  glow: {base_color: [0, 0, 0], roughness: 1, specular: 0, emissive: [2, 2, 2]}
lights: {none: {type: directional, direction: [0, -1, 0], intensity: 0}}
cameras: {main: {eye: [0, 0, 2], target: [0, 0, 0], fov_y_degrees: 30, near: 0.1, far: 40}}
""")
    file, dark = tmp_path / "pane.yaml", "light.ambient=0"
    found = draw(session, file, "light.radiance", dark, "mirror.samples=256", patch=REFLECTIONS, size=(8, 8))
    expected = 2 * 0.96 * np.array([1, 0.5, 0.2])
    np.testing.assert_allclose(found[..., :3].mean(axis=(0, 1)), expected, rtol=0.02)
    truth = draw(session, file, "light.radiance", dark, "light.samples=256", pipeline="path-traced", size=(8, 8))
    np.testing.assert_allclose(truth[..., :3].mean(axis=(0, 1)), expected, rtol=0.05)
