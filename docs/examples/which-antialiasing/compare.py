"""Pictures, errors and times of the ways to smooth edges: `python compare.py [picture.png]`.

Each scene of this folder is drawn small by each of them, still and while its camera turns, and held against 64 pixels
for each: RMSE in display light. Milliseconds are the least of a frame's, all taken in one run; they go to stdout with
the errors as a table. The picture has a row a scene and a column a technique, its middle enlarged.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

import rendergraph as rg
from rendergraph import images

HERE = Path(__file__).parent
SIZE = (192, 108)
CROP = (slice(28, 78), slice(58, 118))
ENLARGED, GAP = 3, 3
STILL, TURNING = 16, 12
SHADOWS = ["shadows.taps=1", "sun.resolution=1024"]
WAYS = {
    "none": "forward",
    "MSAA 4": "forward-msaa",
    "FXAA": "fxaa",
    "SMAA": "smaa",
    "TAA": "taa",
    "16 pixels": "forward",
}


def light(picture: Any) -> Any:
    """What a display makes of bytes, 0 to 1."""
    c = picture[..., :3] / 255
    return np.where(c > 0.04045, ((c + 0.055) / 1.055) ** 2.4, c / 12.92)


def encoded(picture: Any) -> Any:
    """The other way round."""
    c = np.where(picture > 0.0031308, 1.055 * picture ** (1 / 2.4) - 0.055, 12.92 * picture)
    return np.ascontiguousarray((c * 255 + 0.5).astype(np.uint8))


def drawn(session: rg.Session, way: str, scene: Path, frame: int, times: int = 1) -> tuple[Any, float]:
    """A frame as light, with a mean of `times` times as many pixels each way, and its milliseconds."""
    width, height = SIZE
    pipeline = rg.load(WAYS[way], scene=scene, size=(width * times, height * times), sets=SHADOWS)
    first = 1 if way == "TAA" or times < 8 else frame  # several, for their least time
    made = list(session.frames(pipeline, outputs=["image"], frames=range(first, frame + 1), reuse=False))[-1]
    fine = light(made["image"]).reshape(height, times, width, times, 3).mean(axis=(1, 3))
    return fine, made.frame_ms["min"]


def turning(scene: Path, folder: Path) -> Path:
    """The scene with a camera that goes round it."""
    file = folder / f"turning-{scene.name}"
    file.write_text(scene.read_text(encoding="utf-8") + "orbit: {degrees_per_second: 10}\n", encoding="utf-8")
    return file


def main() -> None:
    """Write the table to stdout, and the picture where one is named."""
    from tempfile import TemporaryDirectory

    rows, lines, cost = [], [], dict.fromkeys(WAYS, float("inf"))
    with rg.Session() as session, TemporaryDirectory() as folder:
        for scene in (HERE / "thin.yaml", HERE / "highlights.yaml", HERE / "shadows.yaml"):
            row = []
            for moment, file, frame in (("", scene, STILL), (", turning", turning(scene, Path(folder)), TURNING)):
                exact, _ = drawn(session, "none", file, frame, 8)
                errors = []
                for way in WAYS:
                    times = 4 if way == "16 pixels" else 1
                    found, ms = drawn(session, way, file, frame, times)
                    cost[way] = min(cost[way], ms)
                    errors.append(f"{np.sqrt(((found - exact) ** 2).mean()):.4f}")
                    if not moment:
                        tile = np.repeat(np.repeat(found[CROP], ENLARGED, 0), ENLARGED, 1)
                        row.append(np.pad(tile, ((0, GAP), (0, GAP), (0, 0)), constant_values=1))
                lines.append(f"| {scene.stem}{moment} | {' | '.join(errors)} |")
            rows.append(np.hstack(row))
    print(f"| RMSE | {' | '.join(WAYS)} |")
    print(f"|---|{'---|' * len(WAYS)}")
    print("\n".join(lines))
    print(f"| ms a frame | {' | '.join(f'{ms:.0f}' for ms in cost.values())} |")
    if len(sys.argv) > 1:
        images.write(Path(sys.argv[1]), encoded(np.vstack(rows)))


if __name__ == "__main__":
    main()
