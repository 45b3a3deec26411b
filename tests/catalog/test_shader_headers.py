"""The YAML header of a shader file."""

from __future__ import annotations

from pathlib import Path

import pytest

from rendergraph.catalog import Catalog, NodeType
from rendergraph.declare import Facts, Input, Output, TextureInfo
from rendergraph.errors import InputError
from rendergraph.schema import schema
from rendergraph.textures import Depth, Radiance, TextureDesc, Visibility

BODY = """uniform sampler2D color;
uniform float strength;
out vec4 darkened;
void main() { darkened = texelFetch(color, ivec2(0), 0) * strength; }
"""
MACROS = "int taps = TAPS, curve = CURVE_HARD;\n#if SMOOTH_IT\n#endif\n"
WHOLE = """// A first comment.
/*---
doc: |
  Darken.

  More about it.
inputs:
  color: {semantic: radiance, size: any, filter: linear, wrap: mirror, anisotropy: 4, optional: true, doc: What.}
outputs:
  darkened: {like: color, format: r32f, size: [color, $scale], mips: all, clear: [1, 2, 3, 4], first: 5, doc: Result.}
params:
  strength: {default: 0.25, min: 0, max: 1, unit: EV, doc: How much.}
  taps: {default: 4, min: 1, max: 8, role: define, doc: How often.}
  curve: {choices: [soft, hard], doc: How.}
  smooth_it: {default: true, doc: Whether.}
  scale: {default: 0.5, min: 0.1, max: 1, role: structural, doc: How large.}
---*/
"""


def load(folder: Path, text: str, name: str = "effect.frag") -> NodeType:
    (folder / name).write_text(text, encoding="utf-8")
    return Catalog.discover([folder / name], installed=False).get(Path(name).stem)


def mistakes(folder: Path, text: str, name: str = "effect.frag") -> list[str]:
    with pytest.raises(InputError) as caught:
        load(folder, text, name)
    return [str(problem).splitlines()[0].removeprefix(f"{folder / name}:") for problem in caught.value.problems]


def test_a_header_says_everything_that_a_class_can(tmp_path: Path) -> None:
    found = load(tmp_path, WHOLE + BODY + MACROS)
    cls = found.cls
    assert found.warnings == ()
    assert cls.__doc__ == "Darken.\n\nMore about it."
    color, darkened = cls.ports()["color"], cls.ports()["darkened"]
    assert isinstance(color, Input)
    assert (color.semantic, color.size, color.filter, color.wrap) == (Radiance, "any", "linear", "mirror")
    assert (color.anisotropy, color.optional, color.doc) == (4, True, "What.")
    assert isinstance(darkened, Output)
    assert (darkened.like, darkened.format, darkened.mips, darkened.clear) == ("color", "r32f", 0, (1.0, 2.0, 3.0, 4.0))
    assert (darkened.first, darkened.semantic, darkened.doc) == (5, None, "Result.")
    assert dict(cls()) == {
        "strength": 0.25,
        "taps": 4,
        "curve": "soft",
        "smooth_it": True,
        "scale": 0.5,
    }
    assert [parameter.role for parameter in cls.parameters().values()] == [
        "param",
        "define",
        "define",
        "define",
        "structural",
    ]
    assert cls.parameters()["curve"].choices == ("soft", "hard")
    desc = TextureDesc("texture2d", "rgba16f", 101, 50)
    assert callable(darkened.size)
    assert darkened.size(cls(), Facts((64, 64), inputs={"color": (TextureInfo(desc, Radiance),)})) == (51, 25)
    assert darkened.size(cls(), Facts((64, 64))) == (32, 32)


@pytest.mark.parametrize(
    ("size", "rule"), [("0.5", 0.5), ("color", "color"), ("[64, 32]", (64, 32)), ("[color, 0.5]", ("color", 0.5))]
)
def test_sizes(tmp_path: Path, size: str, rule: object) -> None:
    text = f"/*---\noutputs: {{darkened: {{size: {size}}}}}\n---*/\n" + BODY
    (port,) = load(tmp_path, text).cls.outputs().values()
    assert isinstance(port, Output)
    assert port.size == rule


def test_a_single_output_may_have_any_name(tmp_path: Path) -> None:
    text = "/*---\noutputs: {dark: {doc: It.}}\n---*/\n" + BODY
    assert list(load(tmp_path, text).cls.outputs()) == ["dark"]


def test_depth_needs_no_declaration(tmp_path: Path) -> None:
    text = "/*---\noutputs: {depth: {semantic: depth, format: depth32f}}\n---*/\nvoid main() { gl_FragDepth = 0.5; }"
    (port,) = load(tmp_path, text).cls.outputs().values()
    assert isinstance(port, Output)
    assert (port.semantic, port.format) == (Depth, "depth32f")


