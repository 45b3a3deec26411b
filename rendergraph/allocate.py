"""Schedule to ResourcePlan: lifetimes, physical textures, aliases, bytes, lower bound."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from rendergraph.schedule import Schedule
from rendergraph.steps import Resource
from rendergraph.textures import BufferDesc, TextureDesc


@dataclass(frozen=True)
class Lifetime:
    """First and last position in the schedule at which a resource must hold its values, inclusive."""

    first: int
    last: int


@dataclass(frozen=True)
class Physical:
    """One texture or buffer that is really allocated.

    Attributes:
        index: its number.
        desc: what it is created from; members of another format of the same texel class look at it through a view.
        members: resources that live in it, in time order; a history resource has two physicals to itself.
        bytes: by formula.
    """

    index: int
    desc: TextureDesc | BufferDesc
    members: tuple[str, ...]
    bytes: int


@dataclass(frozen=True)
class Memory:
    """The figures of `run --json` and `plan --json`."""

    no_reuse_bytes: int
    allocated_bytes: int
    lower_bound_bytes: int
    peak_node: str | None
    proven: bool
    tier: Literal["descriptor", "view", "heap"]
    next_tier_bytes: int | None = None

    def as_json(self) -> dict[str, object]:
        """Plain JSON values."""
        return dict(vars(self))


@dataclass(frozen=True)
class ResourcePlan:
    """Where every resource lives.

    Attributes:
        schedule: what it was made from.
        lifetimes: resource id to lifetime.
        physicals: what is allocated.
        placement: resource id to the indices of its physicals (two for history, else one).
        released: step position to the resources that are dead after it (for the poison mode).
        memory: bytes.
        reasons: resource id to why it shares, or why not.
    """

    schedule: Schedule
    lifetimes: Mapping[str, Lifetime]
    physicals: tuple[Physical, ...]
    placement: Mapping[str, tuple[int, ...]]
    released: Mapping[int, tuple[str, ...]]
    memory: Memory
    reasons: Mapping[str, str]

    @property
    def resources(self) -> Mapping[str, Resource]:
        """The schedule's resources."""
        return self.schedule.resources
