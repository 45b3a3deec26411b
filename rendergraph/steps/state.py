"""Fixed-function state as values: blending, stencil, depth, culling."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

from rendergraph.errors import Misuse, suggestion

Compare = Literal["never", "less", "equal", "lequal", "greater", "notequal", "gequal", "always"]
StencilOp = Literal["keep", "zero", "replace", "incr", "incr_wrap", "decr", "decr_wrap", "invert"]
BlendFactor = Literal[
    "zero",
    "one",
    "src_color",
    "one_minus_src_color",
    "dst_color",
    "one_minus_dst_color",
    "src_alpha",
    "one_minus_src_alpha",
    "dst_alpha",
    "one_minus_dst_alpha",
]
BlendOp = Literal["add", "subtract", "reverse_subtract", "min", "max"]
Cull = Literal["material", "back", "front", "none"]


def _one_of(owner: str, name: str, value: object, choices: Any) -> None:
    """Refuse a word that no table further down knows, where the author's call is still on the stack."""
    known = get_args(choices)
    if not isinstance(value, str) or value not in known:
        hint = suggestion(value if isinstance(value, str) else "", known, most=len(known))
        raise Misuse(f"{owner}: {name} is {value!r}{hint}")


def _of_type(owner: str, name: str, value: object, types: type | tuple[type, ...], words: str) -> None:
    if not isinstance(value, types):
        raise Misuse(f"{owner}: {name} is {value!r}, not {words}")


def _numbers(owner: str, name: str, value: object, count: int, kind: type, words: str) -> None:
    numbers = value if isinstance(value, tuple) else ()
    alike = all(isinstance(n, kind | int) and (kind is bool or not isinstance(n, bool)) for n in numbers)
    if len(numbers) != count or not alike:
        raise Misuse(f"{owner}: {name} is {value!r}, not {words}")


@dataclass(frozen=True)
class Blend:
    """Blending of one target: `source × src + destination × dst` with `op` between."""

    src: BlendFactor = "one"
    dst: BlendFactor = "zero"
    src_alpha: BlendFactor | None = None
    dst_alpha: BlendFactor | None = None
    op: BlendOp = "add"

    def __post_init__(self) -> None:
        for name in ("src", "dst", "src_alpha", "dst_alpha"):
            value = getattr(self, name)
            if value is not None or name in ("src", "dst"):
                _one_of("Blend", name, value, BlendFactor)
        _one_of("Blend", "op", self.op, BlendOp)

    @property
    def takes_destination(self) -> bool:
        """Whether what is in the target shows in what comes out."""
        factors = [name or "" for name in (self.src, self.dst, self.src_alpha, self.dst_alpha)]
        dst_alpha = self.dst if self.dst_alpha is None else self.dst_alpha
        return (
            (self.dst, dst_alpha) != ("zero", "zero")
            or self.op in ("min", "max")
            or any("dst" in name for name in factors)
        )


ADD = Blend("one", "one")
ALPHA = Blend("src_alpha", "one_minus_src_alpha", "one", "one_minus_src_alpha")
PREMULTIPLIED = Blend("one", "one_minus_src_alpha")
MULTIPLY = Blend("dst_color", "zero")


@dataclass(frozen=True)
class StencilFace:
    """Stencil test and operations of one face."""

    func: Compare = "always"
    reference: int = 0
    read_mask: int = 0xFF
    write_mask: int = 0xFF
    stencil_fail: StencilOp = "keep"
    depth_fail: StencilOp = "keep"
    depth_pass: StencilOp = "keep"

    def __post_init__(self) -> None:
        _one_of("StencilFace", "func", self.func, Compare)
        for name in ("stencil_fail", "depth_fail", "depth_pass"):
            _one_of("StencilFace", name, getattr(self, name), StencilOp)
        for name in ("reference", "read_mask", "write_mask"):
            value = getattr(self, name)
            if not isinstance(value, int) or not 0 <= value <= 0xFF:
                raise Misuse(f"StencilFace: {name} is {value!r}, not a whole number from 0 to 255")


@dataclass(frozen=True)
class Stencil:
    """Stencil state; `back` is the front's where None."""

    front: StencilFace = StencilFace()
    back: StencilFace | None = None

    def __post_init__(self) -> None:
        _of_type("Stencil", "front", self.front, StencilFace, "a StencilFace")
        _of_type("Stencil", "back", self.back, (StencilFace, type(None)), "a StencilFace or None")


@dataclass(frozen=True)
class State:
    """The fixed function of a step.

    Attributes:
        depth_test: compare with the attached depth; None: yes where a depth texture is attached to a geometry or draw
            step. Without the test every fragment's depth is written.
        depth_func: the comparison.
        depth_write: write depth; None: yes where depth is written by the step.
        blend: one `Blend` for all targets, one a target, or None.
        color_mask: which of RGBA are written.
        cull: `material` culls back faces of single-sided materials; `back`, `front`, `none`.
        stencil: stencil state, None for off.
        scissor: x, y, width, height in texels from the bottom left.
        polygon_offset: factor and units of filled triangles' depth, negative for nearer; not of `wireframe`'s lines.
        depth_clamp: clamp instead of clipping at the near and far plane.
        wireframe: draw lines instead of filled triangles.
    """

    depth_test: bool | None = None
    depth_func: Compare = "lequal"
    depth_write: bool | None = None
    blend: Blend | tuple[Blend | None, ...] | None = None
    color_mask: tuple[bool, bool, bool, bool] = (True, True, True, True)
    cull: Cull = "material"
    stencil: Stencil | None = None
    scissor: tuple[int, int, int, int] | None = None
    polygon_offset: tuple[float, float] | None = None
    depth_clamp: bool = False
    wireframe: bool = False

    def __post_init__(self) -> None:
        _one_of("State", "depth_func", self.depth_func, Compare)
        _one_of("State", "cull", self.cull, Cull)
        for name in ("depth_test", "depth_write"):
            _of_type("State", name, getattr(self, name), (bool, type(None)), "True, False or None")
        for name in ("depth_clamp", "wireframe"):
            _of_type("State", name, getattr(self, name), bool, "True or False")
        blends = self.blend if isinstance(self.blend, tuple) else (self.blend,)
        for blend in blends:
            _of_type("State", "blend", blend, (Blend, type(None)), "a Blend, a tuple of them, or None")
        _of_type("State", "stencil", self.stencil, (Stencil, type(None)), "a Stencil or None")
        _numbers("State", "color_mask", self.color_mask, 4, bool, "four of True and False")
        if self.scissor is not None:
            _numbers("State", "scissor", self.scissor, 4, int, "x, y, width and height in texels")
        if self.polygon_offset is not None:
            _numbers("State", "polygon_offset", self.polygon_offset, 2, float, "a factor and units")
