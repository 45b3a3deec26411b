"""The cache on the disk: what it gives back, what it forgets, and disks that refuse."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from rendergraph.images.cache import DiskCache

ARRAYS = {"a": np.arange(6, dtype=np.float32).reshape(2, 3), "b": np.array(7)}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RENDERGRAPH_CACHE", str(tmp_path))
    return tmp_path / "things"


def test_what_was_put_comes_back_under_its_own_key(folder: Path) -> None:
    cache = DiskCache("things", 1 << 20)
    cache.put("one", ARRAYS)
    found = DiskCache("things", 1 << 20).get("one")
    assert found is not None
    assert found.keys() == ARRAYS.keys()
    assert all(np.array_equal(found[name], ARRAYS[name]) for name in ARRAYS)
    assert cache.get("two") is None
    assert DiskCache("other", 1 << 20).get("one") is None


def test_the_least_recently_used_go_first(folder: Path) -> None:
    cache = DiskCache("things", 1 << 20)
    for age, key in enumerate(("old", "older", "new")):
        cache.put(key, ARRAYS)
        newest = max(folder.iterdir(), key=lambda path: path.stat().st_ctime_ns)
        os.utime(newest, (1000 - 100 * age, 1000 - 100 * age))
    assert cache.get("older") is not None  # used now
    size = next(folder.iterdir()).stat().st_size
    DiskCache("things", 2 * size).put("newest", ARRAYS)
    assert [key for key in ("old", "older", "new", "newest") if cache.get(key) is not None] == ["older", "newest"]


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 half a file", b"text"])
def test_a_damaged_file_is_made_again(folder: Path, damage: bytes) -> None:
    cache = DiskCache("things", 1 << 20)
    cache.put("one", ARRAYS)
    next(folder.iterdir()).write_bytes(damage)
    assert cache.get("one") is None


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("RENDERGRAPH_CACHE", str(tmp_path / "file"))
    cache = DiskCache("things", 1 << 20)
    cache.put("one", ARRAYS)
    assert cache.get("one") is None
