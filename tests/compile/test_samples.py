"""Several samples a texel: where they are, what follows them, what averages them, what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.api import Any as AnyTexel
from rendergraph.api import (
    Depth,
    InOut,
    Input,
    Internal,
    Node,
    Normal,
    Output,
    Radiance,
    Steps,
    structural,
)
from rendergraph.errors import InputError
from rendergraph.link import Endpoint

SHADERS = {
    "half.vert": """uniform vec3 edge;  // the half-plane where dot(edge.xy, place) > edge.z, place from 0 to the size
uniform vec2 size;
void main() {
    vec2 along = vec2(-edge.y, edge.x) * 1e3, within = edge.xy * 1e3, start = edge.xy * edge.z;
    vec2 place = start + (gl_VertexID == 0 ? -along : gl_VertexID == 1 ? along : within);
    gl_Position = vec4(place / size * 2.0 - 1.0, 0.0, 1.0);
}""",
    "one.frag": "out float color; void main() { color = 1.0; }",
    "where.frag": """uniform sampler2DMS shape;
out vec4 places;
void main() {
    int i = int(gl_FragCoord.x);
    places = i < SHAPE_SAMPLES ? vec4(SHAPE_SAMPLE_POSITIONS[i], SHAPE_SAMPLES, PASS_SAMPLES) : vec4(0.0);
}""",
    "count.frag": """uniform sampler2DMS shape;
out float count;
void main() {
    count = 0.0;
    for (int i = 0; i < SHAPE_SAMPLES; ++i) count += texelFetch(shape, ivec2(gl_FragCoord.xy), i).r;
}""",
}
SIZE = (16, 8)


class Shape(Node):
    """A half-plane of ones, drawn with samples."""

    color = Output(AnyTexel, format="r32f", samples=lambda node, facts: node.samples, clear=0.0, doc="1 inside.")

    samples: int = structural(default=4, min=1, max=16, doc="Samples a texel.")
    edge: ClassVar[tuple[float, float, float]] = (0.6, 0.8, 7.3)

    def record(self, steps: Steps) -> None:
        steps.draw("one.frag", vertex="half.vert", vertices=3, out={"color": self.color}, edge=self.edge, size=SIZE)


class Where(Node):
    """Where the samples of its input are, one a column; and how many of them are ones."""

    shape = Input(AnyTexel, samples="multi", doc="Samples.")
    places = Output(AnyTexel, format="rgba32f", doc="Places.")
    count = Output(AnyTexel, format="r32f", doc="How many.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("where.frag", shape=self.shape, out=self.places)
        steps.fullscreen("count.frag", shape=self.shape, out={"count": self.count})


class Average(Node):
    """The device's mean."""

    shape = Input(AnyTexel, samples="multi", doc="Samples.")
    mean = Output(like="shape", samples=1, doc="Their mean.")

    def record(self, steps: Steps) -> None:
        steps.resolve(self.shape, self.mean)


TEXT = """nodes:
  s: {{type: shape, params: {{samples: {0}}}}}
  w: {{type: where, inputs: {{shape: s.color}}}}
  m: {{type: average, inputs: {{shape: s.color}}}}
outputs: {{places: w.places, count: w.count, mean: m.mean}}"""


@pytest.mark.parametrize("samples", [2, 4, 8, 16])
def test_a_half_plane_covers_the_samples_that_lie_in_it(bench: Any, samples: int) -> None:
    """The places that the shader is told are those where the rasteriser looks, and `resolve` counts each once."""
    if samples > bench.session.device.limits["samples"]:
        pytest.skip("this device has not so many")
    frame = bench.draw(TEXT.format(samples), Shape, Where, Average, shaders=SHADERS, size=SIZE)
    places = frame["places"][0, :samples]
    assert (places[:, 2:] == (samples, 1)).all()
    assert len(np.unique(places[:, :2], axis=0)) == samples
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]]
    at = np.stack([x, SIZE[1] - 1 - y], axis=-1)[:, :, None] + places[:, :2].astype(np.float64)
    inside = at @ np.array(Shape.edge[:2]) - Shape.edge[2]
    assert np.abs(inside).min() > 1e-4, "no sample lies on the edge, where the rasteriser may decide either way"
    right = (inside > 0).sum(axis=-1)
    np.testing.assert_array_equal(frame.arrays["count"][..., 0], right)
    # A driver may keep more samples than it is asked for (OpenGL 4.5, 8.8), and then takes the mean of all.
    if samples == bench.session.device.limits["samples"]:
        np.testing.assert_allclose(frame.arrays["mean"][..., 0], right / samples, atol=1e-6)
    assert len(np.unique(right)) > 2


