"""A sweep as a file: pipeline, axes, and what else the options of `sweep` say."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from rendergraph.compare.axes import MOST_RUNS, Axis, Space, axis_of, repeated
from rendergraph.compare.ranges import RANGE
from rendergraph.compare.sampling import Sampling
from rendergraph.document import Value, load
from rendergraph.errors import InputError, Problem
from rendergraph.keys import Codes, Key, MapOf, Table, Validator, plain
from rendergraph.keys.values import TEXT, choice, listed, shipped, version, whole, word
from rendergraph.read import SIZE, entries
from rendergraph.resources import shipped_pipelines, shipped_scenes

MOST_MEASURED = 10_000
"""Frames of a run."""
MOST_REPEATS = 1000
_CODES = Codes(unknown="RG030", wrong="RG030", name="RG030", file="RG030")
_VALUES: Any = Annotated[
    listed(Any, "values", least=1) | word(RANGE, "a range", "FIRST:LAST:STEP"),
    "a list of values, or a range such as 8:64:8 or log:0.1:10:5",
]
SWEEP = Table(
    "a sweep",
    (
        Key("sweep", version(1), "Version of the format.", required=True, example="sweep: 1"),
        Key(
            "pipeline",
            shipped(shipped_pipelines),
            "A shipped name, or a file.",
            required=True,
            example="pipeline: NAME",
        ),
        Key(
            "axes",
            MapOf(_VALUES, what="path", null=False, least=1),
            "Paths, as `-s` takes them, each with a list of values or a range, both ends included.",
            required=True,
            example="axes: {NODE.PARAM: [VALUE, VALUE], NODE.OTHER: 8:64:8}",
        ),
        Key(
            "zip",
            listed(listed(TEXT, "paths", least=2), "lists of paths"),
            "Groups of axes that go through their values together, the first with the first.",
            example="zip: [[NODE.PARAM, NODE.OTHER]]",
        ),
        Key("samples", whole(1, MOST_RUNS), "How many samples of the axes are drawn, in place of all combinations."),
        Key(
            "sampling", choice(*get_args(Sampling)), "`latin`: a sample in each equal part of every axis; or `random`."
        ),
        Key("seed", whole(0), "Of the samples: the same one gives the same.", default=0),
        Key(
            "minimise",
            Annotated[TEXT | listed(TEXT, "names", least=1), "a name such as flip or ms, or a list of names"],
            "Look for what makes this least, or these, in place of all combinations.",
            example="minimise: [flip, ms]",
        ),
        Key("budget", whole(1, MOST_RUNS), "How many runs the search may ask for.", default=50),
        Key("reference", shipped(shipped_pipelines), "A picture or a pipeline that all runs are compared with."),
        Key("metric", TEXT, "A port, `NODE.PORT`, whose texture is measured in place of the picture."),
        Key("scene", shipped(shipped_scenes), "What is drawn, in place of the pipeline's own."),
        SIZE,
        Key("set", MapOf(Any, what="path"), "Paths to values that hold for all runs."),
        Key("frames", whole(1, MOST_MEASURED), "How many frames are measured."),
        Key("repeats", whole(1, MOST_REPEATS), "How often they are measured, each time anew."),
        Key("keep", choice("all", "best"), "Which pictures stay; `best` are those of the Pareto front."),
    ),
)
"""What a sweep's file holds."""


@dataclass(frozen=True)
class SweepFile:
    """A sweep as a file has it; None where the file does not say.

    Attributes:
        pipeline: a shipped name or a path, joined to the file's folder.
        space: its axes, and which runs are made of them.
        reference, scene: likewise.
        metric: the port that is measured.
        size: width and height.
        sets: `PATH=VALUE` texts.
        frames, repeats: how many are measured, and how often.
        kept: which pictures stay.
        minimise, budget: what a search looks for, and how many runs it may ask for.
        places: what stands under each path, of axes and of `set`, and the groups of `zip`.
    """

    pipeline: str
    space: Space
    reference: str | None = None
    scene: str | None = None
    metric: str | None = None
    size: tuple[int, int] | None = None
    sets: tuple[str, ...] = ()
    frames: int | None = None
    repeats: int | None = None
    kept: Literal["all", "best"] | None = None
    minimise: tuple[str, ...] = ()
    budget: int | None = None
    places: Mapping[str, Value] = field(default_factory=dict)

    def placed(self, error: InputError) -> InputError:
        """Mistakes in what the file says of paths, at its own lines; others as they are."""
        return error.relocated(self._placed)

    def _placed(self, problem: Problem) -> Problem:
        option = problem.place.option("-x", "--set", "--zip") if problem.place else None
        value = self.places.get(option.path) if option else None
        return value.relocate(problem, key=option.name != "--zip") if option and value else problem


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
    validator = Validator(_CODES)
    root = validator.file(load(path).root, SWEEP, "`sweep: 1`, `pipeline` and `axes`")
    axes = [_axis(str(name), listed, validator) for name, listed in entries(root, "axes").items()] if root else []
    if validator.problems or root is None:
        raise InputError(validator.problems)
    said = plain(root, SWEEP)
    groups = {",".join(group.plain()): group for group in _parts(root.get("zip"))}
    said |= {key: _beside(path, said[key]) for key in ("pipeline", "reference", "scene") if key in said}
    given, minimise = root.get("set"), said.get("minimise", ())
    return SweepFile(
        said["pipeline"],
        Space(
            tuple(axes),
            tuple(tuple(group) for group in said.get("zip", ())),
            said.get("samples"),
            said.get("sampling", "latin"),
            said.get("seed", 0),
        ),
        said.get("reference"),
        said.get("scene"),
        said.get("metric"),
        said.get("size"),
        tuple(f"{name}={value_text(value)}" for name, value in (given.items() if given else ())),
        said.get("frames"),
        said.get("repeats"),
        said.get("keep"),
        tuple([minimise] if isinstance(minimise, str) else minimise),
        said.get("budget"),
        entries(root, "set") | groups | entries(root, "axes"),
    )


def value_text(value: Value) -> str:
    """A value as the text that `-s` would take for it."""
    plain = value.plain()
    return plain if isinstance(plain, str) else json.dumps(plain)


def _axis(path: str, given: Value, validator: Validator) -> Axis:
    if isinstance(given.data, str):
        try:
            return axis_of(path, given.data)
        except ValueError as error:
            validator.report(given, _CODES.wrong, str(error))
    values = [value_text(value) for value in _parts(given)]
    for value in repeated(values):
        validator.report(given, _CODES.wrong, f"axis '{path}' has the value {value} twice")
    return Axis(path, tuple(values))


def _parts(value: Value | None) -> Sequence[Value]:
    return value.data if value is not None and isinstance(value.data, list) else ()


def _beside(file: Path, name: str) -> str:
    """A name as the command line takes it: shipped ones as they are, paths joined to the file's folder."""
    if re.fullmatch(r"[A-Za-z0-9_-]+", name):
        return name
    return str(file.parent / name)
