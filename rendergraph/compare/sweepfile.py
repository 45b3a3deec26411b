"""A sweep as a file: pipeline, axes, and the options of `sweep`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, get_args

from msgspec import Struct

from rendergraph.compare.space import MOST_RUNS, RANGE, Axis, Sampling, Space, axis_of
from rendergraph.document import Value, load
from rendergraph.errors import InputError, Problem
from rendergraph.keys import Codes, Key, MapOf, Table, Validator, plain
from rendergraph.keys.values import TEXT, choice, listed, number, shipped, version, whole, word
from rendergraph.read import SIZE, entries
from rendergraph.resources import is_name, shipped_pipelines, shipped_scenes

MOST_MEASURED = 10_000
"""Maximum number of measured frames."""
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
            "Paths, as `-s` takes them, each with a list of values or a range that includes both ends.",
            required=True,
            example="axes: {NODE.PARAM: [VALUE, VALUE], NODE.OTHER: 8:64:8}",
        ),
        Key(
            "zip",
            listed(listed(TEXT, "paths", least=2), "lists of paths"),
            "Groups of axes that step through their values together, first with first.",
            example="zip: [[NODE.PARAM, NODE.OTHER]]",
        ),
        Key("samples", whole(1, MOST_RUNS), "Number of samples of the axes, instead of all combinations."),
        Key(
            "sampling", choice(*get_args(Sampling)), "`latin`: a sample in each equal part of every axis; or `random`."
        ),
        Key("seed", whole(0), "Random seed of the samples.", default=0),
        Key(
            "minimise",
            Annotated[TEXT | listed(TEXT, "names", least=1), "a name such as flip or ms, or a list of names"],
            "Minimise these objectives with an optimiser, instead of rendering all combinations.",
            example="minimise: [flip, ms]",
        ),
        Key("budget", whole(1, MOST_RUNS), "Maximum number of runs of the search.", default=50),
        Key("reference", shipped(shipped_pipelines), "A picture or a pipeline that all runs are compared with."),
        Key(
            "reference_noise", number(0, above=True), "Draw a truth until its noise is this part of the smallest error."
        ),
        Key("reference_samples", whole(1), "Draw at most so many samples of each of its pixels."),
        Key("reference_seconds", number(0, above=True), "Draw it at most so long."),
        Key("metric", TEXT, "A port, `NODE.PORT`, whose texture is measured instead of the picture."),
        Key("scene", shipped(shipped_scenes), "The scene, instead of the pipeline's own."),
        SIZE,
        Key("set", MapOf(Any, what="path"), "Paths to values that apply to all runs."),
        Key("frames", whole(1, MOST_MEASURED), "Number of measured frames."),
        Key("repeats", whole(1, MOST_REPEATS), "Number of measurements, each from the start."),
        Key("keep", choice("all", "best"), "Which pictures are kept; `best` keeps those on the Pareto front."),
    ),
)
"""The keys of a sweep's file."""


class SweepFile(Struct, frozen=True, eq=False):
    """A sweep as its file has it.

    Attributes:
        pipeline, reference, scene: shipped names, or paths joined to the file's folder.
        options: the attributes of `SweepOptions` that the file has.
        sets: `PATH=VALUE` texts.
        places: path to value of axes and of `set`, and the groups of `zip`.
    """

    pipeline: str
    space: Space
    options: Mapping[str, Any]
    reference: str | None
    scene: str | None
    size: tuple[int, int] | None
    sets: tuple[str, ...]
    places: Mapping[str, Value]

    def relocate(self, problem: Problem) -> Problem:
        """Return a mistake in a path at its line in the file."""
        option = problem.place.option("-x", "--set", "--zip") if problem.place else None
        value = self.places.get(option.path) if option else None
        return value.relocate(problem, key=option.name != "--zip") if option and value else problem


def is_sweep(path: Path) -> bool:
    """Whether a file claims to be a sweep; one that cannot be read is not."""
    if path.suffix.lower() not in (".yaml", ".yml") or not path.is_file():
        return False
    try:
        root = load(path, keep_going=True).root
    except InputError:
        return False
    return isinstance(root.data, dict) and "sweep" in root.data


def read_sweep(path: Path) -> SweepFile:
    validator = Validator(_CODES)
    root = validator.file(load(path).root, SWEEP, "`sweep: 1`, `pipeline` and `axes`")
    axes = [_axis(str(name), value, validator) for name, value in entries(root, "axes").items()] if root else []
    if validator.problems or root is None:
        raise InputError(validator.problems)
    values = plain(root, SWEEP)
    groups = {",".join(group.plain()): group for group in _items(root.get("zip"))}
    files = [
        key for key in ("pipeline", "reference", "scene") if key in values and not is_name(values[key].split(":")[0])
    ]
    values |= {key: str(path.parent / values[key]) for key in files}
    given, minimise = root.get("set"), values.get("minimise", ())
    options = {name: values[key] for key, name in _OPTIONS.items() if key in values}
    options["minimise"] = (minimise,) if isinstance(minimise, str) else tuple(minimise)
    sampled = {key: values[key] for key in ("samples", "sampling", "seed") if key in values}
    return SweepFile(
        pipeline=values["pipeline"],
        space=Space(tuple(filter(None, axes)), tuple(map(tuple, values.get("zip", ()))), **sampled),
        options=options,
        reference=values.get("reference"),
        scene=values.get("scene"),
        size=values.get("size"),
        sets=tuple(f"{name}={value_text(value)}" for name, value in (given.items() if given else ())),
        places=entries(root, "set") | groups | entries(root, "axes"),
    )


_OPTIONS = {"metric": "metric", "frames": "frames", "repeats": "repeats", "keep": "kept", "budget": "budget"}
_OPTIONS |= {name: name for name in ("reference_noise", "reference_samples", "reference_seconds")}
"""Key to attribute of `SweepOptions`."""


def value_text(value: Value) -> str:
    plain = value.plain()
    return plain if isinstance(plain, str) else json.dumps(plain)


def _axis(path: str, given: Value, validator: Validator) -> Axis | None:
    try:
        if isinstance(given.data, str):
            return axis_of(path, given.data)
        return Axis(path, tuple(map(value_text, _items(given))))
    except ValueError as error:
        validator.report(given, _CODES.wrong, str(error))
    return None


def _items(value: Value | None) -> Sequence[Value]:
    return value.data if value is not None and isinstance(value.data, list) else ()
