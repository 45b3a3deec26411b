"""Many variants of one pipeline drawn together: passes that compute the same are drawn once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from msgspec.structs import replace

from rendergraph.compare.divergence import passes
from rendergraph.compare.merge import Merged, kinship, merge
from rendergraph.compare.timing import Times, times_repeated
from rendergraph.compare.values import Pixels
from rendergraph.errors import InputError
from rendergraph.session import stages

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rendergraph.session.gpu import Gpu
    from rendergraph.session.values import Planned

MOST_BYTES = 512 << 20
"""Textures of one batch; the outputs of all its variants are alive at once."""
MOST_RUNS = 16
"""Variants of one batch: what is drawn together is kept together, and lost together when it is interrupted."""
MOST_VIEWS = 48
"""View tables of one batch: each has a binding point of its own, and OpenGL promises 84."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Variants that are drawn in the same frames.

    Attributes:
        numbers: which of the variants.
        merged: their graphs as one.
        planned: what is drawn of that.
    """

    numbers: tuple[int, ...]
    merged: Merged
    planned: Planned

    @property
    def pass_count(self) -> int:
        """Passes it draws."""
        return len(passes(self.planned.plan))


@dataclass(frozen=True, eq=False)
class Drawn:
    """One variant of a batch: its outputs by name."""

    number: int
    arrays: Mapping[str, Pixels]
    device: Mapping[str, object]


def batches(variants: Sequence[Planned], numbers: Sequence[int], most_bytes: int = MOST_BYTES) -> list[Batch]:
    """The variants in as few batches as fit, and those together that share most of their first passes.

    Args:
        variants: all with one scene, camera and size.
        numbers: which of them.
        most_bytes: of textures in a batch; a single variant may have more.
    """
    return [batch for cut in cuts(variants, numbers) for batch in fitting(variants, cut, most_bytes)]


def cuts(variants: Sequence[Planned], numbers: Sequence[int], most: int = MOST_RUNS) -> list[list[int]]:
    """The variants in groups, those together that share most of their first passes.

    Args:
        variants: all with one scene, camera and size.
        numbers: which of them.
        most: variants of a group.
    """
    if not numbers:
        return []
    graphs = [variants[number].linked.graph for number in numbers]
    kin = dict(zip(numbers, kinship(graphs, passes(variants[numbers[0]].plan)), strict=True))
    waiting = sorted(numbers, key=kin.__getitem__)
    found: list[list[int]] = []
    while waiting:
        cut = _cut([kin[number] for number in waiting], most)
        found.append(waiting[:cut])
        waiting = waiting[cut:]
    return found


def _cut(kin: Sequence[tuple[int, ...]], most: int) -> int:
    """How many of the first variants are a group: as many as may be, or some less where what follows shares less."""
    if len(kin) <= most:
        return len(kin)

    def shared(at: int) -> int:
        differing = (place for place, pair in enumerate(zip(kin[at - 1], kin[at], strict=True)) if pair[0] != pair[1])
        return next(differing, len(kin[at]))

    return min(range(most, most // 2, -1), key=shared)


def fitting(variants: Sequence[Planned], numbers: Sequence[int], most_bytes: int) -> list[Batch]:
    """These variants in one batch, or halved until each batch fits."""
    chosen = [variants[number] for number in numbers]
    merged = merge([variant.linked.graph for variant in chosen])
    try:
        planned = stages.plan(stages.expand(replace(chosen[0].linked, graph=merged.graph)))
        small = planned.plan.memory.allocated_bytes <= most_bytes and len(planned.expansion.views) <= MOST_VIEWS
        if small or len(numbers) == 1:
            return [Batch(tuple(numbers), merged, planned)]
    except InputError:
        # Each graph has a legal order and all of them together have none: readers of two continued textures wait for
        # each other across graphs. So rare that the way out is the plain one.
        if len(numbers) == 1:
            raise
    half = len(numbers) // 2
    return [*fitting(variants, numbers[:half], most_bytes), *fitting(variants, numbers[half:], most_bytes)]


def draw(gpu: Gpu, variants: Sequence[Planned], batch: Batch, frame: int) -> Iterator[Drawn]:
    """Draw a batch and hand out its variants.

    Args:
        gpu: where.
        variants: all of them.
        batch: which ones.
        frame: number of the frame whose pictures are wanted.
    """
    drawn = stages.draw_last(batch.planned.for_frames(range(1, frame + 1), warm_up=False), gpu)  # nothing is measured
    for place, number in enumerate(batch.numbers):
        arrays = {name: drawn[batch.merged.output(place, name)] for name in variants[number].linked.graph.outputs}
        yield Drawn(number, arrays, drawn.device)


def measure(
    gpu: Gpu, variants: Sequence[Planned], batch: Batch, frames: int, *, warm: bool, repeats: int = 1
) -> Iterator[tuple[int, Times]]:
    """The times of a batch's variants, each the sum of the passes it needs.

    Args:
        gpu: where.
        variants: all of them.
        batch: which ones.
        frames: how many frames are measured, each time.
        warm: whether the batch has just been drawn.
        repeats: how often, each time from the first frame on, with a frame to warm up.
    """
    times = []
    for number in range(repeats):
        warm_up = not warm or number > 0
        timed = batch.planned.for_frames(range(1, frames + 1), warm_up=warm_up, timed=True)
        times.append(stages.draw_last(timed, gpu).times)
    for place, number in enumerate(batch.numbers):
        variant = variants[number]
        own = {name: batch.merged.names[place][name] for name in passes(variant.plan)}
        yield number, times_repeated(times, own, {node.id: node.type.name for node in variant.linked.graph.nodes})
