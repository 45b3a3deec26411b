"""Where in its author's own files an exception came from."""

from __future__ import annotations

from collections.abc import Iterator
from opcode import opmap
from types import CodeType, FrameType, TracebackType

from rendergraph.declare.node import Node
from rendergraph.errors import Misuse, nearest, shown_file, suggestion


def author_line(error: BaseException, cls: type) -> str:
    """`file:line` of the innermost line of the node's own package that an exception came through.

    Helpers beside the node count as the author's own; the framework, NumPy and the like do not.

    Args:
        error: what was raised.
        cls: the node's class.

    Returns:
        The place, or nothing where the exception never met the author's code.
    """
    found = own_place(error, cls.__module__)
    return f"{shown_file(found[0])}:{found[1]}" if found is not None else ""


def own_place(error: BaseException, module: str) -> tuple[str, int] | None:
    """File and line of the innermost line of a module's own package that an exception came through."""
    own = [(code.co_filename, line) for frame, code, line in _frames(error.__traceback__) if _is_own(frame, module)]
    return own[-1] if own else None


def is_deliberate(error: BaseException, cls: type) -> bool:
    """Whether the author's own code says `raise`: a message for users and no accident."""
    last = error.__traceback__
    while last is not None and last.tb_next is not None:
        last = last.tb_next
    if last is None or not _is_own(last.tb_frame, cls.__module__):
        return False
    return last.tb_frame.f_code.co_code[last.tb_lasti] == opmap["RAISE_VARARGS"]


def what_happened(error: BaseException, cls: type) -> str:
    """`file:line: KeyError: 'x'`, without the exception's name where the framework refused a call."""
    where = author_line(error, cls)
    text = str(error) if isinstance(error, Misuse) else f"{type(error).__name__}: {error}{_meant(error)}"
    return f"{where}: {text}" if where else text


def _meant(error: BaseException) -> str:
    """What a misspelt attribute of a node, or of what the framework hands to one, may have been."""
    if not isinstance(error, AttributeError) or not error.name:
        return ""
    asked = type(error.obj)
    if issubclass(asked, Node):  # what it declares, and nothing of its base classes
        return suggestion(error.name, [*asked.ports(), *asked.parameters()], most=99)
    known = [name for name in dir(asked) if not name.startswith("_")] if is_framework(asked.__module__) else []
    near = nearest(error.name, known)
    return f"; did you mean '{near}'?" if near is not None else ""


def _frames(trace: TracebackType | None) -> Iterator[tuple[FrameType, CodeType, int]]:
    while trace is not None:
        yield trace.tb_frame, trace.tb_frame.f_code, trace.tb_lineno
        trace = trace.tb_next


def _is_own(frame: FrameType, module: str) -> bool:
    name = str(frame.f_globals.get("__name__", ""))
    return name.partition(".")[0] == module.partition(".")[0] and not is_framework(name)


def is_framework(module: str) -> bool:
    """Whether a module is the framework's; the standard nodes are authors like anybody."""
    return module == "rendergraph" or (module.startswith("rendergraph.") and not module.startswith("rendergraph.nodes"))
