"""`explain` of names in Python and of shared includes, and that every public name is documented."""

from __future__ import annotations

from pathlib import Path

import pytest

import rendergraph as rg
from rendergraph import reference
from rendergraph.errors import InputError
from rendergraph.reference.python import public_members, public_names


@pytest.mark.parametrize("name", sorted(set(rg.__all__) - {"CacheLimits"}))
def test_every_public_name_has_a_documentation_and_so_have_its_members(name: str) -> None:
    found = reference.describe_python(name)
    assert len(found["doc"]) > 20
    assert all(member["doc"] for member in found["members"])


def test_names_of_authors_are_explained() -> None:
    steps = reference.describe_python("Steps")
    assert {"fullscreen", "compute", "geometry", "upload"} <= {one["name"] for one in steps["members"]}
    names = reference.describe_python("api")["names"]
    assert {"Node", "Input", "History", "param", "Radiance"} <= names.keys()
    includes = reference.describe_python("glsl")["includes"]
    assert any("world_position(" in line for line in includes["view.glsl"])
    assert reference.describe_python("Nothing") == {}
    assert "render" in dict(public_members(public_names()["Pipeline"]))


def test_a_mistake_in_a_notebook_is_one_message() -> None:
    with pytest.raises(InputError) as raised:
        rg.load({"extends": "forward", "nodes": {"light": {"params": {"ambiant": 1}}}}).render()
    (text,) = raised.value._render_traceback_()
    assert text == f"InputError: {raised.value}"
    assert "\n" not in text


def test_a_node_without_a_port_is_not_a_tap() -> None:
    with pytest.raises(InputError, match=r"'light' is a node, not a port; write one of .*light\.radiance"):
        rg.load("forward").expand(taps="light")


def test_what_ports_carry_is_explained() -> None:
    """Meanings of textures, and functions that shaders call."""
    assert reference.describe_python("ShadowLookup")["doc"].startswith(
        "float shadow(int light, vec3 position, vec3 normal)"
    )
    assert "near plane" in reference.describe_python("Depth")["doc"]


def test_the_output_of_the_inputs_own_name_is_offered_first(tmp_path: Path) -> None:
    """Lighting nodes declare the parts of radiance before the whole."""
    file = tmp_path / "no-link.yaml"
    nodes = "nodes:\n  light: {type: forward_lighting}\n  display: {type: tonemap}\n"
    file.write_text(f"rendergraph: 1\nscene: shapes\n{nodes}outputs: {{image: display.color}}\n")
    with pytest.raises(InputError, match=r"is not connected; 'light\.radiance' would fit"):
        rg.load(file).link()
