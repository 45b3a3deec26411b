"""Three works against plain moderngl, every frame read back: `python tests/bench/bench_works.py`.

W1: a million triangles in 25 spheres under one light. W2: a ground under them, and a 1024² shadow map. W3: ambient
occlusion of 32 samples, too. Camera and light move in each frame, at 1280×720; `works_by_hand.py` is the other half. CPU
time of frames, threads of the rasteriser included, and of the first frame with everything that it takes to get there but
for imports, each in a process of its own: what one program leaves behind makes the next one's first frame cheaper or dearer.
Goal: at most 1.0.
"""

from __future__ import annotations

import gc
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib import import_module
from itertools import count, islice
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
import numpy.typing as npt
from bench_forward import FAR, FOV_Y, INTENSITY, NEAR, TARGET, spheres
from forward_by_hand import look_at, perspective, sphere
from measure import Draw, Row, check_pictures, compare, keep_memory, options, report, save
from works_by_hand import Deferred, Moving, ground

import rendergraph as rg

SIZE = (1280, 720)
GROUND, HALF = -5.6, 20.0
SECONDS = 20.0
EYES = np.array([(-3.0, 3.0, 15.0), (4.0, 4.5, 14.0)])
DIRECTIONS = np.array([(-0.7, -0.8, -0.5), (0.1, -0.9, -0.6)])
SETS = {
    "W1": ["light.lookup=null"],
    "W2": ["sun.resolution=1024"],
    "W3": ["sun.resolution=1024", "ao.samples=32"],
}

LATE = (
    "glcontext.egl",
    "yaml",
    "rendergraph.scene.scene_file",
    "rendergraph.pipelines.shapes",
    "rendergraph.nodes.display.tonemap",
    "rendergraph.nodes.geometry.gbuffer",
    "rendergraph.nodes.lighting.deferred_lighting",
    "rendergraph.nodes.lighting.forward_lighting",
    "rendergraph.nodes.occlusion.ssao_hemisphere",
    "rendergraph.nodes.shadows.shadow_map",
    "rendergraph.nodes.shadows.shadow_pcf",
)
"""What is imported on the way to a first frame of ours or theirs."""


def scene(under: bool) -> str:
    """The spheres as a scene file, over a ground, with what moves."""
    models, colors, surfaces = spheres()
    lines = ["scene: 1", "objects:"]
    for number, model in enumerate(models):
        at = model[:3, 3].tolist()
        shape = f"shape: sphere, radius: 1, segments: 200, rings: 101, at: {at}, material: m{number}"
        lines.append(f"  ball{number}: {{{shape}}}")
    if under:
        lines.append(
            f"  ground: {{shape: plane, size: [{2 * HALF}, {2 * HALF}], at: [0, {GROUND}, 0], material: grey}}"
        )
    lines += ["materials:", "  grey: {base_color: [0.6, 0.6, 0.6], roughness: 0.9, metallic: 0}"]
    for number, (color, (metallic, roughness)) in enumerate(zip(colors, surfaces, strict=True)):
        look = f"base_color: {color.tolist()}, metallic: {metallic}, roughness: {roughness}"
        lines.append(f"  m{number}: {{{look}}}")
    lens = f"fov_y_degrees: {math.degrees(FOV_Y)}, near: {NEAR}, far: {FAR}"
    moving = [f"{{0: {ends[0].tolist()}, {SECONDS}: {ends[1].tolist()}}}" for ends in (EYES, DIRECTIONS)]
    return "\n".join(
        [
            *lines,
            f"lights: {{sun: {{type: directional, direction: {DIRECTIONS[0].tolist()}, intensity: {INTENSITY}}}}}",
            f"cameras: {{main: {{eye: {EYES[0].tolist()}, target: {list(TARGET)}, {lens}}}}}",
            f"keyframes: {{cameras.main.eye: {moving[0]}, lights.sun.direction: {moving[1]}}}",
            "",
        ]
    )


def by_hand(name: str) -> Any:
    """The hand-written program of a work."""
    models, colors, surfaces = spheres()
    center = models[:, :3, 3].mean(axis=0)
    radius = float(np.linalg.norm(models[:, :3, 3] - center, axis=1).max() + 1)
    more: dict[str, Any] = (
        {} if name == "W1" else {"shadow": 1024, "ball": (center, radius), "under": ground(GROUND, HALF)}
    )
    kind = Deferred if name == "W3" else Moving
    light = -DIRECTIONS[0] / np.linalg.norm(DIRECTIONS[0])
    return kind(SIZE, sphere(200, 101), models, colors, surfaces, np.eye(4), tuple(EYES[0]), light, INTENSITY, **more)


