"""GLSL as text: includes, prefixed functions, program text, driver messages."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from rendergraph.api import Any as AnyTexture
from rendergraph.api import Function, Input, Node, Output, ShadowLookup, ShadowMap, Signature, Visibility, param
from rendergraph.catalog import NodeType
from rendergraph.errors import InputError, Problem
from rendergraph.expand import ViewTable
from rendergraph.glsl import Includes, declared, expand, strip_comments
from rendergraph.glsl.names import calls, renamed
from rendergraph.glsl.source import Origin, SourceText
from rendergraph.program import StageText, compile_problems, link_problems, prefix, stage_texts
from rendergraph.resources import folder as folder_of
from rendergraph.steps import FunctionBinding, Read, Resource, Step
from rendergraph.textures import TextureDesc


@pytest.fixture
def shaders(tmp_path: Path) -> Path:
    """A folder for an author's shaders, with a shared include folder beside it."""
    (tmp_path / "include").mkdir()
    (tmp_path / "include" / "view.glsl").write_text("struct View { mat4 view; };\n")
    (tmp_path / "include" / "fullscreen.vert").write_text("void main() {}\n")
    (tmp_path / "own").mkdir()
    return tmp_path / "own"


def write(folder: Path, **files: str) -> None:
    for name, text in files.items():
        file = folder / name.replace("__", ".")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)


def problem(error: pytest.ExceptionInfo[InputError]) -> Problem:
    (found,) = error.value.problems
    return found


# --- includes --------------------------------------------------------------------------------------------------------


def test_lines_know_their_file_and_line(shaders: Path) -> None:
    write(shaders, a__frag='int one;\n#include "b.glsl"\nint four;\n', b__glsl="int two;\nint three;\n")
    source = expand(shaders / "a.frag", shaders.parent / "include")
    rows = [
        (line, o.file.name, o.line) for line, o in zip(source.lines, source.origins, strict=True) if line and o.file
    ]
    assert rows == [
        ("int one;", "a.frag", 1),
        ("int two;", "b.glsl", 1),
        ("int three;", "b.glsl", 2),
        ("int four;", "a.frag", 3),
    ]


def test_a_file_is_compiled_once_a_stage(shaders: Path) -> None:
    write(
        shaders,
        a__frag='#include "b.glsl"\n#include "c.glsl"\n#include "b.glsl"\n',
        b__glsl="int b;\n",
        c__glsl='#include "b.glsl"\n',
    )
    assert expand(shaders / "a.frag", shaders.parent / "include").text.count("int b;") == 1


def test_an_include_that_may_not_be_compiled_does_not_hide_a_later_one(shaders: Path) -> None:
    write(shaders, a__frag='#if X\n#include "b.glsl"\n#endif\n#include "b.glsl"\n', b__glsl="int b;\n")
    text = expand(shaders / "a.frag", shaders.parent / "include").text
    assert text.count("int b;") == 2
    assert text.count("#ifndef INCLUDED_0") == 2


def test_comments_keep_their_room_and_hide_includes(shaders: Path) -> None:
    assert strip_comments("a /* b\nc */ d // e\nf") == "a     \n     d     \nf"
    assert strip_comments("a // b\n/* c */ /* d\ne") == "a     \n        /* d\ne"  # for the driver to say so
    write(shaders, a__frag='// #include "nowhere.glsl"\n/*\n#include "nowhere.glsl"\n*/\n')
    assert expand(shaders / "a.frag", shaders.parent / "include").text.strip() == ""


@pytest.mark.parametrize(
    ("text", "code", "line", "says"),
    [
        ('int a;\n#include "lihgt.glsl"', "RG401", 2, "did you mean 'light.glsl'?"),
        ("#include <veiw.glsl>", "RG401", 1, "did you mean 'view.glsl'?"),
        ('#include "a.frag"', "RG402", 1, "a.frag includes a.frag"),
        ('#include "loop.glsl"', "RG402", 1, "loop.glsl includes loop2.glsl includes loop.glsl"),
        ("#version 450", "RG404", 1, "'#version' is written by rendergraph"),
        ("  #line 3", "RG404", 1, "'#line' is written by rendergraph"),
        ("#include light.glsl", "RG405", 1, "is not '#include <name.glsl>'"),
        ('#include "../../secret.glsl"', "RG406", 1, "lies outside"),
        ("#include </etc/passwd>", "RG406", 1, "lies outside"),
    ],
)
def test_what_is_wrong_with_an_include(shaders: Path, text: str, code: str, line: int, says: str) -> None:
    write(shaders, a__frag=text, light__glsl="", loop__glsl='#include "loop2.glsl"', loop2__glsl='#include "loop.glsl"')
    with pytest.raises(InputError, match=code) as error:
        expand(shaders / "a.frag", shaders.parent / "include")
    found = problem(error)
    assert says in found.text
    assert found.place is not None
    assert found.place.line == (1 if "loop" in text else line)
    assert Path(found.place.file).name == ("loop2.glsl" if "loop" in text else "a.frag")


