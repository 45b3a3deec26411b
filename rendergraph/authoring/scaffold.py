"""Write a new node or project from templates, or copies of shipped files that are ready to edit: all files or none.

Templates are the files of the folder `templates`, with `@words@` as placeholders.
"""

from __future__ import annotations

import contextlib
import json
import keyword
import re
import shlex
import sys
import tempfile
from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from rendergraph import api
from rendergraph.catalog import Catalog, NodeType
from rendergraph.declare import RESERVED_NAMES
from rendergraph.errors import InputError, Place, Problem, RenderError, suggestion
from rendergraph.installed import module_spec
from rendergraph.keys import as_markdown, file_schema
from rendergraph.resources import folder, shipped_pipelines, shipped_scenes
from rendergraph.scene.scene_keys import SCENE
from rendergraph.schema import schema
from rendergraph.settings import nearest_settings

Kind = Literal["fullscreen", "compute", "geometry", "shader-only"]
KINDS: tuple[Kind, ...] = get_args(Kind)

SCHEMA_FILE = "rendergraph.schema.json"
_IDS_OF_FORWARD = ("sun", "shadows", "light", "display")  # ids that the templates' pipelines already use
_IN_PLACE = {
    "imports": "from pathlib import Path",
    "where": "HERE = Path(__file__).parent",
    "pipeline": 'HERE / "@file@.yaml"',
    "plugins": ', plugins=[HERE / "@name@.py"]',
}
_IN_PACKAGE = {
    "imports": "from importlib.util import find_spec\nfrom pathlib import Path",
    "where": "ROOT = Path(__file__).parents[1]\n"
    'PLUGINS = [] if find_spec("@package@") else [ROOT]  # installed, it is found without being named',
    "pipeline": 'ROOT / "pipelines" / "@name@.yaml"',
    "plugins": ", plugins=PLUGINS",
}
_IN_PROJECT = _IN_PLACE | {"where": "HERE = Path(__file__).parents[1]", "plugins": ', plugins=[HERE / "@nodes@"]'}
_PROJECT_NODE = "lens_falloff"
_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*\Z")
_LONGEST_NAME = 40

_FILE = r"\.?/?[\w./-]+\.[a-z0-9]+\b"
_SHADER = re.compile(r'"([\w./-]+\.(?:frag|vert|geom|comp|glsl))"')
_RELATIVE = re.compile(r"^(\s*from )(\.+)([\w.]*)", re.MULTILINE)


@dataclass(frozen=True)
class NewNode:
    """The files that were written, relative to the given folder, and the commands to run there next."""

    name: str
    kind: Kind
    files: tuple[Path, ...]
    commands: tuple[str, ...]


def new_project(where: Path) -> NewNode:
    """Write a project into a folder, which need not exist: a pipeline, a scene, a node and settings that find it.

    If one of its files exists already, or writing fails, nothing is left behind.
    """
    node = _files(_PROJECT_NODE, "fullscreen", nodes="nodes", file="pipeline")
    words = {"name": _PROJECT_NODE, "id": _PROJECT_NODE, "type": _PROJECT_NODE, "nodes": "nodes"}
    words["schema"] = f"./{SCHEMA_FILE}"
    own = {file.name.removesuffix(".in"): _fill(file, words) for file in _templates("project")}
    more = {".gitignore": own.pop("gitignore"), "scene.schema.json": _json(as_markdown(file_schema(SCENE)))}
    files = node | own
    refuse_existing(where, files)
    more[SCHEMA_FILE] = _schema(files, by_path=False)
    files |= {path: text for path, text in more.items() if not (where / path).exists()}
    write_files(where, files)
    commands = ["rendergraph run pipeline.yaml", "rendergraph new-node glow", "rendergraph run glow.yaml"]
    if where.resolve() != Path.cwd():
        commands.insert(0, f"cd {shlex.quote(str(where))}")
    return NewNode(_PROJECT_NODE, "fullscreen", tuple(where / path for path in files), tuple(commands))


