"""Steps as small integers for the search, and the cost of an order."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import NamedTuple

from msgspec import Struct

from rendergraph.link.graph import depth_first
from rendergraph.schedule.dependencies import Versions, Waits, is_filled_by_update, touched_ids
from rendergraph.steps import Resource, Step
from rendergraph.textures import TextureDesc

# Exact lifetimes cost a visit per step and texture, so long graphs count only the steps that touch a texture.
MUST_LIVE_VISITS = 20_000


class Cost(NamedTuple):
    """The cost of an order, compared by pool, then by peak, then by area.

    Attributes:
        pool: bytes of a pool of textures that are shared within a texel class.
        peak: maximum of live bytes over the steps.
        area: live bytes summed over the steps; breaks ties towards short lifetimes.
    """

    pool: int
    peak: int
    area: int


class Frame(Struct, frozen=True):
    """The steps and resources to schedule.

    Attributes:
        shown, whole_frame: ids of the resources that are alive at the frame's end, and during the whole frame.
        sinks: the steps that write the results of the frame, in a fixed order.
    """

    kept: Sequence[Step]
    resources: Mapping[str, Resource]
    shown: set[str]
    whole_frame: frozenset[str]
    sinks: Sequence[Step]

    def constant(self, copies: Mapping[str, int]) -> int:
        """Return the bytes alive during the whole frame; `copies` has the number of textures of each history."""
        whole = [self.resources[id] for id in self.whole_frame]
        return sum(one.desc.bytes * copies[one.id] if one.role == "history" else one.bytes for one in whole)


class Model(Struct, frozen=True):
    """Steps numbered in reading order: depth first from the outputs, with inputs in the order of their ports.

    The numbering depends only on links and port declarations, not on the order of nodes in a file or of keys in a
    mapping, and so does everything computed from it.

    Attributes:
        before, after: numbers of the steps that a step waits for, and of those that wait for it.
        touched: numbers of the resources that a step touches, without those that are alive during the whole frame.
        touchers: the same by resource: numbers of the steps that touch it.
        born: bytes that become alive with a step.
        classes: number of the storage class of each resource; equal ones can share a texture.
        toucher_count: number of steps that touch each resource, plus one for the frame's end if it is shown.
        shown: numbers of the resources that are alive at the frame's end.
        constant: bytes alive during the whole frame: history, kept values, buffers that `update` fills.
    """

    steps: tuple[Step, ...]
    before: tuple[tuple[int, ...], ...]
    after: tuple[tuple[int, ...], ...]
    touched: tuple[tuple[int, ...], ...]
    touchers: tuple[tuple[int, ...], ...]
    born: tuple[int, ...]
    sizes: tuple[int, ...]
    classes: tuple[int, ...]
    toucher_count: tuple[int, ...]
    shown: frozenset[int]
    names: tuple[str, ...]
    constant: int

    @property
    def content(self) -> Hashable:
        """Everything that determines the cost of an order, without the identity of steps."""
        kept = self.before, self.touched, self.born, self.sizes, self.classes, self.toucher_count
        return *kept, self.shown, self.constant

    @classmethod
    def of(cls, frame: Frame, waits: Waits) -> Model:
        """Number the steps of a dependency graph; `constant` is not counted yet."""
        resources, by_key = frame.resources, {step.key: step for step in frame.kept}
        order = depth_first(waits, [step.key for step in frame.sinks])
        number = {key: place for place, key in enumerate(order)}
        steps = tuple(by_key[key] for key in order)
        before = tuple(tuple(sorted(number[key] for key in waits[step])) for step in order)
        after: list[list[int]] = [[] for _ in order]
        for place, earlier in enumerate(before):
            for step_before in earlier:
                after[step_before].append(place)
        touchers: dict[str, list[int]] = defaultdict(list)
        for place, step in enumerate(steps):
            for id in touched_ids(step):
                if id not in frame.whole_frame:
                    touchers[id].append(place)
        names = {id: place for place, id in enumerate(touchers)}
        sizes = tuple(resources[id].bytes for id in names)
        born = [0] * len(steps)
        for (first, *_), size in zip(touchers.values(), sizes, strict=True):
            born[first] += size  # the reading order is legal, so the first step that touches it is its first writer
        kinds: dict[object, int] = {}
        return cls(
            steps=steps,
            before=before,
            after=tuple(map(tuple, after)),
            touched=tuple(tuple(names[id] for id in touched_ids(step) if id in names) for step in steps),
            touchers=tuple(map(tuple, touchers.values())),
            born=tuple(born),
            sizes=sizes,
            classes=tuple(kinds.setdefault(storage_class(resources[id]), len(kinds)) for id in names),
            toucher_count=tuple(len(places) + (id in frame.shown) for id, places in touchers.items()),
            shown=frozenset(place for id, place in names.items() if id in frame.shown),
            names=tuple(names),
            constant=0,
        )

    def __len__(self) -> int:
        return len(self.steps)

    def cost(self, order: Sequence[int]) -> Cost:
        """Return the cost of an order, in time linear in the resources that the steps touch."""
        sizes, classes, touched = self.sizes, self.classes, self.touched
        count = len(sizes)
        left = list(self.toucher_count)
        seen = bytearray(count)
        live, peak, area = self.constant, self.constant, 0
        alive = [0] * count  # by class; there are at most as many classes as resources
        most: dict[int, int] = {}
        for step in order:
            dead = 0
            for resource in touched[step]:
                if not seen[resource]:
                    seen[resource] = 1
                    live += sizes[resource]
                    kind = classes[resource]
                    alive[kind] += 1
                    if alive[kind] > most.get(kind, 0):
                        most[kind] = alive[kind]
            if live > peak:
                peak = live
            area += live
            for resource in touched[step]:
                left[resource] -= 1
                if not left[resource]:
                    dead += sizes[resource]
                    alive[classes[resource]] -= 1
            live -= dead
        size_of = dict(zip(classes, sizes, strict=True))
        return Cost(self.constant + sum(size_of[kind] * number for kind, number in most.items()), peak, area)

    def peak(self, order: Sequence[int]) -> tuple[int, int | None]:
        """Return the peak of live bytes of an order and the first step that reaches it; None without steps."""
        left = list(self.toucher_count)
        live = peak = self.constant
        at = order[0] if order else None
        for step in order:
            live += self.born[step]
            if live > peak:
                peak, at = live, step
            for resource in self.touched[step]:
                left[resource] -= 1
                if not left[resource]:
                    live -= self.sizes[resource]
        return peak, at

    def bounds(self) -> tuple[int, int]:
        """Return lower bounds on the pool and the peak of any order, in bytes.

        A resource is alive at every step that touches it, and at every step that must run between its first writer and
        another step that touches it; an output also at every step that must follow its first writer.
        """
        count = len(self)
        ancestors = _reachable(self.before, range(count))
        live = [self.constant] * count
        alive: dict[int, list[int]] = {}
        visits = MUST_LIVE_VISITS
        descendants = _reachable(self.after, reversed(range(count))) if visits > count else []
        for resource in sorted(range(len(self.sizes)), key=lambda r: (-self.sizes[r], r)):
            mask = within = 0
            for step in self.touchers[resource]:
                mask |= 1 << step
                within |= ancestors[step]
            if visits > 0:
                following = descendants[self.touchers[resource][0]]
                mask |= following if resource in self.shown else within & following
            number_alive = alive.setdefault(self.classes[resource], [0] * count)
            while mask:
                low = mask & -mask
                mask ^= low
                step = low.bit_length() - 1
                live[step] += self.sizes[resource]
                number_alive[step] += 1
                visits -= 1
        size_of = dict(zip(self.classes, self.sizes, strict=True))
        at_end = [self.classes[resource] for resource in self.shown]
        pool = sum(size_of[kind] * max(*numbers, at_end.count(kind)) for kind, numbers in alive.items())
        # A step without dependents runs last, while all outputs are alive.
        least = sum(self.sizes[resource] for resource in self.shown) + min(
            sum(self.sizes[resource] for resource in self.touched[step] if resource not in self.shown)
            for step in range(count)
            if not self.after[step]
        )
        return self.constant + pool, max(self.constant + least, *live)


def _reachable(neighbours: Sequence[Iterable[int]], order: Iterable[int]) -> list[int]:
    """Return for each step a bit mask of all steps that its neighbours lead to, which come before it in `order`."""
    found = [0] * len(neighbours)
    for step in order:
        for other in neighbours[step]:
            found[step] |= found[other] | 1 << other
    return found


def storage_class(resource: Resource) -> object:
    """Return a key that is equal for resources that can share a texture or buffer, possibly through a view."""
    return resource.desc.storage_class if isinstance(resource.desc, TextureDesc) else resource.desc


def alive_all_frame(resources: Mapping[str, Resource], versions: Versions) -> set[str]:
    """Return the ids of resources alive all frame: history, kept values, scene data, buffers that `update` fills."""
    return {
        id
        for id, resource in resources.items()
        if resource.role in ("history", "kept", "scene") or is_filled_by_update(id, resource, versions)
    }
