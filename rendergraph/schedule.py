"""Steps to Schedule: what runs, in which order, and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rendergraph.steps import Resource, Step


@dataclass(frozen=True)
class Schedule:
    """Steps culled and ordered.

    Attributes:
        steps: the steps that run, in order.
        resources: the resources they touch, by id.
        wanted: as in `Expansion`.
        culled: node id to the reason why none of its steps runs.
        peak_bytes: the most bytes of live resources at any step, in this order.
        peak_node: the node whose step is the peak.
        lower_bound_bytes: the least peak over all legal orders that was found.
        proven: no legal order has a lower peak.
        reasons: step key to why it stands where it stands.
    """

    steps: tuple[Step, ...]
    resources: Mapping[str, Resource]
    wanted: Mapping[str, str]
    culled: Mapping[str, str]
    peak_bytes: int
    peak_node: str | None
    lower_bound_bytes: int
    proven: bool
    reasons: Mapping[tuple[str, int], str] = field(default_factory=dict)
