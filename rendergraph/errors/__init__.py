"""Problems, where they are, and the exceptions that carry them.

A *problem* is one mistake with its place; an exception carries all problems found before stopping. Each code has one
file beside this module, `RG103-unknown-param.yaml`, with the wrong text, its exact message and the corrected text;
tests, docs and `rendergraph explain RG103` read it.
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
EXIT_CODES = {
    0: "success",
    1: "failed while running: disk, memory, GL",
    2: "wrong command line: unknown verb or option, malformed value",
    3: "an error in a file, or something missing: pipeline, scene, mesh, image, shader",
    4: "a comparison exceeded its threshold",
    5: "no usable GL device",
    130: "interrupted",
    143: "terminated",
}


class Option(Struct, frozen=True):
    """A command-line option as the origin of a mistake, or the argument of the Python API that corresponds to it.

    Attributes:
        name: `--set`, or `pipeline` or `patch` for values given in Python.
        text: as typed; empty if only the option matters. Of a value in Python its keys: `nodes.ao.params.radius`.
    """

    name: str
    text: str = ""

    def __str__(self) -> str:
        if self.text and not self.name.startswith("-"):
            return f"{self.name}.{printable(self.text)}"
        text = self.text if len(self.text) <= _LONGEST_OPTION else self.text[: _LONGEST_OPTION - 1] + "…"
        return f"{self.name} {printable(text)}" if text else self.name

    @property
    def path(self) -> str:
        """The path that `PATH=VALUE` sets."""
        return self.text.partition("=")[0]


class Place(Struct, frozen=True):
    """A place in a file, as messages name it, or an option.

    Line and column start at 1; they are 0 for an origin without lines, such as a mesh or an option.
    """

    origin: str | Option
    line: int = 0
    column: int = 0

    @property
    def file(self) -> str:
        """The file, empty for an option."""
        return self.origin if isinstance(self.origin, str) else ""

    def option(self, *names: str) -> Option | None:
        """Return the option that this place is in, if it has one of the names."""
        return self.origin if isinstance(self.origin, Option) and self.origin.name in names else None

    def __str__(self) -> str:
        return f"{self.origin}:{self.line}:{self.column}" if self.line else str(self.origin)


class Problem(Struct, frozen=True, eq=False):
    """One mistake: `file:line:col: RG103 text`, with the line of the file beneath.

    Code that must distinguish problems, or find their place, reads the fields and never the text.

    Attributes:
        code: `RG` and three digits.
        text: what is wrong and the fix, in one line.
        place: where the user can correct it, if there is such a place.
        line_text: the line of the file, empty if unknown.
        severity: an `error` stops, a `warning` is reported and the work continues.
        subject: the name of a port, a parameter, an argument, or a resource that is wrong; empty for the whole.
        context: the node, the file or the option that the problem concerns, printed before the text.
        cause: the line of a plugin author's code that it comes from, if `place` is one of the pipeline's.
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
        """Return what makes two problems equal: everything that is printed."""
        return self.code, self.message, self.place, self.line_text, self.severity

    @property
    def message(self) -> str:
        """The text with everything that is printed around it: `context: file:line: text; hint`."""
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
        """Return the same problem at another place, where its reader can correct it.

        Args:
            place, line_text: the new place, and the line of the file there.
            code: the new code, if the same mistake has another one there.
            context, hint: printed before and after everything else.
            cause: the plugin author's line, if the problem has none yet.
        """
        context = ": ".join(filter(None, (context, self.context)))
        code, cause, hint = code or self.code, self.cause or cause, self.hint + hint
        return replace(self, code=code, place=place, line_text=line_text, context=context, cause=cause, hint=hint)

    def at_cause(self, place: Place | None) -> Problem:
        """Return the same problem for the plugin author: at their line, or else at another place of theirs."""
        return replace(self, place=self.cause or place, line_text="", cause=None)

    def as_warning(self) -> Problem:
        """Return the problem as a warning."""
        return replace(self, severity="warning")

    def as_json(self) -> dict[str, object]:
        """Return the fields of the message as plain JSON values."""
        line, column = (self.place.line, self.place.column) if self.place and self.place.line else (None, None)
        return {
            "code": self.code,
            "severity": self.severity,
            "file": str(self.place.origin) if self.place else None,
            "line": line,
            "column": column,
            "text": self.message,
        }


