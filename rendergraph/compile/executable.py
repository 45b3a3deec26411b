"""The result of compiling: draws with their uniforms and state, assembled into a flat list of calls.

Uniforms with the same value in all draws of a program are written once when the pipeline becomes active; each draw
writes only the others. A changed parameter only reassembles the lists: no GL object is created, no shader compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence
from contextlib import ExitStack
from functools import cached_property
from itertools import chain, pairwise
from typing import Any

from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph import activity
from rendergraph.allocate import ResourcePlan
from rendergraph.compile.bindings import ViewBuffers
from rendergraph.compile.checks import uniform_mismatch
from rendergraph.compile.gpu_scene import PREVIOUS_ATTRIBUTES, TEXELS, GpuScene
from rendergraph.compile.memory import Call, Memory
from rendergraph.compile.reuse import Reuse, Source
from rendergraph.compile.transfers import UploadedValues
from rendergraph.expand import CAMERA
from rendergraph.gl.device import Device
from rendergraph.gl.programs import Program
from rendergraph.gl.queries import OcclusionQuery, Timer
from rendergraph.gl.state import Pieces, changes
from rendergraph.program import prefix, used_blocks, used_names
from rendergraph.schedule.dependencies import StepKey, touched_ids
from rendergraph.steps import Read, Step, UniformValue
from rendergraph.steps.model import FunctionBinding

_MOST_PARTS = 64
"""Maximum number of cached lists of some of the steps."""

_OF_INSTANCES = {
    "scene_instance_block": "instances",
    "scene_previous_block": "instances before",
    "scene_previous_position_block": "instances before",
}
"""Blocks of the scene's data that change together with other sources."""


class Draw(Struct, eq=False):
    """One draw call or dispatch with the state to set before it.

    Attributes:
        binds: its own texture and buffer bindings; textures only if the driver's units ran out.
        textures: sampled name to texture in this parity and sampler, for plain 2D textures.
    """

    program: Program
    uniforms: dict[str, Any]
    state: Pieces | None
    call: Call
    binds: list[Call] = field(default_factory=list)
    vertex_array: Any = None
    textures: dict[str, tuple[int, int]] = field(default_factory=dict)


class SortedDraws(Struct, eq=False):
    """Depth-sorted draws: each part is compiled once, and runs of neighbours are found again whenever the view moves.

    Attributes:
        runs: part number, first command and number of commands, far to near.
    """

    parts: list[Draw]
    render: Callable[[int, int, int], object]
    runs: list[tuple[int, int, int]] = field(default_factory=list)
    prepared: list[tuple[Call, ...]] = field(default_factory=list)

    def __call__(self) -> None:
        for part, first, count in self.runs:
            for call in self.prepared[part]:
                call()
            self.render(part, first, count)


class _Cell(Struct, eq=False):
    """A uniform that `update` sets: a call before a draw whose value can change."""

    step: StepKey
    draw: Draw
    name: str
    value: Any = None
    call: Call | None = None

    def __call__(self) -> None:
        if self.call is not None:
            self.call()


class CompiledStep(Struct, eq=False):
    """A step of one parity.

    Attributes:
        before: framebuffer, clears, begins of queries and conditional rendering.
        sorted: depth-sorted draws, instead of `draws`.
        after: ends of queries and conditional rendering, barriers, poison.
        name: the step's name, as in plans.
    """

    step: Step
    before: list[Call] = field(default_factory=list)
    draws: list[Draw] = field(default_factory=list)
    sorted: SortedDraws | None = None
    after: list[Call] = field(default_factory=list)
    name: str = ""

    @property
    def all_draws(self) -> list[Draw]:
        return self.draws + (self.sorted.parts if self.sorted is not None else [])

    def values(self, step: Step) -> dict[str, Any]:
        """Return the uniforms of an equal step that any of its programs uses."""
        seen = {name for draw in self.all_draws for name in draw.program.uniforms}
        seen |= {"values"} if self.step.kind == "upload" else set()
        return {name: value for name, value in step_uniforms(step).items() if name in seen}


class FrameStep(Struct, frozen=True, eq=False):
    """A step as executed in a frame: a flat list of its calls, and its timer.

    State changes depend on the preceding steps, so the calls may differ between lists.
    """

    step: Step
    calls: tuple[Call, ...]
    timer: Timer


