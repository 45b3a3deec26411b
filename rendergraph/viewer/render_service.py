"""The service in the render process: renders pictures and computes facts about them."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import singledispatchmethod
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from rendergraph import images, stamps
from rendergraph.compile import Executable
from rendergraph.errors import Problem, RendergraphError, shown_file
from rendergraph.metrics import measure
from rendergraph.resolve.patches import settings
from rendergraph.scene.cameras import bounding_sphere
from rendergraph.session import stages
from rendergraph.session.drawing import Drawing
from rendergraph.session.frame import Frame, OutputInfo
from rendergraph.session.gpu import Gpu
from rendergraph.session.selection import RenderOptions, Selection
from rendergraph.session.values import Expanded, Linked, Planned, every_port
from rendergraph.stamps import Stamps
from rendergraph.textures import TextureDesc
from rendergraph.viewer import editing, messages
from rendergraph.viewer.describe import describe
from rendergraph.viewer.messages import Look, RenderRequest, Request, Response

Pixels = npt.NDArray[Any]

NO_ALIAS_BYTES = 256 << 20
"""Up to this size textures do not share memory, so that more of the last frame can be reused after a change."""
INTERACTIVE_MS = 40.0
"""Moving pictures that take longer are rendered smaller."""
MOST_REDUCTION = 4
"""Minimum scale of moving pictures: a quarter of the size."""
THUMBNAIL = 176
"""Pixels along the longer side of a small picture."""
BINS = 64
_MOST_CACHED = 4
_OPTIONS = RenderOptions(warm_up=False, timed=True, reuse=True, share=True)
_LIGHT = frozenset({"radiance", "emissive", "luminance", "irradiance", "reflections"})


@dataclass(frozen=True)
class _Rendered:
    """The last picture, and the output or tap that is shown."""

    request: RenderRequest
    frame: Frame
    name: str
    drawing: Drawing

    @property
    def pixels(self) -> Pixels:
        return self.frame.arrays[self.name]

    @property
    def info(self) -> OutputInfo:
        return self.frame.info(self.name)

    def displayed(self) -> tuple[npt.NDArray[np.uint8], str]:
        """Return the picture, and the mapping of values to colours, if one was chosen."""
        look, pixels, exposure = self.request.look, self.pixels, self.request.exposure
        if exposure and self.info.semantic in _LIGHT:
            pixels = pixels * np.float32(2.0**exposure)
        if look == Look():
            return images.viewable_as(pixels, self.info), ""
        channel = "RGBA".find(look.channel) if look.channel else -1
        if 0 <= channel < pixels.shape[-1]:
            pixels = pixels[..., channel : channel + 1]
        return images.mapped(pixels, look.scale or "linear", look.low, look.high)


class RenderService:
    """Answers requests in the render process; the response to a failed request has its problems.

    It owns the GL context, and caches what the next picture can use: linked pipelines, their steps, the last picture.
    """

    def __init__(self, gpu: Gpu, interactive_ms: float = INTERACTIVE_MS) -> None:
        self._gpu, self._interactive_ms = gpu, interactive_ms
        self._files: Stamps = {}
        self._linked: dict[Selection, Linked] = {}
        self._expanded: dict[tuple[Selection, str], Expanded] = {}
        self._planned: Planned | None = None
        self._revision = 0
        self._described: dict[str, Any] = {}
        self._node_of_file: Mapping[str, str] = {}
        self._full_ms = 0.0  # the time of a whole frame: the sum of each node's last time
        self._timed: Executable | None = None
        self._pass_times: dict[str, dict[str, Any]] = {}
        self._rendered: _Rendered | None = None
        self._has_slid = False  # a value in the last drawing differs from its pipeline

    def answer(self, request: Request) -> Response:
        """Return the response; it contains mistakes of the user instead of raising them."""
        try:
            return self._answer(request)
        except RendergraphError as error:
            problems = (problem.as_json() | {"node": self._node_at(problem, request)} for problem in error.problems)
            return Response(problems=tuple(problems))

    @singledispatchmethod
    def _answer(self, request: Request) -> Response:
        raise NotImplementedError(request)

    # --- a picture ---------------------------------------------------------------------------------------------------

    @_answer.register
    def _picture(self, request: RenderRequest) -> Response:
        if stamps.modified(self._files):
            self._files, self._linked, self._expanded = {}, {}, {}
        with stamps.track_reads() as files:
            try:
                rendered = self._render(request)
            finally:
                self._files = {**self._files, **files}
        self._rendered, frame = rendered, rendered.frame
        picture, mapping = rendered.displayed()
        warnings = tuple(one for one in frame.warnings if one.code != "RG620")  # the page can play frames
        if request.still:
            drawing = rendered.drawing
            warnings += tuple(stages.not_finite_warnings(frame, drawing.expanded, self._gpu, drawing.camera))
        facts: dict[str, Any] = {
            "size": [picture.shape[1], picture.shape[0]],
            "number": frame.number,
            "port": request.port,
            "mapping": mapping,
            "is_light": rendered.info.semantic in _LIGHT,
            "passes": self._passes(rendered),
            "frame_ms": frame.frame_ms["median"],
            "device": dict(frame.device),
            "still": request.still,
            "warnings": [problem.as_json() for problem in warnings],
            "revision": self._revision,
        }
        if request.still:
            facts["texture"] = texture_statistics(rendered.pixels, rendered.info)
        if request.known_revision != self._revision:
            facts["pipeline"] = self._described
        return Response(
            facts,
            {"picture": _encode(picture, ".png" if request.still else ".jpg")},
            camera=rendered.drawing.camera,
            sphere=bounding_sphere(rendered.drawing.expanded.linked.scene),
        )

    def _passes(self, rendered: _Rendered) -> list[dict[str, Any]]:
        """Return each node's last times, whether it ran for this picture, and whether that was its first time.

        The first time of a program includes deferred work of the driver. Smaller pictures are not timed.
        """
        assert self._planned is not None  # the picture was rendered with it
        is_first = self._timed is not rendered.drawing.executable
        ran = {step.node for step in rendered.frame.times[-1].steps if step.index >= 0}
        drawn = [step.node for step in self._planned.plan.schedule.steps]
        times = {node: self._pass_times[node] for node in dict.fromkeys(drawn) if node in self._pass_times}
        for entry in rendered.frame.passes:
            node = str(entry["node"])
            if node in ran or node not in times:
                times[node] = dict(entry) | {"first": is_first}
        if rendered.request.still:
            self._timed, self._pass_times = rendered.drawing.executable, times
            kept = {step.node for step in rendered.drawing.executable.kept.values()}  # kept steps do not run again
            again = (entry for node, entry in times.items() if node not in kept)
            self._full_ms = sum(entry["gpu_ms"] or entry["cpu_ms"] for entry in again)
        return [entry | {"ran": node in ran} for node, entry in times.items()]

    def _render(self, request: RenderRequest) -> _Rendered:
        if (rendered := self._slide(request)) is not None:
            return rendered
        selection = request.selection
        if request.still or self._planned is None:
            linked = self._link(selection)
            if self._planned is None or self._planned.linked is not linked:
                self._planned = stages.plan(stages.expand(linked))
                self._node_of_file = _nodes_by_file(self._planned)
                described = describe(self._planned)
                if described != self._described:  # more than the camera has changed
                    self._described = described
                    self._revision += 1
        if not request.still:  # the description waits for a still picture
            selection = self._reduce_size(selection, self._planned.linked.graph.size)
        return self._draw(self._expand(selection, request), request)

    def _slide(self, request: RenderRequest) -> _Rendered | None:
        """Render the last moving picture with another value of one parameter, if that needs no linking."""
        last = self._rendered
        if last is None or last.request.still or request.still or request.port != last.request.port:
            return None
        before, after = last.request.selection, request.selection
        changed = [text for text in after.sets if text not in before.sets]
        drawing = last.drawing
        if len(changed) != 1 or drawing is not self._gpu.cache.drawing:
            return None
        (setting,) = settings(changed)
        others = [tuple(s for s in sets if s.partition("=")[0] != setting.text) for sets in (before.sets, after.sets)]
        same_file = replace(before, sets=()) == replace(after, sets=()) and others[0] == others[1]
        if not same_file or setting.node is None or setting.scope:
            return None
        with self._gpu.current():
            if not drawing.set(setting.node, setting.name, setting.value.plain()):
                return None
            self._has_slid, drawing.times = True, []
            drawing.draw(request.frame, request.camera)
            return _Rendered(request, drawing.read(), last.name, drawing)

    def _draw(self, expanded: Expanded, request: RenderRequest) -> _Rendered:
        with self._gpu.current():
            drawing = self._gpu.cache.drawing
            if isinstance(drawing, Drawing) and drawing.expanded is expanded and not self._has_slid:
                drawing.times = []
            else:
                drawing, self._has_slid = stages.compile(expanded, self._gpu), False
                drawing.begin()
            drawing.draw(request.frame, request.camera)
            return _Rendered(request, drawing.read(), list(expanded.requests)[-1], drawing)

    def _link(self, selection: Selection) -> Linked:
        if selection not in self._linked:
            _store(self._linked, selection, stages.link(stages.resolve(selection)))
        return self._linked[selection]

    def _expand(self, selection: Selection, request: RenderRequest) -> Expanded:
        port = request.port
        key = selection, port
        if key not in self._expanded:
            linked = self._link(selection)
            outputs = linked.graph.outputs
            main = "image" if "image" in outputs else next(iter(outputs))
            assert self._planned is not None  # the first picture is still, and so planned
            alias = self._planned.plan.memory.no_reuse_bytes > NO_ALIAS_BYTES
            asked, taps = (port, ()) if port in outputs else (main, (port,) if port else ())
            options = replace(_OPTIONS, outputs=(asked,), taps=taps, fps=request.fps, alias=alias)
            _store(self._expanded, key, stages.expand(linked, options))
        return self._expanded[key]

    def _reduce_size(self, selection: Selection, size: tuple[int, int]) -> Selection:
        factor = 1
        while self._full_ms > self._interactive_ms * factor * factor and factor < MOST_REDUCTION:
            factor *= 2
        width, height = (max(side // factor, 1) for side in size)
        return selection if factor == 1 else replace(selection, size=(width, height))

    # --- more about the picture --------------------------------------------------------------------------------------

    @_answer.register
    def _changed_files(self, request: messages.ChangedFilesRequest) -> Response:
        return Response({"changed": [path.name for path in stamps.modified(self._files)]})

    @_answer.register
    def _pixel(self, request: messages.PixelRequest) -> Response:
        if self._rendered is None:
            return Response()
        return Response({"pixel": texel(self._rendered.pixels, request.x, request.y)})

    @_answer.register
    def _thumbnails(self, request: messages.ThumbnailRequest) -> Response:
        if self._rendered is None or self._planned is None:
            return Response()
        last, (width, height) = self._rendered.request, self._planned.linked.graph.size
        scale = min(1.0, THUMBNAIL / max(width, height))
        small = replace(last.selection, size=(max(1, round(width * scale)), max(1, round(height * scale))))
        ports = every_port(self._planned)
        if request.nodes is not None:
            found = (self._first_texture(node, ports) for node in sorted(request.nodes))
            ports = tuple(port for port in found if port is not None)
            if not ports:
                return Response({"revision": self._revision})
        key = small, f"* {' '.join(ports)}"
        if key not in self._expanded:
            options = RenderOptions(fps=last.fps, taps=ports, warm_up=False)
            self._expanded[key] = stages.expand(self._link(small), options)
        frame = self._draw(self._expanded[key], last).frame
        textures = {port: frame.info(port) for port in ports if frame.info(port).kind != "buffer"}
        pictures = {port: images.viewable_as(frame.arrays[port], info) for port, info in textures.items()}
        files = {port: _encode(_subsample(picture)) for port, picture in pictures.items()}
        return Response({"revision": self._revision}, files)

    def _first_texture(self, node: str, ports: Collection[str]) -> str | None:
        """Return the first output of a node that is a texture and was rendered."""
        assert self._planned is not None  # its ports were requested
        graph = self._planned.linked.graph
        if node not in graph:
            return None  # it existed when the page asked
        textures = (end for end, info in graph.textures.items() if isinstance(info.desc, TextureDesc))
        found = {str(end) for end in textures}.intersection(ports)
        return next((port for name in graph[node].node.outputs() if (port := f"{node}.{name}") in found), None)

    @_answer.register
    def _compare(self, request: messages.CompareRequest) -> Response:
        if self._rendered is None or self._planned is None:
            return Response()
        last, linked = self._rendered, self._planned.linked
        # As in `compare`: the same scene, camera and size.
        scene, camera = linked.spec.scene or request.selection.scene, last.request.selection.camera
        selection = replace(request.selection, size=linked.graph.size, scene=scene, camera=camera)
        other = self._draw(self._expand(selection, last.request), last.request)
        facts: dict[str, Any] = {
            "name": other.drawing.expanded.linked.graph.name,
            "frame_ms": other.frame.frame_ms["median"],
            "passes": [dict(entry) for entry in other.frame.passes],
        }
        (a, _), (b, _) = last.displayed(), other.displayed()
        files = {"other": _encode(b)}
        if a.shape == b.shape and a.shape[-1] == 3:
            metrics, flip = measure(a, b)
            facts["figures"] = metrics.as_json()
            difference = np.abs(a.astype(np.int16) - b.astype(np.int16)).max(axis=-1).astype(np.float32) / 255
            files["difference"] = _encode(images.heat_map(np.clip(difference * 8, 0, 1)))
            files["flip"] = _encode(images.heat_map(flip))
        return Response(facts, files)

    # --- errors ------------------------------------------------------------------------------------------------------

    def _node_at(self, problem: Problem, request: Request) -> str | None:
        """Return the node that is declared or set at a problem's place, or whose type comes from that file."""
        place = problem.place
        if place is None or self._planned is None or not isinstance(request, RenderRequest):
            return None
        if editing.is_in_opened(place, request.selection) or place.option("--set") is not None:
            return editing.node_at(problem, request.selection)
        if (id := self._node_of_file.get(place.file)) is not None:
            return id
        nodes = self._planned.linked.graph.nodes
        above = [
            (n.place.line, n.id) for n in nodes if n.place and n.place.file == place.file and n.place.line <= place.line
        ]
        return max(above)[1] if above else None


