"""Fixed-function state as differences: a step's calls change only what the step before left otherwise."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from rendergraph.gl.raw import RawGL
from rendergraph.steps import Blend, State, StencilFace

_COMPARE = {
    "never": 0x200,
    "less": 0x201,
    "equal": 0x202,
    "lequal": 0x203,
    "greater": 0x204,
    "notequal": 0x205,
    "gequal": 0x206,
    "always": 0x207,
}
_STENCIL_OP = {
    "keep": 0x1E00,
    "zero": 0,
    "replace": 0x1E01,
    "incr": 0x1E02,
    "incr_wrap": 0x8507,
    "decr": 0x1E03,
    "decr_wrap": 0x8508,
    "invert": 0x150A,
}
_FACTOR = {
    "zero": 0,
    "one": 1,
    "src_color": 0x300,
    "one_minus_src_color": 0x301,
    "src_alpha": 0x302,
    "one_minus_src_alpha": 0x303,
    "dst_alpha": 0x304,
    "one_minus_dst_alpha": 0x305,
    "dst_color": 0x306,
    "one_minus_dst_color": 0x307,
}
_EQUATION = {"add": 0x8006, "min": 0x8007, "max": 0x8008, "subtract": 0x800A, "reverse_subtract": 0x800B}
_CULL = {"front": 0x404, "back": 0x405}
_BLEND, _CULL_FACE, _DEPTH_TEST, _STENCIL_TEST, _OFFSET, _CLAMP = 0x0BE2, 0x0B44, 0x0B71, 0x0B90, 0x8037, 0x864F

Call = Callable[[], object]
Pieces = dict[str, tuple[Call, ...]]


def pieces(
    raw: RawGL, state: State, *, depth_test: bool, cull: str, clockwise: bool = False, targets: int = 1
) -> Pieces:
    """The calls that set a state completely, by what they set; equal keys with equal `describe` need no call.

    Colour mask, depth mask, viewport and scissor are the framebuffer object's (moderngl sets them with it).

    Args:
        raw: raw functions.
        state: what a step states.
        depth_test: resolved from `state.depth_test` and the attachments.
        cull: resolved: `back`, `front` or `none`.
        clockwise: front faces are clockwise (mirrored instances).
        targets: number of colour targets.
    """

    def on(capability: int) -> Call:
        return partial(raw.glEnable, capability)

    def off(capability: int) -> Call:
        return partial(raw.glDisable, capability)

    calls: Pieces = {}
    calls["depth"] = (
        (on(_DEPTH_TEST), partial(raw.glDepthFunc, _COMPARE[state.depth_func])) if depth_test else (off(_DEPTH_TEST),)
    )
    calls["cull"] = (on(_CULL_FACE), partial(raw.glCullFace, _CULL[cull])) if cull != "none" else (off(_CULL_FACE),)
    calls["front"] = (partial(raw.glFrontFace, 0x900 if clockwise else 0x901),)
    calls["blend"] = tuple(_blend(raw, state, targets))
    calls["stencil"] = tuple(_stencil(raw, state))
    calls["offset"] = (
        (on(_OFFSET), partial(raw.glPolygonOffset, *state.polygon_offset)) if state.polygon_offset else (off(_OFFSET),)
    )
    calls["clamp"] = (on(_CLAMP),) if state.depth_clamp else (off(_CLAMP),)
    calls["fill"] = (partial(raw.glPolygonMode, 0x408, 0x1B01 if state.wireframe else 0x1B02),)
    return calls


def _blend(raw: RawGL, state: State, targets: int) -> list[Call]:
    blends = state.blend if isinstance(state.blend, tuple) else (state.blend,) * max(1, targets)
    calls: list[Call] = []
    for index, blend in enumerate(blends):
        if blend is None:
            calls.append(partial(raw.glDisablei, _BLEND, index))
            continue
        calls += [
            partial(raw.glEnablei, _BLEND, index),
            partial(raw.glBlendFuncSeparatei, index, *_factors(blend)),
            partial(raw.glBlendEquationi, index, _EQUATION[blend.op]),
        ]
    return calls


def _factors(blend: Blend) -> tuple[int, int, int, int]:
    src, dst = _FACTOR[blend.src], _FACTOR[blend.dst]
    return src, dst, _FACTOR[blend.src_alpha or blend.src], _FACTOR[blend.dst_alpha or blend.dst]


def _stencil(raw: RawGL, state: State) -> list[Call]:
    if state.stencil is None:
        return [partial(raw.glDisable, _STENCIL_TEST)]
    calls: list[Call] = [partial(raw.glEnable, _STENCIL_TEST)]
    faces: tuple[tuple[int, StencilFace], ...] = (
        (_CULL["front"], state.stencil.front),
        (_CULL["back"], state.stencil.back or state.stencil.front),
    )
    for face, s in faces:
        calls += [
            partial(raw.glStencilFuncSeparate, face, _COMPARE[s.func], s.reference, s.read_mask),
            partial(
                raw.glStencilOpSeparate,
                face,
                _STENCIL_OP[s.stencil_fail],
                _STENCIL_OP[s.depth_fail],
                _STENCIL_OP[s.depth_pass],
            ),
            partial(raw.glStencilMaskSeparate, face, s.write_mask),
        ]
    return calls


def changes(before: Pieces | None, after: Pieces) -> list[Call]:
    """The calls of `after` that differ from what `before` left."""
    if before is None:
        return [call for calls in after.values() for call in calls]
    return [
        call for key, calls in after.items() if _describe(calls) != _describe(before.get(key, ())) for call in calls
    ]


def _describe(calls: tuple[Call, ...]) -> list[tuple[int, tuple[object, ...]]]:
    return [(id(call.func), call.args) for call in calls if isinstance(call, partial)]
