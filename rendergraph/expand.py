"""Graph to Expansion: what each node records, with resources and versions in place of ports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rendergraph.steps import Resource, Step


@dataclass(frozen=True)
class Expansion:
    """All steps of a graph with the resources they touch.

    Attributes:
        steps: in the order of the graph's nodes and of recording.
        resources: by id.
        wanted: ids of the resources that must exist at the end of the frame (outputs and taps), with output names.
        idle: nodes that recorded nothing, with the reason.
    """

    steps: tuple[Step, ...]
    resources: Mapping[str, Resource]
    wanted: Mapping[str, str]
    idle: Mapping[str, str] = field(default_factory=dict)
