"""The global `uniform`, `in`, `out` and `buffer` declarations of a text with their types, values and places. No GL.

Like `names`, a scanner that also sees what stands inside `#if`: which branch is compiled depends on macros that only a
pipeline knows.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from rendergraph.glsl.constants import Constant, constant
from rendergraph.glsl.names import statements, without_directives

Storage = Literal["uniform", "in", "out", "buffer"]

_TOKEN = re.compile(r"[A-Za-z_]\w*|\.?\d[\w.]*|[^\s\w]")
_WORD = re.compile(r"[A-Za-z_]\w*\Z")
_MACRO = re.compile(r"^[ \t]*#[ \t]*define[ \t]+([A-Za-z_]\w*)[ \t]+(\S.*)$", re.MULTILINE)
_STORAGE: tuple[Storage, ...] = ("uniform", "in", "out", "buffer")
_WORDS_BEFORE = frozenset(
    """
    const flat smooth noperspective centroid sample invariant precise coherent volatile restrict readonly writeonly
    highp mediump lowp shared patch
    """.split()  # noqa: SIM905 - a list of so many words reads best as text
)


class Word(str):
    """A token that knows where it stands."""

    __slots__ = ("at",)

    at: int
    """Its first character's number in the text."""


@dataclass(frozen=True)
class Global:
    """One declaration at the top level.

    Attributes:
        storage: `uniform`, `in`, `out`, or `buffer` for a storage block.
        type: the GLSL type, empty for a block.
        name: the variable's name, or the block's.
        at: the name's first character's number in the text.
        array: whether it is an array.
        qualifiers: `readonly`, `flat`, …
        layout: `location`, `binding`, … with the text behind `=`, empty for words alone (`rgba16f`).
        initialiser: tokens behind `=`, empty where there is none.
    """

    storage: Storage
    type: str
    name: str
    at: int
    array: bool = False
    qualifiers: frozenset[str] = frozenset()
    layout: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    initialiser: tuple[str, ...] = ()


@dataclass(frozen=True)
class Globals:
    """What a text declares towards the outside.

    Attributes:
        declared: in the order of the text; a name that stands in several branches of an `#if` is there once.
        constants: values of macros and `const` variables that are numbers.
        input_layout: the words of `layout(…) in;`, such as `local_size_x`.
    """

    declared: tuple[Global, ...]
    constants: Mapping[str, Constant]
    input_layout: Mapping[str, tuple[str, ...]]

    def value(self, words: Sequence[str]) -> Constant:
        """The value of a constant expression of this text.

        Raises:
            ValueError: it is more than numbers.
        """
        return constant(words, self.constants)


def globals_of(text: str) -> Globals:
    """What a text without comments declares."""
    constants: dict[str, Constant] = {}
    for macro in _MACRO.finditer(text):
        _learn(constants, macro[1], _TOKEN.findall(macro[2]))
    found: dict[str, Global] = {}
    input_layout: dict[str, tuple[str, ...]] = {}
    for statement, body in statements(_words(without_directives(text))):
        storage, qualifiers, layout, rest = _head(statement)
        if storage == "in" and not rest:
            input_layout |= layout
        elif body is not None:
            if storage == "buffer" and rest:
                found.setdefault(rest[0], Global("buffer", "", str(rest[0]), _at(rest[0]), False, qualifiers, layout))
        elif storage and rest:
            for name, array, value in _declarators(rest[1:]):
                one = Global(
                    storage, str(rest[0]), str(name), _at(name), array, qualifiers, layout, tuple(map(str, value))
                )
                found.setdefault(one.name, one)
        elif "const" in qualifiers and rest:
            for name, _, value in _declarators(rest[1:]):
                _learn(constants, str(name), value)
    return Globals(tuple(found.values()), constants, input_layout)


def _learn(constants: dict[str, Constant], name: str, words: Sequence[str]) -> None:
    try:
        constants[name] = constant(words, constants)
    except ValueError:
        constants.pop(name, None)


def _words(text: str) -> list[str]:
    found: list[str] = []
    for match in _TOKEN.finditer(text):
        word = Word(match.group())
        word.at = match.start()
        found.append(word)
    return found


def _at(word: str) -> int:
    return word.at if isinstance(word, Word) else 0


def _head(
    statement: list[str],
) -> tuple[Storage | None, frozenset[str], dict[str, tuple[str, ...]], list[str]]:
    """Storage, other qualifiers and layout of a statement, and the tokens behind them."""
    storage: Storage | None = None
    qualifiers: set[str] = set()
    layout: dict[str, tuple[str, ...]] = {}
    position = 0
    while position < len(statement):
        word = statement[position]
        if word == "layout" and statement[position + 1 : position + 2] == ["("]:
            end = _closing(statement, position + 1)
            layout |= _layout(statement[position + 2 : end])
            position = end + 1
            continue
        if word in _STORAGE:
            storage = next(known for known in _STORAGE if known == word)
        elif word in _WORDS_BEFORE:
            qualifiers.add(str(word))
        else:
            break
        position += 1
    return storage, frozenset(qualifiers), layout, statement[position:]


def _layout(words: list[str]) -> dict[str, tuple[str, ...]]:
    found: dict[str, tuple[str, ...]] = {}
    for part in _split_at_commas(words):
        if part:
            found[str(part[0])] = tuple(map(str, part[2:])) if part[1:2] == ["="] else ()
    return found


def _declarators(words: list[str]) -> Iterator[tuple[str, bool, list[str]]]:
    """Name, whether it is an array, and initialiser of each of `a = 1, b[3], c`."""
    array_type = words[:1] == ["["]
    if array_type:
        words = words[_closing(words, 0) + 1 :]
    if len(words) > 1 and words[1] == "(":  # a function's declaration
        return
    for part in _split_at_commas(words):
        if not part or not _WORD.match(part[0]):
            continue
        rest = part[1:]
        array = array_type
        if rest[:1] == ["["]:
            array = True
            rest = rest[_closing(rest, 0) + 1 :]
        yield part[0], array, rest[1:] if rest[:1] == ["="] else []


def _split_at_commas(words: list[str]) -> list[list[str]]:
    parts: list[list[str]] = [[]]
    depth = 0
    for word in words:
        depth += (word in "([{") - (word in ")]}")
        if word == "," and depth == 0:
            parts.append([])
        else:
            parts[-1].append(word)
    return parts


def _closing(words: list[str], start: int) -> int:
    """The position of the bracket that closes the one at `start`."""
    depth = 0
    for position in range(start, len(words)):
        depth += (words[position] in "([{") - (words[position] in ")]}")
        if depth == 0:
            return position
    return len(words)
