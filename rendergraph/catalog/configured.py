"""Plugins that need not be named again: those of the project where the user stands, and of the environment."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from msgspec import Struct

from rendergraph.errors import Place, shown_file
from rendergraph.installed import plain
from rendergraph.settings import at_home, nearest
from rendergraph.stamps import record_read

OWN = "rendergraph"
"""The distribution that nobody stands in for."""
VARIABLE = "RENDERGRAPH_PATH"
"""Folders and files with nodes, separated as in PATH."""


class Named(Struct, frozen=True):
    """A plugin by path.

    Attributes:
        path: the file or folder.
        place: the settings file that names it.
        where: the same in words, where no file does.
    """

    path: Path
    place: Place | None = None
    where: str = ""

    @property
    def words(self) -> str:
        """Who names it, behind its file."""
        return self.where or (f", which {self.place.file} names" if self.place is not None else ", given as a plugin")


def configured() -> Iterator[Named]:
    """What the settings of the project around the current folder name, then what the environment names.

    Raises:
        InputError: the settings file is malformed.
    """
    project = nearest(Path.cwd())
    for path in project.plugins if project is not None else ():
        yield Named(path, Place(shown_file(project.file)) if project is not None else None)
    for text in os.environ.get(VARIABLE, "").split(os.pathsep):
        if text.strip():
            yield Named(at_home(text.strip()), where=f", which {VARIABLE} names")


def projects(folders: Iterable[Path]) -> frozenset[str]:
    """The distributions that folders are the projects of, spelled as indexes compare them (PEP 503).

    Who names a project's folder means that, and not a copy of it that was installed some time ago.
    """
    names = {_project(folder) for folder in folders} - {"", OWN}
    return frozenset(names)


def _project(folder: Path) -> str:
    """The name that the `pyproject.toml` of a folder gives; nothing where there is none to read."""
    file = folder / "pyproject.toml"
    record_read(file)
    if not file.is_file():
        return ""
    import tomllib  # most folders lie in no project

    try:
        name = tomllib.loads(file.read_text(encoding="utf-8"))["project"]["name"]
    except (OSError, ValueError, KeyError, TypeError):
        return ""
    return plain(name) if isinstance(name, str) else ""
