"""Comparisons of pipelines: pictures, times and memory, of given variants or of all combinations of a sweep.

from rendergraph.compare import compare, sweep
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rendergraph.lazy import lazy_exports

if TYPE_CHECKING:
    from rendergraph.compare.engine import Sweep as Sweep
    from rendergraph.compare.engine import compare as compare
    from rendergraph.compare.engine import compare_pictures as compare_pictures
    from rendergraph.compare.engine import sweep as sweep
    from rendergraph.compare.optimiser import check_search as check_search
    from rendergraph.compare.optimiser import search as search
    from rendergraph.compare.prepare import SweepOptions as SweepOptions
    from rendergraph.compare.results import Comparison as Comparison
    from rendergraph.compare.results import Result as Result
    from rendergraph.compare.space import Axis as Axis
    from rendergraph.compare.space import Space as Space


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
