"""Screen-space occlusion against 8 to 128 samples: `python tests/bench/bench_ssao.py`.

Both techniques over the same G-buffer, as the document's figure 28. Milliseconds are those of `ao`
alone: a frame's CPU time, driver threads included, which is where a software rasteriser's frame happens, less that of
the G-buffer, measured in turn with it; medians over the turns. `blur` is part of the hemispheres' time and `ms at half
size` is with `scale` 0.5.
"""

from __future__ import annotations

import statistics
from dataclasses import dataclass
from typing import Any

import numpy as np
from measure import cpu_and_wall, figures, frame_loop, keep_memory, markdown, options, save
from occlusion_plot import plot

SIZE = (480, 270)
SAMPLES = (8, 16, 32, 64, 128)
PIPELINES = ("ssao-hemisphere", "ssao-disc")
SURFACES = {"image": None, "radiance": None, "depth": "gbuffer.depth", "normal": "gbuffer.normal"}


@dataclass(frozen=True)
class Cell:
    """One technique at one number of samples.

    Attributes:
        pipeline, samples: what was drawn.
        ms: median CPU time of `ao`, with the least and the most.
        half_ms: median with `scale` 0.5.
        mean: mean occlusion of the picture, to show that the work was done.
    """

    pipeline: str
    samples: int
    ms: float
    least_ms: float
    most_ms: float
    half_ms: float
    mean: float


def bench(frames: int, turns: int, folder: str | None) -> tuple[list[Cell], str]:
    """Every technique at every number of samples."""
    import rendergraph as rg

    cells: list[Cell] = []
    with rg.Session() as session:
        bare = rg.load("deferred", size=SIZE, patches=[{"outputs": SURFACES}])
        for name in PIPELINES:
            for samples in SAMPLES:
                patch = {"outputs": SURFACES | {"occlusion": "ao.occlusion"}}
                whole, half_size = (
                    rg.load(name, size=SIZE, sets=[f"ao.samples={samples}", f"ao.scale={scale}"], patches=[patch])
                    for scale in (1, 0.5)
                )
                picture = np.asarray(session.render(whole)["occlusion"])
                if not np.isfinite(picture).all() or np.ptp(picture) < 0.3:
                    raise SystemExit(f"{name}: the picture is empty")
                save(folder, **{f"{name}-{samples}": np.repeat(picture, 3, -1)})
                turn = [[_time(session, made, frames) for made in (bare, whole, half_size)] for _ in range(turns)]
                full = [row[1] - row[0] for row in turn]
                half = [row[2] - row[0] for row in turn]
                cells.append(
                    Cell(
                        name,
                        samples,
                        statistics.median(full),
                        min(full),
                        max(full),
                        statistics.median(half),
                        float(picture.mean()),
                    )
                )
        return cells, session.device.renderer


def _time(session: Any, pipeline: Any, frames: int) -> float:
    """Milliseconds of CPU time a frame; prepared anew, for what another pipeline bound is bound no more."""
    loop = frame_loop(session, pipeline)
    loop(1)
    return cpu_and_wall(loop, frames)[0]


def table(cells: list[Cell], device: str) -> str:
    """Markdown."""
    heads = ("technique", "samples", "CPU ms (least to most)", "ms at half size", "mean occlusion")
    rows = [
        (
            c.pipeline,
            str(c.samples),
            f"{c.ms:.1f} ({c.least_ms:.1f} to {c.most_ms:.1f})",
            f"{c.half_ms:.1f}",
            f"{c.mean:.3f}",
        )
        for c in cells
    ]
    return markdown(device, SIZE, heads, rows)


def main() -> None:
    chosen = options(__doc__, frames=3, turns=5)
    keep_memory()
    cells, device = bench(chosen.frames, chosen.turns, chosen.save)
    figures(chosen, "occlusion", device, cells, table(cells, device), plot)


if __name__ == "__main__":
    main()
