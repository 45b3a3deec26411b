"""What a node records: steps with their reads, writes and fixed-function state.

A node's `record` fills a `Steps` without GL, so a pass can be inspected, tested and scheduled without a driver.
`Frame` is the interface of `update`, which runs on the CPU in each frame.
"""

from __future__ import annotations

from rendergraph.steps.checks import define_text
from rendergraph.steps.frame import Change, Frame, FrameScene, ViewMatrices
from rendergraph.steps.model import MOST_STEPS, FunctionBinding, Read, Resource, State, Step, UniformValue, Write
from rendergraph.steps.recorder import BUFFER_OPTIONS, StepRequest, Steps
