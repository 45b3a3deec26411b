"""What a shader file without a header declares, read without GL."""

from __future__ import annotations

import math
import re
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rendergraph.catalog import Catalog, NodeType
from rendergraph.declare import Input, Output, WrittenPort
from rendergraph.declare.mistakes import RESERVED_NAMES
from rendergraph.errors import InputError
from rendergraph.glsl import strip_comments
from rendergraph.glsl.globals import globals_of, literal

TAKEN = set("out uniform float int bool vec sampler half filter copy json schema image".split())  # noqa: SIM905 - as text
WORDS = st.from_regex(r"\A[a-z]{3,8}\Z").filter(lambda word: word not in TAKEN | RESERVED_NAMES)


def load(folder: Path, text: str, name: str = "effect.frag") -> NodeType:
    (folder / name).write_text(text, encoding="utf-8")
    return Catalog.discover([folder / name], installed=False).get(Path(name).stem)


def mistakes(folder: Path, text: str, name: str = "effect.frag") -> list[str]:
    with pytest.raises(InputError) as caught:
        load(folder, text, name)
    return [str(problem).splitlines()[0].removeprefix(f"{folder / name}:") for problem in caught.value.problems]


# --- values of initialisers ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.5", 0.5),
        (".5", 0.5),
        ("1.", 1.0),
        ("1e-3", 1e-3),
        ("2.5E+2f", 250.0),
        ("3u", 3),
        ("0x1F", 31),
        ("-2", -2),
        ("true", True),
        ("- 1.5", -1.5),
        ("vec3(1)", (1.0, 1.0, 1.0)),
        ("vec3(1.0, -2.0, 3e-1)", (1.0, -2.0, 0.3)),
        ("vec2 ( 1 ,\n 2 )", (1.0, 2.0)),
        ("ivec2(1.9, -1.9)", (1, -1)),
        ("uvec2(1u, 0x2u)", (1, 2)),
    ],
)
def test_literals(text: str, value: object) -> None:
    found = literal(text)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "other",
        "1.0 / 4.0",
        "2.0 * HALF",
        "(1.0)",
        "- -1",
        "vec3(1, 2)",
        "vec4(vec2(1, 2), vec2(3, 4))",
        "vec2(one, 2)",
        "float(3)",
        "(1",
        "1 2",
        "1e39",
        "ivec2(1e999)",
        "0x" + 40 * "f",
        40 * "9",
        10_000 * "9",
    ],
)
def test_what_is_no_literal_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        literal(text)


def test_a_macro_is_a_number_only_where_it_is_written_as_one() -> None:
    text = "#define SIDE 8\n#define TWICE (2 * SIDE)\n # define  NONE 0 \n#define REAL 1.5\n"
    assert globals_of(text).numbers == {"SIDE": 8, "NONE": 0}


@given(st.floats(min_value=-1e30, max_value=1e30), st.sampled_from(["", "f", "F"]))
def test_every_float_is_read_as_it_is_written(number: float, suffix: str) -> None:
    text = f"{number!r}{suffix}" if "." in repr(number) or "e" in repr(number) else f"{number!r}.0{suffix}"
    found = literal(text)
    assert isinstance(found, float | int)
    assert math.isclose(found, number, rel_tol=0, abs_tol=0)


# --- declarations ----------------------------------------------------------------------------------------------------


def test_ports_and_parameters_of_a_plain_shader(tmp_path: Path) -> None:
    found = load(
        tmp_path,
        """#version 330 core
        uniform sampler2D color, other;
        uniform sampler2DShadow shadows; // a comment; uniform float no;
        layout(binding = 3) uniform usampler2DArray ids;
        uniform float strength = 1.0, plain;
        uniform vec3 tint = vec3(1.0, 0.5, 0.25);
        uniform ivec2 axis = ivec2(1, 0);
        uniform uint count = 4u;
        uniform bool on = true;
        in vec2 v_uv;
        uniform camera_like { mat4 view; } block;
        struct Light { vec3 position; };
        float helper(in float x);
        out vec4 fragColor;
        void main() { float local; fragColor = vec4(helper(strength)); }
        """,
    )
    ports = {name: port for name, port in found.cls.ports().items() if isinstance(port, Input)}
    assert list(ports) == ["color", "other", "shadows", "ids"]
    assert [(p.semantic.name, p.kind, p.compare, p.optional) for p in ports.values()] == [
        ("any", "texture2d", False, False),
        ("any", "texture2d", False, False),
        ("any", "texture2d", True, False),
        ("any", "texture2d_array", False, False),
    ]
    (output,) = found.cls.outputs().values()
    assert isinstance(output, Output)
    assert (output.name, output.format, output.size, output.semantic) == (
        "fragColor",
        None,
        None,
        ports["color"].semantic,
    )
    assert dict(found.cls()) == {
        "strength": 1.0,
        "plain": 0.0,
        "tint": (1.0, 0.5, 0.25),
        "axis": (1, 0),
        "count": 4,
        "on": True,
    }
    assert {parameter.role for parameter in found.cls.parameters().values()} == {"param"}


