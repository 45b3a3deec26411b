"""The process a node is checked in: limits are set, everything is examined, the report goes back through a pipe.

`supervise` starts it with one JSON argument. Before each stage it says so, so that the parent knows what was under way
when nothing more is heard; where that was, the fault handler has written to a file of the parent's.
"""

from __future__ import annotations

import faulthandler
import json
import os
import resource
import signal
import sys
import traceback
from pathlib import Path
from typing import Any

from msgspec import to_builtins

from rendergraph.declare.blame import cause_chain, describe_error, source_location
from rendergraph.errors import Place, Problem, RendergraphError, shown_file

ENDED, OUT_OF_MEMORY = "RG450", "RG453"


def main() -> None:
    """Examine what the argument names and report."""
    asked = json.loads(sys.argv[1])
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # Private writable memory, and not the address space: drivers reserve much of that and use little.
    resource.setrlimit(resource.RLIMIT_DATA, (asked["memory"], asked["memory"]))
    trace = os.fdopen(asked["trace"], "wb", buffering=0)
    faulthandler.enable(trace, all_threads=False)
    faulthandler.register(signal.SIGUSR1, trace, all_threads=False)
    leave = os._exit

    def told_exit(status: int) -> None:
        faulthandler.dump_traceback(trace, all_threads=False)
        leave(status)

    os._exit = told_exit  # type: ignore[assignment]  # so that whoever calls it can be named
    pipe = os.fdopen(asked["pipe"], "w", buffering=1, encoding="utf-8")

    def send(**event: Any) -> None:
        pipe.write("\n" + json.dumps(event) + "\n")  # a node may have written half a line
        pipe.flush()

    file = Path(asked["file"])
    try:
        from rendergraph.authoring.examine import examine_file  # what fails here is told, too

        plugins = [Path(plugin) for plugin in asked["plugins"]]
        report = examine_file(file, plugins, asked["scene"], lambda stage, what: send(stage=stage, what=what))
        problems = [to_builtins(_shown(problem)) for problem in report.problems]
        send(report={"node": report.node, "variants": report.variants, "problems": problems})
    except RendergraphError as error:
        found = [_memory(file, asked["memory"], error) or problem for problem in error.problems]
        send(failed=[to_builtins(_shown(problem)) for problem in dict.fromkeys(found)], exit_code=error.exit_code)
    except BaseException as error:  # whatever a stranger's code can raise, and our own mistakes
        memory = _memory(file, asked["memory"], error)
        send(**{"failed": [to_builtins(memory)], "exit_code": 3} if memory else _other(file, error))
    leave(0)  # no handlers and threads of a stranger's at the end


def _shown(problem: Problem) -> Problem:
    """The same with its file as messages print it."""
    place = problem.place
    if place is None or not place.file:
        return problem
    return problem.relocate(Place(shown_file(place.file), place.line, place.column), problem.line_text)


def _memory(file: Path, limit: int, error: BaseException) -> Problem | None:
    """What to say where memory ran out, however it is wrapped."""
    if not any(isinstance(cause, MemoryError) for cause in cause_chain(error)):
        return None
    text = f"it takes more than the {limit / 2**20:.0f} MiB of memory that it may; --limit memory=MiB allows more"
    return Problem(OUT_OF_MEMORY, text, source_location(error, file) or Place(shown_file(file)))


def _other(file: Path, error: BaseException) -> dict[str, Any]:
    """What to send for anything else: the author's where it came through the author's lines, else our own mistake."""
    place = source_location(error, file)
    if place is None:
        return {"mistake": "".join(traceback.format_exception(error))}
    return {"failed": [to_builtins(Problem(ENDED, f"it raises {describe_error(error)}", place))], "exit_code": 3}
