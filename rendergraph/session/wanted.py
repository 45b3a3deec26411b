"""The ports that a render asks for."""

from __future__ import annotations

from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.link import Endpoint, Graph, endpoint
from rendergraph.session.selection import RenderOptions


def wanted_ports(graph: Graph, options: RenderOptions) -> dict[str, Endpoint]:
    """The ports that must exist at the end of a frame, by output name or tap.

    Raises:
        InputError: an output or a port that the pipeline does not have.
    """
    wanted: dict[str, Endpoint] = {}
    problems = []
    for name in graph.outputs if options.outputs is None else options.outputs:
        if name in graph.outputs:
            wanted[name] = graph.outputs[name]
        else:
            hint = suggestion(name, graph.outputs)
            problems.append(Problem("RG205", f"pipeline '{graph.name}' has no output '{name}'{hint}"))
    for tap in options.taps:
        try:
            end = wanted[tap] = endpoint(graph, tap)
        except InputError as error:
            problems += [Problem("RG206", f"--tap {tap}: {problem.text}") for problem in error.problems]
            continue
        node = graph[end.node]
        problems += [
            Problem("RG116", f"--tap {tap}: it needs input '{name}' of '{end.node}', which is not connected")
            for name in getattr(node.node.ports()[end.port], "needs", ())
            if not node.inputs.get(name)
        ]
    if problems:
        raise InputError(problems)
    return wanted
