"""Schedule steps: which steps run, in which order, and why.

The order minimises allocated memory: the bytes of a pool of textures shared within a texel class, then the peak of live
bytes. The least peak over all orders is searched separately and reported as well (`lower_bound_bytes`, `proven`): a
heap of bytes could reach it. So an order with a higher peak is chosen only if it allocates less.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from functools import cached_property
from heapq import heappop, heappush

from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph.errors import InputError, Problem
from rendergraph.expand import Expansion
from rendergraph.formatting import format_bytes
from rendergraph.schedule.dependencies import (
    ReadFirst,
    StepKey,
    Versions,
    Waits,
    contributing,
    dependencies,
    history_copies,
    read_first,
    read_first_choices,
)
from rendergraph.schedule.model import Cost, Frame, Model, alive_all_frame
from rendergraph.schedule.search import improve, random_order, search, seeds
from rendergraph.steps import MOST_STEPS, Resource, Step

# Resources visited per second of budget: a count, so that slow and fast machines find the same schedule.
LOOKS_PER_SECOND = 1_000_000
# Sets of steps are bit masks: beyond this size, copying them dominates the search.
MOST_SEARCHED = 1_000


class Schedule(Struct, frozen=True, dict=True):
    """The steps that run, in order.

    Attributes:
        outputs: as in `Expansion`: output name to resource id.
        culled: node id to the reason why none of its steps runs.
        peak_bytes: the maximum of live bytes over the steps in this order.
        least_peak_bytes: the least peak of any order found; this order's may be higher, because it allocates less.
        lower_bound_bytes: no legal order has a lower peak.
        whole_frame: ids of the resources that keep their memory for the whole frame: history, kept values, and buffers
            that the CPU fills before the first step.
        waits: step key to the steps that it waits for, with the resource as reason and `reads`, `continues` or
            `overwrites`; empty for a schedule written by hand.
        model: the same as integers; None for a schedule written by hand.
        shuffle: the seed of an order that was drawn instead of chosen by memory.
    """

    steps: tuple[Step, ...]
    resources: Mapping[str, Resource]
    outputs: Mapping[str, str]
    culled: Mapping[str, str]
    peak_bytes: int
    peak_node: str | None
    least_peak_bytes: int
    lower_bound_bytes: int
    whole_frame: frozenset[str] = frozenset()
    waits: Waits = field(default_factory=dict)
    model: Model | None = None
    shuffle: int | None = None

    @property
    def proven(self) -> bool:
        """Whether the least peak found is proven to be the minimum over all legal orders."""
        return self.least_peak_bytes == self.lower_bound_bytes

    @cached_property
    def shown(self) -> frozenset[str]:
        """Ids of the resources that keep their memory from their first write to the end of the frame."""
        return frozenset(self.outputs.values()) - self.whole_frame

    @cached_property
    def reasons(self) -> Mapping[StepKey, str]:
        """Step key to the reason for its position."""
        if self.model is None:
            return {}
        number_of = {step.key: number for number, step in enumerate(self.model.steps)}
        return order_reasons(self.model, [number_of[step.key] for step in self.steps], self.shuffle)

    @cached_property
    def history_copies(self) -> Mapping[str, int]:
        """Number of textures of each history: one if its last read precedes its first write."""
        return history_copies(self.steps, self.resources)


def schedule(expansion: Expansion, *, budget_s: float = 0.5, shuffle: int | None = None) -> Schedule:
    """Cull the steps that no output needs and order the rest to allocate the least memory.

    The result depends only on links, ports and sizes, not on the order of nodes or keys in a file or on the machine.

    Args:
        budget_s: limit of the search in seconds of a typical machine; it counts visited resources, not time.
        shuffle: seed of a random legal order instead, for tests.
    """
    if len(expansion.steps) > MOST_STEPS:
        (node, most), *_ = Counter(step.node for step in expansion.steps).most_common(1)
        text = f"the pipeline has {len(expansion.steps)} steps, more than {MOST_STEPS}; {most} of them belong to node "
        text += f"'{node}': lower its counts, or use another node if it records a step for each light"
        raise InputError(Problem("RG606", text))
    versions = Versions.of(expansion.steps)
    kept = contributing(expansion.steps, expansion.resources, expansion.outputs, versions, expansion.idle)
    touched = {read.resource for step in kept for read in step.all_reads}
    touched |= {write.resource for step in kept for write in step.writes}
    shown = set(expansion.outputs.values())
    resources = {id: expansion.resources[id] for id in sorted(expansion.resources) if id in touched or id in shown}
    kept_versions = Versions.of(kept) if len(kept) < len(expansion.steps) else versions
    waits = dependencies(kept, kept_versions, expansion.overwritten)
    sinks = _sinks(expansion, kept, versions)
    whole_frame = frozenset(alive_all_frame(resources, kept_versions))
    frame = Frame(kept, resources, shown, whole_frame, sinks)
    found = _least(frame, waits, read_first_choices(waits, kept, kept_versions, resources), budget_s)
    model, order = found.model, found.order
    if shuffle is not None:
        model = Model.of(frame, waits)
        order = random_order(model, shuffle)
    steps = tuple(model.steps[number] for number in order)
    model = replace(model, constant=frame.constant(history_copies(steps, resources)))
    peak, peak_step = model.peak(order)
    return Schedule(
        steps=steps,
        resources=resources,
        outputs=dict(expansion.outputs),
        culled={**culled_reasons(expansion.steps, kept, versions), **expansion.idle},
        peak_bytes=peak,
        peak_node=None if peak_step is None else model.steps[peak_step].node,
        least_peak_bytes=found.least,
        lower_bound_bytes=found.bound,
        whole_frame=whole_frame,
        waits=waits,
        model=model,
        shuffle=shuffle,
    )


def _sinks(expansion: Expansion, kept: Sequence[Step], versions: Versions) -> list[Step]:
    """Return the last writers of the outputs, by output name, then those of resources that the next frame reads."""
    ids = [expansion.outputs[name] for name in sorted(expansion.outputs)]
    ids += sorted({read.resource for step in kept for read in step.all_reads if read.previous})
    finals = [versions.final(id) for id in ids]
    return [step for step in finals if step is not None]


class _Ordering(Struct, frozen=True):
    """An order that allocates little, its cost, the least peak found, and a lower bound on the peak."""

    model: Model
    order: Sequence[int]
    cost: Cost
    least: int
    bound: int


def _least(frame: Frame, waits: Waits, first: ReadFirst, budget_s: float) -> _Ordering:
    """Return the best order over all choices of histories to read before they are written.

    Other histories need a second texture. A choice is skipped if even the lower bound on its memory is no better than
    the best order found.
    """
    base = Model.of(frame, waits)
    single = history_copies(base.steps, frame.resources) | dict.fromkeys(first.turns, 1)
    base = replace(base, constant=frame.constant(single))
    sizes = {id: frame.resources[id].desc.bytes for id in first.turns}
    pool_floor, peak_floor = base.bounds() if len(first.choices) > 1 else (0, 0)
    found: list[_Ordering] = []
    for early in first.choices:
        late = [id for id in first.turns if id not in early]
        extra = sum(sizes[id] for id in late)
        if found:
            best, least = min(one.cost.pool for one in found), min(one.least for one in found)
            if best <= pool_floor + extra and least <= peak_floor + extra:
                continue
        model = Model.of(frame, read_first(waits, {id: first.turns[id] for id in early})) if early else base
        constant = frame.constant(single | dict.fromkeys(late, 2))
        found.append(_optimise(replace(model, constant=constant), budget_s / len(first.choices)))
    bound = min(one.bound for one in found)
    if not first.exhaustive:
        bound = min(bound, peak_floor + min(sizes.values()))
    best_found = min(found, key=lambda one: one.cost[:2])
    return replace(best_found, least=min(one.least for one in found), bound=bound)


_MOST_ORDERS = 256
_orders: dict[Hashable, tuple[Sequence[int], Cost, int, int]] = {}
"""Results by model: most changes of a pipeline do not change the order."""


def _optimise(model: Model, budget_s: float) -> _Ordering:
    key = model.content, budget_s
    if key not in _orders:
        if len(_orders) >= _MOST_ORDERS:
            _orders.clear()
        _orders[key] = _ordered(model, int(budget_s * LOOKS_PER_SECOND))
    return _Ordering(model, *_orders[key])


def _ordered(model: Model, budget: int) -> tuple[Sequence[int], Cost, int, int]:
    """Return the steps' numbers in order, the cost, the least peak found and the bound."""
    if not len(model):
        return (), Cost(model.constant, model.constant, 0), model.constant, model.constant
    pool_bound, bound = model.bounds()
    orders: list[tuple[Cost, Sequence[int]]] = []
    for order in seeds(model):
        orders.append((model.cost(order), order))
        if orders[-1][0][:2] == (pool_bound, bound):
            break
    least = min(cost.peak for cost, _ in orders)
    if least > bound and len(model) <= MOST_SEARCHED:
        better, bound = search(model, below=least, bound=bound, budget=budget)
        if better is not None:
            orders.append((model.cost(better), better))
            least = orders[-1][0].peak
    # For equal costs the order found first wins, which is the reading order.
    cost, best = min(orders, key=lambda pair: pair[0][:2])
    if cost.pool > pool_bound and len(model) <= MOST_SEARCHED:
        better, improved = improve(model, best, pool_bound=pool_bound, budget=budget // 5)
        least = min(least, improved.peak)
        if improved[:2] < cost[:2]:
            cost, best = improved, better
    return best, cost, least, bound


def step_names(steps: Sequence[Step]) -> dict[tuple[str, int], str]:
    """Return step key to name: the node's id, with number and label if it has several steps; a copy's label."""
    several = {step.node for step in steps if step.index > 0 and step.kind != "copy"}
    names = {
        step.key: f"{step.node}[{f'{step.index} {step.label}'.rstrip()}]" if step.node in several else step.node
        for step in steps
    }
    return names | {step.key: step.label for step in steps if step.kind == "copy"}


def order_reasons(model: Model, order: Sequence[int], shuffle: int | None) -> dict[tuple[str, int], str]:
    """Return by step key the reason for its position; `shuffle` is the seed of an order that was drawn."""
    names = step_names(model.steps)
    place = {step: number for number, step in enumerate(order)}
    left = list(model.toucher_count)
    missing = [len(steps) for steps in model.before]
    ready = [step for step, number in enumerate(missing) if not number]
    waiting = len(ready)
    reasons: dict[tuple[str, int], str] = {}
    for number, step in enumerate(order):
        while ready and place[ready[0]] < number:
            heappop(ready)
        freed = []
        for resource in model.touched[step]:
            left[resource] -= 1
            if not left[resource]:
                freed.append(resource)
        release = ""
        if freed:
            largest = max(freed, key=lambda r: model.sizes[r])
            more = f" and {len(freed) - 1} more" if len(freed) > 1 else ""
            release = f"releases {model.names[largest]}{more} ({format_bytes(sum(model.sizes[r] for r in freed))})"
        if waiting == 1:
            text = "nothing else can run yet" if number + 1 < len(order) else "everything else has run"
        elif shuffle is not None:
            text = f"drawn by seed {shuffle}, of {waiting} that could run"
        elif step == ready[0]:
            text = f"first of {waiting} that could run, reading from the outputs"
        else:
            text = f"before {names[model.steps[ready[0]].key]}, because less memory is held this way"
        reasons[model.steps[step].key] = f"{text}; {release}" if release else text
        waiting -= 1
        for other in model.after[step]:
            missing[other] -= 1
            if not missing[other]:
                heappush(ready, other)
                waiting += 1
    return reasons


def culled_reasons(steps: Sequence[Step], kept: Sequence[Step], versions: Versions) -> Mapping[str, str]:
    """Return by node id why none of its steps runs."""
    running = {step.node for step in kept}
    running |= {step.view.rpartition(".")[0] for step in kept if step.view}  # nodes that only set views
    running |= {function.node for step in kept for function in step.functions}  # nodes whose functions are called
    culled: dict[str, str] = {}
    for node in dict.fromkeys(step.node for step in steps):
        if node in running:
            continue
        ids = list(dict.fromkeys(write.resource for step in steps if step.node == node for write in step.writes))
        readers = {other.node for id in ids for _, other in versions.readers.get(id, ()) if other.node != node}
        if not ids:
            culled[node] = "it writes nothing"
        elif readers:
            be, do = "is" if len(ids) == 1 else "are", "does" if len(readers) == 1 else "do"
            culled[node] = f"{_listed(ids)} {be} read only by {_listed(sorted(readers))}, which {do} not run"
        else:
            culled[node] = f"nothing reads {_listed(ids)}"
    return culled


def _listed(words: Sequence[str]) -> str:
    if len(words) > 3:
        words = [*words[:3], f"{len(words) - 3} more"]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
