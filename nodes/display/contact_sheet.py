"""Pictures side by side."""

from __future__ import annotations

import math
from itertools import chain

from rendergraph.api import Any as AnyTexel
from rendergraph.api import DisplayColor, Input, Node, Output, SceneError, Steps, TextureInfo, param, structural

from ._text import characters

_MOST = 12
_LETTERS = 20  # of a label
_ENCODED, _PLAIN, _GREY = range(3)


class ContactSheet(Node):
    """A grid of pictures with labels, row by row from the upper left, each as large as its share of the sheet takes it.

    What is larger than its place shrinks to the mean of the light that its texels send, what is smaller shows its
    texels as squares. Textures that hold no display colour are shown as they are, from 0 to 1, those of one channel in
    grey.
    """

    pictures = Input(AnyTexel, many=True, size="any", doc="What is shown, up to 12, in this order.")
    color = Output(DisplayColor, format="rgba8", doc="The sheet, as large as the picture of the pipeline.")

    columns: int = structural(default=0, min=0, max=_MOST, doc="Pictures in a row; 0: about as many rows as columns.")
    labels: tuple[str, ...] = structural(default=(), doc="A text for each, capitals and digits; none by default.")
    gap: int = structural(default=4, unit="texels", min=0, max=256, doc="Between pictures.")
    background: float = param(default=0.02, min=0, max=1, doc="Grey between them, display-linear.")

    def record(self, steps: Steps) -> None:
        """One step that finds the picture of each texel."""
        shown = steps.facts.inputs["pictures"]
        if len(shown) > _MOST:
            raise SceneError(f"it is given {len(shown)} pictures; a sheet has up to {_MOST}")
        if len(self.labels) > len(shown):
            raise SceneError(f"it has {len(self.labels)} labels for {len(shown)} pictures")
        texts = [*self.labels, *[""] * (len(shown) - len(self.labels))]
        sizes = [one.desc.mip_size(0) for one in shown if one.desc is not None]
        sheet = steps.desc(self.color).mip_size(0)
        places = _places(sizes, sheet, self.columns or math.ceil(math.sqrt(len(shown))), self.gap)
        steps.fullscreen(
            "contact_sheet.frag",
            defines={"LETTERS": _LETTERS, "SHEET_HEIGHT": sheet[1]},
            pictures=self.pictures,
            kinds=[_kind(one) for one in shown],
            sizes=list(chain.from_iterable(sizes)),
            places=list(chain.from_iterable(places)),
            letters=[number for text in texts for number in characters(text, _LETTERS)],
        )


def _places(
    sizes: list[tuple[int, int]], sheet: tuple[int, int], columns: int, gap: int
) -> list[tuple[int, int, int, int]]:
    """Where pictures are shown: x and y of the upper left, width and height; the grid is in the sheet's middle."""
    columns = min(columns, len(sizes))
    grid = columns, math.ceil(len(sizes) / columns)
    room = [max(1, (whole - gap * (count + 1)) // count) for whole, count in zip(sheet, grid, strict=True)]
    scales = [min(room[0] / width, room[1] / height) for width, height in sizes]
    shown = [[max(1, int(side * scale + 1e-6)) for side in size] for size, scale in zip(sizes, scales, strict=True)]
    cell = [max(size[axis] for size in shown) for axis in (0, 1)]
    first = [(sheet[axis] - grid[axis] * (cell[axis] + gap) + gap) // 2 for axis in (0, 1)]
    found = []
    for number, size in enumerate(shown):
        at = number % columns, number // columns
        x, y = (first[i] + at[i] * (cell[i] + gap) + (cell[i] - size[i]) // 2 for i in (0, 1))
        found.append((x, y, size[0], size[1]))
    return found


def _kind(picture: TextureInfo) -> int:
    """How its texels are meant."""
    if picture.semantic == DisplayColor:
        return _ENCODED
    single = picture.desc is not None and picture.desc.format.startswith(("r8", "r16", "r32", "depth"))
    return _GREY if single else _PLAIN