def test_whole_numbers_have_their_formats(tmp_path: Path) -> None:
    found = load(tmp_path, "out uvec4 ids; out int number;")
    assert [port.format for port in found.cls.ports().values() if isinstance(port, WrittenPort)] == ["rgba32ui", "r32i"]


def test_includes_count_and_shared_ones_do_not(tmp_path: Path) -> None:
    (tmp_path / "more.glsl").write_text("uniform float inside = 2.0;\n")
    text = '#include "more.glsl"\n#include <depth_surface.glsl>\nout vec4 color;\n'
    found = load(tmp_path, text)
    assert dict(found.cls()) == {"inside": 2.0}
    assert list(found.cls.inputs()) == []


def test_both_branches_of_an_if_are_one_declaration(tmp_path: Path) -> None:
    text = "#if A\nuniform float size = 1.0;\n#else\nuniform float size = 2.0;\n#endif\nout vec4 color;"
    assert dict(load(tmp_path, text).cls()) == {"size": 1.0}


KINDS: dict[str, Any] = {
    "float": st.floats(-100, 100, width=32),
    "int": st.integers(-100, 100),
    "uint": st.integers(0, 100),
    "bool": st.booleans(),
}


@pytest.mark.slow
@settings(max_examples=30)
@given(st.data())
def test_what_is_written_is_what_is_read(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    """Random declarations in random layouts, printed and scanned."""
    names = data.draw(st.lists(WORDS, min_size=2, max_size=8, unique=True))
    parts: list[str] = []
    wanted: dict[str, tuple[str, object]] = {}
    blank = st.sampled_from([" ", "\n", "  \t", " /* uniform int no; */ ", " // out vec4 no;\n"])
    for name in names:
        kind = data.draw(st.sampled_from([*KINDS, "vec2", "vec3", "ivec4", "sampler2D", "out vec4"]))
        gap = data.draw(blank)
        if kind == "sampler2D" or kind.startswith("out"):
            wanted[name] = (kind.removeprefix("out "), None)
            parts.append(f"{'' if kind.startswith('out') else 'uniform'}{gap}{kind}{gap}{name};")
            continue
        width = int(kind[-1]) if kind[-1].isdigit() else 1
        scalar = KINDS[{"v": "float", "i": "int"}[kind[0]] if width > 1 else kind]
        values = [data.draw(scalar) for _ in range(width)]
        texts = [str(v).lower() + ("u" if kind == "uint" else "") for v in values]
        text = texts[0] if width == 1 else f"{kind}({f',{gap}'.join(texts)})"
        given_one = data.draw(st.booleans())
        zero = {"f": 0.0, "v": 0.0, "i": 0, "u": 0, "b": False}[kind[0]]
        value: object = values[0] if width == 1 else tuple(values)
        nothing: object = zero if width == 1 else (zero,) * width
        wanted[name] = (kind, value if given_one else nothing)
        parts.append(f"uniform{gap}{kind}{gap}{name}{f' = {text}' if given_one else ''};")
    text = data.draw(blank).join(parts)
    found = globals_of(strip_comments(text))
    assert {one.name: one.type for one in found.declared} == {name: kind for name, (kind, _) in wanted.items()}
    for one in found.declared:
        assert text[one.at :].startswith(one.name)
    folder = tmp_path_factory.mktemp("scan")
    made = load(folder, text + "\nout vec4 result_of_all;\n").cls()
    assert dict(made) == {name: value for name, (_, value) in wanted.items() if value is not None}


@given(st.text(alphabet='uniform floatvec3(){}[];=,.#\n/*01ab"<>', max_size=200))
def test_any_text_is_scanned_to_an_end(text: str) -> None:
    globals_of(text)


SIZE = 100_000


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        "/* " * (SIZE // 3),
        "#define A 1" + SIZE * " " + "b",
        "#define A 1" + SIZE * "\t" + "b",
        SIZE // 4 * "in a{}b[",
        "uniform float a = " + SIZE * "(",
        SIZE * "{",
        SIZE * "}",
        SIZE // 2 * "\\\n",
        SIZE * " ",
        SIZE // 6 * "x = y[",
    ],
    ids=lambda text: text[:8],
)
def test_text_that_repeats_itself_is_read_in_time(tmp_path: Path, text: str) -> None:
    start = time.monotonic()
    load(tmp_path, f"out vec4 c;\nvoid main() {{ c = vec4(1.0); }}\n{text}\n")
    assert time.monotonic() - start < 20  # it takes less than one; in quadratic time it would take minutes


