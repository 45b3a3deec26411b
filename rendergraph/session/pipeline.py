"""A pipeline from file to plan: pure, immutable, and without GL until it is rendered."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import WeakValueDictionary

from rendergraph import stamps
from rendergraph.errors import InputError, Problem, UsageError, suggestion
from rendergraph.link import Endpoint, Graph, endpoint

if TYPE_CHECKING:
    from rendergraph.allocate import ResourcePlan
    from rendergraph.catalog import Catalog
    from rendergraph.expand import Expansion
    from rendergraph.resolve import PipelineSpec
    from rendergraph.scene.model import Scene
    from rendergraph.session.frame import Frame
    from rendergraph.session.session import Session


_SCENES: WeakValueDictionary[tuple[Any, ...], Scene] = WeakValueDictionary()
"""Scenes in use, so that variants of a pipeline share theirs."""


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

    Args:
        source: a shipped name (`forward`) or a path.
        scene, size: override the file's; `size` is width and height in pixels.
        environment: an equirectangular image that replaces the scene's.
        camera: name of the scene's camera; its first by default.
        sets: what `-s` takes on the command line, such as `ao.radius=0.8`.
        patches: merge patches, as files or mappings.
        asset_roots: more folders that the file may reach.
        limits: what files may ask for, by the names that messages give: `yaml-depth`, `scene-vertices`, …;
            `plan-memory`, in MiB, is what textures may take.
        plugins: Python files or folders with node types.

    Raises:
        UsageError: a limit of an unknown name.
    """
    known = {name for names in _limit_names().values() for name in names}
    for name in limits or {}:
        if name not in known:
            raise UsageError(Problem("RG500", f"there is no limit '{name}'{suggestion(name, known)}"))
    return Pipeline(
        source=str(source),
        scene_name=None if scene is None else str(scene),
        environment=None if environment is None else Path(environment),
        camera=camera,
        size=size,
        sets=tuple(sets),
        patches=tuple(Path(p) if isinstance(p, str) else p for p in patches),
        asset_roots=tuple(Path(root) for root in asset_roots),
        limits=tuple((limits or {}).items()),
        plugins=tuple(Path(plugin) for plugin in plugins),
    )


def _limit_names() -> dict[str, dict[str, str]]:
    """What each kind of file has limits of: the name on the command line to the field."""
    from rendergraph.document import Limits as YamlLimits
    from rendergraph.scene.files import Limits as SceneLimits

    names = {
        kind: {f"{kind}-{entry.name.replace('_', '-')}": entry.name for entry in fields(limits)}
        for kind, limits in (("yaml", YamlLimits), ("scene", SceneLimits))
    }
    return {**names, "plan": {"plan-memory": "memory"}}


def _each(names: Iterable[str]) -> list[str]:
    """Several names, or a text that is one: its letters are never meant."""
    return [names] if isinstance(names, str) else list(names)


