"""The program of a step: what its shaders may use, and their final text."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from rendergraph.catalog import Catalog, NodeType
from rendergraph.errors import InputError, Problem, UsageError, node_named, suggestion
from rendergraph.expand import Expansion
from rendergraph.reference.examples import example_file
from rendergraph.resources import shipped_pipelines
from rendergraph.session import Selection, stages
from rendergraph.session.values import Linked
from rendergraph.steps import Step

_KINDS_WITH_PROGRAM = ("fullscreen", "geometry", "draw", "compute")


def find_node_of_type(node_type: NodeType, catalog: Catalog, select: Callable[[str], Selection]) -> tuple[Linked, str]:
    """Return the example of a node type, changed by the options in `select`, and the id of the type's node in it."""
    import yaml  # other topics need no YAML

    text = example_file(node_type, catalog)
    if text is None:
        text = f"no shipped pipeline uses '{node_type.name}'; name one with --pipeline, and the node's id"
        raise InputError(Problem("RG511", text))
    names = [name for name, file in shipped_pipelines().items() if file.read_text(encoding="utf-8") == text]
    patch = {} if names else yaml.safe_load(text)
    selection = select(names[0] if names else patch.pop("extends"))
    selection = replace(selection, patches=(*([patch] if patch else []), *selection.patches))
    for candidate in (selection, replace(selection, environment=selection.environment or Path("studio"))):
        linked = stages.link(stages.resolve(candidate, catalog))
        nodes = [node.id for node in linked.graph.nodes if node.type.name == node_type.name]
        if nodes or not linked.graph.unlit:  # some nodes take part only where the scene has an environment
            break
    if not nodes:
        raise InputError(Problem("RG511", f"these options leave no node of type '{node_type.name}'"))
    return linked, nodes[0]


def describe_program(linked: Linked, node: str, number: int | None) -> dict[str, Any]:
    """Return what is in scope in a step of a node, and the final text of its shaders.

    The number is that of `plan`; None selects the first step that has a program.
    """
    expansion, steps = _steps_with_program(linked, node)
    kept = {id for id, resource in expansion.resources.items() if resource.role == "kept"}
    each_frame = [one for one in steps if not any(write.resource in kept for write in one.writes)]
    first = (each_frame or steps)[0]
    step = first if number is None else next((one for one in steps if one.index == number), None)
    if step is None:
        listed = ", ".join(f"{s.index} ({s.label or ', '.join(name for _, name in s.shaders)})" for s in steps)
        text = f"--step: '{node}' has no step {number} with a program; available: {listed}"
        raise UsageError(Problem("RG500", text))
    return _describe(linked, expansion, steps, step)


def describe_programs(linked: Linked, node: str) -> list[dict[str, Any]]:
    """Return `describe_program` of every step that has a program."""
    expansion, steps = _steps_with_program(linked, node)
    return [_describe(linked, expansion, steps, step) for step in steps]


def complete_shader(linked: Linked, node: str, shader: str | None) -> str:
    """Return one shader of a node as GLSL that any compiler takes, includes resolved.

    `#line` gives each line the number that it has in its file: string 0 is the shader, so messages about it name the
    author's own lines; the strings of other files are listed after `#version`, and the last is what rendergraph writes.

    Args:
        shader: the file's name; by default the one that is named after the node type, or the only one.
    """
    found: dict[str, Any] = {}
    for program in describe_programs(linked, node):
        for stage, name in program["shaders"].items():
            found.setdefault(name, program["stages"][stage])
    stem = next(one.type for one in linked.graph.nodes if one.id == node).word
    of_node = [name for name in found if not name.startswith("<")] or [*found]
    of_node = [name for name in of_node if name in (f"{stem}.frag", f"{stem}.comp")] or of_node
    if shader is None and len(of_node) > 1:
        text = f"'{node}' has several shaders; choose one with --shader: {', '.join(of_node)}"
        raise UsageError(Problem("RG500", text))
    name = shader or of_node[0]
    if name not in found:
        text = f"--shader: '{node}' has no shader '{name}'; available: {', '.join(found)}"
        raise UsageError(Problem("RG500", text + suggestion(name, found, most=0)))
    lines, origins = found[name]["text"].split("\n"), found[name]["origins"]
    ending = Path(name.strip("<>")).name
    own = next(one["file"] for one in reversed(origins) if one["file"] and Path(one["file"]).name == ending)
    files = dict.fromkeys([own, *(one["file"] for one in origins if one["file"]), None])
    strings = {file: number for number, file in enumerate(files)}
    legend = [f"// string {number}: {file or 'written by rendergraph'}" for file, number in strings.items()]
    output, last = [lines[0], *legend], (None, 0)
    for line, one in zip(lines[1:], origins[1:], strict=False):
        here = one["file"], one["line"]
        if here[0] != last[0] or (here[0] is not None and here[1] != last[1] + 1):
            output.append(f"#line {here[1] or 1} {strings[here[0]]}")
        output.append(line)
        last = here
    return "\n".join(output) + "\n"


def _steps_with_program(linked: Linked, node: str) -> tuple[Expansion, list[Step]]:
    types = {one.id: one.type for one in linked.graph.nodes}
    if node not in types:
        text = f"pipeline '{linked.graph.name}' has no node '{node}'{suggestion(node, types)}"
        raise InputError(Problem("RG511", text))
    expansion = stages.expand(linked).expansion
    steps = [step for step in expansion.steps if step.node == node and step.kind in _KINDS_WITH_PROGRAM]
    if not steps:
        callers = [step.node for step in expansion.steps if any(one.node == node for one in step.functions)]
        idle = expansion.idle.get(node)
        reason = f" here: {idle}" if idle else " here"
        reason = f": its function is compiled into that of '{callers[0]}'" if callers else reason
        raise InputError(Problem("RG511", f"{node_named(node, types[node].name)} has no program{reason}"))
    return expansion, steps


def _describe(linked: Linked, expansion: Expansion, steps: list[Step], step: Step) -> dict[str, Any]:
    from rendergraph.program import TextSources, stage_texts  # most topics need no GLSL
    from rendergraph.program.scope import annotated, in_scope  # likewise
    from rendergraph.program.variants import variants  # likewise
    from rendergraph.scene.pack import pack  # likewise

    types = {one.id: one.type for one in linked.graph.nodes}
    found = variants(step, linked.scene, pack(linked.scene), expansion.views)
    macros = (found or [{}])[0]
    sources = TextSources(types, expansion.resources, expansion.views)
    texts = stage_texts(step, sources, defines=macros)
    scope = in_scope(step, sources, macros, texts)
    return {
        "pipeline": linked.graph.name,
        "node": step.node,
        "type": types[step.node].name,
        "step": step.index,
        "shaders": dict(step.shaders),
        "steps": [
            {"step": one.index, "label": one.label, "kind": one.kind, "shaders": dict(one.shaders)} for one in steps
        ],
        "variants": len(found),
        "differ": sorted({f"{k} {v}" for one in found for k, v in one.items() if any(o.get(k) != v for o in found)}),
        "scope": [{"section": one.section, "name": one.name, "source": one.source} for one in scope],
        "stages": {
            stage: {"text": text.text, "annotated": annotated(text), "origins": _origins(text)}
            for stage, text in texts.items()
        },
    }


def _origins(text: Any) -> list[dict[str, Any]]:
    """File and line of each line; a line that rendergraph writes has no file, but the reason in `made`."""
    return [
        {"file": str(one.file) if one.file is not None else None, "line": one.line, "made": one.purpose}
        for one in text.source.origins
    ]
