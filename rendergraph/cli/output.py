"""What is printed, and where: stdout is data, stderr everything else."""

from __future__ import annotations

import json
import math
import re
import shutil
import sys
import textwrap
from collections.abc import Sequence
from typing import Any

from rendergraph.errors import Problem

_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")


def emit(text: str) -> None:
    """Data, to stdout, with one line end."""
    if sys.stdout is not None:
        sys.stdout.write(_printable(text, sys.stdout) + "\n")


def emit_json(document: Any, *, line: bool = False) -> None:
    """One JSON document to stdout, in one line if asked; infinite and undefined numbers become null."""
    emit(json.dumps(_plain(document), indent=None if line else 2, ensure_ascii=False, default=str))


def say(text: str) -> None:
    """A word to the person, on stderr."""
    if sys.stderr is not None:
        sys.stderr.write(_printable(text, sys.stderr) + "\n")
        sys.stderr.flush()


def warn(problems: Sequence[Problem]) -> None:
    """Warnings, each once."""
    for text in dict.fromkeys(str(problem) for problem in problems):
        say(text)


class Warnings:
    """Says each warning once, however often it comes up."""

    def __init__(self) -> None:
        self._said: set[str] = set()

    def say(self, problems: Sequence[Problem]) -> None:
        """Those that have not been said."""
        for text in dict.fromkeys(str(problem) for problem in problems):
            if text not in self._said:
                say(text)
        self._said.update(str(problem) for problem in problems)


def say_summary(report: dict[str, Any]) -> None:
    """Of what `run --json` prints: what was not drawn, how large, how long and on what."""
    for node, reason in report["culled"].items():
        say(f"not drawn: {node}: {reason}")
    device, (width, height) = report["device"], report["size"]
    passes = amount(len(report["passes"]), "pass", "passes")
    text = f"{width}×{height}, {passes}, {report['frame_ms']['median']:.1f} ms a frame"
    say(f"{text} on {device['renderer']}" + (" (software: no measure of a GPU)" if device["software"] else ""))


def print_error(problems: Sequence[Problem], exit_code: int, *, as_json: bool) -> None:
    """What stopped us: in words on stderr, and as the document of `--json` on stdout."""
    for problem in problems:
        say(str(problem))
    if as_json:
        emit_json({"error": error_document(problems, exit_code)})


def error_document(problems: Sequence[Problem], exit_code: int) -> dict[str, Any]:
    """What `--json` prints under `error`."""
    return {"exit_code": exit_code, "problems": [problem.as_json() for problem in problems]}


class Progress:
    """`frame 3 of 10` on a terminal, nothing elsewhere."""

    def __init__(self, total: int) -> None:
        self._total = total
        self._on = total > 1 and sys.stderr is not None and sys.stderr.isatty()

    def show(self, done: int) -> None:
        """Say how many are done."""
        if self._on:
            sys.stderr.write(f"\rframe {done} of {self._total}")
            sys.stderr.flush()

    def clear(self) -> None:
        """Leave the line as it was."""
        if self._on:
            sys.stderr.write("\r" + " " * 40 + "\r")
            sys.stderr.flush()


class Bar:
    """A bar that fills on a terminal, nothing elsewhere."""

    _WIDTH = 30

    def __init__(self, word: str) -> None:
        self._word = word
        self._on = sys.stderr is not None and sys.stderr.isatty()

    def show(self, done: int, total: int) -> None:
        """Say how many of how many are done."""
        if self._on:
            full = self._WIDTH * done // max(1, total)
            bar = _printable("█" * full + "·" * (self._WIDTH - full), sys.stderr)
            sys.stderr.write(f"\r{bar} {done} of {total} {self._word}")
            sys.stderr.flush()

    def clear(self) -> None:
        """Leave the line as it was."""
        if self._on:
            sys.stderr.write("\r" + " " * (self._WIDTH + 30) + "\r")
            sys.stderr.flush()


def table(rows: Sequence[Sequence[object]], heads: Sequence[str] = (), *, right: Sequence[int] = ()) -> str:
    """Aligned columns, two blanks between; on a terminal the last one is wrapped to its width.

    Args:
        rows: cells; None is empty.
        heads: titles above the columns.
        right: numbers of the columns that are aligned to the right.
    """
    cells = [["" if cell is None else str(cell) for cell in row] for row in [heads, *rows] if row]
    if not cells:
        return ""
    widths = [max(len(row[column]) for row in cells) for column in range(len(cells[0]))]
    start = sum(widths[:-1]) + 2 * (len(widths) - 1)
    room = max(24, terminal_width() - start)
    lines = []
    for row in cells:
        *front, last = row
        shown = [c.rjust(w) if i in right else c.ljust(w) for i, (c, w) in enumerate(zip(front, widths, strict=False))]
        if len(front) in right:
            last = last.rjust(widths[-1])
        wrapped = textwrap.wrap(last, room, break_long_words=False) if len(last) > room else [last]
        lines.append("  ".join([*shown, wrapped[0]]).rstrip())
        lines += [" " * start + more for more in wrapped[1:]]
    return "\n".join(lines)


def terminal_width() -> int:
    """Columns of the terminal that stdout is, without bound elsewhere."""
    if sys.stdout is not None and sys.stdout.isatty():
        return shutil.get_terminal_size().columns
    return 1 << 20


def amount(count: int, one: str, many: str = "") -> str:
    """`1 run`, `2 runs`."""
    return f"{count} {one if count == 1 else many or one + 's'}"


def megabytes(count: float) -> str:
    """Bytes for a person: `12.4 MiB`."""
    return f"{count / (1 << 20):.1f} MiB"


def _printable(text: str, stream: Any) -> str:
    """Text that the stream's encoding can hold, and without control characters that would steer a terminal."""
    text = _CONTROL.sub(lambda found: repr(found[0])[1:-1], text)
    encoding = getattr(stream, "encoding", None) or "utf-8"
    return text.encode(encoding, "backslashreplace").decode(encoding)


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value
