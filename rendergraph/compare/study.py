"""The folder of a sweep: what was studied in it, so that another study does not write over its pictures."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.compare.ledger import Ledger
from rendergraph.compare.runs import RUN
from rendergraph.errors import InputError, Place, Problem

if TYPE_CHECKING:
    from rendergraph.session import Pipeline

RESULTS = "results.jsonl"
STUDY = "study.json"
_LOCK = ".lock"
_VALUES = "resolved"
"""The whole file without the axes; the other entries of a study are said in words."""


def study_of(base: Pipeline, frame: int, reference: str) -> dict[str, Any]:
    """What all runs of a sweep have in common, and what they are measured against.

    More values of an axis are the same study, and so are edited shaders: those runs are drawn again.
    """
    selection, spec = base.selection, base.resolve().spec
    width, height = spec.size
    return {
        "pipeline": spec.name,
        "scene": str(spec.scene.stem) if spec.scene else None,
        "environment": str(selection.environment) if selection.environment else None,
        "camera": selection.camera,
        "size": f"{width}x{height}",
        "frame": frame,
        "reference": reference,
        _VALUES: json.loads(json.dumps(spec.tree.plain(), default=str)),
    }


@contextlib.contextmanager
def claimed(out: Path) -> Iterator[None]:
    """Make the folder where there is none, and keep other sweeps out of it meanwhile.

    The lock is the system's, and ends with the process, however that ends.

    Raises:
        InputError: it cannot be a folder, or another sweep is at work in it.
    """
    import fcntl  # a sweep is read and checked on every system

    try:
        out.mkdir(parents=True, exist_ok=True)
        lock = os.open(out / _LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise _refused(out, error.strerror or str(error)) from error
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise _refused(out, "another sweep is at work in it; wait for that, or name another folder") from None
        yield
    finally:
        os.close(lock)


def open_folder(out: Path, study: Mapping[str, Any], *, resume: bool) -> tuple[Ledger, dict[str, dict[str, Any]], int]:
    """A claimed folder's results: where they go, what is there by key, and how many lines are not whole.

    What a killed sweep was about to write is removed.

    Raises:
        InputError: there are results already, or those of another study.
    """
    check_folder(out, study, resume=resume)
    ledger = Ledger(out / RESULTS)
    for part in (*out.glob(".*.part"), *out.glob("*/.*.part")):
        part.unlink(missing_ok=True)
    records, torn = ledger.read()
    return ledger, {record["key"]: record for record in records if "key" in record}, torn


def check_folder(out: Path, study: Mapping[str, Any], *, resume: bool) -> None:
    """Whether a sweep may go into a folder.

    Raises:
        InputError: there are results already, or those of another study.
    """
    if ((out / RESULTS).exists() or (out / STUDY).exists()) and not resume:
        raise _refused(out, "it has results of a sweep; --resume adds what is missing, or name another folder")
    before = _study_in(out)
    if before is not None and (differing := [key for key in study if before.get(key) != study[key]]):
        named = [f"{key} {before.get(key)}, not {study[key]}" for key in differing if key != _VALUES]
        what = (
            "; ".join(named) or f"other values (-s, -p or the file): {_first_change(before[_VALUES], study[_VALUES])}"
        )
        raise _refused(out, f"it has results of another study: {what}; name another folder: -o {out}-2")


def begin(out: Path, study: Mapping[str, Any]) -> None:
    """Write down what is studied in a folder; to be called before the first picture goes there."""
    from rendergraph.images.files import write_file  # a sweep is checked without OpenImageIO

    write_file(out / STUDY, json.dumps(study, indent=2, ensure_ascii=False) + "\n")


def kept_runs(out: Path) -> int:
    """How many runs a folder has, measured or not."""
    return sum(1 for _ in out.glob(f"*/{RUN}"))


def _first_change(old: Any, new: Any, path: str = "") -> str:
    """The first value that two resolved files do not share, as one has it and as the other."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in [*old, *(key for key in new if key not in old)]:
            if old.get(key) != new.get(key):
                return _first_change(old.get(key), new.get(key), f"{path}.{key}" if path else str(key))
    told = [json.dumps(value, ensure_ascii=False) if value is not None else "none" for value in (old, new)]
    return f"{path} {told[0]}, not {told[1]}"


def _study_in(out: Path) -> dict[str, Any] | None:
    try:
        found = json.loads((out / STUDY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) and _VALUES in found else None


def _refused(out: Path, text: str) -> InputError:
    return InputError(Problem("RG504", f"cannot be written: {text}", Place(str(out))))
