"""The Python reference, from signatures and docstrings.

Docstrings are Markdown with Google's sections, so they are shown as they are; there is no second markup to learn.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterator
from typing import Any, Literal, get_args, get_origin

import msgspec

import rendergraph
import rendergraph.api
import rendergraph.errors
import rendergraph.ports
import rendergraph.projection
import rendergraph.scene.model
import rendergraph.steps.frame
import rendergraph.steps.model
import rendergraph.textures
from rendergraph.reference.python import (
    PUBLIC_ERRORS,
    author_names,
    member_of,
    member_signature,
    public_members,
    public_names,
    signature,
)
from rendergraph.textures import Semantic, Signature

from .markdown import block, code, page, prose, table

FIRST = (
    "Node",
    "Input",
    "Output",
    "InOut",
    "Internal",
    "History",
    "Views",
    "Function",
    "Part",
    "param",
    "define",
    "structural",
    "Steps",
    "State",
    "Frame",
    "FrameScene",
    "Light",
    "Facts",
)

USED_FIRST = ("load", "loads", "Pipeline", "Frame", "Session", "compare", "sweep", "Comparison", "Sweep", "Result")
_WITH_WORDS = (rendergraph.ports, rendergraph.textures, rendergraph.steps.model)


def pages() -> Iterator[tuple[str, str]]:
    """A page for users, and two for authors of nodes."""
    public = public_names()
    ordered = [*dict.fromkeys((*USED_FIRST, *rendergraph.__all__, *PUBLIC_ERRORS))]
    yield (
        "python.md",
        page(
            "Python",
            "The same words as on the command line: load, set, render. `import rendergraph as rg` gives all of it but "
            f"{', '.join(map(code, PUBLIC_ERRORS))}, which are in `rendergraph.errors`.",
            *(_entry(name, public[name]) for name in ordered),
        ),
    )
    members = author_names()
    ordered = sorted(members, key=lambda name: (FIRST.index(name) if name in FIRST else len(FIRST), name))
    documented = [name for name in ordered if callable(members[name]) or inspect.isclass(members[name])]
    meanings = [(code(n), prose(v.doc)) for n, v in members.items() if isinstance(v, Semantic | Signature)]
    constants = [(code(n), code(repr(v))) for n, v in members.items() if n not in documented and not hasattr(v, "doc")]
    entries = [_entry(name, members[name]) for name in documented]
    yield (
        "node-api.md",
        page(
            "For node authors",
            "Everything here comes from `rendergraph.api`, the one module that a node imports; `FrameScene` and "
            "`Light` are what `update` is given.",
            *entries,
            "## Words\n\nWhat arguments that are one of several words may be.\n\n"
            + table(("argument's type", "words"), _words("\n".join(entries))),
            "## Meanings of ports\n\n" + table(("name", "texels"), meanings),
            "## Constants\n\n" + table(("name", "value"), constants),
        ),
    )
    views = rendergraph.projection
    functions = {name: value for name, value in vars(views).items() if inspect.isfunction(value) and name[0] != "_"}
    yield (
        "views.md",
        page(
            "Views",
            "`from rendergraph.api import projection`: what `update` makes views with.",
            _doc(views),
            *(_entry(name, value) for name, value in functions.items()),
        ),
    )


def _words(text: str) -> Iterator[tuple[str, str]]:
    """Every alias of a choice of words that signatures on the page name."""
    choices = {name: value for module in _WITH_WORDS for name, value in vars(module).items() if name != "FormatName"}
    for name, value in sorted(choices.items()):
        if get_origin(value) is Literal and re.search(rf"\b{name}\b", text):
            yield code(name), ", ".join(code(word) for word in get_args(value))


def _entry(name: str, thing: Any) -> str:
    parts = [f"## {name}"]
    if not inspect.isclass(thing):
        return "\n\n".join([*parts, block(f"{name}{signature(thing)}", "python"), _doc(thing)])
    is_value = dataclasses.is_dataclass(thing) or issubclass(thing, msgspec.Struct)
    arguments = signature(thing) if is_value or "__init__" in vars(thing) else ""
    parts += [block(f"class {name}{arguments}" if arguments else f"class {name}: ...", "python"), _doc(thing)]
    for member, value in public_members(thing):
        text = member_signature(member, value)
        parts += [f"### {name}.{member}", block(text, "python") if text != member else "", _doc(member_of(value))]
    return "\n\n".join(part for part in parts if part)


def _doc(thing: Any) -> str:
    """A docstring with its sections as lists."""
    text = inspect.getdoc(thing) or ""
    parts = re.split(r"^(Args|Attributes|Returns|Raises|Examples?):\n", text, flags=re.MULTILINE)
    shown = [_paragraphs(parts[0])]
    for title, body in zip(parts[1::2], parts[2::2], strict=True):
        shown.append(f"**{title}**\n\n{_items(body)}")
    return "\n\n".join(shown)


def _items(body: str) -> str:
    body, _, after = inspect.cleandoc(body).partition("\n\n")
    lines = []
    for line in body.splitlines():
        item = re.match(r"([\w.*, ]+): (.*)", line)
        if item and not line.startswith(" "):
            lines.append(f"- `{item[1]}`: {prose(item[2])}")
        else:
            lines.append(("  " if lines else "") + prose(line.strip()))
    return "\n".join(lines) + (f"\n\n{_paragraphs(after)}" if after else "")


def _paragraphs(text: str) -> str:
    """Prose, with indented parts as code."""
    blocks = []
    for part in text.strip("\n").split("\n\n"):
        indented = all(line.startswith("    ") for line in part.splitlines())
        blocks.append(block(inspect.cleandoc(part), "python") if part and indented else prose(part))
    return "\n\n".join(blocks)
