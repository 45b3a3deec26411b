"""`nodes`, `explain` and `schema`: everything there is can be asked about."""

from __future__ import annotations

import json
import re
import textwrap
from pathlib import Path
from typing import Any, Literal

import pytest

from rendergraph.api import Any as Anything
from rendergraph.api import (
    Depth,
    DisplayColor,
    Function,
    InOut,
    Input,
    Internal,
    Layout,
    Node,
    Output,
    Radiance,
    ShadowLookup,
    param,
)
from rendergraph.catalog import Catalog
from rendergraph.cli.output import table
from rendergraph.reference import describe_node, error_codes, example_text, input_facts, output_facts
from rendergraph.resources import folder

CATALOG = Catalog.discover()
CODES = error_codes()


def test_nodes_lists_every_type(cli: Any) -> None:
    listed = cli("nodes")
    told = cli("nodes", "--json").json["nodes"]
    assert [entry["name"] for entry in told] == [n for names in CATALOG.families().values() for n in names]
    for entry in told:
        assert entry["name"] in listed.out
        assert entry["doc"].partition("\n")[0] in listed.out


@pytest.mark.nightly(keep=16)
@pytest.mark.slow
@pytest.mark.parametrize("name", CATALOG.names())
def test_every_node_can_be_explained(cli: Any, name: str) -> None:
    text = cli("explain", name).out
    told = cli("explain", name, "--json").json
    assert told["name"] == name
    for port in (*told["inputs"], *told["outputs"], *told["parameters"]):
        assert port["name"] in text
        assert port["doc"] in text
    alone = re.fullmatch(r"extends: (.*)\n?", told["example"])
    whole = (folder("rendergraph.pipelines") / f"{alone[1]}.yaml").read_text() if alone else text
    assert f"type: {name}" in whole


@pytest.mark.nightly(keep=60)
@pytest.mark.slow
@pytest.mark.parametrize("code", CODES)
def test_every_code_can_be_explained(cli: Any, code: str) -> None:
    text = cli("explain", code.lower()).out
    page = cli("explain", code, "--json").json
    assert text.startswith(f"{code}  {page['title']}")
    assert page["message"].strip().splitlines()[0].strip() in text


