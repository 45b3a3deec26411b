"""Sessions: what a frame makes, what closing frees, borrowed contexts, frames and camera moves."""

from __future__ import annotations

import subprocess
import sys
import threading
from typing import Any

import moderngl
import numpy as np
import pytest

import rendergraph as rg
from rendergraph.authoring.node_check import flush_deleted_programs
from rendergraph.errors import InputError, Problem, RenderError, UsageError
from rendergraph.gl import device
from rendergraph.gl.raw import RawGL
from rendergraph.resources import shipped_pipelines

FLAT = """
from rendergraph.api import Any, Node, Output


class Flat(Node):
    \"\"\"One value.\"\"\"

    color = Output(Any, format="r32f", doc="One value.")
"""
KINDS = ("Texture", "Buffer", "Framebuffer", "VertexArray", "Sampler", "Program", "Query", "Renderbuffer")


def living(raw: RawGL, most: int = 3000) -> dict[str, int]:
    """How many GL objects of each kind exist."""
    return {kind: sum(bool(getattr(raw, f"glIs{kind}")(name)) for name in range(1, most)) for kind in KINDS}


def test_closing_a_session_frees_everything_it_made() -> None:
    ctx = moderngl.create_context(standalone=True, backend="egl", require=450)  # type: ignore[arg-type]  # its stub knows only dicts
    session = rg.Session(ctx=ctx)
    raw = session.device.raw
    flush_deleted_programs(session.device)
    before = living(raw)
    pipeline = rg.load("forward", size=(64, 36))
    for variant in (pipeline, pipeline.set("shadows.taps", 1), pipeline.with_scene("spheres")):
        session.render(variant)
    assert living(raw) != before
    session.close()
    flush_deleted_programs(session.device)
    assert living(raw) == before
    ctx.release()


def test_frames_make_no_gl_object(gl: rg.Session) -> None:
    pipeline = rg.load("forward-prepass", size=(64, 36))
    counts: list[dict[str, int]] = []
    for _ in gl.frames(pipeline, frames=range(1, 5)):
        with gl.current():
            counts.append(living(gl.device.raw, 1500))
    assert counts[1] == counts[3]


def test_what_was_current_before_is_current_again() -> None:
    ctx = moderngl.create_context(standalone=True, backend="egl", require=450)  # type: ignore[arg-type]  # its stub knows only dicts
    buffer = ctx.buffer(b"mine")
    with rg.Session() as session:
        assert buffer.read() == b"mine"
        session.render(rg.load("forward", size=(16, 16)))
        assert buffer.read() == b"mine"
    assert buffer.read() == b"mine"
    ctx.release()


def test_an_orbit_moves_the_camera_and_frames_differ(gl: rg.Session, tmp_path: Any) -> None:
    (tmp_path / "s.yaml").write_text(
        "scene: 1\nobjects: {box: {shape: box, size: [1, 0.5, 0.2]}}\n"
        "cameras: {main: {eye: [0, 1, 3], target: [0, 0, 0]}}\norbit: {camera: main, degrees_per_second: 90}\n"
    )
    pipeline = rg.load("forward", scene=tmp_path / "s.yaml", size=(32, 32))
    seen = [frame["image"] for frame in gl.frames(pipeline, frames=range(1, 6), fps=1.0)]
    assert not np.array_equal(seen[0], seen[1])
    difference = np.abs(seen[0].astype(float) - seen[4].astype(float))  # once around, but for rounding at edges
    assert (difference > 2).mean() < 0.02


def test_keyframes_move_objects_and_lights(gl: rg.Session, tmp_path: Any) -> None:
    (tmp_path / "s.yaml").write_text(
        "scene: 1\nobjects: {box: {shape: box, size: [1, 1, 1]}}\n"
        "lights: {sun: {type: directional, direction: [0, 0, -1], intensity: 3}}\n"
        "cameras: {main: {eye: [0, 0, 5], target: [0, 0, 0], height: 4, near: 0.1, far: 50}}\n"
        "keyframes: {objects.box.at: {0: [-1, 0, 0], 1: [1, 0, 0]}, lights.sun.intensity: {0: 3, 1: 1}}\n"
    )
    pipeline = rg.load("forward", scene=tmp_path / "s.yaml", size=(32, 32)).set("light.ambient", 0)
    seen = [frame["radiance"][..., 0] for frame in gl.frames(pipeline, frames=range(1, 3), fps=1.0)]
    first, second = (array > 0 for array in seen)
    np.testing.assert_array_equal(first, second[:, ::-1])
    np.testing.assert_allclose(seen[0].max(), 3 * seen[1].max(), rtol=0.01)


