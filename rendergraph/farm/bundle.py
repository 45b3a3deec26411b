"""The input files of pipelines, for workers that share no disk with the client.

A file is identified by its content, and each worker gets it once. A worker keeps the files below a folder, where they
have the same paths as below `/` on the client, so that relative paths and the rules about roots still hold.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from rendergraph.catalog.find import OWN, VARIABLE, configured
from rendergraph.errors import InputError, Problem, RendergraphError
from rendergraph.installed import version
from rendergraph.resources import folder

if TYPE_CHECKING:
    from rendergraph.session.selection import Selection

SHIPPED = ("rendergraph", "rendergraph.nodes", "rendergraph.shaders", "rendergraph.pipelines")
MOST_FILES = 20_000
MOST_BYTES = 16 << 30
_SKIPPED_FOLDERS = frozenset({"__pycache__", ".git", ".hg", ".venv", "node_modules"})


@dataclass(frozen=True)
class Bundle:
    """The files that workers need, by path with the SHA-256 of the content, and the client's folder and packages."""

    files: Mapping[str, str]
    folders: tuple[str, ...]
    home: str
    path: str
    packages: Mapping[str, tuple[str, str]] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        content = repr((sorted(self.files.items()), self.folders, self.home, self.path))
        return hashlib.sha256(content.encode()).hexdigest()

    def write(self, root: Path, stored: Path) -> None:
        """Put all files beneath a folder; `stored` holds contents by SHA-256."""
        for name in (*self.folders, self.home):
            (root / Path(name).relative_to("/")).mkdir(parents=True, exist_ok=True)
        for name, digest in self.files.items():
            path = root / Path(name).relative_to("/")
            path.parent.mkdir(parents=True, exist_ok=True)
            if not path.exists():
                os.link(stored / digest, path)

    def environment(self, root: Path) -> dict[str, str]:
        paths = [part.strip() for part in self.path.split(os.pathsep) if part.strip()]
        return {VARIABLE: os.pathsep.join(str(_relocate(Path(path), root)) for path in paths)}


def make_bundle(read: Iterable[str], plugins: Sequence[Path], modules: Iterable[str] = ()) -> Bundle:
    """Collect the files that the work needs.

    `read` has the files and folders that planning looked for, whether they exist or not, and `modules` those of the
    node classes in use. Installed packages must also be installed on the workers.
    """
    shipped = [folder(name).resolve() for name in SHIPPED]
    paths = [path for path in map(Path, read) if not any(path.resolve().is_relative_to(root) for root in shipped)]
    found = {path for path in paths if path.is_file()}
    for plugin in (*plugins, *(entry.path for entry in configured())):
        found |= set(_files_of(Path(os.path.abspath(plugin))))
    if len(found) > MOST_FILES or sum(path.stat().st_size for path in found) > MOST_BYTES:
        limits = f"{MOST_FILES} files or {MOST_BYTES >> 30} GiB"
        text = f"the work needs {len(found)} files, more than {limits}; share a disk instead"
        raise InputError(Problem("RG642", text))
    packages = (OWN, *sorted(_distributions(modules) - {OWN}))
    return Bundle(
        {str(path): file_sha256(path) for path in sorted(found)},
        tuple(sorted({str(path) for path in paths if path.is_dir()})),
        os.getcwd(),
        os.environ.get(VARIABLE, ""),
        {name: (version(name) or "", digest_of(name)) for name in packages},
    )


def _files_of(path: Path) -> Iterable[Path]:
    if path.is_file():
        yield path
    for root, subfolders, names in os.walk(path):
        subfolders[:] = [name for name in subfolders if name not in _SKIPPED_FOLDERS]
        yield from (Path(root) / name for name in names if (Path(root) / name).is_file())


def file_sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _distributions(modules: Iterable[str]) -> set[str]:
    packages = {module.partition(".")[0] for module in modules} - {OWN}
    distributions = metadata.packages_distributions() if packages else {}
    return {name for package in packages for name in distributions.get(package, ())}


def digest_of(name: str) -> str:
    """Return the SHA-256 of a distribution's source files; two builds of one version may differ."""
    digest = hashlib.sha256()
    for path in sorted(_sources(name)):
        digest.update(path.name.encode() + bytes.fromhex(file_sha256(path)))
    return digest.hexdigest()


def _sources(name: str) -> Iterable[Path]:
    if name == OWN:
        yield from (path for package in SHIPPED for path in _files_of(folder(package)) if path.suffix != ".pyc")
        return
    for file in metadata.distribution(name).files or ():
        path = Path(str(file.locate()))
        if file.suffix != ".pyc" and ".dist-info" not in str(file) and path.is_file():
            yield path


def check_packages(needed: Mapping[str, tuple[str, str]], worker: str) -> InputError | None:
    """Return why this worker process would render differently from the client; None if it would not."""
    problems = []
    for name, (client, digest) in needed.items():
        own, what = version(name), "rendergraph" if name == OWN else f"the plugin '{name}'"
        if own is None:
            text = f"worker '{worker}' lacks {what}; install it there: pip install {name}=={client}"
        elif own != client:
            text = f"worker '{worker}' has {what} {own}, but this client has {client}; install the same on both"
        elif digest_of(name) != digest:
            text = f"worker '{worker}' has other files in {what} {client} than this client; install the same on both"
        else:
            continue
        problems.append(Problem("RG642", text))
    return InputError(problems) if problems else None


def relocate_selection(selection: Selection, root: Path | None) -> Selection:
    if root is None:
        return selection
    names = ("source", "scene", "environment", "patches", "asset_roots", "plugins")
    return replace(selection, **{name: _relocated(getattr(selection, name), root) for name in names})


def _relocate(path: Path, root: Path) -> Path:
    return root / path.relative_to(path.anchor) if path.is_absolute() else path


def _relocated(value: Any, root: Path) -> Any:
    """Return a Python value with each absolute path in it, such as that of an array, moved below a worker's folder."""
    if isinstance(value, Mapping):
        return {key: _relocated(child, root) for key, child in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(_relocated(child, root) for child in value)
    if isinstance(value, Path):
        return _relocate(value, root)
    is_path = isinstance(value, str) and value.startswith("/") and "\n" not in value
    return str(_relocate(Path(value), root)) if is_path else value


def map_remote_paths(error: RendergraphError, root: Path | None) -> RendergraphError:
    """Return the error with the client's file names instead of those below a worker's folder."""
    if root is None:
        return error

    def mapped(problem: Problem) -> Problem:
        place = problem.place
        if place is None or not Path(place.file).is_relative_to(root):
            return problem
        home = replace(place, origin=f"/{Path(place.file).relative_to(root)}")
        return problem.relocate(home, problem.line_text)

    return error.relocated(mapped)
