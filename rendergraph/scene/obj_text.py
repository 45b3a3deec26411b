"""The statements of an OBJ file as arrays, read a whole block of lines at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rendergraph.scene.files import Reading
from rendergraph.scene.obj_block import Block, Doubles, Growing, Ints

BLOCK_BYTES = 8 << 20
"""Bytes of a block: large enough that a call for each costs nothing, small enough for the memory of its word table."""


@dataclass
class Statements:
    """Everything an OBJ file says.

    Attributes:
        positions: (v, 3); `colors` (v, 3), NaN where a vertex has none.
        uvs: (t, 2) as written, v upwards.
        normals: (n, 3).
        corners: (c, 3) position, texture coordinate and normal of each corner, from 0, `ABSENT` where there is none.
        sizes: corners of each face; `lines` its line.
        states: for each face, columns object, group, smoothing group and material as numbers into `names`.
        names: the words behind the numbers; smoothing groups are kept as they are, 0 for off.
        libraries: `mtllib` arguments with their lines.
        smoothed: whether there is an `s` statement at all.
    """

    positions: Doubles
    colors: Doubles
    uvs: Doubles
    normals: Doubles
    corners: Ints
    sizes: Ints
    lines: Ints
    states: Ints
    names: tuple[list[str], list[str], list[str], list[str]]
    libraries: list[tuple[str, int]]
    smoothed: bool


def statements(data: bytes, reading: Reading) -> Statements:
    """Parse a whole file.

    Raises:
        InputError: a statement is malformed, a number not finite, or a limit passed.
    """
    if data.startswith(b"\xef\xbb\xbf"):
        data = data[3:]
    if b"\0" in data[:4096]:
        raise reading.error("RG303", "is no OBJ text: it holds zero bytes")
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    grown = Growing()
    for block, first_line in _blocks(data):
        Block(block, first_line, grown, reading).read()
    names = tuple(list(table) for table in grown.numbers)
    return Statements(
        np.concatenate(grown.positions),
        np.concatenate(grown.colors),
        np.concatenate(grown.uvs),
        np.concatenate(grown.normals),
        np.concatenate(grown.corners),
        np.concatenate(grown.sizes),
        np.concatenate(grown.lines),
        np.concatenate(grown.states),
        (names[0], names[1], names[2], names[3]),
        list(grown.libraries.items()),
        grown.smoothed,
    )


def _blocks(data: bytes) -> Iterator[tuple[bytes, int]]:
    """Blocks that end at a line's end, with their first line's number."""
    at, line = 0, 1
    while at < len(data):
        end = data.find(b"\n", min(len(data), at + BLOCK_BYTES))
        while end > 0 and (data[end - 1 : end] == b"\\" or data[end - 2 : end] == b"\\\r"):
            end = data.find(b"\n", end + 1)
        end = len(data) if end < 0 else end + 1
        block = data[at:end]
        yield block, line
        line += block.count(b"\n")
        at = end
