"""The JSON Schema for editors."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import pytest
import yaml

from rendergraph.catalog import Catalog
from rendergraph.cli.app import main
from rendergraph.document import parse
from rendergraph.resources import folder
from rendergraph.schema import outdated, schema
from rendergraph.settings import Roots

FORWARD = """
rendergraph: 1
size: [64, 64]
parameters: {bias: {default: 2, min: 0, max: 4}}
nodes:
  sun: {type: shadow_map}
  shadows: {type: shadow_pcf, inputs: {shadow_map: sun.shadow_map}, params: {bias: $bias, taps: null}}
  light: {type: forward_lighting, inputs: {lookup: [shadows.lookup]}, params: {ambient: [0.1, 0.1, 0.1]}}
  glow: {type: ./glow.yaml, inputs: {radiance: light.radiance}}
  display: {type: tonemap, inputs: {radiance: glow.radiance}}
outputs: {image: display.color}
"""


@pytest.fixture(scope="module")
def made(toy_catalog: Catalog) -> dict[str, Any]:
    return schema(toy_catalog)


def rules_of(made: dict[str, Any], name: str) -> Any:
    """The `then` of one node type."""
    rules = made["definitions"]["node"]["allOf"]
    return next(rule["then"] for rule in rules if rule["if"]["properties"]["type"]["const"] == name)["properties"]


def test_is_plain_json_and_draft_07(made: dict[str, Any]) -> None:
    text = json.dumps(made, allow_nan=False)
    assert json.loads(text)["$schema"] == "http://json-schema.org/draft-07/schema#"
    assert "prefixItems" not in text


def test_every_type_is_offered_with_its_text(made: dict[str, Any], toy_catalog: Catalog) -> None:
    choices = made["definitions"]["node"]["properties"]["type"]["anyOf"]
    texts = {choice["const"]: choice["description"] for choice in choices if "const" in choice}
    assert sorted(texts) == toy_catalog.names()
    assert texts["tonemap"] == "Radiance to display values.\n\nOutputs:\n\n- `color`: Colour. (display_color)"


def test_a_node_type_has_its_inputs_and_params(made: dict[str, Any]) -> None:
    rules = rules_of(made, "forward_lighting")
    assert list(rules["inputs"]["properties"]) == ["view", "lookup", "visibility", "depth"]
    assert "array" in rules["inputs"]["properties"]["lookup"]["type"]
    assert "array" not in rules["inputs"]["properties"]["depth"]["type"]
    shading = rules["params"]["properties"]["shading"]
    assert shading["anyOf"][0]["enum"] == ["unlit", "phong", "blinn_phong", "pbr"]
    assert shading["default"] == "pbr"
    assert "gbuffer" in rules_of(made, "deferred_lighting")["inputs"]["properties"]


def test_ranges_and_units_are_there(made: dict[str, Any]) -> None:
    exposure = rules_of(made, "tonemap")["params"]["properties"]["exposure"]
    assert (exposure["minimum"], exposure["maximum"]) == (-16, 16)
    assert exposure["type"] == ["number", "string", "null"]  # a string is a pipeline's parameter
    assert exposure["description"] == "Stops.\n\nDefault 0.0 EV, from -16 to 16. Changing it rebuilds nothing."


def test_an_independent_validator_agrees(made: dict[str, Any]) -> None:
    fastjsonschema = pytest.importorskip("fastjsonschema")
    validate = fastjsonschema.compile(made)
    validate(parse(FORWARD).root.plain())
    validate({"extends": "forward", "nodes": {"light": None, "display": {"params": {"exposure": 1}}}})
    validate({"nodes": {"shadows": {"type": "shadow_vsm", "params": {"taps": None}}}})  # drops an inherited one
    for wrong in (
        FORWARD.replace("bias: $bias", "bais: $bias"),
        FORWARD.replace("taps: null", "taps: 99"),
        FORWARD.replace("taps: null", "taps: many"),
        FORWARD.replace("{shadow_map: sun", "{shadow_mop: sun"),
        FORWARD.replace("type: tonemap", "type: tonemop"),
        FORWARD.replace("radiance: glow.radiance", "radiance: [glow.radiance]"),
        FORWARD.replace("size:", "sise:"),
        FORWARD.replace("  sun:", "  s n:"),
        FORWARD.replace("[64, 64]", "[64]"),
    ):
        assert wrong != FORWARD
        with pytest.raises(fastjsonschema.JsonSchemaException, match=r"^data"):
            validate(parse(wrong).root.plain())


# --- a schema on disk ------------------------------------------------------------------------------------------------

FOG = """
from rendergraph.api import Input, Node, Output, Radiance, param

