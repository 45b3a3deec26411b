"""The space of a sweep: axes (paths with the values they take), and the runs they make: all combinations, or samples.

`8:64:8` and `log:0.1:10:5` list values; `8:64` and `log:0.1:10` are continuous ranges, from which samples are drawn, at
random or as a Latin hypercube (McKay, Beckman and Conover 1979).
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import random
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from rendergraph.document import parse
from rendergraph.errors import InputError, Option, Place, Problem, suggestion

if TYPE_CHECKING:
    from rendergraph.session import Pipeline

MOST_RUNS = 10_000
"""Maximum number of runs of a sweep, and of values of a range."""
RANGE_FORMS = "FIRST:LAST:STEP, log:FIRST:LAST:COUNT, or LOW:HIGH and log:LOW:HIGH for --samples"
_NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]{1,3})?"
RANGE = re.compile(rf"(log:)?({_NUMBER}):({_NUMBER})(?::({_NUMBER}))?\Z")
_RANGE_START = re.compile(rf"(?:log:|{_NUMBER}:)")
"""Text that starts like a range was meant as one."""
_INTEGER = re.compile(r"[-+]?[0-9]+\Z")
_LARGEST = Decimal("1e12")
_LONGEST_NAME = 120
_BRACKETS = {"[": "]", "{": "}", "(": ")"}

Sampling: TypeAlias = Literal["latin", "random"]
Position: TypeAlias = "tuple[float, float, float]"
"""A position 0…1 on an axis, and both ends of its stratum."""


@dataclass(frozen=True)
class Span:
    """A continuous range; both ends are included.

    Attributes:
        log: equal factors are equally likely, rather than equal differences.
        whole: whole numbers only, as when both ends are written as such.
        text: as it was written.
    """

    low: float
    high: float
    log: bool
    whole: bool
    text: str

    def at(self, position: float) -> float:
        """Return the number at a position 0…1; every whole number has an interval of width 1 around it."""
        low, high = (self.low - 0.5, self.high + 0.5) if self.whole else (self.low, self.high)
        value = low * (high / low) ** position if self.log else low + (high - low) * position
        return min(max(float(math.floor(value + 0.5)), self.low), self.high) if self.whole else value

    def text_at(self, position: Position) -> str:
        """Return the number at a position, in the fewest digits that keep it inside its stratum and close to itself."""
        value, low, high = map(self.at, position)
        if self.whole:
            return str(int(value))
        edge = 1e-6 * (high - low)  # the ends themselves are rounded
        for digits in range(3, 17):
            text = f"{value:.{digits}g}"
            if low + edge < float(text) < high - edge and abs(float(text) - value) <= (high - low) / 50:
                return text
        return repr(value)


@dataclass(frozen=True)
class Axis:
    """One path, as `-s` takes it, and its values.

    Attributes:
        values: YAML texts; empty for a continuous range.
        written: the text that was typed, where that is shorter than the values.
    """

    path: str
    values: tuple[str, ...]
    span: Span | None = None
    written: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if self.span is None and not self.values:
            raise ValueError(f"axis '{self.path}' has no values; write {self.path}=VALUE,VALUE,…")
        for value in repeated(self.values):
            raise ValueError(f"axis '{self.path}' has the value {value} twice")

    @property
    def text(self) -> str:
        return self.written or ",".join(self.values)

    def at(self, position: Position) -> str:
        """Return the value at a position; every value of a list has an equal share."""
        if self.span is not None:
            return self.span.text_at(position)
        return self.values[int(position[0] * len(self.values))]


@dataclass(frozen=True)
class Space:
    """Axes, and how runs are made of them.

    Attributes:
        axes: in the order in which they were given.
        zipped: groups of paths that step through their values together.
        samples: number of samples; None for all combinations.
        sampling: `latin`, one sample in each of `samples` equal parts of every axis; or `random`.
        seed: random seed of the samples.
        chosen: exactly these runs, as an optimiser asks for them.
        names: those of the chosen runs, if they are part of a larger space.
    """

    axes: tuple[Axis, ...]
    zipped: tuple[tuple[str, ...], ...] = ()
    samples: int | None = None
    sampling: Sampling = "latin"
    seed: int = 0
    chosen: tuple[Mapping[str, str], ...] | None = field(default=None, compare=False)
    names: tuple[str, ...] = field(default=(), compare=False)

    @classmethod
    def of(cls, axes: Axes, *, zipped: Sequence[Sequence[str]] = (), **sampling: Any) -> Space:
        """Make a space from plain Python values.

        Args:
            axes: axes, texts as `-x` takes them, or a mapping from paths to lists of values or to ranges as text.
            zipped, sampling: the attributes `zipped`, `samples`, `sampling` and `seed`.
        """
        if isinstance(axes, Space):
            return axes
        given = [axes] if isinstance(axes, str) else axes
        try:
            if isinstance(given, Mapping):
                made = [_from_python(path, values) for path, values in given.items()]
            else:
                made = [axis if isinstance(axis, Axis) else parse_axis(axis) for axis in given]
        except ValueError as error:
            raise InputError(Problem("RG524", str(error))) from None
        return cls(tuple(made), tuple(map(tuple, zipped)), **sampling)

    @property
    def groups(self) -> list[tuple[Axis, ...]]:
        """Zipped axes together, at the position of the first of them; every other axis alone."""
        together = {path: group for group in self.zipped for path in group}
        groups: dict[tuple[str, ...], list[Axis]] = {}
        for axis in self.axes:
            groups.setdefault(together.get(axis.path, (axis.path,)), []).append(axis)
        return [tuple(group) for group in groups.values()]

    def runs(self) -> list[dict[str, str]]:
        """Return path to value of every run: the product, last axis fastest, or the samples; without duplicates."""
        if self.chosen is not None:
            return [dict(run) for run in self.chosen]
        columns = [self._column(group) for group in self.groups]
        rows = itertools.product(*columns) if self.samples is None else zip(*columns, strict=True)
        runs = [{path: value for part in row for path, value in part.items()} for row in rows]
        return list({tuple(run.items()): run for run in runs}.values())

    def run_names(self) -> list[str]:
        """Return the name of every run, which no other run has."""
        return list(self.names or unique_names([run_name(run) for run in self.runs()]))

    def _column(self, group: Sequence[Axis]) -> list[dict[str, str]]:
        paths = [axis.path for axis in group]
        if self.samples is None:
            values = zip(*(axis.values for axis in group), strict=True)
            return [dict(zip(paths, row, strict=True)) for row in values]
        positions = sample_positions(self.samples, self.sampling, self.seed, ",".join(paths))
        return [{axis.path: axis.at(position) for axis in group} for position in positions]

    def count(self) -> int:
        if self.chosen is not None:
            return len(self.chosen)
        if self.samples is not None:
            return self.samples
        return math.prod(min(len(axis.values) for axis in group) for group in self.groups)

    def check(self, *, spans: bool = False) -> None:
        """Check the axes as a whole; `spans` allows continuous ranges without samples, as for an optimiser."""
        allows_spans = spans or self.samples is not None or self.chosen is not None
        problems = [
            Problem("RG524", text, Place(option) if option else None)
            for text, option in (*self._zip_mistakes(), *self._axis_mistakes(allows_spans))
        ]
        if not problems and (count := self.count()) > MOST_RUNS:
            ways = "use fewer values, split the sweep, or use --samples"
            problems.append(Problem("RG524", f"the axes make {count} runs, more than {MOST_RUNS}; {ways}"))
        if problems:
            raise InputError(problems)

    def _axis_mistakes(self, allows_spans: bool) -> Iterator[tuple[str, Option | None]]:
        if not self.axes:
            yield "the sweep has no axis; add one: -x NODE.PARAM=VALUE,VALUE", None
        for path in repeated(axis.path for axis in self.axes):
            yield f"two axes have the path '{path}'; put all values into one", None
        for axis in self.axes:
            if axis.span is not None and not allows_spans:
                step = f"{axis.span.text}:{'COUNT' if axis.span.log else 'STEP'}"
                text = f"axis '{axis.path}' is a continuous range; add a step ({step}) or use --samples"
                yield text, Option("-x", f"{axis.path}={axis.text}")

    def _zip_mistakes(self) -> Iterator[tuple[str, Option]]:
        by_path = {axis.path: axis for axis in self.axes}
        for group in self.zipped:
            option = Option("--zip", ",".join(group))
            if missing := [path for path in group if path not in by_path]:
                yield f"unknown axis '{missing[0]}'{suggestion(missing[0], by_path)}", option
                continue
            if len(group) < 2:
                yield "expected two axes or more", option
            counts = [len(by_path[path].values) or "a continuous range" for path in group]
            if len(set(counts)) > 1:
                has = ", ".join(f"'{path}' has {count}" for path, count in zip(group, counts, strict=True))
                yield f"zipped axes need the same number of values: {has}", option
        for path in repeated(path for group in self.zipped for path in group):
            group = next(group for group in self.zipped if path in group)
            yield f"axis '{path}' is zipped more than once", Option("--zip", ",".join(group))


Axes: TypeAlias = "Space | str | Sequence[Axis | str] | Mapping[str, Any]"


# --- text ------------------------------------------------------------------------------------------------------------


def parse_axis(text: str) -> Axis:
    """Parse `ao.samples=8,16,32` or `ao.samples=8:64:8`; a ValueError describes a mistake."""
    path, equals, rest = text.partition("=")
    path = path.strip()
    if not equals or not path:
        raise ValueError(f"'{text}' is not PATH=VALUE,VALUE,…, as in shadows.taps=1,2,4")
    return axis_of(path, rest)


def axis_of(path: str, text: str) -> Axis:
    """Return the axis of a path from its values and ranges, separated by commas; a ValueError describes a mistake."""
    parts = [part.strip() for part in _split(text)] if text.strip() else []
    if "" in parts:
        raise ValueError(f"axis '{path}' has an empty value in '{text}'")
    values: list[str] = []
    try:
        for part in parts:
            parsed = parse_range(part)
            if isinstance(parsed, Span):
                if len(parts) > 1:
                    raise ValueError(f"'{part}' is a continuous range, not one of several values; add a third number")
                return Axis(path, (), parsed, part)
            values += (part,) if parsed is None else parsed
    except ValueError as error:
        raise ValueError(f"axis '{path}': {error}") from None
    return Axis(path, tuple(values), None, text.strip() if len(values) > len(parts) else "")


def parse_range(text: str) -> tuple[str, ...] | Span | None:
    """Return the values of a range, or a continuous range; None where the text does not start like a range.

    Both ends are included, the last one if the steps reach it. Values are whole if all numbers are written so; of a
    logarithmic range only the two ends count, and the values are rounded. A ValueError describes a mistake.
    """
    text = text.strip()
    match = RANGE.match(text)
    if not match:
        if _RANGE_START.match(text):
            raise ValueError(f"'{text}' is an invalid range; use {RANGE_FORMS}. Quote values that contain a colon")
        return None
    log, *written = match.groups()
    first, last = Decimal(written[0]), Decimal(written[1])
    whole = all(_INTEGER.match(part) for part in written[:2])
    if max(abs(first), abs(last)) > _LARGEST:
        raise ValueError(f"'{text}': numbers must not exceed 1e12")
    if log and min(first, last) < 1 / _LARGEST:
        raise ValueError(f"'{text}': a logarithmic range must lie above 0, at 1e-12 or more")
    if written[2] is None:
        if first >= last:
            raise ValueError(f"'{text}': the first number must be the lower one")
        return Span(float(first), float(last), bool(log), whole, text)
    if log:
        return _geometric(text, written, whole)
    return _arithmetic(text, first, last, Decimal(written[2]), whole and bool(_INTEGER.match(written[2])))


def _arithmetic(text: str, first: Decimal, last: Decimal, step: Decimal, whole: bool) -> tuple[str, ...]:
    """In decimals, as they are written: 0:1:0.1 contains 0.3, not 0.30000000000000004."""
    if not step or (last - first) / step < 0:
        raise ValueError(f"'{text}': steps of {step} do not lead from {first} to {last}")
    count = int((last - first) / step) + 1
    _check_count(text, count)
    values = [first + number * step for number in range(count)]
    return tuple(str(int(value)) if whole else repr(float(value)) for value in values)


def _geometric(text: str, written: Sequence[str], whole: bool) -> tuple[str, ...]:
    if not _INTEGER.match(written[2]) or int(written[2]) < 2:
        raise ValueError(f"'{text}': the last number is the number of values, at least 2")
    first, last, count = float(written[0]), float(written[1]), int(written[2])
    _check_count(text, count)
    values = [first * (last / first) ** (number / (count - 1)) for number in range(count)]
    values[-1] = last
    if whole:
        texts = [str(math.floor(value + 0.5)) for value in values]
        if len(set(texts)) < count:
            raise ValueError(f"'{text}' has fewer than {count} whole numbers; for fractions write {written[0]}.0")
        return tuple(texts)
    for digits in range(6, 17):
        texts = [f"{value:.{digits}g}" for value in values]
        if len(set(texts)) == count:
            return tuple(texts)
    return tuple(map(repr, values))


def _check_count(text: str, count: int) -> None:
    if count > MOST_RUNS:
        raise ValueError(f"'{text}' makes {count} values, more than {MOST_RUNS}")


def _split(text: str) -> list[str]:
    """Split a list at its commas, except inside brackets and quotes."""
    parts, closing, quote = [""], [], ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "'\"":
            quote = letter
        elif letter in _BRACKETS:
            closing.append(_BRACKETS[letter])
        elif closing and letter == closing[-1]:
            closing.pop()
        elif letter == "," and not closing:
            parts.append("")
            continue
        parts[-1] += letter
    return parts


def typed(text: str) -> Any:
    """Return a value as `-s` reads its text: a number, a boolean, a list, or the text itself."""
    if text.lstrip().startswith("#"):
        return text  # a colour
    try:
        return parse(text).root.plain()
    except InputError:
        return text


def repeated(values: Iterable[str]) -> list[str]:
    return [value for value, count in Counter(values).items() if count > 1]


def _from_python(path: str, values: Iterable[Any] | str) -> Axis:
    if isinstance(values, str):
        return axis_of(path, values)
    listed = values if isinstance(values, Iterable) else [values]
    return Axis(path, tuple(value if isinstance(value, str) else json.dumps(value) for value in listed))


# --- runs ------------------------------------------------------------------------------------------------------------


def sample_positions(count: int, sampling: Sampling, seed: int, name: str) -> list[Position]:
    """Return positions on one axis, each with the two ends of its stratum.

    `latin` has exactly one position in each of `count` equal parts, in random order; `random` has them anywhere. They
    depend on seed and axis name alone: adding another axis changes none of them.
    """
    # The two methods of Random whose results do not change between versions of Python.
    source = random.Random(f"{seed} {name}")

    def uniform() -> float:
        return (source.getrandbits(32) + 0.5) / (1 << 32)  # neither end: no rounding leads out of a stratum

    if sampling == "random":
        drawn = [uniform() for _ in range(count)]
        return [(position, max(0.0, position - 1e-6), min(1.0, position + 1e-6)) for position in drawn]
    order = sorted(range(count), key=lambda _: source.random())
    return [((part + uniform()) / count, part / count, (part + 1) / count) for part in order]


def pipelines(base: Pipeline, runs: Sequence[Mapping[str, str]]) -> list[Pipeline]:
    """Return the pipeline of every run, checked; each mistake is raised once, with the first run that shows it."""
    made: list[Pipeline] = []
    problems: dict[tuple[str, str], Problem] = {}
    shared = replace(base, catalog=base.resolve().catalog)
    for run in runs:
        pipeline = shared.select(sets=(*base.selection.sets, *(f"{path}={value}" for path, value in run.items())))
        try:
            pipeline.check()
        except InputError as error:
            for problem in error.problems:
                problems.setdefault((problem.code, problem.message), _of_axis(problem, run))
        made.append(pipeline)
    if problems:
        raise InputError(list(problems.values()))
    return made


def _of_axis(problem: Problem, run: Mapping[str, str]) -> Problem:
    """Relocate a mistake in an assignment to the axis that made it, or to the run."""
    if problem.place is None:
        return problem.relocate(Place(", ".join(f"{path}={value}" for path, value in run.items())))
    setting = problem.place.option("--set")
    if setting is not None and setting.text == f"{setting.path}={run.get(setting.path)}":
        return problem.relocate(Place(Option("-x", setting.text)))
    return problem


def run_name(run: Mapping[str, str]) -> str:
    """Return a run's name, which is its folder's too: `ao.samples=8,shadows.type=shadow_vsm`, special signs replaced.

    A long one ends in a digest of all settings, so that it does not depend on the other runs.
    """
    text = ",".join(f"{path}={value}" for path, value in run.items())
    name = re.sub(r"[^A-Za-z0-9._=,+-]+", "_", text).strip("._")
    if len(name) > _LONGEST_NAME:
        digest = hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()[:8]
        name = f"{name[: _LONGEST_NAME - 9]}-{digest}"
    return name or "run"


def unique_names(names: Sequence[str]) -> list[str]:
    """Return the names with a number behind duplicates: `forward`, `forward-2`."""
    unique: dict[str, None] = {}
    given = frozenset(names)
    for name in names:
        number, candidate = 1, name
        while candidate in unique or (number > 1 and candidate in given):
            number += 1
            candidate = f"{name}-{number}"
        unique[candidate] = None
    return list(unique)
