"""Traced interreflection against radiosity, form factors, a path-traced reference and the other traced nodes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]
DARK = ("gi.sky=0", "gi.environment=false", "light.ambient=0", "gi.radius=1000")


def draw(session: rg.Session, scene: Path | str, *sets: str, size: tuple[int, int], **ports: str) -> dict[str, Floats]:
    """Values by name, shape (height, width, 3), top row first; `ports` are their ports."""
    pipeline = rg.load(
        ports.pop("pipeline", "ssgi"),
        scene=scene,
        size=size,
        sets=[f"gi.type={ports.pop('type', 'traced_interreflection')}", *sets],
        patches=[{"outputs": {"image": None, "radiance": None, **ports}}],
    )
    frame = session.render(pipeline, outputs=list(ports))
    return {name: np.asarray(frame.arrays[name], np.float64)[..., :3] for name in ports}


PARALLEL = """scene: 1
objects:
  floor: {{shape: plane, size: [40, 40], material: white}}
  lamp: {{shape: plane, size: [2, 3], rotate_degrees: [180, 0, 0], at: [0, 1.5, 0], material: lamp}}
materials:
  white: {{base_color: [0.8, 0.8, 0.8], roughness: 1}}
  lamp: {{base_color: [{albedo}, {albedo}, {albedo}], roughness: 1, emissive: {emissive}}}
lights:
  sun: {{type: point, at: [0, 0.5, 0], intensity: {intensity}}}
  other: {{type: point, at: [0.8, 0.9, 0], intensity: {other}}}
cameras: {{main: {{eye: [0, 1, 0], target: [0, 0, 0], up: [0, 0, -1], height: 4, near: 0.1, far: 4}}}}
"""
"""A rectangle that faces the floor 1.5 m above it; the camera is below it and sees 4 m of the floor, from -2 to 2."""


def corner_form_factor(a: Floats, b: Floats, height: float) -> Floats:
    """Form factor from a point to a parallel rectangle over it, whose corner is above the point (Howell, B-4)."""
    x, y = a / height, b / height
    first = x / np.sqrt(1 + x * x) * np.arctan(y / np.sqrt(1 + x * x))
    return np.asarray((first + y / np.sqrt(1 + y * y) * np.arctan(x / np.sqrt(1 + y * y))) / (2 * np.pi))


def rectangle_form_factor(x: Floats, z: Floats, width: float, depth: float, height: float) -> Floats:
    """The same of a rectangle centred over the origin, from the points (x, z)."""
    signed = [
        corner_form_factor(width / 2 + i * x, depth / 2 + j * z, height) for i in (-1, 1) for j in (-1, 1)
    ]  # odd in both arguments, so that it also holds for points outside
    return np.asarray(sum(signed))


def floor_points(side: int) -> tuple[Floats, Floats]:
    ticks = ((np.arange(side) + 0.5) / side - 0.5) * 4
    x, z = np.meshgrid(ticks, ticks)
    return x, z


def test_a_glowing_rectangle_lights_the_floor_by_its_form_factor(session: rg.Session, tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(PARALLEL.format(albedo=0, emissive=[2, 1, 0.5], intensity=0, other=0))
    found = draw(session, file, *DARK, "gi.samples=32", size=(32, 32), x="gi.indirect", sent="gi.reflected")
    expected = rectangle_form_factor(*floor_points(32), 2, 3, 1.5)[..., None] * [2, 1, 0.5]
    off = found["x"] - expected
    assert np.abs(off.reshape(4, 8, 4, 8, 3).mean(axis=(1, 3))).max() < 0.02
    assert np.abs(off.mean(axis=(0, 1)) / expected.mean(axis=(0, 1))).max() < 0.01
    np.testing.assert_allclose(found["sent"], 0.8 * found["x"], rtol=3e-3, atol=1e-4)


def test_one_bounce_of_two_lamps_is_the_integral_over_the_rectangle(session: rg.Session, tmp_path: Path) -> None:
    """Light of two point lights by way of the rectangle over them, integrated over the rectangle in NumPy."""
    file = tmp_path / "scene.yaml"
    file.write_text(PARALLEL.format(albedo=0.6, emissive=[0, 0, 0], intensity=4, other=1))
    found = draw(session, file, *DARK, "gi.samples=32", size=(32, 32), x="gi.indirect")["x"][..., 0]
    u, v = ((np.arange(n) + 0.5) / n - 0.5 for n in (80, 120))
    u, v = (grid.ravel() for grid in np.meshgrid(2 * u, 3 * v))
    area = 6 / u.size
    leaving = 0.6 / np.pi * 4 * 1.0 / (u * u + v * v + 1.0**2) ** 1.5
    leaving += 0.6 / np.pi * 1 * 0.6 / ((u - 0.8) ** 2 + v * v + 0.6**2) ** 1.5
    x, z = floor_points(32)
    apart = (x[..., None] - u) ** 2 + (z[..., None] - v) ** 2 + 1.5**2
    expected = (leaving * 1.5**2 / apart**2 * area).sum(axis=-1) / np.pi
    off = found - expected
    assert np.abs(off.mean() / expected.mean()) < 0.01
    assert np.abs(off.reshape(4, 8, 4, 8).mean(axis=(1, 3))).max() < 0.04 * expected.max()


FURNACE = """scene: 1
objects:
  room: {shape: box, size: [2, 2, 2], material: a}