class Fog(Node):
    '''Fog.'''

    radiance = Input(Radiance, doc="Clear.")
    foggy = Output(like="radiance", doc="Foggy.")
    density: float = param(default=0.05, min=0, max=10, doc="How much.")
"""


@pytest.mark.slow
def test_check_says_when_the_schema_beside_the_file_is_out_of_date(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = yaml.safe_load((folder("rendergraph.errors") / "RG153-schema-out-of-date.yaml").read_text())
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pipeline.yaml").write_text(page["wrong"])
    (tmp_path / "fog.py").write_text(FOG)
    check = ["check", "pipeline.yaml", "--plugin", "fog.py"]

    def warned() -> str:
        capsys.readouterr()
        assert main(check) == 0
        return "\n".join(line for line in capsys.readouterr().err.splitlines() if "RG153" in line)

    assert warned() == ""  # no schema is there
    assert main(["schema", "-o", "rendergraph.schema.json"]) == 0
    assert warned().removeprefix("pipeline.yaml:") == page["message"]
    assert main(shlex.split(page["right"])[1:]) == 0
    assert warned() == ""
    (tmp_path / "fog.py").write_text(FOG.replace("max=10", "max=11"))
    assert "'fog' has changed" in warned()
    (tmp_path / "inner").mkdir()
    monkeypatch.chdir(tmp_path / "inner")  # what is said to type works where it is said
    check = ["check", "../pipeline.yaml", "--plugin", "../fog.py"]
    assert main(shlex.split(warned().split("`")[1])[1:]) == 0
    assert warned() == ""
    (tmp_path / "fog.py").write_text(FOG)
    monkeypatch.chdir(tmp_path)
    check = ["check", "pipeline.yaml"]
    assert warned() == ""  # a schema may be for more plugins than this run has
    schema_file = tmp_path / "rendergraph.schema.json"
    schema_file.write_text(schema_file.read_text().replace("tonemap", "tone"))
    assert warned().endswith("writes it again, with --plugin for 'fog', 'tone' too")


def test_a_schema_of_a_file_is_written_anew_for_that_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "base.yaml").write_text("extends: forward\nnodes: {fog: {type: ./fog.frag}}\n")
    (tmp_path / "fog.frag").write_text("uniform float density = 0.1;\nout vec4 foggy;\n")
    (tmp_path / "mine.yaml").write_text("# $schema=mine.json\nextends: ./base.yaml\n")
    assert main(["schema", "mine.yaml", "-o", "mine.json"]) == 0
    made = json.loads((tmp_path / "mine.json").read_text())
    rules = [rule for rule in made["allOf"] if "properties" in rule.get("if", {})]
    bases = {rule["if"]["properties"]["extends"]["const"]: rule["then"]["properties"] for rule in rules}
    assert bases["./base.yaml"]["nodes"]["properties"].keys() == bases["forward"]["nodes"]["properties"].keys() | {
        "fog"
    }
    assert list(rules_of(made, "./fog.frag")["params"]["properties"]) == ["density"]
    (tmp_path / "mine.json").write_text((tmp_path / "mine.json").read_text().replace("tonemap", "tone"))
    capsys.readouterr()
    main(["check", "mine.yaml"])
    assert "`rendergraph schema mine.yaml -o mine.json` writes it again, with --plugin for 'tone' too" in (
        capsys.readouterr().err
    )


RADIANCES = (
    *("light.radiance", "light.diffuse", "gi.radiance", "gi.indirect", "gi.reflected"),
    *("light.direct_diffuse", "light.direct_specular", "light.environment_reflection"),
)


def test_a_schema_of_a_file_offers_the_links_that_fit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Although the file has mistakes: an unknown parameter, a link of another meaning, a circle."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").write_text("""
extends: deferred
nodes:
  ao: {type: ssao_hemisphere, inputs: {depth: gbuffer.normal, normal: gbuffer.normal}, params: {radios: 1}}
  light: {inputs: {occlusion: ao.occlusion}}
  gi: {type: ssgi, inputs: {gbuffer: gbuffer, radiance: glow.radiance, diffuse: light.diffuse}}
  glow: {type: bloom, inputs: {radiance: gi.radiance}}
