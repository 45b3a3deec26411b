"""Every key of the files we read, from the tables that `explain` prints, and the limits on files."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from typing import Any

import msgspec

from rendergraph import document
from rendergraph.catalog import entries, find
from rendergraph.compare.space import MOST_RUNS
from rendergraph.glsl import MAX_BYTES, expansion, source
from rendergraph.reference import file_keys
from rendergraph.resolve import flatten
from rendergraph.scene.image_files import MOST_CHANNELS
from rendergraph.scene.model import SceneLimits
from rendergraph.steps import MOST_STEPS
from rendergraph.textures import MOST_SIDE

from .markdown import code, prose, table

FILES = {"pipeline": "The file", "scene": "The file", "sweep": "", "settings": "", "header": "The header itself"}
"""What the first table of a kind of file is called; nothing where there is but one."""

HEADS = ("key", "value", "default", "")


def pages() -> Iterator[tuple[str, str]]:
    """A part of a page for each kind of file."""
    for kind, top in FILES.items():
        yield f"{kind}-keys.md", _sections(file_keys(kind), top)
    yield "limits.md", _limits()


def _sections(keys: list[dict[str, Any]], top: str) -> str:
    parts = []
    for section in dict.fromkeys(row["section"] for row in keys):
        rows = [
            (code(row["key"]), code(row["value"]), _default(row), prose(row["doc"]))
            for row in keys
            if row["section"] == section
        ]
        title = f"`{section}`" if section else top
        parts.append((f"### {title}\n\n" if title else "") + table(HEADS, rows))
    return "\n".join(parts)


def _default(row: dict[str, Any]) -> str:
    if row["required"]:
        return "required"
    value = row["default"]
    if value is None:
        return row["unit"] or ""
    if isinstance(value, bool):
        value = "true" if value else "false"
    elif isinstance(value, list):
        value = "[" + ", ".join(f"{item:g}" if isinstance(item, float) else str(item) for item in value) + "]"
    elif isinstance(value, float):
        value = f"{value:g}"
    return f"{code(value)} {row['unit']}".strip()


def _limits() -> str:
    rows = [
        *_documented("a YAML file", "yaml", document.YamlLimits),
        *_documented("a scene", "scene", SceneLimits),
    ]
    rows += [
        ("an image", "channels of an EXR", MOST_CHANNELS, ""),
        ("a pipeline", "nodes, those of sub-pipelines included", flatten.MOST_NODES, ""),
        ("a pipeline", "sub-pipelines inside each other", flatten.MOST_NESTED, ""),
        ("a pipeline", "steps", MOST_STEPS, ""),
        ("a picture", "pixels along one side; a driver's own limit may be lower", MOST_SIDE, ""),
        ("a shader", "bytes with its includes", MAX_BYTES, ""),
        ("a shader", "includes inside each other", source.MAX_DEPTH, ""),
        ("a shader", "words that its macros may make", expansion.MOST_WORDS, ""),
        ("a shader", "macros inside each other", expansion.MOST_NESTED, ""),
        ("a shader node", "ports and parameters", entries.MOST_NAMES, ""),
        ("a folder of shader nodes that a pipeline names", "files", find.MOST_FILES, ""),
        ("a sweep", "runs", MOST_RUNS, ""),
    ]
    shown = [(of, prose(what), f"{most:,}", code(name) if name else "") for of, what, most, name in rows]
    return table(("of", "limit on", "value", "`--limit`"), shown)


def _documented(of: str, kind: str, limits: Any) -> list[tuple[str, str, int, str]]:
    """The fields of a class of limits, as its docstring explains them, and what `--limit` calls them."""
    doc = re.sub(r"\n {8,}", " ", inspect.getdoc(limits) or "")
    about = dict(re.findall(r"^ +(\w+): (.*)$", doc, re.MULTILINE))
    values = {found.name: found.default for found in msgspec.structs.fields(limits)}
    return [
        (of, about[name].rstrip("."), most, f"{kind}-{name.replace('_', '-')}=N")
        for name, most in values.items()
        if name in about and isinstance(most, int)
    ]
