"""Plugins that need not be named again: those of the project where the user stands, and of the environment."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rendergraph.errors import Place, shown_file
from rendergraph.settings import at_home, nearest

VARIABLE = "RENDERGRAPH_PATH"
"""Folders and files with nodes, separated as in PATH."""


@dataclass(frozen=True)
class Named:
    """A plugin by path.

    Attributes:
        path: the file or folder.
        place: the settings file that names it.
        where: the same in words, where no file does.
    """

    path: Path
    place: Place | None = None
    where: str = ""


def surroundings() -> Iterator[Named]:
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
