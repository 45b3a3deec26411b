"""A mistake in GLSL is shown at the author's own file and line, in the words of every driver and through everything."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Depth, Function, Input, Node, Output, ShadowLookup, ShadowMap
from rendergraph.catalog import NodeType
from rendergraph.errors import Problem
from rendergraph.expand import ViewTable
from rendergraph.glsl import strip_comments
from rendergraph.program import StageText, TextSources, stage_texts
from rendergraph.program.messages import compile_problems, link_problems
from rendergraph.steps import FunctionBinding, Read, Resource, Step
from rendergraph.textures import TextureDesc

if TYPE_CHECKING:
    import rendergraph as rg

FORMS = {
    "mesa": "0:{line}({column}): error: `{name}' undeclared",
    "nvidia": '0({line}) : error C1503: undefined variable "{name}"',
    "amd": "ERROR: 0:{line}: error(#143) Undeclared identifier: '{name}'",
    "amd_mesa_like": "ERROR: 0:{line}: '{name}' : undeclared identifier",
    "intel": "ERROR: 0:{line}: '{name}' : undeclared identifier",
}

FILES = {
    "main.frag": '#include "one.glsl"\nout vec4 color;\n\nvoid main() {\n    color = one() + mistake_main * SAMPLES;\n}\n',
    "one.glsl": '#include "two.glsl"\nvec4 one() { return two() + mistake_one; }\n',
    "two.glsl": "#define TWICE(x) ((x) * mistake_macro)\n\nvec4 two() { return vec4(TWICE(1.0)) + mistake_two; }\n",
    "shadow.glsl": (
        "uniform sampler2DArrayShadow shadow_map;\n"
        "float shadow(int light, vec3 position, vec3 normal) {\n    return mistake_shadow;\n}\n"
    ),
    "lit.frag": "out vec4 color;\nvoid main() {\n    color = vec4(shadow(0, vec3(0.0), vec3(0.0)));\n}\n",
    "fog.frag": (
        "uniform sampler2D depth;\nout vec4 color;\nvoid main() {\n"
        "    color = depth_views[0].eye + texture(depth, vec2(0));\n}\n"
    ),
}


class Provider(Node):
    """Shadows."""

    shadow_map = Input(ShadowMap, kind="texture2d_array", doc="Map.")
    lookup = Function(ShadowLookup, "shadow.glsl", reads=("shadow_map",), doc="Shadows.")


class Consumer(Node):
    """Light."""

    depth = Input(Depth, optional=True, doc="Depth.")
    lookup = Input(ShadowLookup, kind="function", many=True, optional=True, doc="Shadows.")
    color = Output(AnyTexel, doc="Colour.")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def texts(folder: Path, shader: str) -> dict[str, StageText]:
    types = {
        name: NodeType(name, "", cls, folder / "x.py", folder) for name, cls in (("a", Consumer), ("sun", Provider))
    }
    resources = {
        "sun.map": Resource("sun.map", TextureDesc("texture2d_array", "depth32f", 8, 8), view="camera", lights=(0,)),
        "z.depth": Resource("z.depth", TextureDesc("texture2d", "depth32f", 8, 8), view="camera"),
    }
    functions = (FunctionBinding("shadow", "sun", "shadow.glsl", (Read("shadow_map", "sun.map", 1),)),)
    reads = (Read("depth", "z.depth", 1),)
    step = Step("a", 0, "fullscreen", (("fragment", shader),), reads, functions=functions, defines=(("SAMPLES", "4"),))
    return stage_texts(step, TextSources(types, resources, {"camera": ViewTable()}))


def answer(form: str, text: StageText, fragment: str, name: str) -> Problem:
    """What is made of a driver's message about the line that holds a piece of text."""
    lines = text.text.splitlines()
    number = next(number for number, line in enumerate(lines, start=1) if fragment in line)
    column = lines[number - 1].find(name) + 1 or 1
    (found,) = compile_problems(FORMS[form].format(line=number, column=column, name=name), text)
    return found


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("shader", "fragment", "name", "file", "line", "more"),
    [
        ("main.frag", "mistake_main", "mistake_main", "main.frag", 5, ""),
        ("main.frag", "mistake_one", "mistake_one", "one.glsl", 2, "(included at main.frag:1)"),
        ("main.frag", "mistake_two", "mistake_two", "two.glsl", 3, "(included at one.glsl:1)"),
        ("main.frag", "mistake_two", "mistake_macro", "two.glsl", 3, "(in macro TWICE of two.glsl:1)"),
        ("lit.frag", "mistake_shadow", "mistake_shadow", "shadow.glsl", 3, ""),
        ("lit.frag", "color = vec4(shadow", "shadow", "lit.frag", 3, ""),
        # lines that nobody wrote: the author's nearest, and what they are there for
        (
            "fog.frag",
            "depth_view_block",
            "View",
            "fog.frag",
            4,
            "(in what rendergraph writes for the views of 'depth': ",
        ),
        ("lit.frag", "float result = 1.0", "result", "lit.frag", 1, "(in what rendergraph writes for shadow() of all "),
        (
            "main.frag",
            "#define SAMPLES 4",
            "SAMPLES",
            "main.frag",
            5,
            "(in what rendergraph writes for the macro SAMPLES: ",
        ),
    ],
)
def test_every_driver_leads_to_the_authors_line(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    form: str,
    shader: str,
    fragment: str,
    name: str,
    file: str,
    line: int,
    more: str,
) -> None:
    monkeypatch.chdir(folder)
    found = answer(form, texts(folder, shader)["fragment"], fragment, name)
    assert found.place is not None
    assert (found.place.file, found.place.line) == (file, line)
    assert found.text.startswith("node 'a': fragment shader: ")
    assert name in found.text
    assert more in found.text


