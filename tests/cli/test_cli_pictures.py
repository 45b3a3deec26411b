"""Pictures in place of pipelines: drawn again, compared as they are, and never trusted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph import images
from rendergraph.images import read, read_metadata

SMALL = ("--size", "48x27")
BOX = (*SMALL, "--scene", "cornell_box")
TURNING = """
scene: 1
objects: {box: {shape: box}, floor: {shape: plane, size: [5, 5]}}
cameras: {one: {eye: [2, 2, 3], target: [0, 0, 0]}, two: {eye: [-3, 1, 3], target: [0, 0, 0]}}
orbit: {camera: two, degrees_per_second: 90}
"""


@pytest.fixture
def turning(tmp_path: Path) -> str:
    """A pipeline and its scene in a folder of their own."""
    folder = tmp_path / "own"
    folder.mkdir()
    (folder / "scene.yaml").write_text(TURNING)
    (folder / "pipeline.yaml").write_text("extends: forward\nscene: ./scene.yaml\n")
    return "own/pipeline.yaml"


def test_a_picture_draws_itself_again(cli: Any, tmp_path: Path) -> None:
    assert cli("run", "forward", *BOX, "-s", "shadows.taps=1", "-o", "light.exr").code == 0
    assert cli("run", "light.exr").out == "light-again.exr\n"
    np.testing.assert_array_equal(read(tmp_path / "light.exr"), read(tmp_path / "light-again.exr"))
    assert cli("run", "light.exr", "-s", "light.ambient=0.5", "-o", "other.exr").code == 0
    assert not np.array_equal(read(tmp_path / "light.exr"), read(tmp_path / "other.exr"))


@pytest.mark.slow
def test_it_knows_its_camera_its_frame_and_its_scene(cli: Any, turning: str, tmp_path: Path) -> None:
    shutter = ("--shutter", "0.25")
    assert (
        cli("run", turning, *SMALL, "--camera", "two", "--fps", "24", "--frames", "7-7", *shutter, "-o", "a.png").code
        == 0
    )
    said = read_metadata(tmp_path / "a.png")
    assert said["shutter"] == "0.25"
    assert (said["camera"], said["frame"], said["fps"], said["folder"]) == ("two", "7", "24", "own")
    assert cli("run", "a.png", "-o", "b.png").code == 0
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert cli("run", "a.png", "--frames", "1", "-o", "first.png").code == 0
    assert not np.array_equal(read(tmp_path / "a.png"), read(tmp_path / "first.png"))
    frame = rg.load(tmp_path / "a.png").render()
    assert (frame.number, rg.load(tmp_path / "a.png").link().graph.facts.camera.shutter) == (7, 0.25)
    np.testing.assert_array_equal(frame["image"][..., :3], read(tmp_path / "a.png"))


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["check", "plan", "graph", "config", "bench"])
def test_every_verb_takes_a_picture(cli: Any, turning: str, verb: str) -> None:
    assert cli("run", turning, *SMALL, "-o", "a.png").code == 0
    result = cli(verb, "a.png", "-s", "shadows.taps=1")
    assert (result.code, "RG" in result.err) == (0, False), result


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("folder", "/"),
        ("folder", "../secret"),
        ("environment", "../secret/sky.hdr"),
        ("frame", "x"),
        ("fps", "nan"),
        ("shutter", "9"),
    ],
)
def test_what_a_picture_says_reaches_nothing_outside(
    cli: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, key: str, value: str
) -> None:
    """Its paths are those of a file in the current folder, whatever it says of where it was made."""
    for name in ("secret", "here"):
        (tmp_path / name).mkdir()
    (tmp_path / "secret" / "scene.yaml").write_text(TURNING)
    images.write(tmp_path / "secret" / "sky.hdr", np.ones((2, 4, 3), np.float32))
    monkeypatch.chdir(tmp_path / "here")
    pipeline = rg.load("forward", size=(8, 8)).resolve().spec.to_yaml()
    pipeline = pipeline.replace("scene: shapes", "scene: ./scene.yaml") if key == "folder" else pipeline
    pixels = np.zeros((2, 2, 3), np.uint8)
    images.write(Path("hostile.png"), pixels, metadata={"rendergraph:pipeline": pipeline, f"rendergraph:{key}": value})
    result = (
        cli("check", "hostile.png") if key in ("frame", "fps", "shutter") else cli("run", "hostile.png", "-o", "x.png")
    )
    if key in ("frame", "fps", "shutter"):
        assert result.code == 0, result
    else:
        assert result.code == 3
        assert ("RG012" in result.err) or ("RG011 there is no file './scene.yaml'" in result.err), result.err


@pytest.mark.slow
def test_pictures_are_compared_as_they_are(cli: Any, tmp_path: Path) -> None:
    assert cli("run", "forward", *SMALL, "-o", "soft.png").code == 0
    assert cli("run", "forward", *SMALL, "-s", "shadows.taps=1", "-o", "hard.png").code == 0
    result = cli("compare", "soft.png", "hard.png")
    assert (result.code, result.err) == (0, "")
    assert result.out.splitlines()[1].split() == ["FLIP", "RMSE", "PSNR", "SSIM"]
    assert result.out.endswith("soft → hard\n  ~ shadows.taps: 3 → 1\n")
    told = cli("compare", "soft.png", "hard.png", "--json").json
    first, second = told["variants"]
    assert (first["rmse"], first["psnr"], first["ssim"], first["flip"]) == (0, None, 1, 0)
    difference = read(tmp_path / "soft.png")[..., :3] / 255.0 - read(tmp_path / "hard.png")[..., :3] / 255.0
    assert second["rmse"] == pytest.approx(np.sqrt(np.mean(difference**2)))
    assert "gpu_ms" not in second
    assert cli("compare", "soft.png", "hard.png", "--fail-above", "rmse=0").code == 4
    against = cli("compare", "hard.png", "--reference", "soft.png", "--json").json
    assert against["variants"][0]["flip"] == second["flip"]
    # what changes them, or asks for times, draws them
    assert cli("compare", "soft.png", "hard.png", "-n", "1", "--json").json["variants"][1]["frames"] == 1


def test_a_report_of_pictures_has_what_there_is(cli: Any, tmp_path: Path) -> None:
    for name, taps in (("soft.png", 3), ("hard.png", 1)):
        assert cli("run", "forward", *SMALL, "-s", f"shadows.taps={taps}", "-o", name).code == 0
    assert cli("compare", "soft.png", "hard.png", "-o", "report.html").code == 0
    page = (tmp_path / "report.html").read_text()
    assert "shadows.taps: 3 → 1" in page
    assert "GPU" not in page


def test_pictures_that_cannot_be_compared_say_why(cli: Any, tmp_path: Path) -> None:
    assert cli("run", "forward", *SMALL, "-o", "a.png", "-o", "a.exr").code == 0
    images.write(tmp_path / "small.png", np.zeros((2, 2, 3), np.uint8))
    said = cli("compare", "a.png", "a.exr")
    assert (said.code, said.err) == (
        3,
        "RG521 'a.exr' holds light, but 'a.png' display values; write both as PNG, or both as EXR\n",
    )
    assert cli("compare", "a.png", "small.png").err.startswith("RG520 'small.png' has 2×2 pixels")
    result = cli("compare", "forward", "small.png", *SMALL)
    assert "RG510" in result.err
    assert result.err.endswith("; to measure pipelines against it: --reference small.png\n")
