"""Arrays cached on disk by content: ground truth, which takes minutes to render, and generated textures."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from rendergraph.errors import RenderError
from rendergraph.images.files import write_file


class DiskCache:
    """A folder of arrays, in `RENDERGRAPH_CACHE` or in the user's folder for caches.

    Above `most_bytes` the least recently used files are deleted. If the disk is full or read-only, nothing is cached.
    """

    def __init__(self, name: str, most_bytes: int) -> None:
        self.name, self.most_bytes = name, most_bytes

    def _file(self, key: str) -> Path:
        user = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()
        base = Path(os.environ.get("RENDERGRAPH_CACHE") or user / "rendergraph")
        return base / self.name / f"{hashlib.sha256(key.encode()).hexdigest()}.npz"

    def get(self, key: str) -> dict[str, npt.NDArray[Any]] | None:
        """Return the arrays of a key; None if there are none or they cannot be read."""
        file = self._file(key)
        try:
            os.utime(file)
            with np.load(io.BytesIO(file.read_bytes()), allow_pickle=False) as stored:
                return dict(stored)
        except (OSError, ValueError, KeyError, EOFError, BadZipFile):
            return None

    def put(self, key: str, arrays: Mapping[str, Any]) -> None:
        data, file = io.BytesIO(), self._file(key)
        np.savez(data, **arrays)
        with contextlib.suppress(OSError, RenderError):
            file.parent.mkdir(parents=True, exist_ok=True)
            write_file(file, data.getvalue())
            total = 0
            for each in sorted(file.parent.glob("*.npz"), key=lambda path: path.stat().st_mtime, reverse=True):
                total += each.stat().st_size
                if total > self.most_bytes:
                    each.unlink()
