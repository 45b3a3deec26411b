"""Filtering an environment, and lighting triangles by it: `python tests/bench/bench_environment.py`.

The document's tables 4.1, milliseconds of filtering against 32 to 512 samples a texel, and 4.2, milliseconds a frame
against 1 to 16 million triangles, unlit and under physical light. Both are scaled down for software rasterisers, by 2
and by 64; `--full 1` takes the sizes of the tables. Filtering is the driver's time of what is made once, the least of
fresh sessions; `integrated` is what the defaults do instead of sampling. A frame is CPU time, driver threads included.
"""

from __future__ import annotations

import statistics
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from environment_plot import plot
from measure import cpu_and_wall, figures, frame_loop, keep_memory, markdown, options, save

SAMPLES = (32, 64, 128, 256, 512)
MILLIONS = (1, 2, 4, 8, 16)
SIZE = (320, 180)
SAMPLED = "environment.integrated_from=2"
BALL = "  ball_{0}: {{shape: sphere, radius: 0.4, segments: {1}, rings: {2}, at: [{3}, {4}, 0], material: metal}}\n"
SCENE = """scene: 1
materials: {{metal: {{base_color: [0.9, 0.7, 0.5], metallic: 1, roughness: 0.4}}}}
environment: {{file: studio}}
cameras: {{main: {{eye: [0, 0, 8], target: [0, 0, 0], fov_y_degrees: 32}}}}
objects:
{0}"""


@dataclass(frozen=True)
class Cell:
    """One measurement.

    Attributes:
        table: `filter` or `triangles`.
        name: `sampled` or `integrated`; `unlit` or `pbr`.
        count: samples a texel, or triangles drawn.
        ms: the median, of filtering the least, with the least and the most.
    """

    table: str
    name: str
    count: int
    ms: float
    least_ms: float
    most_ms: float


def bench(turns: int, frames: int, full: bool, folder: str | None) -> tuple[list[Cell], str]:
    """Both tables."""
    import rendergraph as rg

    side, share = (256, 1) if full else (128, 64)
    device, cells = "", []
    for name, samples in [("integrated", 64), *(("sampled", count) for count in SAMPLES)]:
        taken = []
        for _ in range(turns):
            sets = [f"environment.size={side}", f"environment.samples={samples}"]
            sets += [SAMPLED] if name == "sampled" else []
            with rg.Session() as session:
                frame = session.render(rg.load("ibl", size=(64, 36), sets=sets), timed=True, warm_up=False)
                device = session.device.renderer
            taken.append(next(float(str(entry["gpu_ms"])) for entry in frame.passes if entry["node"] == "environment"))
        cells.append(Cell("filter", name, samples, min(taken), min(taken), max(taken)))
    with tempfile.TemporaryDirectory() as home, rg.Session() as session:
        for millions in MILLIONS:
            path = Path(home) / f"{millions}.yaml"
            count = _balls(path, millions * 1_000_000 // share)
            loops = {}
            for name in ("unlit", "pbr"):
                pipeline = rg.load("forward", scene=path, size=SIZE, sets=[f"light.shading={name}"])
                picture = np.asarray(session.render(pipeline)["image"])
                if np.ptp(picture[..., :3]) < 100:
                    raise SystemExit(f"{name}: the picture is empty")
                save(folder, **{f"{name}-{millions}": picture[..., :3] / 255.0})
                loops[name] = frame_loop(session, pipeline)
                loops[name](1)
            for name, loop in loops.items():
                taken = [cpu_and_wall(loop, frames)[0] for _ in range(turns)]
                cells.append(Cell("triangles", name, count, statistics.median(taken), min(taken), max(taken)))
    return cells, device


def _balls(path: Path, triangles: int) -> int:
    """Sixteen balls of about so many triangles in all; how many they have."""
    rings = max(int((triangles / 64) ** 0.5), 3)
    places = [(i % 8 - 3.5, i // 8 - 0.5) for i in range(16)]
    path.write_text(SCENE.format("".join(BALL.format(i, 2 * rings, rings, *at) for i, at in enumerate(places))))
    return 16 * 2 * (2 * rings) * (rings - 1)


def table(cells: list[Cell], device: str) -> str:
    """Markdown: milliseconds with the least and the most."""
    rows = [(c.table, c.name, f"{c.count:,}", f"{c.ms:.1f} ({c.least_ms:.1f} to {c.most_ms:.1f})") for c in cells]
    return markdown(device, SIZE, ("table", "what", "samples or triangles", "ms"), rows)


def main() -> None:
    chosen = options(__doc__, frames=2, turns=3, full=0)
    keep_memory()
    cells, device = bench(chosen.turns, chosen.frames, bool(chosen.full), chosen.save)
    figures(chosen, "environment", device, cells, table(cells, device), plot)


if __name__ == "__main__":
    main()
