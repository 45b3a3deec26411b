"""Reading the text that travels with the package: pipelines, scenes, shaders, error pages."""

from __future__ import annotations

from functools import cache
from importlib import resources
from pathlib import Path


@cache
def folder(package: str) -> Path:
    """The folder a package's files lie in.

    Raises:
        ModuleNotFoundError: there is no such package.
    """
    return Path(str(resources.files(package)))


def shipped_pipelines() -> dict[str, Path]:
    """Name to file of every shipped pipeline."""
    return {path.stem: path for path in sorted(folder("rendergraph.pipelines").glob("*.yaml"))}


def shipped_scenes() -> dict[str, Path]:
    """Name to file of every shipped scene."""
    return {path.stem: path for path in sorted((folder("rendergraph.pipelines") / "scenes").glob("*.yaml"))}
