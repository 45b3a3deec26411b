"""Every shipped pipeline under every kind of camera: each picture is what another camera shows of the same thing.

Cameras are given to a compiled pipeline one after the other, so that it is compiled once. Panoramas are no cameras here:
a view is one matrix.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from msgspec.structs import replace

import rendergraph as rg
from rendergraph.errors import InputError
from rendergraph.resources import shipped_pipelines
from rendergraph.scene.model import Camera

Floats = npt.NDArray[np.float64]

SCENE = """scene: 1
objects:
  ground: {shape: plane, size: [6, 6], material: clay, casts_shadow: false}
  box: {shape: box, size: [0.9, 1.4, 0.9], at: [-0.5, 0.7, -0.3], rotate_degrees: [0, 25, 0], material: clay}
  low: {shape: box, size: [0.8, 0.5, 0.8], at: [0.6, 0.25, 0.5], material: red}
  pane: {shape: plane, size: [0.8, 0.8], at: [0.5, 0.6, 1.1], rotate_degrees: [90, 10, 0], material: pane, casts_shadow: false}
materials:
  clay: {base_color: [0.7, 0.66, 0.6], roughness: 0.8}
  red: {base_color: [0.7, 0.15, 0.1], roughness: 0.5}
  pane: {base_color: [0.2, 0.5, 0.8, 0.5], alpha_mode: blend}
lights:
  sun: {type: directional, direction: [-0.5, -1, -0.4], intensity: 1.2}
  lamp: {type: point, at: [1, 1.6, 1], intensity: 1, range: 6}
cameras:
  main: {eye: [1.8, 2.4, 4], target: [0, 0.5, 0], fov_y_degrees: 42, near: 0.5, far: 20}
"""
TRACED = ("light.samples=64", "light.antialiasing=false")
MORE_RAYS = {"hybrid": ("ao.samples=32",)}  # the noise of 4 rays alone differs by more than the cameras
SETS = ("sun.resolution=128", "light.ambient=0.4", "exposure.limit=0", *TRACED)  # where the pipeline has them
UNBLENDED = "light.blended=false"
BLENDING = {"forward", "deferred"}  # drawn with the surfaces that others leave out, to compile less
PICTURES_OF_THE_SCREEN = {
    "overdraw",
    "terms",
    "shadow-cascaded-shown",
    "shadow-map-shown",
}  # legends, tiles, several views
NOT_FROM_AFAR = {"fog", "path-traced-denoised"}  # fog gets thicker, and the filter's tolerance grows with the distance
SIDE = 32
AFAR = 100.0


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("cameras") / "scene.yaml"
    path.write_text(SCENE)
    return path


def small(name: str, scene: Path) -> rg.Pipeline:
    pipeline = rg.load(name, scene=scene, size=(SIDE, SIDE))
    for setting in (*SETS, *MORE_RAYS.get(name, ()), *(() if name in BLENDING else (UNBLENDED,))):
        path, _, value = setting.partition("=")
        try:
            changed = pipeline.set(path, value)
            changed.resolve()
            changed.link()
        except InputError:
            continue
        pipeline = changed
    return pipeline


def quarters(picture: Floats) -> Floats:
    """Each 2 × 2 pixels as one."""
    return np.asarray(picture.reshape(SIDE // 2, 2, SIDE // 2, 2, 3).mean(axis=(1, 3)))


def differing(a: Floats, b: Floats, by: float) -> float:
    """The share of pixels that are so many 255ths apart."""
    assert a.mean() > 2, "black pictures agree with anything black"
    return float((np.abs(a - b).max(axis=-1) > by).mean())


@pytest.mark.nightly(keep=2)
@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(shipped_pipelines()))
def test_every_pipeline_draws_what_every_camera_sees(session: rg.Session, scene: Path, name: str) -> None:
    with session.current():
        drawing = session.compile(small(name, scene), outputs=["image"])
        camera = drawing.expanded.linked.scene.cameras["main"]
        assert camera.target is not None
        target, eye = np.array(camera.target), camera.transform[:3, 3]
        distance, slope = float(np.linalg.norm(eye - target)), float(np.tan(camera.fov_y / 2))

        def seen(by: Camera) -> Floats:
            drawing.begin()
            drawing.draw(1, by)
            return np.asarray(drawing.read()["image"][..., :3], np.float64)

        plain = seen(camera)
        assert differing(seen(replace(camera, far=float("inf"))), plain, 4) <= 0.01
        top = camera.near * slope
        corner = seen(replace(camera, type="frustum", frustum=(0.0, top, 0.0, top)))
        flat = replace(camera, type="orthographic", height=2 * distance * slope)
        if name == "ssgi-hemicube":
            with pytest.raises(
                InputError, match=r"RG209 node 'cube' \(hemicube\): a hemicube .* camera is orthographic"
            ):
                seen(flat)
            return
        parallel = seen(flat)
        placed = camera.transform.copy()
        placed[:3, 3] = target + (eye - target) * AFAR
        back = distance * (AFAR - 1)
        afar = replace(
            camera,
            transform=placed,
            fov_y=2 * float(np.arctan(slope / AFAR)),
            near=camera.near + back,
            far=camera.far + back,
        )
        from_afar = seen(afar)
    if name in PICTURES_OF_THE_SCREEN:
        assert min(corner.mean(), parallel.mean()) > 2
        return
    assert differing(quarters(corner), plain[: SIDE // 2, SIDE // 2 :], 12) <= 0.08
    if name not in NOT_FROM_AFAR:
        assert differing(parallel, from_afar, 6) <= 0.03
