"""The runs of a sweep as a table, `results.csv`, for spreadsheets and data frames: settings, errors, times, bytes."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from rendergraph.compare.results import Result, Results, pareto, typed_settings
from rendergraph.compare.store import Failure


@dataclass(frozen=True)
class Column:
    """A column of the table; the type is called the same in JSON Schema and Table Schema."""

    name: str
    type: Literal["string", "number", "integer", "boolean"]
    doc: str
    value: Callable[[Result], Any]
    unit: str = ""

    def field(self, **more: Any) -> dict[str, Any]:
        doc = f"{self.doc.rstrip('.')}, in {self.unit}." if self.unit else self.doc
        return {"name": self.name, "type": self.type, "description": doc, **more}


def _spread(time: str, part: str) -> Callable[[Result], float | None]:
    return lambda result: getattr(getattr(result.times, time), part, None)


RUN = Column("run", "string", "Name of the run and of its folder.", lambda r: r.name)
COLUMNS = (
    Column("flip", "number", "FLIP against the reference, 0…1: 0 is equal.", lambda r: r.metrics.flip),
    Column("rmse", "number", "Root mean square error.", lambda r: r.metrics.rmse),
    Column("psnr", "number", "Peak signal to noise; empty where pictures are equal.", lambda r: r.metrics.psnr, "dB"),
    Column("ssim", "number", "Structural similarity: 1 is equal.", lambda r: r.metrics.ssim),
    Column("radiance_rmse", "number", "Error of scene-linear light, where both have it.", lambda r: r.radiance_rmse),
    Column("relative_mse", "number", "Relative mean square error of that light.", lambda r: r.relative_mse),
    Column("gpu_ms", "number", "Time on the GPU, the median of all frames.", _spread("gpu_ms", "median"), "ms"),
    Column("gpu_ms_p10", "number", "Its tenth percentile.", _spread("gpu_ms", "p10"), "ms"),
    Column("gpu_ms_p90", "number", "Its ninetieth percentile.", _spread("gpu_ms", "p90"), "ms"),
    Column("cpu_ms", "number", "Time in Python and the driver, the median.", _spread("cpu_ms", "median"), "ms"),
    Column("cpu_ms_p10", "number", "Its tenth percentile.", _spread("cpu_ms", "p10"), "ms"),
    Column("cpu_ms_p90", "number", "Its ninetieth percentile.", _spread("cpu_ms", "p90"), "ms"),
    Column("frames", "integer", "Measured frames.", lambda r: r.times.frames),
    Column("repeats", "integer", "Number of measurements.", lambda r: max(1, len(r.times.repeats))),
    Column("repeats_min_ms", "number", "Least median of several measurements.", _spread("repeated", "min"), "ms"),
    Column("repeats_max_ms", "number", "Greatest median of several measurements.", _spread("repeated", "max"), "ms"),
    Column("passes", "integer", "Number of passes.", lambda r: r.pass_count),
    Column("allocated_bytes", "integer", "Memory of textures.", lambda r: r.allocated_bytes if r.memory else None, "B"),
    Column("not_finite", "integer", "Pixels that are NaN or infinite.", lambda r: r.not_finite),
)
"""Between the settings and the last two columns; plugin metrics and figures follow behind those."""
PARETO = Column("pareto", "boolean", "No other run is both faster and nearer to the reference.", lambda r: None)
ERROR = Column("error", "string", "Why it could not be rendered; empty where it was.", lambda r: None)
_TAKEN = frozenset(column.name for column in (RUN, *COLUMNS, PARETO, ERROR))


def rows_of(results: Sequence[Result], failures: Sequence[Failure] = ()) -> list[dict[str, Any]]:
    """Return the table: a row for each run, by the names of its columns."""
    front = {result.name for result in pareto(results)}
    rows = []
    for result in results:
        row = {column.name: column.value(result) for column in COLUMNS}
        row |= {PARETO.name: result.name in front, ERROR.name: None, **_prefixed("figures", result.columns)}
        rows.append({RUN.name: result.name, **_prefixed("settings", typed_settings(result.settings)), **row})
    for failure in failures:
        settings = _prefixed("settings", typed_settings(failure.settings))
        rows.append({RUN.name: failure.name, **settings, PARETO.name: False, ERROR.name: failure.text})
    return rows


def csv_text(sweep: Results) -> str:
    """Return the table with a row for each run, under names; unknown values are empty, lists are JSON."""
    rows = rows_of(sweep.results, sweep.failures)
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _cell(value) for name, value in row.items()} for row in rows)
    return text.getvalue()


def csv_schema() -> dict[str, Any]:
    """Return the Table Schema (Frictionless Data, 2.0) of the columns that every `results.csv` has.

    The paths of the axes follow `run`; plugin metrics and figures follow `error`.
    """
    required = {"constraints": {"required": True}}
    return {
        "$schema": "https://datapackage.org/profiles/2.0/tableschema.json",
        "fieldsMatch": ["superset"],
        "missingValues": [""],
        "primaryKey": [RUN.name],
        "fields": [
            RUN.field(**required),
            *(column.field() for column in COLUMNS),
            PARETO.field(**required, trueValues=["True"], falseValues=["False"]),
            ERROR.field(),
        ],
    }


def _prefixed(kind: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by column; the name of a path or a figure that is a column's gets its kind in front."""
    return {f"{kind}.{name}" if name in _TAKEN else name: value for name, value in values.items()}


def _cell(value: Any) -> Any:
    if isinstance(value, float) and value != value:
        return ""
    return json.dumps(value) if isinstance(value, list | dict) else value
