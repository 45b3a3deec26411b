"""The final text of a program: functions under their givers' names, views, macros, and what drivers say of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from msgspec.structs import replace

from rendergraph.api import Any as AnyTexture
from rendergraph.api import Function, Input, Node, Output, ShadowLookup, ShadowMap, Signature, Visibility, param
from rendergraph.catalog import NodeType
from rendergraph.errors import InputError
from rendergraph.expand import ViewTable
from rendergraph.glsl.source import Origin, SourceText
from rendergraph.program import StageText, StepTexts, TextSources, prefix, stage_texts
from rendergraph.program.messages import compile_problems, link_problems
from rendergraph.resources import folder as folder_of
from rendergraph.steps import FunctionBinding, Read, Resource, Step
from rendergraph.textures import TextureDesc


def write(folder: Path, **files: str) -> None:
    for name, text in files.items():
        file = folder / name.replace("__", ".")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)


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
    sources = TextSources(types(folder), RESOURCES, VIEWS)
    return stage_texts(given, sources, include_folder=folder.parent / "include")["fragment"]


@pytest.fixture
def folder(shaders: Path) -> Path:
    write(
        shaders,
        shadow__glsl=SHADOW,
        kernel__glsl="const float WIDTH = 2.0;\nfloat kernel(float s) { return s * WIDTH; }\n",
        light__frag="out vec4 made;\nvoid main() { made = vec4(shadow(3, vec3(0.0), vec3(1.0))); }\n",
    )
    return shaders


def test_texts_of_equal_steps_are_put_together_once_and_of_others_not(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = "rendergraph.program.text"
    made: list[Step] = []

    def counted(given: Step, *arguments: Any, **named: Any) -> dict[str, StageText]:
        made.append(given)
        return stage_texts(given, *arguments, **named, include_folder=folder.parent / "include")

    monkeypatch.setattr(f"{whole}.stage_texts", counted)
    resources = RESOURCES | {
        "same": replace(RESOURCES["vis"], id="same"),
        "wide": replace(RESOURCES["vis"], id="wide", desc=TextureDesc("texture2d_array", "r16", 8, 8, layers=5)),
        "lit": replace(RESOURCES["vis"], id="lit", lights=(0, 3)),
    }
    texts = StepTexts(TextSources(types(folder) | {"other": types(folder)["light"]}, resources, VIEWS))
    base = step("sun-soft", visibility=True)
    first = texts.of(base, {"A": "1"})
    again = texts.of(replace(base, node="other", index=3, reads=(Read("visibility_0", "same", 2),)), {"A": "1"})
    assert len(made) == 1
    assert again["fragment"].text == first["fragment"].text
    assert (first["fragment"].node, again["fragment"].node) == ("light", "other")
    for given, defines in (
        (base, {"A": "2"}),
        (replace(base, defines=(("HAS_MASK", "0"),)), {"A": "1"}),
        (replace(base, reads=(Read("visibility_0", "wide", 1),)), {"A": "1"}),
        (replace(base, reads=(Read("visibility_0", "lit", 1),)), {"A": "1"}),
        (step("lamp", visibility=True), {"A": "1"}),
        (step("sun-soft"), {"A": "1"}),
    ):
        before = len(made)
        texts.of(given, defines)
        assert len(made) == before + 1

    before = len(made)
    another = TextSources(types(folder), resources, VIEWS)
    assert StepTexts(another).of(base, {"A": "1"})["fragment"].text == first["fragment"].text
    assert len(made) == before  # another pipeline's step, as long as the files are what they were
    (folder / "kernel.glsl").write_text("const float WIDTH = 7.25;\nfloat kernel(float s) { return s * WIDTH; }\n")
    assert "7.25" in StepTexts(another).of(base, {"A": "1"})["fragment"].text
    assert len(made) == before + 1


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


def test_macros_are_there_where_they_are_looked_at(folder: Path) -> None:
    write(
        folder,
        count__frag="void main() { int count = VISIBILITY_COUNT; }\n",
        between__frag="#ifdef OUTER\nconst int first = OUTER;\n#endif\nvoid main() {}\n",
    )
    text = fragment(folder, step(shader="count.frag", visibility=True)).text
    assert "#define VISIBILITY_COUNT 1" in text
    assert "VISIBILITY_LAYERS" not in text
    defines = (("OUTER", "(2 * INNER)"), ("INNER", "3"), ("OTHER", "4"))
    text = fragment(folder, replace(step(shader="between.frag"), defines=defines)).text
    assert "#define OUTER (2 * INNER)\n#define INNER 3\n" in text
    assert "OTHER" not in text


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
    text = StageText("fragment", SourceText.of([("#define X 1 2", Origin()), ("int a;", Origin(Path("a.frag"), 1))]))
    (found,) = compile_problems("0:1(1): error: odd", text)
    assert "in generated text: #define X 1 2" in found.text
    assert found.place is not None
    assert found.place.file == "a.frag"


def test_warnings_are_left_out_where_there_are_errors(folder: Path) -> None:
    text = fragment(folder, step())
    found = compile_problems("0:1(1): warning: w\n0:1(1): error: e\n0:1(1): error: e", text)
    assert [(p.severity, "e" in p.message) for p in found] == [("error", True)]
    assert compile_problems("out of memory", text)[0].message == "node 'light': fragment shader: out of memory"


def test_link_messages_name_the_stages(folder: Path) -> None:
    sources = TextSources(types(folder), RESOURCES, VIEWS)
    texts = stage_texts(step(), sources, include_folder=folder.parent / "include")
    (found,) = link_problems("error: fragment shader input `v_x' has no matching output\n", texts)
    assert found.code == "RG411"
    assert found.text.startswith("node 'light': the stages vertex, fragment do not link: fragment shader input")


def test_a_function_that_its_file_does_not_define(folder: Path) -> None:
    page = yaml.safe_load((folder_of("rendergraph.errors") / "RG408-function-not-defined.yaml").read_text())
    write(folder, shadow__glsl=page["wrong"])
    with pytest.raises(InputError, match="RG408") as error:
        fragment(folder, step("lamp"))
    (found,) = error.value.problems
    assert found.place is not None
    assert f"{found.place.line}:{found.place.column}: {found.code} {found.message}" == page["message"]
