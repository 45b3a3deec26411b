"""Problems, where they are, and the exceptions that carry them.

A *problem* is one mistake with its place; an exception carries all problems found before stopping. Each code has one
file beside this module, `RG103-unknown-param.yaml`, with the wrong text, its exact message and the mended text; tests,
docs and `rendergraph explain RG103` read it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import ClassVar, Literal, Self

from msgspec import Struct
from msgspec.structs import replace

_WIDEST = 200
"""Characters of a file's line that a message shows, those around the place."""
_LONGEST_OPTION = 80


class Option(Struct, frozen=True):
    """A command-line option as the origin of a mistake, or the argument of the Python API that stands for it.

    Attributes:
        name: `--set`, or `patch` for a patch given in Python.
        text: what was given, as typed; empty where only the option matters.
    """

    name: str
    text: str = ""

    def __str__(self) -> str:
        text = self.text if len(self.text) <= _LONGEST_OPTION else self.text[: _LONGEST_OPTION - 1] + "…"
        return f"{self.name} {printable(text)}" if text else self.name

    @property
    def path(self) -> str:
        """The path that `PATH=VALUE` sets."""
        return self.text.partition("=")[0]


class Place(Struct, frozen=True):
    """A place in a file, or an option; line and column start at 1, 0 where the origin has no lines (a mesh, an option).

    Attributes:
        origin: a file as messages name it, or what the user typed.
    """

    origin: str | Option
    line: int = 0
    column: int = 0

    @property
    def file(self) -> str:
        """The file, empty for an option."""
        return self.origin if isinstance(self.origin, str) else ""

    def option(self, *names: str) -> Option | None:
        """The option that this is a place in, where it has one of the names."""
        return self.origin if isinstance(self.origin, Option) and self.origin.name in names else None

    def __str__(self) -> str:
        return f"{self.origin}:{self.line}:{self.column}" if self.line else str(self.origin)


class Problem(Struct, frozen=True, eq=False):
    """One mistake: `file:line:col: RG103 text`, with the line of the file beneath.

    Code that must distinguish problems, or find their place, reads the fields and never the text.

    Attributes:
        code: `RG` and three digits.
        text: what is wrong and the fix, in one line.
        place: where the user can mend it; None where there is no such place.
        line_text: the line of the file, empty where unknown.
        severity: an `error` stops, a `warning` is reported and the work goes on.
        subject: the name of what is wrong: a port, a parameter, an argument, a resource; empty for the whole.
        context: the node, the file or the option that the problem concerns, printed before the text.
        cause: the line of a plugin author's code that it comes from, where `place` is one of the pipeline's.
        hint: what only the caller knows, printed after the text.
    """

    code: str
    text: str
    place: Place | None = None
    line_text: str = ""
    severity: Literal["error", "warning"] = "error"
    subject: str = ""
    context: str = ""
    cause: Place | None = None
    hint: str = ""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Problem) and self._compared == other._compared

    def __hash__(self) -> int:
        return hash(self._compared)

    @property
    def _compared(self) -> tuple[object, ...]:
        """Two problems that read the same are one."""
        return self.code, self.message, self.place, self.line_text, self.severity

    @property
    def message(self) -> str:
        """The text with all that is printed around it: `context: file:line: text; hint`."""
        cause = f"{self.cause.origin}:{self.cause.line or ''}".rstrip(":") if self.cause else ""
        return ": ".join(filter(None, (self.context, cause, self.text))) + self.hint

    def __str__(self) -> str:
        head = f"{self.place}: " if self.place else ""
        word = "warning: " if self.severity == "warning" else ""
        text = f"{head}{word}{self.code} {self.message}"
        if self.line_text and self.place and self.place.line:
            start = max(0, self.place.column - _WIDEST // 2) if len(self.line_text) > _WIDEST else 0
            shown = self.line_text.expandtabs(1)[start : start + _WIDEST]
            text += f"\n    {shown}\n    {' ' * (self.place.column - 1 - start)}^"
        return text

    def relocate(
        self,
        place: Place | None,
        line_text: str = "",
        *,
        code: str = "",
        context: str = "",
        cause: Place | None = None,
        hint: str = "",
    ) -> Problem:
        """Return the same problem at another place, where its reader can mend it.

        Args:
            place: the new place.
            line_text: the line of the file there.
            code: the new code, where the same mistake has another one there.
            context: printed before everything else.
            cause: the plugin author's line, where the problem has none yet.
            hint: printed after everything else, with its own punctuation.
        """
        context = ": ".join(filter(None, (context, self.context)))
        return replace(
            self,
            code=code or self.code,
            place=place,
            line_text=line_text,
            context=context,
            cause=self.cause or cause,
            hint=self.hint + hint,
        )

    def at_cause(self, place: Place | None) -> Problem:
        """Return the same problem for the plugin author: at their line, or else at another place of theirs."""
        return replace(self, place=self.cause or place, line_text="", cause=None)

    def as_warning(self) -> Problem:
        """Return the same as a warning."""
        return replace(self, severity="warning")

    def as_json(self) -> dict[str, object]:
        """Return what messages show as plain JSON values."""
        return {
            "code": self.code,
            "severity": self.severity,
            "file": str(self.place.origin) if self.place else None,
            "line": self.place.line if self.place and self.place.line else None,
            "column": self.place.column if self.place and self.place.line else None,
            "text": self.message,
        }


class RendergraphError(Exception):
    """Base of everything a user can cause; `exit_code` is the command line's."""

    exit_code: ClassVar[int] = 1

    def __init__(self, problems: Problem | Sequence[Problem]) -> None:
        self.problems: tuple[Problem, ...] = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    def __reduce__(self) -> tuple[type[RendergraphError], tuple[tuple[Problem, ...]]]:
        return type(self), (self.problems,)  # to be raised again in another process

    def relocated(self, relocate: Callable[[Problem], Problem]) -> Self:
        """Return the same error with each of its problems relocated."""
        return type(self)([relocate(problem) for problem in self.problems])


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


def printable(text: str) -> str:
    """The text with control characters escaped, so that it stays in one line of a message."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode() for c in text)


def shown_file(file: str | Path) -> str:
    """A path as messages print it: relative to the current folder where it lies inside."""
    try:
        return Path(file).relative_to(Path.cwd()).as_posix()
    except (ValueError, OSError):  # elsewhere, or the current folder is gone
        return str(file)


def is_framework(module: str) -> bool:
    """Whether a module is the framework's; the standard nodes are authors like anybody."""
    return module == "rendergraph" or (module.startswith("rendergraph.") and not module.startswith("rendergraph.nodes"))


def nearest(word: str, words: Iterable[str], *, floor: float = 0.6) -> str | None:
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
    close = get_close_matches(word.lower(), lowered, n=1, cutoff=floor)
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
    """Return `; did you mean 'x'?`, or the names that begin with the word, or a short list of all, or nothing."""
    known = sorted(set(words))
    family = [name for name in known if name.lower().replace("-", "_").partition("_")[0] == word.lower()]
    if len(family) > 1:
        more = f" or {len(family) - 4} more" if len(family) > 5 else ""
        return f"; did you mean one of {', '.join(family[: 4 if more else 5])}{more}?"
    near = nearest(word, known)
    if near is not None:
        return f"; did you mean '{near}'?"
    if 0 < len(known) <= most:
        return f"; available: {', '.join(known)}"
    return ""
