"""What a node records: steps with what they read and write, and the fixed-function state they need.

A node's `record` fills a `Steps` without GL, so what a pass does can be read, tested and scheduled with no driver.
`Frame` is the other side: what `update` may do each frame on the CPU.
"""

from __future__ import annotations

from rendergraph.steps.checks import define_text
from rendergraph.steps.frame import Frame, FrameScene, ViewMatrices
from rendergraph.steps.model import (
    MOST_STEPS,
    FunctionBinding,
    Read,
    Resource,
    Role,
    Step,
    UniformValue,
    Use,
    Where,
    Write,
)
from rendergraph.steps.recorder import Recorder, StepRequest, Steps, Target
from rendergraph.steps.state import (
    ADD,
    ALPHA,
    MULTIPLY,
    PREMULTIPLIED,
    Blend,
    BlendFactor,
    Compare,
    State,
    Stencil,
    StencilFace,
    StencilOp,
)

__all__ = [
    "ADD",
    "ALPHA",
    "MOST_STEPS",
    "MULTIPLY",
    "PREMULTIPLIED",
    "Blend",
    "BlendFactor",
    "Compare",
    "Frame",
    "FrameScene",
    "FunctionBinding",
    "Read",
    "Recorder",
    "Resource",
    "Role",
    "State",
    "Stencil",
    "StencilFace",
    "StencilOp",
    "Step",
    "StepRequest",
    "Steps",
    "Target",
    "UniformValue",
    "Use",
    "ViewMatrices",
    "Where",
    "Write",
    "define_text",
]
