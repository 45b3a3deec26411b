"""Checking a node in a process of its own, with limits, so that whatever it does ends in a message.

What it may take was measured with Mesa's llvmpipe on two cores: a context maps 0.75 GB of address space and writes to
0.15 GB of it, `forward` maps 0.83 GB and writes to 0.24 GB. The limit is therefore on what can be written
(RLIMIT_DATA); a GPU's driver reserves far more address space than 2 GB.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import select
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from msgspec import ValidationError, convert

from rendergraph.authoring.report import Report
from rendergraph.catalog.types import SHADERS
from rendergraph.errors import DeviceError, InputError, Place, Problem, RenderError, shown_file

_ERRORS = {1: RenderError, 3: InputError, 5: DeviceError}
_OVERHEAD = 20.0
"""Seconds for what is not the node's: starting Python, importing the framework, opening a context."""
_LONGEST = 16 << 20
"""Bytes of a line that the child may send; a report has far fewer."""


@dataclass(frozen=True)
class CheckLimits:
    """What a check may take.

    Attributes:
        import_seconds: until the node's module is loaded.
        pass_seconds: for compiling and drawing one variant.
        memory: bytes.
    """

    import_seconds: float = 10
    pass_seconds: float = 30
    memory: int = 2 << 30


def check_node(
    file: Path, *, plugins: Sequence[Path] = (), scene: str | None = None, limits: CheckLimits = CheckLimits()
) -> Report:
    """Examine the node of a file in a child process.

    Args:
        file: a Python module or a shader file.
        plugins: further plugins that it needs.
        scene: what geometry nodes draw, a shipped name or a file; one that has something of everything by default.
        limits: what it may take.

    Raises:
        InputError: it cannot be loaded, ends or crashes its process, hangs, or takes too much memory.
        DeviceError: there is no usable GL device.
    """
    if file.suffix not in (".py", *SHADERS) or file.is_dir():
        kinds = f"a Python module or a shader file ({', '.join(SHADERS)})"
        raise InputError(Problem("RG461", f"'{file}' is no node; name the file of one: {kinds}"))
    if not file.is_file():
        raise InputError(Problem("RG011", f"there is no file '{file}'"))
    asked = {
        "file": str(file.resolve()),
        "plugins": [str(plugin.resolve()) for plugin in plugins],
        "scene": str(Path(scene).resolve()) if scene and re.search(r"[./]", scene) else scene,
        "memory": limits.memory,
    }
    with _Child(asked, limits) as child:
        return child.report()


@dataclass
class _Child:
    """One running check."""

    asked: dict[str, Any]
    limits: CheckLimits
    stage: str = "start"
    what: str = ""
    _last: deque[str] = field(default_factory=lambda: deque(maxlen=5))

    def __enter__(self) -> _Child:
        self._trace: IO[bytes] = tempfile.TemporaryFile()
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)  # ours: the child may not come to it
        self._events, child_end = os.pipe()
        words = json.dumps(self.asked | {"pipe": child_end, "trace": self._trace.fileno()})
        program = "from rendergraph.authoring.child import main; main()"
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", program, words],
                pass_fds=(child_end, self._trace.fileno()),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                text=True,
                errors="replace",
                env=os.environ | {"TMPDIR": self._folder.name},
            )
        finally:
            os.close(child_end)
        self._reader = threading.Thread(target=self._drain, daemon=True)
        self._reader.start()
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._folder.cleanup()
        os.close(self._events)
        self._trace.close()
        self._reader.join(1)
        if self._process.stdout is not None and not self._reader.is_alive():
            self._process.stdout.close()

    def _drain(self) -> None:
        """Keep the last lines it prints, and no more: it may print for ever."""
        assert self._process.stdout is not None
        with contextlib.suppress(ValueError, OSError):
            while chunk := self._process.stdout.readline(4096):
                if chunk.strip():
                    self._last.append(chunk.strip())

    # Waiting ----------------------------------------------------------------------------------------------------------

    def report(self) -> Report:
        """What it found.

        Raises:
            InputError: see `check_node`.
        """
        for event in self._heard():
            match event:
                case {"stage": str(stage), "what": str(what)}:
                    self.stage, self.what = stage, what
                case {"report": {"node": str(node), "variants": list(variants), "problems": list(problems)}}:
                    if (found := _problems(problems)) is not None:
                        return Report(node, tuple(variants), found)
                case {"mistake": str(text)}:
                    raise RuntimeError(text)  # ours
                case {"failed": [*problems], "exit_code": int(code)}:
                    if found := _problems(problems):
                        raise _ERRORS.get(code, RenderError)(found)
        raise InputError(self._ended())

    def _heard(self) -> Iterator[object]:
        """Events until the process ends.

        Raises:
            InputError: a stage took too long.
        """
        rest = b""
        end = time.monotonic() + self._seconds()
        while True:
            ready, _, _ = select.select([self._events], [], [], min(0.2, max(0.0, end - time.monotonic())))
            if ready:
                chunk = os.read(self._events, 1 << 16)
                if not chunk:
                    return
                *lines, rest = (rest + chunk).split(b"\n")
                rest = rest[-_LONGEST:]
                for line in lines:
                    yield _event(line)
                    end = time.monotonic() + self._seconds()
            elif time.monotonic() >= end:
                raise InputError(self._too_slow())
            elif self._process.poll() is not None:
                return  # a process of its own making may still hold the pipe

    def _seconds(self) -> float:
        return {"import": self.limits.import_seconds, "pass": self.limits.pass_seconds}.get(self.stage, _OVERHEAD)

    # What to say ------------------------------------------------------------------------------------------------------

    def _doing(self) -> str:
        return {"import": "while it is imported", "pass": f"in variant '{self.what}'"}.get(self.stage, "at the start")

    def _too_slow(self) -> Problem:
        with contextlib.suppress(ProcessLookupError):
            self._process.send_signal(signal.SIGUSR1)  # the fault handler writes where it is
        time.sleep(0.2)
        name = "pass-seconds" if self.stage == "pass" else "import-seconds"
        text = f"it takes longer than {self._seconds():g} s {self._doing()}; --limit {name}=N allows more"
        return Problem("RG452", text, self._place())

    def _ended(self) -> Problem:
        try:
            status = self._process.wait(self._seconds())
        except subprocess.TimeoutExpired:  # it has closed what it would report through, and goes on
            return self._too_slow()
        self._reader.join(1)
        words = f"; its last words: {self._last[-1][:200]}" if self._last else ""
        if status >= 0:
            return Problem("RG450", f"it ends the process with status {status} {self._doing()}{words}", self._place())
        name = signal.Signals(-status).name
        text = f"it crashes the process ({name}) {self._doing()}{words}"
        return Problem("RG451", text, self._place())

    def _place(self) -> Place:
        """The line of the author's file that was running, as the fault handler has it: the innermost stands first."""
        self._trace.seek(0)
        trace = self._trace.read(1 << 20).decode("utf-8", "replace")
        file = self.asked["file"]
        found = re.search(rf'File "{re.escape(file)}", line (\d+)', trace)
        return Place(shown_file(file), int(found[1]) if found else 0, 1 if found else 0)


def _event(line: bytes) -> object:
    """What the child says; what a node writes into the pipe itself says nothing."""
    try:
        return json.loads(line)
    except (ValueError, RecursionError):
        return None


def _problems(entries: Sequence[Any]) -> tuple[Problem, ...] | None:
    """What the child tells; None where somebody else has written."""
    try:
        return convert(entries, tuple[Problem, ...])
    except ValidationError:
        return None