def test_an_include_of_blanks_is_read_in_time(tmp_path: Path) -> None:
    start = time.monotonic()
    [message] = mistakes(tmp_path, f"out vec4 c;\n#include a{SIZE * ' '}b\n")
    assert re.match(r"2:1: RG405 .* is not '#include <name.glsl>'", message)
    assert time.monotonic() - start < 20


def test_ports_and_parameters_are_bounded(tmp_path: Path) -> None:
    text = "out vec4 c;\n" + "".join(f"uniform float a{number};\n" for number in range(255))
    assert len(load(tmp_path, text).cls.parameters()) == 255
    said = ["1:1: RG441 the shader has 257 ports and parameters, the limit is 256; use a texture for tables"]
    assert mistakes(tmp_path, f"{text}uniform float more;\n") == said


# --- mistakes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "uniform mat3 turn;\nout vec4 c;",
            "1:14: RG441 'turn' is mat3, which is not a parameter; bool, int, uint, float and their vectors can be",
        ),
        (
            "out vec4 c;\nuniform float w[4];",
            "2:15: RG441 'w' is an array of float, which is not a parameter; bool, int, uint, float and their vectors can be",
        ),
        (
            "uniform sampler2D s[2];\nout vec4 c;",
            "1:19: RG441 's' is an array of samplers; declare the input `many` and s_0, s_1, …",
        ),
        (
            "in vec2 uv;\nout vec4 c;",
            "1:9: RG441 nothing writes the varying 'uv'; a full-screen pass has v_uv, from 0 to 1",
        ),
        ("uniform float a;\n", "1:1: RG441 the shader writes nothing; declare an output, as in out vec4 color;"),
        ("out mat2 c;", "1:10: RG441 output 'c': expected float, vec2 to vec4, uint or int, got mat2"),
        (
            "out vec4 c;\nuniform float a = other;",
            "2:15: RG442 the initialiser of 'a': it is not a literal; write a number, or give its default in the header",
        ),
        (
            "out vec4 c;\nuniform vec3 a = vec3(1, 2);",
            "2:14: RG442 the initialiser of 'a': vec3 expected 1 or 3 numbers, got 2; write a number, or give its default "
            "in the header",
        ),
        ("out vec4 c;\nuniform int a = 1.5;", "2:13: RG442 the default of 'a' (int): expected a whole number, got 1.5"),
        (
            "layout(location = 1 + 0) out vec4 c;",
            "1:35: RG441 the location of 'c': '1+0' is neither a number nor a macro that is one; write a number, or leave the "
            "layout out",
        ),
        (
            "layout(location = 1) out vec4 c;",
            "1:31: RG441 locations of outputs start at 0 and have no gaps, for all outputs or none; leave the layouts out",
        ),
        ("#version 300 es\nout vec4 c;", "1:1: RG404 '#version' is written by rendergraph; remove the line"),
        (
            "out vec4 c;\nuniform float distance;",
            "2:15: RG490 shader 'effect.frag': 'distance' is reserved by GLSL or by the node's base class; "
            "choose another name",
        ),
    ],
)
def test_what_can_be_no_node_is_said_at_its_line(tmp_path: Path, text: str, message: str) -> None:
    assert mistakes(tmp_path, text) == [message]


def test_all_mistakes_of_a_file_are_said_at_once(tmp_path: Path) -> None:
    found = mistakes(tmp_path, "uniform mat3 a;\nuniform mat3 b;\nin vec3 c;\n")
    assert [text.split(":")[0] for text in found] == ["1", "2", "3"]


def test_a_mistake_in_an_include_is_said_there(tmp_path: Path) -> None:
    (tmp_path / "more.glsl").write_text("\nuniform mat2 a;\n")
    (text,) = mistakes(tmp_path, '#include "more.glsl"\nout vec4 color;\n')
    assert text.removeprefix(f"{tmp_path}/").startswith("more.glsl:2:14: RG441 'a' is mat2")


@pytest.mark.parametrize("version", ["330", "330 core", "400", "450 compatibility", "460 core"])
def test_versions_are_accepted(tmp_path: Path, version: str) -> None:
    assert list(load(tmp_path, f"  # version {version}\nout vec4 color;").cls.outputs()) == ["color"]


def test_what_is_missing_is_one_warning(tmp_path: Path) -> None:
    (warning,) = load(tmp_path, "uniform float a;\nuniform bool b;\nout vec4 c;").warnings
    assert str(warning) == (
        f"{tmp_path}/effect.frag:1:1: warning: RG445 shader node 'effect.frag' lacks doc of the node; "
        "doc of 'c', 'a' and 'b'; min and max of 'a'; add them to its header"
    )


def test_discard_is_a_warning_at_its_line(tmp_path: Path) -> None:
    *_, warning = load(tmp_path, "out vec4 c;\nvoid main() {\n    discard;\n}").warnings
    assert (warning.code, warning.severity, str(warning.place)) == ("RG446", "warning", f"{tmp_path}/effect.frag:3:5")