def test_unknown_outputs_and_taps_name_what_there_is(gl: rg.Session) -> None:
    pipeline = rg.load("forward", size=(16, 16))
    with pytest.raises(InputError, match=r"no output 'imgae'; did you mean 'image'"):
        pipeline.render(outputs=["imgae"], session=gl)
    with pytest.raises(InputError, match=r"RG206 --tap ligth.radiance: there is no node 'ligth'; did you mean 'light'"):
        pipeline.render(taps=["ligth.radiance"], session=gl)


def test_what_a_notebook_gives_is_understood_or_refused_in_words(gl: rg.Session) -> None:
    pipeline = rg.load("deferred", size=(8, 8))
    values = np.linspace(0, 1, 3, dtype=np.float32)
    assert pipeline.set("display.exposure", values[1]).selection.sets == ("display.exposure=0.5",)
    assert pipeline.set("light.ambient", values).selection.sets == ("light.ambient=[0.0, 0.5, 1.0]",)
    frame = gl.render(pipeline, outputs="image", taps="gbuffer.depth")
    assert list(frame) == ["image", "gbuffer.depth"]
    with pytest.raises(
        KeyError, match=r"no output 'depth'; .*gbuffer.depth.*; render\(taps=\['NODE.PORT'\]\) adds ports"
    ):
        frame["depth"]
    for source in ("deferred", shipped_pipelines()["deferred"]):
        np.testing.assert_array_equal(gl.render(source, (8, 8))["image"], gl.render(pipeline)["image"])
    assert gl.render(pipeline, size=(4, 4)).size == (4, 4)
    for frames in (5, range(0), range(3)):
        with pytest.raises(UsageError, match="expected a range of numbers from 1"):
            gl.render(pipeline, frames=frames)  # type: ignore[arg-type]  # a mistake
    with pytest.raises(UsageError, match="fps: expected a number above 0, got 0"):
        gl.render(pipeline, fps=0)


def test_what_can_be_typed_is_offered() -> None:
    assert set(rg.__all__) <= set(dir(rg))
    assert all(name in rg.__all__ or name == "__version__" for name in dir(rg))


def test_values_of_python_are_told_in_a_line(gl: rg.Session) -> None:
    pipeline = rg.load("forward", size=(16, 8)).set("shadows.taps", 2)
    assert repr(pipeline) == "load('forward', size=(16, 8), sets=('shadows.taps=2',))"
    assert repr(gl.render(pipeline)) == "<Frame 1 of forward, 16×8: image, radiance>"
    assert repr(pipeline.link().graph).startswith("<Graph forward, 16×8: sun, ")
    stages = [
        pipeline.resolve(),
        pipeline.link(),
        pipeline.expand(),
        pipeline.check(),
        pipeline.plan(),
        pipeline.link().scene,
    ]
    assert all(len(repr(value)) < 120 for value in stages)


@pytest.mark.parametrize(
    ("size", "means"),
    [
        ("320x180", r"size=\(320, 180\)"),
        (320, "expected width and height"),
        ((320.5, 180), "expected width and height"),
        ((1, 2, 3), "expected width and height"),
    ],
)
def test_a_size_that_is_no_pair_is_told_what_one_is(size: Any, means: str) -> None:
    pipeline = rg.load("forward")
    with pytest.raises(UsageError, match=means):
        pipeline.render(size=size)
    with pytest.raises(UsageError, match=means):
        rg.load("forward", size=size)


