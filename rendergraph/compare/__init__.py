"""Pipelines against each other: pictures, times, memory; one by one or as the product of axes.

from rendergraph.compare import compare, sweep
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rendergraph.lazy import lazy_exports

if TYPE_CHECKING:
    from rendergraph.compare.axes import Axis, Space
    from rendergraph.compare.files import compare_pictures
    from rendergraph.compare.optimise import check_search, search
    from rendergraph.compare.pictures import compare
    from rendergraph.compare.prepare import check_sweep
    from rendergraph.compare.product import Sweep, sweep
    from rendergraph.compare.values import Comparison, Result

__all__ = [
    "Axis",
    "Comparison",
    "Result",
    "Space",
    "Sweep",
    "check_search",
    "check_sweep",
    "compare",
    "compare_pictures",
    "search",
    "sweep",
]


def __dir__() -> list[str]:
    return __all__


__getattr__ = lazy_exports(
    __name__,
    {
        "axes": ("Axis", "Space"),
        "files": ("compare_pictures",),
        "optimise": ("check_search", "search"),
        "pictures": ("compare",),
        "prepare": ("check_sweep",),
        "product": ("Sweep", "sweep"),
        "values": ("Comparison", "Result"),
    },
)
