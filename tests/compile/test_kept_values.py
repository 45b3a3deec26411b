"""What one pipeline has made and kept, another takes over: the same bits, made once."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.api import (
    ADD,
    EnvironmentMap,
    Input,
    Internal,
    Node,
    Output,
    Radiance,
    State,
    Steps,
    param,
)
from rendergraph.api import (
    Any as Anything,
)
from rendergraph.errors import InputError

SHADERS = {
    "sums.comp": "layout(local_size_x = 4) in; layout(std430) buffer sums { vec4 sum[4]; }; uniform float value;"
    "void main() { sum[gl_LocalInvocationIndex] = vec4(value + float(gl_LocalInvocationIndex)); }",
    "levels.frag": "layout(std430) readonly buffer sums { vec4 sum[4]; }; out vec4 table;"
    "void main() { table = sum[int(gl_FragCoord.x) % 4] + gl_FragCoord.y; }",
    "more.frag": "uniform float value; out vec4 table; void main() { table = vec4(value); }",
    "show.frag": "uniform sampler2D table; uniform float gain; out vec4 color;"
    "void main() { color = gain * textureLod(table, gl_FragCoord.xy / 8.0, 1.0); }",
    "sign.frag": "uniform float value; out vec4 table; void main() { table = vec4(1.0 / value > 0.0 ? 1.0 : -1.0); }",
    "held.frag": "uniform sampler2D picture; out vec4 made; void main() { made = textureLod(picture, vec2(0.5), 0.0); }",
}


class Table(Node):
    """A texture with levels, made of a buffer and drawn onto."""

    sums = Internal(kind="buffer", bytes=64, kept=True, doc="Four numbers.")
    table = Output(Radiance, format="rgba32f", size=(8, 8), mips=0, kept=True, doc="Made of them.")
    value: float = param(default=1.0, min=-100, max=100, doc="The first of them.")

    def record(self, steps: Steps) -> None:
        steps.compute("sums.comp", over=(4, 1, 1), out=self.sums)
        steps.fullscreen("levels.frag", sums=self.sums, out=self.table)
        steps.fullscreen("more.frag", out=self.table, state=State(blend=ADD))
        steps.mipmaps(self.table)


class Show(Node):
    """A table's second level as a picture."""

    table = Input(Radiance, size="any", filter="trilinear", doc="Table.")
    color = Output(Radiance, format="rgba32f", doc="Picture.")
    gain: float = param(default=1.0, min=-100, max=100, doc="Factor.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("show.frag", table=self.table)


class Hold(Node):
    """A texel of the environment."""

    picture = Input(EnvironmentMap, size="any", doc="Picture.")
    made = Output(Anything, format="rgba32f", size=(1, 1), kept=True, doc="One texel.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("held.frag", picture=self.picture)


ONE = "nodes: {a: {type: table}, b: {type: show, inputs: {table: a.table}}}\noutputs: {image: b.color}\n"
OTHER = ONE.replace("a.table}}", "a.table}}, c: {type: show, inputs: {table: a.table}}").replace(
    "b.color}", "b.color, second: c.color}"
)
MADE = ["a"] * 4


@pytest.fixture
def session() -> Iterator[rg.Session]:
    with rg.Session() as made:
        yield made


def ran(frame: rg.Frame) -> list[str]:
    """The nodes of the steps of the only frame."""
    return [step.node for step in frame.times[0].steps]


def both(bench: Any) -> tuple[rg.Pipeline, rg.Pipeline]:
    """One pipeline, and another that makes the same table."""
    (bench.folder / "other").mkdir()
    other = type(bench)(bench.folder / "other", bench.session)
    return bench.pipeline(ONE, Table, Show, shaders=SHADERS), other.pipeline(OTHER, Table, Show, shaders=SHADERS)


def drawn(session: rg.Session, pipeline: rg.Pipeline, **options: Any) -> rg.Frame:
    return session.render(pipeline, warm_up=False, timed=True, **options)


def test_another_pipeline_takes_over_what_one_has_made(bench: Any, session: rg.Session) -> None:
    one, other = both(bench)
    first = drawn(session, one)
    assert ran(first) == [*MADE, "b"]
    second = drawn(session, other)
    assert sorted(ran(second)) == ["b", "c"]
    np.testing.assert_array_equal(second["image"], first["image"])
    np.testing.assert_array_equal(second["second"], first["image"])
    changed = drawn(session, other.set("a.value", 5.0))
    assert sorted(ran(changed)) == [*MADE, "b", "c"]
    assert (changed["image"] - first["image"] == 8.0).all()  # once in the buffer, once drawn onto it
    np.testing.assert_array_equal(drawn(session, one)["image"], first["image"])  # it was another's copy that changed


def test_a_value_that_was_there_before_is_there_again(bench: Any, session: rg.Session) -> None:
    pipeline = bench.pipeline(ONE, Table, Show, shaders=SHADERS)
    pictures = {value: drawn(session, pipeline.set("a.value", value))["image"] for value in (1.0, 2.0, 3.0)}
    for value, picture in pictures.items():
        again = drawn(session, pipeline.set("a.value", value))
        assert ran(again) == ["b"]
        np.testing.assert_array_equal(again["image"], picture)
    assert not np.array_equal(pictures[1.0], pictures[2.0])


def test_what_reads_a_value_that_is_there_again_runs_again(bench: Any, session: rg.Session) -> None:
    pipeline = bench.pipeline(ONE, Table, Show, shaders=SHADERS)
    first, second, third = (session.render(pipeline.set("a.value", value))["image"] for value in (1.0, 2.0, 1.0))
    np.testing.assert_array_equal(third, first)
    assert not np.array_equal(second, first)


class Sign(Node):
    """1 or -1, as the sign of zero."""

    table = Output(Radiance, format="rgba32f", size=(1, 1), kept=True, doc="One texel.")
    color = Output(Radiance, format="rgba32f", size=(1, 1), doc="The same in each frame.")
    value: float = param(default=1.0, min=-100, max=100, doc="A number.")

    def record(self, steps: Steps) -> None:
        for out in (self.table, self.color):
            steps.fullscreen("sign.frag", out={"table": out})


def test_zero_and_minus_zero_are_two_values(bench: Any, session: rg.Session) -> None:
    text = "nodes: {a: {type: sign}}\noutputs: {kept: a.table, image: a.color}\n"
    pipeline = bench.pipeline(text, Sign, shaders=SHADERS)
    for value, sign in ((0.0, 1), (-0.0, -1), (0.0, 1), (-0.0, -1)):
        frame = session.render(pipeline.set("a.value", value))
        assert (frame["kept"][0, 0, 0], frame["image"][0, 0, 0]) == (sign, sign)


def test_nothing_is_copied_while_one_pipeline_goes_on(bench: Any, session: rg.Session) -> None:
    pipeline = bench.pipeline(ONE, Table, Show, shaders=SHADERS)
    drawn(session, pipeline)
    made = session.device.textures_made
    drawn(session, pipeline.set("b.gain", 2.0))
    assert session.device.textures_made == made
    drawn(session, pipeline.set("a.value", 2.0))
    assert session.device.textures_made == made + 1


def test_another_size_scene_and_text_tell_what_is_the_same(bench: Any, session: rg.Session) -> None:
    pipeline = bench.pipeline(ONE, Table, Show, shaders=SHADERS)
    drawn(session, pipeline)
    assert ran(drawn(session, pipeline.with_size((16, 4)))) == ["b"]
    assert ran(drawn(session, pipeline.with_scene("spheres"))) == ["b"]
    shaders = SHADERS | {"more.frag": SHADERS["more.frag"].replace("vec4(value)", "vec4(-value)")}
    other = drawn(session, bench.pipeline(ONE, Table, Show, shaders=shaders))
    assert ran(other) == [*MADE[1:], "b"]  # the buffer is made as before


@pytest.mark.parametrize("mode", [{"poison": True}, {"shuffle": 3}, {"alias": False}])
def test_the_modes_that_check_a_pipeline_make_all_of_it(bench: Any, session: rg.Session, mode: dict[str, Any]) -> None:
    pipeline = bench.pipeline(ONE, Table, Show, shaders=SHADERS)
    plain = drawn(session, pipeline)
    checked = drawn(session, pipeline, **mode)
    assert ran(checked) == [*MADE, "b"]
    np.testing.assert_array_equal(checked["image"], plain["image"])


def test_what_broke_off_is_not_passed_on(bench: Any, session: rg.Session, monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = both(bench)
    with session.current():
        compiled = session.compile(one)
        compiled.executable.lists[0][1] = None  # type: ignore[call-overload]
    with pytest.raises(AttributeError), session.current():
        compiled.draw(1)
    assert sorted(ran(drawn(session, other))) == [*MADE, "b", "c"]


def test_copies_keep_to_a_budget_and_are_freed(bench: Any) -> None:
    with rg.Session() as session:
        pipeline = bench.pipeline(ONE, Table, Show, shaders=SHADERS)
        one = 16 * (64 + 16 + 4 + 1) + 64  # bytes of the levels and of the buffer
        session.cache.kept.limit = 2 * one
        for value in (1.0, 2.0, 3.0, 4.0):
            drawn(session, pipeline.set("a.value", value))
        values = session.cache.kept
        assert len(values._copies) == 4  # two of each; the last is in the executable alone
        assert ran(drawn(session, pipeline.set("a.value", 1.0))) == [*MADE, "b"]
        assert ran(drawn(session, pipeline.set("a.value", 4.0))) == ["b"]
        with session.current():
            textures = [held.glo for held in values._copies.values() if hasattr(held, "target")]
            assert textures
            session.cache.release()
            assert not any(session.device.raw.glIsTexture(name) for name in textures)


def picture(file: Path, light: float) -> None:
    oiio = pytest.importorskip("OpenImageIO")
    out = oiio.ImageOutput.create(str(file))
    out.open(str(file), oiio.ImageSpec(4, 2, 3, "float"))
    out.write_image(np.full((2, 4, 3), light, np.float32))
    out.close()


def test_an_environment_is_known_by_its_file(bench: Any, session: rg.Session, tmp_path: Path) -> None:
    text = "nodes: {hold: {type: hold}}\noutputs: {made: hold.made}\n"
    file = tmp_path / "e.exr"
    picture(file, 0.5)
    for number, scene in enumerate(("one", "two")):
        lights = {"sun": {"type": "directional", "intensity": number + 1.0}}
        (tmp_path / f"{scene}.yaml").write_text(
            json.dumps({"scene": 1, "lights": lights, "environment": {"file": "e.exr"}})
        )
    pipeline = bench.pipeline(text, Hold, shaders=SHADERS)
    assert ran(drawn(session, pipeline.with_scene(tmp_path / "one.yaml"))) == ["hold"]
    again = drawn(session, pipeline.with_scene(tmp_path / "two.yaml"))
    assert not ran(again)
    assert (again["made"][0, 0, :3] == 0.5).all()
    picture(file, 2.0)
    os.utime(file, ns=(1, 1))
    changed = drawn(session, pipeline.with_scene(tmp_path / "one.yaml"))
    assert ran(changed) == ["hold"]
    assert (changed["made"][0, 0, :3] == 2.0).all()
    for scene, count in (("one", 1), ("two", 0)):
        assert (
            len(ran(drawn(session, pipeline.with_scene(tmp_path / f"{scene}.yaml").select(environment=Path("sky")))))
            == count
        )


def test_materials_are_nothing_to_keep_something_of(bench: Any) -> None:
    text = "nodes: {hold: {type: hold}}\noutputs: {made: hold.made}\n"
    shader = "#include <materials.glsl>\nout vec4 made; void main() { made = materials[0].base_color; }"
    with pytest.raises(InputError, match=r"RG439 .*uses the scene's materials"):
        bench.pipeline(text, Hold, shaders=SHADERS | {"held.frag": shader}).with_scene("spheres").check()
