"""One folder a run: the picture and `run.json`, written before the line in the results that says they are whole."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph import __version__, metrics
from rendergraph.compare.divergence import passes
from rendergraph.compare.ledger import Ledger
from rendergraph.compare.sources import sources_digest
from rendergraph.compare.timing import Times
from rendergraph.compare.values import Pixels, Result, machine
from rendergraph.errors import InputError, Place, Problem, RenderError
from rendergraph.metrics import Encoding, Metrics

if TYPE_CHECKING:
    from rendergraph.session import Pipeline

RESULTS = "results.jsonl"


@dataclass(frozen=True, eq=False)
class Run:
    """One combination of a sweep.

    Attributes:
        name: unique, and its folder's name.
        settings: path to value.
        pipeline: with the settings.
        output: the output that is compared and kept.
        key: what decides its picture and figures, so that it is known again.
        folder: where it is kept.
    """

    name: str
    settings: Mapping[str, str]
    pipeline: Pipeline
    output: str
    key: str
    folder: Path

    @property
    def picture(self) -> Path:
        """The picture's file: light keeps its values."""
        return self.folder / ("image.png" if self.output == "image" else "radiance.exr")


def key_of(pipeline: Pipeline, frame: int, against: str) -> str:
    """What decides a run: the resolved file, what it is drawn from, camera and frame, what it is measured against."""
    files = [str(pipeline.spec.scene), str(pipeline.environment), sources_digest(pipeline)]
    spec = pipeline.spec.to_yaml(origins=False)
    parts = [__version__, spec, files, pipeline.camera, pipeline.graph.size, frame, against]
    parts += sorted(metric.name for metric in pipeline.catalog.extensions.metrics())
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def open_folder(out: Path, *, resume: bool) -> tuple[Ledger, dict[str, dict[str, Any]], int]:
    """The folder's results: where they go, what is there by key, and how many lines are not whole.

    Raises:
        InputError: there are results already, or it cannot be a folder.
    """
    ledger = Ledger(out / RESULTS)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(Problem("RG504", f"cannot be written: {error.strerror}", Place(str(out)))) from error
    if ledger.path.exists() and not resume:
        text = "it has results of a sweep; --resume adds what is missing, or name another folder"
        raise InputError(Problem("RG504", f"cannot be written: {text}", Place(str(out))))
    records, torn = ledger.read()
    return ledger, {record["key"]: record for record in records if "key" in record}, torn


def keep(run: Run, result: Result, arrays: Mapping[str, Pixels], device: Mapping[str, object], ledger: Ledger) -> None:
    """Write a run's folder, then its line.

    Raises:
        RenderError: the disk does not take it.
    """
    from rendergraph.images import PictureInfo, Saved, save_outputs
    from rendergraph.images.files import staged

    try:
        run.folder.mkdir(exist_ok=True)
    except OSError as error:
        text = f"the folder cannot be made: {error.strerror}"
        raise RenderError(Problem("RG507", text, Place(str(run.folder)))) from error
    graph = run.pipeline.graph
    info = graph.textures[graph.outputs[run.output]]
    described = PictureInfo(info.semantic.name, info.desc.format if info.desc else "", info.semantic.encoding)
    resolved = run.pipeline.spec.to_yaml(origins=False)
    picture = Saved(run.picture, arrays[run.output], described, raw=False)
    save_outputs([picture], {"rendergraph:pipeline": resolved})
    record = {
        "key": run.key,
        **_finite(result.as_json()),
        "picture": f"{run.folder.name}/{run.picture.name}",
        "picture_sha256": _digest(run.picture),
        "size": list(graph.size),
        "device": dict(device),
        "machine": machine(),
    }
    document = {**record, "resolved": resolved, "metrics": metrics.description()}
    with staged([run.folder / "run.json"]) as (part,):
        part.write_text(json.dumps(document, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    ledger.append(record)


def is_kept(run: Run, record: Mapping[str, Any]) -> bool:
    """Whether the picture a record speaks of is still there."""
    try:
        return _digest(run.picture) == record.get("picture_sha256")
    except OSError:
        return False


def restored(run: Run, record: Mapping[str, Any], encoding: Encoding) -> Result:
    """A result as it was kept."""
    from rendergraph.images import read

    plan = run.pipeline.plan()
    return Result(
        name=run.name, source=run.pipeline.source, pixels=read(run.picture), encoding=encoding,
        metrics=_metrics(record),
        times=Times.from_json(record), memory=plan.memory.as_json(), pass_count=len(passes(plan)),
        settings=run.settings, radiance_rmse=record["radiance_rmse"], graph=run.pipeline.graph, plan=plan,
    )  # fmt: skip


def _metrics(record: Mapping[str, Any]) -> Metrics:
    plugins = {name: _number(value) for name, value in record.get("plugin_metrics", {}).items()}
    return Metrics(
        _number(record["rmse"]), record["psnr"], _number(record["ssim"]), _number(record["flip"]), plugins
    )  # fmt: skip


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _finite(value: Any) -> Any:
    """JSON has no NaN."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, list | tuple) else value
