"""One folder a run: the picture and `run.json`, kept as soon as it is drawn; timed, it gets a line in the results."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph import metrics
from rendergraph.compare.axes import typed
from rendergraph.compare.divergence import passes
from rendergraph.compare.ledger import CHECKSUM, Ledger, checksum
from rendergraph.compare.sources import sources_digest
from rendergraph.compare.timing import NO_TIMES, Times
from rendergraph.compare.values import Pixels, Result
from rendergraph.errors import Place, Problem, RenderError
from rendergraph.formatting import jsonable
from rendergraph.metrics import Encoding, Metrics
from rendergraph.session.made import at_time, described
from rendergraph.version import __version__

if TYPE_CHECKING:
    from rendergraph.link import Graph
    from rendergraph.session.values import Planned

RUN = "run.json"
ERROR = "error"
"""What a line has in place of figures where the run cannot be drawn or compared."""
UNTIMED: Mapping[str, Any] = {
    "frames": 0,
    "frame_ms": None,
    "gpu_ms": None,
    "cpu_ms": None,
    "passes": [],
    "repeats": [],
}


@dataclass(frozen=True, eq=False)
class Run:
    """One combination of a sweep.

    Attributes:
        name: unique, and its folder's name.
        settings: path to value.
        planned: the pipeline with the settings.
        output: the output that is compared and kept.
        frame: whose picture it is.
        key: what decides its picture and figures, so that it is known again.
        folder: where it is kept.
    """

    name: str
    settings: Mapping[str, str]
    planned: Planned
    output: str
    frame: int
    key: str
    folder: Path

    @property
    def picture(self) -> Path:
        """The picture's file: light keeps its values."""
        return self.folder / (f"{self.output}.png" if self.output == "image" else f"{self.output}.exr")

    @property
    def metadata(self) -> dict[str, str]:
        """What its picture says of how it was made."""
        return {**described(self.planned.linked), **at_time(self.frame, 30.0)}


@dataclass(frozen=True)
class Failure:
    """A run that could not be drawn or compared.

    Attributes:
        name: the run's.
        settings: path to value.
        problems: why.
    """

    name: str
    settings: Mapping[str, str]
    problems: tuple[Problem, ...]

    @property
    def text(self) -> str:
        """Why, a line a problem."""
        return "\n".join(str(problem).splitlines()[0] for problem in self.problems)

    def as_json(self) -> dict[str, Any]:
        """Name, settings and reason."""
        return {
            "name": self.name,
            "settings": {path: typed(value) for path, value in self.settings.items()},
            ERROR: self.text,
        }


def key_of(planned: Planned, frame: int, against: str) -> str:
    """What decides a run: the resolved file, what it is drawn from, camera and frame, what it is measured against."""
    linked, selection = planned.linked, planned.linked.selection
    files = [str(linked.spec.scene), str(selection.environment), sources_digest(planned)]
    spec = linked.spec.to_yaml(origins=False)
    parts = [__version__, spec, files, selection.camera, linked.graph.size, frame, against]
    parts += sorted(metric.name for metric in linked.catalog.extensions.metrics())
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def picture_bytes(graph: Graph, output: str, ending: str, pixels: Pixels, metadata: Mapping[str, str]) -> bytes:
    """The file of an output's picture."""
    from rendergraph.images import PictureInfo, Saved, encoded  # a sweep is checked without OpenImageIO

    info = graph.textures[graph.outputs[output]]
    shown = PictureInfo(info.semantic.name, info.desc.format if info.desc else "", info.semantic.encoding)
    return encoded(Saved(Path(f"{output}{ending}"), pixels, shown, raw=False), metadata)


def keep(
    run: Run, result: Result, picture: bytes, device: Mapping[str, object], on: Mapping[str, str]
) -> dict[str, Any]:
    """Write a run's picture and its `run.json`, as yet without times, and return the record.

    Args:
        run: which.
        result: what is known of it.
        picture: its file.
        device, on: what drew it, and the machine.

    Raises:
        RenderError: the disk does not take it.
    """
    from rendergraph.images.files import write_file  # a sweep is checked without OpenImageIO

    try:
        run.folder.mkdir(exist_ok=True)
    except OSError as error:
        text = f"the folder cannot be made: {error.strerror}"
        raise RenderError(Problem("RG507", text, Place(str(run.folder)))) from error
    write_file(run.picture, picture)
    record = {
        "key": run.key,
        **jsonable(result.as_json()),
        **UNTIMED,
        "picture": f"{run.folder.name}/{run.picture.name}",
        "picture_sha256": hashlib.sha256(picture).hexdigest(),
        "size": list(run.planned.linked.graph.size),
        "device": dict(device),
        "machine": dict(on),
    }
    _describe(run, record)
    return record


