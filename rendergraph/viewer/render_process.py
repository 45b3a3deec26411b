"""The server's interface to the render process: start it, ask it, terminate it if it hangs, and restart it.

A hanging shader, a crashing driver or a lack of memory ends only this process: the server reports what happened and
keeps the edits, and the next request starts another process.
"""

from __future__ import annotations

import contextlib
import threading
from multiprocessing.connection import Connection

from rendergraph.errors import Problem, RenderError, RendergraphError
from rendergraph.farm.worker_process import ChildProcess
from rendergraph.viewer.messages import Request, Response

TIMEOUT = 30.0
"""Seconds that a request may take; the first one of a process may take longer."""

FIRST_TIMEOUT = 120.0
"""Minimum timeout for the first request of a process, which also imports, opens the device and compiles."""


class RenderProcess:
    """A process that answers requests, one at a time. Only one thread at a time may use it."""

    def __init__(self, device: int | None = None, timeout: float = TIMEOUT) -> None:
        self._device, self._timeout = device, timeout
        self._lock = threading.Lock()
        self._child: ChildProcess | None = None

    @property
    def pid(self) -> int | None:
        return self._child.process.pid if self._child is not None else None

    def start(self) -> None:
        with self._lock:
            self._running()

    def ask(self, request: Request) -> Response:
        """Return the response to a request.

        A RenderError reports that the process took too long or died; the next request starts another one.
        """
        with self._lock:
            child = self._running()
            patience = self._timeout if child.has_answered else max(self._timeout, FIRST_TIMEOUT)
            try:
                with contextlib.suppress(OSError):  # receiving reports the reason
                    child.pipe.send(request)
                response = child.receive(patience)
            except TimeoutError:
                text = f"the render process did not answer within {patience:.0f} s and was terminated"
                raise self._loss_error(f"{text}; undo the last change, or allow more by --timeout") from None
            except EOFError as error:
                text = f"the render process ended ({error}); a driver that crashes or too little memory can cause this"
                raise self._loss_error(text) from None
            if isinstance(response, BaseException):
                self._end()
                raise response
            assert isinstance(response, Response)
            return response

    def close(self) -> None:
        if (child := self._child) is not None:
            child.process.kill()  # a thread that waits for its response has the lock, and gets an error now
        with self._lock:
            self._end()

    def _running(self) -> ChildProcess:
        if self._child is None:
            self._child = ChildProcess("rendergraph.viewer.render_process:main", {"device": self._device})
        return self._child

    def _loss_error(self, text: str) -> RenderError:
        self._end()
        return RenderError(Problem("RG630", text))

    def _end(self) -> None:
        child, self._child = self._child, None
        if child is not None:
            child.kill()


def main(pipe: int, device: int | None) -> None:
    from rendergraph.session.gpu import Gpu  # the server, which shares this module, never renders
    from rendergraph.viewer.render_service import RenderService  # likewise

    with Connection(pipe) as end, contextlib.suppress(EOFError, OSError):
        try:
            gpu = Gpu(device)
        except RendergraphError as error:
            end.recv()
            end.send(error)
            return
        with gpu:
            service = RenderService(gpu)
            while True:
                end.send(service.answer(end.recv()))
