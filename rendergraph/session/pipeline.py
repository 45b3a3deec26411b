"""A pipeline in Python: load, set, render."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, Unpack

from msgspec import structs

from rendergraph.session import stages
from rendergraph.session.progress import report_progress
from rendergraph.session.selection import RenderKeywords, RenderOptions, Selection, each_of

if TYPE_CHECKING:
    from rendergraph.allocate import ResourcePlan
    from rendergraph.catalog import Catalog
    from rendergraph.session.frame import Frame
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.progress import Progress
    from rendergraph.session.values import Expanded, Linked, Planned, Resolved

T = TypeVar("T")


def load(
    source: str | Path,
    *,
    scene: str | Path | None = None,
    environment: str | Path | None = None,
    camera: str | None = None,
    size: tuple[int, int] | None = None,
    sets: Sequence[str] = (),
    patches: Sequence[str | Path | Mapping[str, Any]] = (),
    asset_roots: Sequence[str | Path] = (),
    limits: Mapping[str, int] | None = None,
    plugins: Sequence[str | Path] = (),
) -> Pipeline:
    """Return a pipeline by shipped name or file; it is read when it is first needed.

    The arguments are the fields of `Selection`.

    Raises:
        UsageError: an unknown limit, or a size that is not a pair of whole numbers.
    """
    return Pipeline(
        Selection(
            source=str(source),
            scene=None if scene is None else str(scene),
            environment=None if environment is None else Path(environment),
            camera=camera,
            size=size,
            sets=each_of(sets),
            patches=tuple(Path(p) if isinstance(p, str) else p for p in patches),
            asset_roots=tuple(Path(root) for root in asset_roots),
            limits=tuple((limits or {}).items()),
            plugins=tuple(Path(plugin) for plugin in plugins),
        )
    )


def as_pipeline(pipeline: Pipeline | str | Path) -> Pipeline:
    """Return the pipeline, or the one with that name or file."""
    return pipeline if isinstance(pipeline, Pipeline) else load(pipeline)


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
        given = "".join(f", {each.name}={value!r}" for each, value in said if value != each.default)
        return f"load({self.selection.source!r}{given})"

    # Changing --------------------------------------------------------------------------------------------------------

    def set(self, path: str, value: object) -> Pipeline:
        """Return a copy with one value changed, `ao.radius` or a pipeline parameter's name, as with `-s`."""
        text = value if isinstance(value, str) else json.dumps(value, default=lambda found: found.tolist())  # NumPy's
        return self.select(sets=(*self.selection.sets, f"{path}={text}"))

    def patch(self, patch: str | Path | Mapping[str, Any]) -> Pipeline:
        """Return a copy with a merge patch applied (RFC 7386)."""
        return self.select(patches=(*self.selection.patches, Path(patch) if isinstance(patch, str) else patch))

    def with_scene(self, scene: str | Path) -> Pipeline:
        """Return a copy with another scene."""
        return self.select(scene=str(scene))

    def with_size(self, size: tuple[int, int]) -> Pipeline:
        """Return a copy with another size."""
        return self if self.selection.size == size else self.select(size=size)

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
        return stages.expand(linked, RenderOptions.of({"frames": linked.frames, "fps": linked.fps, **options}))

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

        expanded = (self if size is None else self.with_size(size)).expand(**options)
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

        expanded = (self if size is None else self.with_size(size)).expand(**options)

        def rendered() -> Iterator[Frame]:
            with opened(session, device) as gpu:
                yield from stages.draw(expanded, gpu)

        return rendered()

    def _repr_html_(self) -> str:
        from rendergraph.diagrams import svg

        return svg(self.link().graph)
