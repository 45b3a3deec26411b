"""What is in scope in a step, where it comes from, and its text with files noted: a compiler takes it."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

import rendergraph as rg
from rendergraph.program import StageText, TextSources, stage_texts
from rendergraph.program.scope import InScope, annotated, in_scope
from rendergraph.program.variants import variants
from rendergraph.scene.pack import pack
from rendergraph.steps import Step

PROGRAMS = ("fullscreen", "geometry", "draw", "compute")


def programs(pipeline: rg.Pipeline) -> Iterator[tuple[Step, dict[str, str], dict[str, StageText], list[InScope]]]:
    """Every variant of every step: its macros, its stages and its scope."""
    expanded = pipeline.expand()
    scene, made = expanded.linked.scene, expanded.expansion
    types, packed = {node.id: node.type for node in expanded.linked.graph.nodes}, pack(scene)
    sources = TextSources(types, made.resources, made.views)
    for step in made.steps:
        for macros in variants(step, scene, packed, made.views) if step.kind in PROGRAMS else ():
            texts = stage_texts(step, sources, defines=macros)
            yield step, macros, texts, in_scope(step, sources, macros, texts)


def scope_of(pipeline: rg.Pipeline, node: str) -> dict[str, str]:
    scope = next(scope for step, _, _, scope in programs(pipeline) if step.node == node)
    return {one.name: one.source for one in scope}


def test_what_a_lighting_step_may_use() -> None:
    found = scope_of(rg.load("ssao-hemisphere").with_scene("cornell_box"), "light")
    assert found["uniform sampler2D depth"] == "input 'depth': gbuffer.depth"
    assert found["uniform sampler2DArray visibility_0"] == "input 'visibility': shadows.visibility"
    assert found["uniform vec3 background"] == "parameter 'background': [0, 0, 0]"
    assert found["depth_view_block { View depth_views[DEPTH_VIEW_COUNT]; }"] == "the views of 'depth'"
    assert found["visibility_0_lights[]"] == "the scene's light of each layer of 'visibility_0'"
    assert found["HAS_OCCLUSION 1"] == "input 'occlusion' is connected"
    assert found["DEPTH_LAYERS 1"] == "texture 'depth'"
    assert found["TERMS TERMS_ALL"] == found["TERMS_DIFFUSE 2"] == "parameter 'terms'"
    assert found["LIGHT_SPOTS 1"] == "the scene's lights"
    assert found["float shadow(int light, vec3 position, vec3 normal)"] == "texture 'visibility_0'"
    assert found["camera_block { View camera; }"] == "include/view.glsl"
    assert "direct_lighting()" in found["include/lighting.glsl"]
    assert found["vec2 v_uv"] == "vertex shader, include/fullscreen.vert"
    assert found["out vec4 radiance"].startswith("light.radiance, ")


def test_what_a_geometry_step_may_use() -> None:
    found = scope_of(rg.load("forward", scene="cornell_box"), "light")
    assert found["float shadow(int light, vec3 position, vec3 normal)"] == "node 'shadows'"
    assert found["uniform sampler2DArrayShadow shadows_shadow_map"] == "sun.shadow_map, for a function"
    assert any(source == "parameter 'bias' of 'shadows': 1" or "of 'shadows'" in source for source in found.values())
    assert found["PASS_VIEW_COUNT 1"] == "the step's view"
    assert found["MATERIAL_COUNT 4"] == "the scene and its materials"
    assert found["vec3 in_position"].startswith("vertex shader, include/")


def test_its_own_textures_and_steps_defines() -> None:
    scopes = [scope for step, _, _, scope in programs(rg.load("ssao-hemisphere")) if step.node == "ao"]
    sources = {one.source for scope in scopes for one in scope}
    assert "its own 'full_surfaces'" in sources
    assert any(one.section == "textures" and one.source.startswith("input 'normal'") for s in scopes for one in s)


def test_each_run_of_lines_says_where_it_stands() -> None:
    texts = next(texts for step, _, texts, _ in programs(rg.load("forward")) if step.node == "display")
    shown = annotated(texts["fragment"])
    plain = [line for line in texts["fragment"].text.split("\n") if line.strip()]
    assert [line for line in shown.split("\n") if line and not line.startswith("// ")] == plain
    where = re.search(r"// (display/tonemap\.frag:\d+)\n#if RADIANCE_SAMPLES > 1", shown)
    assert where is not None
    assert "// macros\n#define RADIANCE_SAMPLES 1\n#define " in shown
    assert "// include/view.glsl:" in shown


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["cornell_box", "glass", "shadow_study"])
def test_variants_are_those_that_are_compiled(scene: str, gl: rg.Session) -> None:
    pipeline = rg.load("forward", scene=scene, size=(32, 32))
    before = set(gl.cache.programs._programs)
    gl.render(pipeline)
    compiled = {text for key in gl.cache.programs._programs.keys() - before for text in key if isinstance(text, tuple)}
    told = {(stage, text.text) for _, _, texts, _ in programs(pipeline) for stage, text in texts.items()}
    assert {pair for pair in compiled if pair and pair[0] in ("vertex", "fragment")} <= told
