"""`new-node`: what it writes works at once, passes every tool, and nothing is ever overwritten."""

from __future__ import annotations

import errno
import json
import os
import re
import shlex
import subprocess
import sys
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from rendergraph import api
from rendergraph.authoring import KINDS, NewNode, new_node
from rendergraph.authoring.examine import examine_file
from rendergraph.authoring.scaffold import class_name
from rendergraph.catalog import Catalog
from rendergraph.cli.app import main
from rendergraph.errors import InputError, RenderError
from rendergraph.resources import folder

SCRIPTS = Path(sys.executable).parent
ROOT = Path(__file__).parents[2]


def run(line: str, where: Path) -> subprocess.CompletedProcess[str]:
    """One command as a new user types it."""
    environment = dict(os.environ, PATH=f"{SCRIPTS}{os.pathsep}{os.environ['PATH']}", PYTHONDONTWRITEBYTECODE="1")
    done = subprocess.run(shlex.split(line), cwd=where, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
    return done


def commands_of(made: NewNode, where: Path) -> tuple[Path, list[str]]:
    """The folder that the printed commands lead to, and those that follow; installing needs a place to install to."""
    folders = [command[3:] for command in made.commands if command.startswith("cd ")]
    return where.joinpath(*folders), [line for line in made.commands if not line.startswith(("cd ", "pip "))]


@pytest.mark.nightly
@pytest.mark.parametrize("kind", ["fullscreen", "compute"])
def test_the_commands_it_prints_work_as_typed(kind: Any, tmp_path: Path) -> None:
    where, commands = commands_of(new_node("lens_falloff", kind, package=True, where=tmp_path), tmp_path)
    for command in commands:
        done = run(command.replace("pytest", "pytest -q -p no:cacheprovider"), where)
        assert command != "python -m pytest" or " passed" in done.stdout
        assert "warning" not in done.stdout
    assert (where / "lens_falloff.png").stat().st_size > 1000


@pytest.mark.nightly
def test_everything_works_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every template, in place and as a package: pictures, checks, tests, lint and types, of all together."""
    for kind in KINDS:
        for package in (False, True):
            name = f"{kind[:4]}_{'pack' if package else 'here'}"
            where, commands = commands_of(new_node(name, kind, package=package, where=tmp_path), tmp_path)
            monkeypatch.chdir(where)
            for command in commands:
                verb, *words = shlex.split(command)[1:] or [""]
                if verb == "run":
                    assert main([verb, *words, "--size", "128x72"]) == 0
                elif verb == "check-node":
                    assert examine_file(Path(words[0]).resolve(), [], None, lambda stage, what: None).problems == ()
            assert (where / f"{name}.png").stat().st_size > 1000
    assert " passed" in run("pytest -q -p no:cacheprovider --import-mode=importlib -W error", tmp_path).stdout
    ruff = ["--isolated", "--line-length", "120", "--target-version", "py311"]
    run(shlex.join(["ruff", "check", *ruff, "--select", "E,F,W,I,UP,B,C4,SIM,RUF,PT,RET", "."]), tmp_path)
    run(shlex.join(["ruff", "format", "--check", *ruff[:3], "."]), tmp_path)
    run(f"mypy {' '.join(map(str, tmp_path.glob('*.py')))}", ROOT)  # with the cache of `make types`


@pytest.mark.slow
def test_a_package_can_be_built_and_found(tmp_path: Path) -> None:
    if find_spec("setuptools") is None or int(version("setuptools").split(".")[0]) < 77:
        pytest.skip("building without network needs setuptools 77 beside the tests")
    written = new_node("lens_falloff", package=True, where=tmp_path)
    assert Path("lens_falloff/.gitignore") in written.files
    site = tmp_path / "site"
    words = f"-m pip install --quiet --no-deps --no-build-isolation --target {site} ."
    run(f"{sys.executable} {words}", tmp_path / "lens_falloff")
    program = (
        "from rendergraph.catalog import Catalog; found = Catalog.discover().get('lens_falloff'); "
        "print(found.plugin, found.cls.__module__, (found.shaders / 'lens_falloff.frag').is_file())"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=dict(os.environ, PYTHONPATH=str(site)),
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.split() == ["lens_falloff", "rendergraph_lens_falloff.nodes.lens_falloff", "True"], done.stderr


@pytest.mark.parametrize("kind", KINDS)
def test_files_begin_as_editors_and_readers_want_them(kind: Any, tmp_path: Path) -> None:
    made = new_node("lens_falloff", kind, where=tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in made.files}
    for path in made.files:
        text = (tmp_path / path).read_text(encoding="utf-8")
        assert not re.search(r"@\w+@", text), path
        assert text.endswith("\n"), path
    first = (tmp_path / "lens_falloff.yaml").read_text(encoding="utf-8").splitlines()[0]
    assert first == "# yaml-language-server: $schema=./rendergraph.schema.json"
    schema = json.loads((tmp_path / "rendergraph.schema.json").read_text(encoding="utf-8"))
    assert ("lens_falloff" in json.dumps(schema)) == (kind != "shader-only")  # a shader by path needs no entry
    new_node("other", kind, package=True, where=tmp_path)
    assert '"other"' in (tmp_path / "other" / "pipelines" / "rendergraph.schema.json").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", ["fullscreen", "shader-only"])
def test_a_full_screen_effect_is_at_most_25_lines(kind: Any, tmp_path: Path) -> None:
    new_node("lens_falloff", kind, where=tmp_path)
    texts = [path.read_text() for path in tmp_path.glob("lens_falloff.*") if path.suffix in (".py", ".frag")]
    assert sum(bool(line.strip()) for text in texts for line in text.splitlines()) <= 25


def test_a_second_node_beside_the_first_leaves_the_schema_and_says_how_to_refresh_it(tmp_path: Path) -> None:
    new_node("one", where=tmp_path)
    before = (tmp_path / "rendergraph.schema.json").stat().st_mtime_ns
    made = new_node("two", "geometry", where=tmp_path)
    assert (tmp_path / "rendergraph.schema.json").stat().st_mtime_ns == before
    assert "rendergraph schema --plugin . -o rendergraph.schema.json" in made.commands


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Lens-Falloff", r"RG530 .* such as 'lens_falloff'"),
        ("3d", r"such as 'd'"),
        ("", r"expected up to 40"),
        ("x" * 41, r"expected up to 40"),
        ("a__b", r"such as 'a_b'"),
        ("gl_thing", r"reserved by GLSL"),
        ("filter", r"reserved by GLSL or Python; choose another, such as 'my_filter'"),
        ("lambda", r"reserved"),
        ("tonemap", r"a node type of that name exists; choose another, such as 'my_tonemap'"),
        ("random", r"a Python module has that name"),
        ("numpy", r"a Python module has that name"),
        ("test_it", r"pytest would take the module for a test; .* 'it_node'"),
        ("../up", r"such as 'up'"),
    ],
)
def test_names_that_cannot_be(name: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        new_node(name, where=tmp_path)
    assert not list(tmp_path.iterdir())


def test_names_that_would_hide_something_get_another_class_or_id(tmp_path: Path) -> None:
    assert class_name("lens_falloff") == "LensFalloff"
    assert class_name("radiance") == "RadianceNode"
    assert {class_name(name.lower()) for name in vars(api)} & {*vars(api)} == set()
    new_node("light", where=tmp_path)
    assert "my_light: {type: light," in (tmp_path / "light.yaml").read_text()
    new_node("node", where=tmp_path)
    assert Catalog.discover([tmp_path / "node.py"]).get("node").cls.__name__ == "NodeNode"


@pytest.mark.parametrize("standing", ["lens_falloff.frag", "test_lens_falloff.py"])
def test_nothing_is_written_where_one_file_exists(standing: str, tmp_path: Path) -> None:
    (tmp_path / standing).symlink_to("nowhere")  # a broken link counts
    with pytest.raises(InputError, match=rf"{standing}: RG531 .* already exists and was not changed"):
        new_node("lens_falloff", where=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [standing]
    (tmp_path / "pack").mkdir()
    with pytest.raises(InputError, match="RG531 'pack' already exists"):
        new_node("pack", package=True, where=tmp_path)


@pytest.mark.parametrize("package", [False, True])
def test_a_full_disk_leaves_nothing_behind(package: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real, calls = Path.open, []

    def full(self: Path, mode: str = "r", *arguments: Any, **options: Any) -> Any:
        if mode == "xb":
            calls.append(self)
            if len(calls) == 4:
                raise OSError(errno.ENOSPC, "No space left on device", str(self))
        return real(self, mode, *arguments, **options)

    monkeypatch.setattr(Path, "open", full)
    with pytest.raises(RenderError, match="No space left on device"):
        new_node("lens_falloff", package=package, where=tmp_path)
    assert len(calls) == 4
    assert not list(tmp_path.iterdir())


def test_a_file_that_appears_meanwhile_is_not_touched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def late(files: Any, by_path: bool) -> str:
        (tmp_path / "test_lens_falloff.py").write_text("mine")
        return "{}\n"

    monkeypatch.setattr("rendergraph.authoring.scaffold._schema", late)
    with pytest.raises(InputError, match=r"RG531 'test_lens_falloff.py' already exists"):
        new_node("lens_falloff", where=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["test_lens_falloff.py"]
    assert (tmp_path / "test_lens_falloff.py").read_text() == "mine"


def test_the_verb(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new-node", "edges", "--kind", "geometry"]) == 0
    out, err = capsys.readouterr()
    assert set(out.split()) == {path.name for path in tmp_path.iterdir()}
    assert err.splitlines()[:2] == ["next:", "  rendergraph run edges.yaml --plugin edges.py"]
    assert main(["new-node", "edges"]) == 3
    assert main(["new-node", "more", "--package", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["commands"][:2] == ["cd more", "rendergraph run pipelines/more.yaml --plugin ."]
    assert all((tmp_path / path).is_file() for path in document["files"])
    assert main(["new-node", "more", "--kind", "cubist"]) == 2


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize("words", [(), ("a study",)])
def test_a_project_and_a_new_node_in_it_run_without_options(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["init", *words]) == 0
    out, err = capsys.readouterr()
    home = Path(*words)
    assert all(Path(line).is_file() for line in out.splitlines())
    assert {path.name for path in home.iterdir()} == {
        *("pipeline.yaml", "scene.yaml", "nodes", "tests", "rendergraph.toml", ".gitignore"),
        *("rendergraph.schema.json", "scene.schema.json"),
    }
    typed = [shlex.split(line) for line in err.splitlines()[1:]]
    assert [one[0] for one in typed] == [*(["cd"] if words else []), *["rendergraph"] * 3]
    monkeypatch.chdir(home)
    for command in typed[-3:]:
        assert main([*command[1:], *(["--size", "64x36"] if command[1] == "run" else [])]) == 0, command
    out, err = capsys.readouterr()
    assert "warning" not in err
    assert "--plugin" not in err
    assert Path("pipeline.png").stat().st_size > 1000 < Path("glow.png").stat().st_size
    assert {path.stem for path in Path("nodes").glob("*.py")} == {"lens_falloff", "glow"}
    for schema, node in (("rendergraph.schema.json", "lens_falloff"), ("scene.schema.json", "base_color")):
        assert node in Path(schema).read_text()
    if not words:
        assert " passed" in run("pytest -q -p no:cacheprovider -W error tests", Path.cwd()).stdout


def test_a_project_overwrites_nothing(cli_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in (".gitignore", "rendergraph.schema.json"):
        (cli_folder / name).write_text("mine\n")
    assert main(["init"]) == 0
    assert (cli_folder / ".gitignore").read_text() == (cli_folder / "rendergraph.schema.json").read_text() == "mine\n"
    before = {path: path.stat().st_mtime_ns for path in cli_folder.rglob("*")}
    capsys.readouterr()
    assert main(["init"]) == 3
    assert "pipeline.yaml: RG531 'pipeline.yaml' already exists and was not changed" in capsys.readouterr().err
    assert {path: path.stat().st_mtime_ns for path in cli_folder.rglob("*")} == before
    (cli_folder / "empty").mkdir()
    (cli_folder / "empty" / "scene.yaml").write_text("mine\n")
    assert main(["init", "empty"]) == 3
    assert [path.name for path in (cli_folder / "empty").iterdir()] == ["scene.yaml"]


@pytest.mark.parametrize("inside", ["nodes", "other"])
def test_a_node_in_another_folder_of_a_project_says_how_it_is_found(
    inside: str, cli_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (cli_folder / "rendergraph.toml").write_text('plugins = ["nodes"]\n')
    for name in {"nodes", inside}:
        (cli_folder / name).mkdir()
    monkeypatch.chdir(cli_folder / inside)
    (cli_folder / inside / "rendergraph.schema.json").write_text("{}\n")  # not under test, and slow to write
    assert main(["new-node", "glow"]) == 0
    assert ("--plugin glow.py" in capsys.readouterr().err) == (inside == "other")
    assert Path("glow.frag").is_file()
    assert main(["check", "glow.yaml"]) == (0 if inside == "nodes" else 3)
    if inside == "other":
        assert "RG102 node type 'glow' is Python beside the file" in (err := capsys.readouterr().err)
        assert "pass --plugin glow.py\n" in err


@pytest.fixture
def cli_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_templates_are_shipped_as_data() -> None:
    found = {path.relative_to(folder("rendergraph")) for path in folder("rendergraph").rglob("*.in")}
    assert {path.parts[:2] for path in found} == {("authoring", "templates")}
    assert len(found) >= 4 * 3
