"""Axes of a sweep: paths with the values they take, from the command line or from a file, and their product."""

from __future__ import annotations

import itertools
import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.document import Value, load, parse
from rendergraph.errors import InputError, Place, Problem
from rendergraph.keys import Codes, Key, Names, Table, Walk, plain
from rendergraph.keys.forms import ANYTHING, TEXT, listed, shipped, version, whole
from rendergraph.read import SIZE, entries
from rendergraph.resources import shipped_pipelines, shipped_scenes

if TYPE_CHECKING:
    from rendergraph.session import Pipeline

MOST_RUNS = 10_000
MOST_MEASURED = 10_000
"""Frames of a run."""
_PAIRS = {"[": "]", "{": "}", "(": ")"}
_CODES = Codes(unknown="RG030", wrong="RG030", name="RG030", file="RG030")
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
            Names(listed(ANYTHING, "values", least=1), what="path", null=False, least=1),
            "Paths, as `-s` takes them, each with a list of values.",
            required=True,
            example="axes: {NODE.PARAM: [VALUE, VALUE]}",
        ),
        Key("reference", shipped(shipped_pipelines), "A picture or a pipeline that all runs are compared with."),
        Key("metric", TEXT, "A port, `NODE.PORT`, whose texture is measured in place of the picture."),
        Key("scene", shipped(shipped_scenes), "What is drawn, in place of the pipeline's own."),
        SIZE,
        Key("set", Names(ANYTHING, what="path"), "Paths to values that hold for all runs."),
        Key("frames", whole(1, MOST_MEASURED), "How many frames are measured."),
    ),
)
"""What a sweep's file holds."""


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
        metric: the port that is measured.
        size: width and height.
        sets: `PATH=VALUE` texts.
        frames: how many are measured.
        places: what stands under each path, of axes and of `set`.
    """

    pipeline: str
    axes: tuple[Axis, ...]
    reference: str | None = None
    scene: str | None = None
    metric: str | None = None
    size: tuple[int, int] | None = None
    sets: tuple[str, ...] = ()
    frames: int | None = None
    places: Mapping[str, Value] = field(default_factory=dict)

    def placed(self, error: InputError) -> InputError:
        """Mistakes in what the file says of paths, at its own lines; others as they are."""
        return InputError([self._placed(problem) for problem in error.problems])

    def _placed(self, problem: Problem) -> Problem:
        where = problem.place.file if problem.place else ""
        path = where.removeprefix("-x ").removeprefix("--set ").partition("=")[0]
        value = self.places.get(path) if where.startswith(("-x ", "--set ")) else None
        return problem if value is None else value.problem(problem.code, problem.text, key=True)


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
    for value in _repeated(values):
        raise ValueError(f"axis '{path}' has the value {value} twice")
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


def typed(text: str) -> Any:
    """A value as `-s` reads its text: a number, a switch, a list, or the text itself."""
    if text.lstrip().startswith("#"):
        return text  # a colour
    try:
        return parse(text).root.plain()
    except InputError:
        return text


def _repeated(values: Iterable[str]) -> list[str]:
    """The values that are there more than once."""
    return [value for value, count in Counter(values).items() if count > 1]


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
    for path in _repeated(paths):
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
    shared = replace(base, catalog=base.resolve().catalog)
    for run in runs:
        pipeline = shared.select(sets=(*base.selection.sets, *(f"{path}={value}" for path, value in run.items())))
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
    walk = Walk(_CODES)
    root = walk.root(load(path).root, SWEEP, "`sweep: 1`, `pipeline` and `axes`")
    axes = [_axis(str(name), listed, walk) for name, listed in entries(root, "axes").items()] if root else []
    if walk.problems or root is None:
        raise InputError(walk.problems)
    said = plain(root, SWEEP)
    said |= {key: _beside(path, said[key]) for key in ("pipeline", "reference", "scene") if key in said}
    given = root.get("set")
    return SweepFile(
        said["pipeline"],
        tuple(axes),
        said.get("reference"),
        said.get("scene"),
        said.get("metric"),
        said.get("size"),
        tuple(f"{name}={value_text(value)}" for name, value in (given.items() if given else ())),
        said.get("frames"),
        entries(root, "set") | entries(root, "axes"),
    )


def value_text(value: Value) -> str:
    """A value as the text that `-s` would take for it."""
    plain = value.plain()
    return plain if isinstance(plain, str) else json.dumps(plain)


def _axis(path: str, listed: Value, walk: Walk) -> Axis:
    values = [value_text(value) for value in listed.data] if isinstance(listed.data, list) else []
    for value in _repeated(values):
        walk.say(listed, _CODES.wrong, f"axis '{path}' has the value {value} twice")
    return Axis(path, tuple(values))


def _beside(file: Path, name: str) -> str:
    """A name as the command line takes it: shipped ones as they are, paths joined to the file's folder."""
    if re.fullmatch(r"[A-Za-z0-9_-]+", name):
        return name
    return str(file.parent / name)
