"""What a piece of GLSL declares, and giving its names a prefix. A scanner, not a parser: it looks at the top level."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Literal

Role = Literal["uniform", "in", "out", "buffer", "block", "function", "struct", "variable", "macro"]

_TOKEN = re.compile(r"[A-Za-z_]\w*|\.?\d[\w.]*|[^\s\w]")
_WORD = re.compile(r"[A-Za-z_]\w*\Z")
_QUALIFIERS = frozenset(
    [
        "const", "in", "out", "inout", "uniform", "buffer", "shared", "flat", "smooth", "noperspective", "centroid",
        "sample", "patch", "invariant", "precise", "coherent", "volatile", "restrict", "readonly", "writeonly", "highp",
        "mediump", "lowp", "subroutine",
    ]
)  # fmt: skip
_DIRECTIVE = re.compile(r"^[ \t]*#(?:\\\n|[^\n])*", re.MULTILINE)
_MEMBERS = re.compile(
    r"\bstruct\s+\w+\s*\{([^{}]*)\}|\b(?:uniform|buffer|in|out)\s+\w+\s*\{([^{}]*)\}\s*[A-Za-z_]\w*\s*(?:\[[^\]]*\])?\s*;"
)
_DEFINE = re.compile(r"\s*#\s*define\s+([A-Za-z_]\w*)")


@dataclass(frozen=True)
class Declared:
    """One name declared at the top level.

    Attributes:
        name: the name.
        role: what it is.
        type: the GLSL type, the block's name for members and instances, empty for macros.
    """

    name: str
    role: Role
    type: str = ""


@dataclass(frozen=True)
class Interface:
    """What a shader's text declares towards the outside; also what stands inside `#if`.

    Attributes:
        uniforms: default-block uniforms (samplers and images too), name to type.
        inputs, outputs: `in` and `out` variables, name to type.
        blocks: uniform blocks, name to members.
        buffers: storage blocks, name to members.
    """

    uniforms: dict[str, str] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    outputs: dict[str, str] = field(default_factory=dict)
    blocks: dict[str, tuple[str, ...]] = field(default_factory=dict)
    buffers: dict[str, tuple[str, ...]] = field(default_factory=dict)


def tokens(text: str) -> list[str]:
    """Words, numbers and signs of a text without comments."""
    return _TOKEN.findall(text)


def without_directives(text: str) -> str:
    """The text with preprocessor lines (and what continues them) blanked out, every character where it was."""
    return _DIRECTIVE.sub(lambda match: re.sub(r"[^\n]", " ", match.group()), text)


def declared(text: str) -> list[Declared]:
    """All names a text declares at its top level, macros included, whatever `#if` they stand in."""
    macros = [Declared(match[1], "macro") for line in text.split("\n") if (match := _DEFINE.match(line))]
    found: list[Declared] = []
    for statement, body in statements(tokens(without_directives(text))):
        found += _of_statement(statement, body)
    return macros + [name for name in found if not name.name.startswith("gl_")]


def interface(text: str) -> Interface:
    """The uniforms, inputs, outputs and blocks of a text without comments."""
    result = Interface()
    tables: dict[str, dict[str, str]] = {"uniform": result.uniforms, "in": result.inputs, "out": result.outputs}
    blocks: dict[str, dict[str, tuple[str, ...]]] = {"uniform": result.blocks, "buffer": result.buffers}
    for statement, body in statements(tokens(without_directives(text))):
        storage, rest = _split(statement)
        if body is not None and storage in blocks and rest:
            blocks[storage][rest[0]] = tuple(_members(body))
        elif body is None:
            for name in _of_statement(statement, None):
                if name.role in tables:
                    tables[name.role][name.name] = name.type
    return result


def calls(text: str, function: str) -> bool:
    """Whether a text without comments calls a function it does not declare itself."""
    if re.search(rf"(?<![\w.]){re.escape(function)}\s*\(", text) is None:
        return False
    return not any(name.role == "function" and name.name == function for name in declared(text))


def mentions(text: str, name: str) -> bool:
    """Whether a name stands in a text as a whole word."""
    return re.search(rf"\b{re.escape(name)}\b", text) is not None


def renamed(text: str, rename: Callable[[str], str]) -> str:
    """A text without comments with its names replaced; members after a dot and members of structs stay."""
    kept = _member_positions(text)

    def replace(match: re.Match[str]) -> str:
        return match.group() if match.start() in kept else rename(match.group())

    return re.sub(r"(?<![\w.])[A-Za-z_]\w*", replace, text)


# --- scanning --------------------------------------------------------------------------------------------------------


def statements(words: list[str]) -> Iterator[tuple[list[str], list[str] | None]]:
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
            end = _closing(words, position)
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


def _closing(words: list[str], start: int) -> int:
    depth = 0
    for position in range(start, len(words)):
        depth += (words[position] == "{") - (words[position] == "}")
        if depth == 0:
            return position
    return len(words)


def _split(statement: list[str]) -> tuple[str, list[str]]:
    """The storage qualifier of a statement, and the tokens after all qualifiers."""
    storage = ""
    position = 0
    while position < len(statement):
        word = statement[position]
        if word == "layout" and statement[position + 1 : position + 2] == ["("]:
            position = _after_brackets(statement, position + 1)
            continue
        if word not in _QUALIFIERS:
            break
        if word in ("uniform", "in", "out", "buffer"):
            storage = word
        position += 1
    return storage, statement[position:]


def _after_brackets(words: list[str], start: int) -> int:
    depth = 0
    for position in range(start, len(words)):
        depth += (words[position] in "([") - (words[position] in ")]")
        if depth == 0:
            return position + 1
    return len(words)


def _of_statement(statement: list[str], body: list[str] | None) -> Iterator[Declared]:
    storage, rest = _split(statement)
    if not rest or rest[0] == "precision":
        return
    if body is not None and "}" in rest:
        after = rest[rest.index("}") + 1 :]
        if rest[0] == "struct":
            yield Declared(rest[1], "struct")
            yield from (Declared(name, "variable", rest[1]) for name in _declarators(after))
            return
        role: Role = "buffer" if storage == "buffer" else "block"
        yield Declared(rest[0], role)
        members = _declarators(after) or _members(body)
        yield from (Declared(name, "variable", rest[0]) for name in members)
        return
    position = 1
    if position < len(rest) and rest[position] == "[":
        position = _after_brackets(rest, position)
    names = rest[position:]
    if len(names) > 1 and _WORD.match(names[0]) and names[1] == "(":
        yield Declared(names[0], "function", rest[0])
        return
    kinds: dict[str, Role] = {"uniform": "uniform", "in": "in", "out": "out"}
    for name in _declarators(names):
        yield Declared(name, kinds.get(storage, "variable"), rest[0])


def _declarators(words: list[str]) -> list[str]:
    """The names of `a = 1, b[3], c`."""
    names: list[str] = []
    depth = 0
    expect = True
    for word in words:
        if word in "([{":
            depth += 1
        elif word in ")]}":
            depth -= 1
        elif depth == 0 and word == ",":
            expect = True
        elif depth == 0 and expect and _WORD.match(word):
            names.append(word)
            expect = False
    return names


def _members(body: list[str]) -> list[str]:
    names: list[str] = []
    for statement, _ in statements(body):
        _, rest = _split(statement)
        position = _after_brackets(rest, 1) if rest[1:2] == ["["] else 1
        names += _declarators(rest[position:])
    return names


def _member_positions(text: str) -> set[int]:
    """Where the members of structs and of blocks with an instance name are declared."""
    kept: set[int] = set()
    for match in _MEMBERS.finditer(without_directives(text)):
        group = 1 if match[1] is not None else 2
        for member in re.finditer(r"(?<!\[)\b([A-Za-z_]\w*)\s*(?=[,;\[])", match[group]):
            kept.add(match.start(group) + member.start())
    return kept
