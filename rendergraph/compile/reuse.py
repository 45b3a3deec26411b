"""Which steps of a frame have to run: those whose result is gone, or was made of something that has changed.

What a step leaves in a texture or buffer is a *value*, a version of a resource. It is decided by the values that the
step starts from and by *sources* outside of the graph: views, lights, transforms, parameters, what the CPU wrote.
`Reuse` knows which values the memory holds. A frame needs those that are shown; going back from there, a step runs
where the value that it makes is not there, or where a step that runs before its reader writes over it. So aliased
memory stays as small as it was, and what it still holds is not drawn again.

From one state of the memory and one set of changed sources the same always follows: it is worked out once, and a frame
that is like one before costs a lookup.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TypeAlias

from msgspec import Struct, field

from rendergraph.allocate import ResourcePlan
from rendergraph.schedule.dependencies import Versions, continues, is_filled_by_update
from rendergraph.steps import Step

Value: TypeAlias = tuple[str, int]
"""Resource id and version."""

Source: TypeAlias = "str | tuple[object, ...]"
"""A block of the scene or of the frame, or `("view", table)`, `("step", key)` for parameters, `("buffer", id)`, …"""

_Slot: TypeAlias = int | str  # a physical, by index; a history, whose two take turns, by its id
_State: TypeAlias = frozenset[tuple[_Slot, Value]]

_MOST_KNOWN = 512
"""Moves from state to state that are remembered."""


class _StepState(Struct, frozen=True):
    """What a step starts from and what it leaves, and where that lies."""

    needs: tuple[tuple[_Slot, Value], ...]
    leaves: tuple[tuple[_Slot, Value], ...]


class Reuse(Struct, eq=False, dict=True):
    """What of a plan has to run, frame after frame.

    Attributes:
        step_sources: the sources of each step besides other steps; called when a second frame is drawn.
    """

    plan: ResourcePlan
    step_sources: Callable[[], Sequence[frozenset[Source]]]
    _state: _State | None = None
    _complete: bool = False
    _known: dict[tuple[_State, frozenset[Source], bool], tuple[tuple[int, ...], _State]] = field(default_factory=dict)

    def forget(self) -> None:
        """Nothing is there any more."""
        self._state, self._complete = None, False

    def choose(self, changed: frozenset[Source], repeats: bool = False) -> tuple[int, ...] | None:
        """The positions of the steps that the next frame runs, in order, except for kept values; None for all steps.

        `changed` are the sources that have changed since the last frame was chosen. A frame that `repeats` that one
        finds the same in history, and leaves its own history where that one has.
        """
        if not self._complete:
            self._state, self._complete = None, True
            return None
        if self._state is None:  # all has run once; what that leaves is asked for now that there is a second frame
            self._state = frozenset(self._missing(set(range(len(self._step_states))), {})[1].items())
        key = self._state, changed, repeats
        if key not in self._known:
            if len(self._known) >= _MOST_KNOWN:
                self._known.clear()
            self._known[key] = self._chosen(*key)
        positions, self._state = self._known[key]
        return positions

    def _chosen(self, state: _State, changed: frozenset[Source], repeats: bool) -> tuple[tuple[int, ...], _State]:
        stale = self._stale(changed, self._refilled if repeats else self._refilled | self._looking_back)
        held: dict[_Slot, Value] = {
            slot: value
            for slot, value in state
            if (repeats or isinstance(slot, int)) and self._makers[value] not in stale
        }  # a history's two textures have changed places unless the frame repeats the one before
        run = self._back_from_goals(held)
        while True:
            missing, after = self._missing(run, held)
            if not missing:
                return tuple(sorted(run)), frozenset(after.items())
            run |= {self._makers[value] for _, value in missing}

    def _back_from_goals(self, held: Mapping[_Slot, Value]) -> set[int]:
        """The steps that make what is shown, as far as it is not held, and all that these start from."""
        run: set[int] = set()
        wanted = [value for slot, value in self._goals if held.get(slot) != value]
        while wanted:
            position = self._makers[wanted.pop()]
            if position not in run:
                run.add(position)
                wanted += [value for slot, value in self._step_states[position].needs if held.get(slot) != value]
        return run

    def _missing(
        self, run: set[int], held: Mapping[_Slot, Value]
    ) -> tuple[list[tuple[_Slot, Value]], dict[_Slot, Value]]:
        """What a step of these does not find where it should be, and else what the frame leaves."""
        now = dict(held)
        for position in sorted(run):
            touched = self._step_states[position]
            if missing := [(slot, value) for slot, value in touched.needs if now.get(slot) != value]:
                return missing, now
            now.update(touched.leaves)
        return [(slot, value) for slot, value in self._goals if now.get(slot) != value], now

    def _stale(self, changed: frozenset[Source], always: set[int]) -> set[int]:
        """The steps whose values are no longer what they would make; those in `always` see others in each frame."""
        stale: set[int] = set()
        for position, touched in enumerate(self._step_states):
            again = position in always or not changed.isdisjoint(self._sources[position])
            if again or any(self._makers[value] in stale for _, value in touched.needs):
                stale.add(position)
        return stale

    @cached_property
    def _sources(self) -> Sequence[frozenset[Source]]:
        return self.step_sources()

    @cached_property
    def _versions(self) -> Versions:
        return Versions.of(self.plan.schedule.steps)

    @cached_property
    def _makers(self) -> dict[Value, int]:
        steps = enumerate(self.plan.schedule.steps)
        return {(write.resource, write.version): at for at, step in steps for write in step.writes}

    @cached_property
    def _step_states(self) -> list[_StepState]:
        return [self._of(step) for step in self.plan.schedule.steps]

    @cached_property
    def _goals(self) -> list[tuple[_Slot, Value]]:
        """What must be there at the end of a frame: what is shown, and what the next one remembers."""
        shown = set(self.plan.schedule.outputs.values())
        shown |= {id for id in self._versions.writers if self.plan.resources[id].role == "history"}
        return [self._at(id, last) for id in sorted(shown) if (last := self._last(id)) is not None and self._moves(id)]

    @cached_property
    def _looking_back(self) -> set[int]:
        """Steps that read history."""
        steps = enumerate(self.plan.schedule.steps)
        return {at for at, step in steps if any(read.previous for read in step.all_reads)}

    @cached_property
    def _refilled(self) -> set[int]:
        """Steps that touch buffers which the CPU fills before steps write them."""
        filled = {
            id
            for id in self._versions.writers
            if is_filled_by_update(id, self.plan.resources[id], self._versions) and self._moves(id)
        }
        return {
            at
            for at, step in enumerate(self.plan.schedule.steps)
            if any(read.resource in filled for read in step.all_reads)
            or any(write.resource in filled for write in step.writes)
        }

    def _of(self, step: Step) -> _StepState:
        needs: dict[tuple[_Slot, Value], None] = {}
        for read in step.all_reads:
            version = self._before(read.resource, read.version + 1)
            if version is not None and not read.previous and self._moves(read.resource):
                needs[self._at(read.resource, version)] = None
        for write in step.writes:
            if not self._moves(write.resource):
                continue
            version = self._before(write.resource, write.version)
            if version is not None and continues(step, write, self.plan.resources[write.resource]):
                needs[self._at(write.resource, version)] = None
        leaves = [self._at(write.resource, write.version) for write in step.writes if self._moves(write.resource)]
        # Layers that a step writes at once are versions after each other: what it makes itself it does not wait for.
        return _StepState(tuple(needs.keys() - set(leaves)), tuple(leaves))

    def _moves(self, id: str) -> bool:
        """Whether a resource is made anew in a frame, unlike what is kept or the scene's."""
        return self.plan.resources[id].role not in ("kept", "scene")

    def _last(self, id: str) -> int | None:
        return next(reversed(self._versions.writers.get(id, {})), None)

    def _before(self, id: str, version: int) -> int | None:
        """The last version below this one that a step makes; None where none does."""
        made = list(self._versions.writers.get(id, ()))
        found = bisect_right(made, version - 1)
        return made[found - 1] if found else None

    def _at(self, id: str, version: int) -> tuple[_Slot, Value]:
        history = self.plan.resources[id].role == "history"
        return (id if history else self.plan.placement[id][0]), (id, version)
