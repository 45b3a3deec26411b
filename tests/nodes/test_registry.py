"""What holds for every node, before its author has written a test."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from rendergraph.pipelines.textures import TEXTURES

import rendergraph as rg
from rendergraph.authoring.examine import doc_problems, examine
from rendergraph.catalog import Catalog
from rendergraph.declare import Node, declaration_mistakes
from rendergraph.glsl import Includes
from rendergraph.glsl.source import needs
from rendergraph.ports import WrittenPort
from rendergraph.resources import folder, shipped_pipelines

CATALOG = Catalog.discover()
BUILTIN = sorted(name for name in CATALOG.names() if CATALOG.get(name).plugin == "builtin")
SHADERS = folder("rendergraph.shaders")
STAGES = {".vert", ".frag", ".geom", ".comp"}


def module_text(name: str) -> str:
    """The text of a node's module and of the helpers beside it."""
    text = CATALOG.get(name).file.read_text()
    for helper in re.findall(r"from \.(_\w+) import", text):
        text += (CATALOG.get(name).file.parent / f"{helper}.py").read_text()
    return text


def shader_names(name: str) -> set[str]:
    """Files a node's module and its helpers name: strings that end like a shader."""
    text = module_text(name)
    found = set(re.findall(r'"(<?[\w./]+\.(?:vert|frag|geom|comp|glsl)>?)"', text))
    cls = CATALOG.get(name).cls
    writes = any(isinstance(port, WrittenPort) for port in cls.ports().values())
    if CATALOG.get(name).is_shader or (cls.record is Node.record and writes):
        found.add(cls.shader or f"{name}.frag")
    return found


def resolved(name: str, shader: str) -> Path:
    shared = re.fullmatch(r"<(.+)>", shader)
    return SHADERS / "include" / shared[1] if shared else CATALOG.get(name).shaders / shader


@pytest.mark.parametrize("name", BUILTIN)
def test_declaration(name: str) -> None:
    node = CATALOG.get(name)
    assert declaration_mistakes(node.cls) == []
    assert node.family, "nodes lie in a family's folder"


@pytest.mark.parametrize("name", [name for name in BUILTIN if CATALOG.get(name).cls.twin])
def test_a_twin_exists_and_has_the_outputs_of_what_it_replaces(name: str) -> None:
    cls = CATALOG.get(name).cls
    twin = CATALOG.get(str(cls.twin)).cls
    assert cls.outputs().keys() <= twin.outputs().keys()


@pytest.mark.parametrize("name", BUILTIN)
def test_docs_are_sentences(name: str) -> None:
    assert list(doc_problems(CATALOG.get(name).cls)) == []


LIGHTING = {
    "forward_lighting",
    "deferred_lighting",
    "forward_multipass",
    "forward_shadow_volumes",
    "deferred_stencil_lights",
    "weighted_blended",
    "depth_peeling",
    "deferred_multisampled",
}
"""Lighting nodes: their programs are the longest of those that draw, so their variants are compiled at night."""


LONG = {"path_traced", "traced_reflections", "traced_interreflection", "traced_occlusion_and_light"}
"""Nodes whose programs trace paths: compiling one takes half a second, so their variants are compiled at night."""


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in BUILTIN if name not in LIGHTING | LONG])
def test_every_variant_compiles_and_the_default_passes_check_node(name: str) -> None:
    """Uniforms as declared, everything written, nothing else touched or left behind."""
    assert examine(CATALOG.get(name), renders=lambda variant: not variant.name).mistakes == ()


@pytest.mark.nightly
@pytest.mark.parametrize("name", BUILTIN)
def test_every_variant_passes_check_node(name: str) -> None:
    assert examine(CATALOG.get(name)).mistakes == ()


@pytest.mark.parametrize("name", BUILTIN)
def test_shaders_exist_and_their_includes_resolve(name: str) -> None:
    for shader in shader_names(name):
        file = resolved(name, shader)
        assert Includes(SHADERS / "include").expand(file, root=file.parent).lines


def open_parameters() -> set[tuple[str, str, str]]:
    """Node, parameter and the name under which plugins add choices to it."""
    nodes = [(name, CATALOG.get(name).cls.parameters()) for name in BUILTIN]
    return {(name, word, kind) for name, found in nodes for word in found if (kind := found[word].open_name)}


def test_a_choice_that_plugins_add_to_is_an_include_each() -> None:
    for name, word, kind in open_parameters():
        parameter = CATALOG.get(name).cls.parameters()[word]
        files = {path.stem: path for path in (SHADERS / "include" / kind).iterdir()}
        assert files.keys() == set(parameter.words), (name, word)
        for choice, file in files.items():
            assert set(needs(file)) <= set(parameter.needs), (name, word, choice)


def test_a_g_buffer_is_read_as_it_is_drawn() -> None:
    """Every texture of the one list is a port at both ends, and nothing else is but movement, which nobody lights."""
    drawn, read = CATALOG.get("gbuffer").cls, CATALOG.get("deferred_lighting").cls
    surfaces = {name: port for name, port in drawn.outputs().items() if name != "velocity"}
    assert list(read.groups()["gbuffer"]) == list(surfaces)
    for name, port in surfaces.items():
        other = read.inputs()[name]
        assert getattr(port, "semantic", None) is other.semantic, name


def test_no_shader_is_an_orphan() -> None:
    used = {resolved(name, shader).resolve() for name in BUILTIN for shader in shader_names(name)}
    used |= {path.resolve() for _, _, kind in open_parameters() for path in (SHADERS / "include" / kind).iterdir()}
    for shader in list(used):
        used |= {
            origin.file.resolve()
            for origin in Includes(SHADERS / "include").expand(shader, root=shader.parent).origins
            if origin.file is not None
        }
    others = (
        "frame.glsl",
        "view.glsl",
        "fullscreen.vert",
        "previous_scene.glsl",
        "pose.comp",
        "light_mean.frag",
        "texture.comp",
        "texture_sample.glsl",
        "shadertoy.glsl",
    )
    spare = {SHADERS / "include" / name for name in others}
    spare |= {Path(kind.shader) for kind in TEXTURES.values()}
    files = {path.resolve() for path in SHADERS.rglob("*") if path.suffix in STAGES | {".glsl"}}
    assert files - used - {path.resolve() for path in spare} == set()


def test_shaders_begin_by_saying_what_they_are() -> None:
    for path in SHADERS.rglob("*"):
        if path.suffix in STAGES | {".glsl"}:
            text = path.read_text()
            assert text.startswith("// "), path.name
            assert len(text.splitlines()) <= 160, path.name
            assert max(map(len, text.splitlines())) <= 120, path.name


def test_shipped_pipelines_begin_by_saying_what_they_show() -> None:
    for path in shipped_pipelines().values():
        assert path.read_text().startswith("# "), path.name


@pytest.mark.parametrize("name", sorted(shipped_pipelines()))
def test_the_radiance_of_a_shipped_pipeline_is_what_its_display_is_given(name: str) -> None:
    """An EXR holds all light that the picture shows: glow and transparent surfaces too."""
    graph = rg.load(name).link().graph
    assert (graph.outputs["radiance"],) == graph["display"].inputs["radiance"]
