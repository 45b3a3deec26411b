"""Six ways to light a scene against 1, 8, 64 and 512 local lights: `python tests/bench/bench_lights.py`.

A floor with spheres under point lights whose range shrinks with their number, so that about as many of them reach any
point however many there are. Milliseconds are medians over frames of the process's CPU time, driver threads included,
which is where a software rasteriser's frame happens; fragments are those that pass depth and stencil in the steps of
`light` (a query of the device), and evaluations those times the lights each of them loops over. With four samples a
pixel the query counts samples: a shader that is run for each of them counts in full, one that is not a quarter.
Beside them what the document's Table 1 predicts: L (V + F) for forward with a pass a light, V + L F' for deferred with
volumes; those that loop over all lights in one shader cost V + L F, and with four samples behind a G-buffer also L times the
samples of pixels that are marked as edges. V is counted in vertices, F in fragments.
"""

from __future__ import annotations

import ctypes
import statistics
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from lights_plot import plot
from measure import cpu_and_wall, figures, frame_loop, keep_memory, markdown, options, save

SIZE = (240, 135)
COUNTS = (1, 8, 64, 512)
PIPELINES = ("forward", "forward-multipass", "deferred", "deferred-stencil-lights", "forward-msaa", "deferred-msaa")
MOST_EDGES = 0.08
"""Of the pixels, where several samples may draw another picture than one."""
_SAMPLES_PASSED, _RESULT = 0x8914, 0x8866


@dataclass(frozen=True)
class Cell:
    """One technique at one number of lights.

    Attributes:
        pipeline, lights: what was drawn.
        ms: median CPU time of a frame, with the fastest and slowest.
        fragments: fragments that the lighting steps shaded.
        evaluations: fragments times the lights each is shaded under.
        predicted: evaluations and vertices by the document's formula.
    """

    pipeline: str
    lights: int
    ms: float
    least_ms: float
    most_ms: float
    fragments: int
    evaluations: int
    predicted: float