""")
    assert main(["schema", "mine.yaml"]) == 0
    last = json.loads(capsys.readouterr().out)["allOf"][-1]["properties"]["nodes"]["properties"]

    def offered(node: str, name: str) -> list[str]:
        found: list[str] = last[node]["properties"]["inputs"]["properties"][name]["anyOf"][0]["enum"]
        return found

    assert offered("ao", "depth") == ["gbuffer.depth"]
    assert offered("ao", "normal") == ["gbuffer.normal"]
    assert offered("light", "occlusion") == ["ao.occlusion"]
    assert offered("gi", "gbuffer") == ["gbuffer"]
    assert {"light.radiance", "gi.indirect"} <= {*offered("glow", "radiance")} <= {*RADIANCES}
    assert main(["check", "mine.yaml"]) == 3


def test_required_inputs_are_asked_for_in_a_whole_file(made: dict[str, Any]) -> None:
    fastjsonschema = pytest.importorskip("fastjsonschema")
    validate = fastjsonschema.compile(made)
    for wrong in (
        FORWARD.replace("inputs: {shadow_map: sun.shadow_map}, ", ""),
        FORWARD.replace("{radiance: glow.radiance}", "{}"),
    ):
        with pytest.raises(fastjsonschema.JsonSchemaException, match="must contain"):
            validate(parse(wrong).root.plain())
        validate(parse(wrong.replace("rendergraph: 1", "extends: forward")).root.plain())
    validate(parse(FORWARD.replace("{radiance: glow.radiance}", "{}, enabled: false")).root.plain())
    assert rules_of(made, "shadow_pcf")["inputs"]["properties"]["shadow_map"]["description"].endswith(", required)")


def test_there_is_a_schema_of_files_we_read_alone(capsys: pytest.CaptureFixture[str]) -> None:
    for kind, key in (("scene", "objects"), ("sweep", "axes"), ("pipeline", "nodes")):
        assert main(["schema", kind]) == 0
        assert key in json.loads(capsys.readouterr().out)["properties"]
    assert main(["schema", "scenes"]) == 3
    assert "RG511 unknown schema 'scenes'; did you mean 'scene'?" in capsys.readouterr().err
    assert main(["schema", "missing.yaml"]) == 3
    assert "RG011 there is no file 'missing.yaml'" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"definitions": {"node": 1}}', "no json"])
def test_a_schema_of_somebody_else_is_left_alone(tmp_path: Path, toy_catalog: Catalog, text: str) -> None:
    file = tmp_path / "pipeline.yaml"
    (tmp_path / "other.json").write_text(text)
    file.write_text("# $schema=other.json\nextends: forward\n")
    assert outdated(file, Roots.of_file(file), toy_catalog) is None
    file.write_text("# $schema=https://example.org/schema.json\n")
    assert outdated(file, Roots.of_file(file), toy_catalog) is None


def test_a_schema_outside_is_not_read(tmp_path: Path, toy_catalog: Catalog) -> None:
    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "s.json").write_text(json.dumps(schema(Catalog({}))))
    file = inside / "pipeline.yaml"
    file.write_text("# yaml-language-server: $schema=../s.json\n")
    assert outdated(file, Roots.of_file(file), toy_catalog) is None
    assert outdated(file, Roots.of_file(file, [tmp_path]), toy_catalog) is not None
