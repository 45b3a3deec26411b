"""What a pipeline is after resolving: plain nodes with every value's origin."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct

from rendergraph.catalog import Catalog
from rendergraph.document import Value
from rendergraph.errors import InputError, Place, Problem
from rendergraph.resolve.write import to_yaml
from rendergraph.settings import Roots

DEFAULT_SIZE = (1280, 720)
"""Width and height where nothing says otherwise."""


class NodeSpec(Struct, frozen=True, eq=False):
    """One node, sub-pipelines unfolded.

    Attributes:
        id: key in the file; inside a sub-pipeline `glow/blur`.
        type: name of its type, empty where the file gives none.
        scope: id of the sub-pipeline it stands in with a slash behind, empty outside of any.
        inputs: links by input or group name; a null says that nothing is connected.
        params: values by parameter name, `$name` replaced, nulls left out.
        value: the node in the file.
        disabled: the `false` that takes it out, its own or that of a sub-pipeline around it; None where there is none.
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
        """Where the node's id stands."""
        return self.value.key_place


class Scope(Struct, frozen=True, eq=False):
    """A sub-pipeline in its place.

    Attributes:
        parent: the scope its node stands in.
        inputs: its declared inputs.
        links: what the node connects to them; refers to the parent scope.
        outputs: its outputs; refers to nodes inside.
        value: the node whose type it is.
        disabled: the `false` that takes it out, as a node has it.
    """

    parent: str
    inputs: Mapping[str, Value]
    links: Mapping[str, Value]
    outputs: Mapping[str, Value]
    value: Value
    disabled: Value | None = None


class PipelineParameter(Struct, frozen=True):
    """A knob of the whole pipeline."""

    name: str
    value: Any
    place: Place
    min: float | None = None
    max: float | None = None
    doc: str = ""


class PipelineSpec(Struct, frozen=True, eq=False):
    """A pipeline with `extends`, patches, settings, parameters and sub-pipelines applied.

    Attributes:
        name: the file's stem.
        path: the file, None for text.
        description: from the file.
        size: width and height.
        scene: the scene's file, None where none is named.
        roots: where the scene may read from; `roots.check(path, place)`.
        nodes: by id, in the file's order.
        outputs: links by output name.
        parameters: by name.
        scopes: sub-pipelines by scope (`glow/`).
        tree: the resolved file, sub-pipelines in place of their names; prints as `to_yaml`.
        notes: warnings: what was dropped, what is unused.
        problems: mistakes found so far. `link` raises them together with its own, so that a user sees all at once.
        dropped: paths of what was left out because of them.
        removed: the `null` of each node that a file takes away from what it extends.
        catalog: the node types, with the shader files that the pipeline brings along.
        missing: packages that it needs and that are not installed.
        unrun: types whose Python stands in a folder that only a pipeline file names, and what `--plugin` takes for it.
    """

    name: str
    path: Path | None
    description: str
    size: tuple[int, int]
    scene: Path | None
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

    def check(self) -> None:
        """Stop here if anything is wrong so far; for callers that do not go on to `link`.

        Raises:
            InputError: with all mistakes found while resolving.
        """
        if self.problems:
            raise InputError(self.problems)

    def plain(self) -> dict[str, Any]:
        """The resolved file as plain data.

        Raises:
            InputError: something is wrong with it.
        """
        self.check()
        data: dict[str, Any] = self.tree.plain()
        return data

    def to_yaml(self, origins: bool = False) -> str:
        """The resolved file, which reads back to the same spec.

        Args:
            origins: say behind every value where it comes from.

        Raises:
            InputError: something is wrong with it.
        """
        self.check()
        return to_yaml(self.tree, origins)
