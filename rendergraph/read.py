"""Read the YAML text of a pipeline into a Document with only known keys and values of the right types.

Mistakes are reported and left out, so that later stages can find mistakes in the rest and need not check the types of
values again.
"""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

from msgspec.structs import replace

from rendergraph.document import Document, Value, YamlLimits, is_standard_input, parse, read_text
from rendergraph.errors import InputError
from rendergraph.keys import Codes, Key, MapOf, Naming, Recursive, Table, Validator
from rendergraph.keys.values import NUMBER, TEXT, listed, row, shipped, version, whole
from rendergraph.resources import shipped_pipelines, shipped_scenes
from rendergraph.textures import MOST_SIDE
from rendergraph.typecheck import Brief

CODES = Codes(unknown="RG105", wrong="RG106", name="RG107", file="RG013")

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]{0,99}\Z")
"""Node ids, output names, parameter names; limited in length for messages and suggestions."""

_NAMING = Naming(NAME, "letters, digits, '_' and '-', no digit first")
_LINK: Any = Annotated[TEXT | listed(TEXT, "links"), "a link as in 'node.port', a list of links, or null"]
_SIDE = whole(1, MOST_SIDE)
SIZE = Key(
    "size",
    Annotated[row(_SIDE, _SIDE), f"width and height in pixels, 1 to {MOST_SIDE}", Brief("[2 numbers]")],
    "Width and height in pixels.",
    example="size: [1280, 720]",
    code="RG207",
)

PARAMETER = Table(
    "'{}'",
    (
        Key("default", Any, "Default value."),
        Key("min", NUMBER, "Minimum."),
        Key("max", NUMBER, "Maximum."),
        Key("doc", TEXT, "What it does, in one line."),
    ),
)
INPUT = Table(
    "'{}'",
    (
        Key("semantic", TEXT, "Meaning of its texels, such as `radiance`."),
        Key("optional", bool, "Whether it may stay unconnected."),
        Key("doc", TEXT, "What it is for, in one line."),
    ),
)
NODE = Table(
    "'{}'",
    (
        # A resolved file contains its sub-pipelines in place of their file names.
        Key("type", Recursive(TEXT, lambda: PIPELINE), "A node type, or a pipeline file."),
        Key("inputs", MapOf(_LINK, _NAMING), "Input to `node.port`, to a node's id, or to null for nothing."),
        Key("params", MapOf(Any, _NAMING), "Parameter to value; null is its default."),
        Key("enabled", bool, "`false` disables the node; nodes that read it read its input instead.", default=True),
    ),
)
VIEW = Table(
    "'{}'",
    (
        Key("camera", TEXT, "Name of one of the scene's cameras, or a new camera: 'eye=0,1,5 target=0,1,0 fov=40'."),
        Key("frame", whole(1, 100_000), "Number of the frame."),
        Key("environment", TEXT, "Environment map: a shipped name, a file, or `none`."),
    ),
)
_NOT_A_NODE = {"inputs": "a node cannot be called 'inputs'; rename it"}
PIPELINE: Table = Table(
    "a pipeline",
    (
        Key("rendergraph", version(1), "Version of the format.", code="RG016"),
        Key("description", TEXT, "What the pipeline shows, in one line."),
        Key("extends", shipped(shipped_pipelines), "A shipped pipeline or a file; the rest is a merge patch on it."),
        SIZE,
        Key(
            "scene",
            Annotated[shipped(shipped_scenes) | dict[Any, Any], "a scene's name, a file, or a mapping", Brief("scene")],
            "A shipped scene, a scene file, .obj, .gltf or .glb; or a mapping with the keys of scene files, which with "
            "`extends` changes another scene.",
        ),
        Key(
            "plugins",
            listed(TEXT, "folders and packages"),
            "Folders of shader nodes, and installed packages that the pipeline needs.",
            example="plugins: [./effects, some-package]",
        ),
        Key(
            "warm_up",
            whole(1, 10_000),
            "Number of earlier frames on which a frame depends; each part of a split film starts this much earlier.",
        ),
        Key(
            "views",
            MapOf(VIEW, _NAMING, "name of a view"),
            "Named views, each with a camera, a frame and an environment; `--view NAME` chooses one.",
            example="views: {side: {camera: 'eye=4,1,0 target=0,1,0', frame: 30}}",
        ),
        Key("parameters", MapOf(PARAMETER, _NAMING), "Parameters of the pipeline, which its nodes use as $name."),
        Key("inputs", MapOf(INPUT, _NAMING), "Inputs of the pipeline when it is the type of a node."),
        Key("nodes", MapOf(NODE, _NAMING, "node id", _NOT_A_NODE), "Nodes, by id."),
        Key("outputs", MapOf(TEXT, _NAMING, "output name"), "Output name to `node.port`."),
    ),
    code="RG101",
)
"""The keys of a pipeline file; the only source for checking, `explain`, the schema and the reference."""

