"""Percentage-closer filtering: the function's text against brute force, the pipeline against ray-cast masks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.resources import folder

Floats = npt.NDArray[np.float64]


def brute_force(depth: Floats, u: float, v: float, receiver: float, taps: int) -> float:
    """The mean of taps × taps bilinear comparisons one texel apart around (u, v), clamped at the border."""
    lit = (receiver <= depth).astype(float)
    size = depth.shape[0]
    total = 0.0
    for j in range(taps):
        for i in range(taps):
            x = u * size - 0.5 + i - (taps - 1) / 2
            y = v * size - 0.5 + j - (taps - 1) / 2
            x0, y0 = int(np.floor(x)), int(np.floor(y))
            for dy, wy in ((0, 1 - (y - y0)), (1, y - y0)):
                for dx, wx in ((0, 1 - (x - x0)), (1, x - x0)):
                    total += wx * wy * lit[np.clip(y0 + dy, 0, size - 1), np.clip(x0 + dx, 0, size - 1)]
    return total / taps**2


def look_up(gl: Any, depth: Floats, places: Floats, taps: int) -> Floats:
    """`map_visibility` of shadow_pcf.glsl at (u, v, receiver), in a compute shader."""
    import moderngl

    text = (folder("rendergraph.shaders") / "shadows" / "shadow_pcf.glsl").read_text().split("#include")[0]
    source = f"""#version 450 core
#define TAPS {taps}
{text}
layout(local_size_x = 1) in;
layout(std430) buffer data_block {{ vec4 data[]; }};
void main() {{
    uint i = gl_GlobalInvocationID.x;
    data[i].w = map_visibility(0, data[i].xyz);
}}
"""
    # One layer: the same text over a plain depth texture, which moderngl can make.
    for array, plain in (("sampler2DArrayShadow", "sampler2DShadow"), ("vec3(middle, float(layer))", "middle")):
        assert array in source
        source = source.replace(array, plain)
    source = source.replace("vec4(place.xy, float(layer), place.z)", "place")
    with gl:
        program = gl.compute_shader(source)
        texture = gl.depth_texture(depth.shape[::-1], depth.astype(np.float32).tobytes())
        texture.compare_func = "<="
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        texture.repeat_x = texture.repeat_y = False
        texture.use(0)
        data = gl.buffer(np.concatenate([places, np.zeros((len(places), 1))], 1).astype(np.float32).tobytes())
        data.bind_to_storage_buffer(0)
        program.run(len(places))
        gl.finish()
        found = np.frombuffer(data.read(), np.float32).reshape(-1, 4)[:, 3].astype(np.float64)
        for thing in (program, texture, data):
            thing.release()
    return found


# --- pictures against ray casting ------------------------------------------------------------------------------------


def wrong_share(shared: Path, case: str, *sets: str, pipeline: str = "forward") -> float:
    """Per cent of the pixels away from shadow edges whose lit state is not the ray-cast one."""
    here = shared / "reference" / "b2_shadows" / case
    camera = json.loads((here / "case.json").read_text())["camera"]
    masks = np.load(here / "masks.npz")
    sets = ("light.ambient=0", "light.terms=diffuse", "shadows.taps=1", *sets)
    size = (camera["width"], camera["height"])
    frame = rg.load(pipeline, scene=here / "scene.glb", size=size, sets=sets).render(outputs=["radiance"])
    lit = frame["radiance"][..., :3].sum(-1) > 1e-6
    judged = (masks["cls"] > 0) & ~masks["edge"].astype(bool)
    return float(100 * (lit != (masks["cls"] == 1))[judged].mean())


@pytest.mark.parametrize("case", ["dir_basic", "dir_camera_in_shadow", "dir_cascades", "spot_basic"])
def test_hard_shadows_are_the_ray_cast_ones(gl: Any, shared: Path, case: str) -> None:
    assert wrong_share(shared, case) <= 0.02
    assert wrong_share(shared, case, pipeline="forward-prepass") <= 0.02
    assert wrong_share(shared, case, "sun.resolution=64") > 0.02


def test_a_point_light_has_six_layers(gl: Any, shared: Path) -> None:
    assert wrong_share(shared, "point_room", "sun.light=point", "sun.resolution=1024") <= 0.02


def test_wider_kernels_make_no_acne(gl: Any, shared: Path) -> None:
    """Away from shadows a lit surface is wholly lit, also at a slope and through 16×16 taps."""
    here = shared / "reference" / "b2_shadows" / "dir_basic"
    masks = np.load(here / "masks.npz")
    for taps in (1, 3, 16):
        sets = ("light.ambient=0", "light.terms=diffuse", f"shadows.taps={taps}")
        shadowed = rg.load("forward", scene=here / "scene.glb", size=(384, 384), sets=sets).render()["radiance"]
        bare = rg.load("forward", scene=here / "scene.glb", size=(384, 384), sets=(*sets, "light.lookup=null"))
        ratio = shadowed[..., 1] / np.maximum(bare.render()["radiance"][..., 1], 1e-6)
        far = (masks["cls"] == 1) & ~masks["edge"].astype(bool)
        for _ in range(14):  # pixels farther from any edge than the kernel is wide
            grown = np.pad(far, 1, mode="edge")
            far = far & grown[:-2, 1:-1] & grown[2:, 1:-1] & grown[1:-1, :-2] & grown[1:-1, 2:]
        assert far.sum() > 10_000
        assert np.mean(ratio[far] < 0.999) < 1e-3


# --- both forms ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scene", ["cornell_box", "shadow_study", "spheres"])
def test_both_forms_give_the_same_picture(gl: Any, scene: str) -> None:
    pictures = [
        rg.load(name, scene=scene, size=(640, 360)).render()["image"].astype(int)
        for name in ("forward", "forward-prepass")
    ]
    assert np.mean(np.abs(pictures[0] - pictures[1]).max(-1) > 1) <= 1e-3


def test_lights_that_are_not_named_cast_no_shadow(gl: Any, shared: Path) -> None:
    scene = shared / "reference" / "b1_direct" / "point_spot_persp" / "scene.glb"
    with_map = rg.load("forward", scene=scene, size=(80, 60)).graph
    assert with_map.lights[1].type == "spot"
    (info,) = [info for end, info in with_map.textures.items() if str(end) == "sun.shadow_map"]
    assert info.lights == (1,)


def test_without_a_light_that_casts_visibility_is_one(gl: Any, shared: Path) -> None:
    """Only a point light: `auto` finds nothing, the pass is culled, and the picture is the unshadowed one."""
    scene = shared / "reference" / "b2_shadows" / "point_room" / "scene.glb"
    frame = rg.load("forward", scene=scene, size=(64, 64)).render()
    bare = rg.load("forward", scene=scene, size=(64, 64), sets=["light.lookup=null"]).render()
    assert "sun" in frame.culled
    np.testing.assert_array_equal(frame["radiance"], bare["radiance"])
