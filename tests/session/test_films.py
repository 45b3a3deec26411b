"""Films: how long they are, closed circles, every kind of file, and going on after an interruption."""

from __future__ import annotations

import gc
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.cli import main
from rendergraph.errors import InputError, UsageError
from rendergraph.images import read
from rendergraph.scene import animate
from rendergraph.scene.cameras import view_matrices
from rendergraph.scene.load import load
from rendergraph.session.scenes import film_frames

SIZE = (48, 28)
MOVING = """scene: 1
objects: {box: {shape: box}}
lights: {sun: {type: directional, direction: [-1, -2, -1]}}
cameras: {main: {eye: [2, 1.5, 3]}}
keyframes: {objects.box.at: {0: [0, 0, 0], 0.2: [0.5, 0, 0]}}
"""


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.yaml").write_text(MOVING)
    return tmp_path / "scene.yaml"


def lengths(text: str, folder: Path, **given: Any) -> int:
    (folder / "some.yaml").write_text("scene: 1\nobjects: {box: {shape: box}}\n" + text)
    return len(film_frames(load(folder / "some.yaml"), 30, **given))


def test_a_film_is_as_long_as_the_motion(tmp_path: Path) -> None:
    keys = "keyframes: {objects.box.at: {0: [0, 0, 0], 2.5: [1, 0, 0]}}"
    assert lengths("", tmp_path) == 1
    assert lengths(keys, tmp_path) == 75
    assert lengths(keys, tmp_path, frames="clip") == 75
    assert lengths("orbit: {degrees_per_second: -90}", tmp_path) == 120
    assert lengths(keys, tmp_path, seconds=0.5) == 15
    assert lengths(keys, tmp_path, turntable=True) == 120
    assert lengths(keys, tmp_path, frames=range(5, 9)) == 4
    assert len(film_frames(rg.load("forward", scene="orrery").link().scene, 25)) == 200
    with pytest.raises(UsageError, match="frames and seconds both say how long the film is"):
        lengths(keys, tmp_path, frames=range(1, 3), seconds=1)
    with pytest.raises(UsageError, match="no clip, keyframes or orbit"):
        lengths("", tmp_path, frames="clip")


@pytest.mark.nightly(keep=1)
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # the reader leaves pipes open
@pytest.mark.parametrize("ending", [".mp4", ".webp", ".gif"])
def test_every_kind_of_film_holds_its_frames(gl: rg.Session, scene: Path, ending: str) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    pipeline = rg.load("forward", scene=scene, size=SIZE)
    shown: list[tuple[int, int]] = []
    path = pipeline.film(f"film{ending}", session=gl, progress=lambda done, total: shown.append((done, total)))
    assert path == Path(f"film{ending}")
    assert shown == [(number, 6) for number in range(1, 7)]
    data = path.read_bytes()
    last = gl.render(pipeline, frames=range(6, 7), outputs=["image"])["image"][..., :3]
    if ending == ".webp":  # the encoder's own reader does not know animated ones
        assert (data[:4], data[8:12], data.count(b"ANMF")) == (b"RIFF", b"WEBP", 6)
        with pytest.importorskip("PIL.Image").open(path) as animated:
            animated.seek(5)
            found = np.asarray(animated.convert("RGB"))
    else:
        film = ffmpeg.read_frames(str(path), pix_fmt="rgb24")
        told, frames = next(film), list(film)
        del film
        gc.collect()
        assert (told["size"], len(frames)) == (SIZE, 6)
        found = np.frombuffer(frames[5], np.uint8).reshape(*SIZE[::-1], 3)
    error = found.astype(float) - last
    assert np.sqrt((error**2).mean()) < {".mp4": 3, ".webp": 1, ".gif": 1}[ending]


