"""What expanding yields: steps, resources and view tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from msgspec import Struct, field

from rendergraph.link import Endpoint
from rendergraph.link.infer import CAMERA
from rendergraph.steps import Resource, Step

ENVIRONMENT = Endpoint("", "the scene's environment")
"""What an input of an environment is linked to that the file links to nothing."""


class ViewTable(Struct, frozen=True):
    """A table of views: how many, and the scene's light index of each (empty where views are not lights')."""

    count: int = 1
    lights: tuple[int, ...] = ()


class Versioned(Struct, frozen=True):
    """What was recorded, with resources and versions in place of ports.

    Attributes:
        steps: in the order of nodes and of recording.
        resources: by id.
        newest: resource id to its last version.
        at_end: port to its resource and the version it has when its node is done.
        passed: port of an idle node to what it would continue.
        firsts: resource id to what whoever continues it says of the first frame.
        idle: nodes that recorded nothing, with the reason.
        views: view tables by id.
    """

    steps: Sequence[Step]
    resources: Mapping[str, Resource]
    newest: Mapping[str, int]
    at_end: Mapping[Endpoint, tuple[str, int]]
    passed: Mapping[Endpoint, Endpoint]
    firsts: Mapping[str, float]
    idle: Mapping[str, str]
    views: Mapping[str, ViewTable]


class Expansion(Struct, frozen=True):
    """All steps of a graph with the resources they touch.

    Attributes:
        steps: in the order of the graph's nodes and of recording.
        resources: by id.
        wanted: output name or tap to the id of the resource that must exist at the end of the frame.
        idle: nodes that recorded nothing, with the reason.
        views: view tables by id.
        ports: port to the id of the resource that holds its texture or buffer.
    """

    steps: tuple[Step, ...]
    resources: Mapping[str, Resource]
    wanted: Mapping[str, str]
    idle: Mapping[str, str] = field(default_factory=dict)
    views: Mapping[str, ViewTable] = field(default_factory=dict)
    ports: Mapping[Endpoint, str] = field(default_factory=dict)


def behind(passed: Mapping[Endpoint, Endpoint], end: Endpoint) -> Endpoint:
    """The port of this frame that a link leads to, where idle nodes pass on what they would continue."""
    end = end.now
    while end in passed:
        end = passed[end]
    return end


__all__ = ["CAMERA", "ENVIRONMENT", "Expansion", "Versioned", "ViewTable", "behind"]
