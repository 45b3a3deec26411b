"""The targets of a step: their parts and size, and what the step must not read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain

from rendergraph.declare import Part
from rendergraph.steps import Read, Resource, State, StepRequest, Write
from rendergraph.textures import FORMATS, BufferDesc, TextureDesc


def parts_written(request: StepRequest, part: Part, desc: TextureDesc | BufferDesc) -> set[tuple[int, int | None]]:
    """Return the (mip, layer) pairs that a request writes: all for a clear, all but mip 0 for a mip chain."""
    mips = desc.mips if isinstance(desc, TextureDesc) else 1
    if request.kind == "mipmaps":
        return {(mip, None) for mip in range(1, mips)}
    if request.kind == "clear" and part.mip is None:
        return {(mip, part.layer) for mip in range(mips)}
    return {(part.mip or 0, part.layer)}


def overlap(one: tuple[int, int | None], other: tuple[int, int | None]) -> bool:
    return one[0] == other[0] and (one[1] == other[1] or None in (one[1], other[1]))


def refusals(
    request: StepRequest, resources: Mapping[str, Resource], writes: Sequence[Write], reads: Sequence[Read]
) -> Iterator[tuple[str, str]]:
    """Yield code and text of each invalid target, and of each read that conflicts with a target."""
    for write in writes:
        yield from _feedback(request, write, reads)
    for read in reads:
        resource = resources.get(read.resource) if read.use == "sample" and read.layer is not None else None
        if resource is not None and getattr(resource.desc, "kind", "") == "texture3d":
            yield "RG420", f"it samples a slice of the 3D texture '{resource.id}'; sample all of it as a sampler3D"
    yield from _undefined_destinations(request, writes)
    touching: tuple[Read | Write, ...] = (*writes, *reads)
    uses = {touched.use for touched in touching}
    if len(writes) > 1 or "depth_test" in uses:
        yield from _mismatches(resources, writes, reads)
    for touched in touching if "image" in uses else ():
        if touched.use == "image" and touched.resource in resources:
            yield from _not_an_image(touched, resources[touched.resource].desc)


def _feedback(request: StepRequest, write: Write, reads: Iterable[Read]) -> Iterator[tuple[str, str]]:
    """Check that a step does not sample what it writes: drivers return old texels, new ones, or a mixture."""
    state = request.options.get("state")
    if write.use == "depth" and state is not None and state.depth_write is False:
        return
    for read in reads:
        if read.resource != write.resource or read.previous or read.use != "sample":
            continue
        if read.mip in (None, write.mip or 0) and overlap((0, read.layer), (0, write.layer)):
            text = f"it samples '{read.resource}' in the step that writes it; "
            if request.reads_all:
                text += f"a step that names no input reads all: leave it out by {read.name}=None; or "
            yield "RG422", f"{text}blend, sample another mip or layer, or go through an `Internal`"


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


def _mismatches(
    resources: Mapping[str, Resource], writes: Sequence[Write], reads: Iterable[Read]
) -> Iterator[tuple[str, str]]:
    """Check that the attachments of a draw agree in size, samples and layers, with at most one depth target."""
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
            text = f"'{first[0]}' is {_difference(first[1], extent)}, but '{name}' is {_difference(extent, first[1])}"
            yield "RG425", f"{text}; all targets of a step must have the same size, samples and layers"
    depths = list(dict.fromkeys(depths))
    if len(depths) > 1:
        text = f"'{depths[0]}' and '{depths[1]}' are both depth; a step can have only one depth target"
        yield "RG425", text


def _undefined_destinations(request: StepRequest, writes: Iterable[Write]) -> Iterator[tuple[str, str]]:
    """Check that a draw does not blend onto, or test against, targets with undefined contents."""
    state = request.options.get("state")
    if not isinstance(state, State) or request.kind not in ("fullscreen", "geometry", "draw"):
        return
    tested = request.kind != "fullscreen" if state.depth_test is None else state.depth_test
    colors = [write for write in writes if write.use == "color"] if state.blend is not None else []
    blends = state.blend if isinstance(state.blend, tuple) else (state.blend,) * len(colors)
    for write, blend in zip(colors, blends, strict=False):
        if write.load == "discard" and blend is not None and blend.takes_destination:
            yield "RG429", f"it blends onto '{write.resource}', whose contents are undefined; declare it with `clear=`"
    for write in writes:
        if write.use == "depth" and write.load == "discard" and tested and state.depth_func != "always":
            text = f"it tests depth against '{write.resource}', whose contents are undefined"
            yield "RG429", f"{text}; declare it with `clear=0.0`"


def _not_an_image(touched: Read | Write, desc: TextureDesc | BufferDesc) -> Iterator[tuple[str, str]]:
    if isinstance(desc, TextureDesc) and (
        FORMATS[desc.format].is_depth or FORMATS[desc.format].srgb or desc.samples > 1
    ):
        word = "write" if isinstance(touched, Write) else "load"
        what = f"{desc.samples} samples per texel" if desc.samples > 1 else f"the format {desc.format}"
        yield "RG426", f"it cannot {word} '{touched.resource}' as an image, as it has {what}"


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
