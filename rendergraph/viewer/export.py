"""The page as one file: still, whole, and opened anywhere without a server."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping
from html import escape
from typing import Any

from rendergraph.errors import InputError, Problem
from rendergraph.formatting import jsonable
from rendergraph.session.gpu import Gpu
from rendergraph.viewer.desk import Desk
from rendergraph.viewer.painter import Painter
from rendergraph.viewer.questions import Against, Answer, Question, Thumbnails
from rendergraph.viewer.server import page_files

_IMPORT = re.compile(r'^import (?:(\{[^}]*\}) from )?"\./(\w+)\.js";$', re.MULTILINE)
_EXPORT = re.compile(r"^export ((?:const|function|async function) ([\w$]+))", re.MULTILINE)
_LIST = re.compile(r"^export \{ ([\w, ]+) \};$", re.MULTILINE)


def exported(desk: Desk, gpu: Gpu) -> str:
    """The page of what a desk shows, as HTML with everything in it.

    Raises:
        InputError: the pipeline, or what it is compared with, cannot be drawn; with all mistakes.
    """
    painter = Painter(gpu)
    try:
        picture = _answer(painter, desk.question())
        desk.answered(picture)
        facts = dict(picture.facts)
        kept = [
            _kept("state", desk.state()),
            _kept("pipeline", facts.pop("pipeline")),
            _kept("picture", facts | {"frame": desk.frame}, picture.files),
        ]
        if desk.other is not None:
            against = _answer(painter, Against(desk.other))
            kept.append(_kept("against", against.facts, against.files))
        thumbnails = _answer(painter, Thumbnails())
        kept.append(_kept("thumbnails", thumbnails.facts, thumbnails.files))
    finally:
        painter.close()
    return _html(kept, str(picture.facts["pipeline"]["name"]))


def _answer(painter: Painter, question: Question) -> Answer:
    answer = painter.answer(question)
    if answer.problems:
        raise InputError([Problem(str(problem["code"]), str(problem["text"])) for problem in answer.problems])
    return answer


def _kept(kind: str, facts: Mapping[str, Any], files: Mapping[str, bytes] | None = None) -> dict[str, Any]:
    pictures = {
        name: "data:image/png;base64," + base64.b64encode(data).decode() for name, data in (files or {}).items()
    }
    return {"kind": kind, "facts": dict(facts), "files": pictures}


def _html(kept: list[dict[str, Any]], name: str) -> str:
    files = {file: data.decode() for file, data in page_files().items()}
    html = files["index.html"]
    data = json.dumps(jsonable(kept), allow_nan=False, default=str).replace("<", "\\u003c")
    elk = files["vendor/elk.bundled.js"]
    scripts = (
        f'<script type="application/json" id="kept">{data}</script>\n'
        f'<script>{_inline(elk)}</script>\n<script type="module">{_inline(bundled(files))}</script>\n'
    )
    html = html.replace('<link rel="stylesheet" href="style.css">', f"<style>{files['style.css']}</style>")
    html = html.replace('<script type="module" src="app.js"></script>\n', "")
    html = html.replace("<title>rendergraph</title>", f"<title>{escape(name)} – rendergraph</title>")
    return html.replace("</body>", f"{scripts}</body>")


def bundled(files: Mapping[str, str], entry: str = "app") -> str:
    """The page's modules as one: each a function that gives what it exports, those it imports before it."""
    order: list[str] = []

    def visit(name: str) -> None:
        if name not in order:
            for found in _IMPORT.finditer(files[f"{name}.js"]):
                visit(found[2])
            order.append(name)

    visit(entry)
    return "\n".join(f"const module_{name} = (() => {{\n{_as_function(files[f'{name}.js'])}\n}})();" for name in order)


def _as_function(text: str) -> str:
    given = [found[2] for found in _EXPORT.finditer(text)]
    given += [name.strip() for found in _LIST.finditer(text) for name in found[1].split(",")]
    text = _IMPORT.sub(lambda found: f"const {found[1]} = module_{found[2]};" if found[1] else "", text)
    text = _LIST.sub("", _EXPORT.sub(r"\1", text))
    return f"{text}\nreturn {{ {', '.join(given)} }};"


def _inline(script: str) -> str:
    """A script's text inside of HTML, where its end would be taken for the element's."""
    return script.replace("</script", "<\\/script")
