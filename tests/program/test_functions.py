"""Functions that one node gives and another calls, views that textures carry, and what is empty."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from rendergraph.api import (
    Depth,
    Facts,
    Frame,
    Function,
    Input,
    Internal,
    Node,
    Output,
    Radiance,
    ShadowLookup,
    ShadowMap,
    Steps,
    ViewMatrices,
    Views,
    Visibility,
    define,
    param,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    import rendergraph as rg

    Draw = Callable[..., rg.Frame]

LIGHTS = """lights:
  sun: {type: directional, direction: [0, -1, 0], intensity: 1}
  lamp: {type: point, at: [0, 1, 0], intensity: 1}
"""


class Lit(Node):
    """What light 0 and light 1 leave."""

    lookup = Input(ShadowLookup, kind="function", many=True, optional=True, doc="Shadows.")
    visibility = Input(Visibility, kind="texture2d_array", many=True, optional=True, doc="Shadows as pictures.")
    color = Output(Radiance, format="rg32f", doc="Both lights.")


class Half(Node):
    """A shadow of its own strength on one light, from a texture it fills itself."""

    lookup = Function(ShadowLookup, "half.glsl", reads=("scratch",), doc="Constant visibility.")
    scratch = Internal(format="r32f", size=(1, 1))
    light: int = param(default=0, doc="Which light.")
    strength: float = param(default=0.5, doc="What is left of it.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("fill.frag", out=self.scratch)


class Screen(Node):
    """Visibility in screen space, of light 1."""

    visibility = Output(
        Visibility, kind="texture2d_array", format="r32f", layers=1, lights=lambda node, facts: (1,), doc="0.25."
    )

    def record(self, steps: Steps) -> None:
        steps.fullscreen("quarter.frag", out=self.visibility.layer(0))


SHADERS = {
    "lit.frag": "out vec2 color; void main() { color = vec2(shadow(0, vec3(0), vec3(0, 1, 0)), shadow(1, vec3(0), vec3(0, 1, 0))); }",
    "half.glsl": """uniform sampler2D scratch; uniform int light; uniform float strength;
        const float one = 1.0;
        float shadow(int which, vec3 position, vec3 normal) {
            return which == light ? texelFetch(scratch, ivec2(0), 0).r * one : one;
        }""",
    "fill.frag": "uniform float strength; out float r; void main() { r = strength; }",
    "quarter.frag": "out float r; void main() { r = 0.25; }",
}


def test_a_function_without_providers_is_neutral(draw: Draw) -> None:
    frame = draw("nodes: {l: {type: lit}}\noutputs: {image: l.color}", Lit, shaders=SHADERS, scene=LIGHTS)
    assert np.all(frame["image"] == 1.0)


def test_functions_and_screen_space_textures_are_multiplied(draw: Draw) -> None:
    text = """nodes:
  a: {type: half, params: {strength: 0.5}}
  b-2: {type: half, params: {strength: 0.75, light: 1}}
  s: {type: screen}
  l: {type: lit, inputs: {lookup: [a.lookup, b-2.lookup], visibility: s.visibility}}
outputs: {image: l.color}"""
    frame = draw(text, Lit, Half, Screen, shaders=SHADERS, scene=LIGHTS)
    np.testing.assert_allclose(frame["image"][0, 0], [0.5, 0.75 * 0.25])


class Maps(Node):
    """Depth 0.25 from every spot light: views and lights travel with the texture."""

    views = Views(count=lambda node, facts: len(_spots(facts)), lights=lambda node, facts: _spots(facts), doc="Views.")
    shadow_map = Output(
        ShadowMap,
        kind="texture2d_array",
        format="depth32f",
        size=(4, 4),
        clear=0.25,
        view="views",
        layers=lambda node, facts: len(_spots(facts)),
        lights=lambda node, facts: _spots(facts),
        doc="Depth.",
    )

    def record(self, steps: Steps) -> None:
        steps.clear(self.shadow_map, 0.25)

    def update(self, frame: Frame) -> None:
        views = []
        for number, light in enumerate(light for light in frame.scene.lights if light.type == "spot"):
            moved = np.eye(4)
            moved[0, 3] = 10.0 * (number + 1)
            views.append(ViewMatrices(moved, np.eye(4), (4, 4), 0.1, 10.0))
            assert light.type == "spot"
        frame.set_views(self.views, views)


def _spots(facts: Facts) -> tuple[int, ...]:
    return tuple(index for index, light in enumerate(facts.lights) if light.type == "spot")


class Lookup(Node):
    """Shows what a reader of a shadow map is told: the light of each layer and where its view is."""

    shadow_map = Input(ShadowMap, kind="texture2d_array", size="any", doc="Map.")
    lookup = Function(ShadowLookup, "table.glsl", reads=("shadow_map",), doc="Number of the view.")


TABLE = {
    "table.glsl": """uniform sampler2DArray shadow_map;
        float shadow(int light, vec3 position, vec3 normal) {
            for (int layer = 0; layer < SHADOW_MAP_LAYERS; ++layer)
                if (shadow_map_lights[layer] == light)
                    return shadow_map_views[layer].view[3].x + texelFetch(shadow_map, ivec3(0, 0, layer), 0).r;
            return 1.0;
        }""",
}
TEXT = """nodes:
  m: {type: maps}
  t: {type: lookup, inputs: {shadow_map: m.shadow_map}}
  l: {type: lit, inputs: {lookup: t.lookup}}