def test_a_link_does_not_lead_out_of_the_root(shaders: Path, tmp_path: Path) -> None:
    (tmp_path / "secret.glsl").write_text("int secret;\n")
    (shaders / "inside.glsl").symlink_to(tmp_path / "secret.glsl")
    write(shaders, a__frag='#include "inside.glsl"\n')
    with pytest.raises(InputError, match="RG406"):
        expand(shaders / "a.frag", shaders.parent / "include")


def test_limits_of_depth_and_size(shaders: Path) -> None:
    for number in range(40):
        (shaders / f"n{number}.glsl").write_text(f'#include "n{number + 1}.glsl"\n')
    write(shaders, n40__glsl="", big__frag="int a;\n" * 200_000, a__frag='#include "n0.glsl"\n')
    with pytest.raises(InputError, match="RG403 includes are nested deeper than 32"):
        expand(shaders / "a.frag", shaders.parent / "include")
    with pytest.raises(InputError, match="RG403 the shader is larger than 1,000,000 bytes"):
        expand(shaders / "big.frag", shaders.parent / "include")
    write(shaders, half__glsl="int a;\n" * 100_000)
    write(shaders, b__frag='#if A\n#include "half.glsl"\n#endif\n#if B\n#include "half.glsl"\n#endif\n')
    with pytest.raises(InputError, match="with its includes is larger than 1,000,000 bytes"):
        expand(shaders / "b.frag", shaders.parent / "include")


def test_missing_and_unreadable_files(shaders: Path) -> None:
    write(shaders, glow__frag="")
    with pytest.raises(InputError, match=r"RG400 there is no shader .*glov\.frag'; did you mean 'glow\.frag'\?"):
        expand(shaders / "glov.frag", shaders.parent / "include")
    (shaders / "latin.frag").write_bytes(b"int a; \xe9\n")
    with pytest.raises(InputError, match="RG407 the shader is not UTF-8"):
        expand(shaders / "latin.frag", shaders.parent / "include")


# --- names -----------------------------------------------------------------------------------------------------------

TEXT = """#define SCALE 2.0
#define TWICE(x) ((x) * SCALE)
layout(location = 0) uniform sampler2D map;
uniform vec3 color, tints[4];
layout(std140) uniform box_block { vec4 low; vec4 high[2]; };
uniform named_block { float size; } named;
layout(rgba16f) uniform writeonly image2D target;
layout(std430) readonly buffer list { uint entries[]; };
struct Hit { float size; vec3 color; };
const int table[2] = int[](1, 2);
float before = 1.0, after;
in vec2 v_uv;
flat in int v_material;
out vec4 made;
precision highp float;
float area(Hit hit);
float area(Hit hit) { float local = hit.size; return local * named.size + low.x; }
void main() { made = vec4(color, 1.0); }
"""


def test_declared_names() -> None:
    assert declared(TEXT) == {
        "SCALE",
        "TWICE",
        "map",
        "color",
        "tints",
        "box_block",
        "low",
        "high",
        "named_block",
        "named",
        "target",
        "list",
        "entries",
        "Hit",
        "table",
        "before",
        "after",
        "v_uv",
        "v_material",
        "made",
        "area",
        "main",
    }


def test_renaming_leaves_members_alone() -> None:
    names = declared(TEXT) | {"size"}
    text = renamed(TEXT, lambda word: f"p_{word}" if word in names else word)
    assert "struct p_Hit { float size; vec3 color; };" in text
    assert "uniform p_named_block { float size; } p_named;" in text
    assert "float local = hit.size; return local * p_named.size + p_low.x;" in text
    assert "#define p_TWICE(x) ((x) * p_SCALE)" in text
    assert "p_made = vec4(p_color, 1.0);" in text


