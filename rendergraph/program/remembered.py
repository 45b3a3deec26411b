"""What has been found out about program texts, kept from one pipeline to the next: variants share most of theirs."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import Generic, TypeVar

from msgspec.structs import replace

from rendergraph import stamps
from rendergraph.catalog import NodeType
from rendergraph.expand import ViewTable
from rendergraph.stamps import Stamps
from rendergraph.steps import Read, Resource, Step, Write
from rendergraph.textures import TextureDesc

T = TypeVar("T")
_MOST = 2048


class Remembered(Generic[T]):
    """Answers by key, each as long as the files that it was made from stay as they were; the oldest go first."""

    def __init__(self, most: int = _MOST) -> None:
        self._most = most
        self._known: dict[Hashable, tuple[T, Stamps]] = {}

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """The answer; what raises is asked again next time."""
        found = self._known.get(key)
        if found is not None and not stamps.changed(found[1]):
            stamps.again(found[1])
            return found[0]
        with stamps.looking() as files:
            value = make()
        self._known.pop(key, None)
        while len(self._known) >= self._most:
            del self._known[next(iter(self._known))]
        self._known[key] = value, files
        return value


def text_key(
    step: Step, types: Mapping[str, NodeType], resources: Mapping[str, Resource], views: Mapping[str, ViewTable]
) -> Hashable:
    """All that `stage_texts` makes a step's texts of beside files: equal keys give equal texts, also of two graphs."""

    def seen(use: Read | Write) -> Hashable:
        resource = resources[use.resource]
        count = resource.view and views.get(resource.view, ViewTable()).count
        desc = resource.desc  # its size is asked by `textureSize` and `imageSize`, and stands in no text
        what = (desc.kind, desc.format, desc.layers, desc.samples) if isinstance(desc, TextureDesc) else desc
        return replace(use, resource="", version=0, mip=None), what, resource.lights, count

    def made_of(node: str) -> Hashable:
        type = types[node]
        return type.cls, type.file, type.shaders, type.inherited

    return (
        made_of(step.node),
        replace(
            step,
            node="",
            index=0,
            reads=(),
            writes=(),
            uniforms=(),
            functions=(),
            label="",
            if_drawn=None,
            size=(0, 0),
            groups=(0, 0, 0),
            invocations=None,
        ),
        tuple(
            (
                replace(each, reads=(), uniforms=tuple((name, 0) for name, _ in each.uniforms)),
                made_of(each.node),
                tuple(seen(use) for use in each.reads),
            )
            for each in step.functions
        ),
        tuple(seen(use) for use in step.reads),
        tuple(seen(use) for use in step.writes),
    )
