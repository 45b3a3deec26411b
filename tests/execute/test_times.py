"""What a pass's time is: its steps', and its `update`'s."""

from __future__ import annotations

from time import sleep
from typing import Any

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Frame, Input, Internal, Node, Output, Steps, View, Views
from rendergraph.execute import FrameTimes, StepTime, median_times

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
    frame = bench.draw(text, Slow, Eyes, Sees, shaders=SHADERS, scene="objects: {box: {shape: box}}\n")
    spent = {entry["node"]: entry["cpu_ms"] for entry in frame.passes}
    assert spent["slow"] >= 30
    assert spent["eyes"] >= 30
    assert spent["sees"] < 30
    assert sum(spent.values()) <= frame.frame_ms["max"]


def test_a_pass_that_most_frames_leave_out_takes_no_time_in_the_median() -> None:
    always, once = StepTime("a", 2.0, 1.0), StepTime("b", 600.0, 500.0)
    frames = [FrameTimes(603.0, (once, always)), FrameTimes(3.0, (always,)), FrameTimes(3.0, (always,))]
    assert median_times(frames) == [StepTime("b", 0.0, 0.0), StepTime("a", 2.0, 1.0)]
