"""Allocate a Schedule's resources, giving a ResourcePlan: lifetimes, physical textures, aliases, bytes, lower bound.

Textures share memory as a whole, in three tiers: `descriptor`, equal descriptions; `view`, equal texel classes through
texture views; and `heap`, blocks of memory for textures of any description. Within a class, lifetimes are intervals, so
greedy allocation in order of time needs only as many textures as are ever alive at once, which is optimal.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Mapping, Sequence
from functools import cached_property, lru_cache
from heapq import heappop, heappush
from typing import Literal, TypeAlias

from msgspec import Struct
from msgspec.structs import asdict

from rendergraph.schedule import Schedule, step_names
from rendergraph.schedule.dependencies import touched_ids
from rendergraph.schedule.model import storage_class
from rendergraph.steps import Resource
from rendergraph.textures import BufferDesc, TextureDesc

# Above this, placement in a heap takes too long for its benefit.
MOST_PLACED = 2_000
# In comparisons of pairs, so that all machines find the same blocks. 40 textures get 6 restarts, 10 get 100.
WORK = 10_000
RESTARTS = 100

Tier: TypeAlias = Literal["descriptor", "view", "heap"]
"""How textures share memory: equal descriptions, equal texel classes through views, or blocks of a heap."""


class Lifetime(Struct, frozen=True, gc=False):
    """First and last position in the schedule at which a resource must hold its values, inclusive."""

    first: int
    last: int


class Physical(Struct, frozen=True, gc=False):
    """One texture or buffer that is allocated.

    Attributes:
        desc: its description; members of another format in the same texel class use a view of it. For a block, the
            largest member's.
        members: resources that live in it, in time order; a history resource has two physicals of its own.
        bytes: by formula; 0 for resources of the scene.
        block: whether it is plain memory, in which members of different texel classes are separate textures.
    """

    index: int
    desc: TextureDesc | BufferDesc
    members: tuple[str, ...]
    bytes: int
    block: bool = False


class MemoryFigures(Struct, frozen=True):
    """The figures of `run --json` and `plan --json`.

    Attributes:
        no_reuse_bytes: bytes if every resource had its own texture.
        lower_bound_bytes: no legal order has a lower peak of live bytes.
        proven: an order was found whose peak is that bound.
        tier: how textures share: `view` only if any needs a view, `heap` if any lie in a block.
        next_tier: the next tier that saves bytes, if any.
    """

    no_reuse_bytes: int
    allocated_bytes: int
    lower_bound_bytes: int
    peak_node: str | None
    proven: bool
    least_peak_bytes: int
    tier: Tier
    next_tier: Tier | None = None
    next_tier_bytes: int | None = None

    def as_json(self) -> dict[str, object]:
        return asdict(self)


class ResourcePlan(Struct, frozen=True, dict=True):
    """Where every resource lives.

    Attributes:
        placement: resource id to the indices of its physicals (two for history, else one).
        released: step position to the resources whose lifetimes end there (for the poison mode).
    """

    schedule: Schedule
    lifetimes: Mapping[str, Lifetime]
    physicals: tuple[Physical, ...]
    placement: Mapping[str, tuple[int, ...]]
    released: Mapping[int, tuple[str, ...]]
    memory: MemoryFigures
    alias: bool
    heap: bool

    def __repr__(self) -> str:
        count, memory = len(self.schedule.steps), self.memory
        return f"<ResourcePlan: {count} steps, {memory.allocated_bytes} bytes, {memory.no_reuse_bytes} without reuse>"

    @property
    def resources(self) -> Mapping[str, Resource]:
        return self.schedule.resources

    @cached_property
    def reasons(self) -> Mapping[str, str]:
        """Resource id to why it shares, or why not."""
        return _reasons(self)

    def bytes(self, id: str) -> int:
        """Return the bytes of a resource by formula, with both textures of a history; 0 for the scene's."""
        resource = self.resources[id]
        return 0 if resource.role == "scene" else resource.desc.bytes * len(self.placement[id])


