"""Feeding a fixed picture to the nodes that work on radiance."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import pytest
from rendergraph.nodes.display.bloom import Bloom
from rendergraph.nodes.display.exposure import Exposure
from rendergraph.nodes.display.gaussian_blur import GaussianBlur
from rendergraph.nodes.display.one_sample import OneSample
from rendergraph.nodes.display.resolve import Resolve
from rendergraph.nodes.display.smaa import SMAA
from rendergraph.nodes.display.tonemap import Tonemap

import rendergraph as rg
from rendergraph.api import Any as AnyTexel
from rendergraph.api import Depth, DisplayColor, Facts, Frame, Input, Internal, Node, Output, Radiance, Steps, define
from rendergraph.catalog import Catalog
from rendergraph.images import read
from rendergraph.resources import folder

Floats = npt.NDArray[Any]
Draw = Callable[..., rg.Frame]


class Picture(Node):
    """The test's picture: `given` of the frame's number, shape (height, width, 4), top row first."""

    given: ClassVar[Callable[[int], Floats]]
    radiance = Output(Radiance, format="rgba32f", doc="The picture.")
    texels = Internal(AnyTexel, kind="buffer", bytes=lambda node, facts: node.bytes(facts))

    def bytes(self, facts: Facts) -> int:
        return 16 * facts.viewport[0] * facts.viewport[1]

    def record(self, steps: Steps) -> None:
        steps.fullscreen("picture.frag", texels=self.texels, out=self.radiance, width=steps.facts.viewport[0])

    def update(self, frame: Frame) -> None:
        frame.write(self.texels, type(self).given(frame.index)[::-1].astype(np.float32))


class Sampled(Node):
    """The picture with four samples a texel, each with a factor of its own; their depths are 0.1 to 0.4."""

    factors: ClassVar = (0.125, 1.0, 7.0, 40.0)
    source = Input(Radiance, doc="The picture.")
    radiance = Output(Radiance, format="rgba32f", samples=4, doc="Its samples.")
    numbers = Output(AnyTexel, format="r32ui", samples=4, doc="Theirs.")
    depth = Output(Depth, format="depth32f", samples=4, doc="As far.")


class FloatTonemap(Tonemap):
    """The same, written as floats."""

    shader: ClassVar[str | None] = "tonemap.frag"
    color = Output(DisplayColor, format="rgba32f", doc="Display-referred colour.")
    dither: bool = define(default=False, doc="Not on floats.")


SHOW = """layout(std430) readonly buffer texels { vec4 given[]; };
uniform int width;
out vec4 radiance;
void main() { radiance = given[int(gl_FragCoord.y) * width + int(gl_FragCoord.x)]; }
"""
SAMPLED = """uniform sampler2D source;
out vec4 radiance;
out uint numbers;
void main() {
    float factor = float[](0.125, 1.0, 7.0, 40.0)[gl_SampleID];
    radiance = texelFetch(source, ivec2(gl_FragCoord.xy), 0) * vec4(vec3(factor), 1.0);
    numbers = uint(gl_SampleID);
    gl_FragDepth = 0.1 * float(gl_SampleID + 1);
}
"""
NODES = (Picture, Sampled, OneSample, Resolve, FloatTonemap, Tonemap, Exposure, GaussianBlur, Bloom, SMAA)


@pytest.fixture
def draw(frames: Callable[..., list[rg.Frame]]) -> Draw:
    """As `frames`, and gives the last one."""
    return lambda *given, **options: frames(*given, **options)[-1]


@pytest.fixture
def frames(tmp_path: Path, session: rg.Session) -> Callable[..., list[rg.Frame]]:
    """`frames(picture, text)`: every frame of the nodes of `text`, which read `picture.radiance`.

    The picture is an array (height, width, 1, 3 or 4 channels; alpha 1 where missing), or a function of the frame.
    """
    shutil.copytree(folder("rendergraph.shaders") / "display", tmp_path / "shaders")
    (tmp_path / "shaders/picture.frag").write_text(SHOW)
    (tmp_path / "shaders/sampled.frag").write_text(SAMPLED)
    catalog = Catalog.of(*NODES, shaders=tmp_path / "shaders")
    for name in ("bright_pass", "fxaa"):
        catalog = catalog.with_file(name, tmp_path / "shaders" / f"{name}.frag")

    def run(picture: Floats | Callable[[int], Floats], text: str, **options: Any) -> list[rg.Frame]:
        moving = picture if callable(picture) else lambda _frame: picture
        Picture.given = staticmethod(lambda frame: with_alpha(moving(frame)))
        height, width = with_alpha(moving(1)).shape[:2]
        (tmp_path / "test.yaml").write_text(
            f"rendergraph: 1\nsize: [{width}, {height}]\nnodes:\n  picture: {{type: picture}}\n{text}\n"
        )
        pipeline = replace(rg.load(tmp_path / "test.yaml"), catalog=catalog)
        frames = list(session.frames(pipeline, **options))
        with session.current():
            assert session.device.raw.error() is None
        return frames

    return run


def with_alpha(picture: Floats) -> Floats:
    channels = picture.shape[-1]
    if channels == 4:
        return picture
    color = np.repeat(picture, 3, axis=-1) if channels == 1 else picture
    return np.concatenate([color, np.ones((*picture.shape[:-1], 1), picture.dtype)], axis=-1)


@pytest.fixture(scope="session")
def reference(shared: Path) -> dict[str, Floats]:
    """The reference picture as `picture`, and what was computed from it."""
    folder = shared / "reference/b7_post"
    return dict(np.load(folder / "image_96x64.npz")) | {"picture": read(folder / "image_96x64.exr")[..., :3]}


@pytest.fixture
def noise() -> Callable[..., Floats]:
    """`noise(width, height)`: a picture of wide dynamic range with black pixels, shape (height, width, 3)."""

    def make(width: int, height: int, seed: int = 1) -> Floats:
        rng = np.random.default_rng(seed)
        picture = np.exp(rng.normal(-1, 2, (height, width, 3)))
        picture[rng.random((height, width)) < 0.1] = 0
        return picture.astype(np.float32)

    return make
