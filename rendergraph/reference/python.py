"""Public names in Python, and the functions of shared includes: from signatures, docstrings and comments."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import msgspec

from rendergraph import api
from rendergraph.catalog.types import shared_includes

PUBLIC_ERRORS = ("InputError", "RenderError", "DeviceError", "UsageError", "Problem", "Place")
"""Names of `rendergraph.errors` that users catch or read; `RendergraphError`, the base, is one of `rendergraph`."""
_FUNCTION = re.compile(r"^((?:\w+ )?\w+) (\w+)\(([^;{}()]*)\)(?: \{|;)", re.MULTILINE)


def public_names() -> dict[str, Any]:
    """Return everything public in Python by name: of `rendergraph`, `rendergraph.errors` and `rendergraph.api`."""
    # By its name: the package offers the viewer, too, which this explains and does not need.
    package, errors = import_module("rendergraph"), import_module("rendergraph.errors")
    own = {name: _value(package, name) for name in package.__all__}
    return own | {name: getattr(errors, name) for name in PUBLIC_ERRORS} | author_names()


def author_names() -> dict[str, Any]:
    """Return what authors of nodes import from `rendergraph.api`, and what `update` is given."""
    named = {name: value for name, value in sorted(vars(api).items()) if name[0] != "_"}
    found = {name: value for name, value in named.items() if not inspect.ismodule(value)}
    given = {"FrameScene": "rendergraph.steps.frame", "Light": "rendergraph.scene.model"}
    return found | {name: getattr(import_module(module), name) for name, module in given.items()}


def _value(package: Any, name: str) -> Any:
    found = getattr(package, name)
    return getattr(found, name) if inspect.ismodule(found) else found


def describe_python(topic: str) -> dict[str, Any]:
    """Return signature, documentation and members of a public name; empty where there is none.

    `api` lists the names for authors of nodes, and `glsl` the functions of the shared includes.
    """
    if topic == "api":
        names = {name: value for name, value in author_names().items() if _line(value)}
        return {"topic": "api", "names": {name: _line(value) for name, value in names.items()}}
    if topic == "glsl":
        files = sorted(shared_includes().glob("*.glsl"))
        return {"topic": "glsl", "includes": {file.name: _functions(file.read_text("utf-8")) for file in files}}
    names = public_names()
    if (thing := names.get(topic)) is None:
        return {}
    if not callable(thing):  # a Semantic or a Signature: what a port carries
        text = "\n".join(filter(None, (getattr(thing, "declaration", ""), _line(thing))))
        return {"name": topic, "signature": type(thing).__name__, "doc": text, "members": []} if text else {}
    members = public_members(thing) if inspect.isclass(thing) else ()
    return {
        "name": topic,
        "signature": f"{topic}{signature(thing)}",
        "doc": inspect.getdoc(thing) or "",
        "members": [
            {"name": name, "signature": member_signature(name, value), "doc": inspect.getdoc(member_of(value)) or ""}
            for name, value in members
        ],
    }


def _line(thing: Any) -> str:
    doc = getattr(thing, "doc", None)
    text = doc if isinstance(doc, str) else (inspect.getdoc(thing) or "") if callable(thing) else ""
    return text.strip().partition("\n")[0]


def _functions(text: str) -> list[str]:
    found = _FUNCTION.findall(text)
    return list(dict.fromkeys(f"{kind} {name}({' '.join(arguments.split())})" for kind, name, arguments in found))


def member_of(value: Any) -> Any:
    """Return the function of a method or property."""
    found: Any = value.fget if isinstance(value, property) else getattr(value, "func", value)
    return inspect.unwrap(getattr(found, "__func__", found))


def member_signature(name: str, value: Any) -> str:
    """Return the signature of a method, or the name alone of a property."""
    is_value = isinstance(value, property) or hasattr(value, "func")
    return name if is_value else f"{name}{signature(member_of(value), method=True)}"


def public_members(cls: type) -> Iterator[tuple[str, Any]]:
    """Documented methods and properties that the class defines, or a base that has no entry of its own."""
    seen: set[str] = set()
    for base in cls.__mro__:
        if not base.__module__.startswith("rendergraph") or (base is not cls and hasattr(api, base.__name__)):
            continue
        for name, value in vars(base).items():
            shown = member_of(value)
            if not name.startswith("_") and name not in seen and inspect.isfunction(shown) and shown.__doc__:
                seen.add(name)
                yield name, value


def signature(thing: Any, *, method: bool = False) -> str:
    """Return arguments, their types and defaults, and what is returned, as Python has them."""
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
