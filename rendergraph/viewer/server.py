"""The server: one page, one WebSocket, and access control.

It is bound to this machine, with a token in the address. Every request and socket must name the right host, and come
from one of our pages (or from no page), so that no other web page can control it, not even by DNS rebinding. Only a
fixed table of our own files can be fetched: a path that a client sends is never opened.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
import socket
import struct
import threading
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import msgspec
import uvicorn
from msgspec.structs import replace
from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.requests import Request as HttpRequest
from starlette.responses import PlainTextResponse
from starlette.responses import Response as HttpResponse
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect
from uvicorn.protocols.http.h11_impl import H11Protocol

from rendergraph.catalog import Catalog
from rendergraph.errors import Problem, RendergraphError, UsageError
from rendergraph.formatting import jsonable
from rendergraph.resources import folder
from rendergraph.viewer import editing, messages
from rendergraph.viewer.messages import PageMessage, RenderRequest, Request, Response, parse_message
from rendergraph.viewer.render_process import RenderProcess
from rendergraph.viewer.view_state import ViewState

LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})
WATCH_SECONDS = 0.25
"""Seconds between two checks of the input files."""
_TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".md": "text/plain"}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'self' http://127.0.0.1:* http://localhost:*"
)
_HEADERS = {
    "content-security-policy": _POLICY,
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "cache-control": "no-store",
}


@dataclass(frozen=True)
class ServerLimits:
    """Limits for clients; dragging on a page sends about sixty messages per second."""

    message_bytes: int = 65_536
    messages_per_second: float = 400
    request_seconds: float = 10.0
    pages: int = 32
    connections: int = 256


@cache
def page_files() -> Mapping[str, bytes]:
    home = folder("rendergraph") / "viewer" / "page"
    return {str(path.relative_to(home)): path.read_bytes() for path in sorted(home.rglob("*")) if path.suffix in _TYPES}


@dataclass(eq=False)
class Page:
    """One tab. Only the newest message of each kind waits, so a slow page neither delays others nor fills memory."""

    socket: WebSocket
    waiting: dict[str, bytes | str] = field(default_factory=dict)
    changed: asyncio.Event = field(default_factory=asyncio.Event)
    allowance: float = 0.0
    last: float = 0.0
    holds: bool = False
    visible: frozenset[str] = frozenset()

    def put(self, kind: str, message: bytes | str) -> None:
        self.waiting.pop(kind, None)
        self.waiting[kind] = message
        self.changed.set()

    def say(self, kind: str, facts: Mapping[str, Any]) -> None:
        self.put(kind, _text(kind, facts))

    async def send_forever(self) -> None:
        while True:
            await self.changed.wait()
            self.changed.clear()
            while self.waiting:
                message = self.waiting.pop(next(iter(self.waiting)))
                if isinstance(message, bytes):
                    await self.socket.send_bytes(message)
                else:
                    await self.socket.send_text(message)

    def is_flooding(self, most: float) -> bool:
        now = time.monotonic()
        self.allowance = min(most, self.allowance + (now - self.last) * most) - 1
        self.last = now
        return self.allowance < 0


class Server:
    """The pages, the state they share, and the render process."""

    def __init__(
        self,
        state: ViewState,
        process: RenderProcess,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        limits: ServerLimits = ServerLimits(),
    ) -> None:
        """Bind the address, where port 0 is any free one; nothing is served yet."""
        self._state, self._process, self._limits = state, process, limits
        self._pages: set[Page] = set()
        self._wake = asyncio.Event()
        self._needs_picture = True
        self._revision = 0  # counts the requested pictures
        self._shown = 0  # the revision of the picture that pages have
        self._details_of: RenderRequest | None = None  # a still picture whose comparison and thumbnails are missing
        self._has_problems = False  # the last picture failed, and pages know
        self._thumbnails_of: RenderRequest | None = None
        self._has_thumbnails: frozenset[str] = frozenset()  # nodes, of that picture
        self._thumbnails: dict[str, bytes] = {}
        self._still: RenderRequest | None = None  # the last still picture
        self._judging: asyncio.Task[None] | None = None
        self._last: dict[str, bytes | str] = {}  # by kind, for pages that connect later
        self._pixels: dict[Page, messages.PixelRequest] = {}  # the last one of each page
        self._socket = _bind(host, port)
        port = self._socket.getsockname()[1]
        token = secrets.token_urlsafe(24)
        names = LOOPBACK if host in LOOPBACK else {host, socket.gethostname(), *LOOPBACK}
        self.url = f"http://{_with_port(host, port)}/{token}/"
        routes = [
            WebSocketRoute(f"/{token}/socket", self._serve_socket),
            Route(f"/{token}/{{name:path}}", self._serve_file),
        ]
        app = Starlette(routes=routes, lifespan=self._lifespan)
        config = uvicorn.Config(
            _Guard(app, frozenset(_with_port(name, port) for name in names)),
            http=type("_Http", (_SlowRequestGuard,), {"request_seconds": limits.request_seconds}),
            ws="websockets-sansio",
            lifespan="on",
            log_level="critical",
            access_log=False,
            server_header=False,
            date_header=False,
            ws_max_size=limits.message_bytes,
            ws_per_message_deflate=False,  # pictures are compressed already
            limit_concurrency=limits.connections,
            timeout_keep_alive=5,
            timeout_graceful_shutdown=1,
        )
        self._uvicorn = uvicorn.Server(config)

    def run(self) -> None:
        self._uvicorn.run(sockets=[self._socket])

    def start(self) -> Callable[[], None]:
        thread = threading.Thread(target=self.run, name="rendergraph view", daemon=True)
        thread.start()

        def stop() -> None:
            self._uvicorn.should_exit = True
            thread.join(10.0)

        return stop

    @contextlib.asynccontextmanager
    async def _lifespan(self, app: Starlette) -> AsyncIterator[None]:
        self._wake.set()
        work = asyncio.create_task(self._work())
        try:
            yield
        finally:
            work.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await work
            await asyncio.to_thread(self._process.close)

    async def _serve_file(self, request: HttpRequest) -> HttpResponse:
        name = request.path_params.get("name", "") or "index.html"
        data = page_files().get(name)
        if data is None:
            return PlainTextResponse("not found\n", 404, headers=_HEADERS)
        return HttpResponse(data, headers=_HEADERS, media_type=_TYPES[name[name.rfind(".") :]])

    # --- pages -------------------------------------------------------------------------------------------------------

    async def _serve_socket(self, socket: WebSocket) -> None:
        if len(self._pages) >= self._limits.pages:
            await socket.close(1013, "too many pages")
            return
        await socket.accept()
        page = Page(socket)
        for kind, message in self._last.items():
            page.put(kind, message)
        page.say("state", self._state_facts())
        self._pages.add(page)
        sending = asyncio.create_task(page.send_forever())
        try:
            await self._listen(page)
        except (WebSocketDisconnect, RuntimeError):
            pass  # the page has gone
        finally:
            self._pages.discard(page)
            if page.holds and self._state.apply(messages.HoldMessage(on=False)):
                self._request_picture()
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await sending

    async def _listen(self, page: Page) -> None:
        while True:
            text = await page.socket.receive_text()
            if page.is_flooding(self._limits.messages_per_second):
                await page.socket.close(1008, "too many messages")
                return
            try:
                self._apply(page, parse_message(text))
            except RendergraphError as error:
                page.say("refused", {"problems": _problems(error)})
            except (msgspec.DecodeError, RecursionError):
                await page.socket.close(1007, "not a JSON object")
                return

    def _apply(self, page: Page, message: PageMessage) -> None:
        match message:
            case messages.PixelMessage(x, y):
                self._pixels[page] = messages.PixelRequest(x, y)
                self._wake.set()
            case messages.DraftMessage(name):
                _, difference, digest = self._state.draft(name)
                page.say("draft", {"name": name, "difference": difference, "digest": digest})
            case messages.SaveMessage(name, digest):
                page.say("saved", {"path": name, "yaml": self._state.save(name, digest)})
                self._changed()
            case messages.TypesMessage():
                catalog = Catalog.discover(self._state.opened.plugins)
                page.say("types", {"types": editing.node_types(catalog)})
            case messages.VisibleMessage(nodes):
                page.visible = frozenset(nodes)
                if self._still is not None and not page.visible <= self._has_thumbnails:
                    self._details_of = self._still
                    self._wake.set()
            case messages.EditMessage(operations):
                page.say("notes", {"notes": self._state.edit(operations)})
                self._changed()
            case _:
                if isinstance(message, messages.HoldMessage):
                    page.holds = message.on
                before = self._state.edits
                if self._state.apply(message):
                    self._request_picture()
                self._send_state()
                if self._state.edits is not before and not self._state.held:
                    self._judge_soon()

    def _changed(self) -> None:
        self._request_picture()
        self._send_state()
        self._judge_soon()

    def _send_state(self) -> None:
        if _text("state", state := self._state_facts()) != self._last.get("state"):
            self._broadcast("state", state)

    def _state_facts(self) -> dict[str, Any]:
        return self._state.as_json() | {"revision": self._revision}

    def _judge_soon(self) -> None:
        """Report mistakes in an edit immediately, even while a picture is being rendered."""
        if self._judging is None or self._judging.done():
            self._judging = asyncio.create_task(self._judge())

    async def _judge(self) -> None:
        judged = problems = None
        while judged != (selection := self._state.selection):
            judged = selection
            problems = await asyncio.to_thread(editing.problems_of, selection)
        if problems:
            self._show_problems(problems)

    def _request_picture(self) -> None:
        self._revision += 1
        self._needs_picture = True
        self._wake.set()

    def _broadcast(self, kind: str, facts: Mapping[str, Any], files: Mapping[str, bytes] | None = None) -> None:
        self._last[kind] = message = _text(kind, facts) if files is None else _pack(kind, facts, files)
        for page in self._pages:
            page.put(kind, message)

    # --- the render process ------------------------------------------------------------------------------------------

    async def _work(self) -> None:
        """Send one request at a time; the newest state wins."""
        while True:
            try:
                await asyncio.wait_for(self._wake.wait(), WATCH_SECONDS)
            except TimeoutError:
                if self._pages and (self._state.follow() or await self._files_changed()):
                    self._thumbnails_of = None
                    self._request_picture()
                self._send_state()  # the edited file may have changed on disk
                continue
            self._wake.clear()
            while self._pixels:
                page = next(iter(self._pixels))
                if (response := await self._ask(self._pixels.pop(page))) is not None:
                    page.say("pixel", response.facts | {"revision": self._shown})
            if self._needs_picture:
                self._needs_picture, self._details_of = False, None
                await self._render()
            if self._details_of is not None:
                await self._render_details(self._details_of)

    async def _render(self) -> None:
        """Show the current picture; after a failure nothing is requested until something changes."""
        begun, request, revision = time.monotonic(), self._state.request(), self._revision
        response = await self._ask(request)
        if response is None or response.problems:
            return
        self._shown = revision
        self._show(response, request)
        if self._state.playing:
            await asyncio.sleep(max(0.0, 1.0 / self._state.fps - (time.monotonic() - begun)))
            if self._state.playing and self._state.frame == request.frame:  # neither stopped nor moved meanwhile
                self._state.frame += 1
            self._request_picture()
        elif request.still:
            self._details_of = self._still = request

    def _show(self, response: Response, request: RenderRequest) -> None:
        self._state.record(response)
        facts = dict(response.facts)
        if (pipeline := facts.pop("pipeline", None)) is not None:
            self._broadcast("pipeline", pipeline | {"revision": self._shown})
        if self._has_problems and request.selection == self._state.selection:  # otherwise they belong to a newer edit
            self._show_problems([])
        self._broadcast("picture", facts | {"frame": request.frame, "revision": self._shown}, response.files)

    async def _render_details(self, request: RenderRequest) -> None:
        """Show the comparison and thumbnails of a still picture; a new request of a page comes first."""
        await asyncio.sleep(0.05)
        if self._wake.is_set():
            return  # the work loop comes back here
        other = self._state.other
        if other is not None and (response := await self._ask(messages.CompareRequest(other))) is not None:
            more = {"problems": response.problems, "revision": self._shown}
            self._broadcast("against", response.facts | more, response.files)
        elif other is None and "against" in self._last:
            self._broadcast("against", {}, {})
            del self._last["against"]
        if self._wake.is_set():
            return
        request = replace(request, port="", exposure=0.0, look=messages.Look(), known_revision=0)
        if request != self._thumbnails_of:
            self._thumbnails_of, self._has_thumbnails = request, frozenset()
        missing = frozenset[str]().union(*(page.visible for page in self._pages)) - self._has_thumbnails
        if missing and (response := await self._ask(messages.ThumbnailRequest(missing))) is not None:
            self._has_thumbnails |= missing
            if response.files:
                self._send_thumbnails(response)
        self._details_of = None

    def _send_thumbnails(self, response: Response) -> None:
        """Send new thumbnails to the pages; a page that connects later gets all."""
        new = {name: data for name, data in response.files.items() if self._thumbnails.get(name) != data}
        self._thumbnails |= new
        if new:
            facts = response.facts | {"revision": self._shown}
            self._broadcast("thumbnails", facts, new)
            self._last["thumbnails"] = _pack("thumbnails", facts, self._thumbnails)

    def _show_problems(self, problems: Sequence[Mapping[str, Any]]) -> None:
        self._has_problems = bool(problems)
        if _text("problems", facts := {"problems": list(problems)}) != self._last.get("problems"):
            self._broadcast("problems", facts)

    async def _files_changed(self) -> bool:
        response = await self._ask(messages.ChangedFilesRequest()) if self._process.pid is not None else None
        return response is not None and bool(response.facts.get("changed"))

    async def _ask(self, request: Request) -> Response | None:
        """Return the response of the render process; None if the process was lost, which is reported to pages."""
        try:
            response = await asyncio.to_thread(self._process.ask, request)
        except RendergraphError as error:
            self._show_problems(_problems(error))
            return None
        is_past = isinstance(request, RenderRequest) and request.selection != self._state.selection
        if response.problems and not is_past:
            self._show_problems(response.problems)
        return response


class _SlowRequestGuard(H11Protocol):
    """Closes a connection that sends no request in time, because it would block a slot forever."""

    request_seconds: float

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn has it
        super().connection_made(transport)
        self._deadline = self.loop.call_later(self.request_seconds, self._too_slow)

    def _too_slow(self) -> None:
        if self.cycle is None and self.transport.get_protocol() is self:  # it has not become a WebSocket
            self.transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        self._deadline.cancel()
        super().connection_lost(exc)


class _Guard:
    """Refuses requests for another host, and those that come from another web page."""

    def __init__(self, app: ASGIApp, hosts: frozenset[str]) -> None:
        self._app, self._hosts = app, hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan" or self._is_allowed(scope):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            await PlainTextResponse("refused\n", 403, headers=_HEADERS)(scope, receive, send)

    def _is_allowed(self, scope: Scope) -> bool:
        headers = Headers(scope=scope)
        host, origin = headers.getlist("host"), headers.getlist("origin")
        if len(host) != 1 or host[0] not in self._hosts or len(origin) > 1:
            return False
        if not origin:
            return bool(scope["type"] != "websocket")  # a browser always names the origin of a socket
        return origin[0] in (f"http://{host[0]}", f"https://{host[0]}")


def _bind(host: str, port: int) -> socket.socket:
    # asyncio sets TCP_NODELAY only if the protocol is named; otherwise messages wait 40 ms.
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((host, port))
        bound.listen(128)  # a browser that connects before the server runs must wait
    except OSError as error:
        bound.close()
        text = f"'{host}' port {port} is not available: {error.strerror or error}; choose another with --port"
        raise UsageError(Problem("RG500", text)) from None
    return bound


def _with_port(host: str, port: int) -> str:
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def _problems(error: RendergraphError) -> list[dict[str, Any]]:
    return [problem.as_json() | {"node": None} for problem in error.problems]


def _text(kind: str, facts: Mapping[str, Any]) -> str:
    return json.dumps(jsonable({"kind": kind, **facts}), allow_nan=False, default=str)


def _pack(kind: str, facts: Mapping[str, Any], files: Mapping[str, bytes]) -> bytes:
    """Return the length of the JSON in four bytes, the JSON with each file's length, then the files."""
    head = _text(kind, {**facts, "files": {name: len(data) for name, data in files.items()}}).encode()
    return struct.pack("<I", len(head)) + head + b"".join(files.values())
