"""Pictures side by side."""

from __future__ import annotations

import math
from itertools import chain

from rendergraph.api import Any as AnyTexel
from rendergraph.api import DisplayColor, Input, Node, Output, SceneError, Steps, TextureInfo, param, structural

from ._text import characters

_MAX_PICTURES = 12
_LABEL_LENGTH = 20
_DISPLAY_COLOR, _VALUES, _GREY = range(3)  # kinds of pictures, as in the shader


class ContactSheet(Node):
    """Arrange pictures in a grid with labels, row by row from the upper left, each as large as its cell allows.

    Larger pictures are reduced by averaging texels in linear light; the texels of smaller ones are shown as squares.
    Textures that do not hold display colours are shown unchanged, from 0 to 1, and in grey if they have one channel.
    """

    pictures = Input(AnyTexel, many=True, size="any", doc="Up to 12 pictures, in this order.")
    color = Output(DisplayColor, format="rgba8", doc="The sheet, of the size of the pipeline's picture.")

    columns: int = structural(
        default=0, min=0, max=_MAX_PICTURES, doc="Pictures per row; 0: about as many rows as columns."
    )
    labels: tuple[str, ...] = structural(
        default=(), doc="A label for each picture, of capital letters and digits; none by default."
    )
    gap: int = structural(default=4, unit="texels", min=0, max=256, doc="Space between pictures.")
    background: float = param(default=0.02, min=0, max=1, doc="Grey between pictures, display-linear.")

    def record(self, steps: Steps) -> None:
        """Record one step that draws all pictures."""
        inputs = steps.facts.inputs["pictures"]
        if len(inputs) > _MAX_PICTURES:
            raise SceneError(f"it has {len(inputs)} pictures; a sheet holds up to {_MAX_PICTURES}")
        if len(self.labels) > len(inputs):
            raise SceneError(f"it has {len(self.labels)} labels for {len(inputs)} pictures")
        texts = [*self.labels, *[""] * (len(inputs) - len(self.labels))]
        sizes = [one.desc.mip_size(0) for one in inputs if one.desc is not None]
        sheet = steps.desc(self.color).mip_size(0)
        rectangles = _rectangles(sizes, sheet, self.columns or math.ceil(math.sqrt(len(inputs))), self.gap)
        steps.fullscreen(
            "contact_sheet.frag",
            defines={"LABEL_LENGTH": _LABEL_LENGTH, "SHEET_HEIGHT": sheet[1]},
            pictures=self.pictures,
            kinds=[_kind(one) for one in inputs],
            sizes=list(chain.from_iterable(sizes)),
            rectangles=list(chain.from_iterable(rectangles)),
            characters=[number for text in texts for number in characters(text, _LABEL_LENGTH)],
        )


def _rectangles(
    sizes: list[tuple[int, int]], sheet: tuple[int, int], columns: int, gap: int
) -> list[tuple[int, int, int, int]]:
    """Return x and y of the upper left corner, width and height of each picture, in a centred grid."""
    columns = min(columns, len(sizes))
    grid = columns, math.ceil(len(sizes) / columns)
    available = [max(1, (extent - gap * (count + 1)) // count) for extent, count in zip(sheet, grid, strict=True)]
    scales = [min(available[0] / width, available[1] / height) for width, height in sizes]
    scaled = [[max(1, int(side * scale + 1e-6)) for side in size] for size, scale in zip(sizes, scales, strict=True)]
    cell = [max(size[axis] for size in scaled) for axis in (0, 1)]
    first = [(sheet[axis] - grid[axis] * (cell[axis] + gap) + gap) // 2 for axis in (0, 1)]
    rectangles = []
    for number, size in enumerate(scaled):
        position = number % columns, number // columns
        x, y = (first[i] + position[i] * (cell[i] + gap) + (cell[i] - size[i]) // 2 for i in (0, 1))
        rectangles.append((x, y, size[0], size[1]))
    return rectangles


def _kind(picture: TextureInfo) -> int:
    """Return how the texels of a picture are shown."""
    if picture.semantic == DisplayColor:
        return _DISPLAY_COLOR
    has_one_channel = picture.desc is not None and picture.desc.format.startswith(("r8", "r16", "r32", "depth"))
    return _GREY if has_one_channel else _VALUES
