"""The generated part of the documentation: everything that a declaration already says is written from it, once.

`generate` fills a folder that git ignores; `conf.py` calls it before every build, and the tests call it without
pictures.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

from . import api, cli, errors, files, includes, nodes, pipelines, types
from .pictures import Studio

ROOT = Path(__file__).parents[2]
SOURCES = ("rendergraph", "nodes", "shaders", "pipelines", "docs/_generate")
STAMP = ".sources"
"""File in the generated folder: the digest of what its pages were generated from."""


def generate(folder: Path, *, pictures: bool = True) -> None:
    """Write every generated page.

    Args:
        folder: where to; files there that are no longer generated are removed.
        pictures: render examples too, where this machine can.
    """
    digest = _digest_of_sources()
    if not pictures and is_fresh(folder):
        return
    with Studio(folder if pictures else None) as studio:
        pages = dict(_pages(studio))
    for name, text in pages.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:  # an unchanged page is not built again
            path.write_text(text, encoding="utf-8")
    (folder / STAMP).write_text(digest, encoding="utf-8")
    kept = {folder / name for name in pages} | studio.written | {folder / STAMP}
    for path in folder.rglob("*"):
        if path.is_file() and path not in kept:
            path.unlink()


def is_fresh(folder: Path) -> bool:
    """Whether no source has changed since the pages of a folder were generated."""
    stamp = folder / STAMP
    return stamp.is_file() and stamp.read_text(encoding="utf-8") == _digest_of_sources()


def _digest_of_sources() -> str:
    digest = hashlib.sha256()
    for source in SOURCES:
        for path in sorted((ROOT / source).rglob("*")):
            if path.is_file() and path.suffix not in (".pyc", ".md"):
                digest.update(f"{path} {path.stat().st_mtime_ns} {path.stat().st_size}\n".encode())
    return digest.hexdigest()


def _pages(studio: Studio) -> Iterator[tuple[str, str]]:
    yield from nodes.pages(studio)
    yield from pipelines.pages(studio)
    yield from errors.pages()
    yield from cli.pages()
    yield from files.pages()
    yield from types.pages()
    yield from includes.pages()
    yield from api.pages()
