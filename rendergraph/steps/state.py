"""Fixed-function state as values: blending, stencil, depth, culling."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Compare = Literal["never", "less", "equal", "lequal", "greater", "notequal", "gequal", "always"]
StencilOp = Literal["keep", "zero", "replace", "incr", "incr_wrap", "decr", "decr_wrap", "invert"]
BlendFactor = Literal[
    "zero", "one", "src_color", "one_minus_src_color", "dst_color", "one_minus_dst_color", "src_alpha",
    "one_minus_src_alpha", "dst_alpha", "one_minus_dst_alpha",
]  # fmt: skip


@dataclass(frozen=True)
class Blend:
    """Blending of one target: `source × src + destination × dst` with `op` between."""

    src: BlendFactor = "one"
    dst: BlendFactor = "zero"
    src_alpha: BlendFactor | None = None
    dst_alpha: BlendFactor | None = None
    op: Literal["add", "subtract", "reverse_subtract", "min", "max"] = "add"


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


@dataclass(frozen=True)
class Stencil:
    """Stencil state; `back` is the front's where None."""

    front: StencilFace = StencilFace()
    back: StencilFace | None = None


@dataclass(frozen=True)
class State:
    """The fixed function of a step.

    Attributes:
        depth_test: compare with the attached depth; None: yes where a depth texture is attached to a geometry or draw
            step.
        depth_func: the comparison.
        depth_write: write depth; None: yes where depth is written by the step.
        blend: one `Blend` for all targets, one a target, or None.
        color_mask: which of RGBA are written.
        cull: `material` culls back faces of single-sided materials; `back`, `front`, `none`.
        stencil: stencil state, None for off.
        scissor: x, y, width, height in texels from the bottom left.
        polygon_offset: factor and units.
        depth_clamp: clamp instead of clipping at the near and far plane.
        wireframe: draw lines instead of filled triangles.
    """

    depth_test: bool | None = None
    depth_func: Compare = "lequal"
    depth_write: bool | None = None
    blend: Blend | tuple[Blend | None, ...] | None = None
    color_mask: tuple[bool, bool, bool, bool] = (True, True, True, True)
    cull: Literal["material", "back", "front", "none"] = "material"
    stencil: Stencil | None = None
    scissor: tuple[int, int, int, int] | None = None
    polygon_offset: tuple[float, float] | None = None
    depth_clamp: bool = False
    wireframe: bool = False