def new_node(name: str, kind: Kind = "fullscreen", *, package: bool = False, where: Path = Path()) -> NewNode:
    """Write a working node into a folder; with `package`, as a folder that can be installed.

    In the folder of a project, the module and shader go into the project's folder of nodes, where they are found. If
    one of the files exists already, or writing fails, nothing is left behind.
    """
    mistake = _name_mistake(name, set(Catalog.discover().names()))
    if mistake:
        raise InputError(Problem("RG530", f"a node cannot be called '{name}': {mistake}"))
    nodes, is_found = ("", False) if package else _project_nodes(where)
    files = _files(name, kind, package=package, nodes=nodes)
    refuse_existing(where, [name] if package else files)
    pipeline = next(file for file in files if file.endswith(".yaml"))
    schema_file = (Path(pipeline).parent / SCHEMA_FILE).as_posix()
    has_schema = (where / schema_file).exists()
    by_path = kind == "shader-only" and not package and not nodes
    if not has_schema:
        files[schema_file] = _schema(files, by_path=by_path)
    write_files(where, files)
    plugin = "--plugin ." if package else "" if by_path or is_found else f"--plugin {name}.py"
    inside = [path.removeprefix(f"{name}/") if package else path for path in files]
    source = next(p for p in inside if Path(p).name == (f"{name}.frag" if kind == "shader-only" else f"{name}.py"))
    run = pipeline.removeprefix(f"{name}/") if package else pipeline
    commands = [f"rendergraph run {run} {plugin}".rstrip(), f"rendergraph check-node {source}", "python -m pytest"]
    if has_schema:
        commands.append(f"rendergraph schema {'' if is_found else '--plugin . '}-o {SCHEMA_FILE}")
    if package:
        commands = [f"cd {name}", *commands, "pip install -e ."]
    return NewNode(name, kind, tuple(Path(path) for path in files), tuple(commands))


def _project_nodes(where: Path) -> tuple[str, bool]:
    """Return the folder of nodes of the project in `where`, and whether a node there is found without options.

    Outside a project the first is empty: a new node's files are written into one folder.
    """
    here, project = where.resolve(), nearest_settings(where.resolve())
    plugins = [path.resolve() for path in project.plugins if path.is_dir()] if project else []
    if any(here.is_relative_to(folder) for folder in plugins):
        return "", True
    below = [folder for folder in plugins if project and project.folder == here and folder.is_relative_to(here)]
    return (below[0].relative_to(here).as_posix(), True) if below else ("", False)


def copy_shipped(name: str, where: Path = Path()) -> NewNode:
    """Copy the shipped item of a name into a folder; the prefix `pipeline:`, `scene:` or `node:` selects the kind.

    A node becomes the type `my_NAME`, with its own shaders and their local includes; it imports code that it shares
    with other nodes. If a file exists already, nothing is written.
    """
    kind, colon, rest = name.partition(":")
    word, catalog = rest or kind, Catalog.discover()
    known: dict[str, Mapping[str, object]] = {"pipeline": shipped_pipelines(), "scene": shipped_scenes()}
    known["node"] = dict.fromkeys(catalog.names())
    found = [each for each in known if word in known[each] and (not colon or each == kind)]
    if len(found) > 1:
        ways = " or ".join(f"{each}:{word}" for each in found)
        raise InputError(Problem("RG511", f"'{word}' is the name of a {' and of a '.join(found)}; write {ways}"))
    if not found:
        names = known.get(kind, {}) if colon else {each: None for names in known.values() for each in names}
        what = f"{kind} '{word}'" if colon and kind in known else f"pipeline, scene or node '{name}'"
        raise InputError(Problem("RG511", f"there is no shipped {what}{suggestion(word, names)}"))
    if found == ["node"]:
        files, commands = _copied_node(catalog.get(word))
    else:
        source = (shipped_pipelines() if found == ["pipeline"] else shipped_scenes())[word]
        files = {source.name: source.read_bytes()}
        for path in re.findall(_FILE, source.read_text(encoding="utf-8")):
            beside = source.parent / path
            if beside.suffix != ".py" and beside.is_file() and beside.resolve().is_relative_to(source.parent.resolve()):
                files[Path(path).as_posix()] = beside.read_bytes()
        run = f"./{source.name}" if found == ["pipeline"] else f"forward --scene ./{source.name}"
        commands = [f"rendergraph run {run}"]
    refuse_existing(where, files)
    write_files(where, files)
    return NewNode(word, "fullscreen", tuple(map(Path, files)), tuple(commands))


