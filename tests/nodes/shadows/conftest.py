"""Shadow techniques against NumPy: the map, the pixels' places in it, and the visibility that was drawn."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from rendergraph.nodes.shadows._light_views import light_views

import rendergraph as rg
from rendergraph.resources import folder
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.facts import FrameScene

Floats = npt.NDArray[np.float64]
SHADERS = folder("rendergraph.shaders") / "shadows"


@dataclass(frozen=True)
class Looked:
    """What a shadow node read and what it made of it, rows from the bottom.

    Attributes:
        visibility: (height, width), of the first light.
        depth: the light's map, as the documents have it: 0 near to 1 far.
        fraction: the same, linear over the light's range, 1 where nothing is.
        places: (height, width, 3): texture coordinates and window depth in the map.
        receiver: linear depth of every pixel over the light's range.
        position: (height, width, 3) in world space.
        seen: where a surface is.
        metres: of the light's range.
    """

    visibility: Floats
    depth: Floats
    fraction: Floats
    places: Floats
    receiver: Floats
    position: Floats
    seen: npt.NDArray[np.bool_]
    metres: float


@pytest.fixture
def look(session: rg.Session) -> Callable[..., Looked]:
    """Draw a pipeline with neither bias nor offset and say what its shadow node read."""

    def run(
        pipeline: str,
        *sets: str,
        scene: str | Path | None = None,
        size: tuple[int, int] = (96, 64),
        resolution: int = 128,
    ) -> Looked:
        fixed = ("shadows.bias=0", "shadows.normal_offset=0", f"sun.resolution={resolution}")
        loaded = rg.load(pipeline, size=size, scene=scene, sets=(*fixed, *sets))
        taps = ("sun.shadow_map", "shadows.visibility", "gbuffer.depth")
        frame = session.render(loaded, outputs=(), taps=taps, warm_up=False)
        depth, visibility, seen = (np.asarray(frame.arrays[tap], np.float64)[..., ::-1, :, 0] for tap in taps)
        depth, seen = 1 - depth, 1 - seen
        stage = loaded.link().scene
        camera = view_matrices(next(iter(stage.cameras.values())), size)
        table = [end for end in loaded.link().graph.textures if str(end) == "sun.shadow_map"]
        light = stage.lights[loaded.link().graph.textures[table[0]].lights[0]]
        view = light_views(light, FrameScene(stage), camera, resolution)[0]
        y, x = np.mgrid[0 : size[1], 0 : size[0]]
        clip = np.stack([(x + 0.5) / size[0], (y + 0.5) / size[1], seen, np.ones_like(seen)], -1)
        clip[..., :3] = clip[..., :3] * 2 - 1
        world = clip @ np.linalg.inv(camera.projection @ camera.view).T
        world /= world[..., 3:]
        there = world @ (view.projection @ view.view).T
        places = there[..., :3] / there[..., 3:] * 0.5 + 0.5

        def linear(window: Floats) -> Floats:
            p = view.projection
            z = window * 2 - 1
            distance = (p[2, 3] - p[3, 3] * z) / (p[2, 2] - p[3, 2] * z)
            return np.asarray((distance - view.near) / (view.far - view.near))

        return Looked(
            visibility[0],
            depth[0],
            np.where(depth[0] == 1, 1.0, linear(depth[0])),
            places,
            linear(np.minimum(places[..., 2], 1.0)),
            world[..., :3],
            seen < 1,
            float(view.far - view.near),
        )

    return run


@pytest.fixture(scope="session")
def bilinear() -> Callable[..., Floats]:
    """Values of texels at texture coordinates, weighted bilinearly, the border's texels going on.

    With `receiver` it is the tests that are weighted, 1 where it is at most the texel's depth.
    """

    def run(texels: Floats, u: Floats, v: Floats, receiver: Floats | None = None) -> Floats:
        rows, columns = texels.shape
        x, y = u * columns - 0.5, v * rows - 0.5
        x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
        total = np.zeros(np.shape(u))
        for dy, wy in ((0, 1 - (y - y0)), (1, y - y0)):
            for dx, wx in ((0, 1 - (x - x0)), (1, x - x0)):
                value = texels[np.clip(y0 + dy, 0, rows - 1), np.clip(x0 + dx, 0, columns - 1)]
                total += wx * wy * (value if receiver is None else receiver <= value)
        return total

    return run


@pytest.fixture(scope="session")
def boxed() -> Callable[[Floats, int], Floats]:
    """Means over squares of 2 radius + 1 texels, the border's texels going on."""

    def run(texels: Floats, radius: int) -> Floats:
        padded = np.pad(texels, radius, mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(padded, (2 * radius + 1,) * 2)
        return np.asarray(windows.mean((-1, -2)))

    return run


@pytest.fixture(scope="session")
def poisson_disc() -> Floats:
    """The points of the irregular kernels."""
    found = re.findall(r"vec2\((-?[\d.]+), (-?[\d.]+)\)", (SHADERS / "poisson_disc.glsl").read_text())
    return np.array(found, np.float64)


@pytest.fixture
def glsl_function(gl: Any) -> Callable[..., float]:
    """One function of a shader's text: `glsl_function(file, name, call, **uniforms)` is the value of the call."""

    def run(file: str, name: str, call: str, **uniforms: float) -> float:
        text = re.search(rf"^float {name}\(.*?^}}", (SHADERS / file).read_text(), re.DOTALL | re.MULTILINE)
        assert text is not None
        constants = "".join(f"const float {key} = {value!r};\n" for key, value in uniforms.items())
        source = f"""#version 450 core
{constants}{text[0]}
layout(local_size_x = 1) in;
layout(std430) buffer made_block {{ float made; }};
void main() {{ made = {call}; }}
"""
        with gl:
            program, made = gl.compute_shader(source), gl.buffer(reserve=4)
            made.bind_to_storage_buffer(0)
            program.run(1)
            gl.finish()
            value = float(np.frombuffer(made.read(), np.float32)[0])
            program.release()
            made.release()
        return value

    return run
