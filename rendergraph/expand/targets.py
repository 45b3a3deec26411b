"""What a step writes to: which parts, at which size, and what it must not read meanwhile."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain

from rendergraph.declare import Part
from rendergraph.steps import Read, Resource, State, StepRequest, Write
from rendergraph.textures import FORMATS, BufferDesc, TextureDesc


def parts_written(request: StepRequest, part: Part, desc: TextureDesc | BufferDesc) -> set[tuple[int, int | None]]:
    """Return the (mip, layer) pairs a request writes: a clear the whole texture, a mip chain all but mip 0."""
    mips = desc.mips if isinstance(desc, TextureDesc) else 1
    if request.kind == "mipmaps":
        return {(mip, None) for mip in range(1, mips)}
    if request.kind == "clear" and part.mip is None:
        return {(mip, part.layer) for mip in range(mips)}
    return {(part.mip or 0, part.layer)}


def overlap(one: tuple[int, int | None], other: tuple[int, int | None]) -> bool:
    return one[0] == other[0] and (one[1] == other[1] or None in (one[1], other[1]))


def feedback(request: StepRequest, write: Write, reads: Iterable[Read]) -> str | None:
    """A step must not sample what it writes: drivers return old texels, new ones, or a mixture."""
    state = request.options.get("state")
    if write.use == "depth" and state is not None and state.depth_write is False:
        return None
    for read in reads:
        if read.resource != write.resource or read.previous or read.use != "sample":
            continue
        if read.mip in (None, write.mip or 0) and overlap((0, read.layer), (0, write.layer)):
            return (
                f"it samples '{read.resource}' in the step that writes it; "
                "blend, sample another mip or layer, or go through an `Internal`"
            )
    return None


def target_size(
    resources: Mapping[str, Resource], writes: Sequence[Write], reads: Iterable[Read]
) -> tuple[tuple[int, int], int]:
    """Return ((width, height), samples) of a step's targets."""
    drawn_to = [write for write in writes if write.use in ("color", "depth")]
    attached: Iterable[Read | Write] = chain(drawn_to, (r for r in reads if r.use == "depth_test"), writes)
    for touched in attached:
        desc = resources[touched.resource].desc
        if isinstance(desc, TextureDesc):
            return desc.mip_size(touched.mip or 0), desc.samples
    return (1, 1), 1


def attachment_mismatch(
    resources: Mapping[str, Resource], writes: Sequence[Write], reads: Iterable[Read]
) -> str | None:
    """Explain why attachments of one draw do not fit together: size, samples, layers, or two depth targets."""
    attached: list[Read | Write] = [write for write in writes if write.use in ("color", "depth")]
    attached += [read for read in reads if read.use == "depth_test"]
    first: tuple[str, _Extent] | None = None
    depths = []
    for touched in attached:
        desc = resources[touched.resource].desc
        if not isinstance(desc, TextureDesc) or desc.layers == 0:
            continue
        depths += [touched.resource] if FORMATS[desc.format].is_depth else []
        layered = touched.layer is None and desc.kind != "texture2d"
        extent = (*desc.mip_size(touched.mip or 0), desc.samples, desc.mip_layers(touched.mip or 0) if layered else 0)
        name = touched.resource + ("" if touched.mip is None else f" mip {touched.mip}")
        if first is None:
            first = name, extent
        elif extent != first[1]:
            return (
                f"'{first[0]}' is {_difference(first[1], extent)}, but '{name}' is {_difference(extent, first[1])}; "
                + ("all targets of a step must have the same size, samples and layers")
            )
    depths = list(dict.fromkeys(depths))
    if len(depths) > 1:
        return f"'{depths[0]}' and '{depths[1]}' are both depth; a step can have only one depth target"
    return None


def undefined_destination(request: StepRequest, writes: Iterable[Write]) -> str | None:
    """Explain which target a draw blends onto, or tests against, while its contents are undefined."""
    state = request.options.get("state")
    if not isinstance(state, State) or request.kind not in ("fullscreen", "geometry", "draw"):
        return None
    tested = request.kind != "fullscreen" if state.depth_test is None else state.depth_test
    if state.blend is None and not tested:
        return None
    colors = [write for write in writes if write.use == "color"] if state.blend is not None else []
    blends = state.blend if isinstance(state.blend, tuple) else (state.blend,) * len(colors)
    for write, blend in zip(colors, blends, strict=False):
        if write.load == "discard" and blend is not None and blend.takes_destination:
            return f"it blends onto '{write.resource}', whose contents are undefined; declare it with `clear=`"
    for write in writes:
        if write.use == "depth" and write.load == "discard" and tested and state.depth_func != "always":
            return (
                f"it tests depth against '{write.resource}', whose contents are undefined; declare it with `clear=0.0`"
            )
    return None


def image_refusal(touched: Read | Write, resource: Resource | None) -> str | None:
    """Explain why a texture cannot be stored to or loaded from as an image."""
    desc = resource.desc if resource is not None else None
    if not isinstance(desc, TextureDesc):
        return None
    word = "write" if isinstance(touched, Write) else "load"
    fmt = FORMATS[desc.format]
    if not (fmt.is_depth or fmt.srgb or desc.samples > 1):
        return None
    what = f"{desc.samples} samples per texel" if desc.samples > 1 else f"the format {desc.format}"
    return f"it cannot {word} '{touched.resource}' as an image, as it has {what}"


_Extent = tuple[int, int, int, int]  # width, height, samples, layers


def _difference(own: _Extent, other: _Extent) -> str:
    words = []
    if own[:2] != other[:2]:
        words.append(f"{own[0]}×{own[1]}")
    if own[2] != other[2]:
        words.append(f"{own[2]} samples per texel" if own[2] > 1 else "not multisampled")
    if own[3] != other[3]:
        words.append(f"{own[3]} layers" if own[3] else "a plain 2D target")
    return ", ".join(words)
