"""Tasks that other processes can import."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def chore(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """`chores.Chore`, from a module that processes started meanwhile find."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    made: Callable[..., Any] = importlib.import_module("chores").Chore
    return made