def test_who_asks_is_told_how_far_it_is(gl: rg.Session, capsys: pytest.CaptureFixture[str]) -> None:
    told: list[tuple[int, int]] = []
    gl.render("forward", (8, 8), frames=range(1, 4), progress=lambda done, total: told.append((done, total)))
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert capsys.readouterr().err == ""
    gl.render("forward", (8, 8), frames=range(1, 4), progress=True)
    shown = capsys.readouterr().err
    assert "3 of 3 frames" in shown
    assert shown.endswith("\r")


def test_a_closed_session_says_so_and_may_be_closed_again() -> None:
    with rg.Session() as session:
        session.close()
        with pytest.raises(RenderError, match="RG615 the session is closed; render before"):
            session.render(rg.load("forward", size=(8, 8)))


def test_another_thread_may_not_close_a_session() -> None:
    said: list[str] = []

    def close() -> None:
        with pytest.raises(RenderError, match="RG615") as caught:
            session.close()
        said.append(str(caught.value))

    with rg.Session() as session:
        thread = threading.Thread(target=close)
        thread.start()
        thread.join()
        assert said == ["RG615 a session must be closed by the thread that created it; render and close it there"]
        assert session.render("shading-unlit", (8, 8))["image"].any()


def test_a_closed_session_leaves_no_context_current() -> None:
    """A handle that stays current after its context's end may be that of the next context, which GLVND then skips."""
    egl = device._egl()
    outside = egl.eglGetCurrentContext()
    with rg.Session() as outer:
        outer.render("shading-unlit", (8, 8))
        before = egl.eglGetCurrentContext()
        with rg.Session() as inner:
            assert inner.render("shading-unlit", (8, 8))["image"].any()
        assert egl.eglGetCurrentContext() == before
        assert outer.render("shading-unlit", (8, 8))["image"].any()
    assert egl.eglGetCurrentContext() == outside


def test_a_context_that_its_owner_has_released_is_said() -> None:
    ctx = moderngl.create_context(standalone=True, backend="egl", require=450)  # type: ignore[arg-type]  # its stub knows only dicts
    with rg.Session(ctx=ctx) as session:
        session.render("shading-unlit", (8, 8))
        ctx.release()
        with pytest.raises(RenderError, match="RG615 the session's context has been released; keep it until"):
            session.render("shading-unlit", (8, 8))


FORKED = """
import os, signal, sys
import rendergraph as rg
from rendergraph.errors import RendergraphError
with rg.Session() as session:
    session.render("shading-unlit", (8, 8))
    sys.stdout.flush()
    child = os.fork()
    if child:
        assert os.waitpid(child, 0)[1] == 0
        assert session.render("shading-unlit", (8, 8))["image"].any()
        print("parent draws")
    else:
        signal.alarm(60)
        for draw in (lambda: session.render("shading-unlit", (8, 8)), rg.Session):
            try:
                draw()
            except RendergraphError as error:
                print(error)
"""


def test_a_forked_process_is_told_that_it_cannot_draw() -> None:
    done = subprocess.run([sys.executable, "-c", FORKED], capture_output=True, text=True, check=False, timeout=120)
    assert done.stdout.splitlines() == [
        "RG615 a session cannot be used after a fork; fork before OpenGL is used, or start new processes ('spawn')",
        "RG611 OpenGL was used before this process was forked, and drivers do not survive a fork; "
        "start new processes instead, as multiprocessing does with 'spawn'",
        "parent draws",
    ], done.stderr


def test_a_frame_shows_itself_in_a_notebook(gl: rg.Session) -> None:
    frame = rg.load("forward", size=(16, 16)).render(session=gl)
    assert frame._repr_png_().startswith(b"\x89PNG")
    assert rg.load("forward")._repr_html_().lstrip().startswith("<svg")


def test_variants_drawn_in_turns_are_compiled_once_and_keep_their_pictures(gl: rg.Session) -> None:
    variants = [rg.load("forward", size=(32, 18)).set("display.curve", curve) for curve in ("aces", "neutral")]
    variants.append(variants[0].set("display.exposure", 1.0))
    first = [gl.render(variant)["image"] for variant in variants]
    compiled, made = gl.cache.programs.compiled, gl.device.textures_made
    again = [gl.render(variant)["image"] for variant in variants]
    assert gl.cache.programs.compiled == compiled
    assert gl.device.textures_made == made
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(first[0], first[2])


