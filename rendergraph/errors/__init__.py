"""Problems, where they are, and the exceptions that carry them.

A *problem* is one mistake with its place; an exception carries all problems found before stopping. Each code has one
file beside this module, `RG103-unknown-param.yaml`, with the wrong text, its exact message and the mended text; tests,
docs and `rendergraph explain RG103` read it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import ClassVar, Literal

from msgspec import Struct
from msgspec.structs import replace

_WIDEST = 200
"""Characters of a file's line that a message shows, those around the place."""


class Place(Struct, frozen=True, order=True):
    """A place in a file; line and column start at 1, 0 where a file has none (a mesh, a command-line option)."""

    file: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        if self.line:
            return f"{self.file}:{self.line}:{self.column}"
        return self.file


class Mistake(Struct, frozen=True):
    """What is wrong with one thing, as a value: a problem is made of it by whoever knows the file and the code.

    Code that must tell one mistake from another, or find its place, asks these fields and never the text.

    Attributes:
        subject: the name of what is wrong: of a port, a parameter, an argument, a resource; empty for the whole.
        text: one sentence without its end.
        kind: `doc` where only a doc is missing, `case` where only a capital letter is wrong in a name, else `wrong`.
        place: the author's line, where it is known.
    """

    subject: str
    text: str
    kind: Literal["doc", "case", "wrong"] = "wrong"
    place: Place | None = None

    def __str__(self) -> str:
        """`file:line: text`, or the text alone."""
        if self.place is None:
            return self.text
        return f"{self.place.file}:{self.place.line}: {self.text}" if self.place.line else f"{self.place}: {self.text}"

    def problem(self, code: str, before: str, place: Place | None) -> Problem:
        """`before: file:line: text`, at a place that is not the author's."""
        return Problem(code, f"{before}: {self}", place, mistake=replace(self, text=f"{before}: {self.text}"))


