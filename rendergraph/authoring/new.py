"""A new node from a template: module, shader, pipeline and test, all of them or none.

Templates are the files of the folder `templates`, with `@words@` to fill in.
"""

from __future__ import annotations

import contextlib
import json
import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from rendergraph.authoring.names import check_name, class_name
from rendergraph.catalog import Catalog
from rendergraph.errors import InputError, Place, Problem, RenderError
from rendergraph.resources import folder
from rendergraph.schema import schema

Kind = Literal["fullscreen", "compute", "geometry", "shader-only"]
KINDS: tuple[Kind, ...] = get_args(Kind)

SCHEMA_FILE = "rendergraph.schema.json"
_IDS_OF_FORWARD = ("sun", "shadows", "light", "display")  # ids that the templates' pipelines have already
_IN_PLACE = {
    "imports": "from pathlib import Path",
    "where": "HERE = Path(__file__).parent",
    "pipeline": 'HERE / "@name@.yaml"',
    "plugins": ', plugins=[HERE / "@name@.py"]',
}
_IN_PACKAGE = {
    "imports": "from importlib.util import find_spec\nfrom pathlib import Path",
    "where": "ROOT = Path(__file__).parents[1]\n"
    'PLUGINS = [] if find_spec("@package@") else [ROOT]  # installed, it is found without being named',
    "pipeline": 'ROOT / "pipelines" / "@name@.yaml"',
    "plugins": ", plugins=PLUGINS",
}


@dataclass(frozen=True)
class NewNode:
    """What has been written.

    Attributes:
        name: the node's type.
        kind: which template.
        files: the paths, relative to the folder they were asked for in.
        commands: what to type next, in that folder.
    """

    name: str
    kind: Kind
    files: tuple[Path, ...]
    commands: tuple[str, ...]


def new_node(name: str, kind: Kind = "fullscreen", *, package: bool = False, where: Path = Path()) -> NewNode:
    """Write a working node.

    Args:
        name: its type: lower-case letters, digits and underscores.
        kind: which template.
        package: a folder that can be installed, instead of files in place.
        where: the folder to write into.

    Raises:
        InputError: the name cannot be used, or a file of it exists already; nothing has been written then.
        RenderError: writing failed; nothing is left behind.
    """
    check_name(name, Catalog.discover().names())
    files = _package(name, kind) if package else _in_place(name, kind)
    _refuse_existing(where, [name] if package else files)
    pipeline = next(file for file in files if file.endswith(".yaml"))
    schema_file = (Path(pipeline).parent / SCHEMA_FILE).as_posix()
    fresh = not (where / schema_file).exists()
    if fresh:
        files[schema_file] = _schema(files, by_path=kind == "shader-only" and not package)
    _write(where, files)
    plugin = "--plugin . " if package else "" if kind == "shader-only" else f"--plugin {name}.py "
    commands = [f"cd {name}"] if package else []
    inside = [path.removeprefix(f"{name}/") if package else path for path in files]
    source = next(p for p in inside if Path(p).name == (f"{name}.frag" if kind == "shader-only" else f"{name}.py"))
    run = pipeline.removeprefix(f"{name}/") if package else pipeline
    commands += [f"rendergraph run {run} {plugin}".rstrip(), f"rendergraph check-node {source}", "pytest"]
    if not fresh:
        commands.append(f"rendergraph schema --plugin . -o {SCHEMA_FILE}")
    if package:
        commands.append("pip install -e .")
    return NewNode(name, kind, tuple(Path(path) for path in files), tuple(commands))


# --- what is written -------------------------------------------------------------------------------------------------


def _in_place(name: str, kind: Kind) -> dict[str, str]:
    """Path to text of a node whose files stand beside each other."""
    words = _words(name, kind, f"./{name}.frag" if kind == "shader-only" else name) | _IN_PLACE
    if kind == "shader-only":
        words["plugins"] = ""
    found = {}
    for file in _templates(kind):
        stem, suffix = file.name.removesuffix(".in").split(".")
        target = {"node": f"{name}.{suffix}", "pipeline": f"{name}.yaml", "test": f"test_{name}.py"}[stem]
        found[target] = _filled(file, words)
    return found


