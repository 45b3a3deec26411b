"""Compute nodes without code: what they cover, images by their port's format, buffers that are cleared and read back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

if TYPE_CHECKING:
    import rendergraph as rg

SOURCE = 'color = Output(Radiance, format="r32f", doc="0 and 1 by turns.")'
SOURCE_FRAG = "out float color;\nvoid main() { color = float((int(gl_FragCoord.x) + int(gl_FragCoord.y)) % 2); }\n"
HISTOGRAM = """
source = Input(AnyTexel, doc="What is counted.")
counts = Output(AnyTexel, kind="buffer", bytes=8, clear=0, doc="How many are 0 and how many 1.")
side: int = define(default=8, min=1, max=32, doc="Side of a work group.")
shader = "histogram.comp"
"""
HISTOGRAM_COMP = """layout(local_size_x = SIDE, local_size_y = SIDE) in;
uniform sampler2D source;
layout(std430) buffer counts { uint bins[2]; };
void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(texel, textureSize(source, 0))))
        atomicAdd(bins[texelFetch(source, texel, 0).r > 0.5 ? 1 : 0], 1u);
}
"""
TEXT = """nodes:
  checks: {type: checks}
  count: {type: histogram, inputs: {source: checks.color}}
outputs: {image: checks.color}
"""


@pytest.fixture
def histogram(author: Any) -> Any:
    author.node(SOURCE, "checks")
    author.node(HISTOGRAM, "histogram")
    author.write(checks__frag=SOURCE_FRAG, histogram__comp=HISTOGRAM_COMP)
    return author


@pytest.mark.parametrize("side", [1, 7, 8, 32])
def test_a_histogram_is_a_class_and_a_shader(histogram: Any, gl: rg.Session, side: int) -> None:
    pipeline = histogram.pipeline(TEXT, size="[17, 9]").set("count.side", side)
    frame = gl.render(pipeline, taps=["count.counts"], frames=range(1, 4))
    np.testing.assert_array_equal(frame["count.counts"].view(np.uint32), [77, 76])
    assert frame.info("count.counts").kind == "buffer"


def test_a_step_covers_what_it_reads_where_it_writes_no_texture(histogram: Any) -> None:
    steps = histogram.pipeline(TEXT, size="[17, 9]").expand(taps=["count.counts"]).expansion.steps
    assert [step.invocations for step in steps if step.kind == "compute"] == [(17, 9, 1)]


@pytest.mark.parametrize("ending", ["exr", "npy"])
def test_a_buffer_is_no_picture_on_the_command_line(
    histogram: Any, ending: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from rendergraph.cli.app import main

    histogram.pipeline(TEXT)
    monkeypatch.chdir(histogram.folder)
    assert main(["run", "test.yaml", "--plugin", "plugins", "--tap", f"count.counts=counts.{ending}"]) == 3
    said = capsys.readouterr().err
    assert (
        "RG508 'count.counts' is a buffer, which picture files cannot store; read it in Python as frame['count.counts']"
        in said
    )


@pytest.mark.parametrize(
    "declared",
    [
        "uniform writeonly image2D color;",
        "writeonly uniform image2D color;",
        "layout(rgba16f) uniform writeonly image2D color;",
        "uniform image2D color;",
        "layout(binding = 1) uniform restrict image2D color;",
    ],
)
def test_an_image_takes_the_format_of_its_port(author: Any, gl: rg.Session, declared: str) -> None:
    author.node('shader = "wrong.comp"\ncolor = Output(Radiance, doc="Where it is.")')
    store = "imageStore(color, p, vec4(p, 0.0, 1.0))"
    author.write(
        wrong__comp=f"layout(local_size_x = 8, local_size_y = 4) in;\n{declared}\nvoid main() {{\n"
        f"    ivec2 p = ivec2(gl_GlobalInvocationID.xy);\n    {store};\n}}"
    )
    image = gl.render(author.pipeline(size="[19, 7]"))["image"]
    np.testing.assert_array_equal(image[::-1, :, 0], np.tile(np.arange(19.0), (7, 1)))
    np.testing.assert_array_equal(image[::-1, :, 1], np.tile(np.arange(7.0)[:, None], (1, 19)))


ARRAY = """
layers = Output(Radiance, kind="texture2d_array", layers=3, mips=2, format="r32ui", doc="Which one.")

def record(self, steps):
    steps.compute("wrong.comp", base=10)
    steps.compute("part.comp", over=self.layers.mip(1).at_layer(1), out={"part": self.layers.mip(1).at_layer(1)})
    steps.clear(self.layers.mip(1).at_layer(0))
    steps.clear(self.layers.mip(1).at_layer(2), 5)
