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
import rendergraph.steps.state
import rendergraph.textures
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

_GIVEN = {"FrameScene": rendergraph.steps.frame.FrameScene, "Light": rendergraph.scene.model.Light}
"""What an author meets and does not import."""

_WITH_WORDS = (rendergraph.ports, rendergraph.textures, rendergraph.steps.model, rendergraph.steps.state)


def pages() -> Iterator[tuple[str, str]]:
    """A page for users, and two for authors of nodes."""
    names = [(name, rendergraph) for name in ("load", "Pipeline", "Selection", "RenderOptions", "Session", "Frame")]
    errors = ("RendergraphError", "InputError", "RenderError", "DeviceError", "UsageError", "Problem", "Place")
    names += [(name, rendergraph.errors) for name in errors]
    yield (
        "python.md",
        page(
            "Python",
            "The same words as on the command line: load, set, render. `import rendergraph as rg` gives the first "
            "six; the exceptions are in `rendergraph.errors`.",
            *(_entry(name, getattr(module, name)) for name, module in names),
        ),
    )
    own = {name: value for name, value in sorted(vars(rendergraph.api).items()) if name[0] != "_"}
    members = {name: value for name, value in own.items() if not inspect.ismodule(value)} | _GIVEN
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
    for member, value in _public_members(thing):
        shown: Any = value.fget if isinstance(value, property) else getattr(value, "func", value)
        shown = inspect.unwrap(getattr(shown, "__func__", shown))
        kind = "" if isinstance(value, property) or hasattr(value, "func") else signature(shown, method=True)
        parts += [f"### {name}.{member}", block(f"{member}{kind}", "python") if kind else "", _doc(shown)]
    return "\n\n".join(part for part in parts if part)


def _public_members(cls: type) -> Iterator[tuple[str, Any]]:
    """Documented methods and properties that the class defines, or a base that has no entry of its own."""
    seen: set[str] = set()
    for base in cls.__mro__:
        if not base.__module__.startswith("rendergraph") or (
            base is not cls and hasattr(rendergraph.api, base.__name__)
        ):
            continue
        for name, value in vars(base).items():
            shown: Any = value.fget if isinstance(value, property) else getattr(value, "func", value)
            shown = inspect.unwrap(getattr(shown, "__func__", shown))
            if not name.startswith("_") and name not in seen and inspect.isfunction(shown) and shown.__doc__:
                seen.add(name)
                yield name, value


def signature(thing: Any, *, method: bool = False) -> str:
    try:
        found = inspect.signature(thing)
    except (TypeError, ValueError):
        return "(…)"
    shown, keyword_only = [], False
    # A struct's signature has its types worked out; the page shows them by the names that it explains.
    is_struct = inspect.isclass(thing) and issubclass(thing, msgspec.Struct)
    lines = [inspect.get_annotations(base) for base in reversed(thing.__mro__)] if is_struct else []
    written = {name: text for line in lines for name, text in line.items()}
    for parameter in found.parameters.values():
        parameter = parameter.replace(annotation=written.get(parameter.name, parameter.annotation))
        if method and parameter.name in ("self", "cls"):
            continue
        if parameter.kind is parameter.KEYWORD_ONLY and not keyword_only:
            shown.append("*")
            keyword_only = True
        shown.append(_parameter(parameter))
    result = (
        "" if inspect.isclass(thing) or found.return_annotation is found.empty else f" -> {found.return_annotation}"
    )
    line = f"({', '.join(shown)}){result}"
    return line if len(line) <= 90 else "(\n    " + ",\n    ".join(shown) + f",\n){result}"


def _parameter(parameter: inspect.Parameter) -> str:
    stars = "*" * ((parameter.kind is parameter.VAR_POSITIONAL) + 2 * (parameter.kind is parameter.VAR_KEYWORD))
    text = f"{stars}{parameter.name}"
    if parameter.annotation is not parameter.empty:
        text += f": {parameter.annotation}"
    if parameter.default is not parameter.empty:
        default = repr(parameter.default)
        text += f" = {'…' if default.startswith('<') or len(default) > 40 else default}"
    return text


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