_PATCH = replace(
    PIPELINE,
    keys=tuple(key for key in PIPELINE.keys if key.name != "extends"),
    refused={"extends": "a patch cannot extend a pipeline; remove 'extends'"},
)
_HOLDS = "`nodes` and `outputs`"


def read(
    path: Path | None,
    text: str | None = None,
    limits: YamlLimits = YamlLimits(),
    *,
    name: str | None = None,
    keep_going: bool = False,
    patch: bool = False,
) -> Document:
    """Return a pipeline file as a document of known keys; `patch` reads a merge patch, which cannot have `extends`."""
    name = name or str(path or "<text>")
    if text is None:
        if path is None:
            raise ValueError("read() needs a path or a text")
        text = read_text(path, limits, name)
        if is_standard_input(path):  # its paths are relative to the current folder
            path, name = None, "stdin"
    return _read(path, text, limits, name, keep_going, patch)


@lru_cache(maxsize=32)
def _read(path: Path | None, text: str, limits: YamlLimits, name: str, keep_going: bool, patch: bool) -> Document:
    document = parse(text, name, path=path, limits=limits, keep_going=True)
    return checked(document, keep_going=keep_going, patch=patch)


def checked(document: Document, *, keep_going: bool = False, patch: bool = False) -> Document:
    """Return the document without invalid parts, and with the problems about them."""
    validator, value = Validator(CODES, document.problems), document.root
    if value.data is None and not patch:
        validator.report(value, CODES.file, f"the file is empty; a pipeline has at least {_HOLDS}")
        raise InputError(validator.problems)
    if (sweep := value.get("sweep")) is not None:
        text = "this file is a sweep, not a pipeline; run it with: rendergraph sweep FILE -o FOLDER"
        validator.report(sweep, "RG101", text, key=True)
        raise InputError(validator.problems)
    scene = value.get("scene")
    if scene is not None and type(scene.data) is int and value.get("nodes") is value.get("extends") is None:
        text = "this file is a scene, not a pipeline; render it with: rendergraph run full --scene FILE"
        validator.report(scene, "RG013", text, key=True)
        raise InputError(validator.problems)
    root = validator.file(value, _PATCH if patch else PIPELINE, _HOLDS)
    if root is None or (validator.problems and not keep_going):
        raise InputError(validator.problems)
    return Document(root, document.source, tuple(validator.problems), document.dropped | validator.dropped)


def entries(value: Value | None, *path: str) -> dict[str, Value]:
    """Return the non-null entries of a mapping at a path; empty if it does not exist."""
    found = value.get(*path) if value is not None else None
    data = found.data if found is not None else None
    return {key: child for key, child in data.items() if child.data is not None} if isinstance(data, dict) else {}


def flag(value: Value | None, *path: str) -> bool:
    """Return whether the value at a path is `true`."""
    found = value.get(*path) if value is not None else None
    return found is not None and found.data is True


def word(value: Value | None, *path: str) -> str | None:
    """Return the text at a path; None if it does not exist."""
    found = value.get(*path) if value is not None else None
    return found.data if found is not None and isinstance(found.data, str) else None