def _copied_node(node_type: NodeType) -> tuple[dict[str, bytes], list[str]]:
    name, own = f"my_{node_type.name}", node_type.file.stem
    module = node_type.cls.__module__
    package = "rendergraph.nodes" if node_type.is_shader else module.rpartition(".")[0]

    def absolute(match: re.Match[str]) -> str:
        base = package.rsplit(".", len(match[2]) - 1)[0] if len(match[2]) > 1 else package
        return f"{match[1]}{base}{'.' if match[3] else ''}{match[3]}"

    text = node_type.file.read_text(encoding="utf-8")
    files = {f"{name}{node_type.file.suffix}": text if node_type.is_shader else _RELATIVE.sub(absolute, text)}
    default = f"{own}.frag"  # a shader that the module does not name is named after the type
    waiting = list(dict.fromkeys([*_SHADER.findall(text), default]))
    while waiting:
        shader = waiting.pop()
        target = f"{name}.frag" if shader == default and f'"{default}"' not in text else shader
        if target not in files and (node_type.shaders / shader).is_file():
            files[target] = (node_type.shaders / shader).read_text(encoding="utf-8")
            waiting += _SHADER.findall(files[target])
    plugin = f"--plugin {name}{node_type.file.suffix}"
    commands = [f"rendergraph explain {name} {plugin}", f"rendergraph run PIPELINE -s NODE.type={name} {plugin}"]
    return {path: text.encode() for path, text in files.items()}, commands


# --- names ------------------------------------------------------------------------------------------------------------


def class_name(name: str) -> str:
    """Return `LensFalloff` for `lens_falloff`, or a longer name if `rendergraph.api` has that one."""
    camel = "".join(part.capitalize() for part in name.split("_"))
    return f"{camel}Node" if hasattr(api, camel) else camel


def _name_mistake(name: str, existing: Set[str]) -> str:
    """Return why a name cannot be a node type, a module and a GLSL file at once; empty if it can."""
    if not _NAME.match(name) or len(name) > _LONGEST_NAME:
        better = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
        better = re.sub(r"[^a-z0-9]+", "_", better).strip("_0123456789")[:_LONGEST_NAME].strip("_")
        hint = f", such as '{better}'" if better and not _name_mistake(better, existing) else ""
        return f"expected up to {_LONGEST_NAME} lower-case letters, digits and single underscores{hint}"
    other = f"; choose another, such as 'my_{name}'"
    if name in existing:
        return f"a node type of that name exists{other}"
    if name in RESERVED_NAMES or keyword.iskeyword(name) or name.startswith("gl_"):
        return f"the word is reserved by GLSL or Python{other}"
    if name.startswith("test_") or name == "conftest":
        return f"pytest would take the module for a test; choose another, such as '{name.removeprefix('test_')}_node'"
    if name in sys.stdlib_module_names or _is_installed(name):
        return f"a Python module has that name, and one would hide the other{other}"
    return ""


def _is_installed(name: str) -> bool:
    spec = module_spec(name)
    return spec is not None and spec.origin is not None and Path(spec.origin).parent != Path.cwd()


# --- what is written --------------------------------------------------------------------------------------------------


