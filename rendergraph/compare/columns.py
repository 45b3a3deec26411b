"""What the results of a sweep hold: the fields of a line of `results.jsonl`, and the columns of `results.csv`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from rendergraph.compare.axes import typed
from rendergraph.compare.runs import Failure
from rendergraph.compare.values import Result

Type: TypeAlias = Literal["string", "number", "integer", "boolean"]
JsonSchema: TypeAlias = "dict[str, Any]"


@dataclass(frozen=True)
class Column:
    """One column of the table.

    Attributes:
        name: at its head.
        type: of its values, as JSON Schema and Table Schema both call them.
        doc: one line.
        value: of a run.
        unit: the unit's symbol, empty for a pure number.
    """

    name: str
    type: Type
    doc: str
    value: Callable[[Result], Any]
    unit: str = ""


def _gpu(part: str) -> Callable[[Result], float | None]:
    return lambda result: getattr(result.times.gpu_ms, part, None)


def _repeated(part: str) -> Callable[[Result], float | None]:
    return lambda result: getattr(result.times.repeated, part, None)


COLUMNS = (
    Column("flip", "number", "FLIP against the reference, 0…1: 0 is equal.", lambda r: r.metrics.flip),
    Column("rmse", "number", "Root mean square error.", lambda r: r.metrics.rmse),
    Column("psnr", "number", "Peak signal to noise; empty where pictures are equal.", lambda r: r.metrics.psnr, "dB"),
    Column("ssim", "number", "Structural similarity: 1 is equal.", lambda r: r.metrics.ssim),
    Column("radiance_rmse", "number", "Error of scene-linear light, where both have it.", lambda r: r.radiance_rmse),
    Column("gpu_ms", "number", "Time on the GPU, the median of all frames.", _gpu("median"), "ms"),
    Column("gpu_ms_p10", "number", "Its tenth percentile.", _gpu("p10"), "ms"),
    Column("gpu_ms_p90", "number", "Its ninetieth.", _gpu("p90"), "ms"),
    Column("cpu_ms", "number", "Time in Python and the driver, the median.", lambda r: r.times.cpu_ms.median, "ms"),
    Column("cpu_ms_p10", "number", "Its tenth percentile.", lambda r: r.times.cpu_ms.p10, "ms"),
    Column("cpu_ms_p90", "number", "Its ninetieth.", lambda r: r.times.cpu_ms.p90, "ms"),
    Column("frames", "integer", "Frames that were measured.", lambda r: r.times.frames),
    Column("repeats", "integer", "How often.", lambda r: max(1, len(r.times.repeats))),
    Column("repeats_min_ms", "number", "Of several measurements the least median.", _repeated("min"), "ms"),
    Column("repeats_max_ms", "number", "And the greatest.", _repeated("max"), "ms"),
    Column("passes", "integer", "Passes that are drawn.", lambda r: r.pass_count),
    Column("allocated_bytes", "integer", "Memory of textures.", lambda r: r.memory["allocated_bytes"], "B"),
    Column("not_finite", "integer", "Pixels that are NaN or infinite.", lambda r: r.not_finite),
)
"""Between the settings and the last two; figures of plugins and of outputs stand behind."""
RUN = Column("run", "string", "Its name, and its folder's.", lambda r: r.name)
PARETO = ("pareto", "boolean", "No other run is both quicker and nearer to the reference.")
ERROR = ("error", "string", "Why it could not be drawn; empty where it was.")


def row(result: Result, best: bool) -> dict[str, Any]:
    """A run that was drawn, by column; a path or a figure that is called as a column of ours has its kind in front."""
    found = {RUN.name: result.name, **_settings(result.settings)}
    found |= {column.name: column.value(result) for column in COLUMNS}
    found |= {PARETO[0]: best, ERROR[0]: None}
    return found | {_own("figures", name): value for name, value in result.columns.items()}


def failed_row(failure: Failure) -> dict[str, Any]:
    """One that could not."""
    return {RUN.name: failure.name, **_settings(failure.settings), PARETO[0]: False, ERROR[0]: failure.text}


def _settings(settings: Mapping[str, str]) -> dict[str, Any]:
    return {_own("settings", path): typed(value) for path, value in settings.items()}


def _own(kind: str, name: str) -> str:
    taken = {RUN.name, PARETO[0], ERROR[0], *(column.name for column in COLUMNS)}
    return f"{kind}.{name}" if name in taken else name


# --- schemas ---------------------------------------------------------------------------------------------------------


def csv_schema() -> JsonSchema:
    """The Table Schema (Frictionless Data, 2.0) of the columns that every `results.csv` has.

    The paths of the axes stand behind `run`, figures of plugins and of outputs behind `error`.
    """
    return {
        "$schema": "https://datapackage.org/profiles/2.0/tableschema.json",
        "fieldsMatch": ["superset"],
        "missingValues": [""],
        "primaryKey": [RUN.name],
        "fields": [
            _field(RUN.name, RUN.type, RUN.doc, required=True),
            *(_field(c.name, c.type, _with_unit(c.doc, c.unit)) for c in COLUMNS),
            _field(*PARETO, required=True) | {"trueValues": ["True"], "falseValues": ["False"]},
            _field(*ERROR),
        ],
    }


def _field(name: str, type_: str, doc: str, *, required: bool = False) -> JsonSchema:
    return {"name": name, "type": type_, "description": doc} | ({"constraints": {"required": True}} if required else {})


def _with_unit(doc: str, unit: str) -> str:
    return f"{doc.rstrip('.')}, in {unit}." if unit else doc


_NUMBER: JsonSchema = {"type": ["number", "null"]}
_TEXT: JsonSchema = {"type": "string"}
_DIGEST: JsonSchema = {"type": "string", "pattern": "^[0-9a-f]{64}$"}
_COUNT: JsonSchema = {"type": "integer", "minimum": 0}
_SPREAD: JsonSchema = {
    "type": ["object", "null"],
    "description": "Milliseconds over frames; null where there is no such time.",
    "properties": {name: {"type": "number"} for name in ("median", "min", "max", "p10", "p90")},
    "required": ["median", "min", "max", "p10", "p90"],
    "additionalProperties": False,
}


def line_schema() -> JsonSchema:
    """The JSON Schema (draft 07) of a line of `results.jsonl`: a run that was drawn and measured, or one that failed.

    Of several lines with one `key` the last holds.
    """
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "A line of results.jsonl",
        "type": "object",
        "oneOf": [
            _object(dict(_shared()) | dict(_measured()), optional=("figures", "plugin_metrics", "repeats")),
            _object(dict(_shared()) | {"error": _said(_TEXT, "Why it could not be drawn or compared.")}),
        ],
    }


def _shared() -> Iterator[tuple[str, JsonSchema]]:
    yield "key", _said(_DIGEST, "What decides the picture: equal keys, equal pictures.")
    yield "name", _said(_TEXT, RUN.doc)
    yield "pipeline", _said(_TEXT, "As it was typed.")
    yield "settings", _said({"type": "object"}, "Path to value: a number, a switch, a text, a list, or null.")
    yield "sha256", _said(_DIGEST, "Of the rest of the line, as JSON with sorted keys and no blanks.")


def _measured() -> Iterator[tuple[str, JsonSchema]]:
    docs = {column.name: _with_unit(column.doc, column.unit) for column in COLUMNS}
    for name in ("flip", "rmse", "psnr", "ssim", "radiance_rmse"):
        yield name, _said(_NUMBER, docs[name].replace("empty where", "null where"))
    yield "not_finite", _said(_COUNT, docs["not_finite"])
    yield "figures", {"type": "object", "description": "Outputs of one texel: a number, or one a channel."}
    yield "plugin_metrics", {"type": "object", "additionalProperties": _NUMBER, "description": "Metrics of plugins."}
    yield "frames", {"type": "integer", "minimum": 1, "description": docs["frames"]}
    for name in ("frame_ms", "gpu_ms", "cpu_ms"):
        yield name, _SPREAD
    repeats = {"type": "array", "items": {"type": "number"}, "description": "The median of each measurement, in ms."}
    yield "repeats", repeats
    a_pass = {"node": _TEXT, "type": _TEXT, "gpu_ms": _SPREAD, "cpu_ms": _SPREAD}
    yield "passes", {"type": "array", "items": _object(a_pass), "description": "Each pass, in order of execution."}
    yield "pass_count", _said(_COUNT, docs["passes"])
    memory = {"type": "object", "properties": {"allocated_bytes": _COUNT}, "required": ["allocated_bytes"]}
    yield "memory", memory | {"description": "As `plan` prints it."}
    yield "picture", {"type": ["string", "null"], "description": "From the folder; null where it was not kept."}
    yield "picture_sha256", {"type": ["string", "null"], "description": "Of its file."}
    size = {"type": "array", "items": {"type": "integer"}, "minItems": 2, "maxItems": 2}
    yield "size", size | {"description": "Width and height in pixels."}
    yield "device", {"type": "object", "description": "What drew; `software` where it is a rasteriser on the CPU."}
    yield "machine", {"type": "object", "description": "The computer, and versions."}


def _said(schema: JsonSchema, doc: str) -> JsonSchema:
    return {**schema, "description": doc}


def _object(properties: JsonSchema, optional: tuple[str, ...] = ()) -> JsonSchema:
    return {
        "type": "object",
        "properties": properties,
        "required": [name for name in properties if name not in optional],
        "additionalProperties": False,
    }
