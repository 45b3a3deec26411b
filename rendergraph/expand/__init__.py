"""Expand a Graph into the steps that nodes record, with resources and versions in place of ports.

Nodes are recorded in reverse topological order, so that a node already knows which of its outputs are read; versions
are then counted in topological order.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph.declare import WrittenPort
from rendergraph.errors import InputError, Problem
from rendergraph.expand.recording import OF_SCENE, SCENE_DATA, define_parameters, param_uniforms, record_all
from rendergraph.expand.versions import VersionAssignment, ViewTable
from rendergraph.link import Endpoint, Graph
from rendergraph.link.infer import CAMERA
from rendergraph.steps.model import Read, Resource, Role, Step, Write


class Expansion(Struct, frozen=True):
    """All steps of a graph with their resources.

    Attributes:
        outputs: output name or tap to the id of the resource that must exist at the end of the frame.
        ports: port to the id of the resource that holds its texture or buffer.
        overwritten: as in `Graph`.
    """

    steps: tuple[Step, ...]
    resources: Mapping[str, Resource]
    outputs: Mapping[str, str]
    idle: Mapping[str, str] = field(default_factory=dict)
    views: Mapping[str, ViewTable] = field(default_factory=dict)
    ports: Mapping[Endpoint, str] = field(default_factory=dict)
    overwritten: Mapping[tuple[str, str], Problem] = field(default_factory=dict)


def expand(graph: Graph, outputs: Mapping[str, Endpoint] | None = None) -> Expansion:
    """Record every node that `outputs` (name to port, the file's outputs by default) needs at the end of the frame."""
    outputs = graph.outputs if outputs is None else outputs
    recorded, idle = record_all(graph, graph.reading_order(), outputs)
    idle |= dict.fromkeys(graph.unlit, "the scene has no environment")
    found = VersionAssignment(graph, recorded, idle)
    found.run()
    shown = {name: _shown(found, name, found.follow(port)) for name, port in outputs.items()}
    _mark_roles(found, set(shown.values()))
    _check_kept(found.steps, found.resources)
    ports = {end: resource for end, (resource, _) in found.final.items()}
    return Expansion(tuple(found.steps), found.resources, shown, found.idle, found.views, ports, graph.overwritten)


def _shown(found: VersionAssignment, name: str, end: Endpoint) -> str:
    """Return the id of the resource that an output shows; a version that a later node overwrites is copied."""
    if end not in found.final or end.node in found.idle:
        reason = found.idle.get(end.node, "it makes no texture")
        text = f"output '{name}' shows '{end}', but that is never rendered: {reason}"
        raise InputError(Problem("RG204", text, found.graph[end.node].place, subject=str(end)))
    resource, version = found.final[end]
    if version == found.version[resource]:
        return resource
    copy = f"{end} kept"
    if copy not in found.resources:
        found.resources[copy] = replace(found.resources[resource], id=copy, role="output")
        index = 1 + max(step.index for step in found.steps if step.node == end.node)
        read, write = Read("source", resource, version, "image"), Write("copy", copy, 1, "image")
        label = f"copy of {end}, kept for {'tap' if '.' in name else 'output'} '{name}'"
        found.steps.append(Step(end.node, index, "copy", reads=(read,), writes=(write,), label=label))
    return copy


def _mark_roles(found: VersionAssignment, shown: set[str]) -> None:
    """Mark outputs, and resources that outlive the frame: they never share memory."""
    graph, resources = found.graph, found.resources
    previous = {read.resource for step in found.steps for read in step.all_reads if read.previous}
    for end in graph.textures:
        if str(end) in previous and str(end) not in resources:  # its node is idle, so it keeps its first value
            port, info = graph[end.node].node.ports()[end.port], graph.textures[end]
            assert isinstance(port, WrittenPort)
            first = port.first or 0.0
            resources[str(end)] = Resource(str(end), info.storage, "history", first, info.view, info.lights)
    for name in shown | previous:
        resource = resources[name]
        role: Role = "history" if name in previous else "output"
        role = resource.role if resource.role in ("history", "kept") else role
        resources[name] = replace(resource, role=role, first=found.firsts.get(name, resource.first))


def _check_kept(steps: Sequence[Step], resources: Mapping[str, Resource]) -> None:
    """Check that steps that write kept resources depend on nothing that changes from frame to frame (RG439).

    Other values that their shaders read are checked when the program text is assembled.
    """
    problems: list[Problem] = []
    for step in steps:
        made = [write.resource for write in step.writes if resources[write.resource].role == "kept"]
        problems += [step.problem("RG439", text) for text in (_dependencies(step, made, resources) if made else ())]
    if problems:
        raise InputError(list(dict.fromkeys(problems)))


def _dependencies(step: Step, made: Sequence[str], resources: Mapping[str, Resource]) -> Iterator[str]:
    kept = made[0]
    maker = kept.rpartition(".")[0]
    if maker != step.node:
        yield f"it continues '{kept}', which is kept from frame to frame; write to a texture that is not kept"
        return
    others = [write.resource for write in step.writes if write.resource not in made]
    if others:
        yield f"it makes '{kept}', which is kept, and '{others[0]}', which is not; make them in two steps"
    if step.kind == "geometry":
        yield f"it makes '{kept}', which is kept, from the scene's objects, which may move"
    if step.region is not None:
        yield f"it makes '{kept}', which is kept, in a region that `update` sets in each frame"
    for read in step.all_reads:
        if read.previous:
            yield f"it makes '{kept}', which is kept, from last frame's '{read.resource}', which changes every frame"
        elif read.resource not in resources or resources[read.resource].role not in ("kept", "scene"):
            yield f"it makes '{kept}', which is kept, from '{read.resource}', which is not; keep that too: `kept=True`"
