"""What nodes are told of the scene before the schedule: objects, and the lights that cast."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import rendergraph as rg
from rendergraph.api import Facts, LightFacts, Node, ObjectFacts, Output, Radiance, SceneError, Steps, casting_lights
from rendergraph.scene.facts import object_facts

LIGHTS = (
    LightFacts("fill", "directional", casts_shadow=False),
    LightFacts("lamp", "spot"),
    LightFacts("key", "directional"),
    LightFacts("bulb", "point"),
)
SCENE = """objects:
  floor: {shape: plane, size: [4, 4], material: white}
  ball: {shape: sphere, at: [0, 1, 0], material: glass}
  box: {shape: box, at: [1, 1, 0], material: white, casts_shadow: false}
  gone: {shape: box, hidden: true}
materials:
  white: {double_sided: true}
  glass: {alpha_mode: blend}
"""


@pytest.mark.parametrize(
    ("wanted", "found"),
    [("auto", (2,)), ("all", (1, 2, 3)), ("fill", (0,)), (["bulb", "lamp", "bulb"], (1, 3)), ([], ())],
)
def test_lights_that_cast(wanted: Any, found: tuple[int, ...]) -> None:
    assert Facts((1, 1), LIGHTS).casting(wanted) == found == casting_lights(wanted, LIGHTS)


def test_auto_takes_a_spot_light_where_no_directional_one_casts_then_a_point_light() -> None:
    assert casting_lights("auto", LIGHTS[:2]) == (1,)
    assert casting_lights("auto", LIGHTS[3:]) == (0,)
    assert casting_lights("auto", ()) == ()


def test_a_light_that_is_not_there() -> None:
    with pytest.raises(SceneError, match="the scene has no light 'kye'; did you mean 'key'"):
        casting_lights("kye", LIGHTS)
    with pytest.raises(SceneError, match="the scene has no light 'sun'; there are no lights"):
        casting_lights("sun", ())


class Told(Node):
    """A picture, after having looked at the scene."""

    color = Output(Radiance, clear=0.0, doc="Triangles.")

    def record(self, steps: Steps) -> None:
        words: tuple[Any, ...] = ("all", "opaque", "transparent", "casters", ["ball", "box"], ["gone"])
        SEEN.append((steps.facts.objects, {str(word): steps.draws(word) for word in words}))
        steps.clear(self.color, 0.0)


SEEN: list[tuple[tuple[ObjectFacts, ...], dict[str, bool]]] = []


def test_record_is_told_of_the_scenes_objects(bench: Any) -> None:
    bench.pipeline("nodes: {a: {type: told}}\noutputs: {image: a.color}", Told, scene=SCENE).plan()
    objects, draws = SEEN.pop()
    floor, ball, box, gone = objects
    assert floor == ObjectFacts("floor", 2, 4, True, False, True)
    assert len({floor, ObjectFacts("floor", 2, 4, True, False, True)}) == 1, (
        "its mesh, which is asked later, is not compared"
    )
    assert floor != ObjectFacts("floor", 2, 4, True, False, True, reflective=True)
    assert floor != ObjectFacts("flour", 2, 4, True, False, True)
    assert repr(floor).endswith("reflective=False, mesh='plane')")
    assert (ball.name, ball.blended, ball.double_sided, ball.casts_shadow) == ("ball", True, False, True)
    assert (box.name, box.triangles, box.casts_shadow) == ("box", 12, False)
    assert [one.closed for one in objects] == [False, True, True, True]
    assert floor.gap == (
        "object 'floor' is not closed: in its mesh 'plane' only one triangle has the edge from (-2, 0, -2) to (-2, 0, 2)"
    )
    assert box.gap == ""
    assert [one.flat for one in objects] == [True, False, False, False]
    assert [one.most_layers for one in objects] == [1, 1, 2, 1], "flat; convex, from outside; from both sides; convex"
    assert gone.hidden
    assert gone not in Facts((1, 1), objects=objects).drawn("all")
    assert all(draws.values())


def test_steps_draws_what_is_there(bench: Any) -> None:
    scene = "objects: {pane: {shape: plane, material: glass}}\nmaterials: {glass: {alpha_mode: blend}}\n"
    bench.pipeline("nodes: {a: {type: told}}\noutputs: {image: a.color}", Told, scene=scene).plan()
    _, draws = SEEN.pop()
    assert draws["transparent"]
    assert draws["all"]
    assert not any(draws[word] for word in ("opaque", "casters", "['ball', 'box']"))


def test_shipped_scenes_are_told_of() -> None:
    objects = object_facts(rg.load("forward").link().scene)
    assert sum(one.triangles for one in objects) > 10
    assert len({one.name for one in objects}) == len(objects)


def test_what_is_not_convex_may_be_met_as_often_as_it_has_triangles(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(
        "scene: 1\nobjects:\n  ring: {shape: torus}\n  can: {shape: cylinder}\n  hat: {shape: cone}\n"
    )
    ring, can, hat = object_facts(rg.load("forward", scene=tmp_path / "a.yaml").link().scene)
    assert ring.most_layers == ring.triangles
    assert (can.most_layers, hat.most_layers) == (1, 1)
