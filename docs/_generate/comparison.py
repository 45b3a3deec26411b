"""README's comparison: its files drawn by `compare`, side by side with FLIP's map of where an eye sees a difference.

`python docs/_generate/comparison.py` writes docs/images/comparison.png; the table is what the command prints.
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

import rendergraph as rg
from rendergraph.compare import compare
from rendergraph.compare.results import Comparison
from rendergraph.images import heat_map, write

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs" / "images" / "comparison.png"
BETWEEN = 8
"""Texels of white between the pictures."""


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
    """Both pictures and the map, uint8 of shape (height, 3 width and what is between, 3)."""
    one, other = comparison.results
    assert other.flip_map is not None
    parts = [np.asarray(result.pixels, np.uint8)[..., :3] for result in (one, other)]
    gap = np.full((parts[0].shape[0], BETWEEN, 3), 255, np.uint8)
    return np.concatenate([parts[0], gap, parts[1], gap, heat_map(other.flip_map)], axis=1)


def main() -> None:
    """Write the picture."""
    with tempfile.TemporaryDirectory() as folder:
        comparison = readme_comparison(Path(folder))
    write(PICTURE, side_by_side(comparison))
    print(PICTURE)


if __name__ == "__main__":
    main()