def test_functions_and_lists(tmp_path: Path) -> None:
    text = """/*---
    inputs:
      lookup: {kind: function, semantic: shadow, optional: true, many: true}
      visibility: {semantic: visibility, optional: true, many: true}
      layer: {many: true}
    ---*/
    uniform sampler2D layer_0, layer_1;
    out vec4 c;
    """
    inputs = load(tmp_path, text).cls.inputs()
    assert list(inputs) == ["lookup", "visibility", "layer"]
    lookup, visibility, layer = inputs.values()
    assert isinstance(lookup, Input)
    assert isinstance(visibility, Input)
    assert isinstance(layer, Input)
    assert (lookup.kind, lookup.semantic.name, lookup.many) == ("function", "shadow", True)
    assert (visibility.kind, visibility.semantic) == ("texture2d_array", Visibility)
    assert (layer.kind, layer.many) == ("texture2d", True)


def test_compute_images_and_buffers(tmp_path: Path) -> None:
    text = """/*---
    inputs: {source: {doc: It.}}
    outputs: {counts: {bytes: 1024, clear: 0}, picture: {}}
    threads: source
    ---*/
    #define SIDE 8
    layout(local_size_x = SIDE, local_size_y = 4) in;
    layout(r32f) uniform readonly image2D source;
    layout(r32ui) uniform uimage2DArray picture;
    layout(std430) buffer counts { uint count[256]; };
    layout(std430) readonly buffer table { float values[]; };
    void main() {}
    """
    cls = load(tmp_path, text, "effect.comp").cls
    assert {name: (port.kind, port.use) for name, port in cls.inputs().items() if isinstance(port, Input)} == {
        "source": ("texture2d", "image"),
        "table": ("buffer", "sample"),
    }
    made = {name: (port.kind, port.format) for name, port in cls.outputs().items() if isinstance(port, Output)}
    assert made == {"counts": ("buffer", None), "picture": ("texture2d_array", "r32ui")}


def test_the_schema_treats_it_like_any_node(tmp_path: Path) -> None:
    (tmp_path / "effect.frag").write_text(WHOLE + BODY + MACROS)
    found = schema(Catalog.discover([tmp_path], installed=False))
    rules = found["definitions"]["node"]["allOf"]
    (rule,) = [rule["then"]["properties"] for rule in rules if rule["if"]["properties"]["type"]["const"] == "effect"]
    assert list(rule["inputs"]["properties"]) == ["color"]
    assert list(rule["params"]["properties"]) == ["strength", "taps", "curve", "smooth_it", "scale"]