class Surfaces(Node):
    """Depth and colour with samples."""

    depth = Output(Depth, format="depth32f", samples=4, clear=0.0, doc="Depth.")
    color = Output(Radiance, samples=4, clear=0.0, doc="Colour.")
    normal = Output(Normal, samples=4, clear=0.0, doc="Normal.")
    number = Output(AnyTexel, format="r32ui", samples=4, clear=0, doc="Number.")

    def record(self, steps: Steps) -> None:
        for port in (self.depth, self.color, self.normal, self.number):
            steps.clear(port, 0.5)


class Follows(Node):
    """What says nothing of samples."""

    source = Input(Radiance, samples="multi", doc="Samples.")
    tested = Input(Depth, use="depth_test", doc="Attached.")
    continued = InOut(Radiance, doc="Continued.")
    alike = Output(like="source", clear=0.0, doc="Like what is read.")
    beside = Output(Radiance, clear=0.0, doc="Beside the depth.")
    smaller = Output(Radiance, size=0.5, clear=0.0, doc="Of another size.")
    levels = Output(like="source", mips=3, clear=0.0, doc="With mips.")
    said = Output(Radiance, samples=2, clear=0.0, doc="Says two.")

    def record(self, steps: Steps) -> None:
        for port in (self.alike, self.smaller, self.levels, self.said):
            steps.clear(port)
        steps.fullscreen("white.frag", tested=self.tested, out={"radiance": self.continued, "beside": self.beside})


def test_samples_follow_what_is_read_and_what_is_attached(bench: Any) -> None:
    text = """nodes:
  s: {type: surfaces}
  f: {type: follows, inputs: {source: s.color, tested: s.depth, continued: s.color}}
outputs: {image: f.continued}"""
    shaders = {"white.frag": "out vec4 radiance, beside; void main() { radiance = beside = vec4(PASS_SAMPLES); }"}
    pipeline = bench.pipeline(text, Surfaces, Follows, shaders=shaders, scene="objects: {}")
    textures = pipeline.link().graph.textures
    found = {name: textures[Endpoint("f", name)].desc for name in Follows.outputs()}
    samples = {name: desc.samples for name, desc in found.items() if desc is not None}
    assert samples == {"continued": 4, "alike": 4, "beside": 4, "smaller": 1, "levels": 1, "said": 2}
    one = textures[Endpoint("s", "color")].desc
    assert one is not None
    assert one.bytes == 4 * 8 * 16 * 8, "bytes of a plan count every sample"
    assert (bench.session.render(pipeline)["image"] == 4).all()


RESOLVES = {
    "depth": ("depth", "depth32f", Depth, r"'source' has values that cannot be averaged; choose a sample in a shader"),
    "normal": ("normal", None, Normal, r"'source' has values that cannot be averaged"),
    "number": ("number", None, AnyTexel, r"'source' has values that cannot be averaged"),
    "color": ("color", "rgba32f", Radiance, r"'made' does not match 'source'; declare it like that input"),
}


@pytest.mark.parametrize("name", RESOLVES)
def test_what_has_no_mean_is_not_resolved(bench: Any, name: str) -> None:
    port, format, semantic, said = RESOLVES[name]

    class Wrong(Node):
        """Resolves it all the same."""

        source = Input(semantic, samples="multi", doc="Samples.")
        made = Output(like="source", format=format, samples=1, doc="One.")

        def record(self, steps: Steps) -> None:
            steps.resolve(self.source, self.made)

    text = f"nodes: {{s: {{type: surfaces}}, w: {{type: wrong, inputs: {{source: s.{port}}}}}}}\noutputs: {{o: w.made}}"
    with pytest.raises(InputError, match="RG423.*" + said):
        bench.pipeline(text, Surfaces, Wrong).check()


def test_one_sample_needs_no_resolve(bench: Any) -> None:
    class Again(Node):
        """Resolves what has one sample."""

        plain = Internal(Radiance, clear=0.0)
        made = Output(Radiance, doc="One.")

        def record(self, steps: Steps) -> None:
            steps.clear(self.plain)
            steps.resolve(self.plain, self.made)

    with pytest.raises(InputError, match=r"source is 'plain', which has one sample per texel, so there is nothing to"):
        bench.pipeline("nodes: {a: {type: again}}\noutputs: {o: a.made}", Again).check()


