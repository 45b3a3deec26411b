"""What shows in a step's program text without GL: samplers of the wrong type, files that are not there."""

from __future__ import annotations

from typing import Any

import pytest

from rendergraph.api import ADD, Depth, InOut, Input, Internal, Node, Output, Radiance, State, Steps, structural
from rendergraph.api import Any as AnyTexel
from rendergraph.errors import InputError
from rendergraph.program import used_blocks


class Maker(Node):
    """Textures of every kind."""

    plain = Output(Radiance, clear=0.0, doc="2D.")
    whole = Output(AnyTexel, format="r32ui", clear=0.0, doc="Whole numbers.")
    layered = Output(AnyTexel, kind="texture2d_array", layers=2, clear=0.0, doc="Layers.")
    cube = Output(AnyTexel, kind="texture_cube", size=(8, 8), clear=0.0, doc="Cube.")
    many = Output(AnyTexel, samples=4, clear=0.0, doc="Samples.")
    depth = Output(Depth, format="depth32f", clear=0.0, doc="Depth.")

    def record(self, steps: Steps) -> None:
        for port in (self.plain, self.whole, self.layered, self.cube, self.many, self.depth):
            steps.clear(port, 0.0)


class Reader(Node):
    """One of them, read."""

    plain = Input(AnyTexel, optional=True, doc="2D.")
    layered = Input(AnyTexel, kind="texture2d_array", optional=True, doc="Layers.")
    cube = Input(AnyTexel, kind="texture_cube", size="any", optional=True, doc="Cube.")
    many = Input(AnyTexel, samples="multi", optional=True, doc="Samples.")
    compared = Input(Depth, compare=True, optional=True, doc="Depth.")
    color = Output(Radiance, doc="Picture.")


SAMPLERS = [
    ("plain", "m.plain", "sampler2D", "texture2d of rgba16f"),
    ("plain", "m.whole", "usampler2D", "texture2d of r32ui"),
    ("plain", "m.depth", "sampler2D", "texture2d of depth32f"),
    ("layered", "m.layered", "sampler2DArray", "texture2d_array of rgba16f"),
    ("cube", "m.cube", "samplerCube", "texture_cube of rgba16f"),
    ("many", "m.many", "sampler2DMS", "texture2d of rgba16f with 4 samples"),
    ("compared", "m.depth", "sampler2DShadow", "texture2d of depth32f"),
]
CALLS = {
    "sampler2D": "texelFetch({}, ivec2(0), 0)",
    "usampler2D": "vec4(texelFetch({}, ivec2(0), 0))",
    "isampler2D": "vec4(texelFetch({}, ivec2(0), 0))",
    "sampler2DArray": "texelFetch({}, ivec3(0), 0)",
    "samplerCube": "texture({}, vec3(1.0))",
    "sampler2DMS": "texelFetch({}, ivec2(0), 0)",
    "sampler2DShadow": "vec4(texture({}, vec3(0.5)))",
}


def pipeline(bench: Any, port: str, source: str, kind: str) -> Any:
    text = f"nodes:\n  m: {{type: maker}}\n  r: {{type: reader, inputs: {{{port}: {source}}}}}\noutputs: {{image: r.color}}"
    shader = f"uniform {kind} {port};\nout vec4 color;\nvoid main() {{ color = {CALLS[kind].format(port)}; }}\n"
    return bench.pipeline(text, Maker, Reader, shaders={"reader.frag": shader})


@pytest.mark.parametrize(("port", "source", "right", "what"), SAMPLERS, ids=[row[1] + row[2] for row in SAMPLERS])
def test_a_sampler_fits_its_texture(bench: Any, port: str, source: str, right: str, what: str) -> None:
    made = pipeline(bench, port, source, right)
    made.check()
    bench.session.render(made)
    for declared in CALLS.keys() - {right, right.replace("MS", "")}:
        how = ", read with `compare`," if port == "compared" else ""
        said = (
            rf"reader\.frag:1:{10 + len(declared)}: RG447 node 'r' \(reader\): '{port}' is declared as {declared}, "
            rf"but '{source}'{how} is a {what}; declare it as {right}"
        )
        with pytest.raises(InputError, match=said):
            pipeline(bench, port, source, declared).check()
        with pytest.raises(InputError, match=said):
            bench.session.render(pipeline(bench, port, source, declared))


