"""What is known of a node's surroundings before the schedule."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from rendergraph.textures import Semantic, TextureDesc


@dataclass(frozen=True)
class LightFacts:
    """What is known of a light before the schedule: values that move are not.

    Attributes:
        name: unique in the scene.
        type: what kind of light it is.
        casts_shadow: whether a node that looks for a light to cast shadows may choose it.
    """

    name: str
    type: Literal["directional", "point", "spot"]
    casts_shadow: bool = True


@dataclass(frozen=True)
class TextureInfo:
    """What an output has turned out to be.

    Attributes:
        desc: what it is allocated from (None for a buffer, view or function).
        semantic: what it means, after `any` and `like` are followed.
        view: the id of the view table it was drawn with (`camera`, or `node.port`), None if not drawn.
        lights: the scene's light index of each layer or view, empty where those are not lights'.
        bytes: size of a buffer, 0 for textures.
        views: number of views of a table of views, 0 for everything else.
    """

    desc: TextureDesc | None
    semantic: Semantic
    view: str | None = None
    lights: tuple[int, ...] = ()
    bytes: int = 0
    views: int = 0

    @property
    def holds_values(self) -> bool:
        """Whether it is a texture or a buffer, which can be read back; a function or a view is neither."""
        return self.desc is not None or self.bytes > 0


@dataclass(frozen=True)
class Facts:
    """What is known of a node's surroundings before the schedule.

    Attributes:
        viewport: width and height of the picture.
        lights: the scene's lights in its order.
        inputs: what each connected input carries; a `many` input has one entry a link.
    """

    viewport: tuple[int, int]
    lights: tuple[LightFacts, ...] = ()
    inputs: Mapping[str, tuple[TextureInfo, ...]] = field(default_factory=dict)

    def connected(self, name: str) -> bool:
        """Whether anything is linked to the input."""
        return bool(self.inputs.get(name))

    def input(self, name: str) -> TextureInfo:
        """What the input carries.

        Raises:
            KeyError: nothing is linked to it.
        """
        return self.inputs[name][0]
