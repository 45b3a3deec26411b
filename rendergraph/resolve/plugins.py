"""Node types that pipeline files provide: shader files by path, folders of them, and required packages.

A pipeline file is data, so nothing is imported here: it can provide only shader files, and only from inside the roots.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

from rendergraph.catalog import SHADERS, Catalog, find
from rendergraph.document import Value, shown
from rendergraph.errors import Place, Problem, shown_file
from rendergraph.installed import version
from rendergraph.resources import is_name
from rendergraph.settings import Roots

_PACKAGE = r"[A-Za-z0-9](?:[A-Za-z0-9_-]{0,98}[A-Za-z0-9])?\Z"


class Plugins:
    """The catalog of a pipeline, extended by the files that are read.

    Attributes:
        missing: packages that are required but not installed.
        unrun: types whose Python code is in a folder that only a pipeline file names, and the argument for `--plugin`.
        written: the entries of `plugins` in the resolved file, by text.
    """

    def __init__(self, catalog: Catalog, report: Callable[[Problem], None]) -> None:
        self.catalog = catalog
        self.missing: list[str] = []
        self.unrun: dict[str, str] = {}
        self.written: dict[str, Value] = {}
        self.notes: list[Problem] = list(catalog.notes)
        self._report = report
        self._home = Path.cwd()
        self._roots = Roots(())
        self._seen: set[Path] = set()
        self._reported: set[tuple[str, Place]] = set()

    def start(self, home: Path, roots: Roots) -> None:
        """Set the folder of the resolved file: paths in it are relative to that."""
        self._home = home.resolve()
        self._roots = roots

    def spelled(self, path: Path) -> str:
        inside = path.is_relative_to(self._home) or any(path.is_relative_to(root) for root in self._roots.folders)
        text = os.path.relpath(path, self._home) if inside else str(path)
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


def is_shader(text: object) -> bool:
    return isinstance(text, str) and text.endswith(SHADERS)
