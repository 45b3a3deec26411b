"""Axes of a sweep: paths with the values they take, from the command line or from a file, and their product."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.document import Value, load
from rendergraph.errors import InputError, Place, Problem, suggestion

if TYPE_CHECKING:
    from rendergraph.session import Pipeline

MOST_RUNS = 10_000
_PAIRS = {"[": "]", "{": "}", "(": ")"}
_KEYS = {
    "sweep": "version of the format: 1",
    "pipeline": "a shipped name, or a file beside this one",
    "axes": "paths to lists of values",
    "reference": "a picture or a pipeline",
    "scene": "what is drawn",
    "size": "width and height",
    "set": "paths to values that hold for all runs",
    "frames": "how many frames are measured",
}


@dataclass(frozen=True)
class Axis:
    """One path, as `-s` takes it, and the values it goes through, as YAML texts."""

    path: str
    values: tuple[str, ...]


@dataclass(frozen=True)
class SweepFile:
    """A sweep as a file has it; None where the file does not say.

    Attributes:
        pipeline: a shipped name or a path, joined to the file's folder.
        axes: in the file's order.
        reference, scene: likewise.
        size: width and height.
        sets: `PATH=VALUE` texts.
        frames: how many are measured.
    """

    pipeline: str
    axes: tuple[Axis, ...]
    reference: str | None = None
    scene: str | None = None
    size: tuple[int, int] | None = None
    sets: tuple[str, ...] = ()
    frames: int | None = None


def parse_axis(text: str) -> Axis:
    """`ao.samples=8,16,32`; commas inside brackets and quotes belong to a value.

    Raises:
        ValueError: it is written in another way, in words.
    """
    path, equals, rest = text.partition("=")
    path = path.strip()
    if not equals or not path:
        raise ValueError(f"'{text}' is not PATH=VALUE,VALUE,…, as in shadows.taps=1,2,4")
    values = [part.strip() for part in _split(rest)]
    if not rest.strip():
        raise ValueError(f"axis '{path}' has no values; write {path}=VALUE,VALUE,…")
    if "" in values:
        raise ValueError(f"axis '{path}' has an empty value in '{rest}'")
    twice = [value for number, value in enumerate(values) if value in values[:number]]
    if twice:
        raise ValueError(f"axis '{path}' has the value {twice[0]} twice")
    return Axis(path, tuple(values))


def _split(text: str) -> list[str]:
    """A list's parts; what stands in brackets or quotes is not looked into."""
    parts, waiting, quote = [""], [], ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "'\"":
            quote = letter
        elif letter in _PAIRS:
            waiting.append(_PAIRS[letter])
        elif waiting and letter == waiting[-1]:
            waiting.pop()
        elif letter == "," and not waiting:
            parts.append("")
            continue
        parts[-1] += letter
    return parts


def check_axes(axes: Sequence[Axis]) -> None:
    """Say what is wrong with axes as a whole.

    Raises:
        InputError: there is none, two have one path, or there are too many runs.
    """
    problems = []
    if not axes:
        text = "the sweep has no axis; add one: -x NODE.PARAM=VALUE,VALUE"
        problems.append(Problem("RG524", text))
    paths = [axis.path for axis in axes]
    for path in dict.fromkeys(path for number, path in enumerate(paths) if path in paths[:number]):
        problems.append(Problem("RG524", f"two axes are called '{path}'; put all values into one"))
    count = 1
    for axis in axes:
        count *= len(axis.values)
    if count > MOST_RUNS:
        text = f"the axes make {count} runs, more than {MOST_RUNS}; leave out values or sweep in parts"
        problems.append(Problem("RG524", text))
    if problems:
        raise InputError(problems)


def combinations(axes: Sequence[Axis]) -> list[dict[str, str]]:
    """The product: path to value of every run, the last axis fastest."""
    return [
        dict(zip((axis.path for axis in axes), values, strict=True))
        for values in itertools.product(*(axis.values for axis in axes))
    ]


def pipelines(base: Pipeline, runs: Sequence[Mapping[str, str]]) -> list[Pipeline]:
    """The pipeline of every run, linked.

    Raises:
        InputError: an axis names nothing or a value does not fit; each mistake once, with the first run that shows it.
    """
    found: list[Pipeline] = []
    problems: dict[tuple[str, str], Problem] = {}
    shared = replace(base, known_catalog=base.catalog)
    for run in runs:
        pipeline = replace(shared, sets=(*base.sets, *(f"{path}={value}" for path, value in run.items())))
        try:
            pipeline.check()
        except InputError as error:
            for problem in error.problems:
                problems.setdefault((problem.code, problem.text), _of_axis(problem, run))
        found.append(pipeline)
    if problems:
        raise InputError(list(problems.values()))
    return found


def _of_axis(problem: Problem, run: Mapping[str, str]) -> Problem:
    """A mistake in an assignment as one of the axis that made it, or of the run."""
    where = problem.place.file if problem.place else ""
    for path, value in run.items():
        if where == f"--set {path}={value}":
            return replace(problem, place=Place(f"-x {path}={value}"))
    if problem.place is None:
        return replace(problem, place=Place(", ".join(f"{path}={value}" for path, value in run.items())))
    return problem


