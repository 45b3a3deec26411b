"""Speed of path tracing, and its cost against the number of triangles.

`python tests/bench/bench_rays.py [SCENE ...]`; without arguments the Cornell box, the courtyard and ever finer spheres.
Run it without `GALLIVM_PERF=nopt`, which slows shaders down. Wall time means little while others use the machine; CPU
time is that of all threads of the process.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import rendergraph as rg

SIZE, SAMPLES = (320, 180), 16
SEGMENTS = {"cornell_box": 2.16, "courtyard": 2.63}
"""Rays with their shadow rays that a path has on average, as counted once in the shader."""


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


def main() -> None:
    """Print paths and segments a second of each scene."""
    scenes: list[str | Path] = list(sys.argv[1:])
    paths = SIZE[0] * SIZE[1] * SAMPLES
    with rg.Session() as session, tempfile.TemporaryDirectory() as name:
        if not scenes:
            scenes = [*SEGMENTS, *(sphere_scene(Path(name) / f"sphere_{side}.yaml", side) for side in (16, 64, 256))]
        for scene in scenes:
            cpu, wall = measure(session, scene)
            text = f"{Path(scene).stem:12} {paths / cpu / 1e6:5.2f} M paths a CPU second, {paths / wall / 1e6:5.2f} a second"
            each = SEGMENTS.get(str(scene))
            print(
                text
                + (f"; {each * paths / cpu / 1e6:5.2f} and {each * paths / wall / 1e6:5.2f} M segments" if each else "")
            )


if __name__ == "__main__":
    main()
