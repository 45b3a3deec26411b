"""The folder of a sweep: `study.json`, a folder with picture and `run.json` for each run, and `results.jsonl`.

A run's picture and `run.json` are written as soon as it is rendered, its line in the results once it is measured.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
from msgspec import Meta, Struct, structs, to_builtins

from rendergraph import metrics, system
from rendergraph.compare.results import Result, typed_settings
from rendergraph.compare.timing import NO_TIMES, PassTime, Spread, Times
from rendergraph.errors import InputError, Place, Problem, RenderError
from rendergraph.formatting import jsonable
from rendergraph.images.files import flush, write_file
from rendergraph.metrics import Encoding, Metrics

if TYPE_CHECKING:
    from rendergraph.compare.prepare import Run

RESULTS = "results.jsonl"
STUDY = "study.json"
RUN = "run.json"
CHECKSUM = "sha256"
_LOCK = ".lock"
_VALUES = "resolved"
"""The resolved file without the axes; messages describe the other entries of a study."""

_UNTIMED: Mapping[str, Any] = {"frames": 0, "frame_ms": None, "gpu_ms": None, "cpu_ms": None, "passes": []}

Digest = Annotated[str, Meta(pattern="^[0-9a-f]{64}$")]
Count = Annotated[int, Meta(ge=0)]
_Milliseconds = Annotated[
    Spread | None, Meta(description="Milliseconds over frames; null where there is no such time.")
]


class RunRecord(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A rendered run, as `run.json` and `results.jsonl` contain it; without frames it has not been measured."""

    key: Annotated[Digest, Meta(description="What decides the picture: equal keys, equal pictures.")]
    name: Annotated[str, Meta(description="Name of the run and of its folder.")]
    pipeline: Annotated[str, Meta(description="As it was typed.")]
    settings: Annotated[dict[str, Any], Meta(description="Path to value: a number, boolean, text, list, or null.")]
    flip: Annotated[float | None, Meta(description="FLIP against the reference, 0…1: 0 is equal.")]
    rmse: Annotated[float | None, Meta(description="Root mean square error.")]
    psnr: Annotated[float | None, Meta(description="Peak signal to noise, in dB; null where pictures are equal.")]
    ssim: Annotated[float | None, Meta(description="Structural similarity: 1 is equal.")]
    radiance_rmse: Annotated[float | None, Meta(description="Error of scene-linear light, where both have it.")]
    relative_mse: Annotated[float | None, Meta(description="Relative mean square error of that light.")] = None
    not_finite: Annotated[Count, Meta(description="Pixels that are NaN or infinite.")]
    figures: Annotated[dict[str, Any], Meta(description="Outputs of one texel: a number, or one a channel.")] = {}
    plugin_metrics: Annotated[dict[str, float | None], Meta(description="Metrics of plugins.")] = {}
    frames: Annotated[Count, Meta(description="Measured frames.")]
    frame_ms: _Milliseconds
    gpu_ms: _Milliseconds
    cpu_ms: _Milliseconds
    repeats: Annotated[tuple[float, ...], Meta(description="The median of each measurement, in ms.")] = ()
    passes: Annotated[tuple[PassTime, ...], Meta(description="Each pass, in order of execution.")]
    pass_count: Annotated[Count, Meta(description="Number of passes.")]
    memory: Annotated[
        dict[str, Any], Meta(description="As `plan` prints it.", extra_json_schema={"required": ["allocated_bytes"]})
    ]
    picture: Annotated[str | None, Meta(description="Path in the folder; null where it was not kept.")]
    picture_sha256: Annotated[str | None, Meta(description="Of the picture's file.")]
    size: Annotated[list[int], Meta(min_length=2, max_length=2, description="Width and height in pixels.")]
    device: Annotated[dict[str, Any], Meta(description="The GL device; `software` for a rasteriser on the CPU.")]
    machine: Annotated[dict[str, Any], Meta(description="The computer, and versions.")]

    @property
    def times(self) -> Times:
        if not self.frames or self.cpu_ms is None:
            return NO_TIMES
        return Times(self.frames, self.frame_ms, self.gpu_ms, self.cpu_ms, self.passes, self.repeats)

    def timed(self, times: Times, origin: Mapping[str, Any]) -> RunRecord:
        return structs.replace(self, **structs.asdict(times), **origin)

    def without_picture(self) -> RunRecord:
        return structs.replace(self, picture=None, picture_sha256=None)

    def as_json(self) -> dict[str, Any]:
        return {
            key: value for key, value in to_builtins(self).items() if value or key not in ("figures", "plugin_metrics")
        }