def settle(
    run: Run,
    record: Mapping[str, Any],
    times: Times,
    device: Mapping[str, object],
    on: Mapping[str, str],
    ledger: Ledger,
) -> dict[str, Any]:
    """Add the times to a run that was kept, then its line to the results, and return the new record.

    Where the record is without its picture, that goes now.

    Raises:
        RenderError: the disk does not take it.
    """
    timed = {key: value for key, value in record.items() if key != CHECKSUM}
    timed |= {**jsonable(times.as_json()), "device": dict(device), "machine": dict(on)}
    _write_down(run, timed, ledger)
    return timed


def drop(run: Run, record: Mapping[str, Any], ledger: Ledger) -> dict[str, Any]:
    """Remove a run's picture and keep its figures, in a new line of the results, and return the new record.

    Raises:
        RenderError: the disk does not take it.
    """
    found = without_picture(record)
    _write_down(run, found, ledger)
    return found


def without_picture(record: Mapping[str, Any]) -> dict[str, Any]:
    """A record of which the picture is not kept."""
    rest = {key: value for key, value in record.items() if key != CHECKSUM}
    return rest | {"picture": None, "picture_sha256": None}


def _write_down(run: Run, record: Mapping[str, Any], ledger: Ledger) -> None:
    _describe(run, record)
    ledger.append(record)
    if record["picture"] is None:
        try:
            run.picture.unlink(missing_ok=True)
        except OSError as error:
            text = f"the picture cannot be removed: {error.strerror}"
            raise RenderError(Problem("RG507", text, Place(str(run.picture)))) from error


def give_up(run: Run, problems: Sequence[Problem], ledger: Ledger, lines: Mapping[str, dict[str, Any]]) -> Failure:
    """Give a run that cannot be drawn its line in the results, unless the last one says the same already.

    Raises:
        RenderError: the disk does not take it.
    """
    failure = Failure(run.name, run.settings, tuple(problems))
    if lines.get(run.key, {}).get(ERROR) != failure.text:
        source = run.planned.linked.selection.source
        ledger.append({"key": run.key, "pipeline": source, **failure.as_json()})
    return failure


def _describe(run: Run, record: Mapping[str, Any]) -> None:
    from rendergraph.images.files import write_file  # a sweep is checked without OpenImageIO

    resolved = run.planned.linked.spec.to_yaml(origins=False)
    document = {**record, "resolved": resolved, "metrics": metrics.description()}
    document[CHECKSUM] = checksum(document)
    write_file(run.folder / RUN, json.dumps(document, indent=2, ensure_ascii=False) + "\n")


def found_again(run: Run, lines: Mapping[str, dict[str, Any]], *, pictures: bool = True) -> dict[str, Any] | None:
    """The record of a run that is there already, None where it is not or its picture is another.

    Args:
        run: which.
        lines: of the results, by key. A run that was drawn and not yet timed has none, only its `run.json`.
        pictures: whether it has to have a picture, which may have been dropped.
    """
    line = lines.get(run.key)
    record = line if line is not None and ERROR not in line else _drawn_before(run)
    if record is not None and record["picture"] is None:
        return None if pictures else record
    return record if record is not None and is_kept(run, record) else None


def _drawn_before(run: Run) -> dict[str, Any] | None:
    try:
        document = json.loads((run.folder / RUN).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(document, dict) or document.get("key") != run.key:
        return None
    if document.get(CHECKSUM) != checksum(document):  # somebody has changed it
        return None
    return {name: value for name, value in document.items() if name not in ("resolved", "metrics", CHECKSUM)}


def is_kept(run: Run, record: Mapping[str, Any]) -> bool:
    """Whether the picture a record speaks of is still there."""
    try:
        return _digest(run.picture) == record.get("picture_sha256")
    except OSError:
        return False


def restored(run: Run, record: Mapping[str, Any], encoding: Encoding) -> Result:
    """A result as it was kept."""
    from rendergraph.images import read  # a sweep is checked without OpenImageIO

    linked, plan = run.planned.linked, run.planned.plan
    return Result(
        name=run.name,
        source=linked.selection.source,
        pixels=read(run.picture) if record["picture"] else None,
        encoding=encoding,
        metrics=_metrics(record),
        times=Times.from_json(record) if record["frames"] else NO_TIMES,
        memory=plan.memory.as_json(),
        pass_count=len(passes(plan)),
        settings=run.settings,
        radiance_rmse=record["radiance_rmse"],
        graph=linked.graph,
        plan=plan,
        not_finite=record["not_finite"],
        figures=record.get("figures", {}),
    )


def _metrics(record: Mapping[str, Any]) -> Metrics:
    plugins = {name: _number(value) for name, value in record.get("plugin_metrics", {}).items()}
    psnr = record["psnr"] if record["rmse"] is not None else math.nan
    return Metrics(_number(record["rmse"]), psnr, _number(record["ssim"]), _number(record["flip"]), plugins)


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _number(value: float | None) -> float:
    return math.nan if value is None else value
