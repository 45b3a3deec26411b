"""What compiling yields: draws with their uniforms and state, assembled into a flat list of calls.

Uniforms that all users of a program agree on are written once when the pipeline becomes active; only what differs is
written by each draw. A changed parameter assembles the lists anew: no GL object is made, no shader compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from rendergraph.gl.programs import Program
from rendergraph.gl.state import Pieces, changes
from rendergraph.program import prefix
from rendergraph.schedule.dependencies import StepKey, touched_ids
from rendergraph.steps import Step

if TYPE_CHECKING:
    import moderngl

    from rendergraph.allocate import ResourcePlan
    from rendergraph.compile.memory import Memory
    from rendergraph.compile.views import ViewBuffers
    from rendergraph.gl.device import Device
    from rendergraph.gl.timer import Timer

Call = Callable[[], object]


@dataclass(eq=False)
class Draw:
    """One draw call or dispatch with what must be set before it.

    Attributes:
        program: what runs.
        uniforms: name to value, all that the program may look at.
        state: calls that set the fixed function, None for compute.
        call: the draw itself.
        binds: texture and buffer binds of its own; textures only where the driver's units ran out.
        vertex_array: what `call` draws with, for geometry.
        textures: sampled name to its texture in this parity and its sampler, where that is a plain 2D texture.
    """

    program: Program
    uniforms: dict[str, Any]
    state: Pieces | None
    call: Call
    binds: list[Call] = field(default_factory=list)
    vertex_array: Any = None
    textures: dict[str, tuple[int, int]] = field(default_factory=dict)


@dataclass(eq=False)
class SortedDraws:
    """Draws whose order is the eye's: each part is compiled once, and runs of neighbours are found anew as it moves.

    Attributes:
        parts: what can be drawn together, in any order.
        runs: part number, first command and number of commands, far to near.
        render: draws a run of commands with a part's vertex array.
    """

    parts: list[Draw]
    render: Callable[[int, int, int], object]
    runs: list[tuple[int, int, int]] = field(default_factory=list)
    prepared: list[tuple[Call, ...]] = field(default_factory=list)

    def __call__(self) -> None:
        """Draw all runs."""
        for part, first, count in self.runs:
            for call in self.prepared[part]:
                call()
            self.render(part, first, count)


@dataclass(eq=False)
class CompiledStep:
    """A step of one parity.

    Attributes:
        step: what it came from.
        before: framebuffer, clears.
        draws: in order.
        sorted: draws whose order is the eye's, instead of `draws`.
        after: barriers, poison.
    """

    step: Step
    before: list[Call] = field(default_factory=list)
    draws: list[Draw] = field(default_factory=list)
    sorted: SortedDraws | None = None
    after: list[Call] = field(default_factory=list)

    @property
    def all_draws(self) -> list[Draw]:
        """All draws, however they are ordered."""
        return self.draws + (self.sorted.parts if self.sorted is not None else [])


@dataclass(frozen=True, eq=False)
class Listed:
    """A step as a frame runs it: all its calls, flat, and what measures it.

    What is set before a draw depends on the steps before it, so the calls of another list may differ.
    """

    step: Step
    calls: tuple[Call, ...]
    timer: Timer


@dataclass(eq=False)
class Executable:
    """A compiled pipeline of one size.

    Attributes:
        plan: what it was compiled from.
        memory: its textures.
        views: its view tables on the GPU.
        binds: the calls that bind textures, samplers and blocks, a list a parity.
        steps: compiled steps, a list a parity.
        lists: what the next frame runs, a list a parity; filled by `assemble`.
        due: kept steps that the next frame runs.
        statics: uniform writes that hold for the whole frame.
        sorters: called with the view tables when a view has changed: objects front to back.
        timers: one a step.
        buffers: draw commands.
        vertex_arrays: frees the vertex arrays over the plan's own buffers.
        fresh: `statics` have to be written and everything bound before the next frame.
    """

    device: Device
    plan: ResourcePlan
    memory: Memory
    views: ViewBuffers
    binds: list[list[Call]]
    steps: list[list[CompiledStep]]
    lists: list[list[Listed]] = field(default_factory=list)
    due: set[StepKey] = field(default_factory=set)
    statics: list[Call] = field(default_factory=list)
    sorters: list[Callable[[ViewBuffers], None]] = field(default_factory=list)
    timers: list[Timer] = field(default_factory=list)
    buffers: list[moderngl.Buffer] = field(default_factory=list)
    vertex_arrays: Call = bool
    fresh: bool = True
    _steady: list[list[Listed]] = field(default_factory=list)

    @cached_property
    def kept(self) -> dict[StepKey, Step]:
        """The steps that make what outlives the frame."""
        resources = self.plan.resources
        steps = self.plan.schedule.steps
        return {s.key: s for s in steps if any(resources[write.resource].role == "kept" for write in s.writes)}

    def renew(self) -> None:
        """Let the next frame make all that is kept: nothing has, or what did failed."""
        self.due = set(self.kept)
        self.assemble()

    def done(self) -> None:
        """The kept steps that were due have run: go on without them."""
        if self.due:
            self.due, self.lists = set(), self._steady

    @cached_property
    def reads_frame(self) -> bool:
        """Whether any program looks at the frame block."""
        draws = (draw for step in self.steps[0] for draw in step.all_draws)
        return any("frame_block" in draw.program.blocks for draw in draws)

    def assemble(self) -> None:
        """Make the flat lists of calls from the steps' draws, leaving out what changes nothing."""
        shared = _differing(draw for step in self.steps[0] for draw in step.all_draws)
        self.statics = []
        written: set[tuple[int, str]] = set()

        def writes(draw: Draw) -> list[Call]:
            own: list[Call] = []
            for name, value in draw.uniforms.items():
                key = (draw.program.glo, name)
                if key not in shared and key in written:
                    continue
                write = draw.program.writer(name, value)
                if write is not None:
                    written.add(key)
                    (own if key in shared else self.statics).append(write)
            return own

        def listed(steps: Iterable[CompiledStep], due: Container[StepKey]) -> list[Listed]:
            state: Pieces | None = None
            found: list[Listed] = []
            for compiled, timer in zip(steps, self.timers, strict=True):
                if compiled.step.key in self.kept and compiled.step.key not in due:
                    continue
                calls: list[Call] = list(compiled.before)
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
                found.append(Listed(compiled.step, (*calls, *compiled.after), timer))
            return found

        self.lists = [listed(steps, self.due) for steps in self.steps]
        self._steady = [listed(steps, ()) for steps in self.steps] if self.due else self.lists
        self.fresh = True

    def set_uniforms(self, steps: Iterable[Step]) -> None:
        """Take over changed parameter values; the steps must be the same but for their uniforms."""
        values: Mapping[StepKey, Step] = {step.key: step for step in steps}
        changed = {key for key, step in self.kept.items() if step_uniforms(step) != step_uniforms(values[key])}
        self.due = self._with_dependents(self.due | changed)
        for compiled in (c for steps_of in self.steps for c in steps_of):
            step = values[compiled.step.key]
            compiled.step = step
            if step.key in self.kept:
                self.kept[step.key] = step
            for draw in compiled.all_draws:
                draw.uniforms.update(step_uniforms(step))
        self.assemble()

    def _with_dependents(self, due: set[StepKey]) -> set[StepKey]:
        """The steps that have to run again where these do.

        Those are all that make one of their textures, as what each of them found there is gone, all that read one, and
        whoever makes what they read in a state before the last.
        """
        final: dict[str, int] = {}
        for step in self.kept.values():
            final |= {write.resource: max(write.version, final.get(write.resource, 0)) for write in step.writes}
        while True:
            steps = [self.kept[key] for key in due]
            again = {write.resource for step in steps for write in step.writes}
            again |= {read.resource for step in steps for read in step.all_reads if read.version < final[read.resource]}
            more = {key for key, step in self.kept.items() if not again.isdisjoint(touched_ids(step))}
            if more <= due:
                return due
            due = due | more

    def release(self) -> None:
        """Free what it owns; programs and scenes are the session's."""
        self.vertex_arrays()
        self.memory.release()
        self.views.release()
        for buffer in self.buffers:
            buffer.release()
        for timer in self.timers:
            timer.release()
        self.timers.clear()


def step_uniforms(step: Step) -> dict[str, Any]:
    """A step's uniforms and, under their prefixed names, those of the functions it calls."""
    values: dict[str, Any] = dict(step.uniforms)
    for function in step.functions:
        values |= {prefix(function.node) + name: value for name, value in function.uniforms}
    if step.view_index is not None:
        values["view_index"] = step.view_index
    return values


def _differing(draws: Iterable[Draw]) -> set[tuple[int, str]]:
    """Uniforms that two draws of one program want to be different."""
    first: dict[tuple[int, str], Any] = {}
    differ: set[tuple[int, str]] = set()
    for draw in draws:
        for name, value in draw.uniforms.items():
            key = (draw.program.glo, name)
            if first.setdefault(key, value) != value:
                differ.add(key)
    return differ
