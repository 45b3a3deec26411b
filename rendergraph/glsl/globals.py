"""The global `uniform`, `in`, `out` and `buffer` declarations of a text, with initialisers and positions. No GL.

Like `names`, this is a scanner that also finds declarations inside `#if`: which branch is compiled depends on macros
that only a pipeline knows.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TypeAlias

from msgspec import Struct, field

from rendergraph.glsl.names import TOKEN, Storage, declarators, head, statements, tokens, without_directives

_SAMPLER = r"\buniform\s+(?:(?:lowp|mediump|highp)\s+)?([iu]?sampler\w+)\s+([^;]+);"
_NAME = r"[A-Za-z_]\w*"
_BRACES = r"(?:\A|(?<=[;{}]))([^;{}]*)\{([^{}]*)\}(?=\s*([A-Za-z_]\w*)?)"

_MACRO = re.compile(r"^[ \t]*#[ \t]*define[ \t]+([A-Za-z_]\w*)[ \t]+(\d{1,9})[ \t]*$", re.MULTILINE)


class Token(str):
    __slots__ = ("at",)

    at: int

    def __new__(cls, match: re.Match[str]) -> Token:
        word = super().__new__(cls, match.group())
        word.at = match.start()
        return word


class Global(Struct, frozen=True):
    """One declaration at the top level.

    Attributes:
        storage: `uniform`, `in`, `out`, or `buffer` for a storage block.
        type, initialiser: as in the text, empty for a block and without one.
        layout: `location`, `binding`, … with the text after `=`, empty for plain words (`rgba16f`).
    """

    storage: Storage
    type: str
    name: str
    at: int
    array: bool = False
    qualifiers: frozenset[str] = frozenset()
    layout: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    initialiser: str = ""


class Globals(Struct, frozen=True):
    """The interface that a text declares.

    Attributes:
        declared: in the order of the text; a name in several branches of an `#if` occurs once.
        numbers: macros that are an integer.
        input_layout: the words of `layout(…) in;`, such as `local_size_x`.
    """

    declared: tuple[Global, ...]
    numbers: Mapping[str, int]
    input_layout: Mapping[str, tuple[str, ...]]

    def number(self, words: Sequence[str]) -> int:
        """Return the integer after a layout's `=`: a literal, or a macro; anything else is a ValueError."""
        text = "".join(words)
        if re.fullmatch(r"\d{1,9}", text):
            return int(text)
        if text not in self.numbers:
            raise ValueError(f"'{text}' is neither a number nor a macro that is one; write a number")
        return self.numbers[text]


def declared_samplers(text: str) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for kind, names in re.findall(_SAMPLER, text):
        for name in re.findall(_NAME, names):
            found.setdefault(name, []).append(kind)
    return found


def declared_blocks(text: str) -> Iterator[tuple[str, str, set[str]]]:
    """Yield each `uniform` or storage (`buffer`) block with the names of its members, or its instance."""
    for before, body, own in re.findall(_BRACES, without_directives(text)):
        words = tokens(before)
        storage = next((at for at, word in enumerate(words) if word in ("uniform", "buffer")), None)
        if storage is not None and (name := head(words[storage:]).rest[:1]):
            members = {made for one, _ in statements(tokens(body)) for made, _, _ in declarators(head(one).rest[1:])}
            yield words[storage], name[0], members | ({own} if own else set())


def globals_of(text: str) -> Globals:
    plain = without_directives(text)
    found: dict[str, Global] = {}
    input_layout: dict[str, tuple[str, ...]] = {}
    for statement, body in statements(list(map(Token, TOKEN.finditer(plain)))):
        begin = head(statement)
        storage, rest, more = begin.storage, begin.rest, (begin.qualifiers, begin.layout)
        if storage == "in" and not rest:
            input_layout |= begin.layout
        elif body is not None:
            if storage == "buffer" and rest:
                found.setdefault(rest[0], Global("buffer", "", str(rest[0]), _at(rest[0]), False, *more))
        elif storage and rest:
            for name, array, value in declarators(rest[1:]):
                initialiser = plain[_at(value[0]) : _at(value[-1]) + len(value[-1])] if value else ""
                one = Global(storage, str(rest[0]), str(name), _at(name), array, *more, initialiser)
                found.setdefault(one.name, one)
    return Globals(tuple(found.values()), {one[1]: int(one[2]) for one in _MACRO.finditer(text)}, input_layout)


def _at(word: str) -> int:
    return word.at if isinstance(word, Token) else 0


Literal: TypeAlias = "bool | int | float | tuple[float, ...]"
"""A scalar, or a vector's components."""

_NUMBER = re.compile(
    r"([-+]?)\s*(?:0[xX](?P<based>[0-9a-fA-F]+)[uU]?|(?P<whole>\d+)[uU]?"
    r"|(?P<real>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?:[fF]|lf|LF)?)\Z"
)
_VECTOR = re.compile(r"([iu]?)vec([234])\s*\(([^()]*)\)\Z")
_SWITCHES = {"true": True, "false": False}
_LARGEST = 3.4028235e38  # the largest float32
_LONGEST = 100


def literal(text: str) -> Literal:
    """Return the value of a literal; any other text is a ValueError."""
    if vector := _VECTOR.match(text):
        convert = int if vector[1] else float
        count, parts = int(vector[2]), [_number(part.strip()) for part in vector[3].split(",")]
        if len(parts) not in (1, count):
            raise ValueError(f"{vector[1]}vec{count} expected 1 or {count} numbers, got {len(parts)}")
        return tuple(convert(part) for part in (parts if len(parts) == count else parts * count))
    return _SWITCHES[text] if text in _SWITCHES else _number(text)


def _number(text: str) -> int | float:
    found = _NUMBER.match(text) if len(text) <= _LONGEST else None
    if found is None:
        raise ValueError("it is not a literal")
    if found["real"]:
        value: int | float = float(found["real"])
    else:
        value = int(found["based"], 16) if found["based"] else int(found["whole"])
    if value > _LARGEST:  # Python integers are unlimited, and no parameter is infinite
        raise ValueError("it is too large")
    return -value if found[1] == "-" else value
