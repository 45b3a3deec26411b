"""From the start of the process to the first PNG: `python tests/bench/bench_first_picture.py`.

One sphere at 640×360 with a shadow map, by `rendergraph run`, by the Python API, and by a hand-written program that
imports moderngl and NumPy and writes its PNG itself. Goal: at most 0.12 s more. Then the same at the default size, without and
with an environment around it, which is to take at most 0.5 s more. Then imports alone: what `run` imports beside NumPy and
moderngl alone, at most 0.15 s of CPU time more. The driver's cache is warm and modules are compiled, as after an installation.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from measure import options

SIZE = (640, 360)
GOAL_S = 0.12
GOAL_STUDIO_S = 0.5
SCENE = """\
scene: 1
objects:
  ball: {shape: sphere, radius: 1, material: paint}
materials:
  paint: {base_color: [0.8, 0.3, 0.2], roughness: 0.5}
lights:
  sun: {type: directional, direction: [-1, -2, -1], intensity: 3}
cameras:
  main: {eye: [0, 1, 3], target: [0, 0, 0], fov_y_degrees: 45, near: 0.1, far: 10}
"""
API = """\
import sys
import rendergraph as rg
rg.load("forward", scene=sys.argv[1], size=(640, 360)).render(outputs=["image"]).save(sys.argv[2])
"""

LOADED = """\
import atexit, sys
atexit.register(lambda: print(*sys.modules))
from rendergraph.cli import main
main()
"""
IMPORT = """\
import gc, importlib, sys
gc.set_threshold(100_000)
for name in sys.argv[1:]:
    importlib.import_module(name)
gc.freeze()
"""
"""Cycles are looked for as seldom as the command looks for them."""
BESIDE = {"in a studio": "default size", "imports": "NumPy, moderngl", "NumPy, moderngl": "NumPy, moderngl"}
"""What a row is compared with, where that is not the program by hand."""


def by_hand(output: str) -> None:
    """The hand-written program; run in a process of its own."""
    import numpy as np
    from forward_by_hand import Forward, look_at, perspective, sphere
    from png import write_png

    eye, to_light = (0.0, 1.0, 3.0), np.array([1.0, 2.0, 1.0]) / 6**0.5
    camera = perspective(np.radians(45), SIZE[0] / SIZE[1], 0.1, 10.0) @ look_at(eye, (0, 0, 0))
    program = Forward(
        SIZE,
        sphere(64, 32),
        np.eye(4)[None],
        np.array([[0.8, 0.3, 0.2]]),
        np.array([[0.0, 0.5]]),
        camera,
        eye,
        to_light,
        3.0,
        2048,
        ((0, 0, 0), 1.1),
    )
    program.frames(1)
    write_png(Path(output), np.ascontiguousarray(program.picture()[..., :3]))


def commands(scene: Path, folder: Path) -> dict[str, list[str]]:
    """What is run, by name; each writes a PNG of its name."""
    python = sys.executable
    size = f"{SIZE[0]}x{SIZE[1]}"
    run = [python, "-m", "rendergraph", "run", "forward", "--scene", str(scene), "--size", size]
    large = run[:-2]
    modules = subprocess.run(
        [python, "-c", LOADED, *run[3:], "-o", str(folder / "x.png")], capture_output=True, text=True
    )
    names = [name for name in modules.stdout.splitlines()[-1].split() if not name.startswith("__")]
    return {
        "by hand": [python, str(Path(__file__)), "--by-hand", str(folder / "by hand.png")],
        "rendergraph run": [*run, "-o", str(folder / "rendergraph run.png")],
        "Python API": [python, "-c", API, str(scene), str(folder / "Python API.png")],
        "default size": [*large, "-o", str(folder / "default size.png")],
        "in a studio": [*large, "--environment", "studio", "-o", str(folder / "in a studio.png")],
        "imports": [python, "-c", IMPORT, "numpy", "moderngl", *names],
        "NumPy, moderngl": [python, "-c", IMPORT, "numpy", "moderngl"],
    }


def environment(folder: Path) -> dict[str, str]:
    """This process's, with a folder for compiled modules whatever it says about them."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return kept | {"PYTHONPYCACHEPREFIX": str(folder)}


def timed(command: list[str], variables: dict[str, str]) -> tuple[float, float]:
    """Seconds of wall and of CPU time of a process."""
    wall, before = time.perf_counter(), os.times()
    done = subprocess.run(command, capture_output=True, text=True, env=variables)
    after = os.times()
    if done.returncode:
        raise SystemExit(done.stderr)
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return time.perf_counter() - wall, cpu


def check(folder: Path) -> None:
    """The three PNGs show the same sphere."""
    import OpenImageIO as oiio
    from measure import check_pictures

    pictures: dict[str, Any] = {
        path.stem: oiio.ImageBuf(str(path)).get_pixels(oiio.UINT8) for path in folder.glob("*.png")
    }
    for name in ("rendergraph run", "Python API"):
        check_pictures(name, pictures[name][..., :3], pictures["by hand"][..., :3], bound=6, share=0.02)


def main() -> None:
    if sys.argv[1:2] == ["--by-hand"]:
        by_hand(sys.argv[2])
        return
    chosen = options(__doc__, runs=9)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(chosen.save or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        scene = Path(temporary) / "ball.yaml"
        scene.write_text(SCENE)
        todo = commands(scene, folder)
        taken: dict[str, list[tuple[float, float]]] = {name: [] for name in todo}
        variables = environment(Path(temporary) / "compiled")
        for command in todo.values():
            timed(command, variables)
        check(folder)
        for _ in range(chosen.runs):
            for name, command in todo.items():
                taken[name].append(timed(command, variables))
    rows: dict[str, dict[str, Any]] = {}
    for name, times in taken.items():
        beside = taken[BESIDE.get(name, "by hand")]
        more = [a[0] - b[0] for a, b in zip(times, beside, strict=True)]
        rows[name] = {
            "wall_s": statistics.median(wall for wall, _ in times),
            "cpu_s": statistics.median(cpu for _, cpu in times),
            "more_wall_s": statistics.median(more),
            "more_wall_range_s": [min(more), max(more)],
            "more_cpu_s": statistics.median(a[1] - b[1] for a, b in zip(times, beside, strict=True)),
        }
    if chosen.json:
        print(json.dumps({"goal_more_s": GOAL_S, "goal_studio_s": GOAL_STUDIO_S, "programs": rows}, indent=1))
        return
    print(
        f"{'':16}  wall s   CPU s   more wall (range)         more CPU   goal: <= {GOAL_S} s more, studio {GOAL_STUDIO_S}"
    )
    for name, row in rows.items():
        low, high = row["more_wall_range_s"]
        print(
            f"{name:16} {row['wall_s']:7.3f} {row['cpu_s']:7.3f}   {row['more_wall_s']:6.3f} ({low:.3f} to {high:.3f})"
            f"   {row['more_cpu_s']:8.3f}"
        )


if __name__ == "__main__":
    main()