def test_calls() -> None:
    assert calls("void main() { float x = shadow(0, p, n); }", "shadow")
    assert not calls("float shadow(int i) { return 1.0; } void main() { shadow(0); }", "shadow")
    assert not calls("void main() { my_shadow(0); a.shadow(); }", "shadow")


@pytest.mark.parametrize(
    ("node", "expected"),
    [
        ("shadows", "shadows_"),
        ("glow/blur", "glowZsblur_"),
        ("a-b", "aZdb_"),
        ("a_b", "aZub_"),
        ("Z", "ZZ_"),
        ("gl", "Zgl_"),
    ],
)
def test_prefixes_are_identifiers(node: str, expected: str) -> None:
    assert prefix(node) == expected


# --- program text ----------------------------------------------------------------------------------------------------

Glow = Signature("glow", "vec3 glow(vec2 uv)", ("uv",), "+", "vec3(0.0)", "Light added.")


class Provider(Node):
    """Gives a shadow."""

    shadow_map = Input(ShadowMap, kind="texture2d_array", doc="map")
    mask = Input(AnyTexture, optional=True, doc="mask")
    lookup = Function(ShadowLookup, "shadow.glsl", reads=("shadow_map",), doc="lookup")
    softness: float = param(default=1.0, doc="softness")


class Consumer(Node):
    """Asks for one."""

    lookup = Input(ShadowLookup, kind="function", many=True, optional=True, doc="lookup")
    glow_from = Input(Glow, kind="function", optional=True, doc="glow")
    visibility = Input(Visibility, kind="texture2d_array", many=True, optional=True, doc="visibility")
    made = Output(AnyTexture, doc="made")


SHADOW = """#include <view.glsl>
#include "kernel.glsl"
uniform sampler2DArrayShadow shadow_map;
uniform float softness;
#ifdef HAS_MASK
#error the mask is not connected
#endif
float shadow(int light, vec3 position, vec3 normal) {
    for (int i = 0; i < SHADOW_MAP_LAYERS; ++i)
        if (shadow_map_lights[i] == light) return kernel(softness) * shadow_map_views[i].view[0][0];
    return 1.0;
}
"""


def types(folder: Path) -> dict[str, NodeType]:
    def node(cls: type[Node]) -> NodeType:
        return NodeType(cls.__name__.lower(), "", cls, folder / "x.py", folder)

    return {"light": node(Consumer), "sun-soft": node(Provider), "lamp": node(Provider)}


RESOURCES = {
    "sun.map": Resource(
        "sun.map", TextureDesc("texture2d_array", "depth32f", 8, 8, layers=2), view="sun.views", lights=(3, 1)
    ),
    "vis": Resource("vis", TextureDesc("texture2d_array", "r16", 8, 8, layers=2), lights=(0, 2)),
}
VIEWS = {"camera": ViewTable(), "sun.views": ViewTable(2, (3, 1))}


def step(*providers: str, shader: str = "light.frag", visibility: bool = False) -> Step:
    bindings = tuple(
        FunctionBinding(
            "shadow", node, "shadow.glsl", (Read("shadow_map", "sun.map", 1),), (("TAPS", "3"),), (("softness", 2.0),)
        )
        for node in providers
    )
    reads = (Read("visibility_0", "vis", 1),) if visibility else ()
    return Step(
        "light", 0, "fullscreen", (("fragment", shader),), reads=reads, functions=bindings, defines=(("HAS_MASK", "1"),)
    )


def fragment(folder: Path, given: Step) -> StageText:
    return stage_texts(given, types(folder), RESOURCES, VIEWS, include_folder=folder.parent / "include")["fragment"]


@pytest.fixture
def folder(shaders: Path) -> Path:
    write(
        shaders,
        shadow__glsl=SHADOW,
        kernel__glsl="const float WIDTH = 2.0;\nfloat kernel(float s) { return s * WIDTH; }\n",
        light__frag="out vec4 made;\nvoid main() { made = vec4(shadow(3, vec3(0.0), vec3(1.0))); }\n",
    )
    return shaders


