"""Occlusion and light between surfaces against 8 to 128 samples: `python tests/bench/bench_ssao.py`.

All techniques over the same G-buffer, as the document's figures 28 (occlusion) and 30 (with light between surfaces).
Milliseconds are those of `ao` or `gi` alone: a frame's CPU time, driver threads included, which is where a software
rasteriser's frame happens, less that of the G-buffer and of the light that is gathered, measured in turn with it;
medians over the turns. Filters are part of it, and `ms at half size` is with `scale` 0.5.
"""

from __future__ import annotations

import statistics
from dataclasses import dataclass
from typing import Any

import numpy as np
from measure import cpu_and_wall, figures, frame_loop, keep_memory, markdown, options, save
from occlusion_plot import plot

SIZE = (320, 180)
SCENE = "cornell_box"
SAMPLES = (8, 16, 32, 64, 128)
SURFACES = {"image": None, "radiance": None, "depth": "gbuffer.depth", "normal": "gbuffer.normal"}
LIT = SURFACES | {"diffuse": "light.diffuse"}
OPEN, SENT = {"occlusion": "ao.occlusion"}, {"indirect": "gi.indirect"}
PIPELINES: dict[str, tuple[dict[str, str | None], dict[str, str]]] = {  # what it stands on, and what it makes
    "ssao-hemisphere": (SURFACES, OPEN),
    "ssao-disc": (SURFACES, OPEN),
    "ssao-hbao": (SURFACES, OPEN),
    "ssao-gtao": (SURFACES, OPEN),
    "ssgi": (LIT, SENT),
    "ssao-ssgi": (LIT, SENT | {"occlusion": "gi.occlusion"}),
    "ssil": (LIT, SENT | {"occlusion": "gi.occlusion"}),
}


@dataclass(frozen=True)
class Cell:
    """One technique at one number of samples.

    Attributes:
        pipeline, samples: what was drawn.
        ms: median CPU time of `ao` or `gi`, with the least and the most.
        half_ms: median with `scale` 0.5.
        mean: mean of what it makes, to show that the work was done: how open surfaces are, or the light they get.
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
        for name, (stands_on, makes) in PIPELINES.items():
            bare = rg.load("deferred", scene=SCENE, size=SIZE, patches=[{"outputs": stands_on}])
            node = "gi" if makes.keys() & SENT.keys() else "ao"
            for samples in SAMPLES:
                patch = {"outputs": stands_on | makes}
                whole, half_size = (
                    rg.load(name, scene=SCENE, size=SIZE, sets=[*sets, f"{node}.scale={scale}"], patches=[patch])
                    for sets in [[f"{node}.samples={samples}"]]
                    for scale in (1, 0.5)
                )
                picture = np.asarray(session.render(whole)[next(iter(makes))])
                if not np.isfinite(picture).all() or np.ptp(picture) < 0.3:
                    raise SystemExit(f"{name}: the picture is empty")
                picture = picture[..., :3] if node == "gi" else np.repeat(picture[..., None], 3, -1)
                save(folder, **{f"{name}-{samples}": picture})
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
    """Markdown: a row a technique, a column a number of samples."""
    heads = ("technique", *(f"{samples}, half size" for samples in SAMPLES))
    rows = [
        (
            name,
            *(
                f"{c.ms:.1f}, {c.half_ms:.1f}"
                for samples in SAMPLES
                for c in cells
                if (c.pipeline, c.samples) == (name, samples)
            ),
        )
        for name in PIPELINES
    ]
    return markdown(device, SIZE, heads, rows)


def main() -> None:
    chosen = options(__doc__, frames=2, turns=3)
    keep_memory()
    cells, device = bench(chosen.frames, chosen.turns, chosen.save)
    figures(chosen, "occlusion", device, cells, table(cells, device), plot)


if __name__ == "__main__":
    main()
