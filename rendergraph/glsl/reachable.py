"""The names that a shader's `main` reaches through functions, macros and values. No GL."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise

from rendergraph.glsl.names import declarators, head, statements, tokens

_DIRECTIVE = re.compile(r"\s*#\s*([a-z]+)\s*(.*)")
_DEFINE = re.compile(r"([A-Za-z_]\w*)(?:\(([^()]*)\))?(.*)")
_DEFINED = re.compile(r"(!?)\s*defined\s*\(?\s*(\w+)\s*\)?\s*\Z")


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
        directive = _DIRECTIVE.match(line)
        taken = not branches or (
            branches[-1][0] and (branches[-1][1] is True if certain else branches[-1][1] is not False)
        )
        if directive is None:
            if taken:
                yield line
            continue
        word, rest = directive[1], directive[2].strip()
        if word in ("if", "ifdef", "ifndef"):
            holds = _condition(word, rest, macros)
            branches.append((taken, holds, holds is True))
        elif word in ("elif", "else") and branches:
            around, holds, done = branches[-1]
            branches[-1] = around, False if done else None if holds is None or word == "elif" else True, done
        elif word == "endif" and branches:
            branches.pop()
        elif taken and word == "define" and (found := _DEFINE.match(rest)):
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