@pytest.mark.parametrize(
    ("line", "said", "marked"),
    [
        ("x = nope;", "0:{}(5): error: `nope' undeclared", "nope"),
        ("    x = nope;", "0:{}(6): error: `nope' undeclared", "nope"),
        ("\t  x\t =   1.0 + nope;", "0:{}(12): error: `nope' undeclared", "nope"),
        # a macro of the line moves what comes after it
        ("    x = M + nope + 1.0;", "0:{}(31): error: `nope' undeclared", "nope"),
        ("    x = a /* c */ + nope + nope;", "0:{}(10): error: `nope' undeclared", "nope + nope"),
        # nothing is quoted, or what is stands not in the line
        ("    x =  vec3(1.0)  ;", "0:{}(6): error: value of type vec3 cannot be assigned", "vec3"),
        ("    x  =  = 1.0;", "0:{}(6): error: syntax error, unexpected '='", "= 1.0"),
        ("\t\tx = 1.0", "0:{}(9): error: syntax error, unexpected '}}'", ""),
        # no column at all
        ("    x = nope;", '0({}) : error C1503: undefined variable "nope"', "nope"),
        ("    x = vec3(1.0);", "ERROR: 0:{}: '=' :  cannot convert", "x"),
    ],
)
def test_the_column_is_the_authors(folder: Path, line: str, said: str, marked: str) -> None:
    (folder / "main.frag").write_text(f"out vec4 c;\nvoid main() {{\nfloat x;\n{line}\n}}\n")
    text = texts(folder, "main.frag")["fragment"]
    stripped = strip_comments(line)
    number = text.text.splitlines().index(stripped) + 1
    (found,) = compile_problems(said.format(number), text)
    assert found.place is not None
    assert found.place.column is not None
    assert line[found.place.column - 1 :].startswith(marked)
    assert marked or found.place.column == len(line) + 1


MESA_CASCADE = """0:{0}(15): error: `amuont' undeclared
0:{0}(11): error: no matching function for call to `mix(error, float, float)'; candidates are:
0:{0}(11): error:    float mix(float, float, float)
0:{0}(11): error:    vec2 mix(vec2, vec2, float)
0:{0}(9): error: operands to arithmetic operators must be numeric
0:{1}(9): error: `amuont' undeclared
0:{2}(9): error: cannot construct `vec4' from a non-numeric data type
"""
NVIDIA_CASCADE = """0({0}) : error C1503: undefined variable "amuont"
0({0}) : error C1115: unable to find compatible overloaded function "mix(error, float, float)"
0({1}) : error C1503: undefined variable "amuont"
"""
GLSLANG_CASCADE = """ERROR: 0:{0}: 'amuont' : undeclared identifier
ERROR: 0:{0}: '+' : wrong operand types
ERROR: 0:{1}: 'amuont' : undeclared identifier
"""
CASCADE = """out vec4 color;
uniform float amount;
void main() {
    float y = mix(amuont, 1.0, 0.5) + 1.0;
    color = vec4(
        amuont);
}
"""


