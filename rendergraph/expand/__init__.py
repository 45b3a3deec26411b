"""Graph to Expansion: what each node records, with resources and versions in place of ports.

Nodes are recorded from the end of the graph to its beginning, so that a node already knows which of its outputs
anybody reads; then versions are counted from the beginning to the end.
"""

from __future__ import annotations

from collections.abc import Mapping

from rendergraph.expand.finalize import check_kept, finalize_resources
from rendergraph.expand.model import CAMERA as CAMERA
from rendergraph.expand.model import Expansion as Expansion
from rendergraph.expand.model import ViewTable as ViewTable
from rendergraph.expand.recording import define_parameters as define_parameters
from rendergraph.expand.recording import param_uniforms as param_uniforms
from rendergraph.expand.recording import record_all
from rendergraph.expand.versions import assign_versions
from rendergraph.link import Endpoint, Graph


def expand(graph: Graph, wanted: Mapping[str, Endpoint] | None = None) -> Expansion:
    """Record every node that `wanted` (name to port, the file's outputs by default) needs at the end of the frame."""
    outputs = dict(graph.outputs if wanted is None else wanted)
    order = graph.reading_order()
    recorded, idle = record_all(graph, order, outputs)
    idle |= dict.fromkeys(graph.unlit, "the scene has no environment")
    expansion = finalize_resources(graph, assign_versions(graph, recorded, idle), outputs)
    check_kept(expansion.steps, expansion.resources)
    return expansion
