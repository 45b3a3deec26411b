"""Shader nodes in pipelines: by path, by name from folders; Python never comes with a pipeline file."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import rendergraph as rg
from rendergraph.catalog import Catalog, find
from rendergraph.cli import main
from rendergraph.errors import InputError, Problem
from rendergraph.link import link
from rendergraph.resolve import PipelineSpec, resolve
from rendergraph.session import stages

EFFECT = """/*---
doc: It, times a number.
inputs: {color: {semantic: display_color, doc: It.}}
outputs: {scaled: {like: color, doc: The result.}}
params: {gain: {default: 2, min: 0, max: 9, doc: The number.}}
---*/
uniform sampler2D color;
uniform float gain;
out vec4 scaled;
void main() { scaled = gain * texelFetch(color, ivec2(gl_FragCoord.xy), 0); }
"""
PYTHON = """
import pathlib
pathlib.Path(__file__).with_suffix(".ran").touch()
raise SystemExit("a pipeline made this run")
"""
Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write(files: dict[str, str]) -> Path:
        for name, text in files.items():
            file = tmp_path / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
        return tmp_path

    return write


def pipeline(effect: str, top: str = "", base: str = "forward") -> str:
    node = f"{{type: {effect}, inputs: {{color: display.color}}}}"
    return f"extends: {base}\n{top}nodes:\n  effect: {node}\noutputs: {{image: effect.scaled}}\n"


def spec_of(file: Path, **options: Any) -> PipelineSpec:
    return resolve(file, catalog=Catalog.discover(), **options)


def problems_of(file: Path, **options: Any) -> list[Problem]:
    with pytest.raises(InputError) as caught:
        link(spec_of(file, **options), Catalog.discover())
    return list(caught.value.problems)


def messages(file: Path, **options: Any) -> list[str]:
    return [f"{p.place}: {p.code} {p.message}".removeprefix(f"{file}:") for p in problems_of(file, **options)]


# --- by path ---------------------------------------------------------------------------------------------------------


def test_a_shader_is_used_by_its_path(write: Write) -> None:
    folder = write({"effects/times.frag": EFFECT, "p.yaml": pipeline("./effects/times.frag")})
    spec = spec_of(folder / "p.yaml")
    graph = link(spec, Catalog.discover())
    found = graph["effect"].type
    assert (found.name, found.file, found.is_shader) == (
        "./effects/times.frag",
        folder / "effects" / "times.frag",
        True,
    )
    assert graph.warnings == ()


def test_the_resolved_file_can_be_used_again(write: Write) -> None:
    folder = write(
        {
            "rendergraph.toml": "",
            "base/effects/times.frag": EFFECT,
            "base/more/other.frag": EFFECT,
            "base/b.yaml": pipeline("./effects/times.frag", "plugins: [./more]\n"),
            "top/p.yaml": "extends: ../base/b.yaml\nplugins: [rendergraph]\n"
            "nodes: {again: {type: other, inputs: {color: effect.scaled}}}\noutputs: {image: again.scaled}\n",
        }
    )
    text = spec_of(folder / "top" / "p.yaml").to_yaml()
    assert "type: ../base/effects/times.frag\n" in text
    assert "plugins: [rendergraph, ../base/more]\n" in text
    (folder / "top" / "resolved.yaml").write_text(text)
    graph = link(spec_of(folder / "top" / "resolved.yaml"), Catalog.discover())
    assert [node.type.name for node in graph.nodes][-2:] == ["../base/effects/times.frag", "other"]
    assert spec_of(folder / "top" / "resolved.yaml").to_yaml() == text


def test_paths_are_relative_to_the_file_they_stand_in(write: Write) -> None:
    glow = (
        "plugins: [./inner]\ninputs: {color: {semantic: display_color}}\nnodes:\n"
        "  one: {type: ./times.frag, inputs: {color: inputs.color}}\n"
        "  two: {type: named, inputs: {color: one.scaled}}\noutputs: {scaled: two.scaled}\n"
    )
    folder = write(
        {
            "sub/glow.yaml": glow,
            "sub/times.frag": EFFECT,
            "sub/inner/named.frag": EFFECT,
            "patch.yaml": "nodes: {effect: {type: ./sub/times.frag}}\n",
            "p.yaml": pipeline("./sub/glow.yaml"),
        }
    )
    graph = link(spec_of(folder / "p.yaml"), Catalog.discover())
    assert [graph[name].type.name for name in ("effect/one", "effect/two")] == ["./sub/times.frag", "named"]
    spec = spec_of(folder / "p.yaml", patches=[folder / "patch.yaml"])
    assert link(spec, Catalog.discover())["effect"].type.name == "./sub/times.frag"
    resolved = folder / "resolved.yaml"
    resolved.write_text(spec_of(folder / "p.yaml").to_yaml())
    assert link(spec_of(resolved), Catalog.discover())["effect/two"].type.name == "named"


def test_a_path_on_the_command_line_is_the_users_own(
    write: Write, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write(
        {"times.frag": EFFECT, "p.yaml": pipeline("tonemap").replace("color: display.color", "radiance: light")}
    )
    here = tmp_path_factory.mktemp("here")
    monkeypatch.chdir(here)
    sets = [f"effect.type={os.path.relpath(folder / 'times.frag')}", "effect.color=display.color", "effect.gain=3"]
    spec = spec_of(folder / "p.yaml", sets=sets)
    assert dict(link(spec, Catalog.discover())["effect"].node) == {"gain": 3.0}
    assert [note.message for note in spec.notes] == [
        f"node 'effect' is now '{os.path.relpath(folder / 'times.frag')}', which has no input 'radiance' of 'tonemap'; "
        "dropped"
    ]


@pytest.mark.parametrize(
    ("effect", "text"),
    [
        ("../times.frag", "RG012 '../times.frag' lies outside the folder of the file that names it; --asset-root"),
        ("/etc/times.frag", "RG012 '/etc/times.frag' lies outside"),
        ("./link.frag", "RG012 './link.frag' lies outside"),
        ("./in/../../times.frag", "RG012 './in/../../times.frag' lies outside"),
        ("./time.frag", "RG011 there is no file './time.frag'"),
        ("./folder.frag", "RG011 './folder.frag' is a folder"),
        ("http://x/y.frag", "RG012 'http://x/y.frag' is not a file path; only local files can be loaded"),
    ],
)
def test_a_shader_stays_inside_the_root(write: Write, effect: str, text: str) -> None:
    folder = write({"times.frag": EFFECT, "in/p.yaml": pipeline(effect)})
    (folder / "in" / "link.frag").symlink_to(folder / "times.frag")
    (folder / "in" / "folder.frag").mkdir()
    (message,) = messages(folder / "in" / "p.yaml")
    assert message.startswith(f"3:18: {text}")


def test_an_include_stays_inside_the_folder(write: Write) -> None:
    folder = write(
        {"out.glsl": "", "in/times.frag": '#include "../out.glsl"\nout vec4 c;', "in/p.yaml": pipeline("./times.frag")}
    )
    (problem,) = problems_of(folder / "in" / "p.yaml")
    assert (problem.code, str(problem.place)) == ("RG406", f"{folder}/in/times.frag:1:1")


def test_a_wrong_header_is_one_of_all_mistakes(write: Write) -> None:
    wrong = pipeline("./times.frag").replace("display.color}", "display.colour}")
    folder = write({"times.frag": EFFECT.replace("semantic", "semantics"), "p.yaml": wrong + "parameters: {x: {}}\n"})
    found = [(problem.code, problem.place.file if problem.place else "") for problem in problems_of(folder / "p.yaml")]
    assert found == [("RG121", f"{folder}/p.yaml"), ("RG440", f"{folder}/times.frag")]


# --- by name ---------------------------------------------------------------------------------------------------------


def test_where_names_come_from(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    files = {f"{name}/{name}_effect.frag": EFFECT for name in ("project", "path", "other", "typed")}
    folder = write({**files, "rendergraph.toml": 'plugins = ["project"]\n', "inside/x": ""})
    monkeypatch.chdir(folder / "inside")
    monkeypatch.setenv("RENDERGRAPH_PATH", f"{folder / 'path'}{os.pathsep}{os.pathsep}{folder / 'other'}")
    names = Catalog.discover([folder / "typed", folder / "path"]).names()
    assert {name for name in names if name.endswith("_effect")} == {
        "project_effect",
        "path_effect",
        "other_effect",
        "typed_effect",
    }
    assert Catalog.discover([folder / "typed"], installed=False).names() == ["typed_effect"]
    assert Catalog.discover([folder / "path"]).get("path_effect").plugin == "path"  # named twice, and one type


def test_a_missing_folder_says_who_names_it(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write({"rendergraph.toml": 'plugins = ["gone"]\n'})
    monkeypatch.chdir(folder)
    with pytest.raises(InputError, match=r"rendergraph.toml: RG011 there is no plugin '.*gone'$"):
        Catalog.discover()
    (folder / "rendergraph.toml").unlink()
    monkeypatch.setenv("RENDERGRAPH_PATH", "nowhere")  # as PATH may name what is not there
    (note,) = resolve("forward", catalog=Catalog.discover()).notes
    assert str(note) == "warning: RG011 there is no plugin 'nowhere', which RENDERGRAPH_PATH names"
    with pytest.raises(InputError, match=r"RG011 there is no plugin 'nowhere'$"):
        Catalog.discover([Path("nowhere")])
    (folder / "nowhere").write_text("")
    with pytest.raises(InputError, match=r"RG011 there is no plugin in '.*nowhere', which RENDERGRAPH_PATH names; use"):
        Catalog.discover()


def test_listing_parses_nothing(write: Write) -> None:
    folder = write({"fx/wrong.frag": "uniform mat4 m;", "fx/a/deep.comp": "?", "fx/_part.frag": "", "fx/no.vert": ""})
    catalog = Catalog.discover([folder / "fx"], installed=False)
    assert catalog.families() == {"": ["wrong"], "a": ["deep"]}


def test_beside_python_only_headers_make_types(write: Write) -> None:
    folder = write(
        {"fx/fog.py": "", "fx/fog.frag": "out vec4 c;", "fx/parts/blur.frag": "out vec4 c;", "fx/own.frag": EFFECT}
    )
    assert Catalog.discover([folder / "fx"], installed=False).names() == ["fog", "own"]


def test_two_of_one_name_are_both_named(write: Write) -> None:
    folder = write(
        {"one/glow.frag": EFFECT, "two/deep/glow.comp": "", "p.yaml": pipeline("glow", "plugins: [./one, ./two]\n")}
    )
    (problem,) = problems_of(folder / "p.yaml")
    assert problem.code == "RG493"
    assert problem.message == (
        f"node type 'glow' comes from 'one' ({folder}/one/glow.frag) and 'two' ({folder}/two/deep/glow.comp); rename one"
    )


def test_of_two_of_one_name_it_is_said_who_names_them(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    files = dict.fromkeys(("a/glow.frag", "b/glow.frag", "c/glow.frag"), EFFECT)
    folder = write({**files, "rendergraph.toml": 'plugins = ["a"]\n'})
    monkeypatch.chdir(folder)
    monkeypatch.setenv("RENDERGRAPH_PATH", "b")
    with pytest.raises(InputError) as caught:
        Catalog.discover([Path("c")]).get("glow")
    assert caught.value.problems[0].message == (
        "node type 'glow' comes from 'a' (a/glow.frag, which rendergraph.toml names) and 'b' (b/glow.frag, which "
        "RENDERGRAPH_PATH names) and 'c' (c/glow.frag, given as a plugin); rename one"
    )


def test_a_broken_type_hides_no_other(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write({"fx/wrong.frag": "uniform mat4 m;", "fx/right.frag": EFFECT})
    assert main(["nodes", "--plugin", str(folder / "fx"), "--json"]) == 3
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert "right" in [node["name"] for node in found["nodes"]]
    assert [problem["code"] for problem in found["problems"]] == ["RG441"]
    assert "wrong.frag:1:14: RG441" in printed.err


# --- the pipeline's own plugins --------------------------------------------------------------------------------------


def test_a_pipeline_brings_a_folder(write: Write) -> None:
    folder = write({"fx/times.frag": EFFECT, "p.yaml": pipeline("times", "plugins: [./fx]\n")})
    assert link(spec_of(folder / "p.yaml"), Catalog.discover())["effect"].type.plugin == "fx"
    assert "times" not in Catalog.discover()


PROGRAM = """
import sys
import rendergraph as rg
pipeline = rg.load(sys.argv[1])
pipeline.check()
print(*[note.code for note in pipeline.resolve().spec.notes])
print(*sorted(name for name in sys.modules if "evil" in name or "extension" == name.rpartition(".")[2]))
"""


@pytest.mark.slow
def test_python_in_its_folder_is_never_imported(write: Write) -> None:
    """In a process of its own: nothing of the folder is in `sys.modules`, and its files have not run."""
    names = (
        "evil.py",
        "extension.py",
        "__init__.py",
        "conftest.py",
        "sitecustomize.py",
        "deep/evil_too.py",
        "setup.py",
    )
    folder = write(
        {
            **{f"fx/{name}": PYTHON for name in names},
            "fx/times.frag": EFFECT,
            "p.yaml": pipeline("times", "plugins: [./fx]\n"),
        }
    )
    words = [sys.executable, "-c", PROGRAM, str(folder / "p.yaml")]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == ["RG152", ""]
    assert list(folder.rglob("*.ran")) == []
    # The same folder named by the user does run: the test would notice.
    words += ["--", "evil"]
    user = "import sys, rendergraph as rg\nrg.load(sys.argv[1], plugins=['fx']).resolve().catalog.get('evil')\n"
    done = subprocess.run(
        [sys.executable, "-c", user, "p.yaml"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert (folder / "fx" / "evil.ran").exists()


def test_settings_that_do_not_count_are_said(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write({"p/fx/times.frag": EFFECT, "p/rendergraph.toml": 'plugins = ["fx"]', "p/p.yaml": pipeline("times")})
    monkeypatch.chdir(folder)
    said = r"RG102 there is no node type 'times'; p/rendergraph\.toml names plugins, but they load only when you work inside its"
    with pytest.raises(InputError, match=said):
        link(spec_of(Path("p/p.yaml")), Catalog.discover(), ())
    monkeypatch.chdir(folder / "p")
    catalog = spec_of(Path("p.yaml")).catalog
    assert catalog is not None
    assert catalog.get("times").is_shader


def test_python_that_is_not_run_is_a_warning(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write({"fx/evil.py": PYTHON, "fx/times.frag": EFFECT, "p.yaml": pipeline("times", "plugins: [./fx]\n")})
    monkeypatch.chdir(folder.parent)
    (note,) = spec_of(folder / "p.yaml").notes
    assert str(note).splitlines()[0] == (
        f"{folder}/p.yaml:2:11: warning: RG152 './fx' has Python (evil.py), which is not run because a pipeline file "
        f"names it; if you trust it, pass --plugin {folder.name}/fx"
    )
    (folder / "p.yaml").write_text(pipeline("evil", "plugins: [./fx]\n"))
    said = rf"RG102 node type 'evil' is Python, which a pipeline file cannot load; pass --plugin {folder.name}/fx"
    with pytest.raises(InputError, match=said):
        link(spec_of(folder / "p.yaml"), Catalog.discover())
    (folder / "p.yaml").write_text(pipeline("times", "plugins: [./fx]\n"))
    named = resolve(folder / "p.yaml", catalog=Catalog.discover([folder / "fx"]))
    assert named.notes == ()


@pytest.mark.parametrize(
    ("plugins", "text"),
    [
        ("[../fx]", "2:11: RG012 '../fx' lies outside"),
        ("[./none]", "2:11: RG011 there is no folder './none'"),
        ("[./p.yaml]", "2:11: RG011 './p.yaml' is a file; expected a folder"),
        (
            "./fx",
            "2:10: RG106 'plugins': expected a list of folders and packages, as in plugins: [./effects, some-package], got './fx'",
        ),
        ("[-rlist]", "2:11: RG131 '-rlist' is neither a folder of plugins nor a package's name"),
        (
            "[3]",
            "2:10: RG106 'plugins': expected a list of folders and packages, as in plugins: [./effects, some-package], got [3]",
        ),
        ("[/]", "2:11: RG012 '/' lies outside"),
    ],
)
def test_wrong_plugins(write: Write, plugins: str, text: str) -> None:
    folder = write({"fx/times.frag": EFFECT, "in/p.yaml": pipeline("tonemap", f"plugins: {plugins}\n")})
    assert any(message.startswith(text) for message in messages(folder / "in" / "p.yaml"))


def test_a_folder_has_a_plugins_size(write: Write) -> None:
    folder = write({f"fx/deep/{n}.txt": "" for n in range(30)})
    assert find.shaders(folder / "fx", 31) == ([], [])
    with pytest.raises(ValueError, match="it has more than 30 files; name the folder of the effects itself"):
        find.shaders(folder / "fx", 30)


def test_a_pipe_in_a_folder_is_not_waited_for(write: Write) -> None:
    folder = write({"fx/a.py": "", "fx/times.frag": EFFECT, "p.yaml": pipeline("times", "plugins: [./fx]\n")})
    os.mkfifo(folder / "fx" / "wait.frag")
    assert link(spec_of(folder / "p.yaml"), Catalog.discover())["effect"].type.name == "times"
    os.mkfifo(folder / "own.frag")
    (folder / "p.yaml").write_text(pipeline("./own.frag"))
    assert messages(folder / "p.yaml") == ["3:18: RG011 './own.frag' is not a regular file"]


@pytest.mark.slow
def test_check_node_takes_it(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    """With a version of its own; what is missing and what the compiler removed are warnings."""
    text = "#version 330\nuniform float unused;\nout vec4 c;\nvoid main() { c = vec4(0.5); }\n"
    folder = write({"plain.frag": text})
    assert main(["check-node", str(folder / "plain.frag")]) == 0
    printed = capsys.readouterr().err
    assert "warning: RG445 shader node 'plain.frag' lacks doc of the node" in printed
    assert "plain.frag:2:1: warning: RG455 'unused' is declared, but no shader program uses it" in printed


def test_a_link_in_a_folder_leads_nowhere_outside(write: Write) -> None:
    folder = write(
        {"secret.frag": EFFECT, "in/fx/times.frag": EFFECT, "in/p.yaml": pipeline("secret", "plugins: [./fx]\n")}
    )
    (folder / "in" / "fx" / "secret.frag").symlink_to(folder / "secret.frag")
    (folder / "in" / "fx" / "more").symlink_to(folder)
    found = messages(folder / "in" / "p.yaml")
    assert found[0].startswith("2:11: RG012 of plugin './fx' 'secret.frag' lies outside")
    assert found[1].startswith("4:18: RG102 there is no node type 'secret'")


# --- missing plugins -------------------------------------------------------------------------------------------------

LACKING = """extends: forward
plugins: [rendergraph-outline, rendergraph]
nodes:
  edge: {type: outline, inputs: {color: display.color, many: [light.radiance]}, params: {width: 3, record: 1}}
  tone: {type: tonemap, inputs: {radiance: edge.outlined}}
