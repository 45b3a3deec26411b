"""Pictures, errors and times of the ways to smooth edges: `python compare.py [picture.png]`.

Each scene of this folder is drawn small by each of them, still and while its camera turns, and measured against path
tracing without bounces: the mean of the light in a pixel, shown by the pipelines' own tone curve. A second table
measures against 64 pixels for each whose mean is taken behind the curve. Both are RMSE in display light. Milliseconds
are those of fast frames of the first scene (10th percentile). The picture has a row a scene and a column a technique,
its middle enlarged; the last one is the truth.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from images.layout import Layout, laid_out  # how the documentation's pictures are put together

import rendergraph as rg
from rendergraph import images
from rendergraph.compare import compare

HERE = Path(__file__).parent
SIZE = (192, 108)
CROP = (slice(28, 78), slice(58, 118))
ENLARGED, GAP = 3, 3
STILL, TURNING = 16, 12
TRUTH = "path-traced:light.max_bounces=0"
SAME_LIGHT = ("light.ambient=0", "light.background=[0.25, 0.32, 0.4]")
"""Light that a lighting node and a path tracer compute alike: none from all sides."""
SAME_SHADOWS = ("shadows.type=traced_shadows", "sun.light=all")
"""And shadows without a map's errors, where the scene casts some."""
WAYS = {"one sample": "forward", "MSAA 4": "forward-msaa", "FXAA": "fxaa", "SMAA": "smaa", "TAA": "taa"}


def light(picture: Any) -> Any:
    """Return what a display makes of bytes, 0 to 1."""
    c = picture[..., :3] / 255
    return np.where(c > 0.04045, ((c + 0.055) / 1.055) ** 2.4, c / 12.92)


def encoded(picture: Any) -> Any:
    """Return the bytes of a display's light."""
    c = np.where(picture > 0.0031308, 1.055 * picture ** (1 / 2.4) - 0.055, 12.92 * picture)
    return np.ascontiguousarray((c * 255 + 0.5).astype(np.uint8))


def load(way: str, scene: Path, times: int = 1) -> rg.Pipeline:
    """Return a pipeline with `times` times as many pixels each way."""
    sets = (*SAME_LIGHT, *(SAME_SHADOWS if "shadows" in scene.stem else ()))
    return rg.load(WAYS[way], scene=scene, size=(SIZE[0] * times, SIZE[1] * times), sets=sets)


def averaged(session: rg.Session, scene: Path, frame: int, times: int) -> Any:
    """Return the display light of a frame, the mean of `times` times as many pixels each way."""
    width, height = SIZE
    found = load("one sample", scene, times).render(session=session, outputs=["image"], frames=range(frame, frame + 1))
    return light(found["image"]).reshape(height, times, width, times, 3).mean(axis=(1, 3))


def rmse(picture: Any, other: Any) -> str:
    """Return the RMSE of display light as a cell of a table."""
    return f"{np.sqrt(((picture - other) ** 2).mean()):.4f}"


def turning(scene: Path, folder: Path) -> Path:
    """Return the scene with a camera that goes round it."""
    file = folder / f"turning-{scene.name}"
    file.write_text(scene.read_text(encoding="utf-8") + "orbit: {degrees_per_second: 10}\n", encoding="utf-8")
    return file


def main() -> None:
    """Write the tables to stdout, and the picture where one is named."""
    from tempfile import TemporaryDirectory

    names = [*WAYS, "16 pixels"]
    panels: list[Any] = []
    before: list[list[str]] = []
    behind: list[list[str]] = []
    cost: list[str] = []
    with rg.Session() as session, TemporaryDirectory() as folder:
        for scene in (HERE / "thin.yaml", HERE / "highlights.yaml", HERE / "shadows.yaml"):
            for moment, file, frame in (("", scene, STILL), (", turning", turning(scene, Path(folder)), TURNING)):
                found = compare(
                    [load(way, file) for way in WAYS],
                    TRUTH,
                    names=list(WAYS),
                    session=session,
                    frame=frame,
                    frames=1 if cost else 20,
                    reference_noise=0.02,
                    reference_seconds=100,
                )
                print(scene.stem, moment, found.reference.samples, found.noise_share, *found.notes, file=sys.stderr)
                truth, curved = light(found.reference.pixels), averaged(session, file, frame, 8)
                pictures = [*(light(each.pixels) for each in found.results), averaged(session, file, frame, 4)]
                cost = cost or [f"{result.times.headline.p10:.1f}" for result in found.results]
                before.append([scene.stem + moment, *(rmse(each, truth) for each in pictures)])
                behind.append([scene.stem + moment, *(rmse(each, curved) for each in pictures), rmse(truth, curved)])
                if not moment:
                    tiles = [each[CROP].repeat(ENLARGED, 0).repeat(ENLARGED, 1) for each in (*pictures, truth)]
                    panels += [encoded(tile) for tile in tiles]
    for heads, table in ((names, before), ([*names, "truth"], behind)):
        print(f"| RMSE | {' | '.join(heads)} |\n|---|{'---|' * len(heads)}")
        print("\n".join(f"| {' | '.join(line)} |" for line in table))
    print(f"| ms a frame | {' | '.join(cost)} |")
    if len(sys.argv) > 1:
        labels = [*names, "path traced"]
        images.write(Path(sys.argv[1]), laid_out(panels, Layout(len(labels), GAP, labels)))


if __name__ == "__main__":
    main()
