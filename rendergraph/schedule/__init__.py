"""Steps to Schedule: what runs, in which order, and why.

What is minimised is what is allocated: the bytes of a pool of textures shared within a texel class, then the peak of
live bytes. The least peak over all orders is found on its own and reported beside it (`lower_bound_bytes`, `proven`),
as what a heap of bytes could reach. So an order above that peak is taken only where it allocates less.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING

from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph.errors import InputError, Problem
from rendergraph.expand import Expansion
from rendergraph.schedule.dependencies import (
    StepKey,
    Turns,
    Versions,
    Waits,
    contributing,
    dependencies,
    history_copies,
    in_turn,
    readers_first,
)
from rendergraph.schedule.model import Cost, Model, alive_all_frame
from rendergraph.schedule.reasons import culled_reasons, order_reasons, step_names
from rendergraph.schedule.seeds import program_order, random_order, seeds
from rendergraph.steps import MOST_STEPS, Resource, Step

if TYPE_CHECKING:
    import networkx as nx

# What a second of budget buys. Counts, so that a slow machine comes to the same schedule as a fast one, only later.
MOVES_PER_SECOND = 150_000
TOUCHES_PER_SECOND = 100_000
# Sets of steps are bit masks: beyond this the search would copy more than it decides.
MOST_SEARCHED = 1_000
MOST_IN_TURN = 4
"""Histories of which each set is tried as those that take a second texture: 16 sets. Of more none or all do."""


class Schedule(Struct, frozen=True, dict=True):
    """Steps culled and ordered.

    Attributes:
        steps: the steps that run, in order.
        resources: the resources they touch, by id.
        wanted: as in `Expansion`: output name to resource id.
        culled: node id to the reason why none of its steps runs.
        peak_bytes: the most bytes of live resources at any step, in this order.
        peak_node: the node whose step is the peak.
        least_peak_bytes: the least peak of an order that was found; this one may have a higher, as it allocates less.
        lower_bound_bytes: no legal order has a lower peak than this.
        whole_frame: ids of the resources that keep their memory for the whole frame: history, kept values, and buffers
            that the CPU fills before the first step.
        waits: step key to the steps it waits for, with the resource that is the reason and `reads`, `continues` or
            `overwrites`; empty where the schedule was made by hand.
        model: the same in numbers; None where the schedule was made by hand.
        chosen: what picked the order where it was not memory: `in the program's order`.
    """

    steps: tuple[Step, ...]
    resources: Mapping[str, Resource]
    wanted: Mapping[str, str]
    culled: Mapping[str, str]
    peak_bytes: int
    peak_node: str | None
    least_peak_bytes: int
    lower_bound_bytes: int
    whole_frame: frozenset[str] = frozenset()
    waits: Waits = field(default_factory=dict)
    model: Model | None = None
    chosen: str | None = None

    @property
    def proven(self) -> bool:
        """Whether the least peak that was found is the least of all legal orders."""
        return self.least_peak_bytes == self.lower_bound_bytes

    @cached_property
    def shown(self) -> frozenset[str]:
        """Ids of the resources that keep their memory from their first write to the frame's end."""
        return frozenset(self.wanted.values()) - self.whole_frame

    @cached_property
    def reasons(self) -> Mapping[StepKey, str]:
        """Step key to why it stands where it stands."""
        if self.model is None:
            return {}
        number_of = {step.key: number for number, step in enumerate(self.model.steps)}
        return order_reasons(self.model, [number_of[step.key] for step in self.steps], self.chosen)

    @cached_property
    def history_copies(self) -> Mapping[str, int]:
        """How many textures each history takes: one where it is read for the last time before it is written."""
        return history_copies(self.steps, self.resources)

    @cached_property
    def dependencies(self) -> nx.DiGraph[StepKey]:
        """The same as a networkx graph: an edge from what must run earlier, with `resource` and `why`."""
        import networkx as nx  # takes longer than scheduling

        dag: nx.DiGraph[StepKey] = nx.DiGraph()
        dag.add_nodes_from(self.waits)
        for step, found in self.waits.items():
            dag.add_edges_from((earlier, step, {"resource": r, "why": why}) for earlier, (r, why) in found.items())
        return dag


