"""The files of a pipeline, inside the roots: those that `extends` and `type` name, and the node types it provides.

A pipeline file is data, so nothing is imported here: it can provide only shader files by path, folders of them, and the
names of packages that it needs.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from rendergraph.catalog import SHADERS, Catalog, find
from rendergraph.document import Document, Source, Value, YamlLimits, shown
from rendergraph.errors import InputError, Place, Problem, shown_file, suggestion
from rendergraph.installed import version
from rendergraph.keys import MOST_PROBLEMS
from rendergraph.read import checked, entries, flag, read, word
from rendergraph.resolve.patches import TypeNames, merge_pipeline
from rendergraph.resources import is_name, shipped_pipelines
from rendergraph.settings import Roots

_MOST_EXTENDED = 32
_PACKAGE = r"[A-Za-z0-9](?:[A-Za-z0-9_-]{0,98}[A-Za-z0-9])?\Z"


class Files:
    """Reads and merges files, each once; collects problems."""

    def __init__(self, catalog: Catalog, asset_roots: Sequence[Path], limits: YamlLimits) -> None:
        self.plugins = Plugins(catalog, self.report)
        self.asset_roots = [Path(root) for root in asset_roots]
        self.limits = limits
        self.problems: list[Problem] = []
        self.notes: list[Problem] = []
        self.dropped: set[tuple[str, ...]] = set()
        self.removed: dict[str, Value] = {}
        self.roots: dict[Source, Roots] = {}
        self._trees: dict[Path, Value | None] = {}
        self._names: dict[str, TypeNames | None] = {}

    @property
    def catalog(self) -> Catalog:
        return self.plugins.catalog

    def report(self, problem: Problem) -> None:
        self.problems.append(problem)
        if len(self.problems) >= MOST_PROBLEMS:
            raise InputError(self.problems)

    def roots_of(self, value: Value) -> Roots:
        """Return the roots of the file that contains a value."""
        return self.roots.get(value.source) or Roots.of_file(Path("x"), self.asset_roots)

    def own(self, document: Document, roots: Roots | None = None) -> None:
        """Register the roots of a file: its own surroundings if the user named it."""
        self.roots[document.source] = roots or Roots.of_file(document.path or Path("x"), self.asset_roots)
        self.dropped |= document.dropped
        self.bring(document.root)

    def bring(self, tree: Value) -> None:
        """Add the node types of a file's `plugins`, and record the nodes that it removes."""
        if (nodes := tree.get("nodes")) is not None:
            self.removed |= {name: node for name, node in nodes.items() if node.data is None}
        named = tree.get("plugins")
        for value in named.data if named is not None and isinstance(named.data, list) else ():
            self.plugins.add(value, self.beside(value), self.roots_of(value))

    def typed_roots(self, value: Value) -> Roots:
        """Return the roots for a `type`; a path typed on the command line may be anywhere."""
        return self.roots.get(value.source) or Roots.of_file(self.beside(value), self.asset_roots)

    def beside(self, value: Value) -> Path:
        return value.source.beside(str(value.data))

    def locate(self, value: Value, shipped: dict[str, Path], what: str) -> tuple[Path, Roots] | None:
        """Return the file that a value names and its roots; report a problem and return None otherwise."""
        text = str(value.data)
        if is_name(text):
            if text in shipped:
                return shipped[text], Roots((shipped[text].parent.resolve(),))
            hint = suggestion(text, shipped, most=20)  # there are more scenes than a suggestion lists by default
            if what == "scene" and text in shipped_pipelines():
                hint = "; it is a pipeline"
            elif next(self.beside(value).parent.glob(f"{text}.*"), None):
                hint = "; a file beside this one is named with its extension"
            self.report(value.problem("RG015", f"there is no shipped {what} '{text}'{hint}"))
            return None
        if problem := self.missing(value):
            self.report(problem)
            return None
        return self.beside(value), self.typed_roots(value)

    def chain(self, document: Document) -> Value:
        documents = self._with_bases(document)
        base = documents.pop().root
        tree = base.with_data({key: value for key, value in entries(base).items() if key != "extends"})
        for above in reversed(documents):
            written = {key: value for key, value in above.root.items() if key != "extends"}  # nulls stay: they remove
            tree = self.patched(tree, above.root.with_data(written))
        return tree

    def _with_bases(self, document: Document) -> list[Document]:
        """Parse a file and everything it extends, before anything is merged."""
        self.problems += document.problems
        documents, open_files = [document], [document.path.resolve() if document.path else Path()]
        while (base := documents[-1].root.get("extends")) is not None and base.data is not None:
            found = self.locate(base, shipped_pipelines(), "pipeline")
            if found is None:
                raise InputError(self.problems)
            path, roots = found
            open_files.append(path.resolve())
            if open_files[-1] in open_files[:-1]:
                names = " → ".join(file.name for file in open_files)
                raise InputError([*self.problems, base.problem("RG118", f"the file extends itself: {names}")])
            if len(documents) > _MOST_EXTENDED:
                text = f"the chain of files that extend each other is longer than {_MOST_EXTENDED}"
                raise InputError([*self.problems, base.problem("RG118", text)])
            documents.append(self._read(path, roots, base))
            self.problems += documents[-1].problems
        return documents

    def patched(self, tree: Value, patch: Value) -> Value:
        merged, notes = merge_pipeline(tree, patch, self.names_of)
        self.notes += notes
        return merged

    def _read(self, path: Path, roots: Roots, value: Value) -> Document:
        try:
            document = read(path, None, self.limits, keep_going=True)
        except InputError as error:
            problems = [p if p.place else value.relocate(p) for p in error.problems]
            raise InputError([*self.problems, *problems]) from None
        self.own(document, roots)
        return document

    def sub_pipeline(self, value: Value) -> Value | None:
        """Return the merged file that a `type` names; None for node types and missing files."""
        if isinstance(value.data, dict):
            self.bring(value)
            inline = Document(value, value.source)
            return value if word(value, "extends") is None else self.chain(checked(inline, keep_going=True))
        text = str(value.data)
        if text.endswith(SHADERS) or (is_name(text) and (text in self.catalog or text not in shipped_pipelines())):
            return None
        before = len(self.problems)
        found = self.locate(value, shipped_pipelines(), "pipeline")
        if found is None:
            del self.problems[before:]
            return None
        key = found[0].resolve()
        if key not in self._trees:
            self._trees[key] = None  # its own names are unknown while it is being read
            try:
                self._trees[key] = self.chain(self._read(*found, value))
            except InputError as error:
                self.problems = list(error.problems)
        return self._trees[key]

    def path_of(self, value: Value) -> Path | None:
        if not isinstance(value.data, str):
            return None
        text = value.data
        return (shipped_pipelines()[text] if is_name(text) else self.beside(value)).resolve()

    def names_of(self, value: Value) -> TypeNames | None:
        """Return the ports and parameters of a type; None if it does not exist."""
        sub = self.sub_pipeline(value)
        if sub is not None:
            inputs = entries(sub, "inputs")
            optional = frozenset(name for name, value in inputs.items() if flag(value, "optional"))
            outputs = frozenset(entries(sub, "outputs"))
            return TypeNames(frozenset(entries(sub, "parameters")), frozenset(inputs), {}, optional, outputs)
        text = self.type_name(value)
        if text not in self._names:
            self._names[text] = self._node_names(text)
        return self._names[text]

    def type_name(self, value: Value) -> str:
        """Return the catalog's name of a `type`; for a missing file, the text itself."""
        text = str(value.data)
        return self.plugins.shader(self.beside(value)) if text.endswith(SHADERS) and not self.missing(value) else text

    def _node_names(self, text: str) -> TypeNames | None:
        if text not in self.catalog:
            return None
        try:
            cls = self.catalog.get(text).cls
        except InputError:
            return None  # `link` reports its mistakes
        groups, inputs = cls.groups(), cls.inputs()
        optional = frozenset(name for name, port in inputs.items() if port.optional)
        return TypeNames(
            frozenset(cls.parameters()), frozenset({*inputs, *groups}), groups, optional, frozenset(cls.outputs())
        )

    def missing(self, value: Value) -> Problem | None:
        """Return the problem of a `type` that is a path, if any."""
        text = str(value.data)
        if is_name(text):
            return None
        mistake = self.typed_roots(value).mistake(self.beside(value), text)
        return value.problem(*mistake) if mistake else None


