"""`forward` on a million triangles against plain moderngl: `python tests/bench/bench_forward.py`.

25 spheres of 40,000 triangles at 1280×720 under one directional light, without and with a 1024² shadow map. The
hand-written program is `forward_by_hand.py`. Goals: 0.95 and 0.85 of its CPU time.
"""

from __future__ import annotations

import json
import math
import struct
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from forward_by_hand import Forward, look_at, perspective, sphere
from measure import Row, check_pictures, compare, frame_loop, keep_memory, options, report, save

SIZE = (1280, 720)
EYE, TARGET = (1.5, 1.5, 15.0), (0.0, 0.0, -0.5)
FOV_Y, NEAR, FAR = math.radians(45), 0.1, 100.0
TO_LIGHT = np.array([0.5, 0.8, 0.6]) / np.linalg.norm([0.5, 0.8, 0.6])
INTENSITY = 3.0
GOALS = {None: 0.95, 1024: 0.85}


def spheres(side: int = 5) -> tuple[Any, Any, Any]:
    """A grid of unit spheres, every other one further back: matrices, colours, and metallic with roughness."""
    models, colors, surfaces = [], [], []
    for y in range(side):
        for x in range(side):
            model = np.eye(4)
            model[:3, 3] = 2.2 * (x - (side - 1) / 2), 2.2 * (y - (side - 1) / 2), -1.5 * ((x + y) % 2)
            models.append(model)
            colors.append((0.9, 0.3 + 0.15 * (x % 5), 0.2 + 0.15 * (y % 5)))
            surfaces.append(((y % 5) / 4, 0.15 + 0.2 * (x % 5)))
    return np.array(models), np.array(colors), np.array(surfaces)


def write_glb(path: Path, mesh: tuple[Any, Any, Any], models: Any, colors: Any, surfaces: Any) -> None:
    """The scene as a file, one node and one material a sphere, with its camera and light."""
    view = look_at(EYE, TARGET)
    light = look_at(TO_LIGHT, (0, 0, 0))
    arrays = [np.ascontiguousarray(a) for a in mesh]
    offsets = np.cumsum([0, *(a.nbytes for a in arrays)]).tolist()
    vertices, triangles = len(mesh[0]), mesh[2].size
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_lights_punctual"],
        "scene": 0,
        "scenes": [{"nodes": list(range(len(models) + 2))}],
        "nodes": [
            {"name": "camera", "camera": 0, "matrix": np.linalg.inv(view).T.ravel().tolist()},
            {
                "name": "sun",
                "matrix": np.linalg.inv(light).T.ravel().tolist(),
                "extensions": {"KHR_lights_punctual": {"light": 0}},
            },
            *({"name": f"ball{i}", "mesh": i, "matrix": m.T.ravel().tolist()} for i, m in enumerate(models)),
        ],
        "cameras": [
            {
                "type": "perspective",
                "perspective": {"yfov": FOV_Y, "aspectRatio": SIZE[0] / SIZE[1], "znear": NEAR, "zfar": FAR},
            }
        ],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": INTENSITY}]}},
        "materials": [
            {
                "pbrMetallicRoughness": {
                    "baseColorFactor": [*color.tolist(), 1],
                    "metallicFactor": metallic,
                    "roughnessFactor": roughness,
                }
            }
            for color, (metallic, roughness) in zip(colors, surfaces, strict=True)
        ],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2, "material": i}]}
            for i in range(len(models))
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": vertices,
                "type": "VEC3",
                "min": mesh[0].min(0).tolist(),
                "max": mesh[0].max(0).tolist(),
            },
            {"bufferView": 1, "componentType": 5126, "count": vertices, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5125, "count": triangles, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": o, "byteLength": a.nbytes} for o, a in zip(offsets[:-1], arrays, strict=True)
        ],
        "buffers": [{"byteLength": offsets[-1]}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data = b"".join(a.tobytes() for a in arrays)
    with open(path, "wb") as file:
        file.write(struct.pack("<III", 0x46546C67, 2, 28 + len(text) + len(data)))
        file.write(struct.pack("<II", len(text), 0x4E4F534A) + text)
        file.write(struct.pack("<II", len(data), 0x004E4942) + data)


def by_hand(shadow: int | None, mesh: tuple[Any, Any, Any], size: tuple[int, int] = SIZE, side: int = 5) -> Forward:
    """The hand-written program over the same spheres."""
    models, colors, surfaces = spheres(side)
    camera = perspective(FOV_Y, size[0] / size[1], NEAR, FAR) @ look_at(EYE, TARGET)
    center = models[:, :3, 3].mean(axis=0)
    radius = float(np.linalg.norm(models[:, :3, 3] - center, axis=1).max() + 1)
    return Forward(size, mesh, models, colors, surfaces, camera, EYE, TO_LIGHT, INTENSITY, shadow, (center, radius))


def pipeline(scene: Path, shadow: int | None) -> Any:
    """`forward` of that scene."""
    import rendergraph as rg

    sets = ["light.lookup=null"] if shadow is None else [f"sun.resolution={shadow}"]
    return rg.load("forward", scene=scene, size=SIZE, sets=sets)


def bench(shadow: int | None, *, frames: int, turns: int, folder: str | None = None) -> Row:
    """One of the two comparisons."""
    import rendergraph as rg

    name = "without shadows" if shadow is None else f"{shadow}² shadow map"
    mesh = sphere(200, 101)
    assert len(mesh[2]) == 40_000
    program = by_hand(shadow, mesh)
    program.frames(1)
    with tempfile.TemporaryDirectory() as temporary, rg.Session() as session:
        scene = Path(temporary) / "spheres.glb"
        write_glb(scene, mesh, *spheres())
        made = pipeline(scene, shadow)
        with session.device.ctx:
            picture = session.render(made)["image"]
            ours = frame_loop(session, made)
        tag = "plain" if shadow is None else "shadows"
        save(folder, **{f"forward_{tag}_framework": picture, f"forward_{tag}_by_hand": program.picture()})
        check_pictures(name, picture, program.picture(), bound=4, share=0.0 if shadow is None else 0.02)
        return compare(name, ours, program.frames, frames=frames, turns=turns, goal=GOALS[shadow])


def main() -> None:
    chosen = options(__doc__, frames=1, turns=40)
    keep_memory()
    rows = [bench(shadow, frames=chosen.frames, turns=chosen.turns, folder=chosen.save) for shadow in (None, 1024)]
    report(rows, chosen.json)


if __name__ == "__main__":
    main()
