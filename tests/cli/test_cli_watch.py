"""`run --watch` in a real process: files are edited, and what is printed and drawn is waited for, with deadlines."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rendergraph import images

pytestmark = pytest.mark.slow  # each test is a process that draws

DEADLINE = 60.0
BASE = """
rendergraph: 1
size: [8, 8]
scene: scene.yaml
nodes:
  light: {type: forward_lighting, params: {shading: unlit}}
  flat: {type: ./flat.frag, inputs: {source: light.radiance}}
outputs: {image: flat.color}
"""
FILES = {
    "base.yaml": BASE,
    "middle.yaml": "extends: ./base.yaml\n",
    "my.yaml": "extends: ./middle.yaml\nnodes:\n  flat: {params: {gain: 1.0}}\n",
    "scene.yaml": "scene: 1\nobjects: {it: {file: it.obj}}\n"
    "cameras: {main: {eye: [0, 0, 3], target: [0, 0, 0], height: 2}}\n",
    "it.obj": "v -9 -9 0\nv 9 -9 0\nv 0 9 0\nf 1 2 3\n",
    "flat.frag": '#include "outer.glsl"\nuniform sampler2D source;\nuniform float gain = 1.0;\nout vec4 color;\n'
    "void main() { color = vec4(value() * gain) * step(0.01, texelFetch(source, ivec2(gl_FragCoord.xy), 0).r); }\n",
    "outer.glsl": '#include "inner.glsl"\nfloat value() { return VALUE; }\n',
    "inner.glsl": "#define VALUE 0.2\n",
}


class Watched:
    """A child process with its lines as they come."""

    def __init__(self, folder: Path, *words: str) -> None:
        command = [sys.executable, "-m", "rendergraph", "run", "my.yaml", "--watch", *words]
        self.process = subprocess.Popen(
            command,
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a background job's suite ignores SIGINT
        )
        self.out: list[str] = []
        self.err: list[str] = []
        for stream, lines in ((self.process.stdout, self.out), (self.process.stderr, self.err)):
            threading.Thread(target=self._read, args=(stream, lines), daemon=True).start()

    @staticmethod
    def _read(stream: Any, lines: list[str]) -> None:
        with stream:
            for line in stream:
                lines.append(line)

    def wait(self, done: Callable[[], bool]) -> None:
        end = time.monotonic() + DEADLINE
        while not done():
            assert time.monotonic() < end, (self.out, self.err)
            assert self.process.poll() is None, (self.out, self.err)
            time.sleep(0.02)

    def said(self, text: str, times: int = 1) -> bool:
        return "".join(self.err).count(text) >= times

    def after(self, change: Callable[[], object]) -> str:
        """What is said after a change, up to the line that ends it."""
        seen = len(self.err)
        change()
        self.wait(lambda: any(": rendered in" in line or ": not rendered" in line for line in self.err[seen:]))
        return "".join(self.err[seen:])

    def stop(self, number: int = signal.SIGINT) -> int:
        self.process.send_signal(number)
        return self.process.wait(DEADLINE)


Start = Callable[..., Watched]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.fixture
def start(folder: Path) -> Iterator[Start]:
    """Starts a process in the folder and waits for its first picture."""
    started: list[Watched] = []

    def begin(*words: str, ready: str = "watching ") -> Watched:
        started.append(Watched(folder, *words))
        started[-1].wait(lambda: started[-1].said(ready))
        return started[-1]

    yield begin
    for child in started:
        if child.process.poll() is None:
            child.process.kill()
        child.process.wait(DEADLINE)


def edit(file: Path, old: str, new: str, *, rename: bool = True) -> None:
    """Replace text as editors do: beside the file, then over it; or in place."""
    text = file.read_text()
    assert old in text, text
    beside = file.with_name(f".{file.name}.swp") if rename else file
    beside.write_text(text.replace(old, new))
    if rename:
        os.replace(beside, file)


def shade(file: Path) -> float:
    return float(images.read(file)[..., :3].mean()) / 255


def test_every_kind_of_file_is_followed_and_only_what_it_touches_is_made(folder: Path, start: Start) -> None:
    child = start("-o", "a.png")
    assert shade(folder / "a.png") == pytest.approx(0.2, abs=0.01)

    said = child.after(lambda: edit(folder / "my.yaml", "gain: 1.0", "gain: 2.0"))
    assert "my.yaml: rendered in" in said
    assert said.endswith(", nothing rebuilt\n")
    assert shade(folder / "a.png") == pytest.approx(0.4, abs=0.01)

    said = child.after(lambda: edit(folder / "inner.glsl", "0.2", "0.3"))  # an include of an include
    assert "inner.glsl: rendered in" in said
    assert "rebuilt 1 program, " in said
    assert shade(folder / "a.png") == pytest.approx(0.6, abs=0.01)

    said = child.after(lambda: edit(folder / "flat.frag", "* gain)", "* gain * 0.5)", rename=False))
    assert "rebuilt 1 program, " in said
    assert shade(folder / "a.png") == pytest.approx(0.3, abs=0.01)

    said = child.after(
        lambda: edit(folder / "base.yaml", "size: [8, 8]", "size: [8, 16]")
    )  # extended by what we extend
    assert "rebuilt " in said
    assert "program" not in said
    assert images.read(folder / "a.png").shape[:2] == (16, 8)

    said = child.after(lambda: edit(folder / "it.obj", "v 9 -9 0", "v -8 -9 0"))
    assert "1 scene" in said
    assert shade(folder / "a.png") == 0
    child.after(lambda: edit(folder / "scene.yaml", "it.obj}", "it.obj, at: [4.3, 0, 0]}"))
    assert shade(folder / "a.png") > 0
    assert child.out == ["a.png\n"] * 7
    assert child.stop() == 130
    assert child.err[-1] == "interrupted\n"


def test_a_mistake_is_said_once_and_the_last_picture_stays(folder: Path, start: Start) -> None:
    child = start("-o", "a.png")
    before = (folder / "a.png").read_bytes()
    said = child.after(lambda: edit(folder / "inner.glsl", "0.2", "0.2 +"))
    assert "outer.glsl:2:" in said
    assert "RG410" in said
    assert "keeping the last picture" in said
    assert child.after(lambda: edit(folder / "inner.glsl", "0.2 +", "0.2 + ")).endswith("; same mistake\n")
    said = child.after(lambda: edit(folder / "my.yaml", "gain", "gian"))
    assert "my.yaml:3:" in said
    assert "did you mean 'gain'?" in said
    assert (folder / "a.png").read_bytes() == before
    child.after(lambda: edit(folder / "inner.glsl", "0.2 + ", "0.4"))
    said = child.after(lambda: edit(folder / "my.yaml", "gian", "gain"))
    assert ": rendered in" in said
    assert shade(folder / "a.png") == pytest.approx(0.4, abs=0.01)
    assert sum("RG410" in line for line in child.err) == 1
    assert child.stop(signal.SIGTERM) == 143


def test_a_file_that_vanishes_is_waited_for(folder: Path, start: Start) -> None:
    child = start("-o", "a.png")
    (folder / "inner.glsl").rename(folder / "away")
    threading.Timer(0.3, lambda: (folder / "inner.glsl").write_text("#define VALUE 0.8\n")).start()
    assert ": rendered in" in child.after(lambda: None)  # never seen to be missing
    assert shade(folder / "a.png") == pytest.approx(0.8, abs=0.01)
    said = child.after((folder / "my.yaml").unlink)
    assert said == "RG011 there is no file 'my.yaml'\nmy.yaml: not rendered, keeping the last picture\n"
    child.after(lambda: (folder / "my.yaml").write_text(FILES["my.yaml"].replace("1.0", "0.5")))
    assert shade(folder / "a.png") == pytest.approx(0.4, abs=0.01)


def test_a_file_that_was_missing_is_noticed_when_it_appears(folder: Path, start: Start) -> None:
    (folder / "inner.glsl").unlink()
    child = start("-o", "a.png")
    assert child.said("RG401 there is no include 'inner.glsl'")
    assert not (folder / "a.png").exists()
    child.after(lambda: (folder / "inner.glsl").write_text(FILES["inner.glsl"]))
    assert shade(folder / "a.png") == pytest.approx(0.2, abs=0.01)


def test_json_is_one_document_a_line_with_frames_and_taps(folder: Path, start: Start) -> None:
    (folder / "patch.yaml").write_text("nodes: {flat: {params: {gain: 1.0}}}\n")
    child = start("-p", "patch.yaml", "--frames", "1-2", "-o", "a.##.png", "--tap", "light.radiance=l.##.exr", "--json")
    child.after(lambda: edit(folder / "patch.yaml", "1.0", "3.0"))
    child.after(lambda: edit(folder / "patch.yaml", "gain", "gian"))
    child.wait(lambda: len(child.out) == 3)
    first, second, third = map(json.loads, child.out)
    assert first["changed"] == []
    assert first["made"]["programs"] > 0
    assert first["outputs"] == ["a.01.png", "l.01.exr", "a.02.png", "l.02.exr"]
    assert second["changed"] == [str(folder / "patch.yaml")]
    assert second["made"] == {"programs": 0, "textures": 0, "scenes": 0}
    assert second["ms"] > 0
    assert set(second) > {"pipeline", "device", "size", "passes", "frame_ms", "memory", "culled", "outputs"}
    assert third["error"]["exit_code"] == 3
    assert third["error"]["problems"][0]["code"] == "RG103"
    assert shade(folder / "a.02.png") == pytest.approx(0.6, abs=0.01)


def test_settings_and_a_python_node_with_its_helper_are_followed(folder: Path, start: Start) -> None:
    (folder / "fx").mkdir()
    (folder / "fx/_help.py").write_text("GAIN = 0.5\n")
    (folder / "fx/bright.py").write_text(
        "from rendergraph.api import Any, Node, Output, param\nfrom ._help import GAIN\n\n\nclass Bright(Node):\n"
        '    """One value."""\n\n    color = Output(Any, format="rgba8", doc="It.")\n'
        '    gain: float = param(default=GAIN, doc="It.")\n'
    )
    (folder / "fx/bright.frag").write_text("uniform float gain; out vec4 color; void main() { color = vec4(gain); }")
    (folder / "my.yaml").write_text("size: [4, 4]\nnodes: {a: {type: bright}}\noutputs: {image: a.color}\n")
    child = start("-o", "a.png", ready="RG102")  # nobody has said where the type is
    child.after(lambda: (folder / "rendergraph.toml").write_text('plugins = ["fx"]\n'))
    assert shade(folder / "a.png") == pytest.approx(0.5, abs=0.01)
    said = child.after(lambda: edit(folder / "fx/_help.py", "0.5", "0.7"))
    assert said.endswith(", nothing rebuilt\n")
    assert shade(folder / "a.png") == pytest.approx(0.7, abs=0.01)
    said = child.after(lambda: edit(folder / "fx/bright.py", "param(default", "param(defualt"))
    assert "bright.py:9:" in said
    assert "RG491" in said
    child.after(lambda: edit(folder / "fx/bright.py", "defualt=GAIN", "default=0.9"))
    assert shade(folder / "a.png") == pytest.approx(0.9, abs=0.01)


def test_a_sub_pipeline_and_a_texture_are_followed(folder: Path, start: Start) -> None:
    def paint(value: int) -> None:
        info = SimpleNamespace(semantic="display_color", format="rgba8", encoding="display", transparent=False)
        images.save_output(folder / "paint.png", np.full((4, 4, 4), value, np.uint8), info, {})

    paint(255)
    edit(folder / "scene.yaml", "it.obj}", "it.obj, at: [0, 0, 0], overrides: {it: {material: red}}}", rename=False)
    edit(folder / "scene.yaml", "cameras", "materials: {red: {base_color_texture: paint.png}}\ncameras", rename=False)
    edit(folder / "it.obj", "v -9 -9 0", "o it\nvt 0 0\nv -9 -9 0", rename=False)
    edit(folder / "it.obj", "f 1 2 3", "f 1/1 2/1 3/1", rename=False)
    (folder / "sub.yaml").write_text(
        "inputs: {x: {semantic: radiance}}\nnodes: {f: {type: ./flat.frag, inputs: {source: inputs.x}}}\n"
        "outputs: {color: f.color}\n"
    )
    edit(folder / "my.yaml", "flat: {params: {gain: 1.0}}", "flat: {type: ./sub.yaml, inputs: {x: light.radiance}}")
    edit(folder / "base.yaml", "inputs: {source: light.radiance}", "inputs: {x: light.radiance}")
    child = start("-o", "a.png")
    assert shade(folder / "a.png") == pytest.approx(0.2, abs=0.01)
    child.after(lambda: edit(folder / "sub.yaml", "x}}}", "x}, params: {gain: 2}}}"))
    assert shade(folder / "a.png") == pytest.approx(0.4, abs=0.01)
    child.after(lambda: paint(0))
    assert shade(folder / "a.png") == 0


def test_the_guide_shows_what_is_printed(folder: Path, start: Start) -> None:
    page = (Path(__file__).parents[2] / "docs/guide/live.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```(\w+)\n(.*?)```", page, re.DOTALL)
    for name, (_, text) in zip(("vignette.frag", "my.yaml"), blocks, strict=False):
        assert name in text.partition("\n")[0]
        (folder / name).write_text(text.replace("[640, 360]", "[64, 36]"))
    child = start()
    shader, pipeline = folder / "vignette.frag", folder / "my.yaml"
    child.after(lambda: edit(pipeline, "strength: 0.5", "strength: 0.9"))
    child.after(lambda: edit(shader, "* far);", "* far * far);"))
    child.after(lambda: edit(shader, "* far);", "* far)"))
    child.after(lambda: edit(shader, "* far)", "* far);"))
    child.after(lambda: edit(pipeline, "[64, 36]", "[32, 18]"))
    child.stop()
    transcript = next(text for kind, text in blocks if kind == "text").splitlines()[1:]
    shown = [line for line in transcript if line != "my.png"]
    assert child.out == ["my.png\n"] * (len(transcript) - len(shown))
    assert [figures(line) for line in child.err] == [figures(line) for line in shown]


def figures(line: str) -> str:
    """A line without what differs from machine to machine."""
    line = re.sub(r" on .*", "", line.rstrip("\n"))
    return re.sub(r"\d+×\d+|\d+\.\d+ ms|\d+ ms|\d+ files|\d+ textures", "N", line)


@pytest.mark.parametrize(("words", "code"), [(["nope.yaml"], 3), (["forwrad"], 3), (["my.yaml", "--frames", "0"], 2)])
def test_what_no_edit_can_mend_ends_at_once(cli: Any, words: list[str], code: int) -> None:
    result = cli("run", *words, "--watch")
    assert result.code == code
    assert "watching" not in result.err