class _Line(RunRecord, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A measured run."""

    sha256: Annotated[Digest, Meta(description="Of the rest of the line, as JSON with sorted keys and no blanks.")]


class _FailedLine(Struct, frozen=True, forbid_unknown_fields=True):
    """A run that failed."""

    key: Digest
    name: str
    pipeline: str
    settings: dict[str, Any]
    error: Annotated[str, Meta(description="Why it could not be rendered or compared.")]
    sha256: Digest


def line_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 07) of a line of `results.jsonl`: a run that was measured, or one that failed.

    Of several lines with the same `key` the last one counts.
    """
    references, components = msgspec.json.schema_components((_Line, _FailedLine), ref_template="#/definitions/{name}")
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "$id": "urn:rendergraph:results:1",
        "title": "A line of results.jsonl",
        "oneOf": list(references),
        "definitions": components,
    }


@dataclass(frozen=True)
class Failure:
    name: str
    settings: Mapping[str, str]
    problems: tuple[Problem, ...]

    @property
    def text(self) -> str:
        return "\n".join(str(problem).splitlines()[0] for problem in self.problems)

    def as_json(self) -> dict[str, Any]:
        return {"name": self.name, "settings": typed_settings(self.settings), "error": self.text}


def read_results(out: Path) -> tuple[list[dict[str, Any]], int]:
    """Return the complete records of a folder in the order they were written, and the number of incomplete lines."""
    path = out / RESULTS
    try:
        lines = path.read_bytes().split(b"\n")
    except FileNotFoundError:
        return [], 0
    except OSError as error:
        raise write_error(path, "the results cannot be written", error) from error
    records = [_verified(line) for line in lines if line.strip()]
    return [record for record in records if record is not None], records.count(None)


