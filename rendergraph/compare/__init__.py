"""Comparisons of pipelines: pictures, times and memory, of given variants or of all combinations of a sweep.

from rendergraph.compare import compare, sweep
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from rendergraph.lazy import CallableModule, lazy_exports

if TYPE_CHECKING:
    from rendergraph.compare.engine import Sweep, compare, compare_pictures, sweep
    from rendergraph.compare.optimiser import check_search, search
    from rendergraph.compare.prepare import SweepOptions
    from rendergraph.compare.results import Comparison, Result
    from rendergraph.compare.space import Axis, Space


sys.modules[__name__].__class__ = CallableModule
__getattr__, __dir__ = lazy_exports(
    __name__,
    {
        "engine": ("Sweep", "compare", "compare_pictures", "sweep"),
        "optimiser": ("check_search", "search"),
        "prepare": ("SweepOptions",),
        "results": ("Comparison", "Result"),
        "space": ("Axis", "Space"),
    },
)