@pytest.mark.parametrize("said", [MESA_CASCADE, NVIDIA_CASCADE, GLSLANG_CASCADE])
def test_a_misspelt_name_is_one_mistake(folder: Path, said: str) -> None:
    (folder / "main.frag").write_text(CASCADE)
    text = texts(folder, "main.frag")["fragment"]
    lines = text.text.splitlines()
    numbers = [lines.index(line) + 1 for line in CASCADE.splitlines()]
    (found,) = compile_problems(said.format(numbers[3], numbers[5], numbers[4]), text)
    assert found.place is not None
    assert (found.place.line, found.place.column) == (4, 19)
    assert found.text.endswith("; did you mean 'amount'?")


def test_what_is_wrong_in_each_statement_is_told(folder: Path) -> None:
    (folder / "main.frag").write_text("out vec4 c;\nvoid main() {\n    vec3 a = 1;\n    vec2 b = a;\n}\n")
    text = texts(folder, "main.frag")["fragment"]
    line = text.text.splitlines().index("    vec3 a = 1;") + 1
    said = "0:{}(10): error: initializer of type int\n0:{}(10): error: initializer of type vec3\n"
    found = compile_problems(said.format(line, line + 1), text)
    assert [problem.place and problem.place.line for problem in found] == [3, 4]


OVERLOADS = """0:{0}(9): error: no matching function for call to `textureLod(sampler2D, vec3, float)'; candidates are:
0:{0}(9): error:    vec4 textureLod(sampler1D, float, float)
0:{0}(9): error:    ivec4 textureLod(isampler2D, vec2, float)
0:{0}(9): error:    vec4 textureLod(sampler3D, vec3, float)
0:{0}(9): error:    vec4 textureLod(sampler2D, vec2, float)
0:{0}(9): error:    vec4 textureLod(sampler2D, vec2)
"""


def test_of_overloads_the_nearest_are_told(folder: Path) -> None:
    (folder / "main.frag").write_text("out vec4 c;\nvoid main() {\n    c = textureLod(t, vec3(0), 0.0);\n}\n")
    text = texts(folder, "main.frag")["fragment"]
    line = next(number for number, row in enumerate(text.text.splitlines(), start=1) if "textureLod" in row)
    (found,) = compile_problems(OVERLOADS.format(line), text)
    assert found.text == (
        "node 'a': fragment shader: no matching function for call to `textureLod(sampler2D, vec3, float)'; the nearest of 5 "
        "are vec4 textureLod(sampler2D, vec2, float); vec4 textureLod(sampler3D, vec3, float); "
        "vec4 textureLod(sampler1D, float, float)"
    )


def test_a_stage_without_main_is_named_by_its_own_file(folder: Path) -> None:
    (folder / "main.frag").write_text("out vec4 c;\nvoid mein() { c = vec4(0); }\n")
    (found,) = link_problems("error: fragment shader lacks `main'", texts(folder, "main.frag"))
    assert found.place is not None
    assert (Path(found.place.file).name, found.place.line) == ("main.frag", 1)


def test_what_mesa_says_of_a_function_without_a_line_stands_at_the_function(folder: Path) -> None:
    (folder / "main.frag").write_text(
        "out vec4 c;\nfloat f(float x) { return f(x); }\nvoid main() { c = vec4(f(1)); }\n"
    )
    said = "0:0(0): error: function `float f(float)' has static recursion"
    (found,) = compile_problems(said, texts(folder, "main.frag")["fragment"])
    assert found.place is not None
    assert (Path(found.place.file).name, found.place.line, found.place.column) == ("main.frag", 2, 7)


def test_the_vertex_stage_of_the_frameworks_own(folder: Path) -> None:
    vertex = texts(folder, "main.frag")["vertex"]
    found = answer("nvidia", vertex, "gl_Position", "gl_Position")
    assert found.place is not None
    assert Path(found.place.file).name == "fullscreen.vert"
    assert found.text.startswith("node 'a': vertex shader: ")


NVIDIA_LINK = """Vertex info
-----------
(0) : warning C7050: "v_uv" might be used before being initialized
Fragment info
-------------
0({line}) : error C5145: must write to gl_Position
"""


def test_nvidias_link_messages_have_lines(folder: Path) -> None:
    both = texts(folder, "main.frag")
    rows = both["fragment"].text.splitlines()
    number = next(number for number, row in enumerate(rows, start=1) if "mistake_main" in row)
    (found,) = link_problems(NVIDIA_LINK.format(line=number), both)
    assert (found.code, found.place and found.place.line) == ("RG411", 5)
    assert "must write to gl_Position" in found.text


