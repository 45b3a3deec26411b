"""Batches: variants of one pipeline that are rendered as one graph, in which equal passes run once.

Two nodes are equal if they have the same type and parameters and read the same ports of equal nodes. A texture that
another node modifies in place (`InOut`) is equal only if that node is equal, too: each version has one writer. The
classes of equal nodes are found by refining a partition until it is stable, as in the minimisation of automata
(Hopcroft 1971, without its worklist), so `@previous` may close cycles.

The merged graph goes through the ordinary stages: it is scheduled, given memory and executed once, and each output is
rendered as in the graph it came from.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from msgspec.structs import replace

from rendergraph.compare.results import passes
from rendergraph.compare.space import unique_names
from rendergraph.compare.timing import Times, times_repeated
from rendergraph.declare import InOut, TextureInfo
from rendergraph.errors import InputError
from rendergraph.link import Endpoint, Graph, GraphNode
from rendergraph.metrics import Pixels
from rendergraph.session import stages

if TYPE_CHECKING:
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.values import Planned

MOST_BYTES = 512 << 20
"""Textures of one batch; the outputs of all its variants exist at the same time."""
MOST_RUNS = 16
"""Variants in a batch. An interruption loses the results of a whole batch."""
MOST_VIEWS = 48
"""View tables of one batch: each has a binding point of its own, and OpenGL guarantees 84."""

Key: TypeAlias = "tuple[int, str]"
"""Number of a graph and id of one of its nodes."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Variants that are rendered in the same frames; `names` are the ids of their nodes in the merged graph."""

    numbers: tuple[int, ...]
    names: tuple[Mapping[str, str], ...]
    planned: Planned

    @property
    def pass_count(self) -> int:
        return len(passes(self.planned.plan))


def batches(variants: Sequence[Planned], numbers: Sequence[int], most_bytes: int = MOST_BYTES) -> list[Batch]:
    """Return these variants in as few batches as possible; a single variant may exceed the limit for textures."""
    groups = group_similar(variants, numbers, MOST_RUNS)
    return [batch for group in groups for batch in fitting_batches(variants, group, most_bytes)]


def group_similar(variants: Sequence[Planned], numbers: Sequence[int], most: int) -> list[list[int]]:
    """Return the variants in groups of at most `most`; variants in a group share most of their first passes."""
    if not numbers:
        return []
    graphs = [variants[number].linked.graph for number in numbers]
    order = passes(variants[numbers[0]].plan)
    node_classes = _equivalence_classes(graphs)
    classes = {
        number: tuple(node_classes.get((place, node), -1) for node in order) for place, number in enumerate(numbers)
    }
    waiting = sorted(numbers, key=classes.__getitem__)
    groups: list[list[int]] = []
    while waiting:
        cut = _cut([classes[number] for number in waiting], most)
        groups.append(waiting[:cut])
        waiting = waiting[cut:]
    return groups


