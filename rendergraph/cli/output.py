"""What is printed, and where: stdout is data, stderr everything else."""

from __future__ import annotations

import json
import os
import re
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from contextvars import ContextVar
from typing import Any, TextIO

from rendergraph.errors import Place, Problem
from rendergraph.formatting import jsonable

_RED, _YELLOW, _BOLD, _PLAIN = "\x1b[1;31m", "\x1b[1;33m", "\x1b[1m", "\x1b[0m"
_CONTROL = "[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]"


_DATA: ContextVar[TextIO | None] = ContextVar("data")
"""The process's stdout while a verb runs."""


@contextmanager
def only_data() -> Iterator[None]:
    """What `emit` is given goes to stdout, and what anybody else prints, such as a plugin, to stderr."""
    token = _DATA.set(sys.stdout)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        _DATA.reset(token)


def data_stream() -> TextIO | None:
    """Where data goes; None where the process has no such stream."""
    return _DATA.get(sys.stdout)


def emit(text: str) -> None:
    """Data, to stdout, with one line end."""
    stream = data_stream()
    if stream is not None:
        stream.write(_printable(text, stream) + "\n")


def emit_json(document: Any, *, line: bool = False) -> None:
    """One JSON document to stdout, in one line if asked; infinite and undefined numbers become null."""
    emit(json.dumps(jsonable(document), indent=None if line else 2, ensure_ascii=False, default=str))


class _Voice:
    """How much is said: `--quiet` leaves errors alone."""

    quiet = False


def be_quiet(quiet: bool) -> None:
    """Say nothing but errors from now on, or everything again."""
    _Voice.quiet = quiet


def say(text: str, *, always: bool = False) -> None:
    """A word to the person, on stderr; `always` where it is why the exit code is not 0."""
    if always or not _Voice.quiet:
        _write(_printable(text, sys.stderr))


def say_event(event: Mapping[str, Any]) -> None:
    """What happens while work is done, as a line of JSON on stderr, for whoever watches by program."""
    if not _Voice.quiet:
        _write(json.dumps(jsonable(event), ensure_ascii=True, default=str))


def tell(problem: Problem) -> None:
    """A mistake or a warning: as it is in a log, on a terminal with `error:` before its code and in colour."""
    if problem.severity == "warning" and _Voice.quiet:
        return
    text = _printable(str(problem), sys.stderr)
    _write(_painted(problem, text) if sys.stderr is not None and sys.stderr.isatty() else text)


def _painted(problem: Problem, text: str) -> str:
    place = _printable(f"{problem.place}: ", sys.stderr) if problem.place else ""
    rest = text[len(place) :].removeprefix("warning: ")
    first, *shown = rest.split("\n")
    word, hue = ("warning:", _YELLOW) if problem.severity == "warning" else ("error:", _RED)
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return f"{place}{word} {rest}"
    shown = [*shown[:-1], f"{hue}{shown[-1]}{_PLAIN}"] if shown else []  # the mark beneath the line
    return "\n".join([f"{_BOLD}{place}{hue}{word}{_PLAIN} {first}", *shown])


def _write(text: str) -> None:
    if sys.stderr is not None:
        sys.stderr.write(text + "\n")
        sys.stderr.flush()


def warn(problems: Sequence[Problem]) -> None:
    """Warnings, each once."""
    Warnings().say(problems)


class Warnings:
    """Says each warning once, however often it comes up; of several values of one setting, of the first."""

    def __init__(self) -> None:
        self._said: set[tuple[str, str, str | Place | None]] = set()

    def say(self, problems: Sequence[Problem]) -> None:
        """Those that have not been said."""
        for problem in problems:
            setting = problem.place.option("--set") if problem.place else None
            said = problem.code, problem.message, setting.path if setting else problem.place
            if said not in self._said:
                self._said.add(said)
                tell(problem)


def say_summary(report: dict[str, Any]) -> None:
    """Of what `run --json` prints: what was not drawn, how large, how long and on what."""
    for node, reason in report["culled"].items():
        say(f"not drawn: {node}: {reason}")
    for name, value in report["figures"].items():
        say(f"{name}: {', '.join(f'{number:.6g}' for number in (value if isinstance(value, list) else [value]))}")
    device, (width, height) = report["device"], report["size"]
    passes = amount(len(report["passes"]), "pass", "passes")
    took = f"{report['frame_ms']['median']:.1f} ms"
    text = f"{width}×{height}, {passes}, {f'drawn in {took}' if len(report['steps_run']) == 1 else f'{took} a frame'}"
    say(f"{text} on {device['renderer']}" + (" (software: no measure of a GPU)" if device["software"] else ""))


def print_error(problems: Sequence[Problem], exit_code: int, *, as_json: bool) -> None:
    """What stopped us: in words on stderr, and as the document of `--json` on stdout."""
    for problem in problems:
        tell(problem)
    from rendergraph.keys import MOST_PROBLEMS

    if len(problems) >= MOST_PROBLEMS:
        say(f"these are the first {len(problems)} mistakes; there may be more", always=True)
    if as_json:
        emit_json({"error": error_document(problems, exit_code)})


def error_document(problems: Sequence[Problem], exit_code: int) -> dict[str, Any]:
    """What `--json` prints under `error`."""
    return {"exit_code": exit_code, "problems": [problem.as_json() for problem in problems]}


class Progress:
    """`frame 3 of 10` on a terminal, nothing elsewhere."""

    def __init__(self, total: int) -> None:
        self._total = total
        self._on = total > 1 and on_terminal()

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


def on_terminal() -> bool:
    """Whether somebody watches: how far things are is shown there and nowhere else."""
    return sys.stderr is not None and sys.stderr.isatty() and not _Voice.quiet


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
    stream = data_stream()
    if stream is not None and stream.isatty():
        import shutil  # brings all archives along

        return shutil.get_terminal_size().columns
    return 1 << 20


def amount(count: int, one: str, many: str = "") -> str:
    """`1 run`, `2 runs`."""
    return f"{count} {one if count == 1 else many or one + 's'}"


def _printable(text: str, stream: Any) -> str:
    """Text that the stream's encoding can hold, and without control characters that would steer a terminal."""
    if not text.isprintable():
        text = re.sub(_CONTROL, lambda found: repr(found[0])[1:-1], text)
    encoding = getattr(stream, "encoding", None) or "utf-8"
    return text.encode(encoding, "backslashreplace").decode(encoding)