materials: {a: {base_color: [0.5, 0.5, 0.5], roughness: 1, emissive: [1, 1, 1], double_sided: true}}
lights: {none: {type: directional, direction: [0, -1, 0], intensity: 0}}
cameras: {main: {eye: [0.2, 0.1, 0.6], target: [0, 0, -1], fov_y_degrees: 90, near: 0.01, far: 10}}
"""


def test_bounces_in_a_furnace_are_a_geometric_series(session: rg.Session, tmp_path: Path) -> None:
    """In a closed room that glows evenly, light that visited n surfaces adds up to 1 + a + … + aⁿ⁻¹ without noise."""
    file = tmp_path / "scene.yaml"
    file.write_text(FURNACE)
    for bounces in (1, 3):
        sets = (*DARK, "gi.samples=2", f"gi.bounces={bounces}")
        found = draw(session, file, *sets, size=(16, 16), x="gi.indirect")["x"]
        np.testing.assert_allclose(found, 2 - 2.0 ** (1 - bounces), rtol=2e-3)


def test_surfaces_send_on_what_they_see_of_the_sky(session: rg.Session, tmp_path: Path) -> None:
    """A rectangle over a floor sees of the sky what the floor, by its form factor, leaves free."""
    file = tmp_path / "scene.yaml"
    file.write_text(PARALLEL.format(albedo=0.6, emissive=[0, 0, 0], intensity=0, other=0).replace("[40, 40]", "[4, 4]"))
    sets = ("gi.environment=false", "light.ambient=0", "gi.radius=1000", "gi.samples=64")
    found = draw(session, file, *sets, "gi.sky=[1, 2, 0]", size=(16, 16), x="gi.indirect")["x"]
    assert found[..., 2].max() == 0
    np.testing.assert_allclose(found[..., 1], 2 * found[..., 0], rtol=2e-3, atol=1e-4)
    # A point of the rectangle sees the sky except for the floor, and a point of the floor sees the rectangle.
    u, v = ((np.arange(n) + 0.5) / n - 0.5 for n in (20, 30))
    u, v = (grid.ravel() for grid in np.meshgrid(2 * u, 3 * v))
    leaving = 0.6 * (1 - rectangle_form_factor(u, v, 4, 4, 1.5))
    x, z = floor_points(16)
    apart = (x[..., None] - u) ** 2 + (z[..., None] - v) ** 2 + 1.5**2
    expected = (leaving * 1.5**2 / apart**2 * 6 / u.size).sum(axis=-1) / np.pi
    assert found[..., 0].mean() == pytest.approx(expected.mean(), rel=0.02)


@pytest.mark.parametrize(("bounces", "part"), [(1, "one_bounce"), pytest.param(10, "full", marks=pytest.mark.nightly)])
def test_light_in_a_box_is_the_path_traced_one(session: rg.Session, shared: Path, bounces: int, part: str) -> None:
    from OpenImageIO import FLOAT, ImageBuf

    here = shared / "reference" / "b4_gi" / "point"

    def picture(name: str) -> Floats:
        return np.asarray(ImageBuf(str(here / f"{name}.exr")).get_pixels(FLOAT), np.float64)[..., :3]

    truth = picture(part) - (picture("direct") if part == "full" else 0)
    surfaces = np.load(here / "gbuffer.npz")
    judged = (surfaces["object"] > 0) & ~surfaces["edge"]
    sets = (*DARK, "gi.scale=0.25", "gi.samples=16", f"gi.bounces={bounces}", "gbuffer.precision=full")
    found = draw(session, here / "scene.glb", *sets, size=(192, 192), x="gi.reflected")["x"]
    assert np.abs(found[judged].mean(axis=0) / truth[judged].mean(axis=0) - 1).max() < 0.01
    for number in range(1, 6):
        here_too = judged & (surfaces["object"] == number)
        assert found[here_too].mean() == pytest.approx(truth[here_too].mean(), rel=0.04)


def test_light_of_the_picture_is_reused(session: rg.Session, shared: Path) -> None:
    """Most surfaces that rays meet are in the picture, so the light hardly changes; but it does follow `diffuse`."""
    here = shared / "reference" / "b4_gi" / "point" / "scene.glb"
    sets = (*DARK, "sun.light=all", "light.environment=null", "gi.samples=16", "gbuffer.precision=full")
    traced, reused, doubled = (
        draw(session, here, *sets, *more, size=(48, 48), x="gi.indirect")["x"]
        for more in ((), ("gi.reuse=true",), ("gi.reuse=true", "light.ambient=0.2"))
    )
    assert reused.mean() == pytest.approx(traced.mean(), rel=0.03)
    assert np.abs(reused - traced).mean() < 0.05 * traced.mean()
    assert doubled.mean() > 1.05 * reused.mean()


@pytest.mark.nightly
@pytest.mark.slow
def test_both_at_once_are_occlusion_and_light(session: rg.Session) -> None:
    """`traced_occlusion_and_light` in place of `ssil`, against the two nodes that trace them apart."""
    both: dict[str, Any] = {"type": "traced_occlusion_and_light", "open": "gi.occlusion", "x": "gi.indirect"}
    sets = ("light.ambient=0", "gi.samples=64", "gi.radius=0.3")
    found = draw(session, "cornell_box", *sets, "gi.wider=4", size=(32, 24), pipeline="ssil", **both)
    light = draw(session, "cornell_box", *sets[:2], "gi.radius=1.2", size=(32, 24), x="gi.indirect")["x"]
    np.testing.assert_allclose(found["x"], light, rtol=5e-3, atol=2e-3)
    rays = ("ao.type=traced_occlusion", "ao.radius=0.3", "ao.samples=64")
    patch = {"outputs": {"open": "ao.occlusion"}}
    pipeline = rg.load("ssao-disc", scene="cornell_box", size=(32, 24), sets=rays, patches=[patch])
    apart = np.asarray(session.render(pipeline, outputs=["open"]).arrays["open"], np.float64)[..., 0]
    assert apart.min() < 0.6
    assert np.abs(found["open"][..., 0] - apart).max() < 0.02


@pytest.mark.nightly
def test_a_filter_takes_noise_and_a_reduced_scale_is_interpolated(session: rg.Session) -> None:
    sets = ("gi.sky=0", "light.ambient=0")
    many, raw, smooth, half = (
        draw(session, "shapes", *sets, f"gi.samples={samples}", *more, size=(40, 24), x="gi.indirect")["x"]
        for samples, *more in ((64,), (8,), (8, "gi.denoise=3"), (8, "gi.scale=0.5", "gi.denoise=3"))
    )
    assert np.abs(smooth - many).mean() < 0.7 * np.abs(raw - many).mean()
    for few in (raw, smooth, half):
        assert abs(few.mean() / many.mean() - 1) < 0.1


@pytest.mark.nightly
def test_a_pane_tints_the_light_that_comes_through_it(session: rg.Session, tmp_path: Path) -> None:
    """A floor under a glowing ceiling with a pane between them: 96 % of the light, tinted; a coat keeps some of it."""
    file = tmp_path / "scene.yaml"
    text = """scene: 1
