"""The generated part of the documentation: everything that a declaration already says is written from it, once.

`generate` fills a folder that git ignores; `conf.py` calls it before every build, and the tests call it without
pictures.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from . import api, cli, errors, files, nodes, pipelines, types
from .pictures import Studio


def generate(folder: Path, *, pictures: bool = True) -> None:
    """Write every generated page.

    Args:
        folder: where to; files there that are no longer generated are removed.
        pictures: render examples too, where this machine can.
    """
    with Studio(folder if pictures else None) as studio:
        pages = dict(_pages(studio))
    for name, text in pages.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:  # an unchanged page is not built again
            path.write_text(text, encoding="utf-8")
    kept = {folder / name for name in pages} | studio.written
    for path in folder.rglob("*"):
        if path.is_file() and path not in kept:
            path.unlink()


def _pages(studio: Studio) -> Iterator[tuple[str, str]]:
    yield from nodes.pages(studio)
    yield from pipelines.pages(studio)
    yield from errors.pages()
    yield from cli.pages()
    yield from files.pages()
    yield from types.pages()
    yield from api.pages()
