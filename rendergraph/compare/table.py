"""The runs of a sweep as a table for spreadsheets: settings, errors, times, bytes."""

from __future__ import annotations

import csv
import io
from typing import Any

from rendergraph.compare.axes import typed
from rendergraph.compare.product import Sweep, pareto
from rendergraph.compare.values import Result


def csv_text(found: Sweep) -> str:
    """A row a run, under names; milliseconds and bytes. What is unknown is empty."""
    results = found.comparison.results
    front = {result.name for result in pareto(results)}
    rows = [_row(result, result.name in front) for result in results]
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _row(result: Result, best: bool) -> dict[str, Any]:
    m, times = result.metrics, result.times
    row: dict[str, Any] = {"run": result.name}
    row |= {path: typed(value) for path, value in result.settings.items()}
    row |= {"flip": m.flip, "rmse": m.rmse, "psnr": m.psnr, "ssim": m.ssim, **result.columns}
    row["radiance_rmse"] = result.radiance_rmse
    for name, spread in (("gpu_ms", times.gpu_ms), ("cpu_ms", times.cpu_ms)):
        if spread is not None:
            row |= {name: spread.median, f"{name}_p10": spread.p10, f"{name}_p90": spread.p90}
    row |= {"passes": result.pass_count, "allocated_bytes": result.memory["allocated_bytes"], "pareto": best}
    return row
