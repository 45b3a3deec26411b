"""A pipeline in Python: load, set, render."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar, Unpack

from msgspec import structs

from rendergraph.catalog import Catalog, find
from rendergraph.catalog.catalog import own_classes
from rendergraph.declare import MeshData
from rendergraph.document import Source, from_plain, shown
from rendergraph.errors import Option, Problem, UsageError
from rendergraph.resolve.spec import flow
from rendergraph.session import stages
from rendergraph.session.progress import report_progress
from rendergraph.session.selection import RenderKeywords, RenderOptions, Selection, each_of

if TYPE_CHECKING:
    import numpy.typing as npt

    from rendergraph.allocate import ResourcePlan
    from rendergraph.session.frame import Frame
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.progress import Progress
    from rendergraph.session.values import Expanded, Linked, Planned, Resolved

T = TypeVar("T")


def load(
    source: str | Path | Mapping[str, Any],
    *,
    scene: str | Path | Mapping[str, Any] | MeshData | None = None,
    environment: str | Path | Mapping[str, Any] | npt.NDArray[Any] | None = None,
    variant: str | None = None,
    ground: bool = False,
    transparent: bool = False,
    camera: str | None = None,
    view: str | None = None,
    shutter: float | None = None,
    size: tuple[int, int] | None = None,
    sets: Sequence[str] = (),
    patches: Sequence[str | Path | Mapping[str, Any]] = (),
    asset_roots: Sequence[str | Path] = (),
    limits: Mapping[str, int] | None = None,
    plugins: Sequence[str | Path] = (),
) -> Pipeline:
    """Return a pipeline by shipped name or file, or of a mapping with the keys of a file; it is read when first needed.

    The other arguments are the fields of `Selection`; a scene may be a mapping, too, such as a `Scene`.

    Raises:
        UsageError: an unknown limit, or a size that is not a pair of whole numbers.
    """
    pipeline = Pipeline(
        Selection(
            source=source if isinstance(source, Mapping) else _path("source", source, "a mapping"),
            variant=variant,
            ground=ground,
            transparent=transparent,
            camera=camera,
            view=view,
            shutter=shutter,
            size=size,
            sets=each_of(sets),
            asset_roots=tuple(Path(root) for root in asset_roots),
            limits=tuple((limits or {}).items()),
            plugins=tuple(Path(plugin) for plugin in plugins),
        )
    )
    if isinstance(source, Mapping):
        pipeline, plain = pipeline._with_values(source)
        pipeline = pipeline.select(source=plain)
    pipeline = pipeline if scene is None else pipeline.with_scene(scene)
    pipeline = pipeline if environment is None else pipeline.with_environment(environment)
    for patch in patches:
        pipeline = pipeline.patch(patch)
    return pipeline


def loads(text: str, **fields: Any) -> Pipeline:
    """Return the pipeline in a YAML text; what it names is relative to the current folder. `fields` as in `load`."""
    return load(text if "\n" in text else f"{text}\n", **fields)


def as_pipeline(pipeline: Pipeline | str | Path | Mapping[str, Any]) -> Pipeline:
    """Return the pipeline, or the one with that name, file or content."""
    return pipeline if isinstance(pipeline, Pipeline) else load(pipeline)


def _path(argument: str, given: object, other: str) -> str:
    if isinstance(given, str | os.PathLike):
        return os.fspath(given)
    text = f"{argument}: expected a name, a file or {other}, got {shown(repr(given))}"
    raise UsageError(Problem("RG500", text))


def _once(stage: Callable[[Pipeline], T]) -> Callable[[Pipeline], T]:
    """Cache the result of a stage with the pipeline."""

    @wraps(stage)
    def cached(self: Pipeline) -> T:
        if stage.__name__ not in self._done:
            self._done[stage.__name__] = stage(self)
        found: T = self._done[stage.__name__]
        return found

    return cached


@dataclass(frozen=True, eq=False)
class Pipeline:
    """A selection with the results of its stages; `set` and the like return changed copies.

    Each stage runs once. It raises an `InputError` with all mistakes that it finds.

    Attributes:
        selection: the file, and the changes to it.
        catalog: the available node types; by default the installed ones and those of plugins.
    """

    selection: Selection
    catalog: Catalog | None = field(default=None, repr=False)
    _done: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    def __repr__(self) -> str:
        said = ((each, getattr(self.selection, each.name)) for each in structs.fields(self.selection)[1:])
        given = "".join(f", {each.name}={shown(repr(value))}" for each, value in said if value != each.default)
        return f"load({self.selection.label!r}{given})"

    @property
    def travels(self) -> bool:
        """Whether other processes can render it, which lack the node classes of this one."""
        return self.catalog is None and not own_classes()

    # Changing --------------------------------------------------------------------------------------------------------

    def set(self, path: str | Mapping[str, object], value: object = None) -> Pipeline:
        """Return a copy with one value changed, or several, as with `-s`: `set("ao.radius", 0.5)`.

        Args:
            path: `ao.radius`, the name of a pipeline parameter, `scene.lights.sun.intensity`; or a mapping of paths.
            value: a value as in a file; an array for an input, a node class or shader text for a type.
        """
        changed = self
        for name, one in ({path: value} if isinstance(path, str) else path).items():
            node, _, key = name.rpartition(".")
            kind = "type" if key == "type" else "inputs" if getattr(one, "ndim", 0) > 1 else "params"
            keys = name.split(".") if node.startswith("scene.") else ("nodes", node, kind, key)
            changed, plain = changed._with_values(one, *(keys[:3] if kind == "type" else keys))
            text = plain if isinstance(plain, str) else flow(from_plain(plain, Source(Option("set", name))))
            changed = changed.select(sets=(*changed.selection.sets, f"{name}={text}"))
        return changed

    def patch(self, patch: str | Path | Mapping[str, Any]) -> Pipeline:
        """Return a copy with a merge patch applied (RFC 7386): a file, or values in Python."""
        changed, plain = self._with_values(patch) if isinstance(patch, Mapping) else (self, Path(patch))
        return changed.select(patches=(*changed.selection.patches, plain))

    def with_scene(self, scene: str | Path | Mapping[str, Any] | MeshData) -> Pipeline:
        """Return a copy with another scene: a name, a file, or a `Scene` or other mapping with a scene file's keys."""
        if isinstance(scene, MeshData):
            scene = {"scene": 1, "objects": {"mesh": {"file": scene}}}
        if isinstance(scene, Mapping):
            return self.select(scene=None).patch({"scene": None}).patch({"scene": scene})
        return self.select(scene=_path("scene", scene, "a `Scene`"))

    def with_camera(self, name: str | None = None, **keys: Any) -> Pipeline:
        """Return a copy seen from a camera of the scene, or from a new one: `with_camera(eye=(0, 1, 4), target=…)`.

        Args:
            name: of the scene's camera.
            keys: as in scene files: `eye`, `target`, `up`, `fov_y_degrees`, `height`, `near`, `far`, …
        """
        if keys:
            name = name or "custom"
            return self.set(f"scene.cameras.{name}", keys).select(camera=name)
        return self.select(camera=name)

    def with_environment(self, environment: str | Path | Mapping[str, Any] | npt.NDArray[Any]) -> Pipeline:
        """Return a copy with another environment: a shipped name, a file, or an array (height, width, 3) of light."""
        if isinstance(environment, Mapping):
            return self.patch({"scene": {"environment": environment}})
        changed, plain = self._with_values(environment, "environment")
        return changed.select(environment=Path(_path("environment", plain, "an array")))

    def _with_values(self, value: Any, *keys: str) -> tuple[Pipeline, Any]:
        """Return a Python value as plain data, and a copy with the files, types and nodes that it stands for."""
        if isinstance(value, str | int | float) and "type" not in keys:
            return self, value
        from rendergraph.session.python_values import Values  # most values are plain

        values = Values()
        plain, selection, catalog = values.plain(value, *keys), self.selection, self.catalog
        if values.types:
            catalog = (catalog or Catalog.discover(selection.plugins)).with_classes(values.types)
        if values.shaders and catalog is not None:
            catalog = catalog.with_shaders((name, find.shader(file)) for name, file in values.shaders.items())
        selection = structs.replace(
            selection,
            asset_roots=tuple(dict.fromkeys((*selection.asset_roots, *values.folders))),
            plugins=tuple(dict.fromkeys((*selection.plugins, *values.shaders.values()))),
            patches=(*selection.patches, *({"nodes": {name: node}} for name, node in values.nodes.items())),
        )
        return replace(self, selection=selection, catalog=catalog), plain

    def with_size(self, size: tuple[int, int] | None) -> Pipeline:
        """Return a copy with another size, if one is given."""
        return self if size in (None, self.selection.size) else self.select(size=size)

    def select(self, **fields: Any) -> Pipeline:
        """Return a copy with other values of these fields of its selection."""
        return replace(self, selection=structs.replace(self.selection, **fields))

    # Stages ----------------------------------------------------------------------------------------------------------

    @_once
    def resolve(self) -> Resolved:
        """Return the file with everything applied."""
        return stages.resolve(self.selection, self.catalog)

    @_once
    def link(self) -> Linked:
        """Return the checked graph with its scene."""
        return stages.link(self.resolve())

    @_once
    def check(self) -> Planned:
        """Find every mistake that can be found without GL, and return the plan of all outputs."""
        return stages.check(self.link())

    def expand(self, **options: Unpack[RenderKeywords]) -> Expanded:
        """Return all steps with what they read and write; the keywords are the fields of `RenderOptions`."""
        linked = self.link()
        made: RenderKeywords = {"frames": linked.frames, "fps": linked.fps, "subframes": linked.subframes}
        return stages.expand(linked, RenderOptions.of({**made, **options}))

    def plan(self, **options: Unpack[RenderKeywords]) -> ResourcePlan:
        """Return order and memory, without GL; the keywords are the fields of `RenderOptions`."""
        return stages.plan(self.expand(**options)).plan

    # Drawing ---------------------------------------------------------------------------------------------------------

    def render(
        self,
        size: tuple[int, int] | None = None,
        *,
        session: Gpu | None = None,
        device: int | None = None,
        progress: Progress | bool | None = None,
        **options: Unpack[RenderKeywords],
    ) -> Frame:
        """Render the pipeline and return the last frame.

        Args:
            size: width and height in pixels; the file's by default.
            session: where to render; by default one that all calls of a thread share.
            device: GL device number where no session is given.
            progress: a function that receives how many frames are done, and of how many; True shows a bar on stderr.
            options: the fields of `RenderOptions`.

        Raises:
            InputError: a mistake in a file or a shader.
            RenderError: rendering failed.
            DeviceError: there is no usable GL device.
        """
        from rendergraph.session.gpu import shared

        expanded = self.with_size(size).expand(**options)
        with report_progress(progress, "frames") as tell:
            return stages.draw_last(expanded, session or shared(device), tell)

    def frames(
        self,
        size: tuple[int, int] | None = None,
        *,
        session: Gpu | None = None,
        device: int | None = None,
        **options: Unpack[RenderKeywords],
    ) -> Iterator[Frame]:
        """Render frame by frame, as `render`; each frame is yielded before the next one is rendered."""
        from rendergraph.session.gpu import opened

        expanded = self.with_size(size).expand(**options)

        def rendered() -> Iterator[Frame]:
            with opened(session, device) as gpu:
                yield from stages.draw(expanded, gpu)

        return rendered()

    def film(
        self,
        path: str | Path,
        frames: range | Literal["clip"] | None = None,
        seconds: float | None = None,
        turntable: bool = False,
        fps: float = 30,
        *,
        session: Gpu | None = None,
        device: int | None = None,
        progress: Progress | bool | None = None,
        **options: Any,
    ) -> Path:
        """Render the picture `image` as a film: .mp4, .webp or .gif; without `frames` and `seconds` the motion once.

        Args:
            path: of the film, which appears when it is complete.
            frames: their numbers, or `clip` for the scene's motion once.
            seconds: length, from frame 1 on, in place of `frames`.
            turntable: take the camera once around its target, in 4 seconds by default.
            fps: frames per second.
            session, device, progress: as for `render`.
            options: the other fields of `RenderOptions`.

        Warns:
            UserWarning: nothing in the scene moves, nor does the camera.

        Raises:
            UsageError: no film has that extension, the encoder is not installed, or the length is contradictory.
        """
        from rendergraph import images
        from rendergraph.images.video import check_film, films
        from rendergraph.session.gpu import opened
        from rendergraph.session.scenes import film_frames, standstill_warning

        path = check_film(Path(path))
        numbers = film_frames(self.link().scene, fps, frames, seconds, turntable=turntable)
        options = {"outputs": ["image"], **options, "turntable": numbers if turntable else None}
        expanded = self.expand(frames=numbers, fps=fps, **options)
        for problem in standstill_warning(expanded, film=True, turntable="turntable=True"):
            warnings.warn(problem.text, stacklevel=2)
        with (
            films([path], fps, numbers[0]) as made,
            opened(session, device) as gpu,
            report_progress(progress, "frames") as tell,
        ):
            for done, frame in enumerate(stages.draw(expanded, gpu), start=1):
                made[path].add(frame.number, images.viewable_as(frame.arrays["image"], frame.info("image")))
                tell(done, len(numbers))
        return path

    def _repr_html_(self) -> str:
        from rendergraph.diagrams import svg

        return svg(self.link().graph)
