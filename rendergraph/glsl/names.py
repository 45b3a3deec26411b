"""What a piece of GLSL declares, and giving its names a prefix. A scanner, not a parser: it looks at the top level."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Literal, TypeAlias

from msgspec import Struct, field

Storage: TypeAlias = Literal["uniform", "in", "out", "buffer"]

TOKEN = re.compile(r"[A-Za-z_]\w*|\.?\d[\w.]*|[^\s\w]")
"""A word, a number or a sign."""

_WORD = re.compile(r"[A-Za-z_]\w*\Z")
_STORAGE: dict[str, Storage] = {"uniform": "uniform", "in": "in", "out": "out", "buffer": "buffer"}
_QUALIFIERS = frozenset(
    [
        "const",
        "inout",
        "shared",
        "flat",
        "smooth",
        "noperspective",
        "centroid",
        "sample",
        "patch",
        "invariant",
        "precise",
        "coherent",
        "volatile",
        "restrict",
        "readonly",
        "writeonly",
        "highp",
        "mediump",
        "lowp",
        "subroutine",
    ]
)
_DIRECTIVE = re.compile(r"^[ \t]*#(?:\\\n|[^\n])*", re.MULTILINE)
_MEMBERS = re.compile(
    r"\bstruct\s+\w+\s*\{([^{}]*)\}|\b(?:uniform|buffer|in|out)\s+\w+\s*\{([^{}]*)\}\s*[A-Za-z_]\w*\s*(?:\[[^\]]*\])?\s*;"
)
_DEFINE = re.compile(r"^\s*#\s*define\s+([A-Za-z_]\w*)", re.MULTILINE)
_OPENS = re.compile(r"\s*\(")
_CLOSES = {"(": ")", "[": "]", "{": "}"}


class Head(Struct, frozen=True):
    """How a statement begins, and the tokens behind that.

    Attributes:
        storage: the storage qualifier; None where there is none.
        qualifiers: the others: `readonly`, `flat`, …
        layout: `location`, `binding`, … with the tokens behind `=`, none for words alone (`rgba16f`).
        rest: from the type on.
    """

    storage: Storage | None
    qualifiers: frozenset[str]
    rest: Sequence[str]
    layout: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def tokens(text: str) -> list[str]:
    """Words, numbers and signs of a text without comments."""
    return TOKEN.findall(text)


def without_directives(text: str) -> str:
    """The text with preprocessor lines (and what continues them) blanked out, every character where it was."""
    return _DIRECTIVE.sub(lambda match: blank(match.group()), text)


def blank(text: str) -> str:
    """As many blanks, in as many lines."""
    return "\n".join(" " * len(line) for line in text.split("\n"))


def declared(text: str) -> set[str]:
    """All names a text declares at its top level, macros included, whatever `#if` they stand in."""
    found = set(_DEFINE.findall(text))
    for statement, body in statements(tokens(without_directives(text))):
        found |= set(_declared_by(head(statement).rest, body))
    return {name for name in found if not name.startswith("gl_")}


@lru_cache(maxsize=1024)
def calls(text: str, function: str) -> bool:
    """Whether a text without comments calls a function it does not declare itself."""
    places = [at for at in _places(text, function) if text[at - 1 : at] != "."]
    places = [at for at in places if _OPENS.match(text, at + len(function))]
    if not any(_may_be_type(_before(text, at)) for at in places):
        return bool(places)
    return all(function_of(head(one).rest) != function for one, _ in statements(tokens(without_directives(text))))


def mentions(text: str, name: str) -> bool:
    """Whether a name stands in a text as a whole word."""
    return next(_places(text, name), None) is not None


def _places(text: str, name: str) -> Iterator[int]:
    """Where a name stands as a whole word. Names are many; to compile an expression takes a millisecond."""
    at = text.find(name)
    while at >= 0:
        around = text[at - 1 : at] + text[at + len(name) : at + len(name) + 1]
        if not any(letter == "_" or letter.isalnum() for letter in around):
            yield at
        at = text.find(name, at + 1)


def _before(text: str, at: int) -> str:
    """The word or the sign before a place."""
    while at and text[at - 1].isspace():
        at -= 1
    begin = at
    while begin and (text[begin - 1] == "_" or text[begin - 1].isalnum()):
        begin -= 1
    return text[begin:at] or text[at - 1 : at]


def _may_be_type(before: str) -> bool:
    """Whether what stands before a function's name may be the type of its declaration, as in `float[2] f()`."""
    return before not in ("return", "else") and (before[-1:] in ("_", "]") or before[-1:].isalnum())


def renamed(text: str, rename: Callable[[str], str]) -> str:
    """A text without comments with its names replaced; members after a dot and members of structs stay."""
    kept = _member_positions(text)

    def replace(match: re.Match[str]) -> str:
        return match.group() if match.start() in kept else rename(match.group())

    return re.sub(r"(?<![\w.])[A-Za-z_]\w*", replace, text)