def _package(name: str, kind: Kind) -> dict[str, str]:
    """Path to text of a folder that can be installed."""
    words = _words(name, kind, name) | _IN_PACKAGE
    found = {f"{name}/{file.name.removesuffix('.in')}": _filled(file, words) for file in _templates("package")}
    for file in _templates(kind):
        stem, suffix = file.name.removesuffix(".in").split(".")
        shaders = "nodes" if kind == "shader-only" else "shaders"  # a shader that is a node lies where nodes do
        home = {"pipeline": "pipelines", "test": "tests"}.get(stem, "nodes" if suffix == "py" else shaders)
        target = f"test_{name}.py" if stem == "test" else f"{name}.{suffix}"
        found[f"{name}/{home}/{target}"] = _filled(file, words)
    for home in ("nodes", "shaders"):
        found[f"{name}/{home}/__init__.py"] = f'"""{home.capitalize()} of `{words["package"]}`."""\n'
    return found


def _words(name: str, kind: Kind, node_type: str) -> dict[str, str]:
    return {
        "name": name,
        "Class": class_name(name),
        "id": f"my_{name}" if name in _IDS_OF_FORWARD else name,
        "type": node_type,
        "package": f"rendergraph_{name}",
        "dashed": name.replace("_", "-"),
        "schema": f"./{SCHEMA_FILE}",
        "summary": _summary(kind),
    }


def _summary(kind: Kind) -> str:
    """The first line of what a template says of its node."""
    for file in _templates(kind):
        text = file.read_text(encoding="utf-8")
        found = re.search(r'class @Class@\(Node\):\n    """(.*?)(?:"""|\n)', text) or re.search(r"doc: (.*)", text)
        if found:
            return found[1]
    raise AssertionError(f"the templates of '{kind}' do not say what they make")


def _templates(kind: str) -> list[Path]:
    return sorted((folder("rendergraph.authoring") / "templates" / kind).glob("*.in"))


def _filled(file: Path, words: Mapping[str, str]) -> str:
    text = file.read_text(encoding="utf-8")
    for _ in range(2):  # words may hold words
        text = re.sub(r"@(\w+)@", lambda found: words[found[1]], text)
    return text


def _schema(files: Mapping[str, str], *, by_path: bool) -> str:
    """The schema of everything installed and of this node, which is not written yet; one by path needs no entry."""
    with tempfile.TemporaryDirectory() as place:
        node = Path(place) / "nodes"
        node.mkdir()
        for path, text in files.items():
            if Path(path).suffix in (".py", ".frag", ".comp") and not Path(path).name.startswith(("test_", "_")):
                (node / Path(path).name).write_text(text, encoding="utf-8")
        return json.dumps(schema(Catalog.discover([] if by_path else [node])), indent=2, ensure_ascii=False) + "\n"


# --- writing ---------------------------------------------------------------------------------------------------------


def _refuse_existing(where: Path, paths: list[str] | Mapping[str, str]) -> None:
    problems = [
        Problem(
            "RG531", f"'{path}' exists already and is left as it is; move it away or choose another name", Place(path)
        )
        for path in paths
        if (where / path).exists() or (where / path).is_symlink()
    ]
    if problems:
        raise InputError(problems)


def _write(where: Path, files: Mapping[str, str]) -> None:
    """All files or none; what appears meanwhile under one of the names is not touched."""
    made: list[Path] = []
    try:
        for path, text in files.items():
            target = where / path
            for parent in reversed(target.relative_to(where).parents[:-1]):
                if not (where / parent).is_dir():
                    (where / parent).mkdir()
                    made.append(where / parent)
            with target.open("x", encoding="utf-8") as file:
                made.append(target)
                file.write(text)
    except BaseException as error:
        for target in reversed(made):
            with contextlib.suppress(OSError):
                target.rmdir() if target.is_dir() else target.unlink()
        if isinstance(error, FileExistsError):
            _refuse_existing(where, [path for path in files if where / path not in made])
        if isinstance(error, OSError):
            shown = Path(str(error.filename)) if error.filename else where
            raise RenderError(Problem("RG509", f"{shown}: {error.strerror or error}")) from error
        raise
