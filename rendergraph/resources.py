"""Reading the text that travels with the package: pipelines, scenes, shaders, error pages."""

from __future__ import annotations

from functools import cache, lru_cache
from importlib import import_module
from itertools import takewhile
from pathlib import Path


@cache
def folder(package: str) -> Path:
    """The folder a package's files lie in.

    Raises:
        ModuleNotFoundError: there is no such package.
    """
    return Path(import_module(package).__path__[0])


def opening(path: Path) -> str:
    """The comment that a shipped file begins with, in one line: what it shows."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return " ".join(line.lstrip("# ").strip() for line in takewhile(lambda line: line.startswith("#"), lines))


def shipped_pipelines() -> dict[str, Path]:
    """Name to file of every shipped pipeline."""
    return _by_name(folder("rendergraph.pipelines"))


def shipped_scenes() -> dict[str, Path]:
    """Name to file of every shipped scene."""
    return _by_name(folder("rendergraph.pipelines") / "scenes")


def _by_name(home: Path) -> dict[str, Path]:
    return dict(_listed(home, home.stat().st_mtime_ns))


@lru_cache
def _listed(home: Path, changed: int) -> dict[str, Path]:
    """The files of a folder, which is `changed` when one comes or goes."""
    return {path.stem: path for path in sorted(home.glob("*.yaml"), key=lambda path: path.stem)}
