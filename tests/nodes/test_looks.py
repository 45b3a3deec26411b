"""How assets look with the light and surroundings that they get by default."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rendergraph as rg


def test_environment_none_leaves_the_background_black(tmp_path: Path, session: rg.Session) -> None:
    (tmp_path / "ball.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    lit, bare = (
        rg.load("forward", scene=str(tmp_path / "ball.obj"), environment=environment, size=(16, 16)).render(
            session=session
        )["image"]
        for environment in (None, "none")
    )
    assert lit[0, 0, :3].min() > 20
    assert bare[0, 0, :3].max() == 0
    assert bare[..., :3].max() > 20, "the key light stays"


def test_environment_none_takes_away_that_of_a_scene_file() -> None:
    assert rg.load("full").link().scene.environment is not None
    assert rg.load("full", environment="none").link().scene.environment is None


ASSETS = (
    *("BoxTextured.glb", "BoxVertexColors.glb", "DamagedHelmet.glb", "Fox.glb", "WaterBottle/WaterBottle.gltf"),
    *("Suzanne/Suzanne.gltf", "SheenCloth/SheenCloth.gltf", "RiggedFigure.glb", "MorphStressTest.glb"),
    *("LightsPunctualLamp/LightsPunctualLamp.gltf", "AnisotropyStrengthTest.glb", "ClearcoatWicker.glb"),
    *("TransmissionRoughnessTest.glb", "GlassBrokenWindow.glb", "MetalRoughSpheresNoTextures.glb"),
    *("NormalTangentTest.glb", "AlphaBlendModeTest.glb"),
)
OWN = ("shapes", "courtyard", "spheres")


@pytest.mark.nightly
@pytest.mark.parametrize("pipeline", ["forward", "full"])
@pytest.mark.parametrize("name", [*OWN, *ASSETS])
def test_looks(session: rg.Session, shared: Path, pipeline: str, name: str) -> None:
    """Neither too dark, nor clipped, nor black, with the surroundings that a file gets by default."""
    path = name if name in OWN else str(shared / "assets/gltf" / name)
    image = rg.load(pipeline, scene=path, size=(192, 128)).render(session=session)["image"][..., :3]
    assert 70 <= image.mean() <= 150
    assert (image.max(axis=-1) >= 254).mean() <= 0.02
    assert (image @ np.array([0.2126, 0.7152, 0.0722]) < 5).mean() <= 0.25