def test_two_plugins_with_equal_names_keep_their_shaders(gl: rg.Session, tmp_path: Any) -> None:
    values = []
    for value in ("0.25", "0.75"):
        folder = tmp_path / value
        folder.mkdir()
        (folder / "flat.py").write_text(FLAT)
        (folder / "flat.frag").write_text(f"out float color; void main() {{ color = {value}; }}")
        (folder / "flat.yaml").write_text("rendergraph: 1\nnodes: {a: {type: flat}}\noutputs: {image: a.color}")
        frame = gl.render(rg.load(folder / "flat.yaml", size=(4, 4), plugins=[folder / "flat.py"]))
        values.append(float(frame.arrays["image"].mean()))
    assert values == [0.25, 0.75]


def test_closing_one_session_leaves_the_others_alone() -> None:
    pipeline = rg.load("forward", size=(16, 16))
    first = rg.Session()
    with rg.Session() as second:
        first.render(pipeline)
        before = second.render(pipeline)["image"]
        with second.device.current():
            names = living(second.device.raw)
        first.close()
        with second.device.current():
            assert living(second.device.raw) == names
        np.testing.assert_array_equal(second.render(pipeline)["image"], before)


def test_a_scene_that_fails_leaves_the_session_as_good_as_new(gl: rg.Session, monkeypatch: pytest.MonkeyPatch) -> None:
    small, other = (rg.load("forward", scene=scene, size=(16, 16)) for scene in ("cornell_box", "spheres"))
    before = gl.render(small)["image"]

    def broken(scene: object) -> None:
        raise RenderError(Problem("RG612", "no memory"))

    with monkeypatch.context() as patch:
        patch.setattr("rendergraph.scene.pack.pack", broken)
        with pytest.raises(RenderError, match="no memory"):
            gl.render(other)
    np.testing.assert_array_equal(gl.render(small)["image"], before)


def test_limits_are_raised_by_the_name_that_the_message_gives(tmp_path: Any) -> None:
    deep = "x: " + "[" * 70 + "]" * 70
    (tmp_path / "deep.yaml").write_text(f"rendergraph: 1\n{deep}\n")
    with pytest.raises(InputError, match="--limit yaml-depth=N"):
        rg.load(tmp_path / "deep.yaml").resolve().spec.check()
    with pytest.raises(InputError) as caught:
        rg.load(tmp_path / "deep.yaml", limits={"yaml-depth": 100}).resolve().spec.check()
    assert "yaml-depth" not in str(caught.value)
    (tmp_path / "scene.yaml").write_text(f"scene: 1\n{deep}\n")
    with pytest.raises(InputError, match="--limit yaml-depth=N"):
        rg.load("forward", scene=tmp_path / "scene.yaml").check()
    with pytest.raises(InputError) as caught:
        rg.load("forward", scene=tmp_path / "scene.yaml", limits={"yaml-depth": 100}).check()
    assert "yaml-depth" not in str(caught.value)
    with pytest.raises(InputError, match="--limit scene-vertices=N"):
        rg.load("forward", limits={"scene-vertices": 10}, scene=_triangle(tmp_path)).check()
    with pytest.raises(UsageError, match="unknown limit 'scene-vertexes'; did you mean 'scene-vertices'"):
        rg.load("forward", limits={"scene-vertexes": 10})


def _triangle(folder: Any) -> Any:
    rows = [f"v {k} {k * k} 0" for k in range(20)] + [f"f {k} {k + 1} {k + 2}" for k in range(1, 18)]
    (folder / "t.obj").write_text("\n".join(rows))
    return folder / "t.obj"


def test_a_tap_whose_input_is_missing_says_which() -> None:
    with pytest.raises(InputError, match=r"RG116 --tap shadows\.visibility: it needs input 'depth' of 'shadows'"):
        rg.load("forward").expand(taps=["shadows.visibility"])
