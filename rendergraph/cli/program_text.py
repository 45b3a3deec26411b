"""`rendergraph explain NODE --glsl`: what a step's program may use, and its final text."""

from __future__ import annotations

import textwrap
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.cli.output import amount
from rendergraph.errors import InputError, Problem, UsageError, node_named, suggestion

if TYPE_CHECKING:
    from rendergraph.catalog import Catalog, NodeType
    from rendergraph.cli.options import Select
    from rendergraph.session.values import Linked
    from rendergraph.steps import Step

_TITLES = {
    "textures": "textures",
    "uniforms": "uniforms",
    "blocks": "blocks, views and tables",
    "macros": "macros",
    "functions": "functions of other nodes, and who provides them",
    "includes": "included files, and what they declare",
    "attributes": "attributes",
    "varyings": "varyings",
    "outputs": "outputs",
}


def shown_at_work(found: NodeType, catalog: Catalog, select: Select) -> tuple[Linked, str]:
    """The example of a type, with what was said about it, and the id of the type's node there.

    Raises:
        InputError: there is none, as no shipped pipeline has what the node needs.
    """
    import yaml
    from msgspec.structs import replace

    from rendergraph.example import example
    from rendergraph.resources import shipped_pipelines
    from rendergraph.session import stages

    text = example(found, catalog)
    if text is None:
        text = f"no shipped pipeline shows '{found.name}'; name one that does with --pipeline, and the node's id"
        raise InputError(Problem("RG511", text))
    names = [name for name, file in shipped_pipelines().items() if file.read_text(encoding="utf-8") == text]
    patch = {} if names else yaml.safe_load(text)
    selection = select(names[0] if names else patch.pop("extends"))
    selection = replace(selection, patches=(*([patch] if patch else []), *selection.patches))
    for around in (selection, replace(selection, environment=selection.environment or Path("studio"))):
        linked = stages.link(stages.resolve(around, catalog))
        nodes = [node.id for node in linked.graph.nodes if node.type.name == found.name]
        if nodes or not linked.graph.unlit:  # else it takes part where the scene has an environment
            break
    if not nodes:
        raise InputError(Problem("RG511", f"what was set leaves no node of type '{found.name}'"))
    return linked, nodes[0]


def program(linked: Linked, node: str, number: int | None) -> dict[str, Any]:
    """What is in scope in a step of a node, and the text of its stages, as plain values.

    Args:
        linked: the pipeline that the node stands in.
        node: its id.
        number: which of its steps, as `plan` numbers them; None for the first that has a program.

    Raises:
        InputError: there is no such node, or it has no program of its own.
        UsageError: it has no such step, or that has no program.
    """
    from rendergraph.program import stage_texts
    from rendergraph.program.scope import annotated, in_scope
    from rendergraph.program.variants import variants
    from rendergraph.scene.pack import pack
    from rendergraph.session import stages

    types = {one.id: one.type for one in linked.graph.nodes}
    if node not in types:
        text = f"pipeline '{linked.graph.name}' has no node '{node}'{suggestion(node, types)}"
        raise InputError(Problem("RG511", text))
    expansion = stages.expand(linked).expansion
    steps = [step for step in expansion.steps if step.node == node and step.kind in _DRAWS]
    if not steps:
        raise InputError(Problem("RG511", _why_not(node, types[node].name, expansion.steps, expansion.idle.get(node))))
    step = next((one for one in steps if number in (one.index, None)), None)
    if step is None:
        listed = ", ".join(_step_words(one) for one in steps)
        raise UsageError(Problem("RG500", f"--step: '{node}' has no step {number} with a program, but {listed}"))
    found = variants(step, linked.scene, pack(linked.scene), expansion.views)
    macros = (found or [{}])[0]
    texts = stage_texts(step, types, expansion.resources, expansion.views, defines=macros)
    scope = in_scope(step, types, expansion.resources, expansion.views, macros, texts)
    return {
        "pipeline": linked.graph.name,
        "node": node,
        "type": types[node].name,
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


_DRAWS = ("fullscreen", "geometry", "draw", "compute")


def _step_words(step: Step) -> str:
    return f"{step.index} ({step.label or ', '.join(name for _, name in step.shaders)})"


def _why_not(node: str, name: str, steps: tuple[Step, ...], idle: str | None) -> str:
    callers = [step.node for step in steps if any(one.node == node for one in step.functions)]
    if callers:
        return f"{node_named(node, name)} has no program: its function stands in that of '{callers[0]}'"
    return f"{node_named(node, name)} has no program here" + (f": {idle}" if idle else "")


def _origins(text: Any) -> list[dict[str, Any]]:
    """The file and line of each line; None for one that rendergraph writes, with what it is there for."""
    return [
        {"file": str(one.file) if one.file is not None else None, "line": one.line, "made": one.made}
        for one in text.source.origins
    ]


def as_text(found: dict[str, Any]) -> str:
    """The same to read; every line but the program's own is a comment."""
    lines = [f"step {found['step']} of {node_named(found['node'], found['type'])} in pipeline '{found['pipeline']}'"]
    if len(found["steps"]) > 1:
        lines.append("steps with a program; --step N shows another:")
        lines += [
            f"  {one['step']}  {one['kind']}  {', '.join(one['shaders'].values())}  {one['label']}".rstrip()
            for one in found["steps"]
        ]
    if found["variants"] == 0:
        lines.append("it draws nothing of this scene")
    elif found["variants"] > 1:
        lines.append(
            f"the first of {amount(found['variants'], 'variant')}, which differ in {', '.join(found['differ'])}"
        )
    for section, members in groupby(found["scope"], key=lambda one: one["section"]):
        rows = [(one["name"], one["source"]) for one in members]
        width = max((len(name) for name, _ in rows if len(name) < _WIDE), default=0)
        lines += ["", _TITLES[section]]
        for name, source in rows:
            if len(name) < _WIDE and width + len(source) < 2 * _WIDE:
                lines.append(f"  {name.ljust(width)}  {source}")
            else:
                lines += [f"  {name}", *textwrap.wrap(source, 100, initial_indent=" " * 6, subsequent_indent=" " * 6)]
    head = "\n".join(f"// {line}".rstrip() for line in lines)
    stages = [f"// {'=' * 20} {stage} shader\n\n{one['annotated']}" for stage, one in found["stages"].items()]
    return "\n\n".join([head, *stages]).rstrip()


_WIDE = 64