def schedule(
    expansion: Expansion, *, budget_s: float = 1.0, shuffle: int | None = None, keep_order: bool = False
) -> Schedule:
    """Cull the steps nothing wanted needs and put the rest in the order that allocates least.

    The result depends on links, ports and sizes alone: not on the order of nodes or keys in a file, nor on the machine.

    Args:
        expansion: what the nodes recorded.
        budget_s: how long to search, in seconds of an ordinary machine; counted in steps tried, not by a clock. Once
            for each set of histories that could take a second texture, where that is not decided without.
        shuffle: seed of a random legal order instead, for tests.
        keep_order: the program's order instead, for debugging; where both are given this one counts.

    Raises:
        InputError: the steps have no legal order, or read what nothing has written (RG601 to RG606).
    """
    if len(expansion.steps) > MOST_STEPS:
        text = f"the pipeline has {len(expansion.steps)} steps, more than {MOST_STEPS}; use fewer nodes or lower counts"
        raise InputError(Problem("RG606", text))
    versions = Versions.of(expansion.steps)
    kept = contributing(expansion.steps, expansion.resources, expansion.wanted, versions, expansion.idle)
    touched = {read.resource for step in kept for read in step.all_reads}
    touched |= {write.resource for step in kept for write in step.writes}
    shown = set(expansion.wanted.values())
    resources = {id: expansion.resources[id] for id in sorted(expansion.resources) if id in touched or id in shown}
    kept_versions = Versions.of(kept) if len(kept) < len(expansion.steps) else versions
    waits = dependencies(kept, kept_versions)
    sinks = _sinks(expansion, kept, versions)
    whole_frame = {id: resources[id].bytes for id in alive_all_frame(resources, kept_versions)}

    models: dict[Hashable, tuple[Waits, Model]] = {}  # with what is waited for, so that nothing else gets its id

    def model_of(waits: Waits, copies: Mapping[str, int]) -> Model:
        key = id(waits), frozenset(copies.items())
        if key not in models:
            alive = whole_frame | {id: resources[id].desc.bytes * number for id, number in copies.items()}
            models[key] = waits, Model.of(waits, kept, resources, alive, shown, sinks)
        return models[key][1]

    each = [_least(model_of, waits, turns, resources, budget_s) for turns in readers_first(waits, kept, kept_versions)]
    found = min(each, key=lambda found: (found.cost.pool, found.cost.peak))
    found = replace(found, least=min(one.least for one in each), bound=min(one.bound for one in each))
    order, chosen = found.order, None
    if keep_order or shuffle is not None:
        model = model_of(waits, {})
        if shuffle is None or keep_order:
            rank = {step.key: number for number, step in enumerate(expansion.steps)}
            numbers, chosen = program_order(model, [rank[step.key] for step in model.steps]), "in the program's order"
        else:
            numbers, chosen = random_order(model, shuffle), f"drawn by seed {shuffle}"
        order = tuple(model.steps[number] for number in numbers)
    model = model_of(found.waits if chosen is None else waits, history_copies(order, resources))
    number_of = {step.key: number for number, step in enumerate(model.steps)}
    numbers = [number_of[step.key] for step in order]
    peak, peak_step = model.peak(numbers)
    return Schedule(
        steps=order,
        resources=resources,
        wanted=dict(expansion.wanted),
        culled={**culled_reasons(expansion.steps, kept, versions), **expansion.idle},
        peak_bytes=peak,
        peak_node=None if peak_step is None else model.steps[peak_step].node,
        least_peak_bytes=found.least,
        lower_bound_bytes=found.bound,
        whole_frame=frozenset(whole_frame),
        waits=waits,
        model=model,
        chosen=chosen,
    )


def _sinks(expansion: Expansion, kept: Sequence[Step], versions: Versions) -> list[Step]:
    """The last writers of what is shown, by output name, then of what the next frame reads."""
    ids = [expansion.wanted[name] for name in sorted(expansion.wanted)]
    ids += sorted({read.resource for step in kept for read in step.all_reads if read.previous})
    finals = [versions.final(id) for id in ids]
    return [step for step in finals if step is not None]


