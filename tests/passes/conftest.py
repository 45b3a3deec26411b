"""Drawing pipelines of node classes that stand in a test."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import rendergraph as rg
from rendergraph.api import Node
from rendergraph.catalog import Catalog


class Bench:
    """Makes pipelines of node classes and shader texts, and draws them on the shared session."""

    def __init__(self, folder: Path, session: rg.Session) -> None:
        self.folder = folder
        self.session = session

    def pipeline(
        self,
        text: str,
        *classes: type[Node],
        shaders: Mapping[str, str] | None = None,
        scene: str | None = None,
        size: tuple[int, int] = (16, 8),
    ) -> rg.Pipeline:
        """A pipeline of YAML text, with the classes as its only node types."""
        for name, source in (shaders or {}).items():
            (self.folder / name).write_text(source)
        head = f"rendergraph: 1\nsize: [{size[0]}, {size[1]}]\n"
        if scene is not None:
            (self.folder / "scene.yaml").write_text("scene: 1\n" + scene)
            head += "scene: scene.yaml\n"
        (self.folder / "test.yaml").write_text(head + text)
        loaded = rg.load(self.folder / "test.yaml")
        return replace(loaded, known_catalog=Catalog.of(*classes, shaders=self.folder))

    def draw(self, text: str, *classes: type[Node], **options: Any) -> rg.Frame:
        """Draw it; options of `pipeline` and of `Session.render` mixed."""
        own = {key: options.pop(key) for key in ("shaders", "scene", "size") if key in options}
        frame = self.session.render(self.pipeline(text, *classes, **own), **options)
        with self.session.device.current():
            assert self.session.device.raw.error() is None
        return frame


@pytest.fixture
def bench(tmp_path: Path, gl: rg.Session) -> Bench:
    return Bench(tmp_path, gl)


Draw = Callable[..., rg.Frame]


@pytest.fixture
def draw(bench: Bench) -> Draw:
    return bench.draw
