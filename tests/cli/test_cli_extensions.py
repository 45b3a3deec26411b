"""What plugins add, where the command line lists and measures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

SMALL = ("--size", "24x16", "-n", "1", "-s", "sun.resolution=64")
EXTENSION = '''
import numpy as np
from rendergraph.api import Extension, Semantic


def darker(image, reference):
    """Share of values that are darker than the reference's."""
    assert image.shape == reference.shape and image.shape[2] == 3 and image.dtype == np.float64
    image[:] = 0.0 if image.max() > 1 else image
    return (image < reference).mean()


EXTENSION = Extension(
    semantics=(Semantic("heat", "Temperature, kelvin."),),
    choices={"curve": {"halve": "halve.glsl"}},
    meshes={".tri": lambda path: []},
    metrics={"darker": darker},
)
'''


@pytest.fixture
def plugin(tmp_path: Path) -> Path:
    home = tmp_path / "sketch"
    home.mkdir()
    (home / "extension.py").write_text(EXTENSION)
    (home / "halve.glsl").write_text("// Half of it,\n// as an example.\nvec3 tone_curve(vec3 c) { return 0.5 * c; }\n")
    return home


def test_nodes_lists_what_plugins_add(cli: Any, plugin: Path) -> None:
    words = " ".join(cli("nodes", "--plugin", str(plugin)).out.partition("\nadded ")[2].split())
    for said in (
        "semantic heat sketch Temperature, kelvin.",
        "curve halve sketch Half of it, as an example.",
        "mesh loader .tri sketch",
        "metric darker sketch Share of values",
    ):
        assert said in words
    told = cli("nodes", "--plugin", str(plugin), "--json").json["extensions"]
    assert {"kind": "curve", "name": "halve", "plugin": "sketch", "doc": "Half of it, as an example."} in told
    assert "added" not in cli("nodes", "display", "--plugin", str(plugin)).out


def test_explain_and_schema_have_a_plugins_choices(cli: Any, plugin: Path) -> None:
    text = cli("explain", "tonemap", "--plugin", str(plugin)).out
    assert "| none | halve" in text
    assert "curve: halve  sketch  Half of it, as an example." in text
    (curve,) = [
        p
        for p in cli("explain", "tonemap", "--plugin", str(plugin), "--json").json["parameters"]
        if p["name"] == "curve"
    ]
    assert curve["choices"][-1] == "halve"
    assert "str" not in curve["type"]
    made = cli("schema", "--plugin", str(plugin)).json
    (rule,) = [r for r in made["definitions"]["node"]["allOf"] if r["if"]["properties"]["type"]["const"] == "tonemap"]
    rules = json.dumps(rule["then"]["properties"]["params"]["properties"]["curve"])
    assert '"none", "halve"]' in rules
    assert "`halve` (sketch): Half of it, as an example." in rules
    assert '"choices"' not in rules
    assert "halve" not in cli("explain", "tonemap").out


def test_what_is_broken_is_left_out_of_lists_with_a_warning(cli: Any, plugin: Path) -> None:
    (plugin / "extension.py").write_text("1 / 0\n")
    for words in (("nodes",), ("explain", "tonemap"), ("schema",)):
        result = cli(*words, "--plugin", str(plugin))
        assert result.code == 0
        assert "sketch/extension.py:1:1: warning: RG494" in result.err
    assert cli("explain", "depth_prepass", "--plugin", str(plugin)).err == ""


@pytest.mark.slow
def test_compare_shows_a_plugins_metric(cli: Any, plugin: Path, tmp_path: Path) -> None:
    words = ("compare", "forward", "shading-unlit", *SMALL, "--plugin", str(plugin))
    result = cli(*words, "-o", "report.html")
    heads, first, second = (row.replace("rel. ", "").split() for row in result.out.splitlines()[1:4])
    assert heads[:6] == ["FLIP", "RMSE", "MSE", "PSNR", "SSIM", "darker"]
    assert (first[6], second[0]) == ("0", "shading-unlit")
    told = cli(*words, "--json").json["variants"]
    assert told[0]["plugin_metrics"] == {"darker": 0}
    assert 0 < told[1]["plugin_metrics"]["darker"] < 1
    assert second[6] == f"{told[1]['plugin_metrics']['darker']:.4g}"
    assert ">darker</th>" in (tmp_path / "report.html").read_text()
    beyond = cli(*words, "--fail-above", "darker=0.0001")
    assert beyond.code == 4
    assert "shading-unlit: darker is" in beyond.err
    assert cli(*words, "--fail-above", "darker=0.99").code == 0
    unknown = cli(*words, "--fail-above", "drker=1")
    assert unknown.code == 2
    assert "unknown metric 'drker'; did you mean 'darker'?" in unknown.err


@pytest.mark.slow
def test_sweep_keeps_a_plugins_metric(cli: Any, plugin: Path) -> None:
    words = ("sweep", "forward", "-x", "light.shading=pbr,unlit", *SMALL, "-o", "out", "--plugin", str(plugin))
    first = cli(*words, "--json").json["runs"]
    assert [run["plugin_metrics"]["darker"] > 0 for run in first] == [False, True]
    again = cli(*words, "--json", "--resume").json
    assert again["resumed"] == 2
    assert [run["plugin_metrics"] for run in again["runs"]] == [run["plugin_metrics"] for run in first]
    without = cli(*words[:-2], "--json", "--resume").json  # other figures: other runs
    assert without["resumed"] == 0


def test_what_a_plugin_prints_is_no_data(cli: Any, plugin: Path) -> None:
    text = EXTENSION.replace("    assert image.shape ==", "    print('measuring')\n    assert image.shape ==")
    (plugin / "extension.py").write_text("print('hello')\n" + text)
    words = ("compare", "forward", "forward", *SMALL, "--plugin", str(plugin), "--json")
    found = cli(*words)
    assert found.json["variants"][0]["plugin_metrics"] == {"darker": 0}
    assert {"hello", "measuring"} <= set(found.err.splitlines())
    assert "Usage:" in cli("compare", "--help").out


@pytest.mark.parametrize(
    ("what", "code"), [("SystemExit(0)", "RG494"), ("BaseException()", "RG494"), ("KeyboardInterrupt", "")]
)
def test_an_extension_that_ends_is_a_mistake(cli: Any, plugin: Path, what: str, code: str) -> None:
    (plugin / "extension.py").write_text(f"raise {what}\n")
    found = cli("run", "forward", *SMALL[:2], "-s", "display.curve=halve", "--plugin", str(plugin))
    assert found.code == (3 if code else 130)
    assert code in found.err


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize(
    ("body", "code", "said"),
    [
        ("return 1 / 0", 3, "extension.py:2:1: RG497 metric 'darker' of "),
        ("return 'dark'", 3, "plugin 'sketch' returned str, not a number"),
        ("raise SystemExit(0)", 3, "extension.py:2:1: RG497 metric 'darker' of "),
        ("raise BaseException('enough')", 3, "BaseException: enough (plugin 'sketch')"),
        ("raise ValueError('long ' * 1000)", 3, "long long … (plugin 'sketch')"),
    ],
)
def test_a_metric_that_fails_is_named(cli: Any, plugin: Path, body: str, code: int, said: str) -> None:
    (plugin / "extension.py").write_text(
        f"def darker(image, reference):\n    {body}\n"
        "from rendergraph.api import Extension\nEXTENSION = Extension(metrics={'darker': darker})\n"
    )
    result = cli("compare", "forward", "forward", *SMALL, "--plugin", str(plugin))
    assert result.code == code
    assert said in result.err