"""


def test_layers_are_covered_too_and_parts_are_flat(author: Any, gl: rg.Session) -> None:
    author.node(ARRAY)
    author.write(
        wrong__comp="layout(local_size_x = 4, local_size_y = 4) in;\nuniform writeonly uimage2DArray layers;\n"
        "uniform uint base;\nvoid main() { ivec3 p = ivec3(gl_GlobalInvocationID);\n"
        "    imageStore(layers, p, uvec4(base + uint(p.z))); }",
        part__comp="layout(local_size_x = 4) in;\nuniform writeonly uimage2D part;\n"
        "void main() { imageStore(part, ivec2(gl_GlobalInvocationID.xy), uvec4(7u)); }",
    )
    pipeline = author.pipeline("nodes:\n  a: {type: wrong}\noutputs: {image: a.layers}\n")
    assert [step.invocations for step in pipeline.expand().expansion.steps if step.kind == "compute"] == [
        (16, 8, 3),
        (8, 4, 1),
    ]
    found = gl.render(pipeline).arrays["image"]
    np.testing.assert_array_equal(found[:, 0, 0, 0], [10, 11, 12])
    assert {int(value) for value in np.unique(found)} == {10, 11, 12}


NUMBERS = """
numbers = Output(AnyTexel, kind="buffer", bytes=400, doc="Squares.")

def record(self, steps):
    steps.compute("wrong.comp", over=100, scale=numpy.float32(1.0))
"""


def test_invocations_may_be_counted(author: Any, gl: rg.Session) -> None:
    author.node(NUMBERS)
    author.node(SOURCE, "checks")
    author.write(
        checks__frag=SOURCE_FRAG,
        wrong__comp="layout(local_size_x = 32) in;\nlayout(std430) buffer numbers { float squares[]; };\n"
        "uniform float scale;\nvoid main() { uint i = gl_GlobalInvocationID.x;\n"
        "    if (i < 100u) squares[i] = scale * float(i * i); }",
    )
    pipeline = author.pipeline("nodes:\n  a: {type: wrong}\n  c: {type: checks}\noutputs: {image: c.color}\n")
    frame = gl.render(pipeline, taps=["a.numbers"])
    np.testing.assert_array_equal(frame["a.numbers"].view(np.float32), np.arange(100.0) ** 2)


def test_more_groups_than_the_device_takes(author: Any, gl: rg.Session) -> None:
    author.node(NUMBERS.replace("over=100", "over=10_000_000"))
    author.node(SOURCE, "checks")
    author.write(
        checks__frag=SOURCE_FRAG,
        wrong__comp="layout(local_size_x = 1) in;\nlayout(std430) buffer numbers { float squares[]; };\n"
        "uniform float scale;\nvoid main() { squares[0] = scale; }",
    )
    pipeline = author.pipeline("nodes:\n  a: {type: wrong}\n  c: {type: checks}\noutputs: {image: c.color}\n")
    (said,) = author.said(lambda: gl.render(pipeline, taps=["a.numbers"]))
    most = gl.device.limits["groups_x"]
    assert (
        f"RG435 node 'a' (wrong): wrong.py:{author.line('steps.compute')}: it has 10000000 × 1 × 1 work groups" in said
    )
    assert f"this device supports {most} × " in said


ONE_MORE = """
numbers = InOut(AnyTexel, kind="buffer", bytes=400, doc="Each one larger.")

def record(self, steps):
    steps.compute("more.comp", over=100)
"""


def test_a_buffer_that_another_node_continues_is_seen_as_it_was(author: Any, gl: rg.Session) -> None:
    author.node(NUMBERS)
    author.node(ONE_MORE, "more")
    author.node(SOURCE, "checks")
    author.write(
        checks__frag=SOURCE_FRAG,
        wrong__comp="layout(local_size_x = 100) in;\nlayout(std430) buffer numbers { float squares[]; };\n"
        "uniform float scale;\nvoid main() { squares[gl_GlobalInvocationID.x] = scale; }",
        more__comp="layout(local_size_x = 100) in;\nlayout(std430) buffer numbers { float squares[]; };\n"
        "void main() { squares[gl_GlobalInvocationID.x] += 1.0; }",
    )
    text = (
        "nodes:\n  a: {type: wrong}\n  m: {type: more, inputs: {numbers: a.numbers}}\n  c: {type: checks}\n"
        "outputs: {image: c.color}\n"
    )
    frame = gl.render(author.pipeline(text), taps=["a.numbers", "m.numbers"], frames=range(1, 3))
    assert set(frame["a.numbers"].view(np.float32)) == {1.0}
    assert set(frame["m.numbers"].view(np.float32)) == {2.0}


PING_PONG = """
source = Input(AnyTexel, doc="Where it starts.")
color = Output(Radiance, format="r32f", doc="As often as asked.")
one = Internal(Radiance, format="r32f")
other = Internal(Radiance, format="r32f")
iterations: int = structural(default=4, min=1, max=64, doc="How often.")