class Problem(Struct, frozen=True, eq=False):
    """One mistake: `file:line:col: RG103 text`, with the line of the file beneath.

    Attributes:
        code: `RG` and three digits.
        text: where, what, and the way out, in one line.
        place: where it stands, None where it stands nowhere.
        line_text: the line of the file, empty where unknown.
        severity: an `error` stops, a `warning` is said and the work goes on.
        mistake: what it was made of, for whoever looks for a place of their own; None where there was no such thing.
    """

    code: str
    text: str
    place: Place | None = None
    line_text: str = ""
    severity: Literal["error", "warning"] = "error"
    mistake: Mistake | None = None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Problem) and self._compared == other._compared

    def __hash__(self) -> int:
        return hash(self._compared)

    @property
    def _compared(self) -> tuple[object, ...]:
        """What a user reads of it: two of one text are one."""
        return self.code, self.text, self.place, self.line_text, self.severity

    def __str__(self) -> str:
        head = f"{self.place}: " if self.place else ""
        word = "warning: " if self.severity == "warning" else ""
        text = f"{head}{word}{self.code} {self.text}"
        if self.line_text and self.place and self.place.line:
            start = max(0, self.place.column - _WIDEST // 2) if len(self.line_text) > _WIDEST else 0
            shown = self.line_text.expandtabs(1)[start : start + _WIDEST]
            text += f"\n    {shown}\n    {' ' * (self.place.column - 1 - start)}^"
        return text

    def as_json(self) -> dict[str, object]:
        """The same as plain JSON values."""
        return {
            "code": self.code,
            "severity": self.severity,
            "file": self.place.file if self.place else None,
            "line": self.place.line if self.place and self.place.line else None,
            "column": self.place.column if self.place and self.place.line else None,
            "text": self.text,
        }


class RendergraphError(Exception):
    """Base of everything a user can cause; `exit_code` is the command line's."""

    exit_code: ClassVar[int] = 1

    def __init__(self, problems: Problem | Sequence[Problem]) -> None:
        self.problems: tuple[Problem, ...] = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    def __reduce__(self) -> tuple[type[RendergraphError], tuple[tuple[Problem, ...]]]:
        return type(self), (self.problems,)  # what it is made of, for another process


class InputError(RendergraphError):
    """Something named on the command line or in a file is missing or wrong: pipeline, scene, mesh, image, shader."""

    exit_code = 3


class RenderError(RendergraphError):
    """It failed while running: disk, memory, GL."""

    exit_code = 1


class Interruption(BaseException):
    """Somebody wants the program to end; nothing on the way up takes it for a failure of its own.

    Attributes:
        number: the signal's.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


def is_interruption(error: BaseException) -> bool:
    """Whether what came out of a stranger's code is none of that code's doing; anything else is, `SystemExit` too."""
    return isinstance(error, KeyboardInterrupt | Interruption)


class Misuse(Exception):
    """What a node's author asked for and cannot have, said where the author's call is still on the stack.

    The stage that called the node turns it into an `InputError` that names node, pipeline line and the author's line.
    """

    def __init__(self, text: str, code: str = "RG423") -> None:
        self.code = code
        super().__init__(text)


class SceneError(Exception):
    """What a node says of a scene that it cannot work on, in a rule of its ports, `record` or `update`: for users.

    Attributes:
        subject: the name that it speaks of, as a parameter has it; the message is shown there.
    """

    def __init__(self, text: str, subject: str = "") -> None:
        self.subject = subject
        super().__init__(text)


class UsageError(RendergraphError):
    """The command line itself is malformed."""

    exit_code = 2


class DeviceError(RendergraphError):
    """No usable GL device."""

    exit_code = 5


def shown_file(file: str | Path) -> str:
    """A path as messages print it: relative to the current folder where it lies inside."""
    try:
        return Path(file).relative_to(Path.cwd()).as_posix()
    except (ValueError, OSError):  # elsewhere, or the current folder is gone
        return str(file)


def is_framework(module: str) -> bool:
    """Whether a module is the framework's; the standard nodes are authors like anybody."""
    return module == "rendergraph" or (module.startswith("rendergraph.") and not module.startswith("rendergraph.nodes"))


def nearest(word: str, words: Iterable[str]) -> str | None:
    """The word a user most likely meant, or None.

    `difflib` alone misses beginnings (`--env` for `--environment`, `kernal` for `kernel_size`), so the one word that
    begins so comes first, and words that are near to one of the tokens count too.
    """
    from difflib import get_close_matches  # where something is misspelt alone

    known = sorted(words)
    lowered = {candidate.lower(): candidate for candidate in reversed(known)}
    begun = [candidate for low, candidate in lowered.items() if low.startswith(word.lower())]
    if len(begun) == 1 and len(word) > 2:
        return begun[0]
    close = get_close_matches(word.lower(), lowered, n=1, cutoff=0.6)
    if close:
        return lowered[close[0]]
    for low, candidate in sorted(lowered.items()):
        tokens = low.replace("-", "_").split("_")
        if get_close_matches(word.lower(), tokens, n=1, cutoff=0.75):
            return candidate
    return None


def node_named(node: str, node_type: str) -> str:
    """How messages name a node: with its type, where that is not the same word."""
    return f"node '{node}'" + (f" ({node_type})" if node_type not in ("", node) else "")


def suggestion(word: str, words: Iterable[str], *, most: int = 12) -> str:
    """`; did you mean 'x'?`, or those that begin with the word, or the whole list where it is short, or nothing."""
    known = sorted(set(words))
    family = [name for name in known if name.lower().replace("-", "_").partition("_")[0] == word.lower()]
    if len(family) > 1:
        more = f" or {len(family) - 4} more" if len(family) > 5 else ""
        return f"; did you mean one of {', '.join(family[: 4 if more else 5])}{more}?"
    near = nearest(word, known)
    if near is not None:
        return f"; did you mean '{near}'?"
    if 0 < len(known) <= most:
        return f"; there is {', '.join(known)}"
    return ""