def allocate(schedule: Schedule, *, alias: bool = True, heap: bool = False) -> ResourcePlan:
    """Allocate memory for every resource of a schedule.

    Args:
        alias: let resources with disjoint lifetimes share memory.
        heap: let textures of any description share blocks of memory, if that takes fewer bytes.
    """
    sharing = _Sharing(schedule)
    by_desc = sharing.colour(sharing.descs)
    alike = len({*sharing.classes.values()}) == len({*sharing.descs.values()})  # each class has one description
    by_class = by_desc if alike else sharing.colour(sharing.classes)
    groups = sharing.fewest_views(by_desc, by_class) if alias else [[id] for id in sharing.ids]
    better: list[tuple[Tier, Groups]] = [] if alias else [("descriptor", by_desc), ("view", by_class)]  # higher tiers
    if len(sharing.ids) <= MOST_PLACED:
        blocks = sharing.blocks(by_desc)
        if not (alias and heap):
            better.append(("heap", blocks))
        elif sharing.bytes(blocks) < sharing.bytes(groups):
            groups = blocks
    # Without sharing, history takes two textures in any order.
    copies = schedule.history_copies if alias else dict.fromkeys(schedule.history_copies, 2)
    physicals, placement = sharing.physicals(groups, copies)
    released: dict[int, list[str]] = defaultdict(list)
    for id in sharing.ids:
        if id not in schedule.shown:
            released[sharing.lifetimes[id].last].append(id)
    return ResourcePlan(
        schedule=schedule,
        lifetimes=sharing.lifetimes,
        physicals=physicals,
        placement=placement,
        released={position: tuple(ids) for position, ids in sorted(released.items())},
        memory=_memory(sharing, physicals, placement, better),
        alias=alias,
        heap=heap,
    )


def _lifetimes(schedule: Schedule) -> dict[str, Lifetime]:
    last = max(0, len(schedule.steps) - 1)
    touches: dict[str, list[int]] = defaultdict(list)
    for position, step in enumerate(schedule.steps):
        for id in touched_ids(step):
            touches[id].append(position)
    return {
        id: Lifetime(0, last)
        if id in schedule.whole_frame
        else Lifetime(touches[id][0], last if id in schedule.shown else touches[id][-1])
        for id in schedule.resources
    }


Groups: TypeAlias = list[list[str]]
"""The resources of each physical, in time order."""

Kinds: TypeAlias = Mapping[str, object]
"""By id, a key that resources have in common if they can share."""


class _Sharing:
    """The resources of a schedule, and the ways to share memory among those that may.

    Attributes:
        ids: resources that may share, by their first positions.
    """

    def __init__(self, schedule: Schedule) -> None:
        self.schedule = schedule
        self.descs = {id: resource.desc for id, resource in schedule.resources.items()}
        self.classes: Kinds = {id: storage_class(resource) for id, resource in schedule.resources.items()}
        self.sizes = {id: desc.bytes for id, desc in self.descs.items()}
        self.lifetimes = _lifetimes(schedule)
        self.ids = sorted(self.lifetimes.keys() - schedule.whole_frame, key=self._position)

    def _position(self, id: str) -> tuple[int, str]:
        return self.lifetimes[id].first, id

    def _sorted(self, groups: Iterable[list[str]]) -> Groups:
        return sorted(groups, key=lambda group: self._position(group[0]))

    def bytes(self, groups: Groups) -> int:
        return sum([max([self.sizes[id] for id in group]) for group in groups])

    def colour(self, kinds: Kinds) -> Groups:
        """Colour the interval graph of each kind; prefer a free texture with the same description, then the oldest."""
        lifetimes, descs = self.lifetimes, self.descs
        groups: Groups = []
        free: dict[object, list[int]] = defaultdict(list)  # by kind: indices into groups, lowest first
        free_exact: dict[object, list[int]] = defaultdict(list)  # by description
        taken: list[bool] = []
        busy: list[tuple[int, int]] = []  # last position and group

        def take(queue: list[int], desc: object = None) -> int | None:
            # Every free texture is queued by kind and by description; an entry is stale once the other queue gave it
            # away.
            while queue:
                group = heappop(queue)
                if not taken[group] and (desc is None or descs[groups[group][-1]] == desc):
                    return group
            return None

        for id in self.ids:
            while busy and busy[0][0] < lifetimes[id].first:
                _, group = heappop(busy)
                taken[group] = False
                owner = groups[group][-1]
                heappush(free[kinds[owner]], group)
                heappush(free_exact[descs[owner]], group)
            found = take(free_exact[descs[id]], descs[id])
            if found is None:
                found = take(free[kinds[id]])
            if found is None:
                found = len(groups)
                groups.append([])
                taken.append(True)
            taken[found] = True
            groups[found].append(id)
            heappush(busy, (lifetimes[id].last, found))
        return groups

    def fewest_views(self, by_desc: Groups, by_class: Groups) -> Groups:
        """Return the sharing by class if it saves bytes, else that by description, to avoid needless views."""
        tables: list[dict[object, Groups]] = []
        for groups in (by_desc, by_class):
            tables.append(defaultdict(list))
            for group in groups:
                tables[-1][self.classes[group[0]]].append(group)
        exact, loose = tables
        return self._sorted(group for kind in exact for group in min(exact[kind], loose[kind], key=len))

    def blocks(self, by_desc: Groups) -> Groups:
        spans = [(id, self.lifetimes[id]) for id in self.ids if not isinstance(self.descs[id], BufferDesc)]
        items = tuple([HeapItem(self.sizes[id], span.first, span.last, self.classes[id]) for id, span in spans])
        buffers = [group for group in by_desc if isinstance(self.descs[group[0]], BufferDesc)]
        return self._sorted([*buffers, *[[spans[number][0] for number in block] for block in share_blocks(items)]])

    def physicals(
        self, groups: Groups, copies: Mapping[str, int]
    ) -> tuple[tuple[Physical, ...], dict[str, tuple[int, ...]]]:
        resources, whole_frame = self.schedule.resources, self.schedule.whole_frame
        physicals: list[Physical] = []
        placement: dict[str, tuple[int, ...]] = {}
        for members in (*groups, *([id] for id in resources if id in whole_frame)):
            resource = resources[max(members, key=self.sizes.__getitem__)]
            first = len(physicals)
            taken = 0 if resource.role == "scene" else self.sizes[resource.id]
            block = len({self.classes[id] for id in members}) > 1
            for _ in range(copies.get(resource.id, 1)):
                physicals.append(Physical(len(physicals), resource.desc, tuple(members), taken, block))
            placement |= dict.fromkeys(members, tuple(range(first, len(physicals))))
        return tuple(physicals), placement


