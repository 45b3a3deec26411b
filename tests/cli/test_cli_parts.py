"""`run --executor`: frames in parts are the frames of one process; films; what cannot be cut says why."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rendergraph.images import read

NOW = """// The frame's number.
/*---
outputs:
  color: {semantic: radiance, format: rgba32f, doc: It.}
---*/
#include <frame.glsl>
out vec4 color;
void main() { color = vec4(float(frame_index), gl_FragCoord.xy, 1.0); }
"""
BOTH = """// What was, and what is.
/*---
inputs:
  now: {semantic: radiance, doc: What is.}
  then: {semantic: radiance, doc: What was.}
outputs:
  color: {semantic: radiance, format: rgba32f, doc: Both.}
---*/
uniform sampler2D now;
uniform sampler2D then;
out vec4 color;
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    color = texelFetch(now, at, 0) + 100.0 * texelFetch(then, at, 0);
}
"""
FILE = """rendergraph: 1
size: [9, 5]
nodes:
  now: {type: ./now.frag}
  both: {type: ./both.frag, inputs: {now: now.color, then: now.color@previous}}
outputs: {radiance: both.color}
"""


def write(folder: Path) -> None:
    for name, text in (("now.frag", NOW), ("both.frag", BOTH), ("p.yaml", FILE)):
        (folder / name).write_text(text)


@pytest.mark.nightly
# imageio-ffmpeg leaves the pipes of its process to be closed when they are collected.
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_frames_in_parts_and_films_are_those_of_one_process(cli: Any, tmp_path: Path) -> None:
    words = (
        "run",
        "forward",
        "--scene",
        "revolving_door",
        "-s",
        "sun.resolution=64",
        "--size",
        "17x9",
        "--frames",
        "1-9",
    )
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    here = cli(*words, "-o", "a/f.##.png", "-o", "a/film.mp4", "--tap", "sun.shadow_map=a/s.##.exr")
    assert here.code == 0, here.err
    there = cli(
        *words,
        "--executor",
        "processes:2",
        "-o",
        "b/f.##.png",
        "-o",
        "b/film.mp4",
        "--tap",
        "sun.shadow_map=b/s.##.exr",
    )
    assert there.code == 0, there.err
    names = {path.name: path.read_bytes() for path in (tmp_path / "a").iterdir()}
    assert len(names) == 9 + 9 + 1
    assert names == {path.name: path.read_bytes() for path in (tmp_path / "b").iterdir()}
    assert sorted(here.out.split()) == sorted(line.replace("b/", "a/") for line in there.out.split())
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    film = ffmpeg.read_frames(str(tmp_path / "a" / "film.mp4"), pix_fmt="rgb24")
    told, frames = next(film), list(film)
    assert (told["size"], told["fps"], len(frames)) == ((18, 10), 30.0, 9)  # sides are even
    shown = np.frombuffer(frames[4], np.uint8).reshape(10, 18, 3)[:9, :17].astype(float)
    assert np.abs(shown - read(tmp_path / "a" / "f.05.png")[..., :3]).mean() < 12  # colours at half the resolution


@pytest.mark.slow
def test_frames_that_depend_on_those_before_say_so_or_begin_as_early_as_is_declared(cli: Any, tmp_path: Path) -> None:
    write(tmp_path)
    words = ("--frames", "3-12", "--executor", "processes:2", "--json", "-o", "there.##.exr")
    told = cli("run", "p.yaml", *words)
    assert told.code == 3
    assert "RG643 each frame depends on earlier ones through 'now', so frames cannot be split among workers" in told.err
    (tmp_path / "w.yaml").write_text(FILE.replace("size:", "warm_up: 1\nsize:"))
    there = cli("run", "w.yaml", *words)
    assert there.code == 0, there.err
    assert (len(there.json["outputs"]), len(there.json["steps_run"])) == (10, 10)
    events = [json.loads(line) for line in there.err.splitlines() if line.startswith("{")]
    assert [event["done"] for event in events] == list(range(1, 11))
    for number in range(3, 13):
        assert read(tmp_path / f"there.{number:02d}.exr")[0, 0, 0] == number + 100 * (number - 1)
    assert cli("run", "p.yaml", "--frames", "3-12", "-o", "here.##.exr").code == 0
    for number in range(3, 13):
        here, drawn = (read(tmp_path / f"{name}.{number:02d}.exr") for name in ("here", "there"))
        np.testing.assert_array_equal(here, drawn)


def test_films_need_their_extra_and_odd_wishes_are_told(
    cli: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path)
    assert (
        "--watch renders in this process; leave out --executor"
        in cli("run", "p.yaml", "--watch", "--executor", "dask").err
    )
    assert (
        "--tap-all renders in this process; leave out --executor"
        in cli("run", "p.yaml", "--tap-all", "in", "--executor", "processes:2").err
    )
    assert "RG500" in cli("run", "p.yaml", "--executor", "threads").err
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setitem(sys.modules, "distributed", None)
    told = cli("run", "p.yaml", "-o", "radiance=a.mp4")
    assert (told.code, "pip install 'rendergraph[video]'" in told.err) == (2, True)
    told = cli("run", "p.yaml", "-o", "a.exr", "--executor", "dask")
    assert (told.code, "pip install 'rendergraph[farm]'" in told.err) == (2, True)