class Drawn(NamedTuple):
    """A program of a work: `draw` so many frames more, and the last `picture`, (height, width, 4)."""

    draw: Draw
    picture: Callable[[], npt.NDArray[Any]]


def hand_drawn(name: str) -> Drawn:
    """The hand-written program with its camera and its light moving, each frame read back."""
    program = by_hand(name)
    projection = perspective(FOV_Y, SIZE[0] / SIZE[1], NEAR, FAR)
    numbers = count()

    def draw(frames: int) -> None:
        with program.ctx:
            for number in islice(numbers, frames):
                share = number / 30 / SECONDS
                eye, direction = (ends[0] + (ends[1] - ends[0]) * share for ends in (EYES, DIRECTIONS))
                program.look(look_at(eye, TARGET), projection, eye, -direction / np.linalg.norm(direction))
                program.draw()
                program.bytes = program.screen.read(components=4)

    return Drawn(draw, lambda: np.frombuffer(program.bytes, "u1").reshape(SIZE[1], SIZE[0], 4)[::-1])


def ours_drawn(name: str, session: rg.Session, file: Path) -> Drawn:
    """The same by the framework, of a scene file."""
    pipeline = rg.load("ssao-hemisphere" if name == "W3" else "forward", scene=file, size=SIZE, sets=SETS[name])
    with session.device.current():
        drawing = session.compile(pipeline, outputs=["image"], warm_up=False)
    numbers = count(1)
    last: dict[str, Any] = {}

    def draw(frames: int) -> None:
        with session.device.current():
            for number in islice(numbers, frames):
                drawing.draw(number)
                last["image"] = drawing.read()["image"]

    return Drawn(draw, lambda: last["image"])


def first_frame(name: str, who: str, file: Path) -> NoReturn:
    """Print the CPU seconds of a first frame, from the first line that makes something; for a process of its own."""
    rg.Session  # noqa: B018 - `bench_first_picture` has what imports take
    for late in LATE:
        import_module(late)
    gc.collect()
    begun = time.process_time()
    drawn = hand_drawn(name) if who == "hand" else ours_drawn(name, rg.Session().__enter__(), file)
    drawn.draw(1)
    print(time.process_time() - begun, flush=True)
    os._exit(0)  # what is left is no part of it


def first_frames(name: str, file: Path, pairs: int) -> dict[str, float]:
    """Seconds of CPU time of the first frame of each, in processes that take turns, and the ratio: medians."""
    taken: dict[str, list[float]] = {"ours": [], "hand": []}
    for _ in range(pairs):
        for who, times in taken.items():
            command = [sys.executable, __file__, "--first", name, who, str(file)]
            times.append(float(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout))
    ratio = statistics.median(ours / hand for ours, hand in zip(*taken.values(), strict=True))
    return {who: statistics.median(times) for who, times in taken.items()} | {"ratio": ratio}


def bench(name: str, file: Path, *, frames: int, turns: int, folder: str | None) -> Row:
    """Frames of one of the works."""
    hand = hand_drawn(name)
    with rg.Session() as session:
        ours = ours_drawn(name, session, file)
        hand.draw(1)
        ours.draw(1)
        pictures = {"by_hand": hand.picture(), "framework": ours.picture()}
        save(folder, **{f"{name}_{who}": picture for who, picture in pictures.items()})
        share = {"W1": 0.0, "W2": 0.02, "W3": 0.1}[name]  # edges of shadows; another occlusion
        check_pictures(name, pictures["framework"], pictures["by_hand"], bound=6, share=share)
        return compare(name, ours.draw, hand.draw, frames=frames, turns=turns, goal=1.0)


def main() -> None:
    keep_memory()
    if sys.argv[1:2] == ["--first"]:
        first_frame(sys.argv[2], sys.argv[3], Path(sys.argv[4]))
    chosen = options(__doc__, frames=1, turns=20, work=0, pairs=5)
    rows: list[Row] = []
    firsts: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as temporary:
        file = Path(temporary) / "work.yaml"
        for name in SETS if not chosen.work else [f"W{chosen.work}"]:
            file.write_text(scene(name != "W1"))
            if chosen.pairs:
                firsts[name] = first_frames(name, file, chosen.pairs)
            if chosen.turns:
                rows.append(bench(name, file, frames=chosen.frames, turns=chosen.turns, folder=chosen.save))
    if rows or chosen.json:
        report(rows, chosen.json, **({"first_frames_s": firsts} if chosen.json else {}))
    for name, first in firsts.items() if not chosen.json else ():
        print(f"{name}: first frame {first['ours']:.2f} s, by hand {first['hand']:.2f} s, ratio {first['ratio']:.2f}")


if __name__ == "__main__":
    main()