def _memory(
    sharing: _Sharing,
    physicals: Sequence[Physical],
    placement: Mapping[str, tuple[int, ...]],
    better: Iterable[tuple[Tier, Groups]],
) -> MemoryFigures:
    schedule, resources = sharing.schedule, sharing.schedule.resources
    constant = sum(physicals[place].bytes for id in schedule.whole_frame for place in placement[id])
    allocated = sum(physical.bytes for physical in physicals)
    viewed = any(resources[id].desc != physical.desc for physical in physicals for id in physical.members)
    totals: list[tuple[Tier, int]] = [(name, constant + sharing.bytes(groups)) for name, groups in better]
    next_tier, next_bytes = next((tier for tier in totals if tier[1] < allocated), (None, None))
    return MemoryFigures(
        no_reuse_bytes=sum(resource.bytes for resource in resources.values()),
        allocated_bytes=allocated,
        lower_bound_bytes=schedule.lower_bound_bytes,
        peak_node=schedule.peak_node,
        proven=schedule.proven,
        least_peak_bytes=schedule.least_peak_bytes,
        tier="heap" if any(physical.block for physical in physicals) else "view" if viewed else "descriptor",
        next_tier=next_tier,
        next_tier_bytes=next_bytes,
    )


def _reasons(plan: ResourcePlan) -> dict[str, str]:
    schedule, lifetimes, physicals, placement = plan.schedule, plan.lifetimes, plan.physicals, plan.placement
    names = step_names(schedule.steps)
    outputs = {id: name for name, id in reversed(list(schedule.outputs.items()))}
    kinds, what = _alike(plan)
    count: dict[object, int] = defaultdict(int)
    for id in schedule.resources:
        count[kinds[id]] += id not in schedule.whole_frame
    reasons: dict[str, str] = {}
    for id, resource in schedule.resources.items():
        physical = physicals[placement[id][0]]
        word = "texture" if isinstance(resource.desc, TextureDesc) else "buffer"
        if resource.role == "history" and len(placement[id]) == 2:
            reasons[id] = f"the next frame reads it: two {word}s take turns and nothing shares them"
        elif resource.role == "history":
            reasons[id] = f"the next frame reads it, before it is written again: one {word}, and nothing shares it"
        elif resource.role == "scene":
            note = f"{resource.note}; " if resource.note else ""
            reasons[id] = f"{note}it is uploaded with the scene, and all pipelines that draw that read it"
        elif resource.role == "kept":
            reasons[id] = f"it outlives the frame: its {word} is its own, and written when it is new or out of date"
        elif id in schedule.whole_frame:
            reasons[id] = f"it is filled before the first step: its {word} is its own for the whole frame"
        elif not plan.alias:
            reasons[id] = "aliasing is off"
        elif len(physical.members) == 1:
            reasons[id] = f"whenever it is alive, all {word}s it could share are in use"
            if count[kinds[id]] == 1:
                reasons[id] = f"no other {word} {what if word == 'texture' else 'is of its size'}"
        else:
            word = "block" if physical.block else word
            place = physical.members.index(id)
            other = physical.members[place - 1 if place else 1]
            view = _view(resource, physical)
            if place:
                end = names[schedule.steps[lifetimes[other].last].key]
                reasons[id] = f"shares {word} {physical.index} with {other}{view}, dead after {end}"
            else:
                start = names[schedule.steps[lifetimes[other].first].key]
                reasons[id] = f"shares {word} {physical.index} with {other}, which takes it over at {start}"
        if id in schedule.shown:
            reasons[id] = f"output '{outputs[id]}', kept to the frame's end: {reasons[id]}"
    return reasons


