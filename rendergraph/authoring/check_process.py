"""Check a node in a process with limits, so that every failure of its code becomes a message.

The limits were measured with Mesa's llvmpipe on two cores: a context maps 0.75 GB of address space and writes to
0.15 GB of it, `forward` maps 0.83 GB and writes to 0.24 GB. The limit is therefore on memory that can be written
(RLIMIT_DATA); a GPU's driver reserves far more address space than 2 GB.
"""

from __future__ import annotations

import faulthandler
import json
import os
import re
import select
import signal
import subprocess
import tempfile
import time
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from msgspec import ValidationError, convert, to_builtins

from rendergraph.authoring.harness import Report
from rendergraph.catalog.types import SHADERS
from rendergraph.declare.blame import cause_chain, describe_error, source_location
from rendergraph.errors import DeviceError, InputError, Place, Problem, RenderError, RendergraphError, shown_file
from rendergraph.farm.worker_process import ChildProcess
from rendergraph.system import limit_memory

_ERRORS = {1: RenderError, 3: InputError, 5: DeviceError}
_STARTUP_SECONDS = 20.0
"""Seconds for starting Python, importing the framework and opening a context."""
_LONGEST_MESSAGE = 16 << 20
_OUTPUT_BYTES = 4096
"""Characters kept from the end of the node's output, which may be endless."""


@dataclass(frozen=True)
class CheckLimits:
    """What a check may take: seconds to import and per variant, bytes of memory."""

    import_seconds: float = 10
    pass_seconds: float = 30
    memory: int = 2 << 30


def check_node(
    file: Path, *, plugins: Sequence[Path] = (), scene: str | None = None, limits: CheckLimits = CheckLimits()
) -> Report:
    """Examine the node of a file in a child process; geometry nodes render `scene`, a shipped name or a file.

    An InputError reports that it cannot be loaded, ends or crashes its process, hangs, or needs too much memory.
    """
    if file.suffix not in (".py", *SHADERS) or file.is_dir():
        kinds = f"a Python module or a shader file ({', '.join(SHADERS)})"
        raise InputError(Problem("RG461", f"'{file}' is not a node file; pass {kinds}"))
    if not file.is_file():
        raise InputError(Problem("RG011", f"there is no file '{file}'"))
    arguments = {
        "file": str(file.resolve()),
        "plugins": [str(plugin.resolve()) for plugin in plugins],
        "scene": str(Path(scene).resolve()) if scene and re.search(r"[./]", scene) else scene,
        "memory": limits.memory,
    }
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:  # the child may die before it removes it
        check = _Check(arguments, limits, folder)
        try:
            return check.report()
        finally:
            check.close()


class _Check:
    def __init__(self, arguments: dict[str, Any], limits: CheckLimits, folder: str) -> None:
        self._file, self._limits = arguments["file"], limits
        self._trace = Path(folder) / "trace"
        self._trace.touch()
        arguments |= {"trace": str(self._trace)}
        self._child = ChildProcess(f"{__name__}:main", arguments, {"TMPDIR": folder}, subprocess.PIPE)
        self._process = self._child.process
        assert self._process.stdout is not None
        self._stdout = self._process.stdout
        self._output = b""
        self._stage = self._variant = ""

    def close(self) -> None:
        self._child.kill()
        self._stdout.close()

    def report(self) -> Report:
        for message in self._messages():
            match message:
                case {"stage": str(stage), "what": str(variant)}:
                    self._stage, self._variant = stage, variant
                case {"report": {"node": str(node), "variants": list(variants), "problems": list(problems)}}:
                    if (found := _problems(problems)) is not None:
                        return Report(node, tuple(variants), found)
                case {"mistake": str(text)}:
                    raise RuntimeError(text)  # an internal error
                case {"failed": [*problems], "exit_code": int(code)}:
                    if found := _problems(problems):
                        raise _ERRORS.get(code, RenderError)(found)
        raise InputError(self._exit_problem())

    def _messages(self) -> Iterator[object]:
        """Yield messages until the process ends or closes its pipe; raise InputError if a stage takes too long."""
        pipe, output = self._child.pipe.fileno(), self._stdout.fileno()
        sources, rest = {pipe, output}, b""
        end = time.monotonic() + self._seconds()
        while pipe in sources:
            ready, _, _ = select.select(sources, [], [], min(0.2, max(0.0, end - time.monotonic())))
            for source in ready:
                chunk = os.read(source, 1 << 16)
                if not chunk:
                    sources.remove(source)
                elif source == output:
                    self._output = (self._output + chunk)[-_OUTPUT_BYTES:]
                else:
                    *lines, rest = (rest + chunk).split(b"\n")
                    rest = rest[-_LONGEST_MESSAGE:]
                    for line in lines:
                        yield _decode(line)
                        end = time.monotonic() + self._seconds()
            if time.monotonic() >= end:
                raise InputError(self._timeout_problem())
            if not ready and self._process.poll() is not None:
                return  # a process that the child started may still hold the pipe

    def _seconds(self) -> float:
        limits = {"import": self._limits.import_seconds, "pass": self._limits.pass_seconds}
        return limits.get(self._stage, _STARTUP_SECONDS)

    # --- messages ----------------------------------------------------------------------------------------------------

    def _during(self) -> str:
        stages = {"import": "while it is imported", "pass": f"in variant '{self._variant}'"}
        return stages.get(self._stage, "at the start")

    def _timeout_problem(self) -> Problem:
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGUSR1)  # the fault handler writes the current line
            time.sleep(0.2)
        name = "pass-seconds" if self._stage == "pass" else "import-seconds"
        text = f"it takes longer than {self._seconds():g} s {self._during()}; --limit {name}=N allows more"
        return Problem("RG452", text, self._place())

    def _exit_problem(self) -> Problem:
        try:
            status = self._process.wait(self._seconds())
        except subprocess.TimeoutExpired:  # it closed its pipe but is still running
            return self._timeout_problem()
        lines = self._output.decode("utf-8", "replace").strip().splitlines()
        last = f"; its last output: {lines[-1][:200]}" if lines else ""
        if status >= 0:
            return Problem("RG450", f"it ends the process with status {status} {self._during()}{last}", self._place())
        text = f"it crashes the process ({signal.Signals(-status).name}) {self._during()}{last}"
        return Problem("RG451", text, self._place())

    def _place(self) -> Place:
        """Return the line of the author's file that was running; the fault handler writes the innermost call first."""
        trace = self._trace.read_bytes()[: 1 << 20].decode("utf-8", "replace")
        found = re.search(rf'File "{re.escape(self._file)}", line (\d+)', trace)
        return Place(shown_file(self._file), int(found[1]) if found else 0, 1 if found else 0)