# --- scanning --------------------------------------------------------------------------------------------------------


def statements(words: Sequence[str]) -> Iterator[tuple[list[str], Sequence[str] | None]]:
    """Top-level statements, each with the tokens of its braces where it has any.

    The tokens after the braces of a block or struct (`} name;`) are appended to the statement after a `}`.
    """
    statement: list[str] = []
    position = 0
    while position < len(words):
        word = words[position]
        if word == ";":
            if statement:
                yield statement, None
            statement = []
        elif word == "{" and "=" not in statement:
            end = closing(words, position)
            body = words[position + 1 : end]
            if statement and statement[-1] == ")":  # a function's body ends the statement
                yield statement, body
            else:
                stop = end + 1
                while stop < len(words) and words[stop] != ";":
                    stop += 1
                yield [*statement, "}", *words[end + 1 : stop]], body
                end = stop
            statement, position = [], end
        else:
            statement.append(word)
        position += 1


def head(statement: Sequence[str]) -> Head:
    """The qualifiers and layouts that a statement begins with, and what follows."""
    storage: Storage | None = None
    qualifiers: set[str] = set()
    layout: dict[str, tuple[str, ...]] = {}
    position = 0
    while position < len(statement):
        word = statement[position]
        if word == "layout" and statement[position + 1 : position + 2] == ["("]:
            end = closing(statement, position + 1)
            for part in _split_at_commas(statement[position + 2 : end]):
                if part:
                    layout[str(part[0])] = tuple(map(str, part[2:])) if part[1:2] == ["="] else ()
            position = end
        elif word in _STORAGE:
            storage = _STORAGE[word]
        elif word in _QUALIFIERS:
            qualifiers.add(str(word))
        else:
            break
        position += 1
    return Head(storage, frozenset(qualifiers), statement[position:], layout)


def declarators(words: Sequence[str]) -> Iterator[tuple[str, bool, Sequence[str]]]:
    """Name, whether it is an array, and initialiser of each of `a = 1, b[3], c`, the words behind a type."""
    array_type = words[:1] == ["["]
    if array_type:
        words = words[closing(words, 0) + 1 :]
    if words[1:2] == ["("]:  # a function's declaration
        return
    for part in _split_at_commas(words):
        if not part or not _WORD.match(part[0]):
            continue
        rest = part[1:]
        array = array_type
        if rest[:1] == ["["]:
            array = True
            rest = rest[closing(rest, 0) + 1 :]
        yield part[0], array, rest[1:] if rest[:1] == ["="] else []


def closing(words: Sequence[str], start: int) -> int:
    """The position of the bracket that closes the one at `start`; brackets of other kinds may stand in branches."""
    opens, closes = words[start], _CLOSES[words[start]]
    depth = 0
    for position in range(start, len(words)):
        depth += (words[position] == opens) - (words[position] == closes)
        if depth == 0:
            return position
    return len(words)


def _split_at_commas(words: Sequence[str]) -> list[list[str]]:
    parts: list[list[str]] = [[]]
    depth = 0
    for word in words:
        depth += (word in "([{") - (word in ")]}")
        if word == "," and depth == 0:
            parts.append([])
        else:
            parts[-1].append(word)
    return parts


def function_of(rest: Sequence[str]) -> str:
    """The function that a statement declares or defines; empty where it is something else."""
    names = rest[closing(rest, 1) + 1 :] if rest[1:2] == ["["] else rest[1:]
    return names[0] if names[1:2] == ["("] and _WORD.match(names[0]) else ""


def _declared_by(rest: Sequence[str], body: Sequence[str] | None) -> Iterator[str]:
    """The names that a statement declares, from its type on."""
    if not rest or rest[0] == "precision":
        return
    if function := function_of(rest):
        yield function
    elif body is None or "}" not in rest:
        yield from (name for name, _, _ in declarators(rest[1:]))
    else:
        is_struct = rest[0] == "struct"
        yield rest[1] if is_struct else rest[0]
        own = [name for name, _, _ in declarators(rest[rest.index("}") + 1 :])]
        yield from own
        if not own and not is_struct:  # members of a block without a name of its own
            for member, _ in statements(body):
                yield from (name for name, _, _ in declarators(head(member).rest[1:]))


def _member_positions(text: str) -> set[int]:
    """Where the members of structs and of blocks with an instance name are declared."""
    kept: set[int] = set()
    for match in _MEMBERS.finditer(without_directives(text)):
        group = 1 if match[1] is not None else 2
        for member in re.finditer(r"(?<!\[)\b([A-Za-z_]\w*)\s*(?=[,;\[])", match[group]):
            kept.add(match.start(group) + member.start())
    return kept