def _alike(plan: ResourcePlan) -> tuple[Kinds, str]:
    """Return what textures that can share have in common, and a phrase for it."""
    if plan.heap:
        descs = {id: resource.desc for id, resource in plan.resources.items()}
        return {id: isinstance(desc, TextureDesc) or desc for id, desc in descs.items()}, "is there"
    classes = {id: storage_class(resource) for id, resource in plan.resources.items()}
    return classes, "is of its texel class and size"


def _view(resource: Resource, physical: Physical) -> str:
    if physical.block or isinstance(resource.desc, BufferDesc) or resource.desc == physical.desc:
        return ""
    return f" through a {resource.desc.format} view"


# --- blocks of a heap -------------------------------------------------------------------------------------------------
#
# A block is as large as its largest member, and all members begin at its start: drivers ignore other offsets
# (docs/decisions/memory-objects.md). This is weighted interval colouring, which minimises the sum over colours of the
# largest weight and is NP-hard. Largest first is within 1 % of the optimum on most small cases; restarts improve it.


class HeapItem(Struct, frozen=True, gc=False):
    """A texture to place: bytes, first and last position in the schedule, and its kind."""

    bytes: int
    first: int
    last: int
    kind: Hashable = None


@lru_cache(64)  # most changes of a pipeline do not change the items
def share_blocks(items: tuple[HeapItem, ...]) -> tuple[tuple[int, ...], ...]:
    """Return the numbers of the items in each block, in time order, with few bytes in total.

    Largest first, each into the block that grows least; ties go to a block with its kind, then to the tightest. Then
    seeded restarts with perturbed sizes, until the bound is reached.
    """
    numbers = range(len(items))
    alive = [(1 << item.last + 1) - (1 << item.first) for item in items]  # a bit for each position
    best, least = _placed(items, alive, sorted(numbers, key=lambda n: (-items[n].bytes, items[n].first, n)))
    bound = least_bytes(items)
    if least > bound:
        import random  # the first order is usually optimal

        chooser = random.Random(0)
        for _ in range(min(RESTARTS, WORK // max(1, len(items)) ** 2)):
            weights = [item.bytes * chooser.uniform(0.5, 1.5) for item in items]
            other, taken = _placed(items, alive, sorted(numbers, key=lambda n: (-weights[n], n)))
            if taken < least:
                best, least = other, taken
            if least == bound:
                break
    return tuple([tuple(sorted(block, key=lambda n: items[n].first)) for block in best])


def least_bytes(items: Sequence[HeapItem]) -> int:
    """Return a lower bound on bytes: the n-th largest block must hold the n-th largest item at every moment."""
    most = [0] * len(items)
    ordered = sorted([(item.bytes, item.first, item.last) for item in items], reverse=True)
    for now in {item.first for item in items}:
        live = [bytes for bytes, first, last in ordered if first <= now <= last]
        most[: len(live)] = map(max, most, live)
    return sum(most)


def _placed(items: Sequence[HeapItem], alive: Sequence[int], order: Sequence[int]) -> tuple[list[list[int]], int]:
    blocks: list[list[int]] = []
    sizes: list[int] = []
    taken: list[int] = []  # per block, the positions at which one of its items is alive
    kinds: list[set[object]] = []
    for number in order:
        bytes, kind, now = items[number].bytes, items[number].kind, alive[number]
        found, least = -1, (bytes, False, 0)
        for place, other in enumerate(taken):
            if not other & now:
                more = bytes - sizes[place]
                cost = (max(0, more), kind not in kinds[place], abs(more))
                if cost < least:
                    found, least = place, cost
                if cost == (0, False, 0):
                    break
        if found < 0:
            blocks.append([number])
            sizes.append(bytes)
            taken.append(now)
            kinds.append({kind})
        else:
            blocks[found].append(number)
            sizes[found] = max(sizes[found], bytes)
            taken[found] |= now
            kinds[found].add(kind)
    return blocks, sum(sizes)
