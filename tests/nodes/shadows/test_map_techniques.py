"""What holds for every shadow-map technique: ray-cast masks, both forms, several lights, narrow filters."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.pack import reversed_projection
from rendergraph.textures import TextureDesc
from tests.scenes import without_images

pytestmark = pytest.mark.slow  # pictures with large maps

Floats = npt.NDArray[np.float64]

NARROW = {
    "shadow_pcf": ("shadows.taps=2",),
    "shadow_vsm": ("shadows.radius=0", "shadows.light_bleeding=0"),
    "shadow_esm": ("shadows.radius=0",),
    "shadow_msm": ("shadows.radius=0", "shadows.light_bleeding=0"),
}
WIDE = {
    "shadow_pcf": ("shadows.taps=7", "shadows.kernel=rotated", "shadows.edges_only=true"),
    "shadow_vsm": ("shadows.radius=4",),
    "shadow_esm": ("shadows.radius=4",),
    "shadow_convolution": ("shadows.radius=4", "shadows.terms=4"),
    "shadow_msm": ("shadows.radius=4",),
    "shadow_pcss": ("shadows.angle=0.05",),
}


def visibility(session: rg.Session, kind: str, *sets: str, **options: Any) -> Floats:
    """What the node makes in screen space, of the first light."""
    loaded = rg.load("forward-prepass", sets=(f"shadows.type={kind}", *sets), **options)
    frame = session.render(loaded, outputs=(), taps=("shadows.visibility",), warm_up=False)
    return np.asarray(frame.arrays["shadows.visibility"][0, ..., 0], np.float64)


# --- against ray casting ---------------------------------------------------------------------------------------------


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("case", ["dir_basic", "dir_camera_in_shadow", "spot_basic", "point_room"])
@pytest.mark.parametrize("kind", ["shadow_pcf", "shadow_vsm", "shadow_msm"])
def test_narrow_filters_are_the_ray_cast_shadow(session: rg.Session, shared: Path, kind: str, case: str) -> None:
    here = shared / "reference" / "b2_shadows" / case
    camera = json.loads((here / "case.json").read_text())["camera"]
    masks = np.load(here / "masks.npz")
    sets = NARROW[kind] + (("sun.light=point", "sun.resolution=1024") if case == "point_room" else ())
    seen = visibility(session, kind, *sets, scene=here / "scene.glb", size=(camera["width"], camera["height"]))
    judged = np.isin(masks["cls"], (1, 2)) & ~masks["edge"].astype(bool)
    wrong = ((seen > 0.5) != (masks["cls"] == 1))[judged].mean()
    assert wrong <= 1e-3
    assert np.abs(seen - (masks["cls"] == 1))[judged].mean() <= 2e-3


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    ("kind", "name", "widths"), [("shadow_pcf", "taps", (16, 8, 4, 2)), ("shadow_vsm", "radius", (8, 4, 2, 0))]
)
def test_filters_that_shrink_lead_to_the_same_hard_shadow(look: Any, kind: str, name: str, widths: Any) -> None:
    """Narrower and narrower in texels, then in metres."""
    size = (192, 128)
    plain = look("shadow-map", size=size, resolution=4096)
    floor = plain.seen & (np.abs(plain.position[..., 1]) < 1e-3)  # elsewhere faces are turned away from the light
    same = (f"shadows.type={kind}", *NARROW[kind])

    def error(width: int, resolution: int) -> float:
        seen = look("shadow-pcf", *same, f"shadows.{name}={width}", size=size, resolution=resolution)
        return float(np.abs(seen.visibility - plain.visibility)[floor].mean())

    errors = [error(width, 512) for width in widths] + [error(widths[-1], 2048)]
    assert errors == sorted(errors, reverse=True), errors
    assert errors[0] > 0.01
    assert errors[-1] < 0.002


GRAZING = """scene: 1
objects:
  floor: {shape: plane, size: [8, 8]}
  box: {shape: box, size: [1, 1, 1], at: [0.4, 0.5, 0]}
