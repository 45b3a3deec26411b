"""Importing a node module, and saying what is wrong with it."""

from __future__ import annotations

import importlib
import traceback
from pathlib import Path

from pydantic import PydanticUserError

from rendergraph.catalog.types import Listed, NodeType
from rendergraph.declare import Node, declaration_mistakes, mistake_place
from rendergraph.errors import InputError, Place, Problem


def load(name: str, listed: Listed) -> NodeType:
    """The one node class of a module.

    Raises:
        InputError: the module fails, or it declares its node wrongly.
    """
    place = Place(str(listed.file))
    try:
        module = importlib.import_module(listed.module)
    except (Exception, SystemExit) as error:  # whatever a stranger's module raises is a mistake in that module
        raise InputError(_failed(name, listed.file, error)) from error
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


def _failed(name: str, file: Path, error: BaseException) -> Problem:
    """The author's own line of what a module raised."""
    line = 0
    if isinstance(error, SyntaxError) and error.filename == str(file):
        line = error.lineno or 0
    for frame in traceback.extract_tb(error.__traceback__):
        if frame.filename == str(file):
            line = frame.lineno or line
    said = getattr(error, "message", error) if isinstance(error, PydanticUserError) else error  # without its link
    text = f"node type '{name}' cannot be imported: {type(error).__name__}: {said}"
    return Problem("RG491", " ".join(text.split()), Place(str(file), line, 1 if line else 0))
