"""A page for each node type, and their list by family."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rendergraph.catalog import NodeType
from rendergraph.errors import InputError
from rendergraph.reference import (
    describe_node,
    describe_programs,
    example_text,
    find_node_of_type,
    input_facts,
    meaning,
    output_facts,
    summary,
)
from rendergraph.reference.python import signature
from rendergraph.session import Selection

from .markdown import block, code, folded, listing, long_table, page, prose, table
from .pictures import Studio, View, catalog, example_and_base, exhibit

STEPS = {"param": "uniform", "define": "compiled in", "structural": "plan"}


def pages(studio: Studio) -> Iterator[tuple[str, str]]:
    """The index and every page."""
    families = {
        family: [found for found in map(catalog().get, names) if found.plugin == "builtin"]
        for family, names in catalog().families().items()
    }
    described = {found.name: describe_node(found) for members in families.values() for found in members}
    yield "nodes/index.md", _index(families)
    for members in families.values():
        for found in members:
            yield f"nodes/{found.name}.md", _page(found, described, studio)
    yield "nodes/bases.md", _bases_page([found for members in families.values() for found in members])


def _index(families: dict[str, list[NodeType]]) -> str:
    parts = [
        "Every node type that comes with rendergraph, by family. `rendergraph nodes` prints the same list, and "
        "`rendergraph explain NODE` the same pages."
    ]
    for family, members in families.items():
        if members:
            rows = [(f"[`{found.name}`]({found.name}.md)", prose(summary(found))) for found in members]
            parts.append(f"## {family.capitalize() or 'Others'}\n\n" + table(("type", "what it makes"), rows))
    names = [found.name for members in families.values() for found in members]
    parts.append("Several are made of the same pieces, which nodes of yours may extend: [bases](bases.md).")
    return page("Nodes", *parts, listing([*names, "bases"]))


def _page(found: NodeType, described: dict[str, dict[str, Any]], studio: Studio) -> str:
    node = described[found.name]
    first, _, rest = node["doc"].partition("\n")
    inputs = table(
        ("input", "takes", "", "", "made by"),
        [
            (code(p["name"]), code(meaning(p)), ", ".join(input_facts(p)), prose(p["doc"]), _makers(p, described))
            for p in node["inputs"]
        ],
    )
    outputs = table(
        ("output", "carries", "as", ""),
        [
            (code(p["name"]), code(meaning(p)), prose(", ".join(output_facts(p))), prose(p["doc"]))
            for p in node["outputs"]
        ],
    )
    internal = table(
        ("texture", "as", ""),
        [(code(p["name"]), prose(", ".join(output_facts(p))), prose(p["doc"])) for p in node["internal"]],
    )
    parameters = table(
        ("parameter", "value", "default", "range", "as", ""),
        [
            (
                code(p["name"]),
                code(p["type"]),
                _value(p["default"], p["unit"]),
                _range(p),
                STEPS[p["role"]],
                prose(p["doc"]),
            )
            for p in node["parameters"]
        ],
    )
    return page(
        f"`{found.name}`",
        f"*{found.family}* — {prose(first)}",
        prose(rest.strip()),
        f"Its exact twin, with the same outputs, is [`{node['twin']}`]({node['twin']}.md)." if node["twin"] else "",
        _extends(found),
        _pictures(found, node["outputs"], studio),
        f"## In a file\n\n{block(example_text(found, catalog()), 'yaml')}",
        f"## Inputs\n\n{inputs}" if inputs else "",
        f"## Outputs\n\n{outputs}",
        f"## Parameters\n\n{parameters}" if parameters else "",
        f"## Textures of its own\n\n{internal}" if internal else "",
        _in_scope(found),
        "## How it is made\n\n" + "\n\n".join(_sources(found)),
    )


def _bases(found: NodeType) -> list[type]:
    """What its class extends, the nearest first, as far as that is no node type by itself."""
    own = [cls for cls in found.cls.__mro__[1:] if cls.__module__.startswith("rendergraph.nodes.")]
    return [cls for cls in own if cls.__module__.rpartition(".")[2].startswith("_")]


def _extends(found: NodeType) -> str:
    """The bases, with the names that a subclass may use."""
    bases = [f"[`{cls.__name__}`](bases.md#{cls.__name__.lower()})" for cls in _bases(found)]
    line = f"`from {found.cls.__module__} import {found.cls.__name__}`"
    return f"To extend it: {line}." + (f" It is made of {' and '.join(bases)}." if bases else "")


def _bases_page(types: list[NodeType]) -> str:
    """Every base, with what a class that extends it has: its doc, ports, parameters, methods and source."""
    users: dict[type, list[str]] = {}
    for found in types:
        for cls in _bases(found):
            users.setdefault(cls, []).append(found.name)
    parts = [_base(cls, names) for cls, names in sorted(users.items(), key=lambda entry: entry[0].__name__)]
    about = (
        "What several standard nodes are made of. They are no types of their own: a node [extends "
        "one](../../../guide/write-a-node.md#extend-a-node), has its ports and parameters, calls its methods in "
        "`record`, and finds its shaders and includes. They change more readily than nodes do."
    )
    files = sorted({Path(inspect.getfile(cls)) for cls in users})
    sources = [folded(f"<code>{file.name}</code>", block(file.read_text(encoding="utf-8"), "python")) for file in files]
    return page("Bases", about, *parts, "## Their modules", *sources)


def _base(cls: Any, users: list[str]) -> str:
    methods = {
        name: value
        for name, value in vars(cls).items()
        if inspect.isfunction(value) and name[0] != "_" and name not in ("record", "update")
    }
    calls = [
        f"{block(name + signature(value, method=True), 'python')}\n\n{prose(_first(value))}"
        for name, value in methods.items()
    ]
    own = [name for name in vars(cls) if name in cls.ports()]
    ports = [(code(name), code(type(cls.ports()[name]).__name__), prose(cls.ports()[name].doc)) for name in own]
    return "\n\n".join(
        [
            f"## {cls.__name__}",
            block(f"from {cls.__module__} import {cls.__name__}", "python"),
            prose(inspect.getdoc(cls) or ""),
            "Of " + ", ".join(f"[`{name}`]({name}.md)" for name in users) + ".",
            table(("port", "is", ""), ports),
            *calls,
        ]
    )


def _first(function: Any) -> str:
    return (inspect.getdoc(function) or "").partition("\n")[0]


def _in_scope(found: NodeType) -> str:
    """What the shaders of its steps may use in the pipeline above, folded; nothing where it has no program there."""
    try:
        linked, node = find_node_of_type(found, catalog(), Selection)
        programs = describe_programs(linked, node)
    except InputError:
        return ""
    tables = [
        folded(
            f"step {step['step']}: " + ", ".join(f"<code>{name}</code>" for name in step["shaders"].values()),
            long_table(("in scope", "from"), [(" ".join(one["name"].split()), one["source"]) for one in step["scope"]]),
        )
        for step in programs
    ]
    return "## In scope of its shaders\n\n" + "\n\n".join(tables)


def _pictures(found: NodeType, outputs: list[dict[str, Any]], studio: Studio) -> str:
    """What its textures hold, and before it what they were made of; without textures, what its readers make of it."""
    figures = []
    for port in outputs:
        textures = port["kind"] not in ("view", "function", "buffer")
        if textures and (shown := exhibit(found, port["name"])):
            figures += _pair(studio, f"{found.name}-{port['name']}", *shown)
    if not figures:
        for pipeline, base in example_and_base(found):
            figures += _pair(studio, f"{found.name}-image", View(pipeline, None), View(base, None))
    return ":::{container} pictures\n" + "\n\n".join(figures) + "\n:::" if figures else ""


def _pair(studio: Studio, stem: str, after: View, before: View | None) -> list[str]:
    """Two figures of one scene, or one; none where there is nothing to see."""
    for scene in studio.scenes(after, before):
        figure = _figure(studio, after, stem, scene)
        if figure:
            return ([_figure(studio, before, f"{stem}-before", scene)] if before else []) + [figure]
    return []


def _figure(studio: Studio, view: View, name: str, scene: str) -> str:
    if studio.draw(view.pipeline.with_scene(scene), f"nodes/{name}.png", view.tap) is None:
        return ""
    where = "the file below" if view.pipeline.selection.patches else f"`{view.pipeline.resolve().spec.name}`"
    caption = f"{'before: ' if name.endswith('-before') else ''}`{view.name}` of {where}, scene `{scene}`"
    return f"```{{figure}} {name}.png\n:alt: {caption.replace('`', '')}\n\n{caption}\n```"


def _makers(port: dict[str, Any], described: dict[str, dict[str, Any]]) -> str:
    """The standard nodes with an output that fits."""
    if port["semantic"] in (None, "any", "view", "scene"):
        return ""
    names = [
        name
        for name, node in described.items()
        if any(o["semantic"] == port["semantic"] and o["kind"] == port["kind"] for o in node["outputs"])
    ]
    return ", ".join(f"[`{name}`]({name}.md)" for name in names)


def _value(value: Any, unit: str) -> str:
    shown = {True: "true", False: "false"}.get(value, value) if isinstance(value, bool) else value
    shown = f"{value:g}" if isinstance(value, float) else shown
    return f"{code(shown)} {unit}".strip()


def _range(parameter: dict[str, Any]) -> str:
    low, high = parameter.get("min"), parameter.get("max")
    if low is None and high is None:
        return ""
    if low is None or high is None:
        return f"≥ {low:g}" if high is None else f"≤ {high:g}"
    return f"{low:g} … {high:g}"


def _sources(found: NodeType) -> Iterator[str]:
    """The whole node: its module, and the shaders that the module or one of its bases names."""
    text = found.file.read_text(encoding="utf-8")
    if found.is_shader:
        yield folded(f"<code>{found.file.name}</code>", block(text, "glsl"))
        return
    yield folded(f"<code>{found.file.name}</code>", block(text, "python"))
    for file in shader_files(found):
        yield folded(f"<code>{file.name}</code>", block(file.read_text(encoding="utf-8"), "glsl"))


def shader_files(found: NodeType) -> list[Path]:
    """The node's own shader files, in the order they are named, and what they include from beside them."""
    own = [cls for cls in found.cls.__mro__ if cls.__module__.startswith(found.cls.__module__.partition(".")[0])]
    own = [cls for cls in own if not cls.__module__.startswith("rendergraph.declare")]
    texts = [Path(inspect.getfile(cls)).read_text(encoding="utf-8") for cls in own]
    names = re.findall(r'"([\w/]+\.(?:vert|geom|frag|comp|glsl))"', "\n".join(texts))
    if found.cls.record is _default_record():
        names.insert(0, found.cls.shader or f"{found.name}.frag")
    files: list[Path] = []
    for name in names:
        _with_includes(found.shader_file(name)[0], files)
    return files


def _default_record() -> Any:
    from rendergraph.api import Node

    return Node.record


def _with_includes(file: Path, files: list[Path]) -> None:
    if file in files or not file.is_file():
        return
    files.append(file)
    for name in re.findall(r'^\s*#\s*include\s+"([^"]+)"', file.read_text(encoding="utf-8"), re.MULTILINE):
        _with_includes(file.parent / name, files)
