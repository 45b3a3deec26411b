"""Pictures for the pages, drawn by the project itself where this machine has a GL device."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import yaml

import rendergraph as rg
from rendergraph import images
from rendergraph.catalog import Catalog
from rendergraph.errors import DeviceError, InputError
from rendergraph.link.graph import Endpoint
from rendergraph.reference import example_file

if TYPE_CHECKING:
    from rendergraph.catalog import NodeType
    from rendergraph.link.graph import GraphNode

SIZE = (480, 270)
SMALL = (96, 54)
SHOWN, ENLARGED = (120, 90), 3
"""The part of a picture that is shown beside the same part of another one, and how many times it is enlarged."""
ALIKE, VISIBLE = 4.0, 0.35
"""Mean difference in 255ths up to which two pictures look alike, and from which on an enlarged part does not."""


@dataclass(frozen=True)
class View:
    """One thing to look at: a port of a pipeline, or where `tap` is None its image."""

    pipeline: rg.Pipeline
    tap: str | None

    @property
    def name(self) -> str:
        """What the frame calls it."""
        return self.tap or "image"


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

    def scenes(self, after: View, before: View | None) -> list[str]:
        """Scenes to try, the best first: that in which a node changes most of what it leaves."""
        if self._session is None or before is None:
            return list(SCENES)
        found = {}
        for scene in SCENES:
            plain, shown = self._values(before, scene), self._values(after, scene)
            found[scene] = float(np.minimum(np.abs(shown - plain), np.abs(shown)).mean() / max(plain.mean(), 1e-6))
        return sorted(SCENES, key=lambda scene: -found[scene])

    def _values(self, view: View, scene: str) -> npt.NDArray[np.float64]:
        assert self._session is not None
        pipeline = with_maps(view.pipeline.with_scene(scene).with_size(SMALL), 128)
        outputs, taps = ([], [view.tap]) if view.tap else (["image"], [])
        return self._session.render(pipeline, outputs=outputs, taps=taps, warm_up=False)[view.name].astype(np.float64)

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
            with_maps(pipeline.with_size(SIZE), 1024),
            outputs=[] if tap else ["image"],
            taps=[tap] if tap else [],
            warm_up=False,
        )
        if np.ptp(frame[name]) == 0:
            return None
        path = self._folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        frame.save(path, name)
        self.written.add(path)
        return file

    def draw_difference(self, base: rg.Pipeline, pipeline: rg.Pipeline, file: str) -> str | None:
        """The part in which two pictures that look alike differ most, of both beside each other and enlarged.

        Returns:
            The path; None where the pictures show different scenes, look the same, or plainly differ as a whole.
        """
        if self._session is None or self._folder is None or base.link().spec.scene != pipeline.link().spec.scene:
            return None
        drawn = [
            self._session.render(with_maps(one.with_size(SIZE), 1024), outputs=["image"], warm_up=False)["image"]
            for one in (base, pipeline)
        ]
        difference = np.abs(drawn[0].astype(float) - drawn[1]).max(-1)
        part = _most_different(difference)
        if difference.mean() > ALIKE or difference[part].mean() < VISIBLE:
            return None
        shown = [np.repeat(np.repeat(image[part][..., :3], ENLARGED, 0), ENLARGED, 1) for image in drawn]
        gap = np.full((shown[0].shape[0], 6, 3), 255, np.uint8)
        path = self._folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        images.write(path, np.concatenate([shown[0], gap, shown[1]], 1))
        self.written.add(path)
        return file


def _most_different(difference: npt.NDArray[np.float64]) -> tuple[slice, slice]:
    """The rows and columns of the window in which most differs."""
    width, height = SHOWN
    sums = np.pad(difference.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    windows = sums[height:, width:] - sums[:-height, width:] - sums[height:, :-width] + sums[:-height, :-width]
    y, x = np.unravel_index(windows.argmax(), windows.shape)
    return slice(y, y + height), slice(x, x + width)


def with_maps(pipeline: rg.Pipeline, side: int) -> rg.Pipeline:
    """The pipeline with shadow maps that suit a small picture: most of a page's time went into larger ones."""
    nodes = [node.id for node in pipeline.link().graph.nodes if "resolution" in node.node.parameters()]
    for node in nodes:
        pipeline = pipeline.set(f"{node}.resolution", side)
    return pipeline


def shipped(scenes: bool = False) -> list[Path]:
    """The shipped pipelines, or scenes: those that stand alone before those that extend another."""
    from rendergraph.resources import folder

    home = folder("rendergraph.pipelines")
    files = sorted((home / "scenes" if scenes else home).glob("*.yaml"))
    return sorted(files, key=lambda file: "\nextends:" in file.read_text(encoding="utf-8"))


@cache
def catalog() -> Catalog:
    """Every node type, looked up once."""
    return Catalog.discover()


SCENES = ("shadow_study", "cornell_box", "many_lights", "glass")
"""Scenes for the pictures of nodes; the first one unless another shows more."""


def exhibit(found: NodeType, port: str) -> tuple[View, View | None] | None:
    """An output in the smallest pipeline that can show it, a shipped one or the example, and what it is made of.

    The second is the texture that the output is a changed version of, where there is one.
    """
    needs = getattr(found.cls.outputs()[port], "needs", ())
    for pipeline in [*_studies(), *(pipeline for pipeline, _ in example_and_base(found))]:
        for node in pipeline.link().graph.nodes:
            if node.type.name == found.name and all(name in node.inputs for name in needs):
                tap, before = f"{node.id}.{port}", _changed(pipeline, node, port)
                try:
                    pipeline.plan(outputs=[], taps=[tap])
                except InputError:
                    continue
                return View(pipeline, tap), View(pipeline, before) if before else None
    return None


@cache
def example_and_base(found: NodeType) -> list[tuple[rg.Pipeline, rg.Pipeline]]:
    """The example on a type's page, and the shipped pipeline that it is a patch on; one such pair or none."""
    text = example_file(found, catalog())
    patch = yaml.safe_load(text) if text else {}
    if "extends" not in patch:
        return []
    base = rg.load(patch.pop("extends")).with_scene(SCENES[0])
    names = [file.stem for file in shipped() if file.read_text(encoding="utf-8") == text]
    if names:  # by its name: what it names itself lies beside it
        return [(rg.load(names[0]).with_scene(SCENES[0]), base)]
    return [(base.patch(patch), base)]


@cache
def _studies() -> list[rg.Pipeline]:
    """Every shipped pipeline with a scene that shows something, the smallest first."""
    pipelines = [rg.load(file.stem).with_scene(SCENES[0]) for file in shipped()]
    return sorted(pipelines, key=lambda pipeline: len(pipeline.link().graph.nodes))


def _changed(pipeline: rg.Pipeline, node: GraphNode, port: str) -> str | None:
    """The texture that an output is a changed version of: one of the same meaning, kind and size."""
    textures = pipeline.link().graph.textures
    made = textures.get(Endpoint(node.id, port))
    for ends in node.inputs.values():
        read = textures.get(ends[0])
        if made and read and read.desc and made.semantic == read.semantic and made.desc == read.desc:
            return str(ends[0])
    return None
