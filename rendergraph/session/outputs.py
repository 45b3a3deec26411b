"""The textures that a render requests."""

from __future__ import annotations

import re

from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.expand import OF_SCENE
from rendergraph.link import Graph, endpoint
from rendergraph.session.selection import TEXTURE_PART, RenderOptions
from rendergraph.session.values import OutputRequest, Planned


def requested_outputs(graph: Graph, options: RenderOptions) -> dict[str, OutputRequest]:
    """Return what must exist at the end of a frame, by the name of the output or tap."""
    requests: dict[str, OutputRequest] = {}
    problems = []
    for name in graph.outputs if options.outputs is None else options.outputs:
        if name in graph.outputs:
            requests[name] = OutputRequest(graph.outputs[name])
        else:
            hint = suggestion(name, graph.outputs)
            problems.append(Problem("RG205", f"pipeline '{graph.name}' has no output '{name}'{hint}"))
    for tap in options.taps:
        try:
            requests[tap] = _parse_tap(graph, tap)
        except InputError as error:
            problems += [p.relocate(None, code="RG206", context=f"--tap {tap}") for p in error.problems]
            continue
        end = requests[tap].end
        node = graph[end.node]
        problems += [
            Problem("RG116", f"--tap {tap}: it needs input '{name}' of '{end.node}', which is not connected")
            for name in getattr(node.node.ports()[end.port], "needs", ())
            if not node.inputs.get(name)
        ]
    if problems:
        raise InputError(problems)
    return requests


def figures(graph: Graph) -> tuple[str, ...]:
    """Return the outputs of the file that have a single texel: they are figures of a run."""
    infos = {name: graph.textures.get(end.now) for name, end in graph.outputs.items()}
    return tuple(
        name
        for name, info in infos.items()
        if info is not None and info.desc is not None and (*info.desc.size, info.desc.layers) == (1, 1, 1)
    )


def every_port(planned: Planned) -> tuple[str, ...]:
    """Return all ports whose textures the steps of a plan write, internals included, as taps, in order of execution."""
    graph, expansion = planned.linked.graph, planned.expansion
    held: dict[tuple[str, str], list[str]] = {}
    for end, resource in expansion.ports.items():
        if end not in OF_SCENE.values() and graph.textures[end].desc is not None:
            held.setdefault((end.node, resource), []).append(str(end))
    written = [
        tap
        for step in planned.plan.schedule.steps
        for write in step.writes
        for tap in held.get((step.node, write.resource), ())
    ]
    return tuple(reversed(dict.fromkeys(reversed(written))))


def _parse_tap(graph: Graph, tap: str) -> OutputRequest:
    """Parse a tap: `node.port`, `node.port[2]`, `node.port[2,mip=3]` or `node.port:stencil`."""
    found = re.fullmatch(r"([^\[:]*)" + TEXTURE_PART, tap)
    if found is None:
        text = "the part of a texture is [LAYER], [mip=N], [LAYER,mip=N] or :stencil after NODE.PORT"
        raise InputError(Problem("RG206", text))
    end = endpoint(graph, found[1])
    layer, mip = (None if found[name] is None else int(found[name]) for name in ("layer", "mip"))
    request = OutputRequest(end, layer, mip, stencil=found["stencil"] is not None)
    desc = graph.textures[end].desc
    if missing := request.lacks(desc):
        raise InputError(Problem("RG206", f"'{found[1]}' {missing}"))
    return request
