"""Where in an author's files something is declared."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from rendergraph.catalog import NodeType
from rendergraph.declare import raised_at
from rendergraph.errors import Place, shown_file


def port_place(node: NodeType, name: str) -> Place:
    """Where a node declares a port, a parameter or a method: in its own file, or in that of a base."""
    for base in node.cls.__mro__:
        if name in vars(base) or name in inspect.get_annotations(base):
            file = getattr(sys.modules.get(base.__module__), "__file__", None)
            if file and node.file.suffix == ".py" and base.__name__ != "Node":
                return declared_at(Path(file), name)
    return declared_at(node.file, name)


def declared_at(file: Path, name: str) -> Place:
    """The first line of a file that declares a name, or else mentions it."""
    lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    for pattern in (
        rf"^\s*{name}\s*[:=]",
        rf"\bdef {name}\b",
        rf"\b(?:in|out|uniform|buffer)\b.*\b{name}\b",
        rf"\b{name}\b",
    ):
        for number, line in enumerate(lines, start=1):
            if found := re.search(pattern, line):
                return Place(shown_file(file), number, found.start() + len(found[0]) - len(found[0].lstrip()) + 1)
    return Place(shown_file(file))


def causes(error: BaseException) -> Iterator[BaseException]:
    """An error, what it came from, and so on."""
    found: BaseException | None = error
    while found is not None:
        yield found
        found = found.__cause__


def line_through(error: BaseException, file: Path) -> Place:
    """The innermost line of a file that an error, or what caused it, came through."""
    found = [place for cause in causes(error) if (place := raised_at(cause, file)) is not None]
    return found[-1] if found else Place(shown_file(file))