lights: {sun: {type: directional, direction: [-0.8, -0.07, -0.6], intensity: 1}}
cameras: {main: {eye: [4, 2.5, 4], target: [0.4, 0.3, 0], fov_y_degrees: 40, near: 0.1, far: 50}}
"""


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize(("kind", "resolution"), [*((kind, 512) for kind in WIDE), ("shadow_pcf", 8192)])
def test_what_faces_the_light_has_no_acne(session: rg.Session, tmp_path: Path, kind: str, resolution: int) -> None:
    """A box on a floor, the sun four degrees over it, at the defaults: what no ray is blocked for is lit, to the pixel."""
    (tmp_path / "s.yaml").write_text(GRAZING)
    loaded = rg.load(
        "forward-prepass",
        scene=tmp_path / "s.yaml",
        size=(160, 120),
        sets=(f"shadows.type={kind}", f"sun.resolution={resolution}"),
    )
    frame = session.render(loaded, outputs=(), taps=("shadows.visibility", "prepass.depth"), warm_up=False)
    camera = view_matrices(loaded.link().scene.cameras["main"], (160, 120))
    depth = np.asarray(frame.arrays["prepass.depth"][..., 0], np.float64)
    y, x = np.mgrid[0:120, 0:160] + 0.5
    clip = np.stack([x / 80 - 1, 1 - y / 60, depth, np.ones_like(depth)], axis=-1)
    world = clip @ np.linalg.inv(reversed_projection(camera) @ camera.view).T
    points = world[..., :3] / world[..., 3:]
    faces = (depth > 0) & (  # the floor and the two sides that the sun meets, away from edges
        (np.abs(points[..., 1]) < 1e-3) & (np.abs(points[..., [0, 2]]).max(axis=-1) < 3.8)
        | (np.abs(points[..., [0, 2]] - (0.9, 0.5)) < 1e-3).any(axis=-1) & (np.abs(points[..., 1] - 0.5) < 0.45)
    )
    to_sun = np.array([0.8, 0.07, 0.6])
    slack = 0.3  # metres: kernels and penumbrae
    first, second = ((np.array(corner) - points) / to_sun for corner in ((-0.1, 0, -0.5), (0.9, 1, 0.5)))
    margin = slack / to_sun
    enter, leave = (np.minimum(first, second) - margin).max(axis=-1), (np.maximum(first, second) + margin).min(axis=-1)
    on_floor = np.abs(points[..., 1]) < 1e-3
    clear = faces & (~on_floor | (enter > leave) | (leave < 0))
    assert clear.sum() > 3000
    assert frame.arrays["shadows.visibility"][0, ..., 0][clear].min() > 0.95


# --- both forms ------------------------------------------------------------------------------------------------------


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("scene", ["cornell_box", "shadow_study"])
@pytest.mark.parametrize("kind", list(WIDE))
def test_both_forms_give_the_same_picture(session: rg.Session, kind: str, scene: str) -> None:
    pictures = []
    for name in ("forward", "forward-prepass"):
        sets = (f"shadows.type={kind}", "sun.resolution=1024", *WIDE[kind])
        camera = "eye=5,5,7.5 target=0,0.7,0 fov=40" if scene == "shadow_study" else None
        pipeline = without_images(rg.load(name, scene=scene, size=(320, 180), camera=camera, sets=sets))
        frame = session.render(pipeline, warm_up=False)
        pictures.append(frame["image"].astype(int))
    assert np.mean(np.abs(pictures[0] - pictures[1]).max(-1) > 1) <= 1e-3


LIGHTS = {
    "sun": "{type: directional, direction: [-1, -2, -0.6], intensity: 1.5}",
    "lamp": "{type: spot, at: [2, 4, 2], direction: [-2, -4, -2], intensity: 30, inner_degrees: 15, outer_degrees: 30}",
    "bulb": "{type: point, at: [-1.5, 2.5, 1.5], intensity: 8}",
    "far": "{type: spot, at: [-3, 5, 0], direction: [3, -5, 0], intensity: 40, inner_degrees: 10, outer_degrees: 25}",
}


def stage(folder: Path, *lights: str) -> Path:
    """A box, a ball and a floor under some of the lights."""
    rows = "\n".join(f"  {name}: {LIGHTS[name]}" for name in lights)
    file = folder / f"{'-'.join(lights)}.yaml"
    file.write_text(f"""scene: 1
