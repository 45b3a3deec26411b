"""What must exist at the end of the frame, and which textures therefore live through it."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec.structs import replace

from rendergraph.declare import WrittenPort
from rendergraph.errors import InputError, Problem
from rendergraph.expand.model import Expansion, Versioned, behind
from rendergraph.link import Endpoint, Graph
from rendergraph.steps import Read, Resource, Role, Step, Write


def ended(graph: Graph, found: Versioned, wanted: Mapping[str, Endpoint]) -> Expansion:
    """The steps with copies of what somebody continues, and resources in the roles that they have in the end.

    Args:
        graph: the graph.
        found: its steps and resources.
        wanted: name to port for everything that must exist at the end of the frame.

    Raises:
        InputError: nothing draws something that is wanted (RG204).
    """
    steps, resources = list(found.steps), dict(found.resources)
    shown: dict[str, str] = {}
    for name, port in wanted.items():
        end = behind(found.passed, port)
        if end not in found.at_end or end.node in found.idle:
            reason = found.idle.get(end.node, "it makes no texture")
            text = f"output '{name}' shows '{end}', but that is never drawn: {reason}"
            raise InputError(Problem("RG204", text, graph[end.node].place, subject=str(end)))
        resource, version = found.at_end[end]
        shown[name] = resource
        if version == found.newest[resource]:
            continue
        shown[name] = f"{end} kept"  # what a tap in the middle of a chain shows is copied
        if shown[name] not in resources:
            resources[shown[name]] = replace(resources[resource], id=shown[name], role="output")
            steps.append(_copy(name, end, resource, version, steps))
    _mark_roles(graph, found, shown, steps, resources)
    ports = {end: resource for end, (resource, _) in found.at_end.items()}
    return Expansion(tuple(steps), resources, shown, found.idle, found.views, ports)


def _copy(name: str, end: Endpoint, resource: str, version: int, steps: list[Step]) -> Step:
    """The step that copies one version of a resource before the next is written."""
    index = 1 + max(step.index for step in steps if step.node == end.node)
    read, write = Read("source", resource, version, "image"), Write("copy", f"{end} kept", 1, "image")
    label = f"copy of {end}, kept for {'tap' if '.' in name else 'output'} '{name}'"
    return Step(end.node, index, "copy", reads=(read,), writes=(write,), label=label)


def _mark_roles(
    graph: Graph, found: Versioned, shown: Mapping[str, str], steps: list[Step], resources: dict[str, Resource]
) -> None:
    """Outputs and what outlives the frame are never shared."""
    previous = {read.resource for step in steps for read in step.all_reads if read.previous}
    for end in graph.textures:
        if str(end) in previous and str(end) not in resources:  # its node is idle: it stays as it first was
            port, info = graph[end.node].node.ports()[end.port], graph.textures[end]
            assert isinstance(port, WrittenPort)
            assert info.desc is not None
            first = port.first or 0.0
            resources[str(end)] = Resource(str(end), info.desc, "history", first, info.view, info.lights)
    for name in set(shown.values()) | previous:
        resource = resources[name]
        role: Role = "history" if name in previous else "output"
        role = resource.role if resource.role in ("history", "kept") else role
        resources[name] = replace(resource, role=role, first=found.firsts.get(name, resource.first))
