"""Axes of a sweep: paths with the values they take, and the runs that these make: all combinations, or samples."""

from __future__ import annotations

import hashlib
import itertools
import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias

from rendergraph.compare.ranges import MOST_VALUES, Span, parse_range
from rendergraph.compare.sampling import Sampling, places
from rendergraph.document import parse
from rendergraph.errors import InputError, Option, Place, Problem, suggestion

if TYPE_CHECKING:
    from rendergraph.session import Pipeline

MOST_RUNS = MOST_VALUES
_LONGEST = 120
"""Characters of a run's name."""
_PAIRS = {"[": "]", "{": "}", "(": ")"}


@dataclass(frozen=True)
class Axis:
    """One path, as `-s` takes it, and what it goes through.

    Attributes:
        path: the path.
        values: YAML texts; none where it is a span.
        span: all numbers between two, of which samples are taken.
        written: how it was typed, where that is shorter than its values.
    """

    path: str
    values: tuple[str, ...]
    span: Span | None = None
    written: str = field(default="", compare=False)

    @property
    def text(self) -> str:
        """It as `-x` takes it, without the path."""
        return self.written or ",".join(self.values)

    def at(self, place: tuple[float, float, float]) -> str:
        """Its value at a place 0…1 within a stratum; each of a list has an equal part."""
        if self.span is not None:
            return self.span.text_at(*place)
        return self.values[int(place[0] * len(self.values))]


@dataclass(frozen=True)
class Space:
    """Axes, and which runs are made of them.

    Attributes:
        axes: in the order in which they were named.
        zipped: groups of paths that go through their values together, the first with the first.
        samples: how many samples are taken; None for all combinations.
        sampling: `latin`, with one sample in each of `samples` equal parts of every axis; or `random`.
        seed: of the samples.
        chosen: these runs and no others, as an optimiser asks for them.
    """

    axes: tuple[Axis, ...]
    zipped: tuple[tuple[str, ...], ...] = ()
    samples: int | None = None
    sampling: Sampling = "latin"
    seed: int = 0
    chosen: tuple[Mapping[str, str], ...] | None = field(default=None, compare=False)

    @classmethod
    def of(
        cls,
        axes: Axes,
        *,
        zipped: Sequence[Sequence[str]] = (),
        samples: int | None = None,
        sampling: Sampling = "latin",
        seed: int = 0,
    ) -> Space:
        """The same from plain Python.

        Args:
            axes: axes, texts as `-x` takes them, or paths with lists of values, or with ranges as text.
            zipped, samples, sampling, seed: the attributes.

        Raises:
            InputError: a text is no axis.
        """
        if isinstance(axes, Space):
            return axes
        if isinstance(axes, str):
            axes = [axes]
        found = [_from_python(path, values) for path, values in axes.items()] if isinstance(axes, Mapping) else axes
        return cls(tuple(map(_axis, found)), tuple(map(tuple, zipped)), samples, sampling, seed)

    @property
    def groups(self) -> list[tuple[Axis, ...]]:
        """Axes that go together, each where the first of them was named; the others alone."""
        together = {path: group for group in self.zipped for path in group}
        found: dict[tuple[str, ...], list[Axis]] = {}
        for axis in self.axes:
            found.setdefault(together.get(axis.path, (axis.path,)), []).append(axis)
        return [tuple(group) for group in found.values()]

    def runs(self) -> list[dict[str, str]]:
        """Path to value of every run: the product, the last axis fastest, or the samples; no two are equal."""
        if self.chosen is not None:
            return [dict(run) for run in self.chosen]
        if self.samples is None:
            columns = [[dict(_pairs(group, row)) for row in _rows(group)] for group in self.groups]
            return [_joined(parts) for parts in itertools.product(*columns)]
        taken = [_sampled(group, self.samples, self.sampling, self.seed) for group in self.groups]
        found = [_joined(parts) for parts in zip(*taken, strict=True)]
        return list({tuple(run.items()): run for run in found}.values())

    def count(self) -> int:
        """How many runs there are before equal samples are made one."""
        if self.chosen is not None:
            return len(self.chosen)
        if self.samples is not None:
            return self.samples
        count = 1
        for group in self.groups:
            count *= min(len(axis.values) for axis in group)
        return count

    def check(self, *, spans: bool = False) -> None:
        """Say what is wrong with it as a whole.

        Args:
            spans: they are as good as values, as for an optimiser.

        Raises:
            InputError: there is no axis, two have one path, axes cannot go together, one is a span of which no samples
                are taken, or there are too many runs.
        """
        problems = _paths(self.axes) + _together(self.axes, self.zipped)
        if self.samples is None and not spans and self.chosen is None:
            for axis in self.axes:
                if axis.span is not None:
                    ways = f"write {axis.span.text}:{'COUNT' if axis.span.log else 'STEP'}, or take --samples of it"
                    text = f"axis '{axis.path}' is all numbers in {axis.span.text}, not some of them: {ways}"
                    problems.append(Problem("RG524", text, Place(Option("-x", f"{axis.path}={axis.text}"))))
        if not problems and (count := self.count()) > MOST_RUNS:
            text = f"the axes make {count} runs, more than {MOST_RUNS}; leave out values, sweep in parts, or --samples"
            problems.append(Problem("RG524", text))
        if problems:
            raise InputError(problems)


Axes: TypeAlias = "Space | str | Sequence[Axis | str] | Mapping[str, Any]"


def parse_axis(text: str) -> Axis:
    """`ao.samples=8,16,32` or `ao.samples=8:64:8`; commas inside brackets and quotes belong to a value.

    Raises:
        ValueError: it is written in another way, in words.
    """
    path, equals, rest = text.partition("=")
    path = path.strip()
    if not equals or not path:
        raise ValueError(f"'{text}' is not PATH=VALUE,VALUE,…, as in shadows.taps=1,2,4")
    return axis_of(path, rest)


