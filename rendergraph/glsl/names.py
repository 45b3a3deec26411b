"""A scanner, not a parser, for the names that GLSL declares at its top level and that `main` reaches; and renaming."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Literal, TypeAlias

from msgspec import Struct, field

Storage: TypeAlias = Literal["uniform", "in", "out", "buffer"]

TOKEN = re.compile(r"[A-Za-z_]\w*|\.?\d[\w.]*|[^\s\w]")
"""A word, a number or a sign."""
tokens: Callable[[str], list[str]] = TOKEN.findall
"""Returns words, numbers and signs of a text without comments."""

_WORD = re.compile(r"[A-Za-z_]\w*\Z")
_STORAGE: dict[str, Storage] = {"uniform": "uniform", "in": "in", "out": "out", "buffer": "buffer"}
_QUALIFIERS = frozenset(
    """const inout shared flat smooth noperspective centroid sample patch invariant precise coherent volatile
    restrict readonly writeonly highp mediump lowp subroutine""".split()  # noqa: SIM905 - reads best as text
)
_DIRECTIVE = re.compile(r"^[ \t]*#(?:\\\n|[^\n])*", re.MULTILINE)
_MEMBERS = re.compile(
    r"\bstruct\s+\w+\s*\{([^{}]*)\}|\b(?:uniform|buffer|in|out)\s+\w+\s*\{([^{}]*)\}\s*[A-Za-z_]\w*\s*(?:\[[^\]]*\])?\s*;"
)
_DEFINE = re.compile(r"^\s*#\s*define\s+([A-Za-z_]\w*)", re.MULTILINE)
_CONDITION_LINE = re.compile(r"\s*#\s*([a-z]+)\s*(.*)")
_DEFINITION = re.compile(r"([A-Za-z_]\w*)(?:\(([^()]*)\))?(.*)")
_DEFINED = re.compile(r"(!?)\s*defined\s*\(?\s*(\w+)\s*\)?\s*\Z")
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


# --- what main reaches ------------------------------------------------------------------------------------------------


def reachable_names(text: str, *, certain: bool = False) -> set[str]:
    """Return the names in `main` of a text without comments and in all that it uses; members after a dot are ignored.

    Branches of `#ifdef` follow the text's own macros. For other conditions every branch counts, or none if `certain`
    asks only for code that is compiled in any case.
    """
    uses: dict[str, list[Sequence[str]]] = {}
    words = tokens("\n".join(_taken(text, uses, certain)))
    if "##" in text:  # pasted names are not known
        return _names(words).union(*(_names(part) for parts in uses.values() for part in parts))
    macros, waiting = set(uses), ["main"]
    for statement, body in statements(words):
        waiting += macros.intersection(statement)  # a macro between functions may expand to one
        begin = head(statement)
        if body is not None and statement[-1:] == [")"]:
            for name, after in pairwise(statement):
                if after == "(":  # after such a macro, the first name is not the function's
                    uses.setdefault(name, []).extend([statement, body])
        elif body is None and begin.rest:
            for one, _, value in declarators(begin.rest[1:]):
                uses.setdefault(one, []).append(value)
    found: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            for part in uses.get(name, ()):
                waiting += _names(part)
    return found


def compiled_text(text: str, *, certain: bool = False) -> str:
    """Return the compiled lines of a text, as far as its own macros decide, without directives."""
    return "\n".join(_taken(text, {}, certain))


def _taken(text: str, uses: dict[str, list[Sequence[str]]], certain: bool) -> Iterator[str]:
    """Yield the lines that are compiled, without directives; the words of macros go to `uses`."""
    macros: set[str] = set()
    branches: list[tuple[bool, bool | None, bool]] = []  # taken: outer, this (None: unknown), earlier
    for line in text.replace("\\\n", " ").split("\n"):
        directive = _CONDITION_LINE.match(line)
        outer, holds, _ = branches[-1] if branches else (True, True, True)
        taken = outer and (holds is True if certain else holds is not False)
        if directive is None:
            if taken:
                yield line
            continue
        word, rest = directive[1], directive[2].strip()
        if word in ("if", "ifdef", "ifndef"):
            holds = _condition(word, rest, macros)
            branches.append((taken, holds, holds is True))
        elif word in ("elif", "else") and branches:
            done = branches[-1][2]
            branches[-1] = outer, False if done else None if holds is None or word == "elif" else True, done
        elif word == "endif" and branches:
            branches.pop()
        elif taken and word == "define" and (found := _DEFINITION.match(rest)):
            macros.add(found[1])
            uses.setdefault(found[1], []).append(tokens(found[3]))
        elif taken and word == "undef":
            macros.discard(rest)


def _condition(word: str, rest: str, macros: set[str]) -> bool | None:
    if rest.startswith(("GL_", "__")):
        return None  # only the driver knows
    if word != "if":
        return (rest in macros) == (word == "ifdef")
    asked = _DEFINED.match(rest)
    return None if asked is None else (asked[2] in macros) != bool(asked[1])


def _names(words: Sequence[str]) -> set[str]:
    return {word for before, word in zip(["", *words], words, strict=False) if before != "." and word[0].isidentifier()}