def checksum(record: Mapping[str, Any]) -> str:
    rest = {key: value for key, value in record.items() if key != CHECKSUM}
    text = json.dumps(rest, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()


def _verified(text: bytes | str) -> dict[str, Any] | None:
    """Return the record of a line or a file, None if it is incomplete or was changed by hand."""
    try:
        record = json.loads(text)
    except ValueError:
        return None
    return record if isinstance(record, dict) and record.get(CHECKSUM) == checksum(record) else None


def write_error(path: Path, text: str, error: OSError) -> RenderError:
    return RenderError(Problem("RG507", f"{text}: {error.strerror or error}", Place(str(path))))


def make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise write_error(folder, "the folder cannot be created", error) from error


def _write_json(path: Path, document: Mapping[str, Any]) -> None:
    text = json.dumps(document, indent=2, ensure_ascii=False) + "\n"
    write_file(path, text.encode(errors="backslashreplace"))


# --- runs ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SweepFolder:
    """A folder with the lines of the results that it had when it was opened, and the number of incomplete ones."""

    path: Path
    lines: Mapping[str, dict[str, Any]]
    incomplete: int

    @classmethod
    def open(cls, path: Path, study: Mapping[str, Any], *, resume: bool) -> SweepFolder:
        """Open a locked folder, and remove files that a killed sweep left half-written."""
        check_folder(path, study, resume=resume)
        for part in (*path.glob(".*.part"), *path.glob("*/.*.part")):
            part.unlink(missing_ok=True)
        return cls.read(path)

    @classmethod
    def read(cls, path: Path) -> SweepFolder:
        records, incomplete = read_results(path)
        return cls(path, {record["key"]: record for record in records if "key" in record}, incomplete)

    def begin(self, study: Mapping[str, Any]) -> None:
        """Write `study.json`; to be called before the first picture is written."""
        _write_json(self.path / STUDY, study)

    def keep(self, run: Run, result: Result, picture: bytes, origin: Mapping[str, Any]) -> RunRecord:
        """Write a run's picture and its `run.json`, still without times, and return the record."""
        make_folder(run.folder)
        write_file(run.picture, picture)
        document = {
            "key": run.key,
            **result.as_json(),
            **_UNTIMED,
            "picture": f"{run.folder.name}/{run.picture.name}",
            "picture_sha256": hashlib.sha256(picture).hexdigest(),
            "size": run.planned.linked.graph.size,
            **origin,
        }
        record = msgspec.convert(jsonable(document), RunRecord)
        _describe(run, record)
        return record

    def write(self, run: Run, record: RunRecord) -> None:
        """Write a measured run's `run.json` and its line in the results; remove a picture that is not kept."""
        _describe(run, record)
        self.append(record.as_json())
        if record.picture is None:
            try:
                run.picture.unlink(missing_ok=True)
            except OSError as error:
                raise write_error(run.picture, "the picture cannot be removed", error) from error

    def append(self, record: Mapping[str, Any]) -> None:
        """Add a line to the results, with the SHA-256 of its other fields; it is on the disk when this returns."""
        path = self.path / RESULTS
        line = json.dumps({**record, CHECKSUM: checksum(record)}, ensure_ascii=False) + "\n"
        try:
            new = not path.exists()
            with path.open("ab+") as file:
                size = file.tell()
                file.seek(max(0, size - 1))
                torn = size > 0 and file.read(1) != b"\n"
                file.write((b"\n" if torn else b"") + line.encode(errors="backslashreplace"))
                file.flush()
                os.fsync(file.fileno())
            if new:
                flush(self.path)
        except OSError as error:
            raise write_error(path, "the results cannot be written", error) from error

    def fail(self, run: Run, problems: Sequence[Problem]) -> Failure:
        """Write the line of a run that cannot be rendered, unless the last one has the same reason."""
        failure = Failure(run.name, run.settings, tuple(problems))
        if self.lines.get(run.key, {}).get("error") != failure.text:
            source = run.planned.linked.selection.label
            self.append({"key": run.key, "pipeline": source, **failure.as_json()})
        return failure


def _describe(run: Run, record: RunRecord) -> None:
    resolved = run.planned.linked.spec.to_yaml(origins=False)
    document = {**record.as_json(), "resolved": resolved, "metrics": metrics.description()}
    _write_json(run.folder / RUN, document | {CHECKSUM: checksum(document)})


def find_record(run: Run, lines: Mapping[str, dict[str, Any]], *, pictures: bool) -> RunRecord | None:
    """Return the record of a run that the folder has, None if it is missing or its picture has changed.

    A run that was rendered and not measured has no line, only its `run.json`. With `pictures`, the picture must exist.
    """
    line = lines.get(run.key)
    document = line if line is not None and "error" not in line else _run_document(run)
    if document is None:
        return None
    known = {name: value for name, value in document.items() if name in RunRecord.__struct_fields__}
    try:
        record = msgspec.convert(known, RunRecord)
        if record.picture is None:
            return None if pictures else record
        unchanged = hashlib.sha256(run.picture.read_bytes()).hexdigest() == record.picture_sha256
    except (msgspec.ValidationError, OSError):
        return None
    return record if unchanged else None


def _run_document(run: Run) -> dict[str, Any] | None:
    try:
        document = _verified((run.folder / RUN).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return document if document is not None and document.get("key") == run.key else None


def restored_result(run: Run, record: RunRecord, encoding: Encoding) -> Result:
    from rendergraph.images import read  # a sweep is checked without OpenImageIO

    plugins = {name: _number(value) for name, value in record.plugin_metrics.items()}
    psnr = record.psnr if record.rmse is not None else math.nan
    return Result.of(
        run.name,
        run.planned,
        pixels=read(run.picture) if record.picture else None,
        encoding=encoding,
        metrics=Metrics(_number(record.rmse), psnr, _number(record.ssim), _number(record.flip), plugins),
        times=record.times,
        settings=run.settings,
        radiance_rmse=record.radiance_rmse,
        relative_mse=record.relative_mse,
        not_finite=record.not_finite,
        figures=record.figures,
    )


def _number(value: float | None) -> float:
    return math.nan if value is None else value


# --- the folder ------------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def locked(out: Path) -> Iterator[None]:
    """Make the folder if it does not exist, and keep other sweeps out of it; the OS releases the lock on exit."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        lock = (out / _LOCK).open("ab")
    except OSError as error:
        raise _refused(out, error.strerror or str(error)) from error
    with lock:
        if not system.lock(lock):
            raise _refused(out, "another sweep is running in it; wait until it ends, or use another folder")
        yield


def check_folder(out: Path, study: Mapping[str, Any], *, resume: bool) -> None:
    """Raise an InputError if a folder has results already, or those of another study."""
    if ((out / RESULTS).exists() or (out / STUDY).exists()) and not resume:
        raise _refused(out, "it has results of a sweep; --resume adds what is missing, or use another folder")
    before = _read_study(out)
    if before is None or not (differing := [key for key in study if before.get(key) != study[key]]):
        return
    what = "; ".join(f"{key} {before.get(key)}, not {study[key]}" for key in differing if key != _VALUES)
    what = what or f"other values (-s, -p or the file): {_first_change(before[_VALUES], study[_VALUES])}"
    raise _refused(out, f"it has results of another study: {what}; use another folder: -o {out}-2")


def kept_runs(out: Path) -> int:
    return len(list(out.glob(f"*/{RUN}")))


def _first_change(old: Any, new: Any, path: str = "") -> str:
    if isinstance(old, dict) and isinstance(new, dict):
        for key in [*old, *(key for key in new if key not in old)]:
            if old.get(key) != new.get(key):
                return _first_change(old.get(key), new.get(key), f"{path}.{key}" if path else str(key))
    texts = [json.dumps(value, ensure_ascii=False) if value is not None else "none" for value in (old, new)]
    return f"{path} {texts[0]}, not {texts[1]}"


def _read_study(out: Path) -> dict[str, Any] | None:
    try:
        study = json.loads((out / STUDY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return study if isinstance(study, dict) and _VALUES in study else None


def _refused(out: Path, text: str) -> InputError:
    return InputError(Problem("RG504", f"cannot be written: {text}", Place(str(out))))