def _files(name: str, kind: Kind, *, package: bool = False, nodes: str = "", file: str = "") -> dict[str, str]:
    """Return the files of a node by path; `nodes` is the project's folder of nodes, `file` the pipeline's name."""
    by_path = kind == "shader-only" and not package and not nodes
    words = {
        "name": name,
        "file": file or name,
        "nodes": nodes,
        "Class": class_name(name),
        "id": f"my_{name}" if name in _IDS_OF_FORWARD else name,
        "type": f"./{name}.frag" if by_path else name,
        "package": f"rendergraph_{name}",
        "dashed": name.replace("_", "-"),
        "schema": f"./{SCHEMA_FILE}",
        "summary": _summary(kind),
    } | (_IN_PACKAGE if package else _IN_PROJECT if nodes else _IN_PLACE)
    if by_path:
        words["plugins"] = ""
    files = {}
    if package:
        own = {file.name.removesuffix(".in"): _fill(file, words) for file in _templates("package")}
        files = {f"{name}/{'.gitignore' if file == 'gitignore' else file}": text for file, text in own.items()}
        for root in ("nodes", "shaders"):
            files[f"{name}/{root}/__init__.py"] = f'"""{root.capitalize()} of `{words["package"]}`."""\n'
    homes = {"test": "tests", "node": nodes} if nodes else {}
    for template in _templates(kind):
        stem, suffix = template.name.removesuffix(".in").split(".")
        target = f"test_{name}.py" if stem == "test" else f"{words['file'] if stem == 'pipeline' else name}.{suffix}"
        if package:
            is_module = suffix == "py" or kind == "shader-only"  # a shader node is stored with the nodes
            homes = {"pipeline": "pipelines", "test": "tests", "node": "nodes" if is_module else "shaders"}
            target = f"{name}/{homes[stem]}/{target}"
        elif home := homes.get(stem):
            target = f"{home}/{target}"
        files[target] = _fill(template, words)
    return files


def _summary(kind: Kind) -> str:
    texts = (file.read_text(encoding="utf-8") for file in _templates(kind))
    found = (re.search(r'(?:class @Class@\(Node\):\n    """|doc: )(.*?)(?:"""|\n)', text) for text in texts)
    return next(match[1] for match in found if match)


def _templates(kind: str) -> list[Path]:
    return sorted((folder("rendergraph.authoring") / "templates" / kind).glob("*.in"))


def _fill(file: Path, words: Mapping[str, str]) -> str:
    text = file.read_text(encoding="utf-8")
    for _ in range(2):  # values may contain placeholders
        text = re.sub(r"@(\w+)@", lambda found: words[found[1]], text)
    return text


def _schema(files: Mapping[str, str], *, by_path: bool) -> str:
    """Return the schema of all installed nodes and of this node, unless the pipeline names it by path."""
    with tempfile.TemporaryDirectory() as place:
        node = Path(place) / "nodes"
        node.mkdir()
        for path, text in files.items():
            if Path(path).suffix in (".py", ".frag", ".comp") and not Path(path).name.startswith(("test_", "_")):
                (node / Path(path).name).write_text(text, encoding="utf-8")
        return _json(schema(Catalog.discover([] if by_path else [node])))


def _json(document: Any) -> str:
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def refuse_existing(where: Path, paths: Iterable[str]) -> None:
    """Raise an InputError if one of the files to be written exists."""
    existing = [path for path in paths if (where / path).exists() or (where / path).is_symlink()]
    text = "'{}' already exists and was not changed; move it or choose another name"
    if existing:
        raise InputError([Problem("RG531", text.format(path), Place(path)) for path in existing])


def write_files(where: Path, files: Mapping[str, str | bytes]) -> None:
    """Write all files or none; a file created meanwhile under one of the names is not touched."""
    made: list[Path] = []
    try:
        for path, text in files.items():
            target = where / path
            for parent in reversed([target.parent, *target.parent.parents]):
                if not parent.is_dir():
                    parent.mkdir()
                    made.append(parent)
            with target.open("xb") as file:
                made.append(target)
                file.write(text.encode() if isinstance(text, str) else text)
    except BaseException as error:
        for target in reversed(made):
            with contextlib.suppress(OSError):
                target.rmdir() if target.is_dir() else target.unlink()
        if isinstance(error, FileExistsError):
            refuse_existing(where, [path for path in files if where / path not in made])
        if isinstance(error, OSError):
            shown = Path(str(error.filename)) if error.filename else where
            raise RenderError(Problem("RG509", f"{shown}: {error.strerror or error}")) from error
        raise
