"""Everything that is printed: data to stdout, everything else to stderr."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, TextIO

from rendergraph import formatting
from rendergraph.errors import Problem
from rendergraph.formatting import jsonable

if TYPE_CHECKING:
    from rendergraph.session.progress import Bar

_RED, _YELLOW, _BOLD, _PLAIN = "\x1b[1;31m", "\x1b[1;33m", "\x1b[1m", "\x1b[0m"
_CONTROL = "[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]"

_SCREENFUL = 10
"""Maximum number of errors to print, three lines each; `--json` lists all."""
_DATA: ContextVar[TextIO | None] = ContextVar("data")
"""The process's stdout while a verb runs."""


@contextmanager
def only_data() -> Iterator[None]:
    """Keep stdout for `emit`; what third-party code prints, such as a plugin's, goes to stderr."""
    token = _DATA.set(sys.stdout)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        _DATA.reset(token)


def data_stream() -> TextIO | None:
    """Return the stream for data; None where the process has no stdout."""
    return _DATA.get(sys.stdout)


def emit(text: str) -> None:
    stream = data_stream()
    if stream is not None:
        stream.write(_printable(text, stream) + "\n")


def emit_json(document: Any, *, line: bool = False) -> None:
    """Print one JSON document, or one `line` of JSON; infinite and undefined numbers become null."""
    emit(json.dumps(jsonable(document), indent=None if line else 2, ensure_ascii=False, default=str))


class _Verbosity:
    quiet = False


def set_quiet(quiet: bool) -> None:
    """From now on, print only errors to stderr, or everything again."""
    _Verbosity.quiet = quiet


def say(text: str, *, always: bool = False) -> None:
    """Print a line for people to stderr; `always` if it is the reason for the exit code."""
    if always or not _Verbosity.quiet:
        _write(_printable(text, sys.stderr))


def say_event(event: Mapping[str, Any]) -> None:
    """Print an event as a line of JSON to stderr, for programs that follow the progress."""
    if not _Verbosity.quiet:
        _write(json.dumps(jsonable(event), ensure_ascii=True, default=str))


def print_problem(problem: Problem) -> None:
    """Print an error or a warning as a line of a log; on a terminal in colour, with `error:` before its code."""
    if problem.severity == "warning" and _Verbosity.quiet:
        return
    text = _printable(str(problem), sys.stderr)
    _write(_colored(problem, text) if sys.stderr is not None and sys.stderr.isatty() else text)


def _colored(problem: Problem, text: str) -> str:
    place = _printable(f"{problem.place}: ", sys.stderr) if problem.place else ""
    rest = text[len(place) :].removeprefix("warning: ")
    first, *source = rest.split("\n")
    word, color = ("warning:", _YELLOW) if problem.severity == "warning" else ("error:", _RED)
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return f"{place}{word} {rest}"
    source = [*source[:-1], f"{color}{source[-1]}{_PLAIN}"] if source else []  # the last line marks the column
    return "\n".join([f"{_BOLD}{place}{color}{word}{_PLAIN} {first}", *source])


def _write(text: str) -> None:
    if sys.stderr is not None:
        sys.stderr.write(text + "\n")
        sys.stderr.flush()


def warn(problems: Sequence[Problem], printed: set[object] | None = None) -> None:
    """Print each warning once, of several values of one setting the first; calls may share what is `printed`."""
    printed = set() if printed is None else printed
    for problem in problems:
        setting = problem.place.option("--set") if problem.place else None
        key = problem.code, problem.message, setting.path if setting else problem.place
        if key not in printed:
            printed.add(key)
            print_problem(problem)


def say_summary(report: dict[str, Any]) -> None:
    """Print the main facts of `run --json`: culled nodes, figures, size, time and device."""
    for node, reason in report["culled"].items():
        say(f"not drawn: {node}: {reason}")
    for name, value in report["figures"].items():
        say(f"{name}: {', '.join(f'{number:.6g}' for number in (value if isinstance(value, list) else [value]))}")
    device, (width, height) = report["device"], report["size"]
    passes = amount(len(report["passes"]), "pass", "passes")
    ms = f"{report['frame_ms']['median']:.1f} ms"
    text = f"{width}×{height}, {passes}, {f'drawn in {ms}' if len(report['steps_run']) == 1 else f'{ms} a frame'}"
    say(f"{text} on {device['renderer']}" + (" (software: not comparable to a GPU)" if device["software"] else ""))


def print_error(problems: Sequence[Problem], exit_code: int, *, as_json: bool) -> None:
    """Print why a verb stopped: as text on stderr, and as the document of `--json` on stdout."""
    for problem in problems[:_SCREENFUL]:
        print_problem(problem)
    if (more := len(problems) - _SCREENFUL) > 0:
        from rendergraph.keys import MOST_PROBLEMS

        least = "at least " if len(problems) >= MOST_PROBLEMS else ""
        say(f"and {least}{amount(more, 'more error')}; --json lists {len(problems)}", always=True)
    if as_json:
        emit_json({"error": error_document(problems, exit_code)})


def error_document(problems: Sequence[Problem], exit_code: int) -> dict[str, Any]:
    return {"exit_code": exit_code, "problems": [problem.as_json() for problem in problems]}


def progress_bar(total: int) -> Bar:
    """Return the progress bar for `total` frames, which is shown only on a terminal."""
    from rendergraph.session.progress import Bar

    return Bar("frames", shown=total > 1 and on_terminal())


def on_terminal() -> bool:
    """Return whether to show progress: stderr is a terminal and not `--quiet`."""
    return sys.stderr is not None and sys.stderr.isatty() and not _Verbosity.quiet


def table(rows: Sequence[Sequence[object]], heads: Sequence[str] = (), *, right: Sequence[int] = ()) -> str:
    """Return aligned columns, on a terminal limited to its width."""
    stream = data_stream()
    if stream is None or not stream.isatty():
        return formatting.table(rows, heads, right=right)
    import shutil

    return formatting.table(rows, heads, right=right, width=shutil.get_terminal_size().columns)


def section(
    title: str, content: str | Sequence[Sequence[object]], heads: Sequence[str] = (), *, right: Sequence[int] = ()
) -> str:
    """Return a title with its text or table indented below; empty without content."""
    text = content if isinstance(content, str) else table(content, heads, right=right)
    lines = [f"  {line}".rstrip() for line in text.rstrip().splitlines()]
    return "\n".join([*([title] if title else []), *lines]) if lines else ""


def sections(*parts: str) -> str:
    return "\n\n".join(filter(None, parts))


def amount(count: int, one: str, many: str = "") -> str:
    """Return a number with its noun: `1 run`, `2 runs`."""
    return f"{count} {one if count == 1 else many or one + 's'}"


def _printable(text: str, stream: Any) -> str:
    """Return text that the stream can encode, without control characters, which a terminal would execute."""
    if not text.isprintable():
        text = re.sub(_CONTROL, lambda found: repr(found[0])[1:-1], text)
    encoding = getattr(stream, "encoding", None) or "utf-8"
    return text.encode(encoding, "backslashreplace").decode(encoding)