def test_shaders_are_hinted_at(cli: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.glsl").write_text("")
    (tmp_path / "film.frag").write_text("out vec4 made;\nvoid main() { made = vec4(1.0); }\n")
    assert "RG511 unknown name 'film'; did you mean './film.frag'?" in cli("explain", "film").err
    assert "RG400 there is no shader 'nothere.frag'; available: film.frag\n" in cli("explain", "./nothere.frag").err
    assert cli("explain", "./film.frag").out.startswith("./film.frag\n")


@pytest.mark.parametrize(
    ("topic", "keys"), [("scene", ["keyframes", "fov_y_degrees"]), ("pipeline", ["extends", "params"])]
)
def test_files_can_be_explained(cli: Any, topic: str, keys: list[str]) -> None:
    text = cli("explain", topic).out
    told = cli("explain", topic, "--json").json["keys"]
    assert all(entry["doc"] for entry in told)
    for key in keys:
        assert f"  {key} " in text
        assert key in {entry["key"] for entry in told}


def test_the_schema_is_json_and_goes_into_a_file(cli: Any, tmp_path: Path) -> None:
    text = cli("schema").out
    assert "tonemap" in json.dumps(json.loads(text))
    assert cli("schema", "-o", "s.json").out == "s.json\n"
    assert json.loads((tmp_path / "s.json").read_text()) == json.loads(text)
    assert cli("schema", "-o", "s.json", "--json").json == {"output": "s.json"}
    (tmp_path / "broken.py").write_text("1 / 0\n")
    told = cli("schema", "--plugin", "broken.py")
    assert re.match(r"broken\.py:1:1: warning: RG491 .* ZeroDivisionError", told.err)
    assert '"broken"' in told.out


class Sample(Node):
    """What every kind of port looks like.

    More.
    """

    radiance = Input(Radiance, group="all", filter="linear", wrap="repeat", doc="In.")
    depth = Input(Depth, optional=True, use="depth_test", doc="Tested.")
    shadows = Input(ShadowLookup, kind="function", many=True, optional=True, doc="Shadows.")
    target = InOut(Radiance, optional=True, doc="Continued.")
    color = Output(DisplayColor, format="rgba8", size=0.5, mips=0, clear=(0, 0, 0, 1), doc="Out.")
    same = Output(like="radiance", doc="Same.")
    lookup = Function(ShadowLookup, "s.glsl", needs=("radiance",), doc="Lookup.")
    scratch = Internal(like="radiance")
    gain: float = param(default=1.0, unit="EV", min=0, max=2, doc="Gain.")
    tint: float | tuple[float, float, float] = param(default=(1.0, 1.0, 1.0), doc="Tint.")
    mode: Literal["a", "b"] = param(default="a", doc="Mode.")


def test_a_description_names_the_exact_twin() -> None:
    catalog = Catalog.discover()
    assert describe_node(catalog.get("shadow_pcf"))["twin"] == "traced_shadows"
    assert describe_node(catalog.get("traced_occlusion"))["twin"] is None  # of itself


def test_a_description_says_everything() -> None:
    found = describe_node(Catalog.of(Sample).get("sample"))
    inputs = {port["name"]: port for port in found["inputs"]}
    outputs = {port["name"]: port for port in found["outputs"]}
    parameters = {entry["name"]: entry for entry in found["parameters"]}
    assert inputs["radiance"]["group"] == "all"
    assert (
        inputs["shadows"] | {"many": True, "optional": True, "kind": "function", "semantic": "shadow"}
        == inputs["shadows"]
    )
    assert inputs["target"]["continues"]
    assert outputs["color"]["size"] == "viewport × 0.5"
    assert outputs["same"]["like"] == "radiance"
    assert outputs["lookup"]["needs"] == ["radiance"]
    assert "target" in outputs
    assert [port["name"] for port in found["internal"]] == ["scratch"]
    assert parameters["gain"] == {
        "name": "gain",
        "type": "number",
        "default": 1.0,
        "role": "param",
        "unit": "EV",
        "doc": "Gain.",
        "min": 0,
        "max": 2,
    }
    assert parameters["tint"]["type"] == "number | [3 numbers]"
    assert parameters["mode"]["choices"] == ["a", "b"]
    json.dumps(found)
    facts = {port["name"]: ", ".join(input_facts(port)) for port in found["inputs"]}
    assert facts == {
        "radiance": "in group all, linear, repeat",
        "depth": "optional, for the depth test only",
        "shadows": "optional, one or a list, function",
        "target": "optional, continued",
    }
    facts = {port["name"]: ", ".join(output_facts(port)) for port in found["outputs"]}
    assert facts == {
        "target": "rgba16f, viewport",
        "color": "rgba8, viewport × 0.5, all mips, cleared to [0, 0, 0, 1]",
        "same": "",
        "lookup": "function, needs radiance, float shadow(int light, vec3 position, vec3 normal)",
    }


class Sparks(Node):
    """Buffers of elements, and a border of its own."""

    before = Input(Anything, kind="buffer", element=Layout("Spark", {"age": "float"}), doc="In.")
    mask = Input(Anything, wrap="border", border=(1.0, 0.0), doc="In.")
    after = Output(Anything, kind="buffer", element=Layout("Spark", {"age": "float"}), count=64, doc="Out.")


def test_elements_and_borders_are_described() -> None:
    found = describe_node(Catalog.of(Sparks).get("sparks"))
    facts = {port["name"]: ", ".join(input_facts(port)) for port in found["inputs"]}
    assert facts == {"before": "buffer, elements Spark", "mask": "border, border value [1, 0]"}
    assert [", ".join(output_facts(port)) for port in found["outputs"]] == ["buffer, 64 elements Spark"]
    assert found["outputs"][0]["fields"] == {"age": "float"}


class Cube(Node):
    """Takes what no standard node makes."""

    sky = Input(Radiance, kind="texture_cube", doc="In.")
    color = Output(DisplayColor, format="rgba8", doc="Out.")


def test_an_example_has_gaps_where_nothing_fits() -> None:
    catalog = Catalog.of(Cube, Sample)
    assert example_text(catalog.get("cube"), catalog) == "cube: {type: cube, inputs: {sky: NODE.sky}}"


def test_an_example_runs_as_it_is_printed(cli: Any, tmp_path: Path) -> None:
    text = cli("explain", "gaussian_blur").out.partition("Example\n")[2]
    (tmp_path / "a.yaml").write_text(textwrap.dedent(text))
    assert (tmp_path / "a.yaml").read_text().rstrip() == cli("explain", "gaussian_blur", "--json").json["example"]
    assert cli("check", "a.yaml").code == 0


def test_a_type_is_explained_by_its_file(cli: Any, tmp_path: Path) -> None:
    (tmp_path / "dim.frag").write_text(
        "uniform sampler2D radiance;\nout vec4 dimmed;\nvoid main() { dimmed = texelFetch(radiance, ivec2(0), 0); }\n"
    )
    text = cli("explain", "./dim.frag").out
    assert text.startswith("./dim.frag")
    assert "dim: {type: ./dim.frag, inputs: {radiance: light.radiance}}" in text


def test_tables_are_aligned() -> None:
    assert table([("a", 1, "x"), ("bbb", 22, None)], ("n", "v", ""), right=(1,)) == "n     v\na     1  x\nbbb  22"
    assert table([]) == ""


def test_what_is_kept_says_so(cli: Any) -> None:
    described = cli("explain", "ssao_hemisphere", "--json").json
    kept = [port["name"] for port in described["internal"] if port.get("kept")]
    assert kept == ["noise"]
    assert "kept from frame to frame" in cli("explain", "ssao_hemisphere").out


def test_a_node_that_is_installed_says_how_it_is_extended(cli: Any, tmp_path: Path) -> None:
    shown = cli("explain", "hbao").out
    assert (
        "  from rendergraph.nodes.occlusion.hbao import HBAO\n  from rendergraph.nodes.occlusion._directional import"
        in shown
    )
    (tmp_path / "loose.py").write_text(
        'from rendergraph.nodes.occlusion.hbao import HBAO\n\n\nclass Loose(HBAO):\n    """The same."""\n'
    )
    assert cli("explain", "loose", "--plugin", "loose.py", "--json").json["extends"] == []


# --- programs --------------------------------------------------------------------------------------------------------


def test_the_program_of_a_type_and_of_a_node(cli: Any) -> None:
    shown = cli("explain", "tonemap", "--glsl")
    assert shown.code == 0
    assert shown.out.startswith("// step 0 of node 'display' (tonemap) in pipeline 'forward'")
    assert re.search(r"//   uniform float exposure +parameter 'exposure': 0\n", shown.out)
    assert "// ==================== fragment shader\n\n#version 450 core\n" in shown.out
    told = cli("explain", "display", "--glsl", "--pipeline", "forward", "-s", "display.exposure=2", "--json").json
    assert {"section": "uniforms", "name": "uniform float exposure", "source": "parameter 'exposure': 2"} in told[
        "scope"
    ]
    stage = told["stages"]["fragment"]
    assert len(stage["origins"]) == len(stage["text"].splitlines())
    assert stage["origins"][stage["text"].splitlines().index("uniform float exposure;")]["file"].endswith(
        "tonemap.frag"
    )


def test_what_needs_an_environment_is_shown_under_one_and_what_a_step_does_not_bind_is_nobodys(cli: Any) -> None:
    shown = cli("explain", "environment_light", "--glsl").out
    assert "input 'map': the scene's environment" in shown
    assert "nothing in this step" not in shown  # what it writes is there for all that
    shown = cli("explain", "forward_lighting", "--glsl").out  # the lighting, not the table that is made once
    assert "//   uniform sampler2D base_color_texture             the scene's materials" in shown
    assert (
        "//   uniform sampler2DArray shadows_depth_ranges      nothing in this step, which has no use for it" in shown
    )


def test_a_step_of_several_and_a_variant_of_several(cli: Any, tmp_path: Path) -> None:
    shown = cli("explain", "ao", "--glsl", "--pipeline", "ssao-hemisphere", "--step", "2").out
    assert "step 2 of node 'ao' (ssao_hemisphere)" in shown
    assert "//   4  fullscreen  bilateral_blur.frag" in shown
    (tmp_path / "two.yaml").write_text(
        "scene: 1\nobjects: {a: {shape: box}, b: {shape: plane, material: thin}}\nmaterials: {thin: {double_sided: true}}\n"
    )
    dark = ("--scene", "two.yaml", "-s", "light.environment=null")  # which would be lit by more than is asked here
    shown = cli("explain", "light", "--glsl", "--pipeline", "forward", *dark).out
    assert "// the first of 2 variants, which differ in DOUBLE_SIDED 1\n" in shown
    assert "variants" not in cli("explain", "light", "--glsl", "--step", "0", "--pipeline", "forward").out


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (
            "shadows --glsl --pipeline forward",
            3,
            r"RG511 node 'shadows' \(shadow_pcf\) has no program: its function is compiled into that of 'light'",
        ),
        ("ligth --glsl --pipeline forward", 3, r"RG511 pipeline 'forward' has no node 'ligth'; did you mean 'light'"),
        (
            "display --glsl --pipeline forward --step 3",
            2,
            r"RG500 --step: 'display' has no step 3 .* 0 \(tonemap.frag\)",
        ),
        (
            "ssao_hemisphere --glsl -s ao.type=ssao_disc",
            3,
            "RG511 these options leave no node of type 'ssao_hemisphere'",
        ),
        ("tonemap --step 1", 2, "RG500 --pipeline, --step and options that change a pipeline require --glsl"),
        (
            "tonemap -s display.exposure=1",
            2,
            "RG500 --pipeline, --step and options that change a pipeline require --glsl",
        ),
    ],
)
def test_programs_that_are_not_there(cli: Any, words: str, code: int, message: str) -> None:
    answer = cli("explain", *words.split())
    assert answer.code == code
    assert re.search(message, answer.err)


def test_a_shader_file_s_program(cli: Any, tmp_path: Path) -> None:
    (tmp_path / "dim.frag").write_text(
        "//---\n// doc: Darker.\n// inputs: {color: {semantic: display_color}}\n// outputs: {dark: {like: color}}\n//---\n"
        "uniform sampler2D color;\nuniform float gain = 0.5;\nin vec2 v_uv;\nout vec4 dark;\n"
        "void main() { dark = gain * texture(color, v_uv); }\n"
    )
    shown = cli("explain", "./dim.frag", "--glsl")
    assert "dark = gain * texture(color, v_uv);" in shown.out, shown.err
    assert re.search(r"uniform float gain +parameter 'gain': 0\.5", shown.out)
