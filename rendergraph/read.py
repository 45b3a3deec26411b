"""YAML text of a pipeline to a Document: only known keys, each with the kind of value it takes.

What is wrong is reported and left out, so that later stages can go on looking for mistakes in the rest and need not ask
again what kind of value they hold.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

from rendergraph.document import BROKEN, Document, Limits, Value, load, parse, shown
from rendergraph.errors import InputError, Problem, suggestion

VERSION = 1
"""The number after `rendergraph:`; it grows when an old file would change its meaning."""

NODE_KEYS = ("type", "inputs", "params")
PARAMETER_KEYS = ("default", "min", "max", "doc")
INPUT_KEYS = ("semantic", "optional", "doc")
TOP_KEYS = (
    "rendergraph",
    "description",
    "extends",
    "size",
    "scene",
    "plugins",
    "parameters",
    "inputs",
    "nodes",
    "outputs",
)

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]{0,99}\Z")
"""Node ids, output names, parameter names; long ones make messages and the search for the nearest name long."""

MOST_PROBLEMS = 100
"""Mistakes after which nobody reads on; finding the nearest name for each of a million takes hours."""


def read(
    path: Path | None,
    text: str | None = None,
    limits: Limits = Limits(),
    *,
    name: str | None = None,
    keep_going: bool = False,
    patch: bool = False,
) -> Document:
    """A pipeline file as a Document of known keys.

    Args:
        path: the file; to which relative paths in it are relative.
        text: its text, where it is at hand.
        limits: budgets of the YAML.
        name: how messages name it; the path by default.
        keep_going: put mistakes that do not stop the reading into `Document.problems`.
        patch: it is a merge patch, which cannot say `extends`.

    Raises:
        InputError: it cannot be read, or is no pipeline; with all mistakes.
    """
    if text is not None:
        document = parse(text, name or str(path or "<text>"), path=path, limits=limits, keep_going=True)
    elif path is not None:
        document = load(path, limits=limits, keep_going=True, name=name)
    else:
        raise ValueError("read() needs a path or a text")
    return checked(document, keep_going=keep_going, patch=patch)


def checked(document: Document, *, keep_going: bool = False, patch: bool = False) -> Document:
    """A document with everything left out that is no pipeline's, and problems that say so.

    Raises:
        InputError: something was left out and `keep_going` is off, or the whole is not a mapping.
    """
    grammar = _Grammar(patch, bool(document.problems))
    root = grammar.top(document.root)
    problems = (*document.problems, *grammar.problems)
    if problems and (not keep_going or root is None):
        raise InputError(problems)
    assert root is not None
    return Document(root, document.source, problems, document.dropped | grammar.dropped)


Shape: TypeAlias = "Callable[[Value, str], Value | None]"


class _Grammar:
    """One walk over a file; every method gives the value back without what does not belong there."""

    def __init__(self, patch: bool, suspect: bool) -> None:
        self.patch = patch
        self.suspect = suspect
        self.problems: list[Problem] = []
        self.dropped: set[tuple[str, ...]] = set()
        self._path: list[str] = []

    def say(self, value: Value, code: str, text: str, *, key: bool = False) -> None:
        self.problems.append(value.problem(code, text, key=key))
        if len(self.problems) >= MOST_PROBLEMS:
            raise InputError(self.problems)

    def enter(self, key: str, child: Value, shape: Shape, kept: dict[str, Value]) -> None:
        """Keep a child as far as it is right; remember where something was left out."""
        self._path.append(key)
        if child.data is None:
            kept[key] = child
        elif child.data is not BROKEN and (good := shape(child, key)) is not None:
            kept[key] = good
        else:
            self.dropped.add(tuple(self._path))
        self._path.pop()

    def top(self, root: Value) -> Value | None:
        if root.data is BROKEN:
            return None
        if root.data is None and not self.patch:
            self.say(root, "RG013", "the file is empty; a pipeline has at least `nodes` and `outputs`")
            return None
        if not isinstance(root.data, dict):
            self.say(root, "RG013", f"a pipeline is a mapping with `nodes` and `outputs`, this is {root.kind}")
            return None
        shapes: dict[str, Shape] = {
            "rendergraph": self.version,
            "description": self.text,
            "extends": self.extends,
            "size": self.size,
            "scene": self.text,
            "plugins": self.texts,
            "parameters": self.named(self.keyed(PARAMETER_KEYS, self.parameter_part)),
            "inputs": self.named(self.keyed(INPUT_KEYS, self.input_part)),
            "nodes": self.named(self.keyed(NODE_KEYS, self.node_part), "node id"),
            "outputs": self.named(self.text, "output name"),
        }
        return self.keyed(TOP_KEYS, lambda value, key: shapes[key](value, key))(root, "a pipeline")

    def keyed(self, known: tuple[str, ...], shape: Shape) -> Shape:
        """A mapping of known keys."""

        def check(value: Value, what: str) -> Value | None:
            if not self.is_mapping(value, what):
                return None
            kept: dict[str, Value] = {}
            if known is TOP_KEYS and (sweep := dict(value.items()).get("sweep")) is not None:
                text = "this is no pipeline but a sweep; draw it with: rendergraph sweep FILE -o FOLDER"
                self.say(sweep, "RG101", text, key=True)
                return None
            for key, child in value.items():
                if key not in known:
                    where = "a pipeline" if known is TOP_KEYS else f"'{what}'"
                    text = f"{where} has no key '{shown(key)}'{suggestion(str(key), known)}"
                    self.say(child, "RG101" if known is TOP_KEYS else "RG105", text, key=True)
                else:
                    self.enter(key, child, shape, kept)
            return value.with_data(kept)

        return check

    def named(self, shape: Shape, what: str = "name") -> Shape:
        """A mapping of free names."""

        def check(value: Value, where: str) -> Value | None:
            if not self.is_mapping(value, where):
                return None
            kept: dict[str, Value] = {}
            for key, child in value.items():
                if not isinstance(key, str) or not NAME.match(key):
                    text = f"'{shown(key)}' is no {what}; letters, digits, '_' and '-' make one, no digit first"
                    text += "; a blank stands between the ':' and the value" if ":" in str(key) else ""
                    self.say(child, "RG107", text, key=True)
                    self.dropped.add((*self._path, str(key)))
                elif where == "nodes" and key == "inputs":
                    self.say(child, "RG107", "a node cannot be called 'inputs'; rename it", key=True)
                    self.dropped.add((*self._path, key))
                else:
                    self.enter(key, child, shape, kept)
            return value.with_data(kept)

        return check

    def is_mapping(self, value: Value, what: str) -> bool:
        if isinstance(value.data, dict):
            return True
        self.say(value, "RG106", f"'{what}' takes a mapping, this is {value.kind}")
        return False

    def text(self, value: Value, key: str) -> Value | None:
        if isinstance(value.data, str) and value.data.strip():
            return value
        what = "empty" if value.data == "" else value.kind
        self.say(value, "RG106", f"'{key}' takes text, this is {what}")
        return None

    def texts(self, value: Value, key: str) -> Value | None:
        if isinstance(value.data, list):
            return value.with_data([part for part in value.data if self.text(part, key) is not None])
        self.say(value, "RG106", f"'{key}' takes a list as in [./effects, some-package], this is {value.kind}")
        return None

    def version(self, value: Value, key: str) -> Value | None:
        if value.data == VERSION and not isinstance(value.data, bool):
            return value
        self.say(value, "RG016", f"this program reads version {VERSION} of the format, as in 'rendergraph: {VERSION}'")
        return None

    def extends(self, value: Value, key: str) -> Value | None:
        if self.patch:
            self.say(value, "RG101", "a patch cannot extend a pipeline; leave 'extends' out", key=True)
            return None
        return self.text(value, key)

    def size(self, value: Value, key: str) -> Value | None:
        data = value.data
        if isinstance(data, list) and len(data) == 2 and all(type(side.data) is int for side in data):
            return value
        if _has_broken(value):
            return None
        self.say(value, "RG106", f"'{key}' takes width and height in pixels, as in [1280, 720]")
        return None

    def node_part(self, value: Value, key: str) -> Value | None:
        if key == "type":
            # A resolved file carries its sub-pipelines where it would name their files.
            return self.top(value) if isinstance(value.data, dict) else self.text(value, key)
        return self.named(self.link if key == "inputs" else self.anything)(value, key)

    def link(self, value: Value, key: str) -> Value | None:
        parts = value.data if isinstance(value.data, list) else [value]
        if all(isinstance(part.data, str) and part.data for part in parts):
            return value
        if any(part.data is BROKEN for part in parts):
            return None
        self.say(value, "RG106", f"'{key}' takes a link as in 'node.port', a list of links, or null")
        return None

    def anything(self, value: Value, key: str) -> Value | None:
        return None if self.suspect and _has_broken(value) else value

    def parameter_part(self, value: Value, key: str) -> Value | None:
        if key == "doc":
            return self.text(value, key)
        if key == "default":
            return self.anything(value, key)
        if isinstance(value.data, int | float) and not isinstance(value.data, bool):
            return value
        self.say(value, "RG106", f"'{key}' takes a number, this is {value.kind}")
        return None

    def input_part(self, value: Value, key: str) -> Value | None:
        if key != "optional":
            return self.text(value, key)
        if isinstance(value.data, bool):
            return value
        self.say(value, "RG106", f"'{key}' takes true or false, this is {value.kind}")
        return None


def _has_broken(value: Value) -> bool:
    data = value.data
    parts = data if isinstance(data, list) else data.values() if isinstance(data, dict) else ()
    return data is BROKEN or any(map(_has_broken, parts))


def entries(value: Value | None, *path: str) -> dict[str, Value]:
    """The entries of a mapping at a path of a read document, without those that are null; empty where there is none."""
    found = value.get(*path) if value is not None else None
    data = found.data if found is not None else None
    return {key: child for key, child in data.items() if child.data is not None} if isinstance(data, dict) else {}


def word(value: Value | None, *path: str) -> str | None:
    """The text at a path of a read document, None where there is none."""
    found = value.get(*path) if value is not None else None
    return found.data if found is not None and isinstance(found.data, str) else None
