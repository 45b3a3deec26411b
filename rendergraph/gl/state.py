"""GL state: what steps set, as differences from the previous step, and what no step sets.

A table lists for each piece of the state that no step sets how it is queried, how it is set, and which value frames
need. `settle` sets these values; `SavedState` saves and restores all state that rendering changes, for borrowed
contexts.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, get_args

import moderngl
from msgspec import Struct

from rendergraph.errors import Problem, RenderError
from rendergraph.gl.raw import RawGL
from rendergraph.steps.model import Compare, State, Stencil

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
_FRONT, _BACK = 0x404, 0x405
_FACES = {"front": _FRONT, "back": _BACK}
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
        "cull": switch(_CULL_FACE, cull != "none", partial(raw.glCullFace, _FACES.get(cull, 0))),
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
    for face, s in ((_FRONT, stencil.front), (_BACK, stencil.back or stencil.front)):
        operations = [_STENCIL_OP[name] for name in (s.stencil_fail, s.depth_fail, s.depth_pass)]
        yield partial(raw.glStencilFuncSeparate, face, _COMPARE[s.func], s.reference, s.read_mask)
        yield partial(raw.glStencilOpSeparate, face, *operations)
        yield partial(raw.glStencilMaskSeparate, face, s.write_mask)


def changes(before: Pieces | None, after: Pieces) -> list[Call]:
    """Return the calls of `after` that differ from those of `before`, or all."""
    now = before or {}
    return [call for key, calls in after.items() if _describe(calls) != _describe(now.get(key, ())) for call in calls]


def _describe(calls: tuple[Call, ...]) -> list[tuple[int, tuple[object, ...]]]:
    return [(id(call.func), call.args) for call in calls if isinstance(call, partial)]


_DRAW_BUFFERS, _VIEWPORTS, _IMAGE_UNITS, _TEXTURE_UNITS = 0x8824, 0x825B, 0x8F38, 0x8B4D  # MAX_…
_ACTIVE_TEXTURE, _TEXTURE0, _SAMPLER_BINDING = 0x84E0, 0x84C0, 0x8919
_FEEDBACK, _FEEDBACK_PAUSED, _FEEDBACK_ACTIVE = 0x8E22, 0x8E23, 0x8E24
_SAMPLES_PASSED, _QUERY_NO_WAIT = 0x8914, 0x8E14

NEEDED: dict[int, bool] = {
    0x8DB9: True,  # FRAMEBUFFER_SRGB
    0x809D: True,  # MULTISAMPLE
    0x8642: True,  # PROGRAM_POINT_SIZE
    0x884F: True,  # TEXTURE_CUBE_MAP_SEAMLESS
    0x0BD0: False,  # DITHER
    0x0BF2: False,  # COLOR_LOGIC_OP
    0x0B20: False,  # LINE_SMOOTH
    0x0B41: False,  # POLYGON_SMOOTH
    0x2A01: False,  # POLYGON_OFFSET_POINT
    0x2A02: False,  # POLYGON_OFFSET_LINE
    0x8C89: False,  # RASTERIZER_DISCARD
    0x8F9D: False,  # PRIMITIVE_RESTART
    0x8D69: False,  # PRIMITIVE_RESTART_FIXED_INDEX
    0x809E: False,  # SAMPLE_ALPHA_TO_COVERAGE
    0x809F: False,  # SAMPLE_ALPHA_TO_ONE
    0x80A0: False,  # SAMPLE_COVERAGE
    0x8E51: False,  # SAMPLE_MASK
    0x8C36: False,  # SAMPLE_SHADING
    **{0x3000 + plane: False for plane in range(8)},  # CLIP_DISTANCE0…
}
"""Capabilities that no step sets, and whether frames need them enabled."""

_STATED = (_CULL_FACE, _DEPTH_TEST, _STENCIL_TEST, _OFFSET, _CLAMP)
"""Capabilities that each step sets."""

_INDEXED = ((_BLEND, _DRAW_BUFFERS), (0x0C11, _VIEWPORTS))
"""Capabilities of each draw buffer or viewport, set by steps and framebuffers: BLEND, SCISSOR_TEST."""


class StateCall(Struct, frozen=True):
    """A raw function that sets state, and how its arguments are queried.

    Attributes:
        queries: parameter and number of values, in the order of the arguments.
        first: the arguments before the values.
        kind: `i` for integers, `f` for floats.
        count: for indexed state, the parameter with the number of indices; the index is the argument after `first`.
        needed: the values while frames are drawn, None if steps set them or they do not matter.
    """

    call: str
    queries: tuple[tuple[int, int], ...]
    first: tuple[int, ...] = ()
    kind: str = "i"
    count: int = 0
    needed: tuple[float, ...] | None = None


def _each(*parameters: int) -> tuple[tuple[int, int], ...]:
    return tuple((parameter, 1) for parameter in parameters)


def _pixel_store(*parameters: int, needed: int = 0) -> list[StateCall]:
    return [StateCall("glPixelStorei", _each(p), (p,), needed=(needed,)) for p in parameters]


def _buffer(target: int, binding: int, needed: tuple[float, ...] | None = None) -> StateCall:
    return StateCall("glBindBuffer", _each(binding), (target,), needed=needed)


STATE_CALLS: tuple[StateCall, ...] = (
    # fixed function
    StateCall("glClipControl", _each(0x935C, 0x935D), needed=(0x8CA1, 0x935F)),  # LOWER_LEFT, ZERO_TO_ONE
    StateCall("glProvokingVertex", _each(0x8E4F), needed=(0x8E4E,)),  # LAST_VERTEX_CONVENTION
    StateCall("glPointParameteri", _each(0x8CA0), (0x8CA0,), needed=(0x8CA2,)),  # SPRITE_COORD_ORIGIN, UPPER_LEFT
    StateCall("glHint", _each(0x8B8B), (0x8B8B,), needed=(0x1100,)),  # FRAGMENT_SHADER_DERIVATIVE_HINT, DONT_CARE
    StateCall("glLineWidth", _each(0x0B21), kind="f", needed=(1.0,)),
    StateCall("glDepthRangeIndexed", ((0x0B70, 2),), kind="f", count=_VIEWPORTS, needed=(0.0, 1.0)),
    StateCall("glViewportIndexedf", ((0x0BA2, 4),), kind="f", count=_VIEWPORTS),
    StateCall("glScissorIndexed", ((0x0C10, 4),), count=_VIEWPORTS),
    StateCall("glDepthFunc", _each(0x0B74)),
    StateCall("glDepthMask", _each(0x0B72)),
    StateCall("glColorMaski", ((0x0C23, 4),), count=_DRAW_BUFFERS),
    StateCall("glBlendFuncSeparatei", _each(0x80C9, 0x80C8, 0x80CB, 0x80CA), count=_DRAW_BUFFERS),
    StateCall("glBlendEquationSeparatei", _each(0x8009, 0x883D), count=_DRAW_BUFFERS),
    StateCall("glCullFace", _each(0x0B45)),
    StateCall("glFrontFace", _each(0x0B46)),
    StateCall("glPolygonMode", _each(0x0B40), (0x0408,)),
    StateCall("glPolygonOffset", _each(0x8038, 0x2A00), kind="f"),
    StateCall("glStencilFuncSeparate", _each(0x0B92, 0x0B97, 0x0B93), (_FRONT,)),
    StateCall("glStencilFuncSeparate", _each(0x8800, 0x8CA3, 0x8CA4), (_BACK,)),
    StateCall("glStencilOpSeparate", _each(0x0B94, 0x0B95, 0x0B96), (_FRONT,)),
    StateCall("glStencilOpSeparate", _each(0x8801, 0x8802, 0x8803), (_BACK,)),
    StateCall("glStencilMaskSeparate", _each(0x0B98), (_FRONT,)),
    StateCall("glStencilMaskSeparate", _each(0x8CA5), (_BACK,)),
    # pixel transfer: swapped bytes, first bit, row length, skipped rows, texels and images, image height; alignment
    *_pixel_store(0x0CF0, 0x0CF1, 0x0CF2, 0x0CF3, 0x0CF4, 0x806D, 0x806E),
    *_pixel_store(0x0D00, 0x0D01, 0x0D02, 0x0D03, 0x0D04, 0x806B, 0x806C),
    *_pixel_store(0x0CF5, 0x0D05, needed=1),
    # bindings
    _buffer(0x8892, 0x8894),  # ARRAY
    _buffer(0x8F36, 0x8F36),  # COPY_READ
    _buffer(0x8F37, 0x8F37),  # COPY_WRITE
    _buffer(0x8F3F, 0x8F43),  # DRAW_INDIRECT
    _buffer(0x90EE, 0x90EF),  # DISPATCH_INDIRECT
    _buffer(0x8A11, 0x8A28),  # UNIFORM
    _buffer(0x90D2, 0x90D3),  # SHADER_STORAGE
    _buffer(0x88EB, 0x88ED, (0,)),  # PIXEL_PACK
    _buffer(0x88EC, 0x88EF, (0,)),  # PIXEL_UNPACK
    _buffer(0x9192, 0x9193, (0,)),  # QUERY
    StateCall("glBindRenderbuffer", _each(0x8CA7), (0x8D41,)),
    StateCall("glBindFramebuffer", _each(0x8CAA), (0x8CA8,)),  # READ
    StateCall("glBindFramebuffer", _each(0x8CA6), (0x8CA9,)),  # DRAW
    StateCall("glBindVertexArray", _each(0x85B5)),
    StateCall("glUseProgram", _each(0x8B8D)),
    StateCall("glBindTransformFeedback", _each(0x8E25), (_FEEDBACK,), needed=(0,)),
)

_BLOCKS = (
    (0x8A11, 0x8A2F, (0x8A28, 0x8A29, 0x8A2A)),  # UNIFORM_BUFFER
    (0x90D2, 0x90DD, (0x90D3, 0x90D4, 0x90D5)),  # SHADER_STORAGE_BUFFER
)
"""Target, number of binding points, and the parameters for buffer, start and size at each."""

_TEXTURES = {
    0x0DE0: 0x8068, 0x0DE1: 0x8069, 0x806F: 0x806A, 0x8C18: 0x8C1C, 0x8C1A: 0x8C1D, 0x84F5: 0x84F6, 0x8513: 0x8514,
    0x9009: 0x900A, 0x8C2A: 0x8C2C, 0x9100: 0x9104, 0x9102: 0x9105,
}  # fmt: skip
"""Texture target to the parameter that queries its binding."""

_READERS: dict[tuple[str, bool], tuple[str, Any]] = {
    ("i", False): ("glGetIntegerv", ctypes.c_int),
    ("f", False): ("glGetDoublev", ctypes.c_double),
    ("i", True): ("glGetIntegeri_v", ctypes.c_int),
    ("f", True): ("glGetDoublei_v", ctypes.c_double),
}


def settle(raw: RawGL) -> None:
    """Set the state that frames need and no step sets."""
    for capability, on in NEEDED.items():
        (raw.glEnable if on else raw.glDisable)(capability)
    for setting in STATE_CALLS:
        if setting.needed is None:
            continue
        call = getattr(raw, setting.call)
        for index in _indices(raw, setting):
            call(*setting.first, *index, *setting.needed)


class SavedState:
    """The state of a borrowed context as its owner left it.

    Not saved, because rendering does not change it: program pipelines, tessellation, all hints but one, clear values,
    atomic counters, debug output. An active query of the owner also counts what is drawn meanwhile.
    """

    def __init__(self, raw: RawGL, ctx: moderngl.Context) -> None:
        """Read everything and pause an active transform feedback."""
        self._raw, self._ctx = raw, ctx
        raw.error()  # discard errors of the owner
        _refuse_conditional(raw)
        self._feedback = bool(raw.integer(_FEEDBACK_ACTIVE)) and not raw.integer(_FEEDBACK_PAUSED)
        if self._feedback:
            raw.glPauseTransformFeedback()
        self._framebuffer = ctx.fbo, ctx.mglo.fbo  # moderngl rebinds what it considers bound
        self.enabled = [(capability, raw.glIsEnabled(capability)) for capability in (*NEEDED, *_STATED)]
        self.indexed = [
            (capability, index, raw.glIsEnabledi(capability, index))
            for capability, count in _INDEXED
            for index in range(raw.integer(count))
        ]
        self.units = raw.integer(_ACTIVE_TEXTURE), list(_units(raw, raw.integer(_TEXTURE_UNITS)))
        raw.glActiveTexture(self.units[0])  # the queries have changed it
        self.images = list(_images(raw))
        self.blocks = list(_blocks(raw))
        self.settings = [
            (getattr(raw, setting.call), (*setting.first, *index, *_values(raw, setting, index)))
            for setting in STATE_CALLS
            for index in _indices(raw, setting)
        ]

    def restore(self) -> None:
        raw = self._raw
        self._ctx.fbo, self._ctx.mglo.fbo = self._framebuffer
        for capability, on in self.enabled:
            (raw.glEnable if on else raw.glDisable)(capability)
        for capability, index, on in self.indexed:
            (raw.glEnablei if on else raw.glDisablei)(capability, index)
        active, units = self.units
        raw.glBindTextures(0, len(units), None)
        raw.glBindSamplers(0, len(units), (ctypes.c_uint * len(units))(*(sampler for _, sampler, _ in units)))
        for unit, _, bound in units:
            for target, texture in bound:
                raw.glActiveTexture(_TEXTURE0 + unit)
                raw.glBindTexture(target, texture)
        raw.glActiveTexture(active)
        for image in self.images:
            raw.glBindImageTexture(*image)
        for target, index, buffer, start, size in self.blocks:
            if size:
                raw.glBindBufferRange(target, index, buffer, start, size)
            else:
                raw.glBindBufferBase(target, index, buffer)
        for call, arguments in self.settings:  # after the blocks, which change the plain bindings too
            call(*arguments)
        if self._feedback:
            raw.glResumeTransformFeedback()


def _indices(raw: RawGL, setting: StateCall) -> list[tuple[int, ...]]:
    return [(index,) for index in range(raw.integer(setting.count))] if setting.count else [()]


def _values(raw: RawGL, setting: StateCall, index: tuple[int, ...]) -> Iterator[float]:
    name, ctype = _READERS[setting.kind, bool(index)]
    found = (ctype * 4)()
    for parameter, count in setting.queries:
        getattr(raw, name)(parameter, *index, ctypes.byref(found))
        yield from found[:count]


def _units(raw: RawGL, count: int) -> Iterator[tuple[int, int, list[tuple[int, int]]]]:
    """Yield each unit with its sampler and its textures by target."""
    value = ctypes.c_int()
    address = ctypes.byref(value)
    for unit in range(count):
        raw.glActiveTexture(_TEXTURE0 + unit)
        bound = []
        for target, parameter in _TEXTURES.items():
            raw.glGetIntegerv(parameter, address)
            if value.value:
                bound.append((target, value.value))
        yield unit, raw.integer(_SAMPLER_BINDING), bound


def _images(raw: RawGL) -> Iterator[tuple[int, ...]]:
    """Yield the arguments of `glBindImageTexture` for each image unit."""
    for unit in range(raw.integer(_IMAGE_UNITS)):
        bound = [raw.integer(parameter, unit) for parameter in (0x8F3A, 0x8F3B, 0x8F3C, 0x8F3D, 0x8F3E, 0x906E)]
        yield unit, *(bound if bound[0] else (0, 0, 0, 0, 0x88B8, 0x8229))  # READ_ONLY, R8: the initial state


def _blocks(raw: RawGL) -> Iterator[tuple[int, int, int, int, int]]:
    """Yield target, index, buffer, start and size of each binding point; size 0 is the whole buffer."""
    value = ctypes.c_int64()
    for target, count, parameters in _BLOCKS:
        for index in range(raw.integer(count)):
            found = [0, 0, 0]
            for number, parameter in enumerate(parameters):
                raw.glGetInteger64i_v(parameter, index, ctypes.byref(value))
                found[number] = value.value
                if not found[0]:
                    break
            yield target, index, found[0], found[1], found[2]


def _refuse_conditional(raw: RawGL) -> None:
    """Refuse active conditional rendering, for which OpenGL has no query: try to begin one inside it."""
    query = raw.make("glCreateQueries", _SAMPLES_PASSED)
    raw.glBeginConditionalRender(query, _QUERY_NO_WAIT)
    under_way = raw.error() is not None
    if not under_way:
        raw.glEndConditionalRender()
    raw.delete("glDeleteQueries", query)
    if under_way:
        text = "conditional rendering is active in the borrowed context; end it with glEndConditionalRender first"
        raise RenderError(Problem("RG618", text))