def write_scene(folder: Path, lights: int) -> Path:
    """Spheres on a floor of 20 m under a grid of lights; the range is 3 m for 64, by area."""
    rng = np.random.default_rng(1)
    side = int(np.ceil(np.sqrt(lights)))
    reach = min(3.0 * (64 / lights) ** 0.5, 12.0)
    lines = ["scene: 1", "objects:", "  floor: {shape: plane, size: [20, 20], material: white}"]
    lines += [
        f"  ball_{i}: {{shape: sphere, radius: 0.7, segments: 48, at: [{x:.2f}, 0.7, {z:.2f}], material: white}}"
        for i, (x, z) in enumerate(np.stack(np.meshgrid(*[np.linspace(-8, 8, 6)] * 2), -1).reshape(-1, 2))
    ]
    lines += ["materials: {white: {base_color: [0.8, 0.8, 0.8], roughness: 0.5}}", "lights:"]
    for i in range(lights):
        x, z = (((i % side) + 0.5) / side - 0.5) * 18, ((i // side + 0.5) / side - 0.5) * 18
        r, g, b = rng.uniform(0.2, 1, 3)
        lines.append(
            f"  l{i}: {{type: point, at: [{x:.3f}, {0.4 * reach:.3f}, {z:.3f}], range: {reach:.3f}, casts_shadow: false, "
            f"intensity: {0.7 * reach**2:.3f}, color: [{r:.2f}, {g:.2f}, {b:.2f}]}}"
        )
    lines.append("cameras: {main: {eye: [0, 9, 15], target: [0, 0, 1], fov_y_degrees: 50, near: 0.1, far: 60}}")
    (folder / f"lights_{lights}.yaml").write_text("\n".join(lines) + "\n")
    return folder / f"lights_{lights}.yaml"


def shaded(session: Any, executable: Any) -> list[tuple[Any, int]]:
    """Fragments that each lighting step lets through; call after a frame, whose state it repeats."""
    raw, found = session.device.raw, []
    with session.device.current():
        for compiled in executable.lists[0]:
            query = raw.make("glCreateQueries", _SAMPLES_PASSED)
            raw.glBeginQuery(_SAMPLES_PASSED, query)
            for call in compiled.calls:
                call()
            raw.glEndQuery(_SAMPLES_PASSED)
            value = ctypes.c_uint64()
            raw.glGetQueryObjectui64v(query, _RESULT, ctypes.byref(value))
            raw.delete("glDeleteQueries", query)
            if compiled.step.node == "light" and any(write.name == "radiance" for write in compiled.step.writes):
                step = compiled.step
                alone = {"PER_SAMPLE", "ONE_SAMPLE"} & set(dict(step.defines))
                together = 1 if alone else step.samples
                found.append((step, value.value // together))
    return found


def marked(steps: list[tuple[Any, int]]) -> int:
    """Samples that are lit one by one."""
    return sum(count for step, count in steps if "ONE_SAMPLE" in dict(step.defines))


def evaluations(pipeline: str, steps: list[tuple[Any, int]], lights: int, covered: int) -> int:
    """Fragments times the lights that their shader loops over; where nothing is, deferred's ends before its loop."""
    if pipeline.startswith("deferred") and pipeline != "deferred-stencil-lights":
        return (covered + marked(steps)) * lights
    if pipeline.startswith("forward") and pipeline != "forward-multipass":
        return sum(count for _, count in steps) * lights
    return sum(count for step, count in steps if any(name == "light" for name, _ in step.uniforms))


def predict(pipeline: str, lights: int, vertices: int, drawn: int, covered: int, local: int, edges: int) -> float:
    """Table 1 for V vertices and L lights.

    F is what a technique shades: all that forward draws in its order (`drawn`), or what is seen (`covered`); `local` is
    the sum of F', the fragments that each light reaches, `edges` the samples of pixels that are marked as edges.
    """
    return {
        "forward": vertices + lights * drawn,
        "forward-multipass": lights * (vertices + covered),
        "deferred": vertices + lights * covered,
        "deferred-stencil-lights": vertices + local,
        "forward-msaa": vertices + lights * drawn,
        "deferred-msaa": vertices + lights * (covered + edges),
    }[pipeline]


def bench(frames: int, folder: str | None) -> tuple[list[Cell], str]:
    """Every technique at every number of lights; a time counts only where the pictures agree."""
    import rendergraph as rg

    cells: list[Cell] = []
    with tempfile.TemporaryDirectory() as temporary, rg.Session() as session:
        for lights in COUNTS:
            scene = write_scene(Path(temporary), lights)
            pictures, counted, times, vertices, covered = {}, {}, {}, 0, 0
            for name in PIPELINES:
                # Nothing else in the picture: no sun casts here, and the G-buffer's rounding stays out.
                sets = ["gbuffer.precision=full"] if name.startswith("deferred") else []
                made = rg.load(name, scene=scene, size=SIZE, sets=sets)
                drawn = np.asarray(session.render(made, outputs=["radiance"])["radiance"])
                pictures[name] = drawn[..., :3]
                covered = int((drawn[..., 3] == 1).sum()) if name == "forward" else covered
                save(folder, **{f"lights_{lights}_{name}": pictures[name] ** (1 / 2.2)})
                loop = frame_loop(session, made)
                loop(1)
                times[name] = [cpu_and_wall(loop, 1)[0] for _ in range(frames)]
                counted[name] = shaded(session, loop.executable)  # type: ignore[attr-defined]
                vertices = sum(
                    len(made.link().scene.meshes[entry.mesh].positions) for entry in made.link().scene.objects
                )
            edges = marked(counted["deferred-msaa"])
            local = evaluations("deferred-stencil-lights", counted["deferred-stencil-lights"], lights, covered)
            for name in PIPELINES:
                off = np.abs(pictures[name] - pictures["forward"]).max(-1) > 0.01 * pictures["forward"].max()
                if off.mean() > (MOST_EDGES if name.endswith("msaa") else 1e-3):
                    raise SystemExit(f"{name} draws another picture at {lights} lights")
                fragments = sum(count for _, count in counted[name])
                cells.append(
                    Cell(
                        name,
                        lights,
                        statistics.median(times[name]),
                        min(times[name]),
                        max(times[name]),
                        fragments,
                        evaluations(name, counted[name], lights, covered),
                        predict(name, lights, vertices, sum(c for _, c in counted["forward"]), covered, local, edges),
                    )
                )
        return cells, session.device.renderer


def table(cells: list[Cell], device: str) -> str:
    """Markdown."""
    heads = ("technique", "lights", "CPU ms (least to most)", "fragments shaded", "light evaluations", "predicted")
    rows = [
        (
            c.pipeline,
            str(c.lights),
            f"{c.ms:.1f} ({c.least_ms:.1f} to {c.most_ms:.1f})",
            f"{c.fragments:,}",
            f"{c.evaluations:,}",
            f"{c.predicted:,.0f}",
        )
        for c in cells
    ]
    return markdown(device, SIZE, heads, rows)


def main() -> None:
    chosen = options(__doc__, frames=5)
    keep_memory()
    cells, device = bench(chosen.frames, chosen.save)
    figures(chosen, "lights", device, cells, table(cells, device), plot)


if __name__ == "__main__":
    main()
