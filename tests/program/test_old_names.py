"""Old names of the shared includes: plugins' shaders that use them work, and `check` warns."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import rendergraph as rg
from rendergraph.glsl.files import strip_comments
from rendergraph.resources import folder

SHADERS = folder("rendergraph.shaders")
OLD_NAMES: dict[str, str] = json.loads((SHADERS / "include" / "old_names.json").read_text())
LIT = {
    "old": """#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>
out vec4 radiance;
void main() {
    Surface surface = surface_here(PASS_VIEW);
    Reflected light = reflected_lights(surface), around = light_around(surface);
    light.diffuse *= abs(dot(surface.to_viewer, to_viewer(PASS_VIEW, surface.position)));
    radiance = vec4(radiance_of(surface, light, around), 1.0);
}
""",
    "new": """#include <pass_view.glsl>
#include <fragment_surface.glsl>
#include <lighting.glsl>
out vec4 radiance;
void main() {
    Surface surface = fragment_surface(PASS_VIEW);
    ReflectedLight light = direct_lighting(surface), around = environment_lighting(surface);
    light.diffuse *= abs(dot(surface.view_dir, view_dir(PASS_VIEW, surface.position)));
    radiance = vec4(radiance_of(surface, light, around), 1.0);
}
""",
}
MODEL = {
    "old": """Reflected reflected(Surface s, vec3 to_light) {
    return Reflected(s.diffuse * max(dot(s.normal, to_light), 0.0), vec3(max(dot(s.to_viewer, to_light), 0.0)));
}
""",
    "new": """ReflectedLight shade(Surface s, vec3 light_dir) {
    return ReflectedLight(s.diffuse * max(dot(s.normal, light_dir), 0.0), vec3(max(dot(s.view_dir, light_dir), 0.0)));
}
""",
}
NODES = "nodes:\n  a: {type: lit}\noutputs: {radiance: a.radiance}\n"
LIGHTING = """from rendergraph.nodes.lighting.forward_lighting import ForwardLighting

class Lit(ForwardLighting):
    \"\"\"Lighting with a shader of its own.\"\"\"
"""


def test_shipped_shaders_use_no_old_name() -> None:
    text = ""
    for file in SHADERS.rglob("*.*"):
        if file.suffix in (".glsl", ".frag", ".vert", ".geom", ".comp"):
            text += strip_comments(file.read_text())
    for old, new in OLD_NAMES.items():
        assert new in text or (SHADERS / "include" / new).is_file(), new
        before = "" if old[0] in "<." else r"(?<![\w.])"
        assert not re.search(before + re.escape(old.removesuffix(")")) + ("" if old[-1] == ")" else r"\b"), text), old


def test_a_lighting_shader_with_old_names_draws_the_same(author: Any, gl: rg.Session) -> None:
    pictures = []
    for age in ("old", "new"):
        author.write(lit__py=LIGHTING, forward_lighting__frag=LIT[age])
        pipeline = author.pipeline(NODES, scene="objects: {box: {shape: box}}\n", size="[24, 16]")
        pictures.append(gl.render(pipeline)["radiance"])
        warned = [problem.text for problem in pipeline.check().warnings]
        assert warned == (
            [
                "'.to_viewer' is now called 'view_dir'",
                "'Reflected' is now called 'ReflectedLight'",
                "'light_around()' is now called 'environment_lighting'",
                "'reflected_lights()' is now called 'direct_lighting'",
                "'surface_here()' is now called 'fragment_surface'",
                "'to_viewer()' is now called 'view_dir'",
            ]
            if age == "old"
            else []
        )
    assert np.array_equal(pictures[0], pictures[1])
    assert pictures[0].max() > 0


def test_a_shading_model_with_old_names_draws_the_same(gl: rg.Session, tmp_path: Path) -> None:
    for age, text in MODEL.items():
        (tmp_path / f"{age}.glsl").write_text(f"// {age}\n{text}")
    choices = ", ".join(f'"{age}": "{age}.glsl"' for age in MODEL)
    (tmp_path / "extension.py").write_text(
        f'from rendergraph.api import Extension\nEXTENSION = Extension(choices={{"shading": {{{choices}}}}})\n'
    )
    pictures = []
    for age in MODEL:
        pipeline = rg.load("forward", plugins=[tmp_path], size=(24, 16)).set("light.shading", age)
        pictures.append(gl.render(pipeline)["image"])
        assert [problem.code for problem in pipeline.check().warnings] == ["RG449"] * (3 if age == "old" else 0)
    assert np.array_equal(pictures[0], pictures[1])


def test_a_node_may_call_methods_of_lighting_by_their_old_names(author: Any) -> None:
    body = """
    def record(self, steps):
        Lighting.record(self, steps)
        reads = self.around(steps) | {"lookup": self.lookup}
        steps.geometry("forward_lighting.frag", out=self.pictures(steps), objects="opaque", **reads)
        self.blend_after(steps)
