"""A page that is served, and what a page says to it."""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

import rendergraph as rg


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
    """A viewer, and ways to it."""

    def __init__(self, viewer: Any, folder: Path) -> None:
        self.viewer, self.url, self.folder = viewer, viewer.url, folder
        parts = urlsplit(viewer.url)
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


@pytest.fixture(scope="session")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """One page of `forward` for all tests of a process; a test leaves it as it found it."""
    pytest.importorskip("uvicorn")
    folder = tmp_path_factory.mktemp("page")
    before = os.getcwd()
    os.chdir(folder)
    try:
        viewer = rg.view(rg.load("forward", size=(64, 36)))
    finally:
        os.chdir(before)
    with viewer:
        yield Served(viewer, folder)