@pytest.mark.parametrize(
    "message",
    [
        "error: fragment shader input `color' has no matching output in the previous stage",
        "error: vertex shader output `color' declared as type `vec3'",
        "ERROR: Type mismatch of varying 'color'",
    ],
)
def test_link_messages_are_at_the_variable(folder: Path, message: str) -> None:
    (found,) = link_problems(message, texts(folder, "main.frag"))
    assert found.place is not None
    assert (Path(found.place.file).name, found.place.line, found.place.column) == ("main.frag", 2, 10)


# --- the driver at hand -----------------------------------------------------------------------------------------------

COLOR = 'color = Output(Radiance, doc="Colour.")\n'
DRAWN = COLOR + 'def record(self, steps):\n    steps.geometry("wrong.frag", vertex="wrong.vert")'
SCENE = "objects: {box: {shape: box}}\n"
CASES = {
    "include in include": (
        COLOR,
        {
            "wrong.frag": '#include "a.glsl"\nout vec4 color; void main() { color = a(); }',
            "a.glsl": '\n#include "b.glsl"\nvec4 a() { return b(); }',
            "b.glsl": "// B\nvec4 b() {\n    return nothing;\n}",
        },
        r"b\.glsl:3:12: RG410 node 'a': fragment shader: .*nothing.* \(included at a\.glsl:2\)",
    ),
    "far in": (
        COLOR,
        {"wrong.frag": "out vec4 color;\nvoid main() {\n\t  float  x =\t 1.0;\n\t\tcolor  =  vec3( x );\n}"},
        r"wrong\.frag:4:3: RG410",
    ),
    "inside a macro": (
        COLOR,
        {"wrong.frag": "#define M(x) (x + nothing)\nout vec4 color;\nvoid main() {\n    color = vec4(M(1.0));\n}"},
        r"wrong\.frag:4:18: RG410 node 'a': fragment shader: .*nothing.* \(in macro M of wrong\.frag:1\)",
    ),
    "a macro redefined": (
        COLOR + 'samples: int = define(default=3, doc="Samples.")',
        {"wrong.frag": "#define SAMPLES 4\nout vec4 color;\nvoid main() { color = vec4(SAMPLES); }"},
        r"wrong\.frag:1:\d+: RG410 node 'a': fragment shader: .*SAMPLES",
    ),
    "shared include": (
        COLOR,
        {
            "wrong.frag": "out vec4 color;\n#define vec3 nothing\n#include <luminance.glsl>\nvoid main() { color = vec4(1); }"
        },
        r"luminance\.glsl:\d+:\d+: RG410 node 'a': fragment shader: .* \(included at wrong\.frag:3\)",
    ),
    "the vertex stage": (
        DRAWN,
        {
            "wrong.vert": "#include <geometry_vertex.glsl>\nvoid main() {\n    transform_vertex();\n    v_positon.x = 1.0;\n}"
        },
        r"wrong\.vert:4:\d+: RG410 node 'a': vertex shader: .*v_positon",
    ),
    "stages that do not fit": (
        DRAWN,
        {
            "wrong.vert": "in vec3 in_position;\nvoid main() { gl_Position = vec4(in_position, 1.0); }",
            "wrong.frag": "\nin vec2 v_missing;\nout vec4 color;\nvoid main() { color = v_missing.xyxy; }",
        },
        r"wrong\.frag:2:9: RG411 node 'a': the stages vertex, fragment do not link: .*v_missing",
    ),
    "an attribute misspelt": (
        DRAWN,
        {"wrong.vert": "\nin vec3 in_positon;\nvoid main() { gl_Position = vec4(in_positon, 1.0); }"},
        r"wrong\.vert:2:9: RG428 node 'a' \(wrong\): wrong\.py:18: wrong\.vert reads vertex attribute 'in_positon', which "
        r"the scene does not have; did you mean 'in_position'\?",
    ),
    "floats as whole numbers": (
        DRAWN,
        {"wrong.vert": "in ivec3 in_position;\nvoid main() { gl_Position = vec4(in_position, 1.0); }"},
        r"wrong\.vert:1:10: RG428 .*: wrong\.vert reads vertex attribute 'in_position' as integers, but it holds "
        r"floats \(3f\)",
    ),
    "a sampler of nobody's": (
        COLOR + 'last = Input(AnyTexel, optional=True, doc="Last.")',
        {"wrong.frag": "out vec4 color;\nuniform sampler2D lost;\nvoid main() { color = texture(lost, vec2(0)); }"},
        r"wrong\.frag:2:19: RG430 node 'a' \(wrong\): wrong\.frag samples 'lost', but the step reads no texture of that "
        r"name; it reads none",
    ),
    "a uniform of nobody's": (
        COLOR + 'gain: float = param(default=1.0, doc="Gain.")',
        {"wrong.frag": "out vec4 color;\nuniform float gian, gain;\nvoid main() { color = vec4(gian + gain); }"},
        r"wrong\.frag:2:15: RG434 node 'a' \(wrong\): wrong\.frag uses uniform 'gian', which nothing sets; did you "
        r"mean 'gain'\?",
    ),
    "an object that is not there": (
        COLOR + 'def record(self, steps):\n    steps.geometry("wrong.frag", objects=["boks"])',
        {},
        r"test\.yaml:5:3: RG431 node 'a' \(wrong\): wrong\.py:18: it draws object 'boks', which the scene does not have; "
        r"available: box",
    ),
    "a buffer's attribute misspelt": (
        COLOR + 'numbers = Internal(kind="buffer", bytes=64)\n\n'
        'def record(self, steps):\n    steps.draw("wrong.frag", vertex="wrong.vert", vertices=3, '
        'attributes={"2f in_corner": self.numbers})\n\ndef update(self, frame):\n    pass',
        {"wrong.vert": "in vec2 in_cornre;\nvoid main() { gl_Position = vec4(in_cornre, 0.0, 1.0); }"},
        r"wrong\.vert:1:9: RG428 .*: wrong\.vert reads vertex attribute 'in_cornre', which no buffer of `attributes` holds; "
        r"did you mean 'in_corner'\?",
    ),
    "a vector from one number": (
        COLOR + 'gain: float = param(default=1.0, doc="Gain.")',
        {"wrong.frag": "uniform vec3 gain;\nout vec4 color;\nvoid main() { color = gain.xyzx; }"},
        r"wrong\.frag:1:14: RG436 node 'a' \(wrong\): wrong\.frag declares 'gain' as vec3, but it is given 1 number$",
    ),
    "too many numbers": (
        COLOR + 'def record(self, steps):\n    steps.fullscreen("wrong.frag", axis=(1, 0, 0))',
        {"wrong.frag": "uniform ivec2 axis;\nout vec4 color;\nvoid main() { color = vec4(axis, axis); }"},
        r"wrong\.frag:1:15: RG436 .*wrong\.py:18: wrong\.frag declares 'axis' as ivec2, but it is given 3 numbers$",
    ),
    "more than an array holds": (
        COLOR + 'def record(self, steps):\n    steps.fullscreen("wrong.frag", weights=[0.1] * 5)',
        {
            "wrong.frag": "uniform float weights[4];\nout vec4 color;\n"
            "void main() { color = vec4(weights[0], weights[1], weights[2], weights[3]); }"
        },
        r"wrong\.frag:1:15: RG436 .* declares 'weights' as float\[4\], but it is given 5 numbers$",
    ),
    "floats for a whole number": (
        COLOR + 'def record(self, steps):\n    steps.fullscreen("wrong.frag", taps=8 / 2)',
        {"wrong.frag": "uniform int taps;\nout vec4 color;\nvoid main() { color = vec4(taps); }"},
        r"wrong\.frag:1:13: RG436 .* declares 'taps' as int, but it is given floats, 4\.0$",
    ),
    "a parameter as a sampler": (
        COLOR + 'gain: float = param(default=1.0, doc="Gain.")',
        {"wrong.frag": "uniform sampler2D gain;\nout vec4 color;\nvoid main() { color = texture(gain, vec2(0)); }"},
        r"wrong\.frag:1:19: RG430 .* samples 'gain', but the step reads no texture of that name",
    ),
    "a texture named like something of the framework's": (
        COLOR,
        {"wrong.frag": "out vec4 color;\nuniform sampler2D depth;\nvoid main() { color = texture(depth, vec2(0)); }"},
        r"wrong\.frag:2:19: RG430 .* samples 'depth', but the step reads no texture of that name",
    ),
    "a texture named like a variable of an earlier stage": (
        DRAWN,
        {
            "wrong.vert": "in vec3 in_position;\nvoid main() {\n    float depth = 1.0;\n"
            "    gl_Position = vec4(in_position, depth);\n}",
            "wrong.frag": "uniform sampler2D depth;\nout vec4 color;\nvoid main() { color = texture(depth, vec2(0)); }",
        },
        r"wrong\.frag:1:19: RG430 .* samples 'depth', but the step reads no texture of that name",
    ),
    "a buffer misspelt": (
        COLOR + 'numbers = Internal(kind="buffer", bytes=64)\n\ndef record(self, steps):\n'
        '    steps.compute("wrong.comp", over=1, out=self.numbers)\n'
        '    steps.fullscreen("wrong.frag", numbers=self.numbers, out=self.color)',
        {
            "wrong.comp": "layout(local_size_x = 1) in;\nlayout(std430) buffer nubmers { float values[]; };\n"
            "void main() { values[0] = 1.0; }"
        },
        r"wrong\.comp:2:23: RG430 .*wrong\.py:20: wrong\.comp uses block 'nubmers', but the step has no buffer of that "
        r"name; it has numbers$",
    ),
    "a target that is not written": (
        COLOR + 'mask = Output(Radiance, doc="Mask.")',
        {},
        r"test\.yaml:5:3: RG437 node 'a' \(wrong\): wrong\.frag writes no output 'mask'$",
    ),
    "an output of whole numbers": (
        'color = Output(Any, format="rgba32ui", doc="Numbers.")',
        {"wrong.frag": "out vec4 color;\nvoid main() { color = vec4(1.0); }"},
        r"wrong\.frag:1:10: RG447 node 'a' \(wrong\): 'color' is declared as vec4, but 'a\.color' is rgba32ui; declare it as uvec4$",
    ),
    "an output more": (
        COLOR,
        {"wrong.frag": "out vec4 color;\nout vec4 mask;\nvoid main() { color = mask = vec4(1.0); }"},
        r"wrong\.frag:2:10: RG448 node 'a' \(wrong\): wrong\.frag writes 'mask', which the node does not declare; available: color$",
    ),
    "a material's texture without a guard": (
        COLOR + 'def record(self, steps):\n    steps.geometry("wrong.frag")',
        {
            "wrong.frag": "uniform sampler2D base_color_texture;\nout vec4 color;\n"
            "void main() { color = texture(base_color_texture, vec2(0)); }"
        },
        r"wrong\.frag:1:19: RG430 .*'base_color_texture', but .* reads none; not every material has it, so put it inside "
        r"#ifdef HAS_BASE_COLOR_TEXTURE$",
    ),
    "no work group": (
        'shader = "wrong.comp"\n' + COLOR,
        {"wrong.comp": "uniform writeonly image2D color;\nvoid main() { imageStore(color, ivec2(0), vec4(1.0)); }"},
        r"wrong\.comp:1:1: RG411 node 'a': the stages compute do not link: .*(local group size|work group size)",
    ),
    "an image of another format": (
        'shader = "wrong.comp"\n' + COLOR,
        {
            "wrong.comp": "layout(local_size_x = 8) in;\nlayout(r32f) uniform writeonly image2D color;\n"
            "void main() { imageStore(color, ivec2(0), vec4(1.0)); }"
        },
        r"wrong\.comp:2:1: RG427 node 'a': image 'color' has layout\(r32f\), but 'a\.color' is rgba16f; leave the layout out",
    ),
    "an image of whole numbers": (
        'shader = "wrong.comp"\ncolor = Output(Radiance, format="r32ui", doc="Colour.")',
        {
            "wrong.comp": "layout(local_size_x = 8) in;\nuniform writeonly image2D color;\n"
            "void main() { imageStore(color, ivec2(0), vec4(1.0)); }"
        },
        r"wrong\.comp:2:1: RG427 node 'a': image 'color' is an image2D, but 'a\.color' is r32ui, which needs uimage2D",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_what_the_driver_at_hand_says(author: Any, gl: rg.Session, case: str) -> None:
    body, files, expected = CASES[case]
    author.node(body)
    author.write(**{name.replace(".", "__"): text for name, text in files.items()})
    mask = ", mask: a.mask" if "mask =" in body else ""
    text = f"nodes:\n  a: {{type: wrong}}\noutputs: {{image: a.color{mask}}}\n"
    said = author.said(lambda: gl.render(author.pipeline(text, scene=SCENE)))
    assert re.match(expected, re.sub(r"^\S*/", "", said[0])), said[0]
