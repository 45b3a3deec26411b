"""The include that every shadow-map technique shares: spans of views, and offsets that are right for any projection."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.scene.cameras import view_matrices

Floats = npt.NDArray[np.float64]

# --- spans -----------------------------------------------------------------------------------------------------------

TWO_SPANS = '''
from dataclasses import replace
import numpy as np
from rendergraph.api import Frame, Node, Output, ShadowMap, Steps, Views, projection


class TwoSpans(Node):
    """Two layers of one light: in the first everything is in shadow, in the second nothing."""

    views = Views(lights=lambda node, facts: (0, 0), doc="From above.")
    shadow_map = Output(
        ShadowMap, kind="texture2d_array", format="depth32f", view="views", size=(16, 16), doc="All or nothing."
    )

    def record(self, steps: Steps) -> None:
        for layer in range(2):
            steps.fullscreen("even.frag", out=self.shadow_map.layer(layer), value=1.0 - layer)

    def update(self, frame: Frame) -> None:
        above = projection.orthographic_view(projection.view_along((0, -1, 0)), (-50, -50, -50), (50, 50, 50), 16)
        spans = ((0.0, SPLIT + 1.5), (SPLIT, np.inf))
        frame.set_views(self.views, [replace(above, light=0, span=span) for span in spans])
'''

FLOOR = """scene: 1
objects: {floor: {shape: plane, size: [60, 60]}}
lights: {sun: {type: directional, direction: [0, -1, 0], intensity: 1}}
cameras: {main: {eye: [0, 2, 8], target: [0, 0, 0], fov_y_degrees: 45, near: 0.1, far: 200}}
"""


@pytest.mark.parametrize("kind", ["shadow_pcf", "shadow_vsm", "shadow_esm"])
def test_spans_share_the_picture_and_are_blended(session: rg.Session, tmp_path: Path, kind: str) -> None:
    (tmp_path / "two_spans.py").write_text(TWO_SPANS.replace("SPLIT", "9.0"))
    (tmp_path / "even.frag").write_text("uniform float value;\nvoid main() { gl_FragDepth = value; }\n")
    (tmp_path / "floor.yaml").write_text(FLOOR)
    (tmp_path / "spans.yaml").write_text(
        "extends: forward-prepass\nnodes:\n  sun: {type: two_spans}\n"
        f"  shadows: {{type: {kind}}}\n  light: {{params: {{terms: diffuse}}}}\n"
    )
    loaded = rg.load(tmp_path / "spans.yaml", scene=tmp_path / "floor.yaml", size=(32, 48), plugins=[tmp_path])
    frame = session.render(loaded, outputs=(), taps=("shadows.visibility", "prepass.depth"))
    view = view_matrices(next(iter(loaded.link().scene.cameras.values())), (32, 48))
    depth = frame.arrays["prepass.depth"][..., 0].astype(float)
    ndc = 1 - 2 * depth
    distance = view.projection[2, 3] / (view.projection[2, 2] + ndc)
    found = frame.arrays["shadows.visibility"][0, ..., 0]
    seen = depth > 0
    assert distance[seen].min() < 8 < 12 < distance[seen].max()
    np.testing.assert_allclose(found[seen], np.clip((distance[seen] - 9) / 1.5, 0, 1), atol=2e-3)


# --- projections -----------------------------------------------------------------------------------------------------

WARPED = '''
from dataclasses import replace
import numpy as np
from rendergraph.api import Frame
from rendergraph.nodes.shadows.shadow_map import ShadowMapNode

SQUEEZED = np.array([[1.6, 0.2, 0, 0], [0, 1.8, 0, 0.8], [0, 0, 1, 0], [0, 0.8, 0, 1.8]])  # (-1, 1) to itself in y


class WarpedMap(ShadowMapNode):
    """A directional light's map, seen in perspective: one side of it has more texels than the other."""

    def update(self, frame: Frame) -> None:
        class Warping:
            scene, camera, views = frame.scene, frame.camera, frame.views

            def set_views(_, port, views):
                frame.set_views(port, [replace(view, projection=SQUEEZED @ view.projection) for view in views])

        super().update(Warping())
