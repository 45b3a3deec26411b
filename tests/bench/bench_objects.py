"""Work on the CPU for 10 and for 10,000 objects: `python tests/bench/bench_objects.py`.

A frame of `forward` must take as many Python calls and as many GL calls, and no GL object, however many objects there
are. Counts, not times: a software rasteriser does the drawing inside the call. A plain loop over the objects stands
beside it, and both pictures are compared first.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from bench_forward import EYE, FAR, FOV_Y, INTENSITY, NEAR, TARGET, TO_LIGHT, write_glb
from forward_by_hand import Forward, look_at, perspective, sphere
from gl_calls import available, counting, made
from measure import check_pictures, options, save

SIZE = (320, 180)
COUNTS = (10, 10_000)


def objects(count: int) -> tuple[Any, Any, Any]:
    """Small spheres in a box, of four materials."""
    random = np.random.default_rng(1)
    models = np.tile(np.eye(4), (count, 1, 1))
    models[:, :3, 3] = random.uniform(-5, 5, (count, 3))
    models[:, :3, :3] *= 0.5 if count < 100 else 0.05
    kinds = np.arange(count) % 4
    colors = np.array([(0.9, 0.3, 0.2), (0.2, 0.9, 0.3), (0.3, 0.4, 0.9), (0.8, 0.8, 0.8)])[kinds]
    surfaces = np.array([(0.0, 0.4), (0.0, 0.8), (1.0, 0.3), (1.0, 0.6)])[kinds]
    return models, colors, surfaces


def calls_of(draw: Any) -> int:
    """Python and C calls of a function, as the interpreter's profiler sees them."""
    count = 0

    def see(frame: Any, event: str, argument: Any) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(see)
    draw()
    sys.setprofile(None)
    return count - 1  # the last one is setprofile's own


def framework(count: int, folder: Path, pictures: str | None) -> dict[str, float]:
    """Calls of a frame with a still camera, and with one that moves, so that objects are sorted anew."""
    import dataclasses

    import rendergraph as rg
    from rendergraph.scene.cameras import view_matrices

    mesh = sphere(8, 6)
    models, colors, surfaces = objects(count)
    file = folder / f"{count}.glb"
    write_glb(file, mesh, models, colors, surfaces)
    with counting() as calls, rg.Session() as session:
        pipeline = rg.load("forward", scene=file, size=SIZE, sets=["light.lookup=null"])
        picture = session.render(pipeline)["image"]
        camera = perspective(FOV_Y, SIZE[0] / SIZE[1], NEAR, FAR) @ look_at(EYE, TARGET)
        by_hand = Forward(SIZE, mesh, models, colors, surfaces, camera, EYE, TO_LIGHT, INTENSITY)
        by_hand.frames(1)
        save(pictures, **{f"objects_{count}_framework": picture, f"objects_{count}_by_hand": by_hand.picture()})
        check_pictures(f"{count} objects", picture, by_hand.picture(), bound=4, share=0.002)
        with session.device.current():
            runner = session.compile(pipeline, reuse=False).runner
            scene = pipeline.link().scene
            still = view_matrices(next(iter(scene.cameras.values())), SIZE)
            views = []
            for number in range(8):
                view = still.view.copy()
                view[0, 3] += 0.01 * number
                views.append(dataclasses.replace(still, view=view))
            frame = 0

            def draw(view: Any) -> None:
                nonlocal frame
                frame += 1
                runner.run(frame, frame / 30, 1 / 30, scene, view)

            result: dict[str, float] = {}
            for name, used in (("still", [still] * 4), ("moving", views[:4])):
                for earlier in used[:2]:
                    draw(earlier)
                before = calls.taken()
                draw(used[2])
                taken = calls.taken() - before
                result |= {f"{name}_gl": taken.total(), f"{name}_gl_objects": made(taken)}
                result[f"{name}_python"] = calls_of(lambda view=used[3]: draw(view))
        return result


def loop_by_hand(count: int) -> dict[str, float]:
    """The same counts for a plain loop that draws one object at a time."""
    mesh = sphere(8, 6)
    models, colors, surfaces = objects(count)
    camera = perspective(FOV_Y, SIZE[0] / SIZE[1], NEAR, FAR) @ look_at(EYE, TARGET)
    with counting() as calls:
        program = Forward(SIZE, mesh, models, colors, surfaces, camera, EYE, TO_LIGHT, INTENSITY)

        def draw() -> None:
            program.target.use()
            program.target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
            for _ in range(count):
                program.spheres.render(instances=1)

        with program.ctx:
            draw()
            before = calls.taken()
            draw()
            gl = (calls.taken() - before).total()
            return {"gl": gl, "python": calls_of(draw)}


def main() -> None:
    chosen = options(__doc__)
    if not available:
        raise SystemExit("GL calls cannot be counted on this machine")
    with tempfile.TemporaryDirectory() as folder:
        ours = {count: framework(count, Path(folder), chosen.save) for count in COUNTS}
    loop = {count: loop_by_hand(count) for count in COUNTS}
    same = ours[COUNTS[0]] == ours[COUNTS[1]]
    if chosen.json:
        print(json.dumps({"same": same, "framework": ours, "loop_by_hand": loop}, indent=1))
        return
    print(f"{'calls a frame':34}" + "".join(f"{count:>9,} objects" for count in COUNTS))
    for key in ours[COUNTS[0]]:
        print(
            f"  framework, {key.replace('_', ': ', 1).replace('_', ' '):21}"
            + "".join(f"{ours[c][key]:17,}" for c in COUNTS)
        )
    for key in ("gl", "python"):
        print(f"  a loop by hand: {key:16}" + "".join(f"{loop[c][key]:17,}" for c in COUNTS))
    print("the same" if same else "NOT the same")


if __name__ == "__main__":
    main()