objects:
  floor: {{shape: plane, size: [8, 8]}}
  box: {{shape: box, size: [0.8, 1.6, 0.8], at: [0.6, 0.8, -0.4], rotate_degrees: [0, 30, 0]}}
  ball: {{shape: sphere, radius: 0.5, at: [-0.7, 0.5, 0.5]}}
lights:
{rows}
cameras:
  main: {{eye: [3, 4, 5], target: [0, 0.4, 0], fov_y_degrees: 45, near: 0.1, far: 50}}
""")
    return file


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("kind", list(WIDE))
def test_several_lights_are_the_sum_of_each(session: rg.Session, tmp_path: Path, kind: str) -> None:
    """A directional, two spot and a point light (six layers) at once, in both forms."""

    def radiance(pipeline: str, *lights: str) -> Floats:
        names = ", ".join(lights)
        sets = (f"shadows.type={kind}", f"sun.light=[{names}]", "sun.resolution=128", "light.ambient=0", *WIDE[kind])
        loaded = rg.load(pipeline, scene=stage(tmp_path, *lights), size=(160, 120), sets=sets)
        return np.asarray(session.render(loaded, warm_up=False)["radiance"][..., :3], np.float64)

    alone = [radiance("forward-prepass", name) for name in LIGHTS]
    for pipeline in ("forward", "forward-prepass"):
        together = radiance(pipeline, *LIGHTS)
        assert together.max() > 0.5
        wrong = np.abs(together - sum(alone)) > together.max() / 255
        assert wrong.mean() <= 1e-3
    unshadowed = rg.load(
        "forward", scene=stage(tmp_path, *LIGHTS), size=(160, 120), sets=("light.lookup=null", "light.ambient=0")
    )
    bare = np.asarray(session.render(unshadowed, warm_up=False)["radiance"][..., :3], np.float64)
    assert np.mean(bare - together > 0.02 * bare.max()) > 0.05


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("name", ["vsm", "esm", "msm", "convolution"])
def test_the_type_is_the_whole_change(session: rg.Session, name: str) -> None:
    """The shipped file and PCF's with another type draw the same, their kernels being equally wide."""
    options: dict[str, Any] = {"size": (96, 64)}
    retyped = rg.load("shadow-pcf", sets=(f"shadows.type=shadow_{name}", "sun.resolution=256"), **options)
    shipped = rg.load(f"shadow-{name}", sets=("sun.resolution=256",), **options)
    pictures = [session.render(each, warm_up=False)["image"] for each in (retyped, shipped)]
    np.testing.assert_array_equal(pictures[0], pictures[1])


def test_layers_share_what_they_are_filtered_through(tmp_path: Path) -> None:
    """One band of columns for nine layers, a quarter of a map: a step writes it, the next reads it."""
    sets = ("shadows.type=shadow_vsm", "sun.light=[sun, lamp, bulb, far]", "sun.resolution=256")
    loaded = rg.load("forward", scene=stage(tmp_path, *LIGHTS), size=(160, 120), sets=sets)
    resources = loaded.expand().expansion.resources
    descs = {name: each.desc for name, each in resources.items() if isinstance(each.desc, TextureDesc)}
    assert descs["shadows.filtered_map"].layers == 9
    assert descs["shadows.filtered_columns"].layers == 1
    assert (descs["shadows.filtered_columns"].width, descs["shadows.filtered_columns"].height) == (256, 64)
    assert resources["shadows.coverage"].lights == (0, 1, 2, 2, 2, 2, 2, 2, 3)


@pytest.mark.parametrize("kind", list(WIDE))
def test_without_a_light_that_casts_visibility_is_one(session: rg.Session, kind: str) -> None:
    loaded = rg.load("forward", scene="many_lights", size=(64, 48), sets=(f"shadows.type={kind}",))
    frame = session.render(loaded, warm_up=False)
    bare = session.render(loaded.set("light.lookup", None), warm_up=False)
    assert "sun" in frame.culled
    np.testing.assert_array_equal(frame["radiance"], bare["radiance"])
