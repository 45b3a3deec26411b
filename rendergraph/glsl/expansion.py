"""How far a shader's macros expand, found without GL, and refused beyond a limit.

A few hundred bytes of macros that double each other fill the machine inside a driver's preprocessor. What shaders of
others hold is therefore preprocessed here first, by the rules of C with a budget; the result is thrown away. Conditions
on what only the driver knows (`#ifdef GL_EXT_…`) are tried both ways.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

from rendergraph.errors import InputError, Problem
from rendergraph.glsl.source import Origin, SourceText

MOST_TOKENS = 1_000_000
"""Words and signs that macros may make of one stage, steps on the way included."""
MOST_UNKNOWN = 6
"""Names that only the driver knows in conditions of one stage: each doubles the ways to look at."""

_TOKEN = re.compile(r"[A-Za-z_]\w*|\.?\d[\w.]*|##|&&|\|\||[<>=!]=|<<|>>|[^\s\w]")
_DIRECTIVE = re.compile(r"\s*#\s*([a-z]+)?\s*(.*)", re.DOTALL)
_DEFINE = re.compile(r"([A-Za-z_]\w*)(\(([^()]*)\))?(.*)", re.DOTALL)
_UNKNOWN = re.compile(r"\b(?:GL|__)\w*")
_KNOWN = {"__VERSION__": "450", "GL_core_profile": "1"}

_Token = tuple[str, frozenset[str]]
"""A word or sign, and the macros that made it, which are not expanded in it again."""


class _TooFar(Exception):
    """The budget is spent."""


@dataclass(frozen=True)
class _Macro:
    parameters: tuple[str, ...] | None
    body: tuple[str, ...]


def check_expansion(source: SourceText, trusted: Iterable[Path] = ()) -> None:
    """Refuse a stage whose macros expand too far.

    Args:
        source: the text of a stage.
        trusted: folders of shaders that need no looking into; a stage of nothing else is passed over.

    Raises:
        InputError: they make more than `MOST_TOKENS`, or depend on more than `MOST_UNKNOWN` names of the driver.
    """
    folders = tuple(trusted)
    files = {origin.file for origin in source.origins} - {None}
    if all(any(file.is_relative_to(folder) for folder in folders) for file in files if file is not None):
        return
    lines = list(_joined(source))
    unknown = sorted({name for text, _ in lines if _conditional(text) for name in _UNKNOWN.findall(text)} - {*_KNOWN})
    if len(unknown) > MOST_UNKNOWN:
        where = next(at for text, at in lines if _conditional(text) and unknown[0] in text)
        listed = ", ".join(unknown)
        raise _error(source, where, f"conditions ask the driver for {listed}; {MOST_UNKNOWN} such names are the limit")
    for answers in product((None, "1"), repeat=len(unknown)):
        known = {name: answer for name, answer in zip(unknown, answers, strict=True) if answer is not None}
        preprocessor = _Preprocessor({**_KNOWN, **known})
        try:
            preprocessor.run(lines)
        except (_TooFar, RecursionError):
            line = source.lines[preprocessor.at].strip()
            text = f"macros make more than {MOST_TOKENS:,} words of this line: '{line[:60]}'"
            raise _error(source, preprocessor.at, text) from None


def _error(source: SourceText, at: int, text: str) -> InputError:
    origin = source.origins[at]
    if origin.file is None:
        origin = next((o for o in source.origins[at:] if o.file is not None), Origin())
    return InputError(Problem("RG409", text, origin.place(), source.lines[at] if origin == source.origins[at] else ""))


def _joined(source: SourceText) -> Iterator[tuple[str, int]]:
    """Lines with those that end in a backslash joined to what follows; each with its position."""
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


def _conditional(text: str) -> bool:
    return re.match(r"\s*#\s*(?:if|ifdef|ifndef|elif)\b", text) is not None


@dataclass
class _Preprocessor:
    """One way through a text.

    Attributes:
        known: macros that the driver defines.
        at: the line that is expanded now.
        spent: tokens looked at so far.
    """

    known: Mapping[str, str]
    at: int = 0
    spent: int = 0
    macros: dict[str, _Macro] = field(default_factory=dict)
    _hidden: dict[tuple[frozenset[str], frozenset[str]], frozenset[str]] = field(default_factory=dict)
    _branches: list[list[bool]] = field(default_factory=list)  # each: takes lines now, has taken some, outer takes

    def run(self, lines: Iterable[tuple[str, int]]) -> None:
        self.macros = {name: _Macro(None, (value,)) for name, value in self.known.items()}
        waiting: list[str] = []
        for text, at in lines:
            directive = _DIRECTIVE.match(text)
            if directive is None:
                if self._taken:
                    if not waiting:
                        self.at = at
                    waiting += _TOKEN.findall(text)
                    if not waiting or waiting[-1] in (";", "{", "}"):  # a call's arguments may go over lines
                        self._expand(waiting)
                        waiting = []
                continue
            self._expand(waiting)
            waiting = []
            self.at = at
            self._directive(directive[1] or "", directive[2])
        self._expand(waiting)

    @property
    def _taken(self) -> bool:
        return not self._branches or self._branches[-1][0]

    def _directive(self, word: str, rest: str) -> None:
        if word in ("if", "ifdef", "ifndef"):
            outer = self._taken
            holds = outer and self._holds(word, rest)
            self._branches.append([holds, holds, outer])
        elif word in ("elif", "else") and self._branches:
            branch = self._branches[-1]
            branch[0] = branch[2] and not branch[1] and (word == "else" or self._holds("if", rest))
            branch[1] = branch[1] or branch[0]
        elif word == "endif" and self._branches:
            self._branches.pop()
        elif self._taken and word == "define" and (found := _DEFINE.match(rest)):
            parameters = None if found[2] is None else tuple(p.strip() for p in found[3].split(",") if p.strip())
            self.macros[found[1]] = _Macro(parameters, tuple(_TOKEN.findall(found[4])))
        elif self._taken and word == "undef":
            self.macros.pop(rest.strip(), None)

    def _holds(self, word: str, rest: str) -> bool:
        if word != "if":
            return (rest.strip() in self.macros) == (word == "ifdef")
        asked = re.sub(
            r"\bdefined\s*(?:\(\s*(\w+)\s*\)|(\w+))", lambda m: "1" if (m[1] or m[2]) in self.macros else "0", rest
        )
        return Condition(self._expand(_TOKEN.findall(asked))).value() != 0

    def _expand(self, words: list[str]) -> list[str]:
        if self.macros.keys().isdisjoint(words):
            return words
        return [word for word, _ in self._expanded([(word, frozenset[str]()) for word in words])]

    def _expanded(self, tokens: list[_Token]) -> list[_Token]:
        """Tokens with all macros expanded (the algorithm of Dave Prosser, X3J11/86-196)."""
        done: list[_Token] = []
        rest = tokens[::-1]
        while rest:
            self._spend(1)
            word, hidden = token = rest.pop()
            macro = self.macros.get(word)
            if macro is None or word in hidden:
                done.append(token)
            elif macro.parameters is None:
                inside = self._both(hidden, frozenset((word,)))
                rest += [(part, inside) for part in reversed(macro.body)]
            elif not rest or rest[-1][0] != "(":
                done.append(token)
            else:
                before = len(rest)
                found = _arguments(rest)
                self.spent += before - len(rest) if found else before  # looking for the end is work too
                if found is None:
                    done.append(token)
                    continue
                arguments, closing = found
                made = self._substituted(macro, arguments, self._both(hidden & closing, frozenset((word,))))
                rest += reversed(made)
        return done

    def _both(self, hidden: frozenset[str], more: frozenset[str]) -> frozenset[str]:
        """Two sets as one, made once: macros that lead to each other in a long row hide as many names in each."""
        key = hidden, more
        if key not in self._hidden:
            self._spend(len(hidden) + len(more))
            self._hidden[key] = hidden | more
        return self._hidden[key]

    def _spend(self, count: int) -> None:
        self.spent += count
        if self.spent > MOST_TOKENS:
            raise _TooFar

    def _substituted(self, macro: _Macro, arguments: list[list[_Token]], inside: frozenset[str]) -> list[_Token]:
        given = dict(zip(macro.parameters or (), arguments, strict=False))
        expanded: dict[str, list[_Token]] = {}
        made: list[_Token] = []
        paste = False
        for number, word in enumerate(macro.body):
            if word == "##":
                paste = bool(made)
                continue
            pasted = paste or macro.body[number + 1 : number + 2] == ("##",)
            if word not in given:
                parts = [(word, inside)]
            elif pasted:
                parts = given[word]
            else:
                if word not in expanded:
                    expanded[word] = self._expanded(given[word])
                parts = expanded[word]
            self._spend(len(parts))
            if paste and parts:
                made[-1] = (made[-1][0] + parts[0][0], made[-1][1] & parts[0][1])
                self._spend(len(made[-1][0]))  # a word may double as well
                parts = parts[1:]
            made += [(part, self._both(hidden, inside)) for part, hidden in parts]
            paste = False
        return made


def _arguments(rest: list[_Token]) -> tuple[list[list[_Token]], frozenset[str]] | None:
    """Takes a call's arguments off the end of reversed tokens; None, with all left, where they do not end."""
    depth = 0
    arguments: list[list[_Token]] = [[]]
    for taken, token in enumerate(reversed(rest)):
        word = token[0]
        depth += (word == "(") - (word == ")")
        if depth == 0:
            del rest[len(rest) - taken - 1 :]
            return arguments, token[1]
        if word == "," and depth == 1:
            arguments.append([])
        elif depth > 1 or word != "(":
            arguments[-1].append(token)
    return None