def axis_of(path: str, text: str) -> Axis:
    """The axis of a path, from what stands behind it: values and ranges, with commas between.

    Raises:
        ValueError: it is written in another way, in words.
    """
    if not text.strip():
        raise ValueError(f"axis '{path}' has no values; write {path}=VALUE,VALUE,…")
    parts = [part.strip() for part in _split(text)]
    if "" in parts:
        raise ValueError(f"axis '{path}' has an empty value in '{text}'")
    values: list[str] = []
    try:
        for part in parts:
            found = parse_range(part)
            if isinstance(found, Span):
                if len(parts) > 1:
                    raise ValueError(f"'{part}' has no values that could stand beside others; give it a third number")
                return Axis(path, (), found, part)
            values += (part,) if found is None else found
    except ValueError as error:
        raise ValueError(f"axis '{path}': {error}") from None
    for value in repeated(values):
        raise ValueError(f"axis '{path}' has the value {value} twice")
    return Axis(path, tuple(values), None, text.strip() if len(values) > len(parts) else "")


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


def repeated(values: Iterable[str]) -> list[str]:
    """The values that are there more than once."""
    return [value for value, count in Counter(values).items() if count > 1]


def _axis(given: Axis | str) -> Axis:
    if isinstance(given, Axis):
        return given
    try:
        return parse_axis(given)
    except ValueError as error:
        raise InputError(Problem("RG524", str(error))) from None


def _from_python(path: str, values: Iterable[Any] | str) -> Axis | str:
    if isinstance(values, str):
        return f"{path}={values}"
    if not isinstance(values, Iterable):
        values = [values]  # a single one
    return Axis(path, tuple(value if isinstance(value, str) else json.dumps(value) for value in values))


def _paths(axes: Sequence[Axis]) -> list[Problem]:
    problems = []
    if not axes:
        text = "the sweep has no axis; add one: -x NODE.PARAM=VALUE,VALUE"
        problems.append(Problem("RG524", text))
    for path in repeated(axis.path for axis in axes):
        problems.append(Problem("RG524", f"two axes are called '{path}'; put all values into one"))
    for axis in axes:
        if axis.span is None and not axis.values:
            problems.append(Problem("RG524", f"axis '{axis.path}' has no values"))
        for value in repeated(axis.values):
            problems.append(Problem("RG524", f"axis '{axis.path}' has the value {value} twice"))
    return problems


def _together(axes: Sequence[Axis], zipped: Sequence[Sequence[str]]) -> list[Problem]:
    """What is wrong with the groups that go together."""
    known = {axis.path: axis for axis in axes}
    found: list[tuple[Sequence[str], str]] = []
    for group in zipped:
        if missing := [path for path in group if path not in known]:
            found.append((group, f"there is no axis '{missing[0]}' to go together{suggestion(missing[0], known)}"))
            continue
        if len(group) < 2:
            found.append((group, "two axes at least go together"))
        counts = [len(known[path].values) or "all numbers" for path in group]
        if len(set(counts)) > 1:
            told = ", ".join(f"'{path}' has {count}" for path, count in zip(group, counts, strict=True))
            found.append((group, f"axes that go together have as many values each: {told}"))
    for path in repeated(path for group in zipped for path in group):
        group = next(group for group in zipped if path in group)
        found.append((group, f"axis '{path}' goes together with others once"))
    return [Problem("RG524", text, Place(Option("--zip", ",".join(group)))) for group, text in found]


def _pairs(group: Sequence[Axis], values: Sequence[str]) -> Iterable[tuple[str, str]]:
    return zip((axis.path for axis in group), values, strict=True)


def _rows(group: Sequence[Axis]) -> Iterable[tuple[str, ...]]:
    return zip(*(axis.values for axis in group), strict=True)


def _joined(parts: Iterable[Mapping[str, str]]) -> dict[str, str]:
    return {path: value for part in parts for path, value in part.items()}


def _sampled(group: Sequence[Axis], count: int, sampling: Sampling, seed: int) -> list[dict[str, str]]:
    taken = places(count, sampling, seed, ",".join(axis.path for axis in group))
    return [{axis.path: axis.at(place) for axis in group} for place in taken]


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
                problems.setdefault((problem.code, problem.message), _of_axis(problem, run))
        found.append(pipeline)
    if problems:
        raise InputError(list(problems.values()))
    return found


def _of_axis(problem: Problem, run: Mapping[str, str]) -> Problem:
    """A mistake in an assignment as one of the axis that made it, or of the run."""
    if problem.place is None:
        return problem.relocate(Place(", ".join(f"{path}={value}" for path, value in run.items())))
    setting = problem.place.option("--set")
    if setting is not None and setting.text == f"{setting.path}={run.get(setting.path)}":
        return problem.relocate(Place(Option("-x", setting.text)))
    return problem


def run_name(run: Mapping[str, str]) -> str:
    """A run's name, which is its folder's too: `ao.samples=8,shadows.type=shadow_vsm`, odd signs left out.

    A long one ends in a digest of all settings, so that it does not depend on which other runs there are.
    """
    text = ",".join(f"{path}={value}" for path, value in run.items())
    name = re.sub(r"[^A-Za-z0-9._=,+-]+", "_", text).strip("._")
    if len(name) > _LONGEST:
        name = f"{name[: _LONGEST - 9]}-{hashlib.sha256(text.encode(errors='surrogatepass')).hexdigest()[:8]}"
    return name or "run"