objects:
  floor: {shape: plane, size: [4, 4]}
  pane: {shape: plane, size: [900, 900], at: [0, 1, 0], material: pane}
  ceiling: {shape: plane, size: [900, 900], rotate_degrees: [180, 0, 0], at: [0, 2, 0], material: glow}
materials:
  pane: {base_color: [1, 0.5, 0.2], transmission: 1, roughness: 0, double_sided: true}
  glow: {base_color: [0, 0, 0], roughness: 1, emissive: [1, 1, 1], clearcoat: COAT}
lights: {none: {type: directional, direction: [0, -1, 0], intensity: 0}}
cameras: {main: {eye: [0, 0.9, 0.01], target: [0, 0, 0], fov_y_degrees: 60, near: 0.1, far: 40}}
"""
    means = {}
    for coat in (0, 1):
        file.write_text(text.replace("COAT", str(coat)))
        found = draw(session, file, *DARK, "gi.samples=256", size=(8, 8), x="gi.indirect")["x"]
        means[coat] = found.mean(axis=(0, 1))
        np.testing.assert_allclose(means[coat] / means[coat][0], [1, 0.5, 0.2], rtol=0.03)
    assert means[0][0] == pytest.approx(0.96, rel=0.02)
    cosine = (np.arange(4096) + 0.5) / 4096  # what a coat of f0 0.04 lets out, cosine-weighted
    assert means[1][0] / means[0][0] == pytest.approx((2 * cosine * 0.96 * (1 - (1 - cosine) ** 5)).mean(), rel=0.02)
