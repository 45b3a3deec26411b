"""Where two pipelines part: the first pass, in order of execution, whose output differs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from rendergraph.compare.values import Difference, Pixels
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
    """One frame with every texture that a pass of the plan hands to others."""
    ports = taps(planned.linked.graph, planned.plan)
    options = RenderOptions(frames=range(1, frame + 1), outputs=(), taps=tuple(ports))
    return stages.draw_last(stages.expand(planned.linked, options), gpu)


def taps(graph: Graph, plan: ResourcePlan) -> list[str]:
    """The ports, in order of execution, that hold a texture somebody else reads."""
    read = {Endpoint(end.node, end.port) for node in graph.nodes for ends in node.inputs.values() for end in ends}
    read |= set(graph.outputs.values())
    found = []
    for node in passes(plan):
        for name, port in graph[node].node.outputs().items():
            info = graph.textures.get(Endpoint(node, name))
            desc = info.desc if info is not None else None
            if isinstance(port, Output | InOut) and desc is not None and desc.layers and desc.samples == 1:
                found += [f"{node}.{name}"] if Endpoint(node, name) in read else []
    return found


def passes(plan: ResourcePlan) -> list[str]:
    """The nodes that are drawn, by their first step."""
    return list(dict.fromkeys(step.node for step in plan.schedule.steps))


def first_difference(
    base: Frame, variant: Frame, plan: ResourcePlan, graph: Graph, difference: GraphDiff
) -> Difference | None:
    """The first pass of the variant that has a counterpart in the base and draws something else.

    Texels are compared bit by bit. A pass that only one of the two has is no difference by itself: what reads it shows
    whether it matters.

    Args:
        base, variant: frames with every output, from `every_output`.
        plan, graph: the variant's.
        difference: which of its nodes is which of the base's.
    """
    back = {new: old for old, new in difference.nodes.items()}
    for node in passes(plan):
        if node not in back:
            continue
        for port in graph[node].node.outputs():
            a, b = base.get(f"{back[node]}.{port}"), variant.get(f"{node}.{port}")
            if a is None or b is None or same(a, b):
                continue
            most, share = _amount(a, b)
            semantic = variant.info(f"{node}.{port}").semantic
            causes = _causes(graph, node, difference)
            added = tuple(cause for cause in causes if cause in difference.added)
            return Difference(node, back[node], port, most, share, causes, added, (a, b), semantic)
    return None


def same(a: Pixels, b: Pixels) -> bool:
    """Whether two textures are equal bit by bit; NaN equals NaN."""
    if a.shape != b.shape or a.dtype != b.dtype:
        return False
    return np.array_equal(a, b, equal_nan=bool(np.issubdtype(a.dtype, np.floating)))


def _amount(a: Pixels, b: Pixels) -> tuple[float | None, float]:
    if a.shape != b.shape:
        return None, 1.0
    differ = (a != b) & ~((a != a) & (b != b))  # NaN is the one value that differs from itself
    texels = differ.any(axis=-1)
    away = np.abs(a.astype(np.float64) - b.astype(np.float64))[differ]
    if a.dtype == np.uint8:
        away = away / 255
    return (float(away.max()) if away.size else 0.0), float(texels.mean())


def _causes(graph: Graph, node: str, difference: GraphDiff) -> tuple[str, ...]:
    """Nodes that differ in structure among a pass and everything it reads."""
    import networkx as nx  # needed for a difference alone, and slow to import

    known: Mapping[str, object] = difference.changed()
    leading = {node, *nx.ancestors(graph.dag, node)}
    return tuple(n.id for n in graph.nodes if n.id in leading and (n.id in known or n.id in difference.added))
