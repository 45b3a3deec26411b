"""Modules of plugins by path: imported from their source, and anew when one of the folder's files has changed.

All modules of one folder are dropped together, helpers included, so that none holds on to an old class of another.
Installed packages are imported once, as everywhere.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import FileFinder, ModuleSpec, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType

from rendergraph.stamps import Stamp, modified, record_read, replay_reads, track_reads

PREFIX = "rendergraph_plugin_"
"""What the packages of folders are called, before a number that tells them apart."""

_READ: dict[str, dict[str, Stamp]] = {}
"""Package to the files that its modules in `sys.modules` were made from."""


class _Loader(SourceFileLoader):
    """Compiles the source each time: compiled files are told apart by whole seconds, edits may be quicker."""

    def get_code(self, fullname: str) -> CodeType:
        """The module's code; its file is noted."""
        with track_reads() as files:
            record_read(Path(self.path))
        _READ.setdefault(fullname.partition(".")[0], {}).update(files)
        return self.source_to_code(self.get_data(self.path), self.path)


class _Finder:
    """Finds the modules of the packages that `fresh_package` made, in the folder as it is now."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Where a module is."""
        if path is None or not fullname.startswith(PREFIX):
            return None
        specs = (FileFinder(folder, (_Loader, [".py"])).find_spec(fullname) for folder in path)
        return next((spec for spec in specs if spec is not None), None)


_FINDER = _Finder()


def fresh_package(name: str, folder: Path) -> None:
    """Make a folder importable as the package `name`; what has been imported from it is dropped if it has changed."""
    if _FINDER not in sys.meta_path:
        sys.meta_path.insert(0, _FINDER)
    if name in sys.modules and modified(_READ.get(name, {})):
        for module in [module for module in sys.modules if module == name or module.startswith(f"{name}.")]:
            del sys.modules[module]
        del _READ[name]
    if name not in sys.modules:
        package = ModuleType(name)
        package.__path__ = [str(folder)]
        sys.modules[name] = package
    replay_reads(_READ.get(name, {}))