def _nodes_by_file(planned: Planned) -> dict[str, str]:
    """Return the files of node types, as messages name them, with the first node that has the type."""
    found: dict[str, str] = {}
    for step in planned.plan.schedule.steps:
        kind = planned.linked.graph[step.node].type
        for _, shader in step.shaders:
            found.setdefault(shown_file(kind.shader_file(shader)[0]), step.node)
        found.setdefault(shown_file(kind.file), step.node)
    return found


def _store(cache: dict[Any, Any], key: Any, value: Any) -> None:
    if len(cache) >= _MOST_CACHED:
        del cache[next(iter(cache))]
    cache[key] = value


def _encode(picture: npt.NDArray[np.uint8], ending: str = ".png") -> bytes:
    return images.picture_bytes((Path(f"picture{ending}"), picture, None, "data", False), {})


def _subsample(picture: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Return every n-th pixel of a picture that is larger than a thumbnail: shadow maps, cubes."""
    step = math.ceil(max(picture.shape[:2]) / THUMBNAIL)
    return np.ascontiguousarray(picture[::step, ::step])


def texel(pixels: Pixels, x: float, y: float) -> dict[str, Any]:
    """Return the values at a position, 0…1 from the left and from the top; layers are arranged in a grid, as shown."""
    array = {2: pixels[np.newaxis, ..., np.newaxis], 3: pixels[np.newaxis]}.get(pixels.ndim, pixels)
    count, height, width, _ = array.shape
    columns = math.ceil(math.sqrt(count))
    rows = math.ceil(count / columns)
    across, down = (min(max(share, 0.0), 1.0) for share in (x, y))
    row, y_in_layer = divmod(min(int(down * rows * height), rows * height - 1), height)
    column, x_in_layer = divmod(min(int(across * columns * width), columns * width - 1), width)
    layer = row * columns + column
    if layer >= count:
        return {}
    values = _numbers(array[layer, y_in_layer, x_in_layer])
    return {"at": [x_in_layer, y_in_layer], "layer": layer if count > 1 else None, "values": values}


def texture_statistics(pixels: Pixels, info: OutputInfo) -> dict[str, Any]:
    """Return a texture's format, shape, count of NaN and infinite texels, and per channel range, mean and histogram."""
    array = pixels[..., np.newaxis] if pixels.ndim == 2 else pixels
    flat = array.reshape(-1, array.shape[-1])
    return {
        "format": info.format,
        "semantic": info.semantic,
        "kind": info.kind,
        "shape": list(array.shape),
        "nan": int(np.isnan(flat).any(axis=-1).sum()),
        "infinite": int(np.isinf(flat).any(axis=-1).sum()),
        "channels": [_channel_statistics(channel) for channel in flat.T.astype(np.float64)],
    }


def _channel_statistics(values: npt.NDArray[np.float64]) -> dict[str, Any]:
    values = values[np.isfinite(values)]
    if not values.size:
        return {"min": None, "max": None, "mean": None, "histogram": [0] * BINS}
    low, high, mean = _numbers((values.min(), values.max(), values.mean()))
    return {"min": low, "max": high, "mean": mean, "histogram": np.histogram(values, bins=BINS)[0].tolist()}


def _numbers(values: Iterable[Any]) -> list[Any]:
    """Return values that JSON can hold: NaN and infinity become words."""
    return [float(f"{v:.7g}") if math.isfinite(v) else str(float(v)) for v in values]
