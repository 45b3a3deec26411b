"""The server: one page, one socket, and who may use them.

Bound to this machine, with a token in the address; every request and socket must come to the right host, and from a
page of ours (or from no page), so that no other web page can drive it, by rebinding a name either. What can be fetched
is a fixed table of our own files: no path that a client sends is ever opened.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
import struct
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from rendergraph.errors import Place, Problem, RendergraphError
from rendergraph.formatting import jsonable
from rendergraph.resources import folder
from rendergraph.viewer.child import Child
from rendergraph.viewer.desk import Desk, as_problems
from rendergraph.viewer.questions import Against, Answer, Ask, Changed, Pixel, Question, Thumbnails, Variant

LONGEST_MESSAGE = 65_536
"""Bytes of a message from a page."""
FASTEST = 400
"""Messages a second that a page may send; one that drags sends some sixty."""
MOST_PAGES = 32
WATCH_S = 0.25
"""Seconds between two looks at the files."""
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


@cache
def page_files() -> Mapping[str, bytes]:
    """What the page consists of, by the name it is fetched by."""
    home = folder("rendergraph") / "viewer" / "page"
    return {str(path.relative_to(home)): path.read_bytes() for path in sorted(home.rglob("*")) if path.suffix in _TYPES}


@dataclass(eq=False)
class Page:
    """One tab: of each kind of message only the newest waits, so a slow one holds up nobody, and no memory."""

    socket: WebSocket
    waiting: dict[str, bytes | str] = field(default_factory=dict)
    woken: asyncio.Event = field(default_factory=asyncio.Event)
    allowance: float = 0.0
    last: float = 0.0
    holds: bool = False

    def put(self, kind: str, message: bytes | str) -> None:
        """To be sent as soon as it can, in place of an older one of its kind."""
        self.waiting.pop(kind, None)
        self.waiting[kind] = message
        self.woken.set()

    async def send(self) -> None:
        """Send whatever waits, for ever."""
        while True:
            await self.woken.wait()
            self.woken.clear()
            while self.waiting:
                kind = next(iter(self.waiting))
                message = self.waiting.pop(kind)
                if isinstance(message, bytes):
                    await self.socket.send_bytes(message)
                else:
                    await self.socket.send_text(message)

    def too_fast(self) -> bool:
        """Whether it sends more than anybody can mean."""
        now = time.monotonic()
        self.allowance = min(FASTEST, self.allowance + (now - self.last) * FASTEST) - 1
        self.last = now
        return self.allowance < 0


class Server:
    """The pages, the state they share, and the render process.

    Attributes:
        desk: the state.
        child: the render process.
        token: stands in the address of everything.
        app: the ASGI application.
    """

    def __init__(self, desk: Desk, child: Child, hosts: frozenset[str]) -> None:
        """Make the application.

        Args:
            desk: the state.
            child: the render process.
            hosts: what the `Host` of a request may be; with a port.
        """
        self.desk, self.child = desk, child
        self.token = secrets.token_urlsafe(24)
        self._pages: set[Page] = set()
        self._woken = asyncio.Event()
        self._due = True  # a picture is wanted
        self._beside: Ask | None = None  # the picture that stands still, and has not all that is shown beside it
        self._wrong = False  # the last picture failed, and pages know
        self._thumbed: Ask | None = None  # what the small pictures were made of
        self._last: dict[str, bytes | str] = {}  # by kind, for pages that come later
        self._asks: dict[tuple[Page, type], tuple[Question, Callable[[Answer], None]]] = {}
        routes = [
            WebSocketRoute(f"/{self.token}/socket", self._socket),
            Route(f"/{self.token}/{{name:path}}", self._file),
        ]
        self.app: ASGIApp = _Guard(Starlette(routes=routes, lifespan=self._life), hosts)

    @contextlib.asynccontextmanager
    async def _life(self, app: Starlette) -> AsyncIterator[None]:
        self._woken.set()
        work = asyncio.create_task(self._work())
        try:
            yield
        finally:
            work.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await work
            await asyncio.to_thread(self.child.close)

    async def _file(self, request: Request) -> Response:
        name = request.path_params.get("name", "") or "index.html"
        data = page_files().get(name)
        if data is None:
            return PlainTextResponse("not found\n", 404, headers=_HEADERS)
        ending = name[name.rfind(".") :]
        return Response(data, headers=_HEADERS, media_type=_TYPES[ending])

    # --- pages -------------------------------------------------------------------------------------------------------

    async def _socket(self, socket: WebSocket) -> None:
        if len(self._pages) >= MOST_PAGES:
            await socket.close(1013, "too many pages")
            return
        await socket.accept()
        page = Page(socket)
        for kind, message in self._last.items():
            page.put(kind, message)
        page.put("state", _text("state", self.desk.state()))
        self._pages.add(page)
        sending = asyncio.create_task(page.send())
        try:
            await self._listen(page)
        except (WebSocketDisconnect, RuntimeError):
            pass  # it is gone
        finally:
            self._pages.discard(page)
            if page.holds and self.desk.said({"do": "hold", "on": False}):
                self._want()
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await sending

    async def _listen(self, page: Page) -> None:
        while True:
            text = await page.socket.receive_text()
            if page.too_fast():
                await page.socket.close(1008, "too many messages")
                return
            try:
                message = json.loads(text)
                if not isinstance(message, dict):
                    raise TypeError("no object")
            except (ValueError, TypeError, RecursionError):
                await page.socket.close(1007, "not a JSON object")
                return
            try:
                self._hear(page, message)
            except RendergraphError as error:
                page.put("refused", _text("refused", {"problems": as_problems(error)}))

    def _hear(self, page: Page, message: Mapping[str, Any]) -> None:
        act = message.get("do")
        if act == "pixel":
            place = Pixel(_unit(message.get("x")), _unit(message.get("y")))
            self._ask(page, place, lambda answer: page.put("pixel", _text("pixel", dict(answer.facts))))
        elif act == "save":
            path = self.desk.file(message.get("name"))
            self._ask(page, Variant(self.desk.opened), lambda answer: page.put("saved", _saved(path, answer)))
        else:
            if act == "hold":
                page.holds = bool(message.get("on"))
            if self.desk.said(message):
                self._want()
            if _text("state", state := self.desk.state()) != self._last.get("state"):
                self._tell("state", state)

    def _ask(self, page: Page, question: Question, then: Callable[[Answer], None]) -> None:
        """Ask something beside pictures; of the same page and kind only the last counts."""
        self._asks.pop((page, type(question)), None)
        self._asks[page, type(question)] = question, then
        self._woken.set()

    def _want(self) -> None:
        """Another picture."""
        self._due = True
        self._woken.set()

    def _tell(self, kind: str, facts: Mapping[str, Any], files: Mapping[str, bytes] | None = None) -> None:
        """Something for every page, and for those that come later."""
        message: bytes | str = _text(kind, facts) if files is None else _packed(kind, facts, files)
        if kind in ("state", "pipeline", "picture", "thumbnails", "against", "problems"):
            self._last[kind] = message
        for page in self._pages:
            page.put(kind, message)

    # --- the render process ------------------------------------------------------------------------------------------

    async def _work(self) -> None:
        """Ask for what is wanted, one question at a time; the newest state wins."""
        while True:
            try:
                await asyncio.wait_for(self._woken.wait(), WATCH_S)
            except TimeoutError:
                if self._pages and await self._files_changed():
                    self._thumbed = None
                    self._want()
                continue
            self._woken.clear()
            while self._asks:
                question, then = self._asks.pop(next(iter(self._asks)))
                if (answer := await self._answer(question)) is not None:
                    then(answer)
            if self._due:
                self._due, self._beside = False, None
                await self._draw()
            if self._beside is not None:
                await self._more(self._beside)

    async def _draw(self) -> None:
        """The picture that is wanted now; after one that fails nothing is asked until something changes."""
        begun, asked = time.monotonic(), self.desk.question()
        answer = await self._answer(asked)
        if answer is None or answer.problems:
            return
        self._show(answer, asked.frame)
        if self.desk.playing:
            await asyncio.sleep(max(0.0, 1.0 / self.desk.fps - (time.monotonic() - begun)))
            if self.desk.playing and self.desk.frame == asked.frame:  # nobody stopped it or went elsewhere meanwhile
                self.desk.frame += 1
            self._want()
        elif asked.still:
            self._beside = asked

    def _show(self, answer: Answer, frame: int) -> None:
        self.desk.answered(answer)
        facts = dict(answer.facts)
        if (pipeline := facts.pop("pipeline", None)) is not None:
            self._tell("pipeline", pipeline | {"revision": self.desk.revision})
        if self._wrong:
            self._say_problems([])
        self._tell("picture", facts | {"frame": frame}, answer.files)

    async def _more(self, asked: Ask) -> None:
        """What is shown beside a picture that stands still; whatever is wanted meanwhile comes first."""
        await asyncio.sleep(0.05)
        if self._woken.is_set():
            return  # it is asked for again
        other = self.desk.other
        if other is not None and (answer := await self._answer(Against(other))) is not None:
            self._tell("against", dict(answer.facts) | {"problems": list(answer.problems)}, answer.files)
        elif other is None and self._last.pop("against", None) is not None:
            self._tell("against", {}, {})
        if self._woken.is_set():
            return
        asked = replace(asked, port="", stops=0.0, known=0)
        if asked != self._thumbed and (answer := await self._answer(Thumbnails())) is not None and answer.files:
            self._thumbed = asked
            self._tell("thumbnails", answer.facts, answer.files)
        self._beside = None

    def _say_problems(self, problems: Sequence[Mapping[str, Any]]) -> None:
        self._wrong = bool(problems)
        self._tell("problems", {"problems": list(problems)})

    async def _files_changed(self) -> bool:
        try:
            answer = await asyncio.to_thread(self.child.ask, Changed()) if self.child.pid is not None else Answer()
        except RendergraphError as error:
            self._say_problems(as_problems(error))
            return False
        return bool(answer.facts.get("changed"))

    async def _answer(self, question: Question) -> Answer | None:
        """What the render process says; None where it was lost, which pages are told."""
        try:
            answer = await asyncio.to_thread(self.child.ask, question)
        except RendergraphError as error:
            self._say_problems(as_problems(error))
            return None
        if answer.problems:
            self._say_problems(answer.problems)
        return answer


class _Guard:
    """Turns away whatever does not come to this host, or comes from a page of somebody else."""

    def __init__(self, app: ASGIApp, hosts: frozenset[str]) -> None:
        self._app, self._hosts = app, hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Hand on what may be handed on."""
        if scope["type"] == "lifespan" or self._welcome(scope):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            await PlainTextResponse("refused\n", 403, headers=_HEADERS)(scope, receive, send)

    def _welcome(self, scope: Scope) -> bool:
        headers: dict[str, list[str]] = {}
        for name, value in scope["headers"]:
            headers.setdefault(name.decode("latin-1"), []).append(value.decode("latin-1"))
        host, origin = headers.get("host", []), headers.get("origin", [])
        if len(host) != 1 or host[0] not in self._hosts or len(origin) > 1:
            return False
        if not origin:
            return bool(scope["type"] != "websocket")  # a browser always says where a socket comes from
        found = urlsplit(origin[0])
        return found.scheme in ("http", "https") and found.netloc == host[0]


def _unit(value: Any) -> float:
    return min(max(float(value), 0.0), 1.0) if isinstance(value, (int, float)) and value == value else 0.0


def _saved(path: Path, answer: Answer) -> str:
    """Write a variant; what the page is told."""
    if answer.problems or "yaml" not in answer.facts:
        return _text("saved", {"problems": list(answer.problems)})
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(answer.facts["yaml"])
    except OSError as error:
        problem = Problem("RG504", f"cannot be written: {error.strerror or error}", Place(path.name))
        return _text("saved", {"problems": [problem.as_json()]})
    return _text("saved", {"path": path.name, "yaml": answer.facts["yaml"], "problems": []})


def _text(kind: str, facts: Mapping[str, Any]) -> str:
    return json.dumps(jsonable({"kind": kind} | dict(facts)), allow_nan=False, default=str)


def _packed(kind: str, facts: Mapping[str, Any], files: Mapping[str, bytes]) -> bytes:
    """The length of the JSON in four bytes, the JSON with each file's length, then the files."""
    head = _text(kind, dict(facts) | {"files": {name: len(data) for name, data in files.items()}}).encode()
    return struct.pack("<I", len(head)) + head + b"".join(files.values())