@dataclass(frozen=True, eq=False)
class Pipeline:
    """A pipeline with everything that is said about it; `set` and the like return changed copies."""

    source: str
    scene_name: str | None = None
    environment: Path | None = None
    camera: str | None = None
    size: tuple[int, int] | None = None
    sets: tuple[str, ...] = ()
    patches: tuple[Path | Mapping[str, Any], ...] = ()
    asset_roots: tuple[Path, ...] = ()
    limits: tuple[tuple[str, int], ...] = ()
    plugins: tuple[Path, ...] = ()
    known_catalog: Catalog | None = field(default=None, repr=False)

    # Changing --------------------------------------------------------------------------------------------------------

    def set(self, path: str, value: object) -> Pipeline:
        """The same with one value changed, `ao.radius` or a pipeline parameter's name, as `-s` does."""
        import json

        text = value if isinstance(value, str) else json.dumps(value, default=lambda found: found.tolist())  # NumPy's
        return replace(self, sets=(*self.sets, f"{path}={text}"))

    def patch(self, patch: str | Path | Mapping[str, Any]) -> Pipeline:
        """The same with a merge patch applied (RFC 7386)."""
        return replace(self, patches=(*self.patches, Path(patch) if isinstance(patch, str) else patch))

    def with_scene(self, scene: str | Path) -> Pipeline:
        """The same of another scene."""
        return replace(self, scene_name=str(scene))

    def with_size(self, size: tuple[int, int]) -> Pipeline:
        """The same at another size."""
        return self if self.size == size else replace(self, size=size)

    def allowed(self, kind: str) -> dict[str, int]:
        """The limits set for `yaml` or `scene` files, or for the `plan`, by field."""
        names = _limit_names()[kind]
        return {names[name]: most for name, most in self.limits if name in names}

    # Stages ----------------------------------------------------------------------------------------------------------

    @cached_property
    def catalog(self) -> Catalog:
        """The node types that can be used."""
        from rendergraph.catalog import Catalog

        return self.known_catalog or Catalog.discover(self.plugins)

    @cached_property
    def spec(self) -> PipelineSpec:
        """The resolved file."""
        from rendergraph.document import Limits
        from rendergraph.resolve import resolve

        return resolve(
            self.source,
            patches=self.patches,
            sets=self.sets,
            scene=self.scene_name,
            size=self.size,
            asset_roots=self.asset_roots,
            limits=Limits(**self.allowed("yaml")),
            catalog=self.catalog,
        )

    @property
    def name(self) -> str:
        """The file's stem."""
        return self.spec.name

    @cached_property
    def scene(self) -> Scene:
        """The scene, completed by a camera and a light where it has none.

        Pipelines that ask for the same unchanged files share one scene, and so its place on the GPU.
        """
        from rendergraph.scene.animate import complete
        from rendergraph.scene.files import Limits, Reading
        from rendergraph.scene.load import load
        from rendergraph.scene.model import Environment, Scene

        file = self.spec.scene
        limits = Limits(**self.allowed("scene"))
        roots = self.spec.roots.folders if file is not None else ()
        key = (Path.cwd(), file, self.environment, self.camera, roots, limits, self.plugins)
        found = _SCENES.get(key)
        if found is not None and not stamps.changed(found.files):
            stamps.again(found.files)
            return found
        with stamps.looking() as files:
            extensions, check = self.catalog.extensions, self.spec.roots.check
            scene = Scene("empty")
            if file is not None:
                scene = load(file, check_path=check, limits=limits, extensions=extensions)
            if self.environment is not None:
                reading = Reading(self.environment, lambda path, place: path, limits, extensions)
                image = reading.image(self.environment, "environment")
                scene = replace(scene, environment=Environment(image))
        _SCENES[key] = found = replace(complete(scene, self.camera), files=files)
        return found

    @cached_property
    def graph(self) -> Graph:
        """The checked graph.

        Raises:
            InputError: with all mistakes of the file.
        """
        from rendergraph.link import link
        from rendergraph.scene.cameras import light_facts
        from rendergraph.scene.selection import unfilled_selections

        try:
            scene = self.scene
        except InputError as error:  # the file's own mistakes may be why, such as a plugin that is not installed
            raise InputError([*self.spec.problems, *error.problems]) from None
        return link(self.spec, self.catalog, light_facts(scene), unfilled_selections(scene))

    @cached_property
    def sketch(self) -> tuple[Graph, tuple[Problem, ...]]:
        """The graph to look at, and what is missing in it: nodes whose type nobody has are in it as far as known.

        Raises:
            InputError: something else is wrong; with all mistakes of the file.
        """
        from rendergraph.link import sketch
        from rendergraph.scene.animate import complete
        from rendergraph.scene.cameras import light_facts
        from rendergraph.scene.model import Scene

        try:
            return self.graph, ()
        except InputError as error:
            unread: tuple[Problem, ...] = ()
            try:
                scene = self.scene
            except InputError as lacking:  # a mesh that a missing plugin would read
                if not self.spec.missing or any(problem.code != "RG303" for problem in lacking.problems):
                    raise error from None
                scene, unread = complete(Scene("missing")), lacking.problems
            graph, missing = sketch(self.spec, self.catalog, light_facts(scene))
            return graph, (*missing, *unread)

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """What was noticed in the pipeline and the scene and is no error."""
        return (*self.spec.notes, *self.graph.warnings, *self.scene.warnings)

    def wanted(self, outputs: Sequence[str] | None = None, taps: Iterable[str] = ()) -> dict[str, Endpoint]:
        """The ports that must exist at the end of a frame, by output name or tap.

        Raises:
            InputError: an output or a port that the pipeline does not have.
        """
        graph = self.graph
        names = graph.outputs if outputs is None else _each(outputs)
        wanted: dict[str, Endpoint] = {}
        problems = []
        for name in names:
            if name in graph.outputs:
                wanted[name] = graph.outputs[name]
            else:
                hint = suggestion(name, graph.outputs)
                problems.append(Problem("RG205", f"pipeline '{graph.name}' has no output '{name}'{hint}"))
        for tap in _each(taps):
            try:
                end = wanted[tap] = endpoint(graph, tap)
            except InputError as error:
                problems += [Problem("RG206", f"--tap {tap}: {problem.text}") for problem in error.problems]
                continue
            node = graph[end.node]
            problems += [
                Problem("RG116", f"--tap {tap}: it needs input '{name}' of '{end.node}', which is not connected")
                for name in getattr(node.node.ports()[end.port], "needs", ())
                if not node.inputs.get(name)
            ]
        if problems:
            raise InputError(problems)
        return wanted

    def expansion(self, outputs: Sequence[str] | None = None, taps: Iterable[str] = ()) -> Expansion:
        """All steps with what they read and write."""
        from rendergraph.expand import expand

        return expand(self.graph, self.wanted(outputs, taps))

    def plan(
        self,
        outputs: Sequence[str] | None = None,
        taps: Iterable[str] = (),
        *,
        alias: bool = True,
        shuffle: int | None = None,
    ) -> ResourcePlan:
        """Order and memory, without GL.

        Args:
            outputs: names of the outputs to keep, all of the file's by default.
            taps: further ports, `node.port`.
            alias: let textures share memory.
            shuffle: seed of a random legal order instead of the best one.
        """
        from rendergraph.allocate import allocate
        from rendergraph.schedule import schedule

        return allocate(schedule(self.expansion(outputs, taps), shuffle=shuffle), alias=alias)

    def check(self, outputs: Sequence[str] | None = None, taps: Iterable[str] = ()) -> Graph:
        """Everything that can be wrong and be found without GL.

        Raises:
            InputError: with all mistakes found.
        """
        from rendergraph.program import check_texts

        plan = self.plan(outputs, taps)
        types = {node.id: node.type for node in self.graph.nodes}
        check_texts(plan.schedule.steps, types, plan.resources, self.expansion(outputs, taps).views)
        return self.graph

    # Drawing ---------------------------------------------------------------------------------------------------------

    def render(
        self,
        size: tuple[int, int] | None = None,
        *,
        frames: range | None = None,
        outputs: Sequence[str] | None = None,
        taps: Sequence[str] = (),
        alias: bool = True,
        poison: bool = False,
        shuffle: int | None = None,
        fps: float = 30.0,
        device: int | None = None,
        on_frame: Callable[[Frame], None] | None = None,
        session: Session | None = None,
    ) -> Frame:
        """Draw it and return the last frame.

        Args:
            size: width and height in pixels, the file's by default.
            frames: frame numbers from 1, `range(1, 2)` by default; frame 1 is time 0.
            outputs: names of the outputs to compute, all of the file's by default.
            taps: further ports to read, `node.port`.
            alias, poison, shuffle: test modes: no sharing of memory, poisoned released textures, a random legal order.
            fps: frames a second.
            device: GL device number, where no session is given.
            on_frame: called with each frame.
            session: where to draw; a private one for this call by default.

        Raises:
            InputError: a mistake in a file or a shader.
            RenderError: it failed while drawing.
            DeviceError: there is no usable GL device.
        """
        from rendergraph.session.session import Session

        pipeline = self if size is None else self.with_size(size)
        options: dict[str, Any] = {
            "frames": frames,
            "outputs": outputs,
            "taps": taps,
            "alias": alias,
            "poison": poison,
            "shuffle": shuffle,
            "fps": fps,
            "on_frame": on_frame,
        }
        if session is not None:
            return session.render(pipeline, **options)
        with Session(device=device) as own:
            return own.render(pipeline, **options)

    def _repr_html_(self) -> str:
        from rendergraph.views import svg

        return svg(self.graph)