outputs: {image: tone.color, edges: edge.edges}
"""


def test_check_says_what_to_install_and_finds_the_rest(write: Write) -> None:
    wrong = LACKING.replace("radiance: edge.outlined", "radiance: edge.outlined, depht: light")
    folder = write({"p.yaml": wrong})
    assert messages(folder / "p.yaml") == [
        "2:11: RG130 the pipeline needs the plugin 'rendergraph-outline', which is not installed: "
        "pip install rendergraph-outline",
        "4:16: RG102 there is no node type 'outline'; a missing package may provide it: rendergraph-outline",
        "5:59: RG111 node type 'tonemap' has no input 'depht'; available: gain, radiance",
    ]


@pytest.mark.parametrize("shape", ["text", "dot", "mermaid", "svg"])
def test_graph_draws_the_rest(write: Write, shape: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write({"p.yaml": LACKING})
    assert main(["graph", str(folder / "p.yaml"), "-f", shape]) == 3
    printed = capsys.readouterr()
    assert "outline" in printed.out
    assert "unknown" in printed.out
    assert all(word in printed.out for word in ("edge", "tone", "display", "outlined", "edges"))
    assert "RG130" in printed.err
    assert "RG102" in printed.err


def test_the_sketch_as_values(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write({"p.yaml": LACKING})
    assert main(["graph", str(folder / "p.yaml"), "--json"]) == 3
    found = json.loads(capsys.readouterr().out)
    (node,) = [node for node in found["nodes"] if node["unknown"]]
    assert (node["id"], node["type"], node["parameters"]) == ("edge", "outline", {"width": 3})
    assert node["inputs"] == {"color": ["display.color"], "many": ["light.radiance"]}
    assert list(node["outputs"]) == ["edges", "outlined"]
    assert [problem["code"] for problem in found["missing"]] == ["RG130", "RG102"]
    assert main(["graph", "forward", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["missing"] == []


def test_diff_shows_the_rest(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write(
        {"a.yaml": LACKING, "b.yaml": LACKING.replace("width: 3", "width: 4").replace("edge.out", "edge.in")}
    )
    assert main(["diff", str(folder / "a.yaml"), str(folder / "b.yaml"), "--svg", str(folder / "d.svg")]) == 3
    assert (folder / "d.svg").read_text().startswith("<svg")
    capsys.readouterr()
    assert main(["diff", str(folder / "a.yaml"), str(folder / "b.yaml")]) == 3
    lines = capsys.readouterr().out.splitlines()
    assert lines[1:] == ["  ~ edge.width: 3 → 4", "  ~ tone.radiance: edge.outlined → edge.inlined"]
    assert main(["diff", str(folder / "a.yaml"), "forward"]) == 3


def test_other_mistakes_are_not_drawn(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write({"p.yaml": LACKING.replace("tone.color", "tone.colour")})
    assert main(["graph", str(folder / "p.yaml")]) == 3
    printed = capsys.readouterr()
    assert printed.out == ""
    assert [line.split()[1] for line in printed.err.splitlines() if ": RG" in line] == ["RG130", "RG102", "RG112"]


def test_a_whole_graph_is_the_same_sketched() -> None:
    pipeline = rg.load("deferred")
    sketch = stages.sketch(pipeline.resolve())
    assert sketch.missing == ()
    assert [node.id for node in sketch.graph.nodes] == [node.id for node in pipeline.link().graph.nodes]


# --- what shows them -------------------------------------------------------------------------------------------------


def test_explain_takes_a_path(
    write: Write, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(write({"fx/times.frag": EFFECT}))
    assert main(["explain", "./fx/times.frag"]) == 0
    printed = capsys.readouterr()
    assert "It, times a number." in printed.out
    assert "type: ./fx/times.frag" in printed.out
    assert printed.err == ""
    assert main(["explain", "./fx/none.frag"]) == 3
    assert "RG400 there is no shader" in capsys.readouterr().err


def test_a_run_reads_only_the_shaders_it_uses(write: Write) -> None:
    folder = write(
        {"fx/times.frag": EFFECT, "fx/huge.frag": "x" * 2_000_000, "p.yaml": pipeline("times", "plugins: [fx/]\n")}
    )
    assert link(spec_of(folder / "p.yaml"), Catalog.discover())["effect"].type.name == "times"
