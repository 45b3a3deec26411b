"""Several moments a frame: the mean of their light, of every pipeline, and one step of history a frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.errors import UsageError

SCENE = """scene: 1
objects:
  wall: {shape: box, size: [40, 40, 1], at: [0, 0, -3], material: grey}
  ball: {shape: sphere, radius: 0.7, at: [-1.5, 0, 0], material: white}
materials:
  grey: {base_color: [0.1, 0.12, 0.1]}
  white: {base_color: [1, 0.9, 0.8], emissive: [3, 3, 3]}
lights: {sun: {type: directional, direction: [-1, -2, -1]}}
cameras: {main: {eye: [0, 0, 6], target: [0, 0, 0], fov_y_degrees: 40, shutter: 0.5}}
keyframes: {objects.ball.at: {0: [-1.5, 0, 0], 0.2: [1.5, 0, 0]}}
"""
SIZE = (64, 36)
SHOWN = """/*---
doc: Colours that no light is behind.
inputs: {depth: {semantic: depth, doc: Of the nearest surfaces.}}
outputs: {color: {semantic: display_color, format: rgba8, doc: White where something is near.}}
---*/
uniform sampler2D depth;
out vec4 color;
void main() { color = vec4(vec3(linear_depth(camera, texelFetch(depth, ivec2(gl_FragCoord.xy), 0).r) < 7.0), 1.0); }
"""
NOISE = """/*---
doc: A number for each frame.
inputs: {depth: {semantic: depth, doc: Is not looked at for its value.}}
outputs: {color: {semantic: radiance, format: rgba32f, doc: Grey.}}
---*/
#include <frame.glsl>
uniform sampler2D depth;
out vec4 color;
void main() { color = vec4(float(frame_index * 37 & 63) / 64.0 + 0.0 * texelFetch(depth, ivec2(0), 0).r); }
"""
COLORS = """rendergraph: 1
nodes:
  prepass: {type: depth_prepass}
  show: {type: ./shown.frag, inputs: {depth: prepass.depth}}
outputs: {image: show.color}
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / "scene.yaml").write_text(SCENE)
    return tmp_path / "scene.yaml"


def at_moments(gl: rg.Session, pipeline: rg.Pipeline, times: Any, fps: float = 3840.0) -> list[Any]:
    """The radiance at some times, each as a frame of its own in a film of many frames a second."""
    frames = [round(time * fps) + 1 for time in times]
    return [gl.render(pipeline, frames=range(n, n + 1), fps=fps, outputs=["radiance"])["radiance"] for n in frames]


def test_a_frame_is_the_mean_of_its_moments(gl: rg.Session, scene: Path) -> None:
    """Moments of the open shutter, centred on the frame's own, averaged before tone mapping."""
    pipeline = rg.load("forward", scene=scene, size=SIZE)
    frame = gl.render(pipeline, frames=range(4, 5), subframes=4)
    offsets = (np.array([0.5, 1.5, 2.5, 3.5]) / 4 - 0.5) * 0.5 / 30
    each = at_moments(gl, pipeline, 3 / 30 + offsets)
    np.testing.assert_allclose(frame["radiance"], np.mean(each, axis=0), rtol=1e-3, atol=1e-4)
    assert np.ptp(each, axis=0).max() > 1
    # The display shows the mean of light; that of bytes is darker at the bright edge.
    once = gl.render(pipeline.set("display.curve", "none"), frames=range(4, 5), subframes=4)
    light = np.clip(once["radiance"][..., :3].astype(np.float64), 0, 1)
    shown = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055) * 255
    assert np.abs(once["image"][..., :3] - shown).max() < 1.5


