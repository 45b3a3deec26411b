"""What a node records: steps with what they read and write, and the fixed-function state they need.

A node's `record` fills a `Steps` without GL, so what a pass does can be read, tested and scheduled with no driver.
`Frame` is the other side: what `update` may do each frame on the CPU.
"""

from __future__ import annotations

from rendergraph.steps.checks import define_text
from rendergraph.steps.frame import Change, Frame, FrameScene, ViewMatrices
from rendergraph.steps.model import (
    MOST_STEPS,
    FunctionBinding,
    Read,
    Resource,
    Role,
    Step,
    UniformValue,
    Upload,
    Use,
    Where,
    Write,
)
from rendergraph.steps.recorder import BUFFER_OPTIONS, Recorder, StepRequest, Steps, Target
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
