"""The differences between two graphs: as a value, as text, as JSON and as a picture. Needs no GL."""

import sys

from rendergraph.diff.show import diff_json, diff_svg, diff_text
from rendergraph.diff.structure import (
    GraphDiff,
    LinkChange,
    OutputChange,
    ParameterChange,
    PlanFigures,
    Retyped,
    diff,
    figures,
)
from rendergraph.lazy import CallableModule

sys.modules[__name__].__class__ = CallableModule
