"""Importing a node module, and saying what is wrong with it."""

from __future__ import annotations

import importlib
from pathlib import Path

from pydantic import PydanticUserError

from rendergraph.catalog.types import Listed, NodeType
from rendergraph.declare import Node, declaration_mistakes, mistake_place
from rendergraph.declare.blame import own_place
from rendergraph.errors import InputError, Place, Problem, shown_file


def load(name: str, listed: Listed) -> NodeType:
    """The one node class of a module.

    Raises:
        InputError: the module fails, or it declares its node wrongly.
    """
    place = Place(shown_file(listed.file))
    try:
        module = importlib.import_module(listed.module)
    except (Exception, SystemExit) as error:  # whatever a stranger's module raises is a mistake in that module
        raise InputError(_failed(name, listed, error)) from error
    classes = [
        value
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Node) and value.__module__ == module.__name__
    ]
    classes = [cls for cls in dict.fromkeys(classes) if not cls.__name__.startswith("_")]
    if len(classes) != 1:
        names = ", ".join(cls.__name__ for cls in classes) or "none"
        text = f"the module of node type '{name}' must define one Node class, it has {names}"
        raise InputError(Problem("RG492", text, place))
    mistakes = declaration_mistakes(classes[0])
    if mistakes:
        placed = [(f"node type '{name}': {mistake}", mistake_place(listed.file, mistake)) for mistake in mistakes]
        raise InputError([Problem("RG490", text, where) for text, where in placed])
    return NodeType(name, listed.family, classes[0], listed.file, listed.shaders, listed.plugin)


def _failed(name: str, listed: Listed, error: BaseException) -> Problem:
    """The author's own line of what a module raised, or a helper that it imports."""
    file, line = own_place(error, listed.module) or (str(listed.file), 0)
    if isinstance(error, SyntaxError) and error.filename and Path(error.filename).is_relative_to(listed.file.parent):
        file, line = error.filename, error.lineno or 0
    said = getattr(error, "message", error) if isinstance(error, PydanticUserError) else error  # without its link
    text = f"node type '{name}' cannot be imported: {type(error).__name__}: {said}"
    return Problem("RG491", " ".join(text.split()), Place(shown_file(file), line, 1 if line else 0))