_BINARY: dict[str, tuple[int, Callable[[int, int], int]]] = {
    "||": (1, lambda a, b: a or b),
    "&&": (2, lambda a, b: a and b),
    "|": (3, lambda a, b: a | b),
    "^": (4, lambda a, b: a ^ b),
    "&": (5, lambda a, b: a & b),
    "==": (6, lambda a, b: a == b),
    "!=": (6, lambda a, b: a != b),
    "<": (7, lambda a, b: a < b),
    ">": (7, lambda a, b: a > b),
    "<=": (7, lambda a, b: a <= b),
    ">=": (7, lambda a, b: a >= b),
    "<<": (8, lambda a, b: a << (b & 31)),
    ">>": (8, lambda a, b: a >> (b & 31)),
    "+": (9, lambda a, b: a + b),
    "-": (9, lambda a, b: a - b),
    "*": (10, lambda a, b: a * b),
    "/": (10, lambda a, b: int(a / b) if b else 0),
    "%": (10, lambda a, b: a - b * int(a / b) if b else 0),
}


class Condition:
    """The whole number that the words after `#if` stand for; what is not understood is 0."""

    def __init__(self, words: list[str]) -> None:
        self._words = words[::-1]

    def value(self) -> int:
        """The number."""
        return self._binary(1)

    def _binary(self, least: int) -> int:
        left = self._unary()
        while self._words and (found := _BINARY.get(self._words[-1])) and found[0] >= least:
            self._words.pop()
            left = int(found[1](left, self._binary(found[0] + 1))) & 0xFFFFFFFF
            left -= (left & 0x80000000) << 1
        return left

    def _unary(self) -> int:
        word = self._words.pop() if self._words else "0"
        if word in ("!", "-", "+", "~"):
            inner = self._unary()
            return {"!": int(not inner), "-": -inner, "+": inner, "~": ~inner}[word]
        if word == "(":
            inner = self._binary(1)
            if self._words:
                self._words.pop()
            return inner
        if found := re.match(r"0[xX]([0-9a-fA-F]+)", word):
            return int(found[1], 16)
        digits = re.match(r"[0-9]{0,20}", word)[0]  # type: ignore[index]  # it matches always
        return int(digits or "0", 8 if re.fullmatch("0[0-7]+", digits) else 10)
