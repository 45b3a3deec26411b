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

_MODULES = {
    "Axis": "axes",
    "Comparison": "values",
    "Result": "values",
    "Space": "axes",
    "compare": "pictures",
    "compare_pictures": "files",
    "Sweep": "product",
    "check_sweep": "prepare",
    "check_search": "optimise",
    "search": "optimise",
    "sweep": "product",
}


def __dir__() -> list[str]:
    return __all__


__getattr__ = lazy_exports(__name__, _MODULES)
