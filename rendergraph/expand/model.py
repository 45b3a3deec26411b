"""The result of expanding: steps, resources and view tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from msgspec import Struct, field

from rendergraph.errors import Problem
from rendergraph.link import Endpoint
from rendergraph.link.infer import CAMERA as CAMERA
from rendergraph.steps import Resource, Step
from rendergraph.textures import EnvironmentMap, SceneData, Semantic, Signature

SCENE_DATA = Endpoint("", "the scene's data")
OF_SCENE: Mapping[Semantic | Signature, Endpoint] = {
    EnvironmentMap: Endpoint("", "the scene's environment"),
    SceneData: SCENE_DATA,
}
"""The sources of inputs that read the scene, if the file does not link them."""


class ViewTable(Struct, frozen=True):
    """A table of views: their count, and each view's light index in the scene (empty unless they are lights' views)."""

    count: int = 1
    lights: tuple[int, ...] = ()


class VersionedSteps(Struct, frozen=True):
    """Recorded steps with resources and versions in place of ports.

    Attributes:
        newest: resource id to its last version.
        final: port to its resource and the resource's version after its node.
        forwarded: port of an idle node to the port that it would continue.
        firsts: resource id to the first frame's value, if a node that continues it declares one.
    """

    steps: Sequence[Step]
    resources: Mapping[str, Resource]
    newest: Mapping[str, int]
    final: Mapping[Endpoint, tuple[str, int]]
    forwarded: Mapping[Endpoint, Endpoint]
    firsts: Mapping[str, float]
    idle: Mapping[str, str]
    views: Mapping[str, ViewTable]


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


def follow_forwards(forwarded: Mapping[Endpoint, Endpoint], end: Endpoint) -> Endpoint:
    """Return the port of this frame that a link leads to: idle nodes forward the input they would continue."""
    end = end.now
    while end in forwarded:
        end = forwarded[end]
    return end
