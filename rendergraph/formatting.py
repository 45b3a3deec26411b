"""Values as text for people, and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any


def jsonable(value: Any) -> Any:
    """Return a value as JSON data: tuples become lists, infinite and undefined numbers null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): jsonable(item) for key, item in value.items()}
    return [jsonable(item) for item in value] if isinstance(value, list | tuple) else value


def format_bytes(count: int) -> str:
    """Return a number of bytes in the largest unit that fits: `8.0 MiB`, `12.0 KiB`."""
    for unit, size in (("GiB", 1 << 30), ("MiB", 1 << 20), ("KiB", 1 << 10)):
        if count >= size:
            return f"{count / size:.1f} {unit}"
    return f"{count} B"


def format_value(value: Any) -> str:
    """Return a value as a file writes it: `0.5`, `true`, `[1, 2]`; `–` for none."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(format_value, value))}]"
    if isinstance(value, float) and float(f"{value:g}") == value:
        return f"{value:g}"
    return str(value)


def table(
    rows: Sequence[Sequence[object]], heads: Sequence[str] = (), *, right: Sequence[int] = (), width: int = 1 << 20
) -> str:
    """Return aligned columns, two spaces between them; rows may have fewer cells than others, and None is empty.

    The columns whose numbers are in `right` are aligned to the right; the last column is wrapped to fit the width.
    """
    cells = [["" if cell is None else str(cell) for cell in row] for row in [heads, *rows] if row]
    widths = [max(map(len, column)) for column in zip_longest(*cells, fillvalue="")]
    start = sum(widths[:-1]) + 2 * (len(widths) - 1)
    room = max(24, width - start)
    lines = []
    for row in cells:
        row += [""] * (len(widths) - len(row))
        wrapped = [row[-1]]
        if len(row[-1]) > room:
            import textwrap  # most tables fit

            wrapped = textwrap.wrap(row[-1], room, break_long_words=False)
        padded = zip([*row[:-1], wrapped[0]], widths, strict=True)
        texts = [text.rjust(w) if number in right else text.ljust(w) for number, (text, w) in enumerate(padded)]
        lines.append("  ".join(texts).rstrip())
        lines += [" " * start + line for line in wrapped[1:]]
    return "\n".join(lines)
