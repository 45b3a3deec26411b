"""An upper bound on the expansion of a shader's macros, computed without expanding them.

A few hundred bytes of macros that double each other exhaust the machine inside a driver's preprocessor. So the maximum
number of words that one use of each macro can produce is computed from its body, after the macros that it refers to;
arguments of a call count as often as the result repeats them. Conditions are ignored: all text counts, and the worst of
several definitions of a name. Real shaders stay far below the limit.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Collection, Iterator, Mapping, Sequence, Set
from functools import lru_cache
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from math import prod

from msgspec import Struct
from msgspec.structs import astuple

from rendergraph.errors import InputError, Problem
from rendergraph.glsl.source import Origin, SourceText

MOST_WORDS = 1_000_000  # words and signs that the macros of one stage may produce
MOST_NESTED = 256  # macros inside each other, by definitions and by calls in arguments

_ENOUGH = MOST_WORDS + 1
_ROUNDS = 16
_TOKEN = re.compile(r"[A-Za-z_]\w*|\.?\d[\w.]*|##|[^\s\w]")
_DIRECTIVE = re.compile(r"\s*#\s*([a-z]*)\s*(.*)", re.DOTALL)
_DEFINE = re.compile(r"([A-Za-z_]\w*)(\(([^()]*)\))?(.*)", re.DOTALL)


def check_expansion(source: SourceText) -> None:
    """Refuse a stage whose macros may produce more than `MOST_WORDS` or nest deeper than `MOST_NESTED` (RG409)."""
    definitions, runs = _parts(source)
    macros = _Macros(definitions, [words for words, _ in runs])
    total = 0
    for words, lines in runs:
        if macros.names.isdisjoint(words):
            continue
        for at, (growth, factor, around) in zip(lines, macros.walk(words), strict=True):
            total += growth.words * factor
            if total > MOST_WORDS:
                raise _error(source, at, f"macros may expand this line to more than {MOST_WORDS:,} words")
            if around + growth.depth > MOST_NESTED:
                raise _error(source, at, f"more than {MOST_NESTED} macros are nested in this line")


def _error(source: SourceText, at: int, text: str) -> InputError:
    text = f"{text}: '{source.lines[at].strip()[:60]}'"
    origin = source.origins[at]
    if origin.file is None:
        origin = next((o for o in source.origins[at:] if o.file is not None), Origin())
    return InputError(Problem("RG409", text, origin.place(), source.lines[at] if origin == source.origins[at] else ""))


class _Definition(Struct, frozen=True):
    name: str
    parameters: tuple[str, ...] | None
    body: tuple[str, ...]


def _parts(source: SourceText) -> tuple[list[_Definition], list[tuple[list[str], list[int]]]]:
    """Return all definitions, and the words that are expanded (between directives, in conditions) with their lines."""
    definitions: list[_Definition] = []
    runs: list[tuple[list[str], list[int]]] = [([], [])]
    for text, at in _joined(source):
        directive = _DIRECTIVE.match(text) if "#" in text else None
        if directive is not None and directive[1] == "define" and (found := _DEFINE.match(directive[2])):
            parameters = None if found[2] is None else tuple(p.strip() for p in found[3].split(",") if p.strip())
            definitions.append(_Definition(found[1], parameters, tuple(_TOKEN.findall(found[4]))))
        words = _tokens(text) if directive is None else ()
        if directive is not None:
            runs.append(([], []))
            words = _tokens(directive[2]) if directive[1] in ("if", "elif") else ()
        runs[-1][0].extend(words)
        runs[-1][1].extend([at] * len(words))
    return definitions, runs


@lru_cache(8192)
def _tokens(line: str) -> tuple[str, ...]:
    """Return the words and signs of a line; cached, because shaders of variants and projects share most lines."""
    return tuple(_TOKEN.findall(line))


def _joined(source: SourceText) -> Iterator[tuple[str, int]]:
    """Yield lines with their continuations joined, each with its position."""
    text, start = "", 0
    for at, line in enumerate(source.lines):
        start = start if text else at
        if line.endswith("\\"):
            text += line[:-1]
            continue
        yield text + line, start
        text = ""
    if text:
        yield text, start


class _Growth(Struct, frozen=True):
    """An upper bound on the result of one use of a macro.

    Attributes:
        words: words, not counting its arguments.
        times: how often a word of its arguments is repeated.
        depth: macros nested inside each other.
    """

    words: int = 1
    times: int = 1
    depth: int = 0


_PLAIN = _Growth()


class _Macros:
    """All macros of a stage, and the growth of a use of each.

    Attributes:
        loose: how often a word in brackets is repeated if a macro passed on by name, without arguments, may be called
            with them; 1 without such a macro.
    """

    def __init__(self, definitions: Sequence[_Definition], runs: Sequence[Sequence[str]]) -> None:
        self.loose = 1
        self._growths: dict[str, _Growth] = {}
        self._called = {one.name for one in definitions if one.parameters is not None}
        self._definitions: dict[str, list[_Definition]] = {}
        for one in definitions:
            self._definitions.setdefault(one.name, []).append(one)
        texts = [*runs, *(one.body for one in definitions)]
        known = set().union(*texts)
        joined = [name for name in self._definitions if _joins(name, known)] if "##" in known else []
        self._pasted = {
            name: {made for one in alternatives for made in joined if _pastes(one, made)} - {name}
            for name, alternatives in self._definitions.items()
        }
        calling = [text for text in texts if not self._called.isdisjoint(text)]
        pairs = (pair for text in calling for pair in pairwise((*text, "")))
        handed = {word for word, following in pairs if word in self._called and following != "("}
        handed |= {name for names in self._pasted.values() for name in names & self._called}
        self.names = self._definitions.keys()
        before, core, behind = self._order()
        for rounds_left in range(_ROUNDS, -1, -1):
            for name in before:
                self._growths[name] = self._growth(name)
            self._weigh_core(core)
            for name in behind:
                self._growths[name] = self._growth(name)
            loose = max((self._growths[name].times for name in handed), default=1)
            if loose == self.loose or _ROUNDS - rounds_left > len(handed):
                return  # each macro is called once per path, so rounds cannot exceed names
            self.loose = loose if rounds_left else _ENOUGH

    def walk(self, words: Sequence[str], inside: _Definition | None = None) -> Iterator[tuple[_Growth, int, int]]:
        """Yield for each word its growth, its repetitions, and the number of calls around it."""
        own = inside.name if inside is not None else ""  # a macro is not expanded inside itself
        brackets = [(1, 0)]
        for before, word in pairwise(("", *words)):
            factor, around = brackets[-1]
            if word == "(":
                called = before in self._called and before != own
                plain = inside is None and around == 0 and before not in self._definitions and before != ")"
                times = max(self._growths[before].times if called else 1, 1 if plain else self.loose)
                brackets.append((min(_ENOUGH, factor * times), around + called))
            elif word == ")" and len(brackets) > 1:
                brackets.pop()
            yield self._growths.get(word, _PLAIN) if word != own else _PLAIN, factor, around

    def _growth(self, name: str) -> _Growth:
        return _worst([self._growth_of(one) for one in self._definitions[name]])

    def _growth_of(self, one: _Definition) -> _Growth:
        back = dict.fromkeys(one.parameters or (), 0)
        pasted = [self._growths[name] for name in self._pasted[one.name]]
        words = depth = left_open = 0
        for word, (growth, factor, around) in zip(one.body, self.walk(one.body, one), strict=True):
            if pasted:  # could be any of its words
                growth = _worst([growth, *pasted])
            if word in back:
                back[word] += factor
            words += growth.words * factor
            depth = max(depth, around + growth.depth)
            left_open = max(0, left_open + (word == "(") - (word == ")"))
        if left_open:  # text after the macro would become arguments
            words = _ENOUGH
        return _Growth(min(_ENOUGH, 1 + words), min(_ENOUGH, max([1, *back.values()])), depth + 1)

    def _weigh_core(self, names: Sequence[str]) -> None:
        """Weigh macros that refer to each other: each expands once on any path, so references multiply at most."""
        self._growths |= dict.fromkeys(names, _PLAIN)
        own = [self._growth(name) for name in names]
        bodies = [one for name in names for one in self._definitions[name]]
        ways = min(_ENOUGH, prod(max(1, self._references(one, {*names})) for one in bodies))
        words = min(_ENOUGH, ways * sum(growth.words for growth in own))
        times = min(_ENOUGH, ways * prod(growth.times for growth in own))
        self._growths |= dict.fromkeys(names, _Growth(words, times, sum(growth.depth for growth in own)))

    def _references(self, one: _Definition, names: Set[str]) -> int:
        walked = zip(one.body, self.walk(one.body, one), strict=True)
        pastes = not names.isdisjoint(self._pasted[one.name])
        return sum(factor for word, (_, factor, _) in walked if pastes or word in names)

    def _order(self) -> tuple[list[str], list[str], list[str]]:
        """Return names in topological order; names on and between cycles; names that refer to those."""
        needs: dict[str, set[str]] = {}
        for name, alternatives in self._definitions.items():
            words = {word for one in alternatives for word in one.body}
            needs[name] = (words & self._definitions.keys() | self._pasted[name]) - {name}
        before = _sorted(needs)
        rest = needs.keys() - before
        reverse: dict[str, set[str]] = {name: set() for name in rest}
        for name in rest:
            for other in needs[name] & rest:
                reverse[other].add(name)
        behind = _sorted(reverse)[::-1]
        return before, sorted(rest - {*behind}), behind


def _worst(growths: Sequence[_Growth]) -> _Growth:
    return _Growth(*map(max, zip(*map(astuple, growths), strict=True)))


def _sorted(needs: Mapping[str, Set[str]]) -> list[str]:
    """Return names in topological order, without names on cycles and those that need them."""
    sorter = TopologicalSorter(needs)
    with contextlib.suppress(CycleError):  # it has then yielded all names that it could
        sorter.prepare()
    found: list[str] = []
    while ready := sorter.get_ready():
        found += ready
        sorter.done(*ready)
    return found


def _pastes(one: _Definition, name: str) -> bool:
    """Whether a body may create a name with `##`, from its own words and parameters."""
    around = zip(one.body, one.body[1:], one.body[2:], strict=False)
    return any(
        sign == "##" and all(part in name or part in (one.parameters or ()) for part in (left, right))
        for left, sign, right in around
    )


def _joins(name: str, known: Collection[str]) -> bool:
    """Whether a name is a concatenation of two or more known words."""
    ends = {0}
    for end in range(1, len(name) + 1):
        if any(name[start:end] in known and (start, end) != (0, len(name)) for start in ends):
            ends.add(end)
    return len(name) in ends
