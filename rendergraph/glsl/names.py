"""A scanner, not a parser, for GLSL's top-level declarations; and renaming."""

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
    re.findall(
        r"\w+",
        """const inout shared flat smooth noperspective centroid sample patch invariant precise coherent volatile
        restrict readonly writeonly highp mediump lowp subroutine""",
    )
)
_DIRECTIVE = re.compile(r"^[ \t]*#(?:\\\n|[^\n])*", re.MULTILINE)
_MEMBERS = re.compile(
    r"\bstruct\s+\w+\s*\{([^{}]*)\}|\b(?:uniform|buffer|in|out)\s+\w+\s*\{([^{}]*)\}\s*[A-Za-z_]\w*\s*(?:\[[^\]]*\])?\s*;"
)
_DEFINE = re.compile(r"^\s*#\s*define\s+([A-Za-z_]\w*)", re.MULTILINE)
_OPENS = re.compile(r"\s*\(")
_CLOSES = {"(": ")", "[": "]", "{": "}"}


class Head(Struct, frozen=True):
    """How a statement begins, and the remaining tokens.

    Attributes:
        qualifiers: all but the storage qualifier: `readonly`, `flat`, …
        layout: `location`, `binding`, … with the tokens after `=`, none for plain words (`rgba16f`).
    """

    storage: Storage | None
    qualifiers: frozenset[str]
    rest: Sequence[str]
    layout: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def tokens(text: str) -> list[str]:
    """Return words, numbers and signs of a text without comments."""
    return TOKEN.findall(text)


def without_directives(text: str) -> str:
    """Blank out preprocessor lines and their continuations; every other character keeps its position."""
    return _DIRECTIVE.sub(lambda match: blank(match.group()), text)


def blank(text: str) -> str:
    """Return as many blanks, on as many lines."""
    return "\n".join(" " * len(line) for line in text.split("\n"))


def declared(text: str) -> set[str]:
    """Return all names that a text declares at its top level, macros included, in every branch of `#if`."""
    found = set(_DEFINE.findall(text))
    for statement, body in statements(tokens(without_directives(text))):
        found |= set(_declared_by(head(statement).rest, body))
    return {name for name in found if not name.startswith("gl_")}


@lru_cache(maxsize=1024)
def calls(text: str, function: str) -> bool:
    """Whether a text without comments calls a function that it does not declare itself."""
    places = [at for at in _places(text, function) if text[at - 1 : at] != "."]
    places = [at for at in places if _OPENS.match(text, at + len(function))]
    if not any(_may_be_type(_before(text, at)) for at in places):
        return bool(places)
    return all(function_of(head(one).rest) != function for one, _ in statements(tokens(without_directives(text))))


def mentions(text: str, name: str) -> bool:
    return next(_places(text, name), None) is not None


def _places(text: str, name: str) -> Iterator[int]:
    """Yield where a name occurs as a whole word, without a regular expression: compiling one takes a millisecond."""
    at = text.find(name)
    while at >= 0:
        around = text[at - 1 : at] + text[at + len(name) : at + len(name) + 1]
        if not any(letter == "_" or letter.isalnum() for letter in around):
            yield at
        at = text.find(name, at + 1)


def _before(text: str, at: int) -> str:
    while at and text[at - 1].isspace():
        at -= 1
    begin = at
    while begin and (text[begin - 1] == "_" or text[begin - 1].isalnum()):
        begin -= 1
    return text[begin:at] or text[at - 1 : at]


def _may_be_type(before: str) -> bool:
    """Whether the text before a function's name may be its return type, as in `float[2] f()`."""
    return before not in ("return", "else") and (before[-1:] in ("_", "]") or before[-1:].isalnum())


def renamed(text: str, rename: Callable[[str], str]) -> str:
    """Rename in a text without comments; members after a dot and members of structs keep their names."""
    members = _member_positions(text)

    def replace(match: re.Match[str]) -> str:
        return match.group() if match.start() in members else rename(match.group())

    return re.sub(r"(?<![\w.])[A-Za-z_]\w*", replace, text)


def statements(words: Sequence[str]) -> Iterator[tuple[list[str], Sequence[str] | None]]:
    """Yield top-level statements, each with the tokens inside its braces, if any.

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
    """Return the qualifiers and layouts at the beginning of a statement, and the rest."""
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
    """Yield name, whether it is an array, and initialiser of each of `a = 1, b[3], c`: the tokens after a type."""
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
    """Return where the bracket at `start` is closed; brackets of other kinds may not match because of `#if`."""
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
    """Return the function that a statement declares or defines; empty for anything else."""
    names = rest[closing(rest, 1) + 1 :] if rest[1:2] == ["["] else rest[1:]
    return names[0] if names[1:2] == ["("] and _WORD.match(names[0]) else ""


def _declared_by(rest: Sequence[str], body: Sequence[str] | None) -> Iterator[str]:
    if not rest or rest[0] == "precision":
        return
    if function := function_of(rest):
        yield function
    elif body is None or "}" not in rest:
        yield from (name for name, _, _ in declarators(rest[1:]))
    else:
        is_struct = rest[0] == "struct"
        yield rest[1] if is_struct else rest[0]
        instances = [name for name, _, _ in declarators(rest[rest.index("}") + 1 :])]
        yield from instances
        if not instances and not is_struct:  # members of a block without a name of its own
            for member, _ in statements(body):
                yield from (name for name, _, _ in declarators(head(member).rest[1:]))


def _member_positions(text: str) -> set[int]:
    """Return where the members of structs and of blocks with an instance name are declared."""
    positions: set[int] = set()
    for match in _MEMBERS.finditer(without_directives(text)):
        group = 1 if match[1] is not None else 2
        for member in re.finditer(r"(?<!\[)\b([A-Za-z_]\w*)\s*(?=[,;\[])", match[group]):
            positions.add(match.start(group) + member.start())
    return positions