def _cut(classes: Sequence[tuple[int, ...]], most: int) -> int:
    """Return the size of the first group: the maximum, or somewhat less if the next variant shares less there."""
    if len(classes) <= most:
        return len(classes)

    def shared(at: int) -> int:
        pairs = enumerate(zip(classes[at - 1], classes[at], strict=True))
        return next((place for place, (one, other) in pairs if one != other), len(classes[at]))

    return min(range(most, most // 2, -1), key=shared)


def fitting_batches(variants: Sequence[Planned], numbers: Sequence[int], most_bytes: int) -> list[Batch]:
    """Return these variants in one batch, or halved until each batch fits."""
    chosen = [variants[number] for number in numbers]
    graph, names = merge([variant.linked.graph for variant in chosen])
    try:
        planned = stages.plan(stages.expand(replace(chosen[0].linked, graph=graph)))
        small = planned.plan.memory.allocated_bytes <= most_bytes and len(planned.expansion.views) <= MOST_VIEWS
        if small or len(numbers) == 1:
            return [Batch(tuple(numbers), names, planned)]
    except InputError:
        # Each graph has a legal order and the merged one has none: readers of two continued textures wait for each
        # other across graphs. This is so rare that halving is good enough.
        if len(numbers) == 1:
            raise
    half = len(numbers) // 2
    return [part for own in (numbers[:half], numbers[half:]) for part in fitting_batches(variants, own, most_bytes)]


def render_batch(gpu: Gpu, batch: Batch, frame: int) -> Iterator[tuple[int, dict[str, Pixels]]]:
    """Render a batch up to a frame, and yield the number and the outputs of each variant."""
    rendered = stages.draw_last(batch.planned.for_frames(range(1, frame + 1), warm_up=False), gpu)  # not measured
    for place, number in enumerate(batch.numbers):
        own = f"{place}/"
        yield number, {name.removeprefix(own): array for name, array in rendered.arrays.items() if name.startswith(own)}


def measure_batch(
    gpu: Gpu, variants: Sequence[Planned], batch: Batch, frames: int, repeats: int, *, warm: bool
) -> Iterator[tuple[int, Times]]:
    """Yield the times of a batch's variants, each the sum of its own passes.

    Each measurement starts at the first frame, after a frame to warm up, unless the batch is `warm` from rendering.
    """
    times = []
    for number in range(repeats):
        warm_up = not warm or number > 0
        timed = batch.planned.for_frames(range(1, frames + 1), warm_up=warm_up, timed=True)
        times.append(stages.draw_last(timed, gpu).times)
    for place, number in enumerate(batch.numbers):
        variant = variants[number]
        names = {name: batch.names[place][name] for name in passes(variant.plan)}
        yield number, times_repeated(times, node_types(variant), names)


def node_types(planned: Planned) -> dict[str, str]:
    return {node.id: node.type.name for node in planned.linked.graph.nodes}


# --- merging ---------------------------------------------------------------------------------------------------------


def merge(graphs: Sequence[Graph]) -> tuple[Graph, tuple[dict[str, str], ...]]:
    """Return one graph for graphs of one scene and one size, and of each its nodes' ids to ids in that graph.

    Output `image` of the second graph is called `1/image` there.
    """
    classes = _equivalence_classes(graphs)
    first: dict[int, str] = {}  # each class is called as its first member, with a number behind if that is taken
    for (_, name), number in classes.items():
        first.setdefault(number, name)
    ids = dict(zip(first, unique_names(list(first.values())), strict=True))
    names = tuple(
        {node.id: ids[classes[number, node.id]] for node in graph.nodes} for number, graph in enumerate(graphs)
    )
    nodes: dict[str, GraphNode] = {}
    textures: dict[Endpoint, TextureInfo] = {}
    outputs: dict[str, Endpoint] = {}
    for number, (graph, own) in enumerate(zip(graphs, names, strict=True)):
        for node in graph.nodes:
            inputs = {port: tuple(_renamed(end, own) for end in ends) for port, ends in node.inputs.items()}
            nodes.setdefault(own[node.id], replace(node, id=own[node.id], inputs=inputs))
        for end, info in graph.textures.items():
            textures.setdefault(_renamed(end, own), replace(info, view=_renamed_view(info.view, own)))
        outputs |= {f"{number}/{name}": _renamed(end, own) for name, end in graph.outputs.items()}
    base = graphs[0]
    reads = next((graph for graph in graphs if graph.facts.scene_data is not None), base)
    return Graph(base.name, nodes, outputs, reads.facts, textures, knows_objects=base.knows_objects), names


def _renamed(end: Endpoint, names: Mapping[str, str]) -> Endpoint:
    return end._replace(node=names[end.node])


def _renamed_view(view: str | None, names: Mapping[str, str]) -> str | None:
    """Return a view table's id; `camera` belongs to no node."""
    node, dot, port = (view or "").rpartition(".")
    return f"{names[node]}.{port}" if dot else view


def _equivalence_classes(graphs: Sequence[Graph]) -> dict[Key, int]:
    """Return the number of each node's class; nodes of a class are equal."""
    nodes = {(number, node.id): node for number, graph in enumerate(graphs) for node in graph.nodes}
    followers = _followers(graphs)
    classes: dict[Key, int] = {}
    signatures: Mapping[Key, object] = {
        key: (node.type.name, node.type.file, type(node.node), repr(node.node)) for key, node in nodes.items()
    }
    while True:
        numbers: dict[object, int] = {}
        refined = {key: numbers.setdefault(signatures[key], len(numbers)) for key in nodes}
        if classes and len(set(refined.values())) == len(set(classes.values())):
            return refined
        classes = refined
        signatures = {
            key: (
                refined[key],
                tuple(
                    (port, tuple((refined[key[0], end.node], end.port, end.previous) for end in ends))
                    for port, ends in node.inputs.items()
                ),
                tuple((port, refined[other], at) for port, other, at in followers.get(key, ())),
            )
            for key, node in nodes.items()
        }


def _followers(graphs: Sequence[Graph]) -> dict[Key, list[tuple[str, Key, str]]]:
    """Return each node's ports that another node continues, with that node and its port."""
    table: dict[Key, list[tuple[str, Key, str]]] = {}
    for number, graph in enumerate(graphs):
        for node in graph.nodes:
            for port, ends in node.inputs.items():
                if isinstance(node.node.ports()[port], InOut):
                    for end in ends:
                        table.setdefault((number, end.node), []).append((end.port, (number, node.id), port))
    return {key: sorted(followers) for key, followers in table.items()}
