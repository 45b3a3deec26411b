"""Running the command line inside the test's own process."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from msgspec.structs import asdict

from rendergraph.cli.app import main
from rendergraph.scene.model import Orbit, Scene
from rendergraph.session import RenderOptions, Selection


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
def cli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], lent_gpu: None) -> Cli:
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


class FakeStages:
    """Answers what `run` asks, without files or GL; `calls` holds what was drawn, and with which device."""

    def __init__(self, outputs: tuple[str, ...] = ("image", "radiance")) -> None:
        self.graph = SimpleNamespace(outputs=dict.fromkeys(outputs))
        self.calls: dict[str, Any] = {}
        self.figures: tuple[str, ...] = ()
        self.fail: BaseException | None = None
        self.device: int | None = None

    def resolve(self, selection: Selection) -> Any:
        return SimpleNamespace(selection=selection)

    def link(self, resolved: Any) -> Any:
        return SimpleNamespace(
            selection=resolved.selection,
            graph=self.graph,
            warnings=(),
            frames=range(1, 2),
            fps=30.0,
            subframes=1,
            scene=Scene("moving", orbit=Orbit("", 30)),
        )

    def expand(self, linked: Any, options: RenderOptions) -> Any:
        return SimpleNamespace(linked=linked, options=options, requests={})

    def gpu(self, device: int | None) -> Any:
        self.device = device
        return nullcontext()

    def draw(self, expanded: Any, gpu: Any) -> Iterator[Any]:
        self.calls = asdict(expanded.options) | {"device": self.device}
        for number in expanded.options.frames:
            if self.fail and number == 2:
                raise self.fail
            yield FakeFrame(number)


class FakeFrame:
    """A small grey picture, as bright as its number."""

    def __init__(self, number: int) -> None:
        self.metadata = {"pipeline": "nodes: {}\n"}
        self.number = number
        self.warnings: tuple[Any, ...] = ()
        self.unsound: dict[str, Any] = {}
        self.badly_exposed: dict[str, str] = {}
        self.arrays = defaultdict[str, Any](lambda: np.full((4, 6, 4), number / 10, np.float32))

    def info(self, name: str) -> Any:
        if name == "image":
            return SimpleNamespace(semantic="display_color", format="rgba8", encoding="display", transparent=False)
        return SimpleNamespace(semantic="radiance", format="rgba16f", encoding="linear", transparent=False)

    def as_json(self) -> dict[str, Any]:
        return {
            "pipeline": "fake",
            "device": {"renderer": "none", "software": True},
            "size": [6, 4],
            "passes": [],
            "frame_ms": {"median": 1.0, "min": 1.0, "max": 1.0},
            "steps_run": [0],
            "memory": {},
            "culled": {"idle": "nobody reads it"},
            "figures": {"share": 0.25, "pair": [1.0, 2.0]},
        }


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeStages:
    """What `run` goes through in this test."""
    from rendergraph.session import gpu, stages, values

    made = FakeStages()
    monkeypatch.setattr(values, "figures", lambda graph: made.figures)
    for name in ("resolve", "link", "expand", "draw"):
        monkeypatch.setattr(stages, name, getattr(made, name))
    monkeypatch.setattr(gpu, "Gpu", made.gpu)
    return made