def test_more_samples_than_there_are_is_the_files_mistake(gl: rg.Session, tmp_path: Path) -> None:
    most = gl.device.limits["samples"]
    if most >= 16:
        pytest.skip("this device has all that can be asked for")
    pipeline = rg.load("forward", sets=["light.samples=16"], size=(16, 16))
    pipeline.check()  # another device may have them
    with pytest.raises(InputError, match=rf"'light\.radiance' has 16 samples per texel, .* device's {most}") as caught:
        gl.render(pipeline)
    assert {problem.code for problem in caught.value.problems} == {"RG435"}
    assert all(problem.place is not None for problem in caught.value.problems)


class Drawn(Node):
    """The scene with four samples: where surfaces are shaded, where the middle of the pixel is, how they lie."""

    where = Output(AnyTexel, format="rgba32f", samples=4, clear=-9.0, doc="Position for shading.")
    middle = Output(AnyTexel, format="rgba32f", samples=4, clear=-9.0, doc="Position in the pixel's middle.")
    lies = Output(AnyTexel, format="rgba32f", samples=4, clear=-9.0, doc="Geometric normal.")

    def record(self, steps: Steps) -> None:
        steps.geometry("drawn.frag", out={"where": self.where, "middle": self.middle, "lies": self.lies})


class Spread(Node):
    """Four samples side by side."""

    many = Input(AnyTexel, samples="multi", size="any", doc="Samples.")
    spread = Output(AnyTexel, format="rgba32f", size=(128, 32), doc="As texels.")


def test_surfaces_are_shaded_where_they_are_and_lie_as_their_triangle(bench: Any, tmp_path: Path) -> None:
    """A sliver of a triangle covers samples of pixels whose middle is outside of it, where colours would run on."""
    shaders = {
        "drawn.frag": """#include <pass_view.glsl>
#include <fragment_surface.glsl>
out vec4 where, middle, lies;
void main() {
    Surface s = fragment_surface(PASS_VIEW);
    where = vec4(s.position, 1.0);
    middle = vec4(v_position, 1.0);
    lies = vec4(s.geometric_normal, 1.0);
}""",
        "spread.frag": """uniform sampler2DMS many; out vec4 spread;
void main() { ivec2 p = ivec2(gl_FragCoord.xy); spread = texelFetch(many, ivec2(p.x / 4, p.y), p.x % 4); }""",
    }
    corners = np.array([[-0.9, -0.8, 0.3], [0.9, 0.1, -0.2], [-0.7, -0.55, 0.0]])
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["f 1 2 3"]
    (tmp_path / "thin.obj").write_text("\n".join(lines))
    scene = "objects: {thin: {file: thin.obj}}\ncameras: {main: {eye: [0.2, 0.3, 1.6], target: [0, 0, 0]}}"
    text = "nodes:\n  d: {type: drawn}\n"
    names = ("where", "middle", "lies")
    text += "".join(f"  {name}: {{type: spread, inputs: {{many: d.{name}}}}}\n" for name in names)
    text += "outputs: {" + ", ".join(f"{name}: {name}.spread" for name in names) + "}"
    frame = bench.draw(text, Drawn, Spread, shaders=shaders, scene=scene, size=(32, 32))
    covered = frame["where"][..., 3] == 1
    assert 50 < covered.sum() < 1000

    def outside(points: Any) -> Any:
        """How far, in barycentric coordinates of the triangle's plane, a point lies outside of the triangle."""
        sides = np.stack([corners[1] - corners[0], corners[2] - corners[0]], axis=1)
        along = np.linalg.lstsq(sides, (points[:, :3] - corners[0]).T.astype(np.float64))[0]
        return -np.minimum(along.min(axis=0), 1 - along.sum(axis=0))

    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    assert np.abs((frame["where"][covered][:, :3] - corners[0]) @ normal).max() < 1e-5
    assert outside(frame["where"][covered]).max() < 1e-3
    assert outside(frame["middle"][covered]).max() > 0.03, "some middles lie outside, or this asks nothing"
    np.testing.assert_allclose(np.abs(frame["lies"][covered][:, :3] @ normal), 1, atol=1e-5)
