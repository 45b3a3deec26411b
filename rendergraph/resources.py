"""Read the text files in the package: pipelines, scenes, shaders, error pages."""

from __future__ import annotations

import re
from functools import cache, lru_cache
from importlib import import_module
from itertools import takewhile
from pathlib import Path

_NAME = re.compile(r"[A-Za-z0-9_-]+\Z")


def is_name(text: str) -> bool:
    """Return whether a text names something shipped or installed, rather than a path."""
    return bool(_NAME.match(text))


@cache
def folder(package: str) -> Path:
    return Path(import_module(package).__path__[0])


def opening(path: Path) -> str:
    """Return the comment at the beginning of a shipped file, in one line."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return " ".join(line.lstrip("# ").strip() for line in takewhile(lambda line: line.startswith("#"), lines))


def shipped_pipelines() -> dict[str, Path]:
    return _by_name(folder("rendergraph.pipelines"))


def shipped_scenes() -> dict[str, Path]:
    return _by_name(folder("rendergraph.pipelines") / "scenes")


def _by_name(home: Path) -> dict[str, Path]:
    return dict(_listed(home, home.stat().st_mtime_ns))


@lru_cache
def _listed(home: Path, changed: int) -> dict[str, Path]:
    """List a folder; `changed` is its time stamp, which changes when files are added or removed."""
    return {path.stem: path for path in sorted(home.glob("*.yaml"), key=lambda path: path.stem)}