def record(self, steps):
    here, there = self.one, self.other
    source = self.source
    for _ in range(self.iterations - 1):
        steps.fullscreen("wrong.frag", source=source, out=here)
        source, here, there = here, there, here
    steps.fullscreen("wrong.frag", source=source, out=self.color)
"""


@pytest.mark.parametrize("iterations", [1, 2, 5, 8])
def test_ping_pong_between_two_internals(author: Any, gl: rg.Session, iterations: int) -> None:
    author.node(SOURCE, "checks")
    author.node(PING_PONG)
    author.write(
        checks__frag="out float color;\nvoid main() { color = 1.0; }",
        wrong__frag="uniform sampler2D source;\nout float next;\n"
        "void main() { next = 2.0 * texelFetch(source, ivec2(gl_FragCoord.xy), 0).r; }",
    )
    text = "nodes:\n  c: {type: checks}\n  a: {type: wrong, inputs: {source: c.color}}\noutputs: {image: a.color}\n"
    pipeline = author.pipeline(text).set("a.iterations", iterations)
    assert gl.render(pipeline).arrays["image"].mean() == 2.0**iterations
    plan = pipeline.plan()
    resources = {name for name in plan.placement if name.startswith("a.")}
    assert resources == {"a.color", "a.one", "a.other"} - ({"a.one", "a.other"} if iterations == 1 else set()) - (
        {"a.other"} if iterations == 2 else set()
    )
    # However many turns: the source, then two textures to go between, one of which may be the source's memory again.
    assert len(plan.physicals) <= 3
    if iterations > 2:
        assert plan.placement["c.color"] == plan.placement["a.other"]


CHAIN = """
source = Input(AnyTexel, filter="linear", doc="Where it starts.")
color = Output(Radiance, format="r32f", doc="The mean everywhere.")
chain = Internal(Radiance, format="r32f", mips=0)

def record(self, steps):
    mips = steps.desc(self.chain).mips
    steps.fullscreen("copy.frag", source=self.source, out=self.chain.mip(0))
    for level in range(1, mips):
        steps.fullscreen("down.frag", source=self.chain.mip(level - 1), out=self.chain.mip(level))
    for level in range(mips - 1, 0, -1):
        steps.fullscreen("copy.frag", source=self.chain.mip(level), out=self.chain.mip(level - 1), scale=2)
    steps.fullscreen("copy.frag", source=self.chain.mip(0), out=self.color)
"""


def test_a_mip_chain_down_and_up_again(author: Any, gl: rg.Session) -> None:
    author.node(SOURCE, "checks")
    author.node(
        CHAIN.replace("out=self.chain.mip(0))", "out=self.chain.mip(0), scale=1)").replace(
            "out=self.color)", "out=self.color, scale=1)"
        )
    )
    author.write(
        checks__frag=SOURCE_FRAG,
        copy__frag="uniform sampler2D source;\nuniform int scale;\nout float made;\n"
        "void main() { made = texelFetch(source, ivec2(gl_FragCoord.xy) / scale, 0).r; }",
        down__frag="uniform sampler2D source;\nout float made;\nvoid main() {\n    ivec2 p = 2 * ivec2(gl_FragCoord.xy);\n"
        "    ivec2 last = textureSize(source, 0) - 1;\n    made = 0.0;\n    for (int i = 0; i < 4; ++i)\n"
        "        made += 0.25 * texelFetch(source, min(p + ivec2(i & 1, i >> 1), last), 0).r;\n}",
    )
    text = (
        "nodes:\n  c: {type: checks}\n  a: {type: wrong, inputs: {source: c.color}}\n"
        "  b: {type: wrong, inputs: {source: a.color}}\noutputs: {image: b.color}\n"
    )
    pipeline = author.pipeline(text)
    np.testing.assert_array_equal(gl.render(pipeline).arrays["image"], np.full((8, 16, 1), 0.5, np.float32))
    plan = pipeline.plan()
    assert plan.placement["a.chain"] == plan.placement["b.chain"]
    assert plan.placement["c.color"] == plan.placement["a.color"]