def test_a_branch_may_declare_another_type(bench: Any) -> None:
    shader = """#ifdef HAS_LAYERED
uniform sampler2DArray flat_one;
#else
uniform sampler2D flat_one, other;
#endif
out vec4 color;
void main() { color = texelFetch(flat_one, ivec2(0), 0); }
"""

    class Scratch(Node):
        """Reads its own."""

        flat_one = Internal(Radiance)
        color = Output(Radiance, doc="Picture.")

        def record(self, steps: Steps) -> None:
            steps.clear(self.flat_one)
            steps.fullscreen("scratch.frag", flat_one=self.flat_one, out=self.color)

    text = "nodes: {a: {type: scratch}}\noutputs: {image: a.color}"
    made = bench.pipeline(text, Scratch, shaders={"scratch.frag": shader})
    made.check()
    bench.session.render(made)


def test_a_missing_shader_is_found_by_check(bench: Any) -> None:
    text = "nodes: {m: {type: maker}, r: {type: reader, inputs: {plain: m.plain}}}\noutputs: {image: r.color}"
    with pytest.raises(
        InputError, match=r"test\.yaml:3:27: RG400 node 'r' \(reader\): there is no shader '\S+reader\.frag'"
    ):
        bench.pipeline(text, Maker, Reader).check()


def test_one_sample_of_a_multisampled_texture_wants_a_resolve(bench: Any) -> None:
    said = (
        r"reader\.frag:1:19: RG214 node 'r' \(reader\): 'many' is read as one sample per texel \(sampler2D\), but 'm.many' "
        r"has 4 samples; resolve it first, or declare it as sampler2DMS"
    )
    with pytest.raises(InputError, match=said):
        pipeline(bench, "many", "m.many", "sampler2D").check()


class Glow(Node):
    """Reads what it continues."""

    radiance = InOut(Radiance, doc="Picture.")
    bright = Internal(Radiance, size=0.5)

    def record(self, steps: Steps) -> None:
        steps.fullscreen("bright.frag", radiance=self.radiance, out={"color": self.bright})
        steps.fullscreen("add.frag", bright=self.bright, out=self.radiance, state=State(blend=ADD))


class Many(Node):
    """Radiance with some samples."""

    radiance = Output(Radiance, samples=lambda node, facts: node.samples, clear=0.5, doc="Picture.")
    samples: int = structural(default=4, min=1, max=8, doc="Samples.")

    def record(self, steps: Steps) -> None:
        steps.clear(self.radiance, 0.5)


def test_an_inout_that_is_read_has_one_sample(bench: Any) -> None:
    shaders = {
        "bright.frag": "uniform sampler2D radiance; out vec4 color; void main() { color = texelFetch(radiance, ivec2(0), 0); }",
        "add.frag": "uniform sampler2D bright; out vec4 color; void main() { color = texelFetch(bright, ivec2(0), 0); }",
    }
    text = "nodes: {m: {type: many}, g: {type: glow, inputs: {radiance: m.radiance}}}\noutputs: {image: g.radiance}"
    glow = bench.pipeline(text, Many, Glow, shaders=shaders)
    glow.set("m.samples", 1).check()
    with pytest.raises(InputError, match=r"RG214 node 'g' \(glow\): \S+: 'radiance' is read as one sample per texel"):
        glow.check()


@pytest.mark.parametrize(
    ("block", "use"),
    [
        ("uniform B { float a; };", "a"),
        ("layout(std140, binding = 1) uniform B { vec4 c; float a[2]; };", "a[1]"),
        ("layout(std140) uniform B { float a; } own;", "own.a"),
        ("layout(std430) readonly buffer B { float a[]; } many[2];", "many[0].a[3]"),
        ("buffer readonly layout(std430) B { float a; };", "a"),
        ("uniform layout(std140) B {\n#ifdef C\n    float c;\n#endif\n    layout(row_major) mat4 a;\n};", "a[0][0]"),
        ("float f() { return 1.0; } uniform B { float a; };", "a"),
        ("float f() { if (true) { return 1.0; } return 2.0; }\nuniform B { float a; };", "a"),
        ("struct S { float a; };\nuniform B { S s; };", "s.a"),
    ],
)
def test_blocks_are_looked_at_by_their_members(block: str, use: str) -> None:
    other = "uniform Other { float nobody; };"
    assert used_blocks(f"{other}\n{block}\nvoid main() {{ float x = {use}; }}") == {"B"}
    assert used_blocks(f"{other}\n{block}\nvoid main() {{ float x = 1.0; }}") == set()
