"""What must exist at the end of the frame, and which textures therefore live through it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from rendergraph.declare import Made
from rendergraph.errors import InputError, Mistake, Problem
from rendergraph.link import Endpoint
from rendergraph.steps import Read, Resource, Role, Step, Write

if TYPE_CHECKING:
    from rendergraph.expand.numbering import Numbering


def wanted_resources(numbering: Numbering) -> dict[str, str]:
    """Output or tap to the resource that shows it.

    Raises:
        InputError: nothing draws it (RG204).
    """
    wanted: dict[str, str] = {}
    for name, port in numbering.wanted.items():
        end = numbering.behind(port)
        if end not in numbering.at_end or end.node in numbering.idle:
            reason = numbering.idle.get(end.node, "it makes no texture")
            text = f"output '{name}' shows '{end}', but that is never drawn: {reason}"
            raise InputError(Problem("RG204", text, numbering.graph[end.node].place, mistake=Mistake(str(end), text)))
        resource, version = numbering.at_end[end]
        last = version == numbering.version[resource]
        wanted[name] = resource if last else _keep(numbering, name, end, resource, version)
    return wanted


def _keep(numbering: Numbering, name: str, end: Endpoint, resource: str, version: int) -> str:
    """A copy of a version that somebody continues: what a tap in the middle of a chain shows."""
    kept = f"{end} kept"
    if kept not in numbering.resources:
        index = 1 + max(step.index for step in numbering.steps if step.node == end.node)
        numbering.resources[kept] = replace(numbering.resources[resource], id=kept, role="output")
        read, write = Read("source", resource, version, "image"), Write("copy", kept, 1, "image")
        label = f"copy of {end}, kept for {'tap' if '.' in name else 'output'} '{name}'"
        numbering.steps.append(Step(end.node, index, "copy", reads=(read,), writes=(write,), label=label))
    return kept


def mark_roles(numbering: Numbering, wanted: dict[str, str]) -> None:
    """Outputs and what outlives the frame are never shared."""
    resources, graph = numbering.resources, numbering.graph
    previous = {read.resource for step in numbering.steps for read in step.all_reads if read.previous}
    for end in graph.textures:
        if str(end) in previous and str(end) not in resources:  # its node is idle: it stays as it first was
            port, info = graph[end.node].node.ports()[end.port], graph.textures[end]
            assert isinstance(port, Made)
            assert info.desc is not None
            first = port.first or 0.0
            resources[str(end)] = Resource(str(end), info.desc, "history", first, info.view, info.lights)
    for name in set(wanted.values()) | previous:
        resource = resources[name]
        role: Role = "history" if name in previous else "output"
        role = resource.role if resource.role in ("history", "kept") else role
        resources[name] = replace(resource, role=role, first=numbering.firsts.get(name, resource.first))
