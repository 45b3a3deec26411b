"""A layered layout from left to right: the column of every node, the order within columns, then the heights."""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Sequence

from msgspec import Struct

from rendergraph.diagrams.markup import Link

SWEEPS = 8
GAP = 26.0  # between boxes of a column
LANE = 12.0  # height that a passing link takes within a column


class Box(Struct, eq=False):
    """A card, or the place where a link passes through a column."""

    key: object  # the node's id, or anything unique for a passing link
    layer: int
    height: float
    y: float = 0.0  # top edge
    ties: list[tuple[Box, float, float]] = []  # linked boxes, with the heights of both ends of the link


def layers_of(nodes: Sequence[str], links: Sequence[Link]) -> dict[str, int]:
    """Return the column of every node: as early as possible, but nodes without inputs next to their first reader."""
    import networkx as nx  # takes longer than checking a pipeline

    links = [link for link in links if not (link.previous or link.back)]
    dag: nx.DiGraph[str] = nx.DiGraph()
    dag.add_nodes_from(nodes)
    dag.add_edges_from((link.source, link.target) for link in links)
    layer = {id: place for place, members in enumerate(nx.topological_generations(dag)) for id in members}
    targets: dict[str, list[int]] = {}
    for link in links:
        targets.setdefault(link.source, []).append(layer[link.target])
    fed = {link.target for link in links}
    return {id: min(targets[id]) - 1 if id not in fed and id in targets else place for id, place in layer.items()}


def tie(one: Box, other: Box, here: float, there: float) -> None:
    """Connect two boxes at the given heights from their tops."""
    one.ties.append((other, here, there))
    other.ties.append((one, there, here))


def place(columns: list[list[Box]]) -> None:
    """Order the boxes of each column so that few links cross, then set heights close to those of linked boxes."""
    best, fewest = [list(column) for column in columns], _crossings(columns)
    for sweep in range(SWEEPS):
        for column in columns:
            _number(column)
        side = -1 if sweep % 2 == 0 else 1
        for column in columns[::-side]:
            rank = {id(box): _middle(box, side) for box in column}
            column.sort(key=lambda box: (rank[id(box)], box.y))
            _number(column)
        crossings = _crossings(columns)
        if crossings < fewest:
            best, fewest = [list(column) for column in columns], crossings
    for column, order in zip(columns, best, strict=True):
        column[:] = order
        y = 0.0
        for box in column:
            box.y = y
            y += box.height + GAP
    for sweep in range(SWEEPS):
        for column in columns if sweep % 2 == 0 else reversed(columns):
            _settle(column)
    top = min((box.y for column in columns for box in column), default=0.0)
    for column in columns:
        for box in column:
            box.y -= top


def _number(column: Sequence[Box]) -> None:
    for number, box in enumerate(column):
        box.y = float(number)


def _middle(box: Box, side: int) -> float:
    """Return the mean position of the linked boxes on one side, with fractions for ports; its own if there are none."""
    ends = [other.y + there / (other.height + 1) for other, _, there in box.ties if other.layer == box.layer + side]
    return sum(ends) / len(ends) if ends else box.y


def _crossings(columns: Sequence[Sequence[Box]]) -> int:
    place_of = {id(box): number for column in columns for number, box in enumerate(column)}
    total = 0
    for column in columns:
        ends = sorted(
            ((number, here), (place_of[id(other)], there))
            for number, box in enumerate(column)
            for other, here, there in box.ties
            if other.layer == box.layer + 1
        )
        open_ends: list[tuple[int, float]] = []
        for _, end in ends:
            total += len(open_ends) - bisect_right(open_ends, end)
            insort(open_ends, end)
    return total


def _settle(column: list[Box]) -> None:
    """Move each box as close to its linked boxes as the order allows: least squares without overlap.

    After subtracting the heights of preceding boxes, offsets must not decrease: pool adjacent violators (Barlow,
    Bartholomew, Bremner and Brunk 1972).
    """
    offset = 0.0
    pools: list[tuple[float, float, int]] = []  # mean, weight, boxes
    for box in column:
        wishes = [other.y + there - here for other, here, there in box.ties]
        wish = (sum(wishes) / len(wishes) if wishes else box.y) - offset
        pools.append((wish, max(1.0, float(len(wishes))), 1))
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            (a, wa, na), (b, wb, nb) = pools[-2:]
            pools[-2:] = [((a * wa + b * wb) / (wa + wb), wa + wb, na + nb)]
        offset += box.height + GAP
    offset = 0.0
    means = [mean for mean, _, number in pools for _ in range(number)]
    for box, mean in zip(column, means, strict=True):
        box.y = mean + offset
        offset += box.height + GAP
