"""Importing a node module, and saying what is wrong with it."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

from rendergraph.catalog import find
from rendergraph.catalog.types import Listed, NodeType
from rendergraph.declare import Node, declaration_mistakes
from rendergraph.declare.blame import declaration_of, describe_error, source_location
from rendergraph.errors import InputError, Place, Problem, is_interruption, shown_file


def load(name: str, listed: Listed) -> NodeType:
    """The one node class of a module.

    Raises:
        InputError: the module fails, or it declares its node wrongly.
    """
    place = Place(shown_file(listed.file))
    try:
        module = importlib.import_module(listed.module)
    except BaseException as error:  # whatever a stranger's module raises is a mistake in that module
        if is_interruption(error):
            raise
        raise InputError(_failed(name, listed, error, place)) from error
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
    (cls,) = classes
    if problems := declaration_mistakes(cls):
        who = f"node type '{name}'"
        raise InputError([p.relocate(declaration_of(cls, listed.file, p.subject), context=who) for p in problems])
    return NodeType(
        name, listed.family, cls, listed.file, listed.shaders, listed.plugin, inherited=_inherited(cls, listed)
    )


def _inherited(cls: type[Node], listed: Listed) -> tuple[Path, ...]:
    """The folders of shaders of the nodes that a class extends, the nearest first."""
    modules = [base.__module__ for base in cls.__mro__[1:] if issubclass(base, Node) and base is not Node]
    folders = [find.shader_folder(module, Path(sys.modules[module].__file__ or "")) for module in modules]
    return tuple(dict.fromkeys(folder for folder in folders if folder != listed.shaders))


def _failed(name: str, listed: Listed, error: BaseException, place: Place) -> Problem:
    """The author's own line of what a module raised, or a helper that it imports."""
    text = f"node type '{name}' cannot be imported: {describe_error(error)}"
    return Problem("RG491", text, source_location(error, listed.module, listed.file.parent) or place)
