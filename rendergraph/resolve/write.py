"""A resolved pipeline as YAML text, with the origin of each value as a comment."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

from rendergraph.document import Source, Value, scalar
from rendergraph.resources import folder

_PLAIN = re.compile(r"[A-Za-z_./$][A-Za-z0-9_./$@ -]*(?<! )\Z")
_WIDTH = 60


def to_yaml(tree: Value, origins: bool) -> str:
    """The text; mappings in block style, lists in flow style."""
    lines = list(_block(tree, 0))
    if not origins:
        return "".join(f"{text}\n" for text, _ in lines)
    width = max((len(text) for text, origin in lines if origin and len(text) <= _WIDTH), default=0)
    return "".join(f"{text.ljust(width)}  # {_origin(origin)}\n" if origin else f"{text}\n" for text, origin in lines)


def _block(value: Value, indent: int) -> Iterator[tuple[str, Value | None]]:
    for key, child in value.items():
        head = f"{'  ' * indent}{_text(key)}:"
        if isinstance(child.data, dict) and child.data:
            yield head, None
            yield from _block(child, indent + 1)
        else:
            yield f"{head} {flow(child)}", child


def flow(value: Value) -> str:
    """A value in one line."""
    data = value.data
    if isinstance(data, dict):
        return "{" + ", ".join(f"{_text(key)}: {flow(child)}" for key, child in data.items()) + "}"
    if isinstance(data, list):
        return "[" + ", ".join(flow(child) for child in data) + "]"
    return _text(data)


def _text(data: Any) -> str:
    """A scalar, quoted where it would read back as something else."""
    if data is None:
        return "null"
    if isinstance(data, bool):
        return "true" if data else "false"
    if isinstance(data, float):
        if math.isfinite(data):
            return repr(data)
        return ".nan" if math.isnan(data) else ".inf" if data > 0 else "-.inf"
    if isinstance(data, int):
        return str(data)
    if _PLAIN.match(data) and scalar(data) == data:
        return str(data)
    return '"' + "".join(map(_escaped, data)) + '"'


def _escaped(char: str) -> str:
    if char in '"\\':
        return f"\\{char}"
    # YAML's own escapes, not JSON's, whose pairs of surrogates PyYAML does not join.
    if char.isprintable():
        return char
    return f"\\u{ord(char):04X}" if ord(char) < 0x10000 else f"\\U{ord(char):08X}"


def _origin(value: Value) -> str:
    name = _short(value.source)
    return f"{name}:{value.line}" if value.line else name


def _short(source: Source) -> str:
    """Shipped files by their names: where they are installed says nothing."""
    shipped = folder("rendergraph.pipelines")
    if source.path is not None and source.path.is_relative_to(shipped):
        return source.path.stem
    return str(source.origin)
