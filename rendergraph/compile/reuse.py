"""Choose the steps of a frame that must run: those whose result is lost, or depends on something that has changed.

The result of a step in a texture or buffer is a *value*, a version of a resource. It depends on the values that the
step reads and on *sources* outside the graph: views, lights, transforms, parameters, data that the CPU wrote. `Reuse`
tracks which values the memory holds. A frame needs the values of its outputs; going backwards from these, a step runs
if its value is missing, or if another step overwrites it before it is read. So aliasing still saves memory, and values
that survive in it are not computed again.

The choice depends only on the state of the memory and the set of changed sources. It is computed once for each pair and
then looked up.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TypeAlias

from msgspec import Struct, field

from rendergraph.allocate import ResourcePlan
from rendergraph.schedule.dependencies import Versions, continues, is_filled_by_update, touched_ids
from rendergraph.steps import Step

Value: TypeAlias = tuple[str, int]
"""Resource id and version."""

Source: TypeAlias = "str | tuple[object, ...]"
"""A block of the scene or of the frame, or `("view", table)`, `("step", key)` for parameters, `("buffer", id)`, …"""

_Slot: TypeAlias = int | str  # a physical texture by index; a history, which alternates between two, by its id
_Held: TypeAlias = tuple[_Slot, Value]
_State: TypeAlias = frozenset[_Held]

_MOST_KNOWN = 512
"""Maximum number of cached choices."""


class _StepState(Struct, frozen=True):
    """The values that a step needs and leaves, with their memory slots."""

    needs: tuple[_Held, ...]
    leaves: tuple[_Held, ...]


class Reuse(Struct, eq=False, dict=True):
    """Chooses the steps of a plan that must run in each frame.

    Attributes:
        step_sources: the sources of each step besides other steps; called when a second frame is drawn.
    """

    plan: ResourcePlan
    step_sources: Callable[[], Sequence[frozenset[Source]]]
    _state: _State | None = None
    _complete: bool = False
    _known: dict[tuple[_State, frozenset[Source], bool], tuple[tuple[int, ...], _State]] = field(default_factory=dict)

    def forget(self) -> None:
        """Assume that the memory holds no values."""
        self._state, self._complete = None, False

    def choose(self, changed: frozenset[Source], repeats: bool = False) -> tuple[int, ...] | None:
        """Return the positions of the steps for the next frame, in order, without kept steps; None for all steps.

        `changed` are the sources that have changed since the last call. A frame that `repeats` the last one reads the
        same history, and overwrites the history that the last one wrote.
        """
        if not self._complete:
            self._state, self._complete = None, True
            return None
        if self._state is None:  # all steps have run once; the state is computed only for a second frame
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
        lasting = (pair for pair in state if repeats or isinstance(pair[0], int))  # otherwise histories have swapped
        held = {slot: value for slot, value in lasting if self._makers[value] not in stale}
        run = self._back_from_goals(held)
        while True:
            missing, after = self._missing(run, held)
            if not missing:
                return tuple(sorted(run)), frozenset(after.items())
            run |= {self._makers[value] for _, value in missing}

    def _back_from_goals(self, held: Mapping[_Slot, Value]) -> set[int]:
        """Return the steps that compute missing values of the goals, and all steps that these need."""
        run: set[int] = set()
        wanted = [value for slot, value in self._goals if held.get(slot) != value]
        while wanted:
            position = self._makers[wanted.pop()]
            if position not in run:
                run.add(position)
                wanted += [value for slot, value in self._step_states[position].needs if held.get(slot) != value]
        return run

    def _missing(self, run: set[int], held: Mapping[_Slot, Value]) -> tuple[list[_Held], dict[_Slot, Value]]:
        """Return the values that one of the steps in `run` would miss, and the memory's state at that point."""
        now = dict(held)
        for position in sorted(run):
            touched = self._step_states[position]
            if missing := [(slot, value) for slot, value in touched.needs if now.get(slot) != value]:
                return missing, now
            now.update(touched.leaves)
        return [(slot, value) for slot, value in self._goals if now.get(slot) != value], now

    def _stale(self, changed: frozenset[Source], always: set[int]) -> set[int]:
        """Return the steps whose values are out of date; those in `always` are so in every frame."""
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
    def _goals(self) -> list[_Held]:
        """The values required at the end of a frame: outputs, and history for the next frame."""
        shown, writers = set(self.plan.schedule.outputs.values()), self._versions.writers
        written = [id for id in sorted(writers) if id in shown or self.plan.resources[id].role == "history"]
        return [self._at(id, max(writers[id])) for id in written if self._moves(id)]

    @cached_property
    def _looking_back(self) -> set[int]:
        """Steps that read history."""
        steps = enumerate(self.plan.schedule.steps)
        return {at for at, step in steps if any(read.previous for read in step.all_reads)}

    @cached_property
    def _refilled(self) -> set[int]:
        """Steps that use buffers which the CPU fills before steps write them."""
        resources, versions = self.plan.resources, self._versions
        moving = filter(self._moves, versions.writers)
        filled = {id for id in moving if is_filled_by_update(id, resources[id], versions)}
        steps = enumerate(self.plan.schedule.steps)
        return {at for at, step in steps if not filled.isdisjoint(touched_ids(step))}

    def _of(self, step: Step) -> _StepState:
        writes = [write for write in step.writes if self._moves(write.resource)]
        needs = {(read.resource, read.version + 1) for read in step.all_reads if not read.previous}
        needs |= {(w.resource, w.version) for w in writes if continues(step, w, self.plan.resources[w.resource])}
        held = {
            self._at(id, version)
            for id, below in needs
            if self._moves(id) and (version := self._before(id, below)) is not None
        }
        leaves = [self._at(write.resource, write.version) for write in writes]
        # Layers that a step writes are successive versions, so values that it writes itself are not needed before it.
        return _StepState(tuple(held.difference(leaves)), tuple(leaves))

    def _moves(self, id: str) -> bool:
        """Return whether a resource is computed in each frame, unlike kept ones and those of the scene."""
        return self.plan.resources[id].role not in ("kept", "scene")

    def _before(self, id: str, version: int) -> int | None:
        """Return the last version below this one that a step writes; None if there is none."""
        return max((made for made in self._versions.writers.get(id, ()) if made < version), default=None)

    def _at(self, id: str, version: int) -> _Held:
        history = self.plan.resources[id].role == "history"
        return (id if history else self.plan.placement[id][0]), (id, version)
