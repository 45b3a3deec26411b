"""Frames in which nothing moves are counted for techniques that average over them."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest

from rendergraph.api import Any as Anything
from rendergraph.api import Frame, Internal, Node, Output, Steps, structural

COUNTED = "#include <frame.glsl>\nout vec4 color;\nvoid main() { color = vec4(float(still_frames)); }\n"


class Counted(Node):
    """How many frames nothing has moved, beside something that may move."""

    color = Output(Anything, format="rgba32f", size=(1, 1), doc="Frames.")
    other = Output(Anything, format="rgba8", clear=0.0, doc="Beside.")
    numbers = Internal(kind="buffer", bytes=16)

    moves: Literal["nothing", "shader", "update"] = structural(default="nothing", doc="What moves.")

    def record(self, steps: Steps) -> None:
        if self.moves != "shader":
            steps.clear(self.other)
        else:
            steps.geometry("white.frag", vertex="swing.vert", out={"color": self.other}, materials="none")
        steps.fullscreen("counted.frag", numbers=self.numbers, out={"color": self.color})

    def update(self, frame: Frame) -> None:
        if self.moves == "update":
            frame.write(self.numbers, np.full(4, frame.time, np.float32))


@pytest.mark.parametrize(("moves", "counts"), [("nothing", [0, 1, 2]), ("shader", [0, 0, 0]), ("update", [0, 0, 0])])
def test_a_frame_in_which_a_node_moves_something_is_not_still(bench: Any, moves: str, counts: list[int]) -> None:
    shaders = {
        "counted.frag": COUNTED.replace("out vec4", "readonly buffer numbers { vec4 number; };\nout vec4", 1),
        "white.frag": "out vec4 color;\nvoid main() { color = vec4(1.0); }\n",
        "swing.vert": "#include <frame.glsl>\n#include <transform.glsl>\n"
        "void main() { gl_Position = world_to_clip(object_to_world(in_position) + sin(time)); }\n",
    }
    text = f"nodes: {{a: {{type: counted, params: {{moves: {moves}}}}}}}\noutputs: {{image: a.color, other: a.other}}\n"
    frames = bench.frames(text, Counted, shaders=shaders, scene="objects: {one: {shape: box}}\n", frames=range(1, 4))
    assert [frame["image"][0, 0, 0] for frame in frames] == counts