"""
    imports = "from rendergraph.nodes.lighting._lighting import Lighting\n"
    author.write(lit__py=imports + LIGHTING + body)
    pipeline = author.pipeline(NODES, scene="objects: {box: {shape: box}}\n")
    with pytest.warns(DeprecationWarning, match="is now called") as warned:
        assert pipeline.expand().expansion.steps
    assert [str(one.message) for one in warned] == [
        "`around` is now called `environment_reads`",
        "`pictures` is now called `color_targets`",
        "`blend_after` is now called `draw_backdrop_and_transparent`",
    ]


def test_a_function_of_ones_own_may_have_an_old_name(author: Any, gl: rg.Session) -> None:
    author.node('color = Output(Radiance, doc="Colour.")')
    own = "vec3 srgb(vec3 value) { return value + 2.0; }\n"
    text = "out vec4 color;\nvoid main() { color = vec4(srgb(linear_to_srgb(vec3(1.0))), 1.0); }\n"
    author.write(wrong__frag=f"#include <srgb.glsl>\n{own}{text}")
    assert not any(problem.code == "RG449" for problem in author.pipeline().check().warnings)
    assert np.allclose(gl.render(author.pipeline())["image"], [3, 3, 3, 1])


def test_what_an_include_lets_a_file_define_may_have_its_old_name(author: Any, gl: rg.Session) -> None:
    author.node('color = Output(Radiance, doc="Colour.")')
    tap = "vec4 halving_tap(ivec2 texel) { return vec4(3.0); }\n"
    text = "out vec4 color;\nvoid main() { color = halved(ivec2(0), ivec2(3)); }\n"
    author.write(wrong__frag=f"#include <halving.glsl>\n{tap}{text}")
    assert np.allclose(gl.render(author.pipeline())["image"], 3)


def test_an_old_include_is_found(author: Any) -> None:
    text = "#include <{}>\nout vec4 color;\nvoid main() {{ color = linear_to_srgb(vec3(0.5)).rgbb; }}\n"
    author.node('color = Output(Radiance, doc="Colour.")')
    author.write(
        wrong__frag="#include <halving.glsl>\n"
        + text.format("srgb.glsl")
        + "vec4 halving_tap(ivec2 texel) { return vec4(1); }\n"
    )
    (found,) = {str(problem).splitlines()[0] for problem in author.pipeline().check().warnings if "<" in problem.text}
    assert found.endswith("wrong.frag:1:10: warning: RG449 '<halving.glsl>' is now called 'downsample.glsl'")


def test_the_page_of_rg449(author: Any) -> None:
    (file,) = folder("rendergraph.errors").glob("RG449-*.yaml")
    page: dict[str, Any] = yaml.safe_load(file.read_text())
    for kind, expected in (("wrong", [page["message"]]), ("right", [])):
        author.write(glow__frag=page[kind])
        pipeline = author.pipeline(
            "nodes:\n  f: {type: flat}\n  a: {type: ./plugins/glow.frag, inputs: {radiance: f.color}}\noutputs: {image: a.color}\n"
        )
        author.node('color = Output(Radiance, doc="Colour.")', name="flat")
        author.write(flat__frag="out vec4 color; void main() { color = vec4(1.0); }")
        warned = [str(problem).splitlines()[0] for problem in pipeline.check().warnings]
        assert [text.removeprefix(f"{author.plugins}/glow.frag:") for text in warned] == expected


def test_an_own_function_of_an_old_name_is_left_alone(author: Any) -> None:
    author.node('color = Output(Radiance, doc="Colour.")')
    author.write(wrong__frag="out vec4 color;\nvec4 moved() { return vec4(1.0); }\nvoid main() { color = moved(); }\n")
    assert author.pipeline().check().warnings == ()