class Plugins:
    """The catalog of a pipeline, extended by the files that are read.

    Attributes:
        missing: packages that are required but not installed.
        unrun: types whose Python code is in a folder that only a pipeline file names, and the argument for `--plugin`.
        written: the entries of `plugins` in the resolved file, by text.
        home: folder of the resolved file, to which paths in it are relative; `roots` are its roots.
    """

    def __init__(self, catalog: Catalog, report: Callable[[Problem], None]) -> None:
        self.catalog = catalog
        self.missing: list[str] = []
        self.unrun: dict[str, str] = {}
        self.written: dict[str, Value] = {}
        self.notes: list[Problem] = list(catalog.notes)
        self.home = Path.cwd()
        self.roots = Roots(())
        self._report = report
        self._seen: set[Path] = set()
        self._reported: set[tuple[str, Place]] = set()

    def spelled(self, path: Path) -> str:
        inside = path.is_relative_to(self.home) or any(path.is_relative_to(root) for root in self.roots.folders)
        text = os.path.relpath(path, self.home) if inside else str(path)
        return text if text.startswith(("..", "/")) else f"./{text}"

    def shader(self, path: Path) -> str:
        file = path.resolve()
        name = self.spelled(file)
        if name not in self.catalog:
            self.catalog = self.catalog.with_file(name, file)
        return name

    def add(self, value: Value, folder: Path, roots: Roots) -> None:
        """Add one entry of `plugins`; `folder` is its path joined to the folder of its file."""
        text = str(value.data)
        if (text, value.place) in self._reported:
            return
        self._reported.add((text, value.place))
        if is_name(text):
            self._package(value, text)
            return
        mistake = roots.mistake(folder, text, folder=True)
        if mistake:
            self._report(value.problem(*mistake))
            return
        folder = folder.resolve()
        self.written.setdefault(self.spelled(folder), value)
        if folder not in self._seen:
            self._seen.add(folder)
            self._shaders(value, text, folder, roots)

    def _package(self, value: Value, name: str) -> None:
        if not re.match(_PACKAGE, name):  # users paste the message into a shell
            self._report(value.problem("RG131", f"'{shown(name)}' is neither a folder of plugins nor a package's name"))
            return
        self.written.setdefault(name, value)
        # A plugin in development is named by its folder and not installed.
        if version(name) is None and name not in self.missing and not self.catalog.has_plugin(name):
            self.missing.append(name)
            text = f"the pipeline needs the plugin '{name}', which is not installed: pip install {name}"
            self._report(value.problem("RG130", text))

    def _shaders(self, value: Value, text: str, folder: Path, roots: Roots) -> None:
        try:
            found, python = find.shaders(folder)
        except ValueError as error:
            self._report(value.problem("RG131", f"'{shown(text)}' is not a folder of plugins: {error}"))
            return
        outside = [one.file for _, one in found if roots.mistake(one.file)]
        for file in outside:
            code, reason = roots.mistake(file, str(file.relative_to(folder))) or ("RG012", "")
            self._report(value.problem(code, f"of plugin '{shown(text)}' {reason}"))
        self.catalog = self.catalog.with_shaders((name, one) for name, one in found if one.file not in outside)
        strange = [file for file in python if file not in self.catalog.files()]
        if strange:
            import shlex  # only for a warning

            names = ", ".join(sorted(file.name for file in strange)[:3]) + (", …" if len(strange) > 3 else "")
            words = f"'{shown(text)}' has Python ({names}), which is not run because a pipeline file names it; "
            named = shlex.quote(shown_file(folder))
            self.unrun |= dict.fromkeys((file.stem for file in strange), named)
            problem = value.problem("RG152", words + f"if you trust it, pass --plugin {named}")
            self.notes.append(problem.as_warning())
