"""What can be said of a node without drawing it: its docs, its ranges, and whether anything looks at its parameters."""

from __future__ import annotations

import re
import sys
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from types import FunctionType, MethodType

from msgspec.structs import asdict

from rendergraph.catalog import NodeType
from rendergraph.catalog.types import shared_includes
from rendergraph.declare import Function, Input, Node, Views, WrittenPort
from rendergraph.errors import Problem
from rendergraph.glsl import expand, read_text, strip_comments

LONGEST_DOC = 160


def _problem(subject: str, text: str) -> Problem:
    return Problem("RG490", text, subject=subject)


def docs(cls: type[Node]) -> Iterator[Problem]:
    """What is wrong with the docs of the class, its ports and parameters: each is one line that ends in a stop."""
    first = (cls.__doc__ or "").strip().partition("\n")[0]
    if not first:
        yield _problem("", "has no docs")
    elif not first.endswith("."):
        yield _problem("", "the first line of its docs is no sentence that ends in '.'")
    found = {
        name: port.doc
        for name, port in cls.ports().items()
        if isinstance(port, Input | WrittenPort | Function | Views)
        and (port.doc or name in {*cls.inputs(), *cls.outputs()})
    }
    found |= {name: parameter.doc for name, parameter in cls.parameters().items()}
    for name, doc in found.items():
        if not doc:
            yield _problem(name, f"'{name}' has no doc")
        elif not doc.endswith("."):
            yield _problem(name, f"the doc of '{name}' is no sentence that ends in '.'")
        elif len(doc) >= LONGEST_DOC:
            text = f"the doc of '{name}' has {len(doc)} letters; one line takes less than {LONGEST_DOC}"
            yield _problem(name, text)


def ranges(cls: type[Node]) -> Iterator[str]:
    """Number parameters that reach a shader and do not say between which limits they lie."""
    for name, parameter in cls.parameters().items():
        if parameter.type in (int, float) and None in (parameter.limits.low, parameter.limits.high):
            yield name


def unused(node: NodeType, seen: Collection[str], files: Iterable[Path]) -> Iterator[str]:
    """Inputs and parameters that nothing looks at.

    Args:
        node: the type.
        seen: uniforms, samplers and blocks that some program looks at.
        files: the shaders that its steps use.
    """
    text = _python_text(node)
    shaders = "".join(shader_text(file, node.inherited) for file in files)
    cls = node.cls
    for name, parameter in cls.parameters().items():
        word = name.upper() if parameter.role == "define" else name
        in_shader = name in seen if parameter.role == "param" else bool(re.search(rf"\b{word}(_\w+)?\b", shaders))
        if not in_shader and not re.search(rf"\.{name}\b", text):
            yield name
    for name, port in cls.inputs().items():
        if isinstance(port, Input) and port.kind in ("view", "function"):
            continue
        looks = name in seen or any(re.fullmatch(rf"{name}_\d+", other) for other in seen)
        uses = getattr(port, "use", "sample") != "sample" or not isinstance(port, Input)
        if not looks and not uses and not re.search(rf"\.{name}\b", text):
            yield name


def shader_text(file: Path, inherited: tuple[Path, ...]) -> str:
    """A shader with its includes, some of which may lie where the extended nodes have theirs, comments left out."""
    if not file.is_file():
        return ""
    origins = expand(file, shared_includes(), root=file.parent, versions=True, inherited=inherited).origins
    files = dict.fromkeys(origin.file for origin in origins if origin.file is not None)
    return "\n".join(strip_comments(read_text(one)) for one in files)  # `#include <CURVE>` with them


def _python_text(node: NodeType) -> str:
    """The modules of the node, of those that it extends, and of the rules that its ports ask: they look at it too."""
    if node.is_shader:
        return ""
    modules = {cls.__module__ for cls in node.cls.__mro__ if issubclass(cls, Node) and cls is not Node}
    said = [value for port in node.cls.ports().values() for value in asdict(port).values()]
    modules |= {rule.__module__ for rule in said if isinstance(rule, FunctionType | MethodType)}
    files = {Path(sys.modules[module].__file__ or "") for module in modules}
    return "".join(file.read_text(encoding="utf-8", errors="replace") for file in files)
