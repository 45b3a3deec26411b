"""What expanding yields: steps, resources and view tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rendergraph.declare import TextureInfo
from rendergraph.link.infer import CAMERA
from rendergraph.steps import Resource, Step


@dataclass(frozen=True)
class ViewTable:
    """A table of views: how many, and the scene's light index of each (empty where views are not lights')."""

    count: int = 1
    lights: tuple[int, ...] = ()


@dataclass(frozen=True)
class Expansion:
    """All steps of a graph with the resources they touch.

    Attributes:
        steps: in the order of the graph's nodes and of recording.
        resources: by id.
        wanted: output name or tap to the id of the resource that must exist at the end of the frame.
        idle: nodes that recorded nothing, with the reason.
        views: view tables by id.
    """

    steps: tuple[Step, ...]
    resources: Mapping[str, Resource]
    wanted: Mapping[str, str]
    idle: Mapping[str, str] = field(default_factory=dict)
    views: Mapping[str, ViewTable] = field(default_factory=dict)


def is_empty(info: TextureInfo | None) -> bool:
    """Whether a texture has no layers: no light casts, nothing is drawn, and readers do without."""
    return info is not None and info.desc is not None and info.desc.layers == 0


__all__ = ["CAMERA", "Expansion", "ViewTable", "is_empty"]
