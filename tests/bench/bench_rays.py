"""Speed of path tracing, and its cost against the number of triangles.

`python tests/bench/bench_rays.py [SCENE ...] [FILE.svg]`; without scenes the Cornell box, the courtyard and ever finer
spheres, whose cost is drawn into the file.
Run it without `GALLIVM_PERF=nopt`, which slows shaders down. Wall time means little while others use the machine; CPU
time is that of all threads of the process.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import rendergraph as rg

SIZE, SAMPLES = (320, 180), 16
SIDES = (8, 16, 32, 64, 128, 256, 512)
SEGMENTS = {"cornell_box": 2.16, "courtyard": 2.56, "Sponza": 3.56}
"""Rays with their shadow rays that a path has on average, as counted once in the shader; Sponza as a glTF file."""


def measure(session: rg.Session, scene: str | Path) -> tuple[float, float]:
    """The least CPU and wall seconds of a frame, of three."""
    pipeline = rg.load("path-traced", scene=scene, size=SIZE).set("light.samples", SAMPLES)
    frames = session.frames(pipeline, frames=range(1, 5), warm_up=False, still=1)
    next(frames)
    found = []
    for _ in range(3):
        started = time.process_time(), time.perf_counter()
        next(frames)
        found.append((time.process_time() - started[0], time.perf_counter() - started[1]))
    return min(cpu for cpu, _ in found), min(wall for _, wall in found)


def sphere_scene(target: Path, side: int) -> Path:
    """A sphere of about 2 side² triangles under the sky."""
    text = f"scene: 1\nobjects: {{ball: {{shape: sphere, radius: 1, segments: {side}}}}}\nenvironment: {{file: sky}}\n"
    target.write_text(text)
    return target


def plot(file: Path, costs: Sequence[tuple[int, float]]) -> None:
    """Draw microseconds of a path against triangles, on a logarithmic axis, as SVG."""
    low, high = math.log10(costs[0][0]), math.log10(costs[-1][0])
    top = max(cost for _, cost in costs) * 1.15
    points = [(70 + 500 * (math.log10(n) - low) / (high - low), 250 - 220 * cost / top) for n, cost in costs]
    parts = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 620 310" font-family="sans-serif" font-size="14">']
    parts.append('<rect width="620" height="310" fill="white"/>')
    for power in range(math.ceil(low), math.floor(high) + 1):
        x = 70 + 500 * (power - low) / (high - low)
        parts.append(f'<line x1="{x:.1f}" y1="30" x2="{x:.1f}" y2="250" stroke="#ddd"/>')
        parts.append(f'<text x="{x:.1f}" y="270" text-anchor="middle">{10**power:,}</text>')
    step = min((step for step in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50) if top / step < 6), default=100.0)
    for number in range(int(top / step) + 1):
        value = step * number
        y = 250 - 220 * value / top
        parts.append(f'<line x1="70" y1="{y:.1f}" x2="570" y2="{y:.1f}" stroke="#ddd"/>')
        parts.append(f'<text x="62" y="{y + 5:.1f}" text-anchor="end">{value:g}</text>')
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    parts.append(f'<polyline points="{line}" fill="none" stroke="#1f5fa8" stroke-width="2"/>')
    parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="#1f5fa8"/>' for x, y in points]
    parts.append('<text x="320" y="296" text-anchor="middle">triangles of a sphere</text>')
    parts.append('<text x="70" y="20">µs of CPU time for a path</text></svg>')
    file.write_text("\n".join(parts) + "\n")


def main() -> None:
    """Print paths and segments a second of each scene."""
    arguments = [argument for argument in sys.argv[1:] if not argument.endswith(".svg")]
    pictures = [Path(argument) for argument in sys.argv[1:] if argument.endswith(".svg")]
    scenes: list[str | Path] = list(arguments)
    paths = SIZE[0] * SIZE[1] * SAMPLES
    costs = []
    with rg.Session() as session, tempfile.TemporaryDirectory() as name:
        spheres = {sphere_scene(Path(name) / f"sphere_{side}.yaml", side): 2 * side**2 for side in SIDES}
        if not scenes:
            scenes = ["cornell_box", "courtyard", *spheres]
        for scene in scenes:
            cpu, wall = measure(session, scene)
            text = f"{Path(scene).stem:12} {paths / cpu / 1e6:5.2f} M paths a CPU second, {paths / wall / 1e6:5.2f} a second"
            each = SEGMENTS.get(Path(scene).stem)
            if each:
                text += f"; {each * paths / cpu / 1e6:5.2f} and {each * paths / wall / 1e6:5.2f} M segments"
            print(text, flush=True)
            if scene in spheres:
                costs.append((spheres[Path(scene)], cpu / paths * 1e6))
    for picture in pictures if costs else ():
        plot(picture, costs)


if __name__ == "__main__":
    main()
