"""What `update` sets and asks in each frame: single uniforms, and what has changed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from rendergraph.api import Frame, Function, Input, Node, Output, Radiance, ShadowLookup, Steps, param
from rendergraph.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    import rendergraph as rg


HOOK: dict[str, Callable[[Frame], None]] = {}
"""What `update` does."""


class Wind(Node):
    """Shows two uniforms, of which `update` sets one, and in every third frame another."""

    color = Output(Radiance, format="rgba32f", doc="Both.")
    other = Output(Radiance, format="rgba32f", doc="Both in another step, which has the same program.")
    lookup = Function(ShadowLookup, shader="wind.glsl", reads=(), doc="The gain.")

    gain: float = param(default=0.5, doc="Factor.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("wind.frag", out={"color": self.color}, wind=(1.0, 2.0))
        steps.fullscreen("wind.frag", out={"color": self.other}, wind=(3.0, 4.0))

    def update(self, frame: Frame) -> None:
        HOOK["act"](frame)


class Same(Node):
    """Has the same program and a parameter of the same name."""

    color = Output(Radiance, format="rgba32f", doc="Both.")
    gain: float = param(default=7.0, doc="Factor.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("wind.frag", wind=(8.0, 9.0))


class Asks(Node):
    """Calls a function."""

    lookup = Input(ShadowLookup, kind="function", doc="What to call.")
    color = Output(Radiance, format="rgba32f", doc="Its value.")
    shader = "asks.frag"


SHADERS = {
    "wind.frag": "uniform vec2 wind; uniform float gain; out vec4 color; void main() { color = vec4(wind, gain, 0.0); }",
    "wind.glsl": "uniform float gain; float shadow(int light, vec3 position, vec3 normal) { return gain; }",
    "asks.frag": "out vec4 color; void main() { color = vec4(shadow(0, vec3(0.0), vec3(0.0))); }",
}
TEXT = """nodes:
  a: {type: wind}
  b: {type: same}
  c: {type: asks, inputs: {lookup: a.lookup}}
outputs: {color: a.color, other: a.other, same: b.color, called: c.color}
"""


@pytest.fixture(params=[True, False], ids=["reuse", "all"])
def values(bench: Any, gl: rg.Session, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Any:
    def drawn(act: Callable[[Frame], None], frames: int = 4) -> list[dict[str, list[float]]]:
        monkeypatch.setitem(HOOK, "act", act)
        pipeline = bench.pipeline(TEXT, Wind, Same, Asks, shaders=SHADERS)
        found = gl.frames(pipeline, frames=range(1, frames + 1), reuse=request.param)
        return [{name: frame[name][0, 0, :3].tolist() for name in frame} for frame in found]

    return drawn


PLAIN = {"color": [1, 2, 0.5], "other": [3, 4, 0.5], "same": [8, 9, 7], "called": [0.5, 0.5, 0.5]}


def test_a_uniform_follows_what_update_sets(values: Any) -> None:
    def act(frame: Frame) -> None:
        if frame.index > 1:
            frame.set_uniform("wind", (frame.index, 10.0))
        if frame.index == 3:
            frame.set_uniform("gain", 0.25)

    first, second, third, fourth = values(act)
    assert first == PLAIN
    assert second == {**PLAIN, "color": [2, 10, 0.5], "other": [2, 10, 0.5]}
    third_gain = {"called": [0.25, 0.25, 0.25], "same": [8, 9, 7]}  # the other node's stays
    assert third == {"color": [3, 10, 0.25], "other": [3, 10, 0.25], **third_gain}
    assert fourth == {"color": [4, 10, 0.25], "other": [4, 10, 0.25], **third_gain}
    assert values(lambda frame: None, 1) == [PLAIN]  # what was set does not outlive the drawing


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        (
            "wnd",
            1.0,
            "set_uniform is given 'wnd', which is not a parameter or a keyword of a step; did you mean 'wind'",
        ),
        ("wind", 1.0, "set_uniform: declares 'wind' as vec2, but it is given 1 number"),
        ("wind", "x", "wind='x': expected"),
    ],
)
def test_a_wrong_uniform(values: Any, name: str, value: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        values(lambda frame: frame.set_uniform(name, value))


SCENE = """
cameras:
  main: {eye: [3, 2, 4], target: [0, 0.5, 0]}
lights: {sun: {type: directional, direction: [-1, -2, -1], intensity: 3}}
objects: {ball: {shape: sphere, radius: 0.5, at: [0, 0.5, 0]}}
keyframes:
  KEY
"""
WORDS = ("camera", "transforms", "lights", "materials", "environment")


@pytest.mark.parametrize(
    ("key", "word"),
    [
        ("objects.ball.at: {0: [0, 0, 0], 0.03: [0, 1, 0]}", "transforms"),
        ("lights.sun.intensity: {0: 1, 0.03: 2}", "lights"),
        ("cameras.main.eye: {0: [3, 2, 4], 0.03: [3, 3, 4]}", "camera"),
    ],
)
def test_a_frame_says_what_has_changed(
    bench: Any, gl: rg.Session, monkeypatch: pytest.MonkeyPatch, key: str, word: str
) -> None:
    seen: list[set[str]] = []

    def act(frame: Frame) -> None:
        seen.append({one for one in WORDS if frame.changed(one)})  # type: ignore[arg-type]  # mypy wants the words
        assert frame.changed() == bool(seen[-1])

    monkeypatch.setitem(HOOK, "act", act)
    scene = SCENE.replace("KEY", key)
    pipeline = bench.pipeline(TEXT, Wind, Same, Asks, shaders=SHADERS, scene=scene)
    list(gl.frames(pipeline, frames=range(1, 4)))
    assert seen == [set(WORDS), {word}, set()]


def test_a_wrong_word(values: Any) -> None:
    with pytest.raises(InputError, match=r"changed is given 'camara'; did you mean 'camera'"):
        values(lambda frame: frame.changed("camara"))