def test_every_name_of_a_provider_is_prefixed(folder: Path) -> None:
    text = fragment(folder, step("sun-soft")).text
    assert text.startswith("#version 450 core\n")
    assert "uniform sampler2DArrayShadow sunZdsoft_shadow_map;" in text
    assert "#define sunZdsoft_SHADOW_MAP_LAYERS 2" in text
    assert "const int sunZdsoft_shadow_map_lights[2] = int[](3, 1);" in text
    assert (
        "uniform sunZdsoft_shadow_map_view_block { View sunZdsoft_shadow_map_views[sunZdsoft_SHADOW_MAP_VIEW_COUNT]; };"
        in text
    )
    assert "return sunZdsoft_kernel(sunZdsoft_softness) * sunZdsoft_shadow_map_views[i].view[0][0];" in text
    assert "#ifdef sunZdsoft_HAS_MASK" in text  # not the consumer's
    assert "#define sunZdsoft_TAPS 3" in text
    assert text.count("struct View") == 1
    assert "result = result * sunZdsoft_shadow(light, position, normal);" in text


def test_providers_multiply(folder: Path) -> None:
    text = fragment(folder, step("sun-soft", "lamp")).text
    assert "result = result * sunZdsoft_shadow(light, position, normal);" in text
    assert "result = result * lamp_shadow(light, position, normal);" in text
    assert "lamp_kernel" in text


def test_without_a_provider_the_function_is_neutral(folder: Path) -> None:
    text = fragment(folder, step()).text
    assert (
        "float shadow(int light, vec3 position, vec3 normal) {\n    float result = 1.0;\n    return result;\n}" in text
    )
    write(folder, glow__frag="out vec4 made;\nvoid main() { made.rgb = glow(vec2(0.0)); }\n")
    assert "vec3 result = vec3(0.0);\n    return result;" in fragment(folder, step(shader="glow.frag")).text


def test_a_function_that_is_not_called_is_left_out(folder: Path) -> None:
    write(folder, plain__frag="out vec4 made;\nvoid main() { made = vec4(1.0); }\n")
    assert "shadow" not in fragment(folder, step("lamp", shader="plain.frag")).text


def test_visibility_is_looked_up_at_the_fragment(folder: Path) -> None:
    text = fragment(folder, step("lamp", visibility=True)).text
    assert "uniform sampler2DArray visibility_0;" in text
    assert "if (light == 2) result = result * texelFetch(visibility_0, ivec3(ivec2(gl_FragCoord.xy), 1), 0).r;" in text
    assert "#define VISIBILITY_COUNT 1" in text


def test_shaders_can_ask_which_lights_have_shadows(folder: Path) -> None:
    write(folder, ask__frag="#if SHADOW_LIGHT_COUNT > 0\nint first = shadow_lights[0];\n#endif\nvoid main() {}\n")
    text = fragment(folder, step("lamp", shader="ask.frag", visibility=True)).text
    assert "#define SHADOW_LIGHT_COUNT 4\nconst int shadow_lights[4] = int[](3, 1, 0, 2);" in text
    assert "#define SHADOW_LIGHT_COUNT 0\n" in fragment(folder, step(shader="ask.frag")).text


def test_a_provider_must_define_its_function(folder: Path) -> None:
    write(folder, shadow__glsl="float shade(int light) { return 1.0; }\n")
    with pytest.raises(
        InputError, match=r"RG408 node 'lamp' \(provider\): 'shadow.glsl' does not define 'float shadow\("
    ):
        fragment(folder, step("lamp"))


def test_extensions_come_first(folder: Path) -> None:
    write(folder, ext__frag="out vec4 made;\n#extension GL_ARB_shader_ballot : enable\nvoid main() {}\n")
    assert fragment(folder, step(shader="ext.frag")).text.splitlines()[1] == "#extension GL_ARB_shader_ballot : enable"


def test_the_same_step_gives_the_same_text(folder: Path) -> None:
    assert fragment(folder, step("lamp")).text == fragment(folder, step("lamp")).text


# --- messages --------------------------------------------------------------------------------------------------------


def line_of(text: StageText, part: str) -> int:
    return next(number for number, line in enumerate(text.source.lines, start=1) if part in line)


@pytest.mark.parametrize(
    "form",
    [
        "0:{line}(9): error: `x' undeclared",
        "0({line}) : error C1503: `x' undeclared",
        "ERROR: 0:{line}: `x' undeclared",
    ],
    ids=["mesa", "nvidia", "glslang"],
)
def test_driver_messages_name_the_authors_line(folder: Path, form: str) -> None:
    text = fragment(folder, step("lamp"))
    (found,) = compile_problems("header\n" + form.format(line=line_of(text, "made = vec4")), text)
    assert found.code == "RG410"
    assert found.text == "node 'light': fragment shader: `x' undeclared"
    assert found.place is not None
    assert (Path(found.place.file).name, found.place.line) == ("light.frag", 2)
    assert "made = vec4(shadow(3" in found.line_text