def test_a_turntable_is_one_closed_circle(gl: rg.Session, scene: Path) -> None:
    """The camera keeps its distance and height, and one more frame would be the first; the scene's own orbit rests."""
    scene.write_text(MOVING.split("keyframes")[0] + "orbit: {degrees_per_second: 77}\n")
    pipeline = rg.load("forward", scene=scene, size=SIZE)
    frames = film_frames(pipeline.link().scene, 30, seconds=0.4, turntable=True)
    turned = pipeline.expand(frames=frames, turntable=frames).linked.scene
    eyes = [animate.at(turned, (number - 1) / 30).cameras["main"].transform[:3, 3] for number in range(1, 14)]
    np.testing.assert_allclose(eyes[0], [2, 1.5, 3], atol=1e-12)
    np.testing.assert_allclose(eyes[12], eyes[0], atol=1e-12)
    around = np.unwrap([np.arctan2(eye[0], eye[2]) for eye in eyes])
    np.testing.assert_allclose(np.diff(around), 2 * np.pi / 12, atol=1e-12)
    np.testing.assert_allclose([np.hypot(eye[0], eye[2]) for eye in eyes], np.hypot(2, 3))
    found = [frame["image"] for frame in gl.frames(pipeline, frames=frames, turntable=frames, outputs=["image"])]
    plain = gl.render(pipeline.set("light.ambient", 0.03), outputs=["image"])["image"]
    np.testing.assert_array_equal(found[0], plain)
    assert (found[6] != plain).any()


def test_a_frame_of_a_turntable_can_be_rendered_again(gl: rg.Session, scene: Path) -> None:
    pipeline = rg.load("forward", scene=scene, size=SIZE)
    frames = range(1, 9)
    frame = gl.render(pipeline, frames=range(3, 4), turntable=frames, outputs=["image"])
    frame.save("third.png")
    again = gl.render(rg.load("third.png"), frames=range(3, 4), outputs=["image"])
    assert np.abs(again["image"].astype(int) - frame["image"]).max() <= 1


@pytest.mark.usefixtures("scene")  # which changes into its folder
def test_a_picture_without_environment_can_be_rendered_again() -> None:
    words = ["--size", "16x9", "-q"]
    assert main(["run", "forward", "--environment", "none", *words, "-o", "bare.png"]) == 0
    assert main(["run", "bare.png", "-q", "-o", "again.png"]) == 0
    np.testing.assert_array_equal(read("again.png"), read("bare.png"))


