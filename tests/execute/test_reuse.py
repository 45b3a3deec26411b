"""Steps whose values are still there are left out, and no bit of any picture depends on it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import rendergraph as rg
from rendergraph.api import Any as AnyTexel
from rendergraph.api import Node, Output
from rendergraph.projection import look_at
from rendergraph.scene.model import Camera
from tests.execute.test_modes import KINDS, SHADERS, Mix, Parents, Source, Stamp, Tally, graph

MOVING = """
scene: 1
cameras:
  main: {eye: [3, 2, 4], target: [0, 0.5, 0]}
lights:
  sun: {type: directional, direction: [-1, -2, -1], intensity: 3}
  bulb: {type: point, at: [0, 2, 1], intensity: 4}
objects:
  ground: {shape: plane, size: [6, 6]}
  ball: {shape: sphere, radius: 0.5, at: [0, 0.5, 0]}
keyframes:
  KEY
"""
OTHER = Camera("by hand", look_at((2.5, 2.5, 3.5), (0.0, 0.5, 0.0)), fov_y=0.8, near=0.1, far=50.0)


def test_a_still_scene_is_drawn_once(gl: rg.Session) -> None:
    frames = list(gl.frames(rg.load("deferred", size=(48, 32), scene="cornell_box"), frames=range(1, 4)))
    assert [times.ran for times in frames[-1].times] == [len(gl.cache.active.steps[0]), 0, 0]  # type: ignore[union-attr]
    for frame in frames:
        np.testing.assert_array_equal(frame["image"], frames[0]["image"])


def test_what_is_timed_is_run_and_so_is_what_was_asked_for(gl: rg.Session) -> None:
    steps = len(gl.render("deferred", size=(48, 32), timed=True, frames=range(1, 3)).times[-1].steps)
    assert steps > 1
    assert gl.render("deferred", size=(48, 32), reuse=False, frames=range(1, 3)).times[-1].ran == steps
    assert gl.render("deferred", size=(48, 32), poison=True, frames=range(1, 3)).times[-1].ran == steps
    timed = gl.render("deferred", size=(48, 32), timed=True, reuse=True, frames=range(1, 3))
    assert timed.times[-1].ran == 0
    assert timed.as_json()["steps_run"] == [steps, 0]


def test_a_frame_that_was_broken_off_leaves_nothing(gl: rg.Session, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop() -> None:
        raise KeyboardInterrupt

    pipeline = rg.load("deferred", size=(48, 32), scene="cornell_box")
    first = gl.render(pipeline, warm_up=False)
    executable = gl.cache.active
    assert executable is not None
    with monkeypatch.context() as patch:
        patch.setattr(executable, "end_frame", stop)  # as if Ctrl-C came while the steps were run
        with pytest.raises(KeyboardInterrupt):
            gl.render(pipeline, warm_up=False)
    again = gl.render(pipeline, warm_up=False)
    assert again.times[-1].ran == len(executable.steps[0])
    np.testing.assert_array_equal(again["image"], first["image"])


def changed(gl: rg.Session, pipeline: rg.Pipeline, edited: rg.Pipeline) -> set[str]:
    """The nodes that run again for an edit, with memory of their own each."""
    gl.render(pipeline, warm_up=False, alias=False)
    return drawn(gl.render(edited, warm_up=False, alias=False, timed=True, reuse=True))


def drawn(frame: rg.Frame) -> set[str]:
    """The nodes whose steps the last frame ran."""
    return {step.node for step in frame.times[-1].steps if step.index >= 0}


def test_a_parameter_runs_what_depends_on_it(gl: rg.Session) -> None:
    pipeline = rg.load("ssao-hemisphere", size=(48, 32))
    assert changed(gl, pipeline, pipeline.set("ao.radius", 0.3)) == {"ao", "light", "display"}
    assert changed(gl, pipeline, pipeline.set("display.exposure", 1.0)) == {"display"}


@pytest.mark.parametrize(
    ("key", "nodes"),
    [
        ("lights.sun.intensity: {0: 3, 1: 5}", {"light", "display"}),
        ("lights.sun.direction: {0: [-1, -2, -1], 1: [1, -2, -1]}", {"sun", "shadows", "light", "display"}),
        ("objects.ball.at: {0: [0, 0.5, 0], 1: [1, 0.5, 0]}", {"gbuffer", "sun", "shadows", "light", "display"}),
        ("cameras.main.eye: {0: [3, 2, 4], 1: [4, 2, 3]}", {"gbuffer", "sun", "shadows", "light", "display"}),
    ],
)
def test_what_moves_runs_what_sees_it(bench: Any, gl: rg.Session, key: str, nodes: set[str]) -> None:
    (bench.folder / "moving.yaml").write_text(MOVING.replace("KEY", key))
    pipeline = rg.load("deferred", size=(48, 32), scene=str(bench.folder / "moving.yaml"))
    frames = list(gl.frames(pipeline, frames=range(1, 3), fps=4, warm_up=False, timed=True, reuse=True, alias=False))
    assert drawn(frames[-1]) == nodes
    plain = list(gl.frames(pipeline, frames=range(1, 3), fps=4, warm_up=False, reuse=False))
    for one, other in zip(frames, plain, strict=True):
        np.testing.assert_array_equal(one["image"], other["image"])


class Clock(Node):
    """The time."""

    color = Output(AnyTexel, format="r32f", doc="Seconds.")


@pytest.mark.parametrize(
    "text",
    [
        "#include <frame.glsl>\nout vec4 color; void main() { color = vec4(time); }",
        "#include <frame.glsl>\n#define NOW time\nout vec4 color; void main() { color = vec4(NOW); }",
        "layout(std140) uniform frame_block { float seconds; } frame;\n"
        "out vec4 color; void main() { color = vec4(frame.seconds); }",
        "#include <frame.glsl>\n#define NOW(x) ti##x\nout vec4 color; void main() { color = vec4(NOW(me)); }",
        "#include <frame.glsl>\n#define MADE(f) float f() { return time; }\nMADE(now)\n"
        "out vec4 color; void main() { color = vec4(now()); }",
        "#include <frame.glsl>\n#define MADE(f) float f() { return 1.0; }\nMADE(one)\nfloat now() { return time * one(); }\n"
        "out vec4 color; void main() { color = vec4(now()); }",
    ],
    ids=["a member", "a macro", "the name of its block", "put together", "a function made", "a function behind one"],
)
def test_a_shader_sees_the_time_however_it_names_it(bench: Any, text: str) -> None:
    pipeline = bench.pipeline("nodes: {a: {type: clock}}\noutputs: {x: a.color}", Clock, shaders={"clock.frag": text})
    seen = [float(frame.arrays["x"][0, 0, 0]) for frame in bench.session.frames(pipeline, frames=range(1, 4), fps=2)]
    assert seen == [0.0, 0.5, 1.0]


@pytest.mark.slow
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture], derandomize=True)
@given(
    parents=st.lists(
        st.tuples(KINDS, st.integers(0, 30), st.integers(0, 30), st.integers(0, 5)), min_size=2, max_size=12
    ),
    outputs=st.lists(st.integers(0, 30), max_size=2),
    edits=st.lists(st.tuples(st.integers(0, 1), st.sampled_from([0.5, 1.0, 2.5])), min_size=2, max_size=6),
)
def test_random_graphs_under_edits(
    bench: Any, parents: Parents, outputs: list[int], edits: list[tuple[int, float]]
) -> None:
    pipeline = bench.pipeline(graph(parents, outputs), Source, Mix, Tally, Stamp, shaders=SHADERS)
    edited = [pipeline]
    for node, seed in edits:
        edited.append(edited[-1].set(f"n{node}.seed", seed))
    left_out = 0
    reusing = [bench.session.render(each, warm_up=False) for each in edited]
    for each, reused in zip(edited, reusing, strict=True):
        plain = bench.session.render(each, warm_up=False, reuse=False, alias=False)
        left_out += plain.times[-1].ran - reused.times[-1].ran
        for name in plain:
            np.testing.assert_array_equal(reused[name], plain[name])
    assert left_out > 0 or len({edit[1] for edit in edits}) > 1  # an edit that changes nothing runs nothing


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("ssao-hemisphere", {"ao.radius": 0.2, "ao.blur": 2, "sun.slope_bias": 0.5}),
        ("adaptation", {"display.curve": "hable", "light.terms": "diffuse"}),
        ("shadow-volumes-auto", {"light.backdrop_blur": 0.3}),
        ("deferred-stencil-lights", {"display.exposure": 1.0}),
        ("bloom", {"bloom.intensity": 0.4, "bloom.enabled": False}),
        ("shadow-cascaded", {"light.terms": "ambient"}),
        ("ssgi", {"gi.radius": 0.4}),
        ("taa", {"display.exposure": 1.0}),
    ],
)
def test_shipped_pipelines_under_edits(gl: rg.Session, name: str, values: dict[str, Any]) -> None:
    """Each value on and off again, with a camera of one's own between."""
    base = rg.load(name, size=(48, 32))
    if "sun.resolution" in {f"{node.id}.{word}" for node in base.link().graph.nodes for word in node.node.parameters()}:
        base = base.set("sun.resolution", 256)
    pictures: list[list[rg.Frame]] = [[], []]
    for frames, reuse in zip(pictures, (True, False), strict=True):
        for path, value in [("", None), *values.items(), ("", None)]:
            pipeline = base.set(path, value) if path else base
            for camera in (None, OTHER, None):
                with gl.current():
                    drawing = gl.compile(pipeline, warm_up=False, reuse=reuse, alias=reuse)
                    drawing.begin()
                    drawing.draw(1, camera)
                    frames.append(drawing.read())
    for reused, plain in zip(*pictures, strict=True):
        for output in plain:
            np.testing.assert_array_equal(reused[output], plain[output])
