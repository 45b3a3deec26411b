"""Fixtures for every test."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from rendergraph import Session


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference data and assets beside the project; tests that need it skip where it is missing."""
    folder = Path(os.environ.get("RENDERGRAPH_SHARED", Path(__file__).parents[2] / "shared"))
    if not (folder / "reference").is_dir():
        pytest.skip("no shared reference data beside the project")
    return folder


@pytest.fixture(scope="session")
def gl() -> Iterator[Session]:
    """One GL session for all tests."""
    import rendergraph as rg

    with rg.Session() as session:
        yield session