'''


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize(
    ("kind", "sets"),
    [
        ("shadow_pcf", ("shadows.taps=1",)),
        ("shadow_pcf", ("shadows.taps=8",)),
        ("shadow_vsm", ("shadows.radius=1",)),
        ("shadow_esm", ("shadows.radius=1",)),
    ],
)
def test_a_projective_view_of_a_directional_light(
    session: rg.Session, tmp_path: Path, kind: str, sets: tuple[str, ...]
) -> None:
    """The same shadow as from a parallel view but for its edges; lit faces are wholly lit, through wide kernels too."""
    (tmp_path / "warped_map.py").write_text(WARPED)
    pictures = []
    for name in ("shadow_map", "warped_map"):
        settings = (f"sun.type={name}", f"shadows.type={kind}", "sun.resolution=2048", *sets)
        loaded = rg.load("forward-prepass", scene="shadow_study", size=(240, 160), sets=settings, plugins=[tmp_path])
        loaded = loaded.with_camera("eye=5,5,7.5 target=0,0.7,0 fov=40")
        frame = session.render(loaded, outputs=(), taps=("shadows.visibility",))
        pictures.append(frame.arrays["shadows.visibility"][0, ..., 0].astype(float))
    parallel, warped = pictures
    assert 0.05 < (parallel < 0.5).mean() < 0.6
    inside = np.ones_like(parallel, bool)  # pixels with all of one kind around them
    for shift in ((y, x) for y in range(-3, 4) for x in range(-3, 4)):
        around = np.roll(parallel, shift, (0, 1))
        inside &= (around > 0.999) == (parallel > 0.999)
        inside &= (around < 0.01) == (parallel < 0.01)
    assert inside.mean() > 0.7
    wrong = np.abs(warped - parallel)[inside]
    assert np.mean(wrong > 0.02) <= 2e-3


# --- offsets ---------------------------------------------------------------------------------------------------------

PLATES = """scene: 1
objects:
  floor: {shape: plane, size: [8, 8]}
  wall: {shape: plane, size: [8, 3], at: [0, 3.5, -6], rotate_degrees: [70, 0, 0]}
lights:
  LIGHT
cameras: {main: {eye: [0, 4, 9], target: [0, 1, 0], fov_y_degrees: 50, near: 0.1, far: 60}}
"""
LIGHTS = {
    "spot": "{type: spot, at: [2.5, 5, 4], direction: [-2.6, -5, -5], intensity: 90, outer_degrees: 50}",
    "point": "{type: point, at: [2.5, 4, 3], intensity: 60}",
    "directional": "{type: directional, direction: [-1.5, -1, -1.2], intensity: 2}",
}


@pytest.mark.nightly(keep=4)
@pytest.mark.parametrize("taps", [1, 8, 16])
@pytest.mark.parametrize("kind", list(LIGHTS))
def test_flat_faces_are_wholly_lit(session: rg.Session, tmp_path: Path, kind: str, taps: int) -> None:
    """Two plates apart, at a slant to the light: nothing of them is darkened, however wide the kernel."""
    scene = tmp_path / "plates.yaml"
    scene.write_text(PLATES.replace("LIGHT", f"lamp: {LIGHTS[kind]}"))
    sets = (f"shadows.taps={taps}", "sun.resolution=512", "sun.light=all")
    loaded = rg.load("forward-prepass", scene=scene, size=(160, 120), sets=sets)
    frame = session.render(loaded, outputs=(), taps=("shadows.visibility", "prepass.depth"))
    seen = frame.arrays["prepass.depth"][..., 0] > 0
    assert seen.mean() > 0.4
    for shift in ((0, 1), (0, -1), (1, 0), (-1, 0)):  # a normal from depth needs neighbours
        seen &= np.roll(frame.arrays["prepass.depth"][..., 0] > 0, shift, (0, 1))
    assert frame.arrays["shadows.visibility"][0, ..., 0][seen].min() > 0.999
