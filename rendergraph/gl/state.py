"""Fixed-function state as differences: a step's calls change only what differs from the previous step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import get_args

from rendergraph.gl.raw import RawGL
from rendergraph.steps import Compare, State, Stencil

_COMPARE = {name: 0x200 + number for number, name in enumerate(get_args(Compare))}
_STENCIL_OP = {
    "keep": 0x1E00, "zero": 0, "replace": 0x1E01, "incr": 0x1E02, "incr_wrap": 0x8507, "decr": 0x1E03,
    "decr_wrap": 0x8508, "invert": 0x150A,
}  # fmt: skip
_FACTOR = {
    "zero": 0, "one": 1, "src_color": 0x300, "one_minus_src_color": 0x301, "src_alpha": 0x302,
    "one_minus_src_alpha": 0x303, "dst_alpha": 0x304, "one_minus_dst_alpha": 0x305, "dst_color": 0x306,
    "one_minus_dst_color": 0x307,
}  # fmt: skip
_EQUATION = {"add": 0x8006, "min": 0x8007, "max": 0x8008, "subtract": 0x800A, "reverse_subtract": 0x800B}
_CULL = {"front": 0x404, "back": 0x405}
_BLEND, _CULL_FACE, _DEPTH_TEST, _STENCIL_TEST, _OFFSET, _CLAMP = 0x0BE2, 0x0B44, 0x0B71, 0x0B90, 0x8037, 0x864F

Call = Callable[[], object]
Pieces = dict[str, tuple[Call, ...]]


def pieces(
    raw: RawGL, state: State, *, depth_test: bool, cull: str, clockwise: bool = False, targets: int = 1
) -> Pieces:
    """Return the calls that set a state completely, by what they set; equal keys with equal `describe` need no call.

    Colour mask, depth mask, viewport and scissor belong to the framebuffer object (moderngl sets them with it).

    Args:
        depth_test: resolved from `state.depth_test` and the attachments.
        cull: resolved: `back`, `front` or `none`.
        clockwise: front faces are clockwise (mirrored instances).
    """

    def switch(capability: int, on: bool, *more: Call) -> tuple[Call, ...]:
        return (partial(raw.glEnable, capability), *more) if on else (partial(raw.glDisable, capability),)

    return {
        "depth": switch(_DEPTH_TEST, depth_test, partial(raw.glDepthFunc, _COMPARE[state.depth_func])),
        "cull": switch(_CULL_FACE, cull != "none", partial(raw.glCullFace, _CULL.get(cull, 0))),
        "front": (partial(raw.glFrontFace, 0x900 if clockwise else 0x901),),
        "blend": tuple(_blend(raw, state, targets)),
        "stencil": switch(_STENCIL_TEST, state.stencil is not None, *_stencil(raw, state.stencil)),
        "offset": switch(
            _OFFSET, state.polygon_offset is not None, partial(raw.glPolygonOffset, *(state.polygon_offset or ()))
        ),
        "clamp": switch(_CLAMP, state.depth_clamp),
        "fill": (partial(raw.glPolygonMode, 0x408, 0x1B01 if state.wireframe else 0x1B02),),
    }


def _blend(raw: RawGL, state: State, targets: int) -> Iterator[Call]:
    blends = state.blend if isinstance(state.blend, tuple) else (state.blend,) * max(1, targets)
    for index, blend in enumerate(blends):
        if blend is None:
            yield partial(raw.glDisablei, _BLEND, index)
            continue
        factors = blend.src, blend.dst, blend.src_alpha or blend.src, blend.dst_alpha or blend.dst
        yield partial(raw.glEnablei, _BLEND, index)
        yield partial(raw.glBlendFuncSeparatei, index, *(_FACTOR[name] for name in factors))
        yield partial(raw.glBlendEquationi, index, _EQUATION[blend.op])


def _stencil(raw: RawGL, stencil: Stencil | None) -> Iterator[Call]:
    if stencil is None:
        return
    for face, s in ((_CULL["front"], stencil.front), (_CULL["back"], stencil.back or stencil.front)):
        operations = [_STENCIL_OP[name] for name in (s.stencil_fail, s.depth_fail, s.depth_pass)]
        yield partial(raw.glStencilFuncSeparate, face, _COMPARE[s.func], s.reference, s.read_mask)
        yield partial(raw.glStencilOpSeparate, face, *operations)
        yield partial(raw.glStencilMaskSeparate, face, s.write_mask)


def changes(before: Pieces | None, after: Pieces) -> list[Call]:
    """Return the calls of `after` that differ from those of `before`."""
    if before is None:
        return [call for calls in after.values() for call in calls]
    return [
        call for key, calls in after.items() if _describe(calls) != _describe(before.get(key, ())) for call in calls
    ]


def _describe(calls: tuple[Call, ...]) -> list[tuple[int, tuple[object, ...]]]:
    return [(id(call.func), call.args) for call in calls if isinstance(call, partial)]
