"""Static files that need no server: a page with its contents, and the index of a site of such pages."""

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
_STYLE = """:root { color-scheme: light dark; --page: #ffffff; --ink: #1f2328; --quiet: #57606a; --line: #d5dae0; }
@media (prefers-color-scheme: dark) { :root { --page: #12161b; --ink: #e6edf3; --quiet: #9aa4af; --line: #333b45; } }
body { margin: 0 auto; max-width: 1200px; padding: 16px; background: var(--page); color: var(--ink);
  font: 15px/1.5 system-ui, "DejaVu Sans", sans-serif; }
ul { list-style: none; padding: 0; display: grid; gap: 20px;
  grid-template-columns: repeat(auto-fill, minmax(min(340px, 100%), 1fr)); }
li { border: 1px solid var(--line); border-radius: 8px; overflow: hidden; }
img { display: block; width: 100%; height: auto; } a { color: inherit; text-decoration: none; }
h1 { font-size: 22px; } h2 { font-size: 17px; margin: 10px 12px 2px; } p { margin: 0 12px 10px; }
.quiet { color: var(--quiet); font-size: 13px; }
"""


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


def _message(kind: str, facts: Mapping[str, Any], files: Mapping[str, bytes] = {}) -> dict[str, Any]:
    pictures = {name: f"data:image/png;base64,{base64.b64encode(data).decode()}" for name, data in files.items()}
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


# --- a site ----------------------------------------------------------------------------------------------------------


def index(title: str, pages: Mapping[str, Exported], times: Mapping[str, float]) -> str:
    """Return the index of a site as HTML; each page has its files under its name, as `NAME.html` and `NAME.png`.

    `times` has the milliseconds of a frame, by the name of the page.
    """
    cards = "\n".join(_card(name, page, times[name]) for name, page in pages.items())
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{escape(title)}</title>\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<style>\n{_STYLE}</style>\n</head>\n'
        f"<body>\n<h1>{escape(title)}</h1>\n<ul>\n{cards}\n</ul>\n</body>\n</html>\n"
    )


def _card(name: str, page: Exported, frame_ms: float) -> str:
    pipeline, facts, name = page.pipeline, page.facts, escape(name)
    width, height = facts["size"]
    memory = pipeline["plan"]["memory"]["allocated_bytes"] / 2**20
    passes = len({step["node"] for step in pipeline["plan"]["order"]})
    cost = f"{passes} passes, {frame_ms:.1f} ms, {memory:.1f} MiB at {width}×{height}"
    software = " (software rasteriser)" if facts["device"]["software"] else ""
    return (
        f'<li><a href="{name}.html"><img src="{name}.png" width="{width}" height="{height}" '
        f'alt="Picture of {name}">\n<h2>{name}</h2>\n'
        f'<p>{escape(str(pipeline["description"]))}</p>\n<p class="quiet">{cost}{software}</p></a></li>'
    )
