"""A pipeline as Python has it: load, set, render."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, Unpack

from msgspec import structs

from rendergraph.session import stages
from rendergraph.session.progress import shown
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
    """A pipeline by shipped name or file; nothing is read until it is asked for.

    The arguments are the fields of a `Selection`.

    Raises:
        UsageError: a limit of an unknown name, or a size that is no pair of whole numbers.
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


def loaded(pipeline: Pipeline | str | Path) -> Pipeline:
    """A pipeline, or the one of a name or a file."""
    return pipeline if isinstance(pipeline, Pipeline) else load(pipeline)


def _once(stage: Callable[[Pipeline], T]) -> Callable[[Pipeline], T]:
    """A stage that is gone through once for each pipeline, and kept with it."""

    @wraps(stage)
    def kept(self: Pipeline) -> T:
        if stage.__name__ not in self._done:
            self._done[stage.__name__] = stage(self)
        found: T = self._done[stage.__name__]
        return found

    return kept


@dataclass(frozen=True, eq=False)
class Pipeline:
    """A selection, and what has been found out about it; `set` and the like return changed copies.

    Attributes:
        selection: what is asked for.
        catalog: the node types that can be used; by default those that are installed and those of plugins.
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
        """The same with one value changed, `ao.radius` or a pipeline parameter's name, as `-s` does."""
        text = value if isinstance(value, str) else json.dumps(value, default=lambda found: found.tolist())  # NumPy's
        return self.select(sets=(*self.selection.sets, f"{path}={text}"))

    def patch(self, patch: str | Path | Mapping[str, Any]) -> Pipeline:
        """The same with a merge patch applied (RFC 7386)."""
        return self.select(patches=(*self.selection.patches, Path(patch) if isinstance(patch, str) else patch))

    def with_scene(self, scene: str | Path) -> Pipeline:
        """The same of another scene."""
        return self.select(scene=str(scene))

    def with_size(self, size: tuple[int, int]) -> Pipeline:
        """The same at another size."""
        return self if self.selection.size == size else self.select(size=size)

    def select(self, **fields: Any) -> Pipeline:
        """The same with other values of these fields of its selection."""
        return replace(self, selection=structs.replace(self.selection, **fields))

    # Stages ----------------------------------------------------------------------------------------------------------

    @_once
    def resolve(self) -> Resolved:
        """The file with everything applied; done once.

        Raises:
            InputError: a file is missing or is no YAML.
        """
        return stages.resolve(self.selection, self.catalog)

    @_once
    def link(self) -> Linked:
        """The checked graph with its scene; done once.

        Raises:
            InputError: with all mistakes of the file.
        """
        return stages.link(self.resolve())

    @_once
    def check(self) -> Planned:
        """Everything that can be wrong and be found without GL, for all of the file's outputs; done once.

        Raises:
            InputError: with all mistakes found.
        """
        return stages.check(self.link())

    def expand(self, **options: Unpack[RenderKeywords]) -> Expanded:
        """All steps with what they read and write; the keywords are the fields of `RenderOptions`.

        Raises:
            InputError: a mistake in the file, or an output or port that it does not have.
        """
        linked = self.link()
        return stages.expand(linked, RenderOptions.of({"frames": linked.frames, "fps": linked.fps, **options}))

    def plan(self, **options: Unpack[RenderKeywords]) -> ResourcePlan:
        """Order and memory, without GL; the keywords are the fields of `RenderOptions`.

        Raises:
            InputError: a mistake in the file, or the steps have no legal order.
        """
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
        """Draw it and return the last frame.

        Args:
            size: width and height in pixels, the file's by default.
            session: where to draw; a private one for this call by default.
            device: GL device number, where no session is given.
            progress: told how many frames are drawn, and of how many; True shows a bar on stderr.
            options: the fields of `RenderOptions`.

        Raises:
            InputError: a mistake in a file or a shader.
            RenderError: it failed while drawing.
            DeviceError: there is no usable GL device.
        """
        from rendergraph.session.gpu import opened

        expanded = (self if size is None else self.with_size(size)).expand(**options)
        with opened(session, device) as gpu, shown(progress, "frames") as tell:
            return stages.draw_last(expanded, gpu, tell)

    def frames(
        self,
        size: tuple[int, int] | None = None,
        *,
        session: Gpu | None = None,
        device: int | None = None,
        **options: Unpack[RenderKeywords],
    ) -> Iterator[Frame]:
        """Draw it frame by frame; as `render`, and each frame is there before the next one is drawn."""
        from rendergraph.session.gpu import opened

        expanded = (self if size is None else self.with_size(size)).expand(**options)

        def drawn() -> Iterator[Frame]:
            with opened(session, device) as gpu:
                yield from stages.draw(expanded, gpu)

        return drawn()

    def _repr_html_(self) -> str:
        from rendergraph.diagrams import svg

        return svg(self.link().graph)