def headed(text: str) -> str:
    return f"/*---\n{text}\n---*/\n{BODY}"


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        ("docs: x", ["2:1: RG440 a header has no key 'docs'; did you mean 'doc'?"]),
        ("- 1", ["2:1: RG440 expected a header, a mapping with doc, inputs, outputs, params, got a list"]),
        ("doc: 3", ["2:6: RG440 'doc': expected text, got 3"]),
        (
            "inputs: [color]",
            ["2:9: RG440 'inputs': expected a mapping, as in inputs: {color: {doc: …}}, got ['color']"],
        ),
        (
            "inputs: {color: radiance}",
            ["2:17: RG440 'color': expected a mapping, as in inputs: {color: {doc: …}}, got 'radiance'"],
        ),
        (
            "inputs: {color: {filter: smooth}}",
            ["2:26: RG440 'filter': expected one of nearest, linear, trilinear, got 'smooth'"],
        ),
        (
            "inputs: {color: {semantic: radiant}}",
            ["2:28: RG440 there is no semantic 'radiant'; did you mean 'radiance'?"],
        ),
        (
            "inputs: {colour: {}}",
            [
                "2:10: RG444 the header has input 'colour', but the shader declares no 'uniform sampler2D colour;'; "
                "did you mean 'color'?"
            ],
        ),
        (
            "inputs: {strength: {}}",
            ["2:10: RG444 the header has input 'strength', but the shader declares 'uniform float strength'"],
        ),
        ("outputs: {darkened: {format: rgba9}}", None),
        (
            "outputs: {darkened: {like: colour}}",
            ["2:28: RG444 'like' names no input of this node: 'colour'; did you mean 'color'?"],
        ),
        ("outputs: {darkened: {size: $scale}}", ["2:28: RG444 there is no parameter 'scale' with role: structural"]),
        (
            "outputs: {darkened: {size: 0}}",
            [
                "2:28: RG440 'size': expected a factor of the picture's size, an input's name, [input, factor], or "
                "[width, height] in texels, got 0"
            ],
        ),
        (
            "outputs: {darkened: {}, more: {}}",
            ["2:25: RG444 the header has output 'more', but the shader declares no 'out vec4 more;'"],
        ),
        (
            "params: {strength: {default: [1, 2]}}",
            ["2:30: RG442 the default of 'strength' (float): expected a number, got [1, 2]"],
        ),
        (
            "params: {strength: {default: true}}",
            ["2:30: RG442 the default of 'strength' (float): expected a number, got true"],
        ),
        ("params: {strength: {min: 2, max: 1}}", ["2:26: RG442 'strength' has a min of 2 above its max of 1"]),
        ("params: {strength: {min: 2}}", ["2:26: RG442 the default of 'strength' is 0, outside its range"]),
        (
            "params: {strength: {role: define}}",
            [
                "2:10: RG444 the header has parameter 'strength', which the shader declares as 'uniform float strength;', "
                "not a define"
            ],
        ),
        (
            "params: {strenght: {role: param}}",
            [
                "2:10: RG444 the header has parameter 'strenght', but the shader declares no 'uniform float strenght;'; "
                "did you mean 'strength'?"
            ],
        ),
        (
            "params: {strenght: {default: 1}}",
            [
                "2:10: RG444 the header has parameter 'strenght', but the shader has neither 'uniform float strenght;' nor "
                "STRENGHT, as which it would be compiled in; did you mean 'strength'?"
            ],
        ),
        (
            "params: {mode: {choices: [a, b]}}",
            [
                "2:10: RG444 the header has parameter 'mode', but the shader has neither 'uniform float mode;' nor "
                "MODE, as which it would be compiled in; available: strength"
            ],
        ),
        (
            "params: {more: {role: define}}",
            [
                "2:10: RG444 'more' is not a uniform of the shader; it needs choices, or a default that is a number or a switch"
            ],
        ),
        (
            "params: {mode: {role: define, choices: [a, b], default: c}}",
            ["2:57: RG442 the default of 'mode': expected one of a, b, got 'c'"],
        ),
        (
            "inputs: {color: {}}\nparams: {color: {}}",
            ["3:10: RG440 'color' is also in line 2; ports and parameters need distinct names"],
        ),
        (
            "params: {filter: {role: define, default: 1}}",
            [
                "2:10: RG490 shader 'effect.frag': 'filter' is reserved by GLSL or by the node's base class; "
                "choose another name"
            ],
        ),
        ("doc: 'open", ["2:6: RG001 not valid YAML: the quote that starts here is not closed"]),
        ("doc: a\ndoc: b", ["3:1: RG002 duplicate key 'doc', first in line 2; remove one"]),
        (
            "doc: 1\ninputs: 2\nparams: {strength: {min: x, uint: EV}}",
            [
                "2:6: RG440 'doc': expected text, got 1",
                "3:9: RG440 'inputs': expected a mapping, as in inputs: {color: {doc: …}}, got 2",
                "4:26: RG440 'min': expected a number, got 'x'",
                "4:29: RG440 a parameter has no key 'uint'; did you mean 'unit'?",
            ],
        ),
    ],
)
def test_a_wrong_header_is_told_at_its_line(tmp_path: Path, text: str, messages: list[str] | None) -> None:
    found = mistakes(tmp_path, headed(text))
    if messages is None:
        assert (
            found[0].startswith("2:30: RG440 'format': expected a format; did you mean 'rgba8'?") or "rgba" in found[0]
        )
    else:
        assert found == messages


@pytest.mark.parametrize(
    "body", ["#define X MODE\n", "#if MODE_A\n#endif\n", '#include "more.glsl"\n', "#include <MODE>\n", ""]
)
def test_what_is_compiled_in_stands_in_the_text(tmp_path: Path, body: str) -> None:
    (tmp_path / "more.glsl").write_text("int mode = MODE;\n")
    header = "/*---\ndoc: It has a MODE.\nparams: {mode: {choices: [a, b]}}\n---*/\n// MODE\n"
    if body:
        assert load(tmp_path, header + body + BODY).cls.parameters()["mode"].role == "define"
    else:
        assert "nor MODE" in mistakes(tmp_path, header + BODY)[0]


def test_a_header_ends(tmp_path: Path) -> None:
    assert mistakes(tmp_path, "\n/*---\ndoc: x\n") == ["2:1: RG440 the header has no end; it ends with a line '---*/'"]
    assert mistakes(tmp_path, "/*---\ndoc: x */\n---*/\n") == [
        "2:1: RG440 the header is ended by '*/' here; it ends with a line '---*/'"
    ]


