"""What a pass's time is: its steps', and its `update`'s."""

from __future__ import annotations

from time import sleep
from typing import Any

import numpy as np
import pytest

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Frame, Input, Internal, Node, Output, Steps, View, Views
from rendergraph.execute import FrameTimes, StepTime, median_times
from rendergraph.gl.queries import Timer
from rendergraph.scene.facts import FrameScene

SHADERS = {
    "show.frag": "layout(std430) readonly buffer numbers { vec4 four; }; out vec4 color; void main() { color = four; }",
    "seen.frag": "out vec4 color; void main() { color = vec4(1.0); }",
}


class Slow(Node):
    """Takes its time over numbers."""

    numbers = Internal(kind="buffer", bytes=16)
    color = Output(AnyTexel, doc="Zeros.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("show.frag", numbers=self.numbers, out=self.color)

    def update(self, frame: Frame) -> None:
        sleep(0.03)


class Eyes(Node):
    """Takes its time over a view, and draws nothing."""

    seen = Views(doc="The camera's view.")

    def update(self, frame: Frame) -> None:
        sleep(0.03)
        frame.set_views(self.seen, [frame.camera])


class Sees(Node):
    """Drawn with a view."""

    view = Input(View, kind="view", doc="View.")
    under = Input(AnyTexel, doc="Another picture.")
    color = Output(AnyTexel, clear=0.0, doc="White where something is.")

    def record(self, steps: Steps) -> None:
        steps.geometry("seen.frag", out=self.color, view=self.view)


def test_update_counts_as_time_of_its_pass(bench: Any) -> None:
    text = """nodes:
  slow: {type: slow}
  eyes: {type: eyes}
  sees: {type: sees, inputs: {view: eyes.seen, under: slow.color}}
outputs: {image: sees.color, slow: slow.color}"""
    frame = bench.draw(text, Slow, Eyes, Sees, shaders=SHADERS, scene="objects: {box: {shape: box}}\n", timed=True)
    spent = {entry["node"]: entry["cpu_ms"] for entry in frame.passes}
    assert spent["slow"] >= 30
    assert spent["eyes"] >= 30
    assert spent["sees"] < 30
    assert sum(spent.values()) <= frame.frame_ms["max"]


def test_steps_are_measured_only_where_that_is_asked_for(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Timer, "start", lambda _: pytest.fail("a step is measured"))
    text = """nodes:
  slow: {type: slow}
  eyes: {type: eyes}
  sees: {type: sees, inputs: {view: eyes.seen, under: slow.color}}
outputs: {image: sees.color, slow: slow.color}"""
    frame = bench.draw(text, Slow, Eyes, Sees, shaders=SHADERS, scene="objects: {box: {shape: box}}\n")
    assert [entry["node"] for entry in frame.passes] == ["eyes", "slow", "sees"]
    assert {(entry["gpu_ms"], entry["cpu_ms"]) for entry in frame.passes} == {(None, None)}
    assert frame.frame_ms["median"] >= 60


class Asks(Node):
    """Asks for the scene's bounds."""

    numbers = Internal(kind="buffer", bytes=32)
    color = Output(AnyTexel, doc="Its corner.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("show.frag", numbers=self.numbers, out=self.color)

    def update(self, frame: Frame) -> None:
        low, high = frame.scene.bounds
        frame.write(self.numbers, np.array([*high, 0.0, *low, 0.0], np.float32))


@pytest.mark.parametrize(
    ("moving", "found"), [("cameras.c.eye", 1), ("lights.l.intensity", 1), ("objects.box.at", 3), ("nothing", 1)]
)
def test_what_does_not_move_is_found_once(bench: Any, monkeypatch: pytest.MonkeyPatch, moving: str, found: int) -> None:
    asked: list[FrameScene] = []
    bounds = FrameScene.bounds.func  # type: ignore[attr-defined]  # a cached property

    def ask(scene: FrameScene) -> object:
        asked.append(scene)
        return bounds(scene)

    monkeypatch.setattr(FrameScene.bounds, "func", ask)
    values = "{0: 1, 1: 2}" if "intensity" in moving else "{0: [0, 0, 3], 1: [30, 0, 3]}"
    scene = "objects: {box: {shape: box}}\ncameras: {c: {eye: [0, 0, 4]}}\nlights: {l: {type: point}}\n"
    scene += f"keyframes: {{{moving}: {values}}}\n" if moving != "nothing" else ""
    text = "nodes: {a: {type: asks}}\noutputs: {image: a.color}"
    frames = bench.frames(text, Asks, shaders=SHADERS, scene=scene, frames=range(1, 4), warm_up=False)
    assert len(asked) == found
    highs = [float(frame["image"][0, 0, 0]) for frame in frames]
    np.testing.assert_allclose(highs, [0.5, 1.5, 2.5] if moving.startswith("objects") else [0.5] * 3, atol=1e-3)


def test_a_pass_that_most_frames_leave_out_takes_no_time_in_the_median() -> None:
    always, once = StepTime("a", 2.0, 1.0), StepTime("b", 600.0, 500.0)
    frames = [FrameTimes(603.0, (once, always)), FrameTimes(3.0, (always,)), FrameTimes(3.0, (always,))]
    assert median_times(frames) == [StepTime("b", 0.0, 0.0), StepTime("a", 2.0, 1.0)]


def test_only_what_is_timed_is_drawn_beforehand(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    updated: list[float] = []
    monkeypatch.setattr(Slow, "update", lambda self, frame: updated.append(frame.time))
    for options, count in (({}, 1), ({"timed": True}, 2), ({"warm_up": True}, 2)):
        updated.clear()
        bench.draw("nodes: {slow: {type: slow}}\noutputs: {a: slow.color}", Slow, shaders=SHADERS, **options)
        assert len(updated) == count