def test_messages_inside_a_function_lose_the_prefix(folder: Path) -> None:
    text = fragment(folder, step("lamp"))
    row = line_of(text, "return lamp_kernel")
    (found,) = compile_problems(f"0:{row}(60): error: no function `lamp_kernel'", text)
    assert found.text == "node 'light': fragment shader: no function `kernel'"
    assert found.place is not None
    assert (Path(found.place.file).name, found.place.line) == ("shadow.glsl", 10)
    assert "lamp_" not in found.line_text


def test_messages_about_generated_lines_say_so() -> None:
    text = StageText("fragment", SourceText(("#define X 1 2", "int a;"), (Origin(), Origin(Path("a.frag"), 1))))
    (found,) = compile_problems("0:1(1): error: odd", text)
    assert "in generated text: #define X 1 2" in found.text
    assert found.place is not None
    assert found.place.file == "a.frag"


def test_warnings_are_left_out_where_there_are_errors(folder: Path) -> None:
    text = fragment(folder, step())
    found = compile_problems("0:1(1): warning: w\n0:1(1): error: e\n0:1(1): error: e", text)
    assert [(p.severity, "e" in p.text) for p in found] == [("error", True)]
    assert compile_problems("out of memory", text)[0].text == "node 'light': fragment shader: out of memory"


def test_link_messages_name_the_stages(folder: Path) -> None:
    texts = stage_texts(step(), types(folder), RESOURCES, VIEWS, include_folder=folder.parent / "include")
    (found,) = link_problems("error: fragment shader input `v_x' has no matching output\n", texts)
    assert found.code == "RG411"
    assert found.text.startswith("node 'light': the stages vertex, fragment do not link: fragment shader input")


def test_includes_of_two_prefixes_are_both_there(shaders: Path) -> None:
    write(shaders, a__glsl='#include "b.glsl"\n', b__glsl="int b;\n")
    resolver = Includes(shaders.parent / "include")
    assert "int b;" in resolver.expand(shaders / "a.glsl", prefix="one_").text
    assert "int b;" in resolver.expand(shaders / "a.glsl", prefix="two_").text


# --- error pages -----------------------------------------------------------------------------------------------------

PAGES = {path.name[:5]: path for path in sorted(folder_of("rendergraph.errors").glob("RG40*.yaml"))}


def message_of(error: InputError) -> str:
    """A problem as its page has it: without the file, and without the line of text."""
    (found,) = error.problems
    place = f"{found.place.line}:{found.place.column}: " if found.place and found.place.line else ""
    return f"{place}{found.code} {found.text}"


@pytest.mark.parametrize("code", ["RG401", "RG402", "RG404", "RG405", "RG406"])
def test_error_pages_say_what_is_said(shaders: Path, monkeypatch: pytest.MonkeyPatch, code: str) -> None:
    page = yaml.safe_load(PAGES[code].read_text())
    monkeypatch.chdir(shaders)
    write(shaders, glow__frag=page["wrong"], kernel__glsl="", secret__glsl="")
    with pytest.raises(InputError, match=code) as error:
        expand(shaders / "glow.frag", shaders.parent / "include")
    assert message_of(error.value) == page["message"]
    write(shaders, glow__frag=page["right"])
    expand(shaders / "glow.frag", shaders.parent / "include")


def test_error_pages_of_files_and_functions(shaders: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pages = {code: yaml.safe_load(path.read_text()) for code, path in PAGES.items()}
    monkeypatch.chdir(shaders)
    write(shaders, glow__frag="", big__frag="int a;\n" * 200_000)
    (shaders / "latin.frag").write_bytes(pages["RG407"]["wrong"].encode("latin-1"))
    for code, name in (("RG400", "glov.frag"), ("RG403", "big.frag"), ("RG407", "latin.frag")):
        with pytest.raises(InputError, match=code) as error:
            expand(shaders / name, shaders.parent / "include")
        assert message_of(error.value) == pages[code]["message"]
    write(folder, shadow__glsl=pages["RG408"]["wrong"])
    with pytest.raises(InputError, match="RG408") as error:
        fragment(folder, step("lamp"))
    assert message_of(error.value) == pages["RG408"]["message"]
