"""Writes gear.stl, so that the example has a model of its own: `python gear.py`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

TEETH, HOLE, ROOT, TIP, HALF = 12, 8.0, 22.0, 28.0, 5.0  # millimetres


def outline() -> npt.NDArray[np.float64]:
    """The gear's rim in its own plane, counter-clockwise: four corners a tooth."""
    angles = [tooth + part for tooth in range(TEETH) for part in (-0.28, -0.14, 0.14, 0.28)]
    radii = np.tile([ROOT, TIP, TIP, ROOT], TEETH)
    turned = 2 * np.pi * np.array(angles) / TEETH
    return np.stack([radii * np.cos(turned), radii * np.sin(turned)], axis=1)


def triangles() -> npt.NDArray[np.float64]:
    """Corners (n, 3, 3): the two faces, the rim, and the hole."""
    rim = outline()
    hole = HOLE * rim / np.linalg.norm(rim, axis=1, keepdims=True)
    found = []
    for k in range(len(rim)):
        a, b, c, d = rim[k], rim[(k + 1) % len(rim)], hole[(k + 1) % len(rim)], hole[k]
        for corners, bottom, top in (
            ((a, b, c, d), HALF, HALF),
            ((d, c, b, a), -HALF, -HALF),
            ((a, a, b, b), HALF, -HALF),
            ((c, c, d, d), HALF, -HALF),
        ):
            heights = (bottom, bottom, bottom, bottom) if bottom == top else (bottom, top, top, bottom)
            quad = [np.append(corner, height) for corner, height in zip(corners, heights, strict=True)]
            found += [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
    return np.array(found)


def stl(corners: npt.NDArray[np.float64]) -> bytes:
    """A binary STL file."""
    rows = np.zeros(len(corners), np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rows["normal"] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    rows["corners"] = corners
    return b"rendergraph-sketch".ljust(80) + len(rows).to_bytes(4, "little") + rows.tobytes()


if __name__ == "__main__":
    Path(__file__).with_name("gear.stl").write_bytes(stl(triangles()))
