"""Serving: an address, a socket bound to it, and uvicorn on that."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from rendergraph.errors import Problem, UsageError
from rendergraph.viewer.child import Child
from rendergraph.viewer.desk import Desk
from rendergraph.viewer.server import LONGEST_MESSAGE, Server

LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})
MOST_CONNECTIONS = 256
SLOWEST_S = 10.0
"""Seconds in which a connection has to say what it wants."""


class _Hasty(H11Protocol):
    """A connection that says nothing, or too slowly, is closed: it would hold a place for ever."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn has it
        super().connection_made(transport)
        self._deadline = self.loop.call_later(SLOWEST_S, self._too_slow)

    def _too_slow(self) -> None:
        if self.cycle is None and self.transport.get_protocol() is self:  # it is no socket by now
            self.transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        self._deadline.cancel()
        super().connection_lost(exc)


@dataclass(eq=False)
class Serving:
    """A server that has its address.

    Attributes:
        url: with the token in it.
    """

    url: str
    _uvicorn: uvicorn.Server
    _socket: socket.socket

    def run(self) -> None:
        """Serve until the process is told to end."""
        self._uvicorn.run(sockets=[self._socket])

    def start(self) -> Callable[[], None]:
        """Serve in a thread of its own; what is returned ends it."""
        thread = threading.Thread(target=self.run, name="rendergraph view", daemon=True)
        thread.start()

        def stop() -> None:
            self._uvicorn.should_exit = True
            thread.join(10.0)

        return stop


def serving(
    desk: Desk,
    child: Child,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
) -> Serving:
    """A server of a pipeline, bound and not yet running.

    Args:
        desk: what is shown.
        child: what draws it; the server ends it.
        host, port: where; a port of 0 is any that is free.

    Raises:
        UsageError: the address cannot be had.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((host, port))
        bound.listen(128)  # whoever has the address may come at once, and waits
    except OSError as error:
        bound.close()
        text = f"'{host}' port {port} cannot be had: {error.strerror or error}; choose another by --port"
        raise UsageError(Problem("RG500", text)) from None
    port = bound.getsockname()[1]
    names = LOOPBACK if host in LOOPBACK else {host, socket.gethostname(), *LOOPBACK}
    hosts = frozenset(f"[{name}]:{port}" if ":" in name else f"{name}:{port}" for name in names)
    server = Server(desk, child, hosts)
    config = uvicorn.Config(
        server.app,
        http=_Hasty,
        ws="websockets-sansio",
        lifespan="on",
        log_level="critical",
        access_log=False,
        server_header=False,
        date_header=False,
        ws_max_size=LONGEST_MESSAGE,
        ws_per_message_deflate=False,  # pictures are packed already
        limit_concurrency=MOST_CONNECTIONS,
        timeout_keep_alive=5,
        timeout_graceful_shutdown=1,
    )
    shown = f"[{host}]" if ":" in host else host
    return Serving(f"http://{shown}:{port}/{server.token}/", uvicorn.Server(config), bound)
