"""Where a step may draw: scissor rectangles that `update` sets, depth bounds, clip distances."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.api import ADD, Depth, Frame, Internal, Node, Output, Radiance, State, Steps, param
from rendergraph.errors import InputError, RendergraphError

Draw = Callable[..., rg.Frame]
TEXT = "nodes: {a: {type: NAME}}\noutputs: {image: a.color}"
WHOLE = "vec2 corners[3] = vec2[](vec2(-1, -1), vec2(3, -1), vec2(-1, 3));\nvoid main() {"
SHADERS = {
    "one.frag": "uniform float value; out float color; void main() { color = value; }",
    "whole.vert": WHOLE + "gl_Position = vec4(corners[gl_VertexID], 0.0, 1.0); }",
    "cut.vert": WHOLE + "gl_Position = vec4(corners[gl_VertexID], 0.0, 1.0); gl_ClipDistance[0] = gl_Position.x;\n"
    "#if PLANES > 1\ngl_ClipDistance[1] = gl_Position.y;\n#endif\n}",
}


class Lamps(Node):
    """Two rectangles that follow the frame, and one that nobody sets."""

    color = Output(Radiance, format="r32f", clear=0.0, doc="Sum.")
    wide: int = param(default=3, min=-9, max=100, doc="Width of the first.")

    def record(self, steps: Steps) -> None:
        for number in range(3):
            steps.fullscreen("one.frag", state=State(blend=ADD), region=number, value=10.0**number)

    def update(self, frame: Frame) -> None:
        frame.set_region(0, (frame.index, 1, self.wide, 2))
        frame.set_region(1, (-4, 0, 8, 2))
        frame.set_region(7, (0, 0, 1, 1))


def test_each_frame_has_its_rectangles(bench: Any) -> None:
    drawn = bench.frames(TEXT.replace("NAME", "lamps"), Lamps, shaders=SHADERS, frames=range(1, 4))
    for start, frame in enumerate(drawn, 1):
        expected = np.full((8, 16), 100.0)
        expected[1:3, start : start + 3] += 1
        expected[:2, :4] += 10
        np.testing.assert_array_equal(frame.arrays["image"][::-1, :, 0], expected)


def test_an_empty_rectangle_draws_nothing_and_a_negative_one_is_refused(bench: Any) -> None:
    pipeline = bench.pipeline(TEXT.replace("NAME", "lamps"), Lamps, shaders=SHADERS)
    image = bench.session.render(pipeline.set("a.wide", 0)).arrays["image"]
    assert set(np.unique(image)) == {100, 110}
    with pytest.raises(InputError, match=r"RG433 node 'a' .*: scissor is \(1, 1, -2, 2\), not x, y, width and height"):
        bench.session.render(pipeline.set("a.wide", -2))


class Kept(Lamps):
    """A kept texture in a region."""

    color = Output(Radiance, format="r32f", clear=0.0, kept=True, doc="Sum.")


def test_what_is_kept_is_not_drawn_in_a_region(bench: Any) -> None:
    with pytest.raises(InputError, match=r"RG439 .* it makes 'a.color', which is kept, in a region that `update` sets"):
        bench.pipeline(TEXT.replace("NAME", "kept"), Kept, shaders=SHADERS).check()


class Cut(Node):
    """The quarter that two clip distances leave, then everything."""

    color = Output(Radiance, format="r32f", clear=0.0, doc="Sum.")

    def record(self, steps: Steps) -> None:
        for planes in (2, 1):
            state = State(blend=ADD, clip_distances=planes)
            defines = {"PLANES": planes}
            steps.draw("one.frag", vertex="cut.vert", vertices=3, state=state, defines=defines, value=10.0**planes)
        steps.draw("one.frag", vertex="whole.vert", vertices=3, state=State(blend=ADD), value=1.0)


def test_clip_distances_hold_for_their_step_alone(draw: Draw) -> None:
    image = draw(TEXT.replace("NAME", "cut"), Cut, shaders=SHADERS, size=(8, 8)).arrays["image"][..., 0]
    expected = np.ones((8, 8))
    expected[:, 4:] += 10
    expected[:4, 4:] += 100
    np.testing.assert_array_equal(image, expected)


class Bounded(Node):
    """Colour where the depth lies in a range."""

    color = Output(Radiance, format="r32f", clear=0.0, doc="1 in the range.")
    depth = Internal(Depth, format="depth32f", clear=0.25)
    by_state: ClassVar[bool] = True

    def record(self, steps: Steps) -> None:
        steps.clear(self.depth, 0.25)
        state = State(depth_test=False, depth_write=False, depth_bounds=(0.0, 0.2) if self.by_state else None)
        out = {"color": self.color, "depth": self.depth}
        steps.draw("one.frag", vertex="whole.vert", vertices=3, out=out, state=state, region=0, value=1.0)
        steps.draw("one.frag", vertex="whole.vert", vertices=3, out=out, state=State(depth_write=False), value=1.0)

    def update(self, frame: Frame) -> None:
        if not self.by_state:
            frame.set_region(0, depth_bounds=(0.0, 0.1))


class BoundedLater(Bounded):
    """The same in `update`."""

    by_state: ClassVar[bool] = False


def test_depth_bounds_that_the_driver_lacks_are_an_error_or_passed_over(bench: Any) -> None:
    if bench.session.device.limits["depth_bounds"]:
        assert (bench.draw(TEXT.replace("NAME", "bounded"), Bounded, shaders=SHADERS)["image"] == 0).all()
        return
    with pytest.raises(RendergraphError, match=r"RG435 node 'a' .*: its `State` has depth bounds, which this device"):
        bench.draw(TEXT.replace("NAME", "bounded"), Bounded, shaders=SHADERS)
    text = TEXT.replace("NAME", "bounded_later")
    assert (bench.draw(text, BoundedLater, shaders=SHADERS).arrays["image"] == 1).all()


@pytest.mark.parametrize(("cls", "bounds"), [(Bounded, (0.0, 0.2)), (BoundedLater, (0.0, 0.1))])
def test_depth_bounds_are_set_for_their_step_alone(bench: Any, monkeypatch: Any, cls: Any, bounds: Any) -> None:
    device, called = bench.session.device, []
    enable, disable = device.raw.glEnable, device.raw.glDisable
    monkeypatch.setitem(device.limits, "depth_bounds", 1)
    monkeypatch.setattr(device.raw, "glDepthBoundsEXT", lambda *range: called.append(range), raising=False)
    for name, before in (("glEnable", enable), ("glDisable", disable)):
        monkeypatch.setattr(
            device.raw, name, lambda what, name=name, do=before: called.append(name) if what == 0x8890 else do(what)
        )
    name = "bounded" if cls is Bounded else "bounded_later"
    bench.draw(TEXT.replace("NAME", name), cls, shaders=SHADERS, warm_up=False)
    assert called == ["glEnable", bounds, "glDisable"]


class Switched(Node):
    """A rectangle and a buffer, which `update` sets where it is switched on."""

    values = Internal(kind="buffer", bytes=16, doc="Four numbers.")
    color = Output(Radiance, format="rgba32f", clear=0.0, doc="The numbers in the rectangle.")
    on: bool = param(default=True, doc="Set both.")
    count: int = param(default=4, min=0, max=4, doc="How many numbers.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("four.frag", values=self.values, region=0)

    def update(self, frame: Frame) -> None:
        if self.on:
            frame.set_region(0, (0, 0, 4, 8))
            frame.write(self.values, np.arange(1, self.count + 1, dtype=np.float32))


@pytest.mark.parametrize("reuse", [True, False])
def test_what_update_sets_in_a_drawing_does_not_hold_in_the_next_one(bench: Any, reuse: bool) -> None:
    four = (
        "layout(std430) readonly buffer values { vec4 four; }; out vec4 color;"
        "void main() { color = four + vec4(gl_FragCoord.x); }"
    )
    pipeline = bench.pipeline(TEXT.replace("NAME", "switched"), Switched, shaders={"four.frag": four})
    variants = [pipeline, pipeline.set("a.on", False), pipeline.set("a.count", 2), pipeline]
    pictures = [bench.session.render(variant, reuse=reuse)["image"] for variant in variants]
    for picture, numbers in zip(pictures, ([1, 2, 3, 4], None, [1, 2, 0, 0], [1, 2, 3, 4]), strict=True):
        expected = np.repeat(np.arange(16)[None, :, None] + np.array(numbers or [0] * 4) + 0.5, 8, axis=0)
        if numbers is not None:
            expected[:, 4:] = 0
        np.testing.assert_array_equal(picture, expected)
