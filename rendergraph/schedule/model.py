"""Steps as small integers for the search, and the cost of an order."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Mapping, Sequence
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


class Model(Struct, frozen=True):
    """Steps numbered in reading order: depth first from the outputs, with inputs in the order of their ports.

    The numbering depends only on links and port declarations, not on the order of nodes in a file or of keys in a
    mapping, and so does everything computed from it.

    Attributes:
        before, after: numbers of the steps that a step waits for, and of those that wait for it.
        touched: numbers of the resources that a step touches, without those that are alive during the whole frame.
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
    def of(
        cls,
        waits: Waits,
        kept: Sequence[Step],
        resources: Mapping[str, Resource],
        whole_frame: Collection[str],
        shown: Collection[str],
        sinks: Sequence[Step],
    ) -> Model:
        """Number the steps of a dependency graph; `constant` is not counted yet.

        Args:
            sinks: the steps that write the results of the frame, in a fixed order.
        """
        by_key = {step.key: step for step in kept}
        order = depth_first(waits, [step.key for step in sinks])
        number = {key: place for place, key in enumerate(order)}
        steps = tuple(by_key[key] for key in order)
        before = tuple(tuple(sorted(number[key] for key in waits[step])) for step in order)
        after: list[list[int]] = [[] for _ in order]
        for place, earlier in enumerate(before):
            for step_before in earlier:
                after[step_before].append(place)
        names: dict[str, int] = {}
        touched: list[tuple[int, ...]] = []
        born = [0] * len(steps)
        sizes: list[int] = []
        toucher_count: list[int] = []
        for place, step in enumerate(steps):
            mine = []
            for id in touched_ids(step):
                if id in whole_frame:
                    continue
                if id not in names:  # the reading order is legal, so the first step that touches it is its first writer
                    names[id] = len(names)
                    toucher_count.append(0)
                    sizes.append(resources[id].bytes)
                    born[place] += sizes[-1]
                mine.append(names[id])
                toucher_count[names[id]] += 1
            touched.append(tuple(mine))
        ending = frozenset(number for id, number in names.items() if id in shown)
        for resource in ending:
            toucher_count[resource] += 1
        kinds: dict[object, int] = {}
        classes = tuple(kinds.setdefault(storage_class(resources[id]), len(kinds)) for id in names)
        return cls(
            steps,
            before,
            tuple(map(tuple, after)),
            tuple(touched),
            tuple(born),
            tuple(sizes),
            classes,
            tuple(toucher_count),
            ending,
            tuple(names),
            0,
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
        ancestors = [0] * count
        for step, earlier in enumerate(self.before):
            for other in earlier:
                ancestors[step] |= ancestors[other] | 1 << other
        touchers: list[list[int]] = [[] for _ in self.sizes]
        for step, resources in enumerate(self.touched):
            for resource in resources:
                touchers[resource].append(step)
        live = [self.constant] * count
        alive: dict[int, list[int]] = {}
        visits = MUST_LIVE_VISITS
        descendants = self._descendants() if visits > count else []
        for resource in sorted(range(len(self.sizes)), key=lambda r: (-self.sizes[r], r)):
            mask = within = 0
            for step in touchers[resource]:
                mask |= 1 << step
                within |= ancestors[step]
            if visits > 0:
                following = descendants[touchers[resource][0]]
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

    def _descendants(self) -> list[int]:
        found = [0] * len(self)
        for step in range(len(self) - 1, -1, -1):
            for other in self.after[step]:
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
