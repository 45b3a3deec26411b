"""Pictures for the pages, drawn by the project itself where this machine has a GL device."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

import numpy as np

import rendergraph as rg
from rendergraph.errors import DeviceError, InputError

if TYPE_CHECKING:
    from rendergraph.catalog import NodeType

SIZE = (480, 270)


class Studio:
    """Draws into one folder; without a folder or a device every picture is left out."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._session: rg.Session | None = None
        self.written: set[Path] = set()

    def __enter__(self) -> Studio:
        if self._folder is not None:
            try:
                self._session = rg.Session()
            except DeviceError as error:
                print(f"the pages will have no pictures: {error}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._session is not None:
            self._session.close()

    def draw(self, pipeline: rg.Pipeline, file: str, tap: str | None = None) -> str | None:
        """The image output of a pipeline, or one port of it.

        Args:
            pipeline: what is drawn.
            file: path within the folder, `.png`.
            tap: a port, `node.port`.

        Returns:
            The path, None where there is no picture, or nothing to see in it.
        """
        if self._session is None or self._folder is None:
            return None
        name = tap or "image"
        frame = self._session.render(
            pipeline.with_size(SIZE), outputs=[] if tap else ["image"], taps=[tap] if tap else [], warm_up=False
        )
        if np.ptp(frame[name]) == 0:
            return None
        path = self._folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        frame.save(path, name)
        self.written.add(path)
        return file


def shipped(scenes: bool = False) -> list[Path]:
    """The shipped pipelines, or scenes: those that stand alone before those that extend another."""
    from rendergraph.resources import folder

    home = folder("rendergraph.pipelines")
    files = sorted((home / "scenes" if scenes else home).glob("*.yaml"))
    return sorted(files, key=lambda file: "\nextends:" in file.read_text(encoding="utf-8"))


@cache
def _studies() -> list[rg.Pipeline]:
    """Every shipped pipeline with a scene that shows something, the smallest first."""
    pipelines = [rg.load(file.stem).with_scene("shadow_study") for file in shipped()]
    return sorted(pipelines, key=lambda pipeline: len(pipeline.graph.nodes))


def uses(found: NodeType, port: str) -> tuple[rg.Pipeline, str] | None:
    """The smallest shipped pipeline that can show a port of a node type, and where the port is in it."""
    needs = getattr(found.cls.outputs()[port], "needs", ())
    for pipeline in _studies():
        for node in pipeline.graph.nodes:
            if node.type.name != found.name or not all(name in node.inputs for name in needs):
                continue
            tap = f"{node.id}.{port}"
            try:
                pipeline.plan(outputs=[], taps=[tap])
            except InputError:
                continue
            return pipeline, tap
    return None
