"""Running the command line inside the test's own process."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import rendergraph
from rendergraph.cli.app import main


@dataclass(frozen=True)
class Result:
    """What a command line did."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


Cli = Callable[..., Result]


@pytest.fixture
def cli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Cli:
    """`cli("run", "forward")`, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("RENDERGRAPH_TRACEBACK", raising=False)

    def call(*words: str) -> Result:
        capsys.readouterr()
        code = main(list(words))
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        return Result(code, out, err)

    return call


class FakePipeline:
    """Answers what `run` asks, without files or GL; `calls` holds what `render` was told."""

    warnings: tuple[Any, ...] = ()

    def __init__(self, outputs: tuple[str, ...] = ("image", "radiance")) -> None:
        self.graph = SimpleNamespace(outputs=dict.fromkeys(outputs))
        self.calls: dict[str, Any] = {}
        self.fail: BaseException | None = None

    def wanted(self, outputs: list[str], taps: list[str]) -> dict[str, Any]:
        return {}

    def render(self, *, frames: range, outputs: list[str], taps: list[str], on_frame: Any, **rest: Any) -> Any:
        self.calls = {"frames": frames, "outputs": outputs, "taps": taps, **rest}
        for number in frames:
            if self.fail and number == 2:
                raise self.fail
            on_frame(FakeFrame(number))
        return FakeFrame(frames[-1])


class FakeFrame:
    """A small grey picture, as bright as its number."""

    def __init__(self, number: int) -> None:
        self.metadata = {"pipeline": "nodes: {}\n"}
        self.number = number
        self.warnings: tuple[Any, ...] = ()

    def __getitem__(self, name: str) -> Any:
        return np.full((4, 6, 4), self.number / 10, np.float32)

    def info(self, name: str) -> Any:
        if name == "image":
            return SimpleNamespace(semantic="display_color", format="rgba8", encoding="display")
        return SimpleNamespace(semantic="radiance", format="rgba16f", encoding="linear")

    def as_json(self) -> dict[str, Any]:
        return {
            "pipeline": "fake",
            "device": {"renderer": "none", "software": True},
            "size": [6, 4],
            "passes": [],
            "frame_ms": {"median": 1.0, "min": 1.0, "max": 1.0},
            "memory": {},
            "culled": {"idle": "nobody reads it"},
        }


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakePipeline:
    """What `rg.load` returns in this test."""
    pipeline = FakePipeline()
    monkeypatch.setattr(rendergraph, "load", lambda source, **options: pipeline, raising=False)
    return pipeline
