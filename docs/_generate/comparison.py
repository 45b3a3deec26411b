"""README's comparison: its files drawn by `compare`, side by side with FLIP's map of where an eye sees a difference."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt
from images.draw import read
from images.layout import Layout, laid_out

import rendergraph as rg
from rendergraph.compare import compare
from rendergraph.compare.results import Comparison
from rendergraph.images import heat_map

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs" / "images" / "comparison.png"


def readme_comparison(folder: Path) -> Comparison:
    """What README's `rendergraph compare` line compares; its files are written into the folder."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for name, file in re.findall(r"^```yaml\n# ([\w.-]+)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        (folder / name).write_text(file, encoding="utf-8")
    found = re.search(r"^\$ rendergraph compare (\S+) (\S+) --size (\d+)x(\d+) -s (\S+)", text, re.MULTILINE)
    assert found is not None, "README compares nothing"
    one, other, width, height, value = found.groups()
    size = (int(width), int(height))
    return compare([rg.load(folder / name, size=size, sets=[value]) for name in (one, other)], frames=1)


def side_by_side(comparison: Comparison) -> npt.NDArray[np.uint8]:
    """Both pictures and the map with the labels of `pictures.yaml`, uint8 of shape (height, width, 3)."""
    one, other = comparison.results
    assert other.flip_map is not None
    parts = [np.asarray(result.pixels, np.uint8)[..., :3] for result in (one, other)]
    picture = read().pictures[PICTURE.name]
    return laid_out([*parts, heat_map(other.flip_map)], Layout(3, picture.gap, picture.labels))