def _decode(line: bytes) -> object:
    """Return the child's message; None for output that the node itself wrote into the pipe."""
    try:
        return json.loads(line)
    except (ValueError, RecursionError):
        return None


def _problems(entries: Sequence[Any]) -> tuple[Problem, ...] | None:
    try:
        return convert(entries, tuple[Problem, ...])
    except ValidationError:
        return None


# --- in the child -----------------------------------------------------------------------------------------------------


def main(pipe: int, file: str, plugins: Sequence[str], scene: str | None, memory: int, trace: str) -> None:
    """Set the limits, examine a node, and report through the pipe as lines of JSON; runs in the child process.

    It announces each stage, so that the parent knows what was running when messages stop; the fault handler writes
    the line to the file `trace`.
    """
    limit_memory(memory)
    traces = open(trace, "wb", buffering=0)  # noqa: SIM115  # until the process ends
    faulthandler.enable(traces, all_threads=False)
    faulthandler.register(signal.SIGUSR1, traces, all_threads=False)
    leave = os._exit

    def exit_with_trace(status: int) -> None:
        faulthandler.dump_traceback(traces, all_threads=False)
        leave(status)

    os._exit = exit_with_trace  # type: ignore[assignment]  # so that the message can name the line that calls it
    messages = os.fdopen(pipe, "w", buffering=1, encoding="utf-8")

    def send(**message: Any) -> None:
        messages.write("\n" + json.dumps(message) + "\n")  # the node may have written half a line
        messages.flush()

    path = Path(file)
    try:
        from rendergraph.authoring.examine import examine_file  # a failing import is reported, too

        report = examine_file(path, list(map(Path, plugins)), scene, lambda stage, what: send(stage=stage, what=what))
        problems = [_as_json(problem) for problem in report.problems]
        send(report={"node": report.node, "variants": report.variants, "problems": problems})
    except RendergraphError as error:
        found = [_out_of_memory(path, memory, error) or problem for problem in error.problems]
        send(failed=[_as_json(problem) for problem in dict.fromkeys(found)], exit_code=error.exit_code)
    except BaseException as error:  # anything that third-party code raises, and internal errors
        problem, place = _out_of_memory(path, memory, error), source_location(error, path)
        if problem is None and place is not None:
            problem = Problem("RG450", f"it raises {describe_error(error)}", place)
        if problem is not None:
            send(failed=[_as_json(problem)], exit_code=3)
        else:
            send(mistake="".join(traceback.format_exception(error)))
    leave(0)  # skips the node's exit handlers and threads


def _as_json(problem: Problem) -> Any:
    place = problem.place
    if place is not None and place.file:
        problem = problem.relocate(Place(shown_file(place.file), place.line, place.column), problem.line_text)
    return to_builtins(problem)


def _out_of_memory(file: Path, limit: int, error: BaseException) -> Problem | None:
    if not any(isinstance(cause, MemoryError) for cause in cause_chain(error)):
        return None
    text = f"it needs more memory than the limit of {limit / 2**20:.0f} MiB; --limit memory=MiB allows more"
    return Problem("RG453", text, source_location(error, file) or Place(shown_file(file)))
