"""A resolved pipeline: plain nodes with every value's origin, and the same as YAML text."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct

from rendergraph.catalog import Catalog
from rendergraph.document import Source, Value, scalar
from rendergraph.errors import InputError, Place, Problem
from rendergraph.resources import folder
from rendergraph.settings import Roots

_PLAIN = re.compile(r"[A-Za-z_./$][A-Za-z0-9_./$@ -]*(?<! )\Z")
_WIDTH = 60


def to_yaml(tree: Value, origins: bool) -> str:
    lines = list(_block(tree, 0))
    if not origins:
        return "".join(f"{text}\n" for text, _ in lines)
    width = max((len(text) for text, origin in lines if origin and len(text) <= _WIDTH), default=0)
    return "".join(f"{text.ljust(width)}  # {_origin(origin)}\n" if origin else f"{text}\n" for text, origin in lines)


def _block(value: Value, indent: int) -> Iterator[tuple[str, Value | None]]:
    for key, child in value.items():
        head = f"{'  ' * indent}{text_of(key)}:"
        if isinstance(child.data, dict) and child.data:
            yield head, None
            yield from _block(child, indent + 1)
        else:
            yield f"{head} {flow(child)}", child


def flow(value: Value) -> str:
    """Return a value as YAML in one line."""
    data = value.data
    if isinstance(data, dict):
        return "{" + ", ".join(f"{text_of(key)}: {flow(child)}" for key, child in data.items()) + "}"
    if isinstance(data, list):
        return "[" + ", ".join(flow(child) for child in data) + "]"
    return text_of(data)


def text_of(data: Any) -> str:
    """Return a scalar as YAML, quoted if necessary."""
    if data is None:
        return "null"
    if isinstance(data, bool):
        return "true" if data else "false"
    if isinstance(data, float):
        if math.isfinite(data):
            return repr(data)
        return ".nan" if math.isnan(data) else ".inf" if data > 0 else "-.inf"
    if isinstance(data, int):
        return str(data)
    if _PLAIN.match(data) and scalar(data) == data:
        return str(data)
    return '"' + "".join(map(_escaped, data)) + '"'


def _escaped(char: str) -> str:
    if char in '"\\':
        return f"\\{char}"
    # YAML's own escapes, because PyYAML does not join the surrogate pairs of JSON's.
    if char.isprintable():
        return char
    return f"\\u{ord(char):04X}" if ord(char) < 0x10000 else f"\\U{ord(char):08X}"


def _origin(value: Value) -> str:
    path = value.source.path
    is_shipped = path is not None and path.is_relative_to(folder("rendergraph.pipelines"))
    name = path.stem if path is not None and is_shipped else str(value.source.origin)
    return f"{name}:{value.line}" if value.line else name


DEFAULT_SIZE = (1280, 720)
"""Default width and height."""


class NodeSpec(Struct, frozen=True, eq=False):
    """One node, after sub-pipelines are inlined.

    Attributes:
        scope: id of the enclosing sub-pipeline with a trailing slash, or empty.
        inputs: links by input or group name; null disconnects.
        params: values by name, `$name` replaced, nulls left out.
        disabled: the `false` that removes it, its own or that of an enclosing sub-pipeline.
    """

    id: str
    type: str
    scope: str
    inputs: Mapping[str, Value]
    params: Mapping[str, Value]
    value: Value
    disabled: Value | None = None

    @property
    def place(self) -> Place:
        return self.value.key_place


class Scope(Struct, frozen=True, eq=False):
    """An inlined sub-pipeline: its declared `inputs` and `outputs`, and the `links` that its node gives to them."""

    parent: str
    inputs: Mapping[str, Value]
    links: Mapping[str, Value]
    outputs: Mapping[str, Value]
    value: Value
    disabled: Value | None = None


class PipelineParameter(Struct, frozen=True):
    name: str
    value: Any
    place: Place
    min: float | None = None
    max: float | None = None
    doc: str = ""


class PipelineSpec(Struct, frozen=True, eq=False):
    """A pipeline with `extends`, patches, settings, parameters and sub-pipelines applied.

    Attributes:
        scene: the scene's file, if there is one.
        scene_changes: the mapping of the pipeline that is merged into the scene, or is the scene.
        roots: folders from which the scene may read; `roots.check(path, place)`.
        source_roots: folders for files that parameters name, by the file that contains the parameter.
        scopes: sub-pipelines by scope (`glow/`).
        tree: the resolved file, with sub-pipelines in place of their names.
        problems: mistakes found so far; `link` raises them with its own, so that a user sees all at once.
        dropped: paths of values that were left out because of them.
        removed: the `null` of each node that a file removes from what it extends.
        unrun: types whose Python code is in a folder that only a pipeline file names, and the argument for `--plugin`.
    """

    name: str
    path: Path | None
    description: str
    size: tuple[int, int]
    scene: Path | None
    scene_changes: Value | None
    roots: Roots
    nodes: Mapping[str, NodeSpec]
    outputs: Mapping[str, Value]
    parameters: Mapping[str, PipelineParameter]
    scopes: Mapping[str, Scope]
    tree: Value
    notes: tuple[Problem, ...] = ()
    problems: tuple[Problem, ...] = ()
    dropped: frozenset[tuple[str, ...]] = frozenset()
    removed: Mapping[str, Value] = {}
    catalog: Catalog | None = None
    missing: tuple[str, ...] = ()
    unrun: Mapping[str, str] = {}
    source_roots: Mapping[Source, Roots] = {}

    @property
    def scene_name(self) -> str:
        """The stem of the scene's file or of the file with changes; empty without a scene."""
        if self.scene is None:
            return "" if self.scene_changes is None else "scene"
        return self.scene.stem

    def check(self) -> None:
        """Raise the problems found so far; for callers that do not go on to `link`."""
        if self.problems:
            raise InputError(self.problems)

    def plain(self) -> dict[str, Any]:
        self.check()
        data: dict[str, Any] = self.tree.plain()
        return data

    def to_yaml(self, origins: bool = False) -> str:
        self.check()
        return to_yaml(self.tree, origins)
