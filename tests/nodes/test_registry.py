"""What holds for every node, before its author has written a test."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rendergraph.catalog import Catalog
from rendergraph.declare import Function, Input, Made, Node, Views, declaration_mistakes
from rendergraph.glsl import expand, interface
from rendergraph.resources import folder, shipped_pipelines

CATALOG = Catalog.discover()
BUILTIN = sorted(path.stem for path in folder("rendergraph.nodes").rglob("*.py") if not path.stem.startswith("_"))
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
    if cls.record is Node.record:
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


@pytest.mark.parametrize("name", BUILTIN)
def test_docs_are_sentences(name: str) -> None:
    cls = CATALOG.get(name).cls
    summary = (cls.__doc__ or "").strip().splitlines()[0]
    assert summary.endswith("."), summary
    for port_name, port in cls.ports().items():
        if isinstance(port, Input | Made | Function | Views) and port.doc:
            assert port.doc.endswith("."), f"{port_name}: {port.doc}"
            assert len(port.doc) < 120, port_name
    for parameter, info in cls.parameters().items():
        assert (info.description or "").endswith("."), parameter


@pytest.mark.parametrize("name", BUILTIN)
def test_shaders_exist_and_their_includes_resolve(name: str) -> None:
    for shader in shader_names(name):
        file = resolved(name, shader)
        assert expand(file, SHADERS / "include", root=file.parent).lines


@pytest.mark.parametrize("name", BUILTIN)
def test_what_its_shaders_declare_is_declared_by_the_node(name: str) -> None:
    """Uniforms of a node's own shaders are its ports, its parameters, what its steps bind, or the framework's."""
    cls = CATALOG.get(name).cls
    framework = {"view_index", *re.findall(r"\b(\w+)=", module_text(name))}
    for shader in shader_names(name):
        if shader.startswith("<"):
            continue
        file = resolved(name, shader)
        names = set(interface(expand(file, SHADERS / "include", root=file.parent).text).uniforms)
        materials = {uniform for uniform in names if uniform.endswith("_texture")}
        assert names - materials - framework <= set(cls.ports()) | set(cls.parameters()), shader


@pytest.mark.parametrize("name", BUILTIN)
def test_every_uniform_parameter_stands_in_a_shader(name: str) -> None:
    cls = CATALOG.get(name).cls
    texts = ""
    for shader in shader_names(name):
        file = resolved(name, shader)
        texts += expand(file, SHADERS / "include", root=file.parent).text
    for parameter in cls.parameters():
        role = cls.role_of(parameter)
        word = parameter if role == "param" else parameter.upper()
        if role != "structural":
            assert re.search(rf"\b{word}(_\w+)?\b", texts), f"no shader looks at '{parameter}'"


def test_no_shader_is_an_orphan() -> None:
    used = {resolved(name, shader).resolve() for name in BUILTIN for shader in shader_names(name)}
    for shader in list(used):
        used |= {
            origin.file.resolve()
            for origin in expand(shader, SHADERS / "include", root=shader.parent).origins
            if origin.file is not None
        }
    spare = {SHADERS / "include" / name for name in ("frame.glsl", "view.glsl", "fullscreen.vert")}
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
