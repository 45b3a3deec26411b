"""What the render process does: draws what is asked for, and says what there is to see.

It owns the GL context and keeps what the next picture can use: the linked pipeline, its steps, what was drawn last.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import singledispatchmethod
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from rendergraph import images, stamps
from rendergraph.compile import Executable
from rendergraph.document import Source, from_plain
from rendergraph.errors import Place, Problem, RendergraphError, shown_file
from rendergraph.metrics import measure
from rendergraph.resolve import diff, to_yaml
from rendergraph.scene.cameras import bounding_sphere
from rendergraph.session import stages
from rendergraph.session.drawing import Drawing
from rendergraph.session.frame import Frame, OutputInfo
from rendergraph.session.gpu import Gpu
from rendergraph.session.selection import RenderOptions, Selection
from rendergraph.session.values import Expanded, Linked, Planned
from rendergraph.session.wanted import every_port
from rendergraph.stamps import Stamps
from rendergraph.viewer.describe import described
from rendergraph.viewer.questions import Against, Answer, Ask, Changed, Pixel, Question, Thumbnails, Variant

Pixels = npt.NDArray[Any]

ROOMY = 256 << 20
"""Bytes of textures up to which they do not share memory, so that more is still there when something changes."""
QUICK_MS = 40.0
"""A picture that moves may take this long before it is drawn smaller."""
SMALLEST = 4
"""It is drawn at a quarter of its size at the least."""
THUMBNAIL = 176
"""Pixels along the longer side of a small picture."""
BINS = 64

_LIGHT = frozenset({"radiance", "emissive", "luminance"})


@dataclass(frozen=True)
class _Shown:
    """What was drawn last, and what of it was looked at."""

    ask: Ask
    frame: Frame
    name: str
    drawing: Drawing


class Painter:
    """Answers questions; one that cannot be answered is answered with what is wrong."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._files: Stamps = {}
        self._linked: dict[Selection, Linked] = {}
        self._expanded: dict[tuple[Selection, str], Expanded] = {}
        self._planned: Planned | None = None
        self._revision = 0
        self._sources: Mapping[str, str] = {}
        self._full_ms = 0.0  # what drawing everything took, last of all times that each node was drawn
        self._timed: Executable | None = None
        self._taken: dict[str, dict[str, Any]] = {}
        self._shown: _Shown | None = None
        self._folder = tempfile.TemporaryDirectory(prefix="rendergraph-view-")

    def close(self) -> None:
        """Remove what pictures were encoded in."""
        self._folder.cleanup()

    def answer(self, question: Question) -> Answer:
        """What there is to say; never an exception for what a user can get wrong."""
        try:
            return self._said(question)
        except RendergraphError as error:
            return Answer(problems=tuple(self._as_json(problem) for problem in error.problems))

    @singledispatchmethod
    def _said(self, question: Question) -> Answer:
        raise NotImplementedError(question)

    # --- a picture ---------------------------------------------------------------------------------------------------

    @_said.register
    def _picture(self, ask: Ask) -> Answer:
        if stamps.modified(self._files):
            self._forget()
        with stamps.track_reads() as files:
            try:
                shown = self._draw(ask)
            finally:
                self._files = {**self._files, **files}
        self._shown, frame = shown, shown.frame
        info, pixels = frame.info(shown.name), frame[shown.name]
        picture = images.viewable_as(_exposed(pixels, info, ask.stops), info)
        facts: dict[str, Any] = {
            "size": [picture.shape[1], picture.shape[0]],
            "number": frame.number,
            "port": ask.port,
            "passes": self._passes(shown),
            "frame_ms": frame.frame_ms["median"],
            "device": dict(frame.device),
            "still": ask.still,
            "warnings": [problem.as_json() for problem in frame.warnings],
        }
        if ask.still:
            facts["texture"] = figures(pixels, info)
        if ask.known != self._revision:
            assert self._planned is not None  # the picture is of it
            facts["pipeline"] = described(self._planned)
        facts["revision"] = self._revision
        return Answer(
            facts,
            {"picture": self._encoded(picture, ".png" if ask.still else ".jpg")},
            camera=shown.drawing.camera,
            sphere=bounding_sphere(shown.drawing.expanded.linked.scene),
        )

    def _passes(self, shown: _Shown) -> list[dict[str, Any]]:
        """What each node took when it was last drawn, and whether that was now."""
        if self._timed is not shown.drawing.executable:
            self._timed, self._taken = shown.drawing.executable, {}
        ran = {step.node for step in shown.frame.times[-1].steps if step.index >= 0}
        for entry in shown.frame.passes:
            node = str(entry["node"])
            if node in ran or node not in self._taken:
                self._taken[node] = dict(entry)
        if shown.ask.still:
            self._full_ms = sum(entry["gpu_ms"] or entry["cpu_ms"] for entry in self._taken.values())
        return [entry | {"ran": node in ran} for node, entry in self._taken.items()]

    def _draw(self, ask: Ask) -> _Shown:
        selection = ask.selection
        if ask.still or self._planned is None:
            linked = self._link(selection)
            if self._planned is None or self._planned.linked is not linked:
                self._planned = stages.plan(stages.expand(linked))
                self._sources = _sources(self._planned)
                self._revision += 1
        if not ask.still:  # what is said of it waits until it stands still
            selection = self._smaller(selection, self._planned.linked.graph.size)
        expanded = self._expand(selection, ask)
        name = list(expanded.wanted)[-1]
        drawing, frame = self._drawn(expanded, ask)
        return _Shown(ask, frame, name, drawing)

    def _drawn(self, expanded: Expanded, ask: Ask) -> tuple[Drawing, Frame]:
        with self._gpu.current():
            active = self._gpu.cache.drawing
            if isinstance(active, Drawing) and active.expanded is expanded:
                drawing = active
                drawing.times = []
            else:
                drawing = stages.compile(expanded, self._gpu)
                drawing.begin()
            drawing.draw(ask.frame, ask.camera)
            return drawing, drawing.read()

    def _link(self, selection: Selection) -> Linked:
        if selection not in self._linked:
            linked = stages.link(stages.resolve(selection))
            self._linked = {**dict(list(self._linked.items())[-3:]), selection: linked}
        return self._linked[selection]

    def _expand(self, selection: Selection, ask: Ask) -> Expanded:
        port = ask.port
        key = selection, port
        if key not in self._expanded:
            linked = self._link(selection)
            outputs = linked.graph.outputs
            main = "image" if "image" in outputs else next(iter(outputs))
            assert self._planned is not None  # the first picture is of what stands still, and that is planned
            roomy = self._planned.plan.memory.no_reuse_bytes <= ROOMY  # then what was drawn stays there
            shown = (port if port in outputs else main,)
            wanted = RenderOptions(outputs=shown, fps=ask.fps, warm_up=False, timed=True, reuse=True, alias=not roomy)
            if port and port not in outputs:
                wanted = replace(wanted, taps=(port,))
            expanded = stages.expand(linked, wanted)
            self._expanded = {**dict(list(self._expanded.items())[-3:]), key: expanded}
        return self._expanded[key]

    def _smaller(self, selection: Selection, size: tuple[int, int]) -> Selection:
        part = 1
        while self._full_ms > QUICK_MS * part * part and part < SMALLEST:
            part *= 2
        return selection if part == 1 else replace(selection, size=(max(size[0] // part, 1), max(size[1] // part, 1)))

    def _forget(self) -> None:
        self._files, self._linked, self._expanded = {}, {}, {}

    # --- more about it -----------------------------------------------------------------------------------------------

    @_said.register
    def _changed(self, question: Changed) -> Answer:
        return Answer({"changed": [path.name for path in stamps.modified(self._files)]})

    @_said.register
    def _pixel(self, place: Pixel) -> Answer:
        if self._shown is None:
            return Answer()
        pixels, info = self._shown.frame[self._shown.name], self._shown.frame.info(self._shown.name)
        return Answer({"pixel": texel(pixels, info, place.x, place.y)})

    @_said.register
    def _thumbnails(self, question: Thumbnails) -> Answer:
        if self._shown is None or self._planned is None:
            return Answer()
        ask, (width, height) = self._shown.ask, self._planned.linked.graph.size
        part = min(1.0, THUMBNAIL / max(width, height))
        small = replace(ask.selection, size=(max(1, round(width * part)), max(1, round(height * part))))
        linked = self._link(small)
        ports = every_port(self._planned)
        key = small, "*"
        if key not in self._expanded:
            self._expanded[key] = stages.expand(linked, RenderOptions(fps=ask.fps, taps=ports, warm_up=False))
        _, frame = self._drawn(self._expanded[key], ask)
        found = {}
        for port in ports:
            info = frame.info(port)
            if info.kind != "buffer":
                found[port] = self._encoded(_reduced(images.viewable_as(frame[port], info)), ".png")
        return Answer({"revision": self._revision}, found)

    @_said.register
    def _against(self, question: Against) -> Answer:
        if self._shown is None or self._planned is None:
            return Answer()
        shown, linked = self._shown, self._planned.linked
        info, mine = shown.frame.info(shown.name), shown.frame[shown.name]
        # As `compare` draws it: on the same scene, by the same camera and at the same size.
        scene, camera = linked.spec.scene or question.selection.scene, shown.ask.selection.camera
        other = replace(question.selection, size=linked.graph.size, scene=scene, camera=camera)
        expanded = self._expand(other, shown.ask)
        _, frame = self._drawn(expanded, shown.ask)
        name = list(expanded.wanted)[-1]
        theirs = frame[name]
        b = images.viewable_as(_exposed(theirs, frame.info(name), shown.ask.stops), frame.info(name))
        facts: dict[str, Any] = {
            "name": expanded.linked.graph.name,
            "frame_ms": frame.frame_ms["median"],
            "passes": [dict(entry) for entry in frame.passes],
        }
        files = {"other": self._encoded(b, ".png")}
        a = images.viewable_as(_exposed(mine, info, shown.ask.stops), info)
        if a.shape == b.shape and a.shape[-1] == 3:
            figures, flip = measure(a, b)
            facts["figures"] = figures.as_json()
            difference = np.abs(a.astype(np.int16) - b.astype(np.int16)).max(axis=-1).astype(np.float32) / 255
            files["difference"] = self._encoded(images.heat_map(np.clip(difference * 8, 0, 1)), ".png")
            files["flip"] = self._encoded(images.heat_map(flip), ".png")
        return Answer(facts, files)

    @_said.register
    def _variant(self, question: Variant) -> Answer:
        if self._shown is None:
            return Answer()
        now, opened = self._shown.ask.selection, replace(question.opened, sets=(), patches=(), scene=None, size=None)
        before, after = (stages.resolve(one).spec.plain() for one in (opened, now))
        variant = {"extends": opened.source} | diff(before, after)
        return Answer({"yaml": to_yaml(from_plain(variant, Source("variant")), origins=False)})

    # --- encoding, and errors ----------------------------------------------------------------------------------------

    def _encoded(self, picture: npt.NDArray[np.uint8], ending: str) -> bytes:
        path = Path(self._folder.name) / f"picture{ending}"
        images.write(path, picture)
        return path.read_bytes()

    def _as_json(self, problem: Problem) -> dict[str, Any]:
        return problem.as_json() | {"node": self._node_at(problem.place) if problem.place else None}

    def _node_at(self, place: Place) -> str | None:
        """The node that stands at a place, is set there, or is made of that file."""
        if (setting := place.option("--set")) is not None:
            return setting.path.partition(".")[0]
        if self._planned is None:
            return None
        if (id := self._sources.get(place.file)) is not None:
            return id
        nodes = self._planned.linked.graph.nodes
        above = [
            (n.place.line, n.id) for n in nodes if n.place and n.place.file == place.file and n.place.line <= place.line
        ]
        return max(above)[1] if above else None


def _sources(planned: Planned) -> dict[str, str]:
    """The files that nodes are made of, as messages name them, with the node; the first of several."""
    found: dict[str, str] = {}
    for step in planned.plan.schedule.steps:
        kind = planned.linked.graph[step.node].type
        for _, shader in step.shaders:
            found.setdefault(shown_file(kind.shader_file(shader)[0]), step.node)
        found.setdefault(shown_file(kind.file), step.node)
    return found


def _exposed(pixels: Pixels, info: OutputInfo, stops: float) -> Pixels:
    """Light, brighter by so many stops; anything else as it is."""
    return pixels * np.float32(2.0**stops) if stops and info.semantic in _LIGHT else pixels


def _reduced(picture: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Every so manieth pixel of what is larger than a small picture: shadow maps, cubes."""
    step = math.ceil(max(picture.shape[:2]) / THUMBNAIL)
    return np.ascontiguousarray(picture[::step, ::step])


def texel(pixels: Pixels, info: OutputInfo, x: float, y: float) -> dict[str, Any]:
    """The values at a place of a picture, 0…1 from the left and from the top; layers lie in a grid, as shown."""
    array = pixels[..., np.newaxis] if pixels.ndim == 2 else pixels
    if array.ndim == 3:
        array = array[np.newaxis]
    count, height, width, _ = array.shape
    columns = math.ceil(math.sqrt(count))
    rows = math.ceil(count / columns)
    column, row = min(int(x * columns * width), columns * width - 1), min(int(y * rows * height), rows * height - 1)
    layer = row // height * columns + column // width
    if layer >= count:
        return {}
    at = [column % width, row % height]
    return {"at": at, "layer": layer if count > 1 else None, "values": numbers(array[layer, at[1], at[0]])}


def figures(pixels: Pixels, info: OutputInfo) -> dict[str, Any]:
    """What is in a texture: size, channels, range, mean, histogram, and how much of it is no number."""
    array = pixels[..., np.newaxis] if pixels.ndim == 2 else pixels
    flat = array.reshape(-1, array.shape[-1])
    found: dict[str, Any] = {
        "format": info.format,
        "semantic": info.semantic,
        "kind": info.kind,
        "shape": list(array.shape),
        "nan": int(np.isnan(flat).any(axis=-1).sum()),
        "infinite": int(np.isinf(flat).any(axis=-1).sum()),
        "channels": [],
    }
    for channel in range(flat.shape[-1]):
        values = flat[:, channel].astype(np.float64)
        values = values[np.isfinite(values)]
        if not values.size:
            found["channels"].append({"min": None, "max": None, "mean": None, "histogram": [0] * BINS})
            continue
        counts, _ = np.histogram(values, bins=BINS)
        low, high, mean = numbers((values.min(), values.max(), values.mean()))
        found["channels"].append({"min": low, "max": high, "mean": mean, "histogram": counts.tolist()})
    return found


def numbers(values: Iterable[Any]) -> list[Any]:
    """Values as JSON holds them; what is no number as a word."""
    return [float(f"{v:.7g}") if math.isfinite(v) else str(float(v)) for v in values]
