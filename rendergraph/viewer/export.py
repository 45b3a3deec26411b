"""The page as one static file, which needs no server."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping
from html import escape
from typing import Any

from msgspec import Struct

from rendergraph.errors import InputError, Problem
from rendergraph.formatting import jsonable
from rendergraph.session.gpu import Gpu
from rendergraph.viewer.messages import CompareRequest, Request, Response, ThumbnailRequest
from rendergraph.viewer.render_service import RenderService
from rendergraph.viewer.server import page_files
from rendergraph.viewer.view_state import ViewState

_IMPORT = re.compile(r'^import (?:(\{[^}]*\}) from )?"\./(\w+)\.js";$', re.MULTILINE)
_EXPORT = re.compile(r"^export ((?:const|function|async function) ([\w$]+))", re.MULTILINE)
_LIST = re.compile(r"^export \{ ([\w, ]+) \};$", re.MULTILINE)


class Exported(Struct, frozen=True):
    """A static page with its contents: picture as PNG, description of the pipeline, size and times."""

    html: str
    picture: bytes
    pipeline: Mapping[str, Any]
    facts: Mapping[str, Any]


def export(state: ViewState, gpu: Gpu) -> Exported:
    """Render what a page shows, and return it as a static page."""
    service = RenderService(gpu)
    picture = _ask(service, state.request())
    state.record(picture)
    facts = dict(picture.facts)
    pipeline = facts.pop("pipeline")
    messages = [
        _message("state", state.as_json()),
        _message("pipeline", pipeline),
        _message("picture", facts | {"frame": state.frame}, picture.files),
    ]
    if state.other is not None:
        against = _ask(service, CompareRequest(state.other))
        messages.append(_message("against", against.facts, against.files))
    thumbnails = _ask(service, ThumbnailRequest())
    messages.append(_message("thumbnails", thumbnails.facts, thumbnails.files))
    return Exported(_html(messages, str(pipeline["name"])), picture.files["picture"], pipeline, facts)


def _ask(service: RenderService, request: Request) -> Response:
    response = service.answer(request)
    if response.problems:
        raise InputError([Problem(str(problem["code"]), str(problem["text"])) for problem in response.problems])
    return response


def _message(kind: str, facts: Mapping[str, Any], files: Mapping[str, bytes] | None = None) -> dict[str, Any]:
    pictures = {
        name: "data:image/png;base64," + base64.b64encode(data).decode() for name, data in (files or {}).items()
    }
    return {"kind": kind, "facts": dict(facts), "files": pictures}


def _html(messages: list[dict[str, Any]], name: str) -> str:
    files = {file: data.decode() for file, data in page_files().items()}
    html = files["index.html"]
    data = json.dumps(jsonable(messages), allow_nan=False, default=str).replace("<", "\\u003c")
    elk = files["vendor/elk.bundled.js"]
    scripts = (
        f'<script type="application/json" id="exported">{data}</script>\n'
        f'<script>{_inline(elk)}</script>\n<script type="module">{_inline(bundle(files))}</script>\n'
    )
    html = html.replace('<link rel="stylesheet" href="style.css">', f"<style>{files['style.css']}</style>")
    html = html.replace('<script type="module" src="app.js"></script>\n', "")
    html = html.replace("<title>rendergraph</title>", f"<title>{escape(name)} – rendergraph</title>")
    return html.replace("</body>", f"{scripts}</body>")


def bundle(files: Mapping[str, str], entry: str = "app") -> str:
    """Return the page's modules as one script: each becomes a function that returns its exports, imports first."""
    order: list[str] = []

    def visit(name: str) -> None:
        if name not in order:
            for found in _IMPORT.finditer(files[f"{name}.js"]):
                visit(found[2])
            order.append(name)

    visit(entry)
    return "\n".join(f"const module_{name} = (() => {{\n{_as_function(files[f'{name}.js'])}\n}})();" for name in order)


def _as_function(text: str) -> str:
    names = [found[2] for found in _EXPORT.finditer(text)]
    names += [name.strip() for found in _LIST.finditer(text) for name in found[1].split(",")]
    text = _IMPORT.sub(lambda found: f"const {found[1]} = module_{found[2]};" if found[1] else "", text)
    text = _LIST.sub("", _EXPORT.sub(r"\1", text))
    return f"{text}\nreturn {{ {', '.join(names)} }};"


def _inline(script: str) -> str:
    """Escape a script's text for HTML, in which `</script` would end the element."""
    return script.replace("</script", "<\\/script")
