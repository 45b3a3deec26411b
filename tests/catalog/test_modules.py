"""Nodes that extend shipped nodes from a folder of their own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rendergraph.nodes.lighting.forward_lighting import ForwardLighting

import rendergraph as rg
from rendergraph.api import DROPPED
from rendergraph.authoring.examine import examine, find_node
from rendergraph.catalog import Catalog
from rendergraph.errors import InputError

PLAIN = '''"""Forward lighting without a pre-pass."""

from rendergraph.api import DROPPED
from rendergraph.nodes.lighting.forward_lighting import ForwardLighting


class PlainLighting(ForwardLighting):
    """Radiance of the scene, drawn without a pre-pass and without pictures of shadows."""

    depth = DROPPED
    visibility = DROPPED
'''
HARD = '''"""Shadows without a filter."""

from rendergraph.api import DROPPED
from rendergraph.nodes.shadows.shadow_pcf import ShadowPCF


class HardShadows(ShadowPCF):
    """Shadows to look up in place alone."""

    visibility = DROPPED
    depth = DROPPED
'''
PIPELINE = """extends: forward
scene: cornell_box
nodes:
  shadows: {type: hard_shadows}
  light: {type: plain_lighting, params: {evaluate: %s}}
"""


class WithoutDepth(ForwardLighting):
    """What a type checker sees of a port that is dropped."""

    depth = DROPPED


@pytest.fixture
def plugin(tmp_path: Path) -> Path:
    home = tmp_path / "plugin"
    home.mkdir()
    (home / "plain_lighting.py").write_text(PLAIN)
    (home / "hard_shadows.py").write_text(HARD)
    return home


def test_a_parameter_outlives_the_port_that_took_its_place(plugin: Path) -> None:
    text = PLAIN.replace("PlainLighting", "ConstantLighting").replace("depth = DROPPED", "environment = DROPPED")
    (plugin / "constant_lighting.py").write_text(text)
    found = Catalog.discover([plugin], installed=False).get("constant_lighting").cls
    assert "environment" not in found.inputs()
    assert found.parameters()["ambient"].unless == "environment"


def test_a_dropped_port_is_no_port() -> None:
    assert "depth" not in WithoutDepth.ports()
    assert "depth" not in WithoutDepth.inputs()
    assert WithoutDepth().depth is None
    assert "depth" in ForwardLighting.ports()


@pytest.mark.parametrize("evaluate", ["fragment", "face"])
def test_a_node_finds_the_shaders_of_the_one_it_extends(
    gl: rg.Session, plugin: Path, tmp_path: Path, evaluate: str
) -> None:
    file = tmp_path / "plain.yaml"
    file.write_text(PIPELINE % evaluate)
    settings: Any = {"plugins": [plugin], "size": (40, 30)}
    found = gl.render(rg.load(file, **settings).set("sun.resolution", 64))["image"]
    shipped = (
        rg.load("forward", size=(40, 30), scene="cornell_box").set("sun.resolution", 64).set("light.evaluate", evaluate)
    )
    np.testing.assert_array_equal(found, gl.render(shipped)["image"])


def test_a_file_of_its_own_goes_before_the_bases(gl: rg.Session, plugin: Path, tmp_path: Path) -> None:
    (plugin / "forward_lighting.frag").write_text("out vec4 radiance;\nvoid main() { radiance = vec4(0.25); }\n")
    file = tmp_path / "plain.yaml"
    file.write_text(PIPELINE % "fragment")
    frame = gl.render(rg.load(file, plugins=[plugin], size=(8, 8)), outputs=["radiance"])
    assert set(np.unique(frame["radiance"])) <= {0.0, 0.25}


OPEN = '''"""Occlusion that is none."""

from rendergraph.api import Steps
from rendergraph.nodes.occlusion._screen_space import ScreenSpaceOcclusion


class Open(ScreenSpaceOcclusion):
    """All surfaces are open within a metre, those farther off count by their distance."""

    def record(self, steps: Steps) -> None:
        self.gather_surfaces(steps)
        steps.fullscreen("open.frag", out=self.occlusion, surfaces=self.surfaces)
'''
OPEN_SHADER = """#include "surfaces.glsl"
uniform sampler2D surfaces;
uniform float radius;
out float occlusion;

void main() {
    vec4 here = texelFetch(surfaces, ivec2(gl_FragCoord.xy), 0);
    occlusion = here.w == 0.0 ? 1.0 : radius / max(radius, clip_w(surfaces_views[0], here.w));
}
"""


def test_a_shader_of_its_own_takes_in_what_lies_beside_those_of_the_base(gl: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "open.py").write_text(OPEN)
    (tmp_path / "open.frag").write_text(OPEN_SHADER)
    pipeline = rg.load("ssao-hbao", sets=["ao.type=open"], plugins=[tmp_path / "open.py"], size=(16, 12))
    frame = gl.render(pipeline.set("ao.radius", 1e6), outputs=[], taps=["ao.occlusion"])
    np.testing.assert_array_equal(frame.arrays["ao.occlusion"], 1.0)
    assert examine(find_node(tmp_path / "open.py")).problems == ()


def test_a_link_to_a_dropped_port_is_refused(plugin: Path, tmp_path: Path) -> None:
    file = tmp_path / "plain.yaml"
    file.write_text(PIPELINE % "fragment" + "  prepass: {type: depth_prepass}\n")
    with pytest.raises(InputError, match=r"RG103 node 'light' \(plain_lighting\) has no param or input 'depth'"):
        rg.load(file, plugins=[plugin]).set("light.depth", "prepass.depth").check()


def test_a_plugin_extends_a_plugins_node(plugin: Path, tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    (whole / "nodes" / "sky").mkdir(parents=True)
    (whole / "shaders" / "sky").mkdir(parents=True)
    (whole / "nodes" / "sky" / "_base.py").write_text(PLAIN.replace("class Plain", "class Base"))
    (whole / "nodes" / "sky" / "dome.py").write_text(
        '"""A dome."""\nfrom ._base import BaseLighting\n\n\nclass Dome(BaseLighting):\n    """A dome."""\n'
    )
    found = Catalog.discover([whole], installed=False).get("dome")
    assert found.shaders == whole / "shaders" / "sky"
    assert [folder.name for folder in found.inherited] == ["lighting"]
    assert found.shader_file("forward_lighting.frag")[0].is_file()
    assert found.shader_file("nowhere.frag")[0] == found.shaders / "nowhere.frag"


def test_none_that_drops_nothing_is_a_mistake(plugin: Path) -> None:
    (plugin / "plain_lighting.py").write_text(PLAIN.replace("    depth =", "    dept ="))
    with pytest.raises(InputError, match=r"plain_lighting\.py:10:5: RG490 .*'dept' is None, which drops a port"):
        Catalog.discover([plugin], installed=False).get("plain_lighting")


def test_a_port_that_others_refer_to_is_not_dropped_alone(plugin: Path) -> None:
    (plugin / "hard_shadows.py").write_text(HARD.replace("    visibility = DROPPED\n", ""))
    with pytest.raises(InputError, match="port 'visibility': needs: there is no port 'depth'"):
        Catalog.discover([plugin], installed=False).get("hard_shadows")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hard_shadows", pytest.param("plain_lighting", marks=pytest.mark.nightly)])
def test_it_passes_check_node(plugin: Path, name: str) -> None:
    found = Catalog.discover([plugin]).get(name)
    assert examine(found, renders=lambda variant: not variant.name).mistakes == ()
