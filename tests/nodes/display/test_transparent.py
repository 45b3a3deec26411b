"""Pictures with alpha: composited over a background they are the pictures with that background."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.errors import UsageError
from rendergraph.images import read, to_srgb

Floats = npt.NDArray[np.float64]
BACKGROUND = 0.5
SCENE = """scene: 1
objects:
  ball: {shape: sphere, radius: 0.5, at: [0, 0.5, 0], material: grey}
  pane: {shape: plane, size: [1, 1], at: [0.7, 0.6, 0.8], rotate_degrees: [90, 0, 0], material: %s}
materials:
  grey: {base_color: 0.5, roughness: 0.6}
  veil: {base_color: [0.2, 0.4, 0.6, 0.5], alpha_mode: blend, double_sided: true}
  glass: {base_color: [0.9, 0.9, 0.9], transmission: 1, roughness: 0, double_sided: true}
lights: {sun: {type: directional, direction: [1, -2, -1], intensity: 3}}
cameras: {main: {eye: [0.5, 1, 4], target: [0.3, 0.5, 0], fov_y_degrees: 40}}
"""


def drawn(
    session: rg.Session, folder: Path, material: str, pipeline: str, *sets: str, transparent: bool = False
) -> rg.Frame:
    (folder / "scene.yaml").write_text(SCENE % material)
    loaded = rg.load(
        pipeline,
        scene=folder / "scene.yaml",
        size=(96, 64),
        sets=sets,
        environment=Path("none"),
        ground=material != "glass",
        transparent=transparent,
    )
    return session.render(loaded, outputs=["image", "radiance"])


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("pipeline", "material"), [("forward", "veil"), ("deferred", "veil"), ("forward", "glass")])
def test_light_over_a_background_is_the_picture_with_it(
    session: rg.Session, tmp_path: Path, pipeline: str, material: str
) -> None:
    """Light of an EXR file is premultiplied. Shadows on the ground and panes hide a part of the background."""
    clear = drawn(session, tmp_path, material, pipeline, transparent=True)
    plain = drawn(session, tmp_path, material, pipeline, f"light.background={BACKGROUND}", "light.backdrop=false")
    alpha = np.asarray(clear["radiance"][..., 3:], np.float64)
    composited = clear["radiance"][..., :3] + (1 - alpha) * BACKGROUND
    expected = np.asarray(plain["radiance"][..., :3], np.float64)
    np.testing.assert_allclose(composited, expected, atol=4e-3)
    assert (alpha == 0).mean() > 0.3
    assert (alpha == 1).mean() > 0.05
    assert ((alpha > 0.05) & (alpha < 0.9)).mean() > 0.03


def test_png_files_have_straight_alpha(session: rg.Session, tmp_path: Path) -> None:
    clear = drawn(session, tmp_path, "veil", "forward", "display.curve=none", "display.dither=false", transparent=True)
    clear.save(tmp_path / "clear.png")
    found = np.asarray(read(tmp_path / "clear.png"), np.float64) / 255
    light = np.asarray(clear["radiance"], np.float64)
    assert found.shape[-1] == 4
    np.testing.assert_allclose(found[..., 3], light[..., 3], atol=0.6 / 255)
    inside = light[..., 3] > 0.25
    straight = to_srgb(np.clip(light[inside][:, :3] / light[inside][:, 3:], 0, 1))
    np.testing.assert_allclose(found[inside][:, :3], straight, atol=2.5 / 255)
    clear.save(tmp_path / "clear.exr")
    np.testing.assert_allclose(read(tmp_path / "clear.exr"), light, rtol=1e-3)
    clear.save(tmp_path / "shown.exr", "image")
    shown = np.clip(light[..., :3], 0, light[..., 3:])
    np.testing.assert_allclose(read(tmp_path / "shown.exr")[..., :3], shown, atol=0.015)
    solid = drawn(session, tmp_path, "veil", "forward")
    solid.save(tmp_path / "solid.png")
    assert read(tmp_path / "solid.png").shape[-1] == 3


def test_full_keeps_alpha_and_meters_what_is_there(session: rg.Session, tmp_path: Path) -> None:
    """Black around a small object would open the aperture."""
    clear = drawn(session, tmp_path, "veil", "full", transparent=True)
    assert clear["image"][0, 0].tolist() == [0, 0, 0, 0]
    assert clear["image"][..., 3].max() == 255
    assert clear["image"][32, 45, :3].max() < 250


BAR = """scene: 1
objects: {bar: {shape: box, size: [20, 1, 0.001], rotate_degrees: [0, 0, 10], material: lamp}}
materials: {lamp: {base_color: %s, unlit: true}}
cameras: {main: {eye: [0, 0, 4], target: [0, 0, 0], fov_y_degrees: 40}}
"""


@pytest.mark.parametrize("level", [0.0, 0.4])
@pytest.mark.parametrize(("pipeline", "frame"), [("fxaa", 1), ("smaa", 1), ("taa", 12)])
def test_edges_are_smooth_in_alpha_and_keep_their_colour(
    session: rg.Session, tmp_path: Path, pipeline: str, frame: int, level: float
) -> None:
    """A bar of one colour: over nothing it has that colour in all pixels, and alpha is what it covers of them."""
    (tmp_path / "scene.yaml").write_text(BAR % level)
    loaded = rg.load(
        pipeline,
        scene=tmp_path / "scene.yaml",
        size=(48, 32),
        sets=["display.curve=none", "display.dither=false"],
        environment=Path("none"),
        transparent=True,
    )
    found = session.render(loaded, outputs=["image"], frames=range(frame, frame + 1))["image"].astype(float) / 255
    y, x = (np.mgrid[0:320, 0:480] + 0.5) / 10
    unit, turn = 16 / np.tan(np.radians(20)) / 4, np.radians(10)
    fine = (np.abs((16 - y) * np.cos(turn) - (x - 24) * np.sin(turn)) < unit / 2).astype(float)
    covered = fine.reshape(32, 10, 48, 10).mean(axis=(1, 3))
    hard = np.abs(fine[5::10, 5::10] - covered).mean()
    off = np.abs(found[..., 3] - covered).mean()
    assert off < (0.2 if pipeline == "taa" else 0.5) * hard
    inside = found[..., 3] > 0.2
    color = float(to_srgb(np.array(level)))
    np.testing.assert_allclose(found[inside][:, :3] / found[inside][:, 3:], color, atol=0.02)


def test_a_small_object_over_nothing_is_not_called_black(session: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text((BAR % 0.4).replace("[20, 1, 0.001]", "[0.1, 0.1, 0.1]"))
    for exposure, found in ((0, {}), (-12, {"image": "almost black"}), (8, {"image": "clipped in more than half"})):
        sets = [f"display.exposure={exposure}", "display.curve=none"]
        loaded = rg.load("forward", scene=tmp_path / "scene.yaml", size=(96, 64), sets=sets, transparent=True)
        frame = session.render(loaded, outputs=["image"])
        assert np.mean(frame["image"][..., :3]) < 5
        assert {name: text[: len(found.get(name, text))] for name, text in frame.badly_exposed.items()} == found


def test_a_pipeline_without_alpha_is_told(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text(
        "rendergraph: 1\nnodes: {depth: {type: depth_prepass}}\noutputs: {depth: depth.depth}\n"
    )
    with pytest.raises(UsageError, match="no node of the pipeline has a parameter 'transparent'"):
        rg.load(tmp_path / "p.yaml", transparent=True).link()
