"""The first pass, in order of execution, whose output differs between two pipelines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from rendergraph.compare.results import Difference, Pixels, passes
from rendergraph.declare import InOut, Output
from rendergraph.diff import GraphDiff
from rendergraph.link import Endpoint, Graph
from rendergraph.session import RenderOptions, stages

if TYPE_CHECKING:
    from rendergraph.allocate import ResourcePlan
    from rendergraph.session import Frame
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.values import Planned


def every_output(gpu: Gpu, planned: Planned, frame: int) -> Frame:
    """Render a frame with every texture that a pass hands to others."""
    ports = taps(planned.linked.graph, planned.plan)
    options = RenderOptions(frames=range(1, frame + 1), outputs=(), taps=tuple(ports))
    return stages.draw_last(stages.expand(planned.linked, options), gpu)


def taps(graph: Graph, plan: ResourcePlan) -> list[str]:
    """Return the ports, in order of execution, whose texture another node or an output of the graph reads."""
    read = {Endpoint(end.node, end.port) for node in graph.nodes for ends in node.inputs.values() for end in ends}
    read |= set(graph.outputs.values())
    ports = []
    for node in passes(plan):
        for name, port in graph[node].node.outputs().items():
            info = graph.textures.get(Endpoint(node, name))
            desc = info.desc if info is not None else None
            if isinstance(port, Output | InOut) and desc is not None and desc.layers and desc.samples == 1:
                ports += [f"{node}.{name}"] if Endpoint(node, name) in read else []
    return ports


def first_difference(
    base: Frame, variant: Frame, plan: ResourcePlan, graph: Graph, difference: GraphDiff
) -> Difference | None:
    """Return the first pass of the variant that has a counterpart in the base and another output, bit by bit.

    A pass that only one of the two has is not a difference by itself: the passes that read it show whether it matters.
    The frames are from `every_output`; plan and graph are the variant's.
    """
    counterparts = {new: old for old, new in difference.nodes.items()}
    for node in passes(plan):
        if node not in counterparts:
            continue
        for port in graph[node].node.outputs():
            a, b = base.get(f"{counterparts[node]}.{port}"), variant.get(f"{node}.{port}")
            if a is None or b is None or _same(a, b):
                continue
            most, share = _amount(a, b)
            semantic = variant.info(f"{node}.{port}").semantic
            causes = _causes(graph, node, difference)
            added = tuple(cause for cause in causes if cause in difference.added)
            return Difference(node, counterparts[node], port, most, share, causes, added, (a, b), semantic)
    return None


def _same(a: Pixels, b: Pixels) -> bool:
    if a.shape != b.shape or a.dtype != b.dtype:
        return False
    return np.array_equal(a, b, equal_nan=bool(np.issubdtype(a.dtype, np.floating)))


def _amount(a: Pixels, b: Pixels) -> tuple[float | None, float]:
    if a.shape != b.shape:
        return None, 1.0
    differ = (a != b) & ~((a != a) & (b != b))  # NaN is the one value that differs from itself
    texels = differ.any(axis=-1)
    distance = np.abs(a.astype(np.float64) - b.astype(np.float64))[differ]
    if a.dtype == np.uint8:
        distance = distance / 255
    return (float(distance.max()) if distance.size else 0.0), float(texels.mean())


def _causes(graph: Graph, node: str, difference: GraphDiff) -> tuple[str, ...]:
    """Return the nodes that differ in structure among a pass and everything it reads."""
    import networkx as nx  # needed for a difference alone, and slow to import

    changed: Mapping[str, object] = difference.changed()
    leading = {node, *nx.ancestors(graph.dag, node)}
    return tuple(n.id for n in graph.nodes if n.id in leading and (n.id in changed or n.id in difference.added))
