"""The JSON Schema for editors."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rendergraph.catalog import Catalog
from rendergraph.document import parse
from rendergraph.schema import schema

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
    assert exposure["description"] == "Stops.\n\nDefault 0.0 EV, -16 to 16. Changing it rebuilds nothing."


def test_an_independent_validator_agrees(made: dict[str, Any]) -> None:
    fastjsonschema = pytest.importorskip("fastjsonschema")
    validate = fastjsonschema.compile(made)
    validate(parse(FORWARD).value)
    validate({"extends": "forward", "nodes": {"light": None, "display": {"params": {"exposure": 1}}}})
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
            validate(parse(wrong).value)