class Executable(Struct, eq=False, dict=True):
    """A compiled pipeline of one size.

    Attributes:
        binds: the calls that bind textures, samplers and blocks, one list per parity.
        lists: the steps of the next frame, one list per parity; filled by `assemble`.
        due: kept steps that the next frame runs.
        cull_and_sort: `GeometryCompiler.cull_and_sort` with the views.
        contents: bytes that `update` has written into buffers.
        stale: the buffers among them that this drawing has not written yet.
        touched: the sources that have changed since the last frame, except the scene's.
        changes_seen: the scene's counters of changes at the last frame.
        recorded_steps: all recorded steps, including those that are not in the plan.
        uploads: values that the CPU computes for textures and buffers, by upload step.
        owned: frees what it owns; programs and scenes belong to the session.
        drawn: frames since the history began; 0 if the history is lost.
        parity: which of the two textures of each history the last frame wrote.
        fresh: `statics` must be written and everything bound before the next frame.
        uses_previous: a program reads positions or views of the previous frame.
        shares_kept: kept values may be exchanged with other pipelines.
        means: the `LightMeans` of a frame's moments, once a frame has several.
    """

    device: Device
    plan: ResourcePlan
    memory: Memory
    views: ViewBuffers
    scene: GpuScene
    binds: list[list[Call]]
    steps: list[list[CompiledStep]]
    lists: list[list[FrameStep]] = field(default_factory=list)
    due: set[StepKey] = field(default_factory=set)
    statics: list[Call] = field(default_factory=list)
    cull_and_sort: Callable[..., object] = bool
    timers: list[Timer] = field(default_factory=list)
    occlusion_queries: list[OcclusionQuery] = field(default_factory=list)
    uploads: Mapping[StepKey, UploadedValues] = field(default_factory=dict)
    owned: ExitStack = field(default_factory=ExitStack)
    fresh: bool = True
    drawn: int = 0
    parity: int = 0
    uses_previous: bool = False
    has_new_kept: bool = False
    shares_kept: bool = True
    means: Any = None
    contents: dict[str, bytes] = field(default_factory=dict)
    stale: set[str] = field(default_factory=set)
    touched: set[Source] = field(default_factory=set)
    recorded_steps: Sequence[Step] = ()
    _cells: dict[tuple[str, str], list[_Cell]] = field(default_factory=dict)
    _steady: list[list[FrameStep]] = field(default_factory=list)
    _parts: dict[tuple[int, tuple[int, ...]], list[FrameStep]] = field(default_factory=dict)
    changes_seen: Mapping[str, int] = field(default_factory=dict)
    _running: bool = False

    def __post_init__(self) -> None:
        self.reuse = Reuse(self.plan, self._step_sources)

    @cached_property
    def kept(self) -> dict[StepKey, Step]:
        """The steps that write resources kept from frame to frame."""
        resources = self.plan.resources
        steps = self.plan.schedule.steps
        return {s.key: s for s in steps if any(resources[write.resource].role == "kept" for write in s.writes)}

    @cached_property
    def uniforms(self) -> Mapping[str, set[str]]:
        """The names of each node's uniforms, including those of steps that are left out."""
        found: dict[str, set[str]] = {}
        for step in self.recorded_steps:
            for _, one in _with_functions(step):
                found.setdefault(one.node, set()).update(dict(one.uniforms))
        return found

    @property
    def programs(self) -> set[Program]:
        return {draw.program for step in chain.from_iterable(self.steps) for draw in step.all_draws}

    def invalidate(self) -> None:
        """Make the next frame run every step, kept ones included: no frame has run yet, or the last one failed."""
        self.due = set(self.kept)
        self.reuse.forget()
        self.assemble()

    def end_frame(self) -> None:
        """Mark the kept steps that were due as done."""
        self._running, self.lists = False, self._steady
        if self.due:
            self.due, self.has_new_kept = set(), True

    def mark_restored(self, resources: Collection[str]) -> None:
        """Skip the due kept steps that write only these resources, which have been restored."""
        missing = {key for key in self.due if any(w.resource not in resources for w in self.kept[key].writes)}
        self.due = self._with_dependents(missing)
        self.reuse.forget()  # their readers must run again
        self.assemble()

    def reset_updates(self) -> None:
        """Discard everything that `update` set in the previous drawing."""
        for region in self.memory.regions.values():
            region.set()
        for cell in chain.from_iterable(self._cells.values()):
            self.write_uniform(cell, cell.draw.uniforms[cell.name])
        self.stale = set(self.contents)

    def cells(self, node: str, name: str) -> list[_Cell]:
        """Return the cells of a node's uniform in programs that run in every frame, for `write_uniform`."""
        if (node, name) not in self._cells:
            found = self._cells[node, name] = [
                _Cell(compiled.step.key, draw, before + name)
                for compiled in chain.from_iterable(self.steps)
                if compiled.step.key not in self.kept
                for before, one in _with_functions(compiled.step)
                if one.node == node and name in dict(one.uniforms)
                for draw in compiled.all_draws
                if before + name in draw.program.uniforms
            ]
            if found:
                self.assemble()
        return self._cells[node, name]

    def set_uniform(self, node: str, name: str, value: UniformValue) -> str | None:
        """Set a uniform of a node for `update`; return why its program cannot take the value."""
        for cell in self.cells(node, name):
            if (mismatch := uniform_mismatch(cell.draw.program.uniforms[cell.name], value)) is not None:
                return mismatch
            self.write_uniform(cell, value)
        return None

    def write_uniform(self, cell: _Cell, value: UniformValue) -> None:
        """Set a uniform in one of its cells."""
        if repr(cell.value) != repr(value):
            cell.value, cell.call = value, cell.draw.program.writer(cell.name, value)
            self.touched.add(("step", cell.step))

    def write_buffer(self, id: str, data: bytes) -> None:
        """Write the beginning of a buffer for `update`; the first write of a drawing sets the rest to 0."""
        buffer, before = self.memory.buffer(id), self.contents.get(id, b"")
        if id in self.stale:
            self.stale.discard(id)
            data = now = data.ljust(len(before), b"\0")
        else:
            now = data + before[len(data) :]
        buffer.write(data)
        if now != before:
            self.contents[id] = now
            self.touched.add(("buffer", id))

    def computed(self, steps: Collection[StepKey]) -> None:
        """Schedule upload steps whose values have been recomputed, and the kept steps that depend on them."""
        self.touched |= {("step", key) for key in steps}
        if kept := self.kept.keys() & steps:
            self.due = self._with_dependents(self.due | kept)
            self.assemble()

    def end_updates(self) -> None:
        """Record which regions and buffers have changed since the previous frame; call it after all updates."""
        for id in list(self.stale):
            self.write_buffer(id, b"")
        for (node, number), region in self.memory.regions.items():
            drawn = region.scissor, region.depth_bounds
            if drawn != region.drawn:
                region.drawn = drawn
                self.touched.add(("region", node, number))

    def mark_stale(self) -> None:
        """Discard all state: another executable has written the uniforms of shared programs and shared textures."""
        self.fresh, self.drawn = True, 0
        self.reuse.forget()

    def abort(self) -> None:
        """End active queries after an interrupted step, so that later draws are not affected."""
        for query in self.occlusion_queries:
            query.abort()
        self.fresh = True

    def steps_for_frame(self, *, reuse: bool, repeats: bool = False) -> list[FrameStep]:
        """Return the steps of a frame: all, or with `reuse` those whose results are lost or out of date.

        A frame that `repeats` replaces the previous one: it reads the same history.
        """
        changes = self.scene.changes
        if changes != self.changes_seen:
            changed = {name for name, count in changes.items() if self.changes_seen.get(name, 0) != count}
            self.touched |= changed
            self.changes_seen = dict(changes)
            if again := {key for key, sources in self._kept_sources.items() if not sources.isdisjoint(changed)}:
                self.due = self._with_dependents(self.due | again)
                self.assemble()
        if not reuse or self.due or self._running:  # `_running`: the last frame was interrupted
            self.reuse.forget()
        self._running = True
        positions = self.reuse.choose(frozenset(self.touched), repeats)
        self.touched.clear()
        if positions is None:
            return self.lists[self.parity]
        key = self.parity, positions
        if key not in self._parts:
            if len(self._parts) >= _MOST_PARTS:
                self._parts.clear()
            self._parts[key] = self._listed(self.parity, positions)
        return self._parts[key]

    def steps_with_stops(self, stops: Mapping[int, Call]) -> list[FrameStep]:
        """Return all steps of a frame, with state-changing calls inserted before some positions or after the last step.

        Call it after `steps_for_frame`, which decides which kept steps are due.
        """
        positions, end = self._positions(self.due), len(self.steps[0])
        key = self.parity, (-1, *positions)
        if key not in self._parts:
            found: list[FrameStep] = []
            for low, high in pairwise([0, *(at for at in sorted(stops) if at), end]):
                part = self._listed(self.parity, [at for at in positions if low <= at < high])
                if low in stops and part:
                    part[0] = replace(part[0], calls=(stops[low], *part[0].calls))
                found += part
            if end in stops:
                found[-1] = replace(found[-1], calls=(*found[-1].calls, stops[end]))
            self._parts[key] = found
        return self._parts[key]

    def _positions(self, due: Container[StepKey]) -> list[int]:
        """Return the positions of all steps but the kept ones that are not due."""
        keys = (compiled.step.key for compiled in self.steps[0])
        return [at for at, key in enumerate(keys) if key not in self.kept or key in due]

    @cached_property
    def _kept_sources(self) -> dict[StepKey, frozenset[Source]]:
        """The sources of kept steps that read the scene's data; other kept steps have none that change."""
        if not any(step.reads_scene for step in self.kept.values()):
            return {}
        sources = zip(self.steps[0], self._step_sources(), strict=True)
        return {one.step.key: found for one, found in sources if one.step.key in self.kept and one.step.reads_scene}

    def _step_sources(self) -> list[frozenset[Source]]:
        """Return the sources of each step, apart from the results of other steps."""
        resources, found = self.plan.resources, []
        for compiled in self.steps[0]:
            step = compiled.step
            texts = (text for draw in compiled.all_draws for text in draw.program.texts.values())
            blocks = set().union(*map(used_blocks, texts))
            views: dict[str, Source] = {"camera_block": ("view", CAMERA), **_OF_INSTANCES}
            if step.view is not None:
                views["pass_view_block"] = "view", step.view
                views["previous_pass_view_block"] = "view before", step.view
            for before, read in prefixed_reads(step):
                if (table := resources[read.resource].view) is not None:
                    views[f"{before}{read.name}_view_block"] = "view before" if read.previous else "view", table
                    views[f"{before}previous_{read.name}_view_block"] = "view before", table
            sources = {views.get(block, block) for block in blocks}
            sources |= {("step", step.key), *(("buffer", id) for id in touched_ids(step))}
            if step.kind == "geometry":
                sources |= {"instances", ("view", step.view or "")}
            if any(TEXELS & draw.program.uniforms.keys() for draw in compiled.all_draws):
                sources.add("instances")
            if any(name in draw.program.object for draw in compiled.all_draws for name in PREVIOUS_ATTRIBUTES):
                sources.add("instances before")
            if step.region is not None:
                sources.add(("region", step.node, step.region))
            found.append(frozenset(sources))
        return found

    @cached_property
    def reads_frame(self) -> bool:
        draws = (draw for step in self.steps[0] for draw in step.all_draws)
        return any("frame_block" in draw.program.block_names for draw in draws)

    @cached_property
    def moves_with_time(self) -> bool:
        """Whether a program moves anything over time.

        In full-screen steps, `delta_time` does not count: they use it for adaptation, not for motion.
        """
        for step in self.steps[0]:
            names = {"time"} if step.step.kind == "fullscreen" else {"time", "delta_time"}
            programs = [draw.program for draw in step.all_draws if "frame_block" in draw.program.block_names]
            texts = (text for program in programs for text in program.texts.values())
            if any(not names.isdisjoint(used_names(text)) for text in texts):
                return True
        return False

    @property
    def was_updated(self) -> bool:
        """Whether nodes have changed buffers or uniforms since the previous frame."""
        return any(isinstance(source, tuple) and source[0] in ("buffer", "step") for source in self.touched)

    def assemble(self) -> None:
        """Build the flat lists of calls from the steps' draws, without redundant state changes."""
        shared = _differing(draw for step in self.steps[0] for draw in step.all_draws)
        cells = {(id(cell.draw), cell.name): cell for found in self._cells.values() for cell in found}
        shared |= {(cell.draw.program.glo, cell.name) for cell in cells.values()}
        self.statics = []
        written: set[tuple[int, str]] = set()

        def writes(draw: Draw) -> list[Call]:
            own: list[Call] = []
            for name, value in draw.uniforms.items():
                key = (draw.program.glo, name)
                if (cell := cells.get((id(draw), name))) is not None:
                    own.append(cell)
                elif (key in shared or key not in written) and (write := draw.program.writer(name, value)):
                    written.add(key)
                    (own if key in shared else self.statics).append(write)
            return own

        def listed(parity: int, positions: Iterable[int], *, wait: bool = False) -> list[FrameStep]:
            state: Pieces | None = None
            found: list[FrameStep] = []
            for position in positions:
                compiled, timer = self.steps[parity][position], self.timers[position]
                calls = list(compiled.before)
                last = found[-1].calls[-1:] if found else ()
                if calls and last and calls[0] is last[0]:
                    del calls[0]  # one barrier is enough between two steps that store
                for draw in compiled.draws:
                    calls += draw.binds
                    if draw.state is not None:
                        calls += changes(state, draw.state)
                        state = draw.state
                    calls += [*writes(draw), draw.call]
                if compiled.sorted is not None:
                    compiled.sorted.prepared = [
                        (*part.binds, *changes(None, part.state or {}), *writes(part)) for part in compiled.sorted.parts
                    ]
                    calls.append(compiled.sorted)
                    state = None
                doing = f"drawing step '{compiled.name}'"
                begin = activity.note(doing if wait else f"{doing} or a step before it")
                calls = [begin, *calls, *compiled.after, *([self.device.ctx.finish] if wait else [])]
                found.append(FrameStep(compiled.step, tuple(calls), timer))
            return found

        def all_but_kept(due: Container[StepKey], *, wait: bool = False) -> list[list[FrameStep]]:
            return [listed(parity, self._positions(due), wait=wait) for parity in range(len(self.steps))]

        # Drivers run commands asynchronously. The first frame waits for each step, so that a hanging one can be named.
        wait = activity.draw_seconds() > 0
        self._steady = all_but_kept(())
        self.lists = all_but_kept(self.due, wait=wait) if self.due or wait else self._steady
        self._listed, self._parts = listed, {}
        self.fresh = True

    def changed(self, values: Mapping[StepKey, Step]) -> set[StepKey]:
        """Return the steps whose parameters differ in `values`, whose steps may differ only in uniforms."""
        return {c.step.key for c in self.steps[0] if repr(c.values(c.step)) != repr(c.values(values[c.step.key]))}

    def set_uniforms(self, values: Mapping[StepKey, Step]) -> None:
        changed = self.changed(values)
        self.touched |= {("step", key) for key in changed}
        self.due = self._with_dependents(self.due | (changed & self.kept.keys()))
        for compiled in chain.from_iterable(self.steps):
            step = values[compiled.step.key]
            compiled.step = step
            if step.key in self.kept:
                self.kept[step.key] = step
            for draw in compiled.all_draws:
                draw.uniforms.update(step_uniforms(step))
        self.assemble()

    def _with_dependents(self, due: set[StepKey]) -> set[StepKey]:
        """Return the steps that must run again if these do.

        These are all writers of their textures, because earlier versions are overwritten, all readers of them, and all
        writers of textures that they read in an earlier version. The scene's environment is never written.
        """
        final: dict[str, int] = {}
        for step in self.kept.values():
            final |= {write.resource: max(write.version, final.get(write.resource, 0)) for write in step.writes}
        while True:
            steps = [self.kept[key] for key in due]
            again = {write.resource for step in steps for write in step.writes}
            reads = [read for step in steps for read in step.all_reads]
            again |= {read.resource for read in reads if read.version < final.get(read.resource, 0)}
            more = {key for key, step in self.kept.items() if not again.isdisjoint(touched_ids(step))}
            if more <= due:
                return due
            due = due | more

    def release(self) -> None:
        self.owned.close()


def _with_functions(step: Step) -> list[tuple[str, Step | FunctionBinding]]:
    """Return a step and the functions that it calls, each with the prefix of its names in the program text."""
    return [("", step), *((prefix(function.node), function) for function in step.functions)]


def prefixed_reads(step: Step) -> list[tuple[str, Read]]:
    """Return the reads of a step and of the functions that it calls, each with its prefix in the program text."""
    return [(before, read) for before, part in _with_functions(step) for read in part.reads]


def step_uniforms(step: Step) -> dict[str, Any]:
    """Return a step's uniforms and, under prefixed names, those of the functions that it calls."""
    values = {before + name: value for before, part in _with_functions(step) for name, value in part.uniforms}
    return values if step.view_index is None else {**values, "view_index": step.view_index}


def _differing(draws: Iterable[Draw]) -> set[tuple[int, str]]:
    """Return the uniforms that differ between draws of one program; compared as text, because 0.0 equals -0.0."""
    first: dict[tuple[int, str], str] = {}
    differ: set[tuple[int, str]] = set()
    for draw in draws:
        for name, value in draw.uniforms.items():
            key, text = (draw.program.glo, name), repr(value)
            if first.setdefault(key, text) != text:
                differ.add(key)
    return differ