def test_a_film_in_which_nothing_moves_says_so(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene.write_text(MOVING.split("keyframes")[0])
    words = ["run", "forward", "--scene", str(scene), "--size", "16x9", "--frames", "1-3", "-o", "a.##.png"]
    assert main(words) == 0
    assert "RG629 nothing in the scene moves during 3 frames; --turntable" in capsys.readouterr().err
    pytest.importorskip("imageio_ffmpeg")
    assert main([*words[:-4], "-o", "a.gif"]) == 0
    assert "RG629 nothing in the scene moves, so the film is one frame; --turntable" in capsys.readouterr().err
    with pytest.warns(UserWarning, match="nothing in the scene moves, so the film is one frame; turntable=True"):
        rg.load("forward", scene=scene, size=(16, 9)).film("b.gif")
    assert main([*words, "--turntable"]) == 0
    assert "RG629" not in capsys.readouterr().err


def test_numbered_frames_go_on_where_they_were_interrupted(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And have the same bits as without an interruption, although each depends on those before it."""
    words = ["run", "taa", "--scene", str(scene), "--size", "32x18", "--frames", "1-5"]
    assert main([*words, "-o", "whole.##.png"]) == 0
    assert main([*words[:-1], "1-3", "-o", "part.##.png"]) == 0
    capsys.readouterr()
    assert main([*words, "-o", "part.##.png", "--resume"]) == 0
    assert capsys.readouterr().out.split() == ["part.04.png", "part.05.png"]
    for number in range(1, 6):
        np.testing.assert_array_equal(read(f"part.{number:02d}.png"), read(f"whole.{number:02d}.png"))
    assert main([*words, "-o", "part.##.png", "--resume"]) == 0
    assert main([*words, "-o", "part.##.png", "--resume", "-s", "display.exposure=1"]) == 3
    assert "part.01.png: RG512 differs from this film in its pipeline; without" in capsys.readouterr().err
    assert main([*words, "-o", "part.##.png", "--resume", "--camera", "eye=1,1,4", "--fps", "10"]) == 3
    assert "part.01.png: RG512 differs from this film in its camera;" in capsys.readouterr().err
    assert main([*words, "-o", "part.##.png", "--resume", "--fps", "10"]) == 3
    assert "part.02.png: RG512 differs from this film in its fps;" in capsys.readouterr().err
    assert main([*words, "-o", "part.##.png", "--resume", "--subframes", "2"]) == 3
    assert "RG512 differs from this film in its subframes;" in capsys.readouterr().err
    assert main([*words, "-o", "part.##.png", "--resume", "--turntable"]) == 3
    assert "RG512 differs from this film in its turntable;" in capsys.readouterr().err
    assert main([*words, "-o", "a.gif", "--resume"]) == 2
    assert "--resume continues numbered frames, and 'a.gif' has no `####`" in capsys.readouterr().err


def test_turntables_go_on_only_on_the_same_circle(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["run", "forward", "--scene", str(scene), "--size", "16x9", "--turntable", "-o", "a.##.png", "--frames"]
    assert main([*words, "1-3"]) == 0
    Path("a.03.png").unlink()
    capsys.readouterr()
    assert main([*words, "1-3", "--resume"]) == 0
    assert capsys.readouterr().out.split() == ["a.03.png"]
    assert main([*words, "1-4", "--resume"]) == 3
    assert "a.01.png: RG512 differs from this film in its turntable;" in capsys.readouterr().err
    assert main([*words, "1-3", "--resume", "--camera", "eye=1,1,4"]) == 3
    assert "a.01.png: RG512 differs from this film in its turntable;" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"seconds": -1}, "seconds: expected a number above 0, got -1"),
        ({"seconds": "2"}, "seconds: expected a number above 0, got '2'"),
        ({"fps": float("nan")}, "fps: expected a number above 0, got nan"),
        ({"frames": range(1, 9, 2)}, "frames: expected consecutive numbers"),
        ({"frames": "clap"}, "or 'clip', got 'clap'"),
        ({"frames": 3}, "or 'clip', got 3"),
    ],
)
def test_impossible_lengths_of_films(scene: Path, options: dict[str, Any], text: str) -> None:
    with pytest.raises(UsageError, match=re.escape(text)):
        rg.load("forward", scene=scene, size=SIZE).film("a.gif", **options)


def test_wrong_films(scene: Path) -> None:
    pipeline = rg.load("forward", scene=scene, size=SIZE)
    with pytest.raises(UsageError, match=r"RG501 '\.avi' films are not written; available: \.gif, \.mp4, \.webp"):
        pipeline.film("a.avi")
    with pytest.raises(InputError, match="RG504"):
        pipeline.film("nowhere/a.gif")


def test_an_added_camera_has_everything_in_its_circle(tmp_path: Path) -> None:
    """From all around, and no farther away than that takes; it looks at the middle."""
    (tmp_path / "long.yaml").write_text("scene: 1\nobjects: {box: {shape: box, size: [6, 1, 0.5], at: [2, 3, 1]}}\n")
    pipeline = rg.load("forward", scene=tmp_path / "long.yaml", size=(160, 90))
    frames = range(1, 25)
    scene = pipeline.expand(frames=frames, turntable=frames).linked.scene
    corners = np.array([(x, y, z, 1.0) for x in (-1, 5) for y in (2.5, 3.5) for z in (0.75, 1.25)])
    extents = []
    for number in frames:
        camera = animate.at(scene, (number - 1) / 30).camera
        assert camera is not None
        assert camera.target is not None
        np.testing.assert_allclose(camera.target, (2, 3, 1), atol=1e-12)
        view = view_matrices(camera, (160, 90))
        points = corners @ (view.projection @ view.view).T
        extents.append(np.abs(points[:, :2] / points[:, 3:]).max())
    assert 0.93 < max(extents) < 0.95
