"""Edit the text of a pipeline file in terms of its graph: nodes, links, parameters.

A file that extends another contains only differences. So inherited values are changed by a new entry, and removed by a
`null`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct

from rendergraph.catalog import Catalog
from rendergraph.document import Document, Source, YamlLimits, from_plain, parse, shown
from rendergraph.edit import text as yaml_text
from rendergraph.edit.text import DELETED
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.read import NAME, PIPELINE, read
from rendergraph.resolve import resolve
from rendergraph.resolve.files import Files
from rendergraph.resolve.patches import Setting, TypeNames, patch_of

_FILE_KEYS = {key.name for key in PIPELINE.keys} - {"nodes", "outputs", "inputs", "parameters"}


class PipelineText(Struct, eq=False):
    """A pipeline file that is being edited. A method that raises an `InputError` may leave a partial change."""

    text: str
    path: Path  # its file, to which its paths are relative
    catalog: Catalog
    notes: list[str] = []  # further effects of the changes, one line each

    def add(self, id: str, node_type: str, values: Mapping[str, Any] = {}) -> None:
        """Add a node; `values` are its links and parameters, by name."""
        self._require_new(id)
        names = self._names(node_type)
        parts: dict[str, dict[str, Any]] = {"inputs": {}, "params": {}}
        for name, value in values.items():
            if name not in names.inputs | names.params:
                hint = suggestion(name, sorted(names.inputs | names.params))
                raise _mistake("RG103", f"node type '{node_type}' has no param or input '{shown(name)}'{hint}")
            parts["inputs" if name in names.inputs else "params"][name] = value
        self._set(("nodes", id), {"type": node_type, **{name: part for name, part in parts.items() if part}})

    def delete(self, id: str) -> None:
        """Remove a node and the links to it; inherited links are removed by null."""
        self._node(id)
        for path, link in _links(self._whole()):
            links = link if isinstance(link, list) else [link]
            left = [one for one in links if _source(one) != id]
            if len(left) < len(links) and path[:2] != ("nodes", id):
                self.notes.append(f"'{path[1]}{path[3:] and '.' + str(path[3])}' no longer reads '{id}'")
                self._set(path, left if len(left) > 1 else left[0] if left else DELETED)
        self._set(("nodes", id), DELETED)

    def rename(self, id: str, new: str) -> None:
        """Rename a node, also in the links of this file."""
        self._node(id)
        self._require_new(new)
        if _at(self._inherited(), ("nodes", id)) is not None:
            raise _mistake("RG109", f"node '{id}' comes from the file that this one extends; rename it there")
        self.text = yaml_text.rename(self.text, ("nodes", id), new)
        for path, link in _links(self._own()):
            for number, one in enumerate(link if isinstance(link, list) else [link]):
                if _source(one) == id:
                    self._set((*path, number) if isinstance(link, list) else path, new + one[len(id) :])

    def connect(self, end: str, links: Sequence[str]) -> None:
        """Connect an input, `node.input`, or an output of the file, `outputs.name`."""
        if "inputs" not in (path := self._path(end, links[0])) and path[0] != "outputs":
            raise _mistake("RG111", f"'{end}' is not an input; to set a value: set {end} VALUE")
        self.set(end, links[0] if len(links) == 1 else list(links))

    def disconnect(self, end: str) -> None:
        """Remove the link of an input, or an output of the file."""
        if _at(self._whole(), self._path(end, None)) is None:
            raise _mistake("RG114", f"'{end}' is not connected")
        self.set(end, None)

    def set(self, name: str, value: Any) -> None:
        """Set a path of `-s`, an output of the file or one of its keys, such as `size`; None removes the value."""
        self._set(self._path(name, value), DELETED if value is None else value)

    def retype(self, id: str, node_type: str) -> None:
        """Change a node's type; inputs and parameters in this file that the new type lacks are dropped."""
        path, names = self._path(f"{id}.type", node_type), self._names(node_type)
        for part, known in (("inputs", names.inputs), ("params", names.params)):
            for name in sorted({*(_at(self._own(), ("nodes", id, part)) or ())} - known):
                self.notes.append(f"'{node_type}' has no {part[:-1]} '{name}'; dropped")
                self._set(("nodes", id, part, name), DELETED)
        self._set(path, node_type)

    def disable(self, id: str) -> None:
        """Disable a node; nodes that read it then read its input instead."""
        self.set(f"{id}.enabled", False)

    def enable(self, id: str) -> None:
        """Enable a disabled node."""
        inherited = _at(self._inherited(), ("nodes", id, "enabled")) is False
        self._set(self._path(f"{id}.enabled", True), True if inherited else DELETED)

    def insert(self, id: str, node_type: str, end: str, port: str = "", out: str = "") -> None:
        """Insert a new node into the link of an input or output of the file, through its ports `port` and `out`."""
        path = self._path(end, "node.port")
        link = _at(self._whole(), path)
        if not isinstance(link, str):
            raise _mistake("RG114", f"'{end}' has no single link into which a node can be inserted")
        if not out:
            port, out = self._passage(node_type)
        self.add(id, node_type, {port: link if "." in link else f"{link}.{path[-1]}"})
        self._set(path, f"{id}.{out}")

    def duplicate(self, id: str, new: str) -> None:
        """Add a node that has the type, links and parameters of another, inherited ones included."""
        node = self._node(id)
        self._require_new(new)
        self._set(("nodes", new), node)

    def view(self, name: str, values: Mapping[str, Any]) -> None:
        """Add a named view, or replace it."""
        self._set(("views", name), dict(values))

    def upgrade(self) -> None:
        """Update the text to the current format: add its version as the first line."""
        if "rendergraph" in self._whole() or "rendergraph" in self._own():
            return
        root = yaml_text.spans(self.text, ())[0]
        put = "rendergraph: 1" + ((yaml_text.BREAK.search(self.text) or ["\n"])[0] if root.block else ", ")
        at = root.start + (not root.block)
        self.text = self.text[:at] + put + self.text[at:]

    # --- what is there -----------------------------------------------------------------------------------------------

    def _own(self) -> Any:
        return parse(self.text).root.plain()

    def _whole(self) -> Any:
        return resolve(self._document(), catalog=self.catalog).tree.plain()

    def _inherited(self) -> Any:
        """The file that this one extends, with everything that it extends in turn."""
        document = self._document()
        kept = {key: value for key, value in document.root.items() if key in ("extends", "plugins")}
        if "extends" not in kept:
            return {}
        base = Document(document.root.with_data(kept), document.source)
        return resolve(base, catalog=self.catalog).tree.plain()

    def _document(self) -> Document:
        return read(self.path, self.text, keep_going=True)

    def _node(self, id: str) -> dict[str, Any]:
        nodes = _at(self._whole(), ("nodes",)) or {}
        if id not in nodes:
            raise _mistake("RG109", f"there is no node '{shown(id)}'{suggestion(id, nodes)}")
        return nodes[id] or {}

    def _require_new(self, id: str) -> None:
        if not NAME.match(id) or id == "inputs":
            expected = "expected letters, digits, '_' and '-', no digit first"
            raise _mistake("RG107", f"a node cannot be called '{shown(id)}': {expected}")
        if id in (_at(self._whole(), ("nodes",)) or {}):
            raise _mistake("RG107", f"there is a node '{id}' already; choose another id")

    def _files(self) -> Files:
        files = Files(self.catalog, (), YamlLimits())
        files.own(self._document())
        return files

    def _names(self, node_type: Any) -> TypeNames:
        names = self._files().names_of(from_plain(node_type, self._document().source))
        if names is None:
            hint = suggestion(str(node_type), self.catalog.names())
            raise _mistake("RG102", f"there is no node type '{shown(node_type)}'{hint}")
        return names

    def _path(self, name: str, value: Any) -> yaml_text.Path:
        """Return the path of `node.param` or another setting of `-s`, of `outputs.name`, or of a key of the file."""
        id, _, last = name.rpartition(".")
        if id == "outputs" or (not id and name in _FILE_KEYS):
            return ("outputs", last) if id else (name,)
        settings = [Setting((), id or None, last, from_plain(value, Source(name)), f"{name}={value}")]
        patch, problems = patch_of(
            resolve(self._document(), catalog=self.catalog).tree, settings, self._files().names_of
        )
        if problems:
            raise InputError(problems)
        if patch is None or not patch.mapping:  # `check` reports the details
            raise _mistake("RG102", f"the type of node '{id}' does not exist; correct it first: retype {id} TYPE")
        path: yaml_text.Path = ()
        while isinstance(patch.data, dict) and len(path) < (4 if id and last not in ("type", "enabled") else 3):
            ((step, patch),) = patch.data.items()
            path = (*path, step)
        return path

    def _passage(self, node_type: str) -> tuple[str, str]:
        """Return an input and the output that continues it, required inputs first."""
        if node_type in self.catalog:
            cls = self.catalog.get(node_type).cls
            for name, port in sorted(cls.inputs().items(), key=lambda item: item[1].optional):
                for out, made in cls.outputs().items():
                    means = getattr(made, "semantic", None)
                    if name in (out, getattr(made, "like", None)) or (means is not None and means == port.semantic):
                        return name, out
        raise _mistake("RG112", f"'{node_type}' has no output that continues an input; name both: INPUT OUTPUT")

    def _set(self, path: yaml_text.Path, value: Any) -> None:
        """Set or delete an entry, inherited ones by null; also delete `inputs` and `params` that become empty."""
        if value is DELETED:
            if _at(self._inherited(), path) is not None:
                value = None
            elif _at(own := self._own(), path[:-1]) is None or path[-1] not in _at(own, path[:-1]):
                return
            elif len(path) == 4 and len(_at(own, path[:-1])) == 1:
                path = path[:-1]
        self.text = yaml_text.edit(self.text, path, value)


def _mistake(code: str, text: str) -> InputError:
    return InputError(Problem(code, text))


def _at(data: Any, path: Iterable[Any]) -> Any:
    for step in path:
        data = data.get(step) if isinstance(data, dict) else None
    return data


def _links(file: Any) -> Iterator[tuple[yaml_text.Path, Any]]:
    """Yield the links of a file, with their places."""
    for id, node in (file.get("nodes") or {}).items():
        for name, link in (_at(node, ("inputs",)) or {}).items():
            yield ("nodes", id, "inputs", name), link
    yield from ((("outputs", name), link) for name, link in (file.get("outputs") or {}).items())


def _source(link: Any) -> str:
    return str(link).partition("@")[0].partition(".")[0]
