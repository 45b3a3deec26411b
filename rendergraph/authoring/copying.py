"""Copies of shipped pipelines, scenes and nodes in the current folder, ready to edit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from rendergraph.authoring.scaffold import NewNode, refuse_existing, write_files
from rendergraph.catalog import Catalog, NodeType
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.resources import shipped_pipelines, shipped_scenes

_FILE = r"\.?/?[\w./-]+\.[a-z0-9]+\b"
_SHADER = re.compile(r'"([\w./-]+\.(?:frag|vert|geom|comp|glsl))"')
_RELATIVE = re.compile(r"^(\s*from )(\.+)([\w.]*)", re.MULTILINE)


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
        files, commands = _node(catalog.get(word))
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


def _node(node_type: NodeType) -> tuple[dict[str, bytes], list[str]]:
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
