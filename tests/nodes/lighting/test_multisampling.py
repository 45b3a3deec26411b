"""Geometry drawn with several samples a pixel: edges, surfaces beside them, masks, and what goes before and after."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.errors import InputError

Floats = npt.NDArray[np.float64]

MASKED = """scene: 1
objects:
  board: {shape: plane, size: [2, 2], rotate_degrees: [90, 0, 17], material: mask}
materials: {mask: {base_color: [1, 1, 1], alpha_mode: mask, unlit: true, base_color_texture: ramp.png}}
cameras: {main: {eye: [0, 0, 5], target: [0, 0, 0], height: 2.2, near: 0.1, far: 10}}
"""


def box_mean(picture: Floats, times: int) -> Floats:
    """Every `times` × `times` pixels as one."""
    height, width, channels = picture.shape
    return np.asarray(picture.reshape(height // times, times, width // times, times, channels).mean(axis=(1, 3)))


def shown(session: rg.Session, pipeline: rg.Pipeline, name: str = "image") -> Floats:
    found = session.render(pipeline, outputs=[name])[name]
    return np.asarray(found, np.float64) / (255 if found.dtype == np.uint8 else 1)


def linear(display: Floats) -> Floats:
    c = display[..., :3]
    return np.asarray(np.where(c > 0.04045, ((c + 0.055) / 1.055) ** 2.4, c / 12.92))


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("sets", [(), ("light.type=forward_multipass",)])
def test_edges_come_near_those_of_a_picture_four_times_as_large(session: rg.Session, sets: tuple[str, ...]) -> None:
    pipeline = rg.load("forward", scene="shadow_study", sets=[*sets, "sun.resolution=256"])
    large = box_mean(linear(shown(session, pipeline.with_size((384, 224)))), 4)
    one = linear(shown(session, pipeline.with_size((96, 56))))
    four = linear(shown(session, pipeline.with_size((96, 56)).set("light.samples", 4)))
    off = [float(np.sqrt(((picture - large) ** 2).mean())) for picture in (one, four)]
    assert off[1] < 0.6 * off[0]


def test_a_mask_is_cut_sample_by_sample(session: rg.Session, tmp_path: Path) -> None:
    """Alpha rises evenly from left to right of a square, so that the cut at 0.5 is a straight line across it."""
    iio = pytest.importorskip("OpenImageIO")
    ramp = np.full((4, 256, 4), 255, np.uint8)
    ramp[..., 3] = np.arange(256)
    spec = iio.ImageSpec(256, 4, 4, "uint8")
    out = iio.ImageOutput.create(str(tmp_path / "ramp.png"))
    out.open(str(tmp_path / "ramp.png"), spec)
    out.write_image(ramp)
    out.close()
    (tmp_path / "scene.yaml").write_text(MASKED)
    pipeline = rg.load("forward", scene=tmp_path / "scene.yaml", size=(64, 64))
    pipeline = pipeline.set("display.curve", "none").set("display.dither", False).set("light.environment", "null")
    exact = box_mean(linear(shown(session, pipeline.with_size((1024, 1024)))), 16)
    cut = np.s_[20:44, 26:38]  # the line of the cut, away from the square's own edges
    hard = linear(shown(session, pipeline))[cut]
    for first in ([], ["prepass"]):
        four = pipeline.set("light.samples", 4)
        if first:
            four = four.patch({"nodes": {"prepass": {"type": "depth_prepass", "params": {"samples": 4}}}})
            four = four.set("light.depth", "prepass.depth")
        picture = linear(shown(session, four))[cut]
        assert {0.25, 0.5, 0.75} <= set(np.round(picture[..., 0], 2).ravel())
        assert ((picture - exact[cut]) ** 2).mean() < 0.45 * ((hard - exact[cut]) ** 2).mean()
        assert abs(float((picture - exact[cut]).mean())) < 0.02


def test_what_is_tested_against_a_pre_pass_has_its_samples(session: rg.Session) -> None:
    """Or says that it has others; the picture is that without a pre-pass, but where part of a pixel is hidden: a driver may
    take the centroid of what is left of it.
    """
    sets = ["display.curve=none", "sun.resolution=64"]
    behind = {
        "prepass": {"type": "depth_prepass", "params": {"samples": 4}},
        "light": {"inputs": {"depth": "prepass.depth"}},
    }
    forward = rg.load("forward", scene="spheres", sets=sets, size=(48, 32))
    pipeline = forward.patch({"nodes": behind})
    differ = (shown(session, pipeline) != shown(session, forward.set("light.samples", 4))).any(axis=-1)
    assert differ.mean() < 0.01
    with pytest.raises(InputError, match=r"RG425 .* 2 samples per texel, but 'prepass.depth' is 4 samples per texel"):
        pipeline.set("light.samples", 2).check()


def test_one_sample_is_taken_by_what_reads_a_pixel(session: rg.Session) -> None:
    pipeline = rg.load("forward-prepass", sets=["prepass.samples=4"], size=(48, 32))
    said = r"RG214 'shadows.depth' expects one sample per texel, .* has 4 samples per texel; 'one_sample' between them"
    with pytest.raises(InputError, match=said):
        pipeline.check()
    one = {
        "one": {"type": "one_sample", "inputs": {"source": "prepass.depth"}},
        "shadows": {"inputs": {"depth": "one.chosen"}},
    }
    assert shown(session, pipeline.patch({"nodes": one})).mean() > 0.01


@pytest.mark.nightly
def test_memory_is_shared_poisoned_and_shuffled_without_a_trace(session: rg.Session) -> None:
    nodes = {
        "prepass": {"type": "depth_prepass", "params": {"samples": 4}},
        "light": {"inputs": {"depth": "prepass.depth"}},
        "one": {"type": "resolve", "inputs": {"source": "light.radiance"}, "params": {"average": "plain"}},
        "bloom": {"type": "bloom", "inputs": {"radiance": "one.radiance"}},
        "display": {"inputs": {"radiance": "bloom.radiance"}},
    }
    patch = {"nodes": nodes, "outputs": {"radiance": "bloom.radiance"}}
    pipeline = rg.load("forward", scene="glass", size=(48, 32), patches=[patch])
    plain = session.render(pipeline, alias=False)["radiance"]
    assert np.isfinite(plain).all()
    for options in ({"poison": True}, {"poison": True, "shuffle": 3}):
        np.testing.assert_array_equal(session.render(pipeline, **options)["radiance"], plain)