class _Found(Struct, frozen=True):
    """An order that allocates little, what it waited for, the least peak found, and one that no order is below."""

    cost: Cost
    order: tuple[Step, ...]
    waits: Waits
    least: int
    bound: int


def _least(
    model_of: Callable[[Waits, Mapping[str, int]], Model],
    waits: Waits,
    turns: Turns,
    resources: Mapping[str, Resource],
    budget_s: float,
) -> _Found:
    """The best order: one in which histories are read before they are written, or one where some take a second texture.

    Args:
        model_of: the steps with these waits, and so many textures of each history.
        waits: what the steps wait for.
        turns: the histories that can be read before they are written.
        resources: what the steps touch.
        budget_s: see `schedule`.
    """
    early = in_turn(waits, turns)
    single = history_copies(model_of(early, {}).steps, resources)
    first = _optimise(model_of(early, single), early, budget_s)
    if not turns:
        return first
    # Every other order takes a second texture of one of them at least, of which only the smallest is sure.
    more = {id: resources[id].desc.bytes for id in turns}
    pool, peak = [bound + min(more.values()) for bound in model_of(waits, single).bounds()]
    if first.cost.pool <= pool and first.least <= peak:
        return first
    every = len(turns) <= MOST_IN_TURN
    found = [first]
    for count in range(1, len(turns) + 1) if every else (len(turns),):
        for twice in combinations(turns, count):
            some = in_turn(waits, {id: turn for id, turn in turns.items() if id not in twice})
            found.append(_optimise(model_of(some, single | dict.fromkeys(twice, 2)), some, budget_s))
    best = min(found, key=lambda one: (one.cost.pool, one.cost.peak))
    unsure = 0 if every else sum(more.values()) - min(more.values())
    bound = min(first.bound, *[one.bound - unsure for one in found[1:]])
    return replace(best, least=min(one.least for one in found), bound=bound)


def _optimise(model: Model, waits: Waits, budget_s: float) -> _Found:
    """An order that allocates little, the least peak found, and a peak that no order is below."""
    key = model.content, budget_s
    if key not in _orders:
        if len(_orders) >= _MOST_ORDERS:
            _orders.clear()
        _orders[key] = _ordered(model, budget_s)
    cost, order, least, bound = _orders[key]
    return _Found(cost, tuple(model.steps[step] for step in order), waits, least, bound)


_MOST_ORDERS = 256
_orders: dict[Hashable, tuple[Cost, Sequence[int], int, int]] = {}
"""What was found for a model before: most changes of a pipeline leave the order what it was."""


def _ordered(model: Model, budget_s: float) -> tuple[Cost, Sequence[int], int, int]:
    """Cost, numbers of the steps, the least peak found, the bound."""
    if not len(model):
        return Cost(model.constant, model.constant, 0), (), model.constant, model.constant
    pool_bound, bound = model.bounds()
    orders = []
    for order in seeds(model):
        orders.append((model.cost(order), order))
        if (orders[-1][0].pool, orders[-1][0].peak) == (pool_bound, bound):
            break
    least = min(cost.peak for cost, _ in orders)
    if least > bound and len(model) <= MOST_SEARCHED:
        from rendergraph.schedule.search import search  # most pipelines are decided by now

        found = search(model, below=least, bound=bound, budget=int(budget_s * MOVES_PER_SECOND))
        bound = found.bound
        if found.order is not None:
            orders.append((model.cost(found.order), found.order))
            least = orders[-1][0].peak
    # Equal costs go to the order found first: the reading order wherever nothing is better.
    cost, best = min(orders, key=lambda pair: (pair[0].pool, pair[0].peak))
    if cost.pool > pool_bound and len(model) <= MOST_SEARCHED:
        from rendergraph.schedule.improve import improve  # as above

        better, improved = improve(model, best, pool_bound=pool_bound, budget=int(budget_s * TOUCHES_PER_SECOND))
        least = min(least, improved.peak)
        if (improved.pool, improved.peak) < (cost.pool, cost.peak):
            cost, best = improved, better
    return cost, best, least, bound


__all__ = ["Schedule", "schedule", "step_names"]
