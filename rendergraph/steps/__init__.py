"""What a node records: steps with what they read and write, and the fixed-function state they need.

A node's `record` fills a `Steps` without GL, so what a pass does can be read, tested and scheduled with no driver.
`Frame` is the other side: what `update` may do each frame on the CPU.
"""

from __future__ import annotations

from rendergraph.steps.checks import define_text as define_text
from rendergraph.steps.frame import Change as Change
from rendergraph.steps.frame import Frame as Frame
from rendergraph.steps.frame import FrameScene as FrameScene
from rendergraph.steps.frame import ViewMatrices as ViewMatrices
from rendergraph.steps.model import MOST_STEPS as MOST_STEPS
from rendergraph.steps.model import FunctionBinding as FunctionBinding
from rendergraph.steps.model import Read as Read
from rendergraph.steps.model import Resource as Resource
from rendergraph.steps.model import Role as Role
from rendergraph.steps.model import Step as Step
from rendergraph.steps.model import UniformValue as UniformValue
from rendergraph.steps.model import Upload as Upload
from rendergraph.steps.model import Use as Use
from rendergraph.steps.model import Where as Where
from rendergraph.steps.model import Write as Write
from rendergraph.steps.recorder import BUFFER_OPTIONS as BUFFER_OPTIONS
from rendergraph.steps.recorder import Recorder as Recorder
from rendergraph.steps.recorder import StepRequest as StepRequest
from rendergraph.steps.recorder import Steps as Steps
from rendergraph.steps.recorder import Target as Target
from rendergraph.steps.state import ADD as ADD
from rendergraph.steps.state import ALPHA as ALPHA
from rendergraph.steps.state import MULTIPLY as MULTIPLY
from rendergraph.steps.state import PREMULTIPLIED as PREMULTIPLIED
from rendergraph.steps.state import Blend as Blend
from rendergraph.steps.state import BlendFactor as BlendFactor
from rendergraph.steps.state import Compare as Compare
from rendergraph.steps.state import State as State
from rendergraph.steps.state import Stencil as Stencil
from rendergraph.steps.state import StencilFace as StencilFace
from rendergraph.steps.state import StencilOp as StencilOp
