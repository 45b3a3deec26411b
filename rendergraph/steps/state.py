"""Fixed-function state as values: blending, stencil, depth, culling."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from msgspec import Struct

from rendergraph.typecheck import Range, validated

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
Cull = Literal["material", "back", "front", "none", "solid"]
Front = Literal["object", "counter_clockwise", "clockwise"]


_Byte: TypeAlias = Annotated[int, Range(0, 255)]
_Fraction: TypeAlias = Annotated[float, Range(0, 1)]
DepthBounds: TypeAlias = Annotated[tuple[_Fraction, _Fraction], "the least and the greatest depth, 0 to 1"]


class Blend(Struct, frozen=True):
    """Blending of one target: `source × src + destination × dst` with `op` in between."""

    src: BlendFactor = "one"
    dst: BlendFactor = "zero"
    src_alpha: BlendFactor | None = None
    dst_alpha: BlendFactor | None = None
    op: BlendOp = "add"

    def __post_init__(self) -> None:
        validated(self)

    @property
    def takes_destination(self) -> bool:
        """Whether the result depends on the target's contents."""
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


class StencilFace(Struct, frozen=True):
    """Stencil test and operations of one face."""

    func: Compare = "always"
    reference: _Byte = 0
    read_mask: _Byte = 0xFF
    write_mask: _Byte = 0xFF
    stencil_fail: StencilOp = "keep"
    depth_fail: StencilOp = "keep"
    depth_pass: StencilOp = "keep"

    def __post_init__(self) -> None:
        validated(self)


class Stencil(Struct, frozen=True):
    """Stencil state; a `back` of None equals the front."""

    front: StencilFace = StencilFace()
    back: StencilFace | None = None

    def __post_init__(self) -> None:
        validated(self)


class State(Struct, frozen=True):
    """The fixed-function state of a step.

    Attributes:
        depth_test: compare with the attached depth; None: if a depth texture is attached to a geometry or draw step.
            Without the test, every fragment's depth is written.
        depth_func: the comparison of window depth, which is reversed: `greater` is nearer.
        depth_write: write depth; None: if the step writes depth.
        blend: one `Blend` for all targets, one per target, or None.
        color_mask: which of RGBA to write.
        cull: `material` culls back faces of single-sided materials; `back`, `front`, `none`; `solid` culls back faces
            of closed meshes with opaque, single-sided materials, which front faces hide from outside.
        front: which triangles are front faces: those that are counter-clockwise on the screen; with `object`,
            clockwise ones for objects that their transform mirrors, because that reverses the winding. A geometry
            shader that chooses the winding itself must not use `object`.
        stencil: stencil state, None for off.
        scissor: x, y, width, height in texels from the bottom left.
        polygon_offset: factor and units of filled triangles' depth, positive for nearer; not for `wireframe` lines.
        depth_bounds: minimum and maximum value in the depth texture for which fragments pass. Not every driver
            supports it (see `rendergraph doctor`); if unsupported, such a step is an error.
        depth_clamp: clamp instead of clipping at the near and far plane.
        clip_distances: how many `gl_ClipDistance[…]` the vertex or geometry shader writes: fragments with any below 0
            are clipped.
        wireframe: draw lines instead of filled triangles.
    """

    depth_test: bool | None = None
    depth_func: Compare = "gequal"
    depth_write: bool | None = None
    blend: Annotated[Blend | tuple[Blend | None, ...] | None, "a Blend such as ADD, a tuple of them, or None"] = None
    color_mask: Annotated[tuple[bool, bool, bool, bool], "four of True and False"] = (True, True, True, True)
    cull: Cull = "material"
    front: Front = "object"
    stencil: Stencil | None = None
    scissor: Annotated[tuple[int, int, int, int], "x, y, width and height in texels"] | None = None
    polygon_offset: Annotated[tuple[float, float], "a factor and units"] | None = None
    depth_bounds: DepthBounds | None = None
    depth_clamp: bool = False
    clip_distances: Annotated[int, Range(0, 8)] = 0
    wireframe: bool = False

    def __post_init__(self) -> None:
        validated(self)
