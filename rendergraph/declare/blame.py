"""Locate declarations and exceptions in a plugin author's files."""

from __future__ import annotations

import ast
import linecache
import re
import sys
from collections.abc import Iterator
from inspect import get_annotations
from pathlib import Path
from types import FrameType
from typing import Any

from rendergraph.declare.node import Node
from rendergraph.errors import Misuse, Place, Problem, is_framework, is_interruption, shown_file, suggestion
from rendergraph.ports import Port


def source_location(error: BaseException, *own: Path | str) -> Place | None:
    """Return the innermost line of an author's code that an exception, or else its cause, came through.

    A syntax error is located at its own line. Helpers beside a node count as the author's; the framework, NumPy and
    the like do not. `own` lists the author's files, folders, and modules, which stand for their whole packages.
    """
    from traceback import walk_tb  # only for mistakes

    folders = [path for path in own if isinstance(path, Path)]
    packages = {module.partition(".")[0] for module in own if isinstance(module, str)}

    def is_own(frame: FrameType) -> bool:
        module = str(frame.f_globals.get("__name__", ""))
        if module.partition(".")[0] in packages and not is_framework(module):
            return True
        return any(Path(frame.f_code.co_filename).is_relative_to(folder) for folder in folders)

    for cause in cause_chain(error):
        if isinstance(cause, SyntaxError) and cause.filename:
            file = Path(cause.filename)
            if any(file.is_relative_to(folder) for folder in folders):
                return Place(shown_file(file), cause.lineno or 1, 1)
        if found := [(frame, line) for frame, line in walk_tb(cause.__traceback__) if is_own(frame)]:
            frame, line = found[-1]
            return Place(shown_file(frame.f_code.co_filename), line, 1)
    return None


def declaration_of(cls: type[Node], file: Path, name: str = "") -> Place:
    """Return where a node declares a port, parameter or method, in its file or a base's; else the place of its class.

    `file` is its module, or the shader that defines it; an empty name means the node itself.
    """
    if file.suffix != ".py":
        return declaration_in(file, name)
    own = [base for base in cls.__mro__ if issubclass(base, Node) and base is not Node]
    for base in (base for base in own if name in {**vars(base), **get_annotations(base)}):
        module = getattr(sys.modules.get(base.__module__), "__file__", None)
        found = declaration_in(Path(module) if module else file, name)
        if found.line:
            return found
    return declaration_in(file, cls.__name__)


def declaration_in(file: Path, name: str) -> Place:
    """Return where a file declares a Python class, its attribute or method, or a shader's variable; else the file."""
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
        found = _in_module(text, name) if file.suffix == ".py" else _in_shader(text, name)
    except (OSError, SyntaxError, ValueError):
        found = None
    return Place(shown_file(file), *found) if found is not None else Place(shown_file(file))


def _in_module(text: str, name: str) -> tuple[int, int] | None:
    classes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ClassDef)]
    for statement in [*(statement for cls in classes for statement in cls.body), *classes]:
        targets: list[Any] = getattr(statement, "targets", [getattr(statement, "target", statement)])
        if name in [getattr(target, "id", getattr(target, "name", None)) for target in targets]:
            return statement.lineno, statement.col_offset + 1
    return None


def _in_shader(text: str, name: str) -> tuple[int, int] | None:
    word = rf"\b{re.escape(name)}\b"
    for pattern in (rf"^\s*{word}\s*:", rf"\b(?:in|out|uniform|buffer)\b.*{word}", word):
        for number, line in enumerate(text.splitlines(), start=1):
            if found := re.search(pattern, line):
                return number, found.start() + len(found[0]) - len(found[0].lstrip()) + 1
    return None


_MOST_CHARACTERS = 500
"""Limit of an exception's text in a message."""
_OF_A_STRUCT = ("Unexpected keyword argument", "Missing required argument", "Extra positional arguments")
"""Beginnings of errors from msgspec's constructors, which do not name the class."""


def describe_error(error: BaseException) -> str:
    """Return `KeyError: 'x'` in one line; a long text is cut, and one that raises is left out."""
    try:
        text = " ".join(str(error)[: 4 * _MOST_CHARACTERS].split())
    except BaseException as another:  # the `__str__` of third-party code
        if is_interruption(another):
            raise
        text = ""
    text = text if len(text) <= _MOST_CHARACTERS else text[:_MOST_CHARACTERS] + "…"
    return f"{type(error).__name__}: {_callee(error) if text.startswith(_OF_A_STRUCT) else ''}{text}"


def _callee(error: BaseException) -> str:
    """Return `Input(): `, from the source line of the call that raised."""
    import traceback  # only for mistakes

    frames = traceback.extract_tb(error.__traceback__)
    line = linecache.getline(frames[-1].filename, frames[-1].lineno or 0) if frames else ""
    called = re.match(r"[\w.]+(?=\()", line[frames[-1].colno or 0 :]) if line else None
    return f"{called[0]}(): " if called else ""


def author_problem(error: BaseException, cls: type, file: Path | None = None, subject: str = "") -> Problem:
    """Return the problem that a node's own code raised, with the author's line; the caller sets its place and code.

    `file` is the place if the exception never came through the author's code. If the framework refused a call, the
    exception's name is left out.
    """
    place = source_location(error, cls.__module__) or (error.place if isinstance(error, Misuse) else None)
    if place is None and file is not None and file.name:
        place = Place(shown_file(file))
    text = str(error) if isinstance(error, Misuse) else describe_error(error)
    if isinstance(error, KeyError) and issubclass(cls, Node):
        text += _input_hint(error, cls)
    elif not isinstance(error, Misuse):
        text += _attribute_hint(error)
    return Problem("RG420", text, subject=subject, cause=place)


def _input_hint(error: KeyError, cls: type[Node]) -> str:
    """Return a hint for a name that `facts.input` does not find: whether the node has such an input."""
    name = str(error.args[0]) if error.args else ""
    if name in cls.inputs():
        return "; that input is not connected; check `connected` first"
    return suggestion(name, cls.inputs(), most=0)


def _attribute_hint(error: BaseException) -> str:
    """Return a suggestion for a misspelt attribute of a node, or of a framework object passed to it."""
    if not isinstance(error, AttributeError) or not error.name:
        return ""
    cls = type(error.obj)
    if issubclass(cls, Node):  # its declarations only, without methods of the base class
        return suggestion(error.name, [*cls.ports(), *cls.parameters()], most=99)
    if error.name == "previous" and issubclass(cls, Port):
        return "; declare it as `History` to read last frame's value"
    names = {*dir(cls), *get_annotations(cls)} if is_framework(cls.__module__) else set()
    return suggestion(error.name, [name for name in names if not name.startswith("_")])


def cause_chain(error: BaseException) -> Iterator[BaseException]:
    """Yield an error and its chain of causes."""
    found: BaseException | None = error
    while found is not None:
        yield found
        found = found.__cause__