def test_a_header_begins_without_blanks(tmp_path: Path) -> None:
    assert mistakes(tmp_path, "// so\n  /* ---\ndoc: x\n---*/\n" + BODY) == [
        "2:3: RG440 a header begins with a line '/*---', without spaces"
    ]
    assert load(tmp_path, "/* ---\nno header\n--- */\n" + BODY).cls.__doc__ == "The shader effect.frag."


def test_a_banner_is_no_header(tmp_path: Path) -> None:
    banner = "/*--------\n * doc: no\n *--------*/\n"
    assert load(tmp_path, banner + BODY).cls.__doc__ == "The shader effect.frag."


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("layout(r32f) uniform image2D a;", "1:1: RG443 a compute shader declares the size of its work groups"),
        (
            "layout(local_size_x = N) in;\nlayout(r32f) uniform image2D a;",
            "1:1: RG443 local_size_x: 'N' is neither a number nor a macro that is one; write a number",
        ),
        (
            "layout(local_size_x = 0) in;\nlayout(r32f) uniform image2D a;",
            "1:1: RG443 local_size_x: expected a whole number from 1 to 1024, got 0",
        ),
        (
            "/*---\nthreads: b\n---*/\nlayout(local_size_x = 8) in;\nlayout(r32f) uniform image2D a;",
            "2:10: RG443 'threads' names no texture of this node: 'b'",
        ),
        (
            "layout(local_size_x = 8) in;\nbuffer a { uint b; };",
            "2:8: RG441 the buffer 'a' has no size; add outputs: {a: {bytes: N}} to the header",
        ),
    ],
)
def test_wrong_compute_shaders(tmp_path: Path, text: str, message: str) -> None:
    assert mistakes(tmp_path, text, "effect.comp")[0].startswith(message)


CONTRADICTIONS = {
    "a second header": (
        "outputs: {c: {doc: C.}}\n---*/\nout vec4 c;\n/*---\ndoc: Y.",
        "",
        "5:1: RG440 a file has one header; put this one into the header that begins in line 1",
    ),
    "a limit that is none": (
        "outputs: {c: {doc: C.}}\nparams: {k: {default: 1, min: .nan, doc: K.}}",
        "uniform float k;\nout vec4 c;",
        "3:31: RG440 'min': expected a number, got nan",
    ),
    "threads of a fragment shader": (
        "threads: [8, 8]\noutputs: {c: {doc: C.}}",
        "out vec4 c;",
        "2:1: RG443 'threads' is for compute shaders; a full-screen pass runs once for each texel of its target",
    ),
    "a sampler as a function": (
        "inputs: {s: {kind: function, semantic: shadow}}\noutputs: {c: {doc: C.}}",
        "uniform sampler2D s;\nout vec4 c;",
        "2:20: RG444 the header has 's' as a function, but the shader declares 'uniform sampler2D s'; "
        "leave one of them out",
    ),
    "a depth as an out": (
        "outputs: {c: {format: depth32f}}",
        "out vec4 c;",
        "2:23: RG444 format depth32f is incompatible with 'out vec4 c'; leave that out, and write gl_FragDepth",
    ),
    "whole numbers as a vec4": (
        "outputs: {c: {format: rgba32ui}}",
        "out vec4 c;",
        "2:23: RG444 format rgba32ui is incompatible with 'out vec4 c'; a uint format needs uvec4",
    ),
    "a uvec4 as fractions": (
        "outputs: {c: {format: rgba8}}",
        "out uvec4 c;",
        "2:23: RG444 format rgba8 is incompatible with 'out uvec4 c'; that format needs float to vec4",
    ),
}


@pytest.mark.parametrize("name", CONTRADICTIONS)
def test_what_a_header_says_against_itself_or_its_text(tmp_path: Path, name: str) -> None:
    header, text, said = CONTRADICTIONS[name]
    assert mistakes(tmp_path, f"/*---\n{header}\n---*/\n{text}\nvoid main() {{ }}\n") == [said]


@pytest.mark.parametrize(
    ("header", "text"),
    [
        ("outputs: {c: {format: rgba32ui}}", "out uvec4 c;"),
        ("outputs: {c: {format: r32i}}", "out int c;"),
        ("outputs: {d: {format: depth32f}, c: {format: rgba8}}", "out vec4 c;"),
        ("params: {f: {default: 1, role: structural}}\noutputs: {c: {format: rgba8}}", "out vec3 c;"),
    ],
)
def test_formats_that_hold_what_is_declared(tmp_path: Path, header: str, text: str) -> None:
    assert load(tmp_path, f"/*---\n{header}\n---*/\n{text}\nvoid main() {{ }}\n").cls.outputs()
