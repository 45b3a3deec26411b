"""The render process: started, asked, ended when it does not answer, and started again.

A shader that hangs, a driver that crashes, a size that memory does not hold end this process, and nothing else: the
server says what happened, keeps what was changed, and the next question starts another one.
"""

from __future__ import annotations

import contextlib
import threading
from multiprocessing.connection import Connection

from rendergraph.errors import Problem, RenderError, RendergraphError
from rendergraph.farm import worker_process as farm
from rendergraph.viewer.questions import Answer, Question

PATIENCE = 30.0
"""Seconds that a question may take; the first ones of a process may take longer: it starts, and compiles."""
FIRST = 120.0


class Child:
    """A process that answers questions, one at a time. To be used from any one thread at a time."""

    def __init__(self, device: int | None = None, patience: float = PATIENCE) -> None:
        self._device, self._patience = device, patience
        self._lock = threading.Lock()
        self._child: farm.Child | None = None
        self._answered = False

    @property
    def pid(self) -> int | None:
        """Of the process that runs, None where none does."""
        return self._child.process.pid if self._child is not None else None

    def start(self) -> None:
        """Start the process, which takes a while, before it is asked."""
        with self._lock:
            self._started()

    def ask(self, question: Question) -> Answer:
        """Its answer.

        Raises:
            RenderError: the process took too long, or died; the next question starts another.
        """
        with self._lock:
            child = self._started()
            patience = self._patience if self._answered else max(FIRST, self._patience)
            try:
                child.pipe.send(question)
                if not child.pipe.poll(patience):
                    self._end()
                    text = (
                        f"the render process did not answer within {patience:.0f} s and was ended; "
                        "undo the last change, or allow more by --timeout"
                    )
                    raise RenderError(Problem("RG630", text))
                answer = child.pipe.recv()
            except (EOFError, OSError):
                code = child.ended_by()
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

    def _started(self) -> farm.Child:
        if self._child is None:
            self._answered = False
            self._child = farm.started("rendergraph.viewer.child:main", {"device": self._device})
        return self._child

    def _end(self) -> None:
        child, self._child = self._child, None
        if child is not None:
            child.end()


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
