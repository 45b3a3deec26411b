"""Which names a node can have."""

from __future__ import annotations

import keyword
import re
import sys
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

from rendergraph import api
from rendergraph.declare import RESERVED_NAMES
from rendergraph.errors import InputError, Problem

_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*\Z")
_LONGEST = 40


def check_name(name: str, existing: Iterable[str]) -> None:
    """Refuse what cannot be a node type's, a module's and a GLSL file's name at once.

    Args:
        name: what was asked for.
        existing: the node types there are.

    Raises:
        InputError: it cannot be used; the message has one that can.
    """
    mistake = _mistake(name, set(existing))
    if mistake:
        raise InputError(Problem("RG530", f"a node cannot be called '{name}': {mistake}"))


def class_name(name: str) -> str:
    """`lens_falloff` to `LensFalloff`, or to a longer name where a node author imports that one."""
    camel = "".join(part.capitalize() for part in name.split("_"))
    return f"{camel}Node" if camel in api.__all__ else camel


def _mistake(name: str, existing: set[str]) -> str:
    if not _NAME.match(name) or len(name) > _LONGEST:
        better = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
        better = re.sub(r"[^a-z0-9]+", "_", better).strip("_0123456789")[:_LONGEST].strip("_")
        hint = f", such as '{better}'" if better and not _mistake(better, existing) else ""
        return f"a name is up to {_LONGEST} lower-case letters, digits and single underscores{hint}"
    other = f"; choose another, such as 'my_{name}'"
    if name in existing:
        return f"there is a node type of that name{other}"
    if name in RESERVED_NAMES or keyword.iskeyword(name) or name.startswith("gl_"):
        return f"the word is reserved by GLSL or Python{other}"
    if name.startswith("test_") or name == "conftest":
        return f"pytest would take the module for a test; choose another, such as '{name.removeprefix('test_')}_node'"
    if name in sys.stdlib_module_names or _is_installed(name):
        return f"a Python module has that name, and one would hide the other{other}"
    return ""


def _is_installed(name: str) -> bool:
    """Whether `import name` finds something that does not lie in the current folder."""
    try:
        spec = find_spec(name)
    except (ImportError, ValueError):
        return False
    return spec is not None and spec.origin is not None and Path(spec.origin).parent != Path.cwd()