class RendergraphError(Exception):
    """Base class of errors that a user can cause; `exit_code` is that of the command line."""

    exit_code: ClassVar[int] = 1

    def __init__(self, problems: Problem | Sequence[Problem]) -> None:
        self.problems: tuple[Problem, ...] = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    def __reduce__(self) -> tuple[type[RendergraphError], tuple[tuple[Problem, ...]]]:
        return type(self), (self.problems,)  # picklable, to be raised again in another process

    def _render_traceback_(self) -> list[str]:
        """Return what a notebook shows: the message with the place of each mistake, without lines of the framework."""
        return [f"{type(self).__name__}: {self}"]

    def relocated(self, relocate: Callable[[Problem], Problem]) -> Self:
        """Return the same error with each of its problems relocated."""
        return type(self)([relocate(problem) for problem in self.problems])


class InputError(RendergraphError):
    """Something named on the command line or in a file is missing or wrong: pipeline, scene, mesh, image, shader."""

    exit_code = 3


class RenderError(RendergraphError):
    """Rendering or writing failed: disk, memory, GL."""


class Interruption(BaseException):
    """A signal that ends the program; error handlers do not catch it."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


def is_interruption(error: BaseException) -> bool:
    """Return whether an exception ends the program, rather than being an error of third-party code."""
    return isinstance(error, KeyboardInterrupt | Interruption)


class Misuse(Exception):
    """A mistake of a node's author, raised while the author's call is on the stack.

    The stage that called the node turns it into an `InputError` with the node, the pipeline's line and the author's
    line, which is `place` if the call is no longer on the stack.
    """

    def __init__(self, text: str, code: str = "RG423", place: Place | None = None) -> None:
        self.code, self.place = code, place
        super().__init__(text)


class SceneError(Exception):
    """A node cannot use this scene: raised in a rule of its ports, in `record` or `update`, for users.

    `subject` may name a parameter, whose place is then that of the message, or an output that cannot be used.
    """

    def __init__(self, text: str, subject: str = "") -> None:
        self.subject = subject
        super().__init__(text)


class UsageError(RendergraphError):
    """The command line is malformed."""

    exit_code = 2


class DeviceError(RendergraphError):
    """There is no usable GL device."""

    exit_code = 5


def printable(text: str) -> str:
    """Return the text with control characters escaped, so that it stays in one line of a message."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode() for c in text)


def shown_file(file: str | Path) -> str:
    """Return a path as messages print it: relative to the current folder if it lies inside."""
    try:
        return Path(file).relative_to(Path.cwd()).as_posix()
    except (ValueError, OSError):  # elsewhere, or the current folder is gone
        return str(file)


def is_framework(module: str) -> bool:
    """Return whether a module is the framework's; the standard nodes count as plugins."""
    return module == "rendergraph" or (module.startswith("rendergraph.") and not module.startswith("rendergraph.nodes"))


def nearest(word: str, words: Iterable[str], *, floor: float = 0.6) -> str | None:
    """Return the word that a user most likely meant, or None.

    `difflib` alone misses prefixes (`--env` for `--environment`, `kernal` for `kernel_size`), so a single word with
    that prefix comes first, and words that are similar to one of the tokens count, too.
    """
    from difflib import get_close_matches  # only for misspelt words

    lowered = {candidate.lower(): candidate for candidate in sorted(words, reverse=True)}
    begun = [candidate for low, candidate in lowered.items() if low.startswith(word.lower())]
    if len(begun) == 1 and len(word) > 2:
        return begun[0]
    if close := get_close_matches(word.lower(), lowered, n=1, cutoff=floor):
        return lowered[close[0]]
    for low, candidate in sorted(lowered.items()):
        if get_close_matches(word.lower(), low.replace("-", "_").split("_"), n=1, cutoff=0.75):
            return candidate
    return None


def node_named(node: str, node_type: str) -> str:
    """Return how messages name a node: with its type, unless that is the same word."""
    return f"node '{node}'" + (f" ({node_type})" if node_type not in ("", node) else "")


def suggestion(word: str, words: Iterable[str], *, most: int = 12) -> str:
    """Return `; did you mean 'x'?`, or the names that begin with the word, or a short list of all, or nothing."""
    known = sorted({str(word) for word in words})  # a file's names may be numbers
    family = [name for name in known if name.lower().replace("-", "_").partition("_")[0] == word.lower()]
    if len(family) > 1:
        more = f" or {len(family) - 4} more" if len(family) > 5 else ""
        return f"; did you mean one of {', '.join(family[: 4 if more else 5])}{more}?"
    if (near := nearest(word, known)) is not None:
        return f"; did you mean '{near}'?"
    return f"; available: {', '.join(known)}" if 0 < len(known) <= most else ""