def run_name(run: Mapping[str, str]) -> str:
    """A run's name, which is its folder's too: `ao.samples=8,shadows.type=shadow_vsm`, odd signs left out."""
    text = ",".join(f"{path}={value}" for path, value in run.items())
    return re.sub(r"[^A-Za-z0-9._=,+-]+", "_", text).strip("._")[:120] or "run"


# --- files -----------------------------------------------------------------------------------------------------------


def is_sweep(path: Path) -> bool:
    """Whether a file says that it is a sweep; one that cannot be read is none."""
    if path.suffix.lower() not in (".yaml", ".yml") or not path.is_file():
        return False
    try:
        root = load(path, keep_going=True).root
    except InputError:
        return False
    return isinstance(root.data, dict) and "sweep" in root.data


def read_sweep(path: Path) -> SweepFile:
    """A sweep's file.

    Raises:
        InputError: it is missing, no YAML, or says something a sweep cannot have; with all mistakes.
    """
    root = load(path).root
    problems: list[Problem] = []
    data: dict[Any, Value] = root.data if isinstance(root.data, dict) else {}
    for key, value in data.items():
        if key not in _KEYS:
            problems.append(
                value.problem("RG030", f"a sweep has no key '{key}'{suggestion(str(key), _KEYS)}", key=True)
            )
    if (version := data.get("sweep")) is None or version.data != 1:
        problems.append((version or root).problem("RG030", "a sweep begins with 'sweep: 1'"))
    pipeline = _text(data, "pipeline", problems)
    if pipeline is None and "pipeline" not in data:
        problems.append(root.problem("RG030", "the sweep names no pipeline; add pipeline: NAME"))
    axes = _axes(data.get("axes"), root, problems)
    sets = data.get("set")
    given: dict[Any, Value] = {}
    if sets is not None and not isinstance(sets.data, dict):
        problems.append(sets.problem("RG030", f"'set' takes a mapping of paths to values, this is {sets.kind}"))
    elif sets is not None and isinstance(sets.data, dict):
        given = sets.data
    size = _size(data.get("size"), problems)
    frames = data.get("frames")
    if frames is not None and not (
        isinstance(frames.data, int) and not isinstance(frames.data, bool) and frames.data > 0
    ):
        problems.append(frames.problem("RG030", f"'frames' takes a whole number from 1 up, this is {frames.kind}"))
    reference, scene = _text(data, "reference", problems), _text(data, "scene", problems)
    if problems:
        raise InputError(problems)
    return SweepFile(
        pipeline=_beside(path, pipeline or ""),
        axes=tuple(axes),
        reference=None if reference is None else _beside(path, reference),
        scene=None if scene is None else _beside(path, scene),
        size=size,
        sets=tuple(f"{key}={value_text(value)}" for key, value in given.items()),
        frames=None if frames is None else int(frames.data),  # type: ignore[arg-type]  # it was looked at above
    )


def value_text(value: Value) -> str:
    """A value as the text that `-s` would take for it."""
    plain = value.plain()
    return plain if isinstance(plain, str) else json.dumps(plain)


def _axes(value: Value | None, root: Value, problems: list[Problem]) -> list[Axis]:
    if value is None or not isinstance(value.data, dict) or not value.data:
        text = "the sweep has no axes; add axes: {NODE.PARAM: [VALUE, VALUE]}"
        problems.append((value or root).problem("RG030", text))
        return []
    found = []
    for path, listed in value.data.items():
        if not isinstance(listed.data, list) or not listed.data:
            text = (
                f"axis '{path}' takes a list of values, this is {'an empty list' if listed.data == [] else listed.kind}"
            )
            problems.append(listed.problem("RG030", text))
            continue
        values = [value_text(part) for part in listed.data]
        twice = [part for number, part in enumerate(values) if part in values[:number]]
        if twice:
            problems.append(listed.problem("RG030", f"axis '{path}' has the value {twice[0]} twice"))
        found.append(Axis(str(path), tuple(values)))
    return found


def _text(data: Mapping[Any, Value], key: str, problems: list[Problem]) -> str | None:
    value = data.get(key)
    if value is None:
        return None
    if not isinstance(value.data, str):
        problems.append(value.problem("RG030", f"'{key}' takes text, this is {value.kind}"))
        return None
    return value.data


def _size(value: Value | None, problems: list[Problem]) -> tuple[int, int] | None:
    if value is None:
        return None
    sides = [part.data for part in value.data] if isinstance(value.data, list) else []
    if len(sides) == 2 and all(isinstance(side, int) and not isinstance(side, bool) and side > 0 for side in sides):
        return int(sides[0]), int(sides[1])  # type: ignore[arg-type]  # whole numbers, as just seen
    problems.append(value.problem("RG030", f"'size' takes [WIDTH, HEIGHT], this is {value.kind}"))
    return None


def _beside(file: Path, name: str) -> str:
    """A name as the command line takes it: shipped ones as they are, paths joined to the file's folder."""
    if re.fullmatch(r"[A-Za-z0-9_-]+", name):
        return name
    return str(file.parent / name)
