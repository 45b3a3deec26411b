"""The files that pipelines are drawn from, so that they can be laid out elsewhere as they lie here.

A file is known by its content, and each worker gets it once. They are laid out beneath a folder as they lie beneath `/`
here, the current folder included, so that paths lead where they lead here and the same rules about roots hold.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from rendergraph.catalog.configured import OWN, VARIABLE, configured
from rendergraph.errors import InputError, Place, Problem, RendergraphError
from rendergraph.installed import version
from rendergraph.resources import folder

if TYPE_CHECKING:
    from rendergraph.session.selection import Selection

SHIPPED = ("rendergraph", "rendergraph.nodes", "rendergraph.shaders", "rendergraph.pipelines")
_LEFT_OUT = frozenset({"__pycache__", ".git", ".hg", ".venv", "node_modules"})
MOST_FILES = 20_000
MOST_BYTES = 16 << 30


@dataclass(frozen=True)
class Bundle:
    """What travels.

    Attributes:
        files: path here to SHA-256 of the content.
        folders: those that have to be there, empty or not.
        home: the current folder.
        path: what `RENDERGRAPH_PATH` says.
        packages: installed distributions that are needed, with their versions and the SHA-256 of their files.
    """

    files: Mapping[str, str]
    folders: tuple[str, ...]
    home: str
    path: str
    packages: Mapping[str, tuple[str, str]] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        """Of all that lies where."""
        told = repr((sorted(self.files.items()), self.folders, self.home, self.path))
        return hashlib.sha256(told.encode()).hexdigest()

    def lay_out(self, root: Path, stored: Path) -> None:
        """Put everything beneath a folder; `stored` holds contents by SHA-256."""
        for name in (*self.folders, self.home):
            (root / Path(name).relative_to("/")).mkdir(parents=True, exist_ok=True)
        for name, digest in self.files.items():
            place = root / Path(name).relative_to("/")
            place.parent.mkdir(parents=True, exist_ok=True)
            if not place.exists():
                os.link(stored / digest, place)

    def environment(self, root: Path) -> dict[str, str]:
        """Variables that name files, as they lie beneath a folder."""
        parts = [part.strip() for part in self.path.split(os.pathsep) if part.strip()]
        return {VARIABLE: os.pathsep.join(str(_moved(Path(part), root)) for part in parts)}


def make_bundle(looked_at: Iterable[str], plugins: Sequence[Path], modules: Iterable[str] = ()) -> Bundle:
    """The bundle of work.

    Args:
        looked_at: files and folders that were looked at when the work was planned, those that are not there included.
        plugins: files and folders with nodes that were named.
        modules: what the node classes in use are called; those of installed packages have to be there, too.

    Raises:
        InputError: these are more files, or larger ones, than anybody means to send.
    """
    shipped = [folder(name).resolve() for name in SHIPPED]
    found: set[Path] = set()
    folders: set[str] = set()
    for path in map(Path, looked_at):
        if any(path.resolve().is_relative_to(own) for own in shipped):
            continue
        if path.is_dir():
            folders.add(str(path))
        elif path.is_file():
            found.add(path)
    for plugin in (*plugins, *(entry.path for entry in configured())):
        found |= set(_within(Path(os.path.abspath(plugin))))
    if len(found) > MOST_FILES or sum(path.stat().st_size for path in found) > MOST_BYTES:
        text = (
            f"the work needs {len(found)} files, more than {MOST_FILES} or {MOST_BYTES >> 30} GiB; share a disk instead"
        )
        raise InputError(Problem("RG642", text))
    files = {str(path): file_sha256(path) for path in sorted(found)}
    needed = _distributions(modules)
    return Bundle(
        files,
        tuple(sorted(folders)),
        os.getcwd(),
        os.environ.get(VARIABLE, ""),
        {name: (version(name) or "", digest_of(name)) for name in (OWN, *sorted(needed - {OWN}))},
    )


def _within(path: Path) -> Iterable[Path]:
    """The files of a plugin."""
    if path.is_file():
        yield path
    for where, subfolders, names in os.walk(path):
        subfolders[:] = [name for name in subfolders if name not in _LEFT_OUT]
        yield from (Path(where) / name for name in names if (Path(where) / name).is_file())


def file_sha256(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _distributions(modules: Iterable[str]) -> set[str]:
    """The installed distributions that modules belong to."""
    packages = {module.partition(".")[0] for module in modules} - {OWN}
    if not packages:
        return set()
    known = metadata.packages_distributions()
    return {name for package in packages for name in known.get(package, ())}


def digest_of(name: str) -> str:
    """SHA-256 of a distribution's source files, so that two of one version that differ are told apart."""
    found = hashlib.sha256()
    for path in sorted(_sources(name)):
        found.update(path.name.encode())
        found.update(bytes.fromhex(file_sha256(path)))
    return found.hexdigest()


def _sources(name: str) -> Iterable[Path]:
    if name == OWN:
        yield from (path for own in SHIPPED for path in _within(folder(own)) if path.suffix != ".pyc")
        return
    for file in metadata.distribution(name).files or ():
        path = Path(str(file.locate()))
        if file.suffix != ".pyc" and ".dist-info" not in str(file) and path.is_file():
            yield path


def unfit(needed: Mapping[str, tuple[str, str]], worker: str) -> InputError | None:
    """Why a worker, which this process is, would draw something else than whoever sent the work; None where not.

    Args:
        needed: `Bundle.packages`.
        worker: what it is called.
    """
    problems = []
    for name, (there, digest) in needed.items():
        here, what = version(name), "rendergraph" if name == OWN else f"the plugin '{name}'"
        if here is None:
            text = f"worker '{worker}' lacks {what}; install it there: pip install {name}=={there}"
        elif here != there:
            text = f"worker '{worker}' has {what} {here}, and here is {there}; install the same on both"
        elif digest_of(name) != digest:
            text = f"worker '{worker}' has other files in {what} {there} than there are here; install the same on both"
        else:
            continue
        problems.append(Problem("RG642", text))
    return InputError(problems) if problems else None


def relocate_selection(selection: Selection, root: Path | None) -> Selection:
    """A selection whose files lie beneath a folder as they lie beneath `/` where it was made."""
    if root is None:
        return selection
    return replace(
        selection,
        source=str(_moved(Path(selection.source), root)),
        scene=None if selection.scene is None else str(_moved(Path(selection.scene), root)),
        environment=None if selection.environment is None else _moved(selection.environment, root),
        patches=tuple(_moved(each, root) if isinstance(each, Path) else each for each in selection.patches),
        asset_roots=tuple(_moved(each, root) for each in selection.asset_roots),
        plugins=tuple(_moved(each, root) for each in selection.plugins),
    )


def _moved(path: Path, root: Path) -> Path:
    return root / path.relative_to(path.anchor) if path.is_absolute() else path


def map_remote_paths(error: RendergraphError, root: Path | None) -> RendergraphError:
    """An error whose files are called as where they came from."""
    if root is None:
        return error

    def homed(problem: Problem) -> Problem:
        place = problem.place
        if place is None or not Path(place.file).is_relative_to(root):
            return problem
        home = Place(f"/{Path(place.file).relative_to(root)}", place.line, place.column)
        return problem.relocate(home, problem.line_text)

    return error.relocated(homed)
