"""The render process: started, asked, ended when it does not answer, and started again.

A shader that hangs, a driver that crashes, a size that memory does not hold end this process, and nothing else: the
server says what happened, keeps what was changed, and the next question starts another one.
"""

from __future__ import annotations

import contextlib
import json
import signal
import socket
import subprocess
import sys
import threading
from multiprocessing.connection import Connection

from rendergraph.errors import Problem, RenderError, RendergraphError
from rendergraph.viewer.questions import Answer, Question

PATIENCE = 30.0
"""Seconds that a question may take; the first ones of a process may take longer: it starts, and compiles."""
FIRST = 120.0


class Child:
    """A process that answers questions, one at a time. To be used from any one thread at a time."""

    def __init__(self, device: int | None = None, patience: float = PATIENCE) -> None:
        self._device, self._patience = device, patience
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._pipe: Connection | None = None
        self._answered = False

    @property
    def pid(self) -> int | None:
        """Of the process that runs, None where none does."""
        return self._process.pid if self._process is not None else None

    def start(self) -> None:
        """Start the process, which takes a while, before it is asked."""
        with self._lock:
            self._pipe = self._pipe or self._start()

    def ask(self, question: Question) -> Answer:
        """Its answer.

        Raises:
            RenderError: the process took too long, or died; the next question starts another.
        """
        with self._lock:
            pipe = self._pipe or self._start()
            patience = self._patience if self._answered else max(FIRST, self._patience)
            try:
                pipe.send(question)
                if not pipe.poll(patience):
                    self._end()
                    text = (
                        f"the render process did not answer within {patience:.0f} s and was ended; "
                        "undo the last change, or allow more by --timeout"
                    )
                    raise RenderError(Problem("RG630", text))
                answer = pipe.recv()
            except (EOFError, OSError):
                code = self._ended_by()
                self._end()
                text = f"the render process ended ({code}); a driver that crashes, or memory that runs out, does that"
                raise RenderError(Problem("RG630", text)) from None
            self._answered = True
            if isinstance(answer, BaseException):
                self._end()
                raise answer
            assert isinstance(answer, Answer)
            return answer

    def close(self) -> None:
        """End the process."""
        with self._lock:
            self._end()

    def _start(self) -> Connection:
        # Not by `multiprocessing`: it would run the caller's script once more, which need not be written for that.
        ours, theirs = socket.socketpair()
        words = json.dumps({"pipe": theirs.fileno(), "path": sys.path, "device": self._device})
        program = "import json, sys; words = json.loads(sys.argv[1]); sys.path[:] = words['path']\n"
        program += "from rendergraph.viewer.child import main; main(words['pipe'], words['device'])"
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", program, words],
                pass_fds=(theirs.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,  # ours is data; what a plugin prints is none
                start_new_session=True,  # Ctrl-C is the server's, which ends this process
            )
        self._answered, self._pipe = False, Connection(ours.detach())
        return self._pipe

    def _ended_by(self) -> str:
        assert self._process is not None  # it was asked
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(1.0)
        code = self._process.returncode
        if code is not None and code < 0:
            with contextlib.suppress(ValueError):
                return signal.Signals(-code).name
        return f"exit code {code}"

    def _end(self) -> None:
        process, pipe = self._process, self._pipe
        self._process = self._pipe = None
        if process is not None:
            process.kill()
            process.wait()
        if pipe is not None:
            pipe.close()


def main(pipe: int, device: int | None) -> None:
    """What the process does: answers, until the pipe ends.

    Args:
        pipe: the file descriptor of its end.
        device: GL device number.
    """
    from rendergraph.session.gpu import Gpu  # the server, which shares this module, never draws
    from rendergraph.viewer.painter import Painter  # nor does it need this

    with Connection(pipe) as end, contextlib.suppress(EOFError, OSError):
        try:
            gpu = Gpu(device)
        except RendergraphError as error:
            end.recv()
            end.send(error)
            return
        with gpu, contextlib.closing(Painter(gpu)) as painter:
            while True:
                end.send(painter.answer(end.recv()))
