"""The runs of a sweep as a table for spreadsheets and data frames: settings, errors, times, bytes."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

from rendergraph.compare.columns import failed_row, row
from rendergraph.compare.front import pareto
from rendergraph.compare.product import Sweep


def csv_text(found: Sweep) -> str:
    """A row a run, under names; milliseconds and bytes. What is unknown is empty, lists are JSON; `schema` has more."""
    results = found.comparison.results
    front = {result.name for result in pareto(results)}
    rows = [row(result, result.name in front) for result in results]
    rows += [failed_row(failure) for failure in found.failures]
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _cell(value) for name, value in row.items()} for row in rows)
    return text.getvalue()


def _cell(value: Any) -> Any:
    if isinstance(value, float) and value != value:
        return ""  # NaN is what nobody knows
    return json.dumps(value) if isinstance(value, list | dict) else value
