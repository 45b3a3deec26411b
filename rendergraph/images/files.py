"""Atomic writing of files."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from rendergraph.errors import Place, Problem, RenderError

_PICTURES = (".png", ".jpg", ".jpeg", ".exr", ".hdr")


def failed(path: Path, reason: str) -> RenderError:
    """Return the error for a file that could not be written."""
    what = "picture" if path.suffix.lower() in _PICTURES else "file"
    return RenderError(Problem("RG507", f"the {what} cannot be written: {reason}", Place(str(path))))


@contextlib.contextmanager
def staged(paths: Sequence[Path]) -> Iterator[list[Path]]:
    """Yield a temporary path beside each path, to be written; they replace the paths together if the block succeeds.

    Symbolic links are followed, so that they stay links. Each temporary file is flushed to disk before the rename, and
    its folder afterwards; if the block ends early, even by an interrupt, nothing is left behind.
    """
    targets = [Path(os.path.realpath(path)) for path in paths]
    temporary = [target.with_name(f".{target.name[:100]}.{os.urandom(4).hex()}.part") for target in targets]
    try:
        yield temporary
        for part in temporary:
            flush(part)
        for part, target in zip(temporary, targets, strict=True):
            os.replace(part, target)
        for folder in {target.parent for target in targets}:
            flush(folder)
    except OSError as error:
        path = dict(zip(map(str, temporary), paths, strict=True)).get(str(error.filename), paths[0])
        raise failed(path, error.strerror or str(error)) from error
    finally:
        for part in temporary:
            with contextlib.suppress(OSError):
                part.unlink()


def write_file(path: Path, content: str | bytes) -> None:
    data = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
    with staged([path]) as (part,):
        part.write_bytes(data)


def replace_text(path: Path, text: str) -> None:
    """Replace a text file atomically, keeping its mode and byte order mark, which is not part of the text."""
    mark = b"\xef\xbb\xbf" if path.read_bytes().startswith(b"\xef\xbb\xbf") else b""
    with staged([path]) as (part,):
        part.write_bytes(mark + text.encode("utf-8"))
        shutil.copymode(path, part)


def flush(path: Path) -> None:
    """Flush a file, or the names in a folder, to disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
