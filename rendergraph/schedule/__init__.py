"""Steps to Schedule: what runs, in which order, and why.

What is minimised is what is allocated: the bytes of a pool of textures shared within a texel class, then the peak of
live bytes. The least peak over all orders is found on its own and reported beside it (`lower_bound_bytes`, `proven`),
as what a heap of bytes could reach. So an order above that peak is taken only where it allocates less.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from rendergraph.errors import InputError, Problem
from rendergraph.expand import Expansion
from rendergraph.schedule.dependencies import StepKey, Versions, Waits, contributing, dependencies, touched_ids
from rendergraph.schedule.improve import improve
from rendergraph.schedule.model import Model, alive_all_frame
from rendergraph.schedule.reasons import culled_reasons, order_reasons, step_names
from rendergraph.schedule.search import search
from rendergraph.schedule.seeds import program_order, random_order, seeds
from rendergraph.steps import Resource, Step

if TYPE_CHECKING:
    import networkx as nx

MOST_STEPS = 10_000
# What a second of budget buys. Counts, so that a slow machine comes to the same schedule as a fast one, only later.
MOVES_PER_SECOND = 150_000
TOUCHES_PER_SECOND = 100_000
# Sets of steps are bit masks: beyond this the search would copy more than it decides.
MOST_SEARCHED = 1_000


@dataclass(frozen=True)
class Schedule:
    """Steps culled and ordered.

    Attributes:
        steps: the steps that run, in order.
        resources: the resources they touch, by id.
        wanted: as in `Expansion`: output name to resource id.
        culled: node id to the reason why none of its steps runs.
        peak_bytes: the most bytes of live resources at any step, in this order.
        peak_node: the node whose step is the peak.
        lower_bound_bytes: the least peak over all legal orders that was found.
        proven: no legal order has a lower peak.
        reasons: step key to why it stands where it stands.
        whole_frame: ids of the resources that keep their memory for the whole frame: outputs, history, kept values,
            and buffers that the CPU fills before the first step.
        waits: step key to the steps it waits for, with the resource that is the reason and `reads`, `continues` or
            `overwrites`; empty where the schedule was made by hand.
    """

    steps: tuple[Step, ...]
    resources: Mapping[str, Resource]
    wanted: Mapping[str, str]
    culled: Mapping[str, str]
    peak_bytes: int
    peak_node: str | None
    lower_bound_bytes: int
    proven: bool
    reasons: Mapping[tuple[str, int], str] = field(default_factory=dict)
    whole_frame: frozenset[str] = frozenset()
    waits: Waits = field(default_factory=dict, compare=False, repr=False)

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
        budget_s: how long to search, in seconds of an ordinary machine; counted in steps tried, not by a clock.
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
    touched = {id for step in kept for id in touched_ids(step)}
    shown = set(expansion.wanted.values())
    resources = {id: expansion.resources[id] for id in sorted(expansion.resources) if id in touched or id in shown}
    kept_versions = Versions.of(kept)
    waits = dependencies(kept, kept_versions)
    whole_frame = alive_all_frame(resources, expansion.wanted, kept_versions)
    model = Model.of(waits, kept, resources, whole_frame, _sinks(expansion, kept, versions))

    best, least_peak, proven = _optimise(model, budget_s)
    chosen = None
    if keep_order:
        rank = {step.key: number for number, step in enumerate(expansion.steps)}
        best, chosen = program_order(model, [rank[step.key] for step in model.steps]), "in the program's order"
    elif shuffle is not None:
        best, chosen = random_order(model, shuffle), f"drawn by seed {shuffle}"
    peak, peak_step = model.peak(best)
    return Schedule(
        steps=tuple(model.steps[step] for step in best),
        resources=resources,
        wanted=dict(expansion.wanted),
        culled={**culled_reasons(expansion.steps, kept, versions), **expansion.idle},
        peak_bytes=peak,
        peak_node=None if peak_step is None else model.steps[peak_step].node,
        lower_bound_bytes=least_peak,
        proven=proven,
        reasons=order_reasons(model, best, chosen),
        whole_frame=frozenset(whole_frame),
        waits=waits,
    )


def _sinks(expansion: Expansion, kept: Sequence[Step], versions: Versions) -> list[Step]:
    """The last writers of what is shown, by output name, then of what the next frame reads."""
    ids = [expansion.wanted[name] for name in sorted(expansion.wanted)]
    ids += sorted({read.resource for step in kept for read in step.all_reads if read.previous})
    finals = [versions.final(id) for id in ids]
    return [step for step in finals if step is not None]


def _optimise(model: Model, budget_s: float) -> tuple[list[int], int, bool]:
    """An order that allocates little, the least peak found, and whether that is proven."""
    if not len(model):
        return [], model.constant, True
    pool_bound, peak_bound = model.bounds()
    orders = []
    for order in seeds(model):
        orders.append((model.cost(order), order))
        if (orders[-1][0].pool, orders[-1][0].peak) == (pool_bound, peak_bound):
            return order, peak_bound, True
    least_peak = min(cost.peak for cost, _ in orders)
    proven = least_peak == peak_bound
    if not proven and len(model) <= MOST_SEARCHED:
        found = search(model, below=least_peak, bound=peak_bound, budget=int(budget_s * MOVES_PER_SECOND))
        proven = found.proven
        if found.order is not None:
            orders.append((model.cost(found.order), found.order))
            least_peak = orders[-1][0].peak
    # Equal costs go to the order found first: the reading order wherever nothing is better.
    cost, best = min(orders, key=lambda pair: (pair[0].pool, pair[0].peak))
    if cost.pool > pool_bound and len(model) <= MOST_SEARCHED:
        better, improved = improve(model, best, pool_bound=pool_bound, budget=int(budget_s * TOUCHES_PER_SECOND))
        least_peak = min(least_peak, improved.peak)
        if (improved.pool, improved.peak) < (cost.pool, cost.peak):
            best = better
    return best, least_peak, proven


__all__ = ["Schedule", "schedule", "step_names"]
