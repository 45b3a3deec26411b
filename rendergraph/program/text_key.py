"""What decides a step's program texts, to share them between pipelines: variants have most of theirs in common."""

from __future__ import annotations

from collections.abc import Hashable, Mapping

from msgspec.structs import replace

from rendergraph.catalog import NodeType
from rendergraph.expand import ViewTable
from rendergraph.steps import Read, Resource, Step, Write
from rendergraph.textures import TextureDesc


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