outputs: {image: l.color}"""


def test_a_shadow_map_carries_its_views_and_lights(draw: Draw) -> None:
    scene = """lights:
  point: {type: point, at: [0, 1, 0], intensity: 1}
  spot: {type: spot, at: [0, 1, 0], direction: [0, -1, 0], intensity: 1, inner_degrees: 10, outer_degrees: 20}
"""
    frame = draw(TEXT, Lit, Maps, Lookup, shaders=SHADERS | TABLE, scene=scene)
    np.testing.assert_allclose(frame["image"][0, 0], [1.0, 10.25])


def test_a_map_of_no_light_is_culled_and_said_to_be(draw: Draw) -> None:
    frame = draw(TEXT, Lit, Maps, Lookup, shaders=SHADERS | TABLE, scene=LIGHTS)
    assert np.all(frame["image"] == 1.0)
    assert "no layers" in frame.culled["m"] or "nothing" in frame.culled["m"]
    assert [entry["node"] for entry in frame.passes] == ["l"]


class Plane(Node):
    """The scene's depth as the camera sees it."""

    depth = Output(Depth, format="depth32f", clear=0.0, doc="Depth.")

    def record(self, steps: Steps) -> None:
        steps.geometry("<depth.frag>", vertex="<depth.vert>", out=self.depth, materials="alpha")


class Position(Node):
    """World-space positions from depth, by the view that the depth texture carries."""

    depth = Input(Depth, doc="Depth.")
    position = Output(Radiance, format="rgba32f", doc="Position, 1 where something is.")


def test_positions_are_rebuilt_from_depth_by_the_textures_own_view(draw: Draw) -> None:
    scene = """objects: {wall: {shape: box, size: [8, 8, 2], at: [0, 0, -3]}}
cameras: {main: {eye: [0, 0, 2], target: [0, 0, 0], fov_y_degrees: 90, near: 0.1, far: 50}}
"""
    shader = {
        "position.frag": """in vec2 v_uv; uniform sampler2D depth; out vec4 position; void main() {
            float d = texelFetch(depth, ivec2(gl_FragCoord.xy), 0).r;
            position = vec4(world_position(depth_views[0], v_uv, d), is_nothing(d) ? 0.0 : 1.0); }""",
    }
    text = "nodes: {p: {type: plane}, q: {type: position, inputs: {depth: p.depth}}}\noutputs: {image: q.position, d: p.depth}"
    frame = draw(text, Plane, Position, shaders=shader, scene=scene, size=(16, 16))
    y, x = (np.mgrid[0:16, 0:16] + 0.5) / 8 - 1
    expected = np.stack([x * 4, -y * 4, np.full_like(x, -2.0), np.ones_like(x)], axis=-1)  # front face, 4 m away
    np.testing.assert_allclose(frame["image"], expected, atol=2e-4)
    assert frame.arrays["d"].shape == (16, 16, 1)


class Ramp(Node):
    """A shadow that is read between two texels; a second texture is made only where it is asked for."""

    two = Internal(format="r32f", size=(2, 1))
    extra = Internal(format="r32f", size=(1, 1))
    lookup = Function(ShadowLookup, "ramp.glsl", reads=(two.sampled("linear"), "extra"), doc="Between 0 and 1.")
    more: bool = define(default=False, doc="Whether there is a second factor.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("two.frag", out=self.two)
        if self.more:
            steps.fullscreen("two.frag", out=self.extra)


RAMP = {
    "ramp.glsl": """uniform sampler2D two;
        #ifdef HAS_EXTRA
        uniform sampler2D extra;
        #endif
        float shadow(int light, vec3 position, vec3 normal) {
            float value = texture(two, vec2(0.375, 0.5)).r;
        #ifdef HAS_EXTRA
            value += 1.0 + texelFetch(extra, ivec2(0), 0).r;
        #endif
            return value;
        }""",
    "two.frag": "out float two; void main() { two = floor(gl_FragCoord.x); }",
}


@pytest.mark.parametrize(("more", "value"), [(False, 0.25), (True, 1.25)])
def test_a_function_reads_internals_with_samplers_and_as_far_as_they_are_written(
    draw: Draw, more: bool, value: float
) -> None:
    text = f"""nodes:
  r: {{type: ramp, params: {{more: {str(more).lower()}}}}}
  l: {{type: lit, inputs: {{lookup: r.lookup}}}}
outputs: {{image: l.color}}"""
    frame = draw(text, Lit, Ramp, shaders=SHADERS | RAMP, scene=LIGHTS)
    np.testing.assert_allclose(frame["image"][0, 0], value, atol=1 / 256)
