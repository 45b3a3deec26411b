"""Fixtures for every test."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from rendergraph import Session
    from rendergraph.catalog import Catalog


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


@pytest.fixture(scope="session")
def toy_catalog() -> Catalog:
    """The node types of `toys.py`."""
    spec = importlib.util.spec_from_file_location("toys", Path(__file__).parent / "toys.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["toys"] = module
    spec.loader.exec_module(module)
    catalog: Catalog = module.CATALOG
    return catalog
