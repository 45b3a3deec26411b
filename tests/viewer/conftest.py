"""A page that is served, and what a page says to it."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

import rendergraph as rg
from rendergraph.viewer.messages import Response
from rendergraph.viewer.render_process import RenderProcess

FORWARD = rg.Selection("forward", size=(64, 36))


class Tab:
    """A page without a browser: what it hears, by kind, and what it says."""

    def __init__(self, socket: Any) -> None:
        self.socket = socket

    def say(self, **message: Any) -> None:
        self.socket.send(json.dumps(message))

    def hear(self, kind: str, timeout: float = 60.0, **facts: Any) -> tuple[dict[str, Any], dict[str, bytes]]:
        """The next message of a kind, with these facts; others are passed over."""
        while True:
            data = self.socket.recv(timeout=timeout)
            found, files = (json.loads(data), {}) if isinstance(data, str) else unpacked(data)
            if found["kind"] == kind and facts.items() <= found.items():
                return found, files


def unpacked(data: bytes) -> tuple[dict[str, Any], dict[str, bytes]]:
    (size,) = struct.unpack_from("<I", data)
    facts = json.loads(data[4 : 4 + size])
    files, at = {}, 4 + size
    for name, length in facts["files"].items():
        files[name] = data[at : at + length]
        at += length
    assert at == len(data)
    return facts, files


class Served:
    """A server, and ways to it."""

    def __init__(self, server: Any, state: Any, process: Any) -> None:
        self.url, self.state, self.process = server.url, state, process
        self.folder: Path = state.folder
        parts = urlsplit(server.url)
        self.host, self.path = parts.netloc, parts.path
        self.port = parts.port

    @contextmanager
    def tab(self, *, origin: str | None = "", path: str | None = None) -> Iterator[Tab]:
        """A socket; `origin` is the page's own by default."""
        from websockets.sync.client import connect

        address = f"ws://{self.host}{self.path if path is None else path}socket"
        found = f"http://{self.host}" if origin == "" else origin
        with connect(address, origin=found, max_size=None, proxy=None) as socket:  # type: ignore[arg-type]
            yield Tab(socket)

    def reset(self, opened: rg.Selection = FORWARD) -> None:
        """The state as of a server that was started now, with its picture."""
        self.state.__init__(opened, self.folder)
        with self.tab() as tab:
            for number in (2, 1):  # the first message may be of a picture from before
                tab.say(do="frame", number=number)
                tab.hear("picture", still=True, frame=number)
        self.state.edits = type(self.state.edits)()


@contextmanager
def serve(folder: Path, process: Any, **options: Any) -> Iterator[Served]:
    """A server of `forward`."""
    pytest.importorskip("uvicorn")
    from rendergraph.viewer.server import Server
    from rendergraph.viewer.view_state import ViewState

    state = ViewState(FORWARD, folder)
    server = Server(state, process, **options)
    stop = server.start()
    try:
        yield Served(server, state, process)
    finally:
        stop()


@pytest.fixture(scope="session")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """One page of `forward` for all tests of a process; a test leaves it as it found it."""
    with serve(tmp_path_factory.mktemp("page"), RenderProcess()) as found:
        yield found


class NoProcess:
    """A render process that renders nothing."""

    pid = None

    def ask(self, request: object) -> Response:
        return Response()

    def close(self) -> None:
        pass


@pytest.fixture
def limited(tmp_path: Path) -> Iterator[Served]:
    """A page with low limits, which shows nothing."""
    pytest.importorskip("uvicorn")
    from rendergraph.viewer.server import ServerLimits

    limits = ServerLimits(messages_per_second=20, request_seconds=1.0, pages=3)
    with serve(tmp_path, NoProcess(), limits=limits) as found:
        yield found
