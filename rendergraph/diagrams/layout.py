"""Placing the boxes of a layered drawing from left to right: order within layers, then heights."""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Sequence
from dataclasses import dataclass, field

from rendergraph.diagrams.cards import Link

SWEEPS = 8
GAP = 26.0  # between boxes of a layer
LANE = 12.0  # height a passing link takes within a layer


@dataclass
class Box:
    """A card, or the place where a link passes a layer it does not end in.

    Attributes:
        key: the node's id, or anything unique for a passing link.
        layer: column.
        height: in pixels.
        y: top edge.
        ties: what it is linked to: the other box, the height of the link's end here and there, from the tops.
    """

    key: object
    layer: int
    height: float
    y: float = 0.0
    ties: list[tuple[Box, float, float]] = field(default_factory=list)


def layers_of(generations: Sequence[Sequence[str]], links: Sequence[Link]) -> dict[str, int]:
    """Column of every node: as early as it can, but nodes that read nothing stand right before their first reader."""
    layer = {id: place for place, generation in enumerate(generations) for id in generation}
    targets: dict[str, list[int]] = {}
    fed = set()
    for link in links:
        if not link.previous:
            targets.setdefault(link.source, []).append(layer[link.target])
            fed.add(link.target)
    return {id: min(targets[id]) - 1 if id not in fed and id in targets else place for id, place in layer.items()}


def place(columns: list[list[Box]]) -> None:
    """Order the boxes of each column so that few links cross, then set their heights near what they are linked to."""
    best, fewest = [list(column) for column in columns], _crossings(columns)
    for sweep in range(SWEEPS):
        _number(columns)
        for column in columns if sweep % 2 == 0 else reversed(columns):
            side = -1 if sweep % 2 == 0 else 1
            rank = {id(box): _middle(box, side) for box in column}
            column.sort(key=lambda box: (rank[id(box)], box.y))
            for number, box in enumerate(column):
                box.y = float(number)
        crossings = _crossings(columns)
        if crossings < fewest:
            best, fewest = [list(column) for column in columns], crossings
    for column, order in zip(columns, best, strict=True):
        column[:] = order
    for column in columns:
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


def _number(columns: Sequence[Sequence[Box]]) -> None:
    for column in columns:
        for number, box in enumerate(column):
            box.y = float(number)


def _middle(box: Box, side: int) -> float:
    """Mean place of what it is linked to on one side, ports counting for fractions; its own where there is nothing."""
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
        seen: list[tuple[int, float]] = []
        for _, end in ends:
            total += len(seen) - bisect_right(seen, end)
            insort(seen, end)
    return total


def _settle(column: list[Box]) -> None:
    """Heights nearest, in least squares, to what each box is linked to, in the given order and without overlap.

    The offsets that remain after the boxes below each other are subtracted must not fall: pool adjacent violators
    (Barlow, Bartholomew, Bremner and Brunk 1972).
    """
    offset = 0.0
    blocks: list[tuple[float, float, int]] = []  # mean, weight, boxes
    for box in column:
        wishes = [other.y + there - here for other, here, there in box.ties]
        wish = (sum(wishes) / len(wishes) if wishes else box.y) - offset
        blocks.append((wish, max(1.0, float(len(wishes))), 1))
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            (a, wa, na), (b, wb, nb) = blocks[-2:]
            blocks[-2:] = [((a * wa + b * wb) / (wa + wb), wa + wb, na + nb)]
        offset += box.height + GAP
    offset = 0.0
    boxes = iter(column)
    for mean, _, number in blocks:
        for _ in range(number):
            box = next(boxes)
            box.y = mean + offset
            offset += box.height + GAP


def tie(one: Box, other: Box, here: float, there: float) -> None:
    """Note that a link leads from one box to another."""
    one.ties.append((other, here, there))
    other.ties.append((one, there, here))