@pytest.mark.slow
@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("name", ["forward-msaa", "taa", "hdr", "shown", "bloom", "forward-transparent"])
def test_every_pipeline_takes_them(gl: rg.Session, scene: Path, name: str) -> None:
    """A ball that moves is blurred in the picture of the display, whatever it is made from."""
    (scene.parent / "shown.frag").write_text(SHOWN)
    (scene.parent / "shown.yaml").write_text(COLORS)
    pipeline = rg.load(scene.parent / "shown.yaml" if name == "shown" else name, scene=scene, size=SIZE)
    options: dict[str, Any] = {"frames": range(4, 5), "outputs": ["image"]}
    one, many = (gl.render(pipeline, **options, subframes=count)["image"][..., :3].astype(int) for count in (1, 16))
    changed = np.abs(many - one).max(axis=-1) > 8
    rows, columns = np.nonzero(changed)
    assert 15 < len(rows) < 200
    assert columns.max() - columns.min() < 30  # around the ball, and nowhere else
    again = gl.render(pipeline, **options)["image"][..., :3]
    np.testing.assert_array_equal(again, one)  # the means are forgotten


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("name", ["forward", "full"])
def test_what_stands_still_is_the_single_picture(gl: rg.Session, name: str) -> None:
    pipeline = rg.load(name, scene="cornell_box", size=SIZE, sets=[]).select(shutter=0.5)
    options: dict[str, Any] = {"frames": range(2, 3), "outputs": ["image", "radiance"]}
    one, many = gl.render(pipeline, **options), gl.render(pipeline, **options, subframes=8)
    for output in options["outputs"]:
        np.testing.assert_array_equal(many[output], one[output])


def test_a_point_that_does_not_move_has_the_same_light(gl: rg.Session, scene: Path) -> None:
    pipeline = rg.load("forward", scene=scene, size=SIZE)
    one, many = (gl.render(pipeline, frames=range(4, 5), subframes=n)["radiance"] for n in (1, 7))
    np.testing.assert_array_equal(many[:, 50:], one[:, 50:])
    assert (many != one).any()


def test_noise_differs_from_moment_to_moment(gl: rg.Session, scene: Path) -> None:
    """Each moment has a number of its own for what is random; the last one has the frame's."""
    (scene.parent / "noise.frag").write_text(NOISE)
    (scene.parent / "noise.yaml").write_text(
        COLORS.replace("./shown.frag", "./noise.frag").replace("image", "radiance")
    )
    pipeline = rg.load(scene.parent / "noise.yaml", scene=scene, size=SIZE)
    found = [gl.render(pipeline, frames=range(4, 5), subframes=n)["radiance"][0, 0, 0] for n in (1, 4)]
    moments = 4 + 100_003 * np.arange(4)
    np.testing.assert_allclose(found, [(4 * 37 & 63) / 64, (moments * 37 & 63).mean() / 64])


def test_histories_advance_once_a_frame(gl: rg.Session, scene: Path) -> None:
    """As many frames are counted by what accumulates them as there are."""
    pipeline = rg.load("taa", scene=scene, size=SIZE)
    frames = list(gl.frames(pipeline, frames=range(1, 4), subframes=4, taps=["aa.history"]))
    assert [float(frame["aa.history"][-1, -1, 3]) for frame in frames] == [1, 2, 3]


def test_the_picture_is_jittered_once_a_frame(gl: rg.Session, scene: Path) -> None:
    """What stands still is where it is without moments, in every frame."""
    post = "  post: {shape: box, size: [0.3, 4, 0.3], at: [2.2, 0, -1], rotate_degrees: [0, 0, 25], material: grey}\n"
    scene.write_text(SCENE.replace("  ball:", post + "  ball:"))
    pipeline = rg.load("taa", scene=scene, size=SIZE)
    one, many = (
        [frame.arrays["gbuffer.depth"][:, 44:] for frame in gl.frames(pipeline, **options, taps=["gbuffer.depth"])]
        for options in ({"frames": range(1, 4)}, {"frames": range(1, 4), "subframes": 3})
    )
    assert (one[2] != one[1]).any()
    np.testing.assert_array_equal(many, one)


def test_a_picture_of_moments_can_be_rendered_again(gl: rg.Session, scene: Path) -> None:
    pipeline = rg.load("forward", scene=scene, size=SIZE, shutter=0.9)
    frame = gl.render(pipeline, frames=range(4, 5), subframes=3)
    frame.save(scene.parent / "mean.png")
    again = gl.render(rg.load(scene.parent / "mean.png", asset_roots=[scene.parent]))
    np.testing.assert_array_equal(again["image"], frame["image"])


def test_bad_numbers(scene: Path) -> None:
    with pytest.raises(UsageError, match="subframes: expected a number from 1 to 4096, got 0"):
        rg.load("forward", scene=scene).expand(subframes=0)
    with pytest.raises(UsageError, match=r"shutter: expected a fraction of a frame, 0 to 1, got 1\.5"):
        rg.load("forward", scene=scene).select(shutter=1.5)
