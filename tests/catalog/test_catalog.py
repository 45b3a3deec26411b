"""Finding node types."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

import rendergraph.catalog
from rendergraph.api import Node, Output, Radiance
from rendergraph.catalog import Catalog
from rendergraph.errors import InputError

GOOD = '''
"""A node."""
from rendergraph.api import Node, Output, Radiance
from ._shared import SIZE


class Good(Node):
    """A good node."""

    radiance = Output(Radiance, size=SIZE, doc="Light.")
'''


@pytest.fixture
def plugin(tmp_path: Path) -> Path:
    folder = tmp_path / "plugin"
    for name, text in {
        "lights/good.py": GOOD,
        "lights/_shared.py": "SIZE = 0.5\n",
        "_hidden/secret.py": "raise SystemExit\n",
        "deep/er/deeper.py": GOOD.replace("from ._shared import SIZE", "SIZE = 1.0"),
        "notes.txt": "",
        "bad-name/odd.py": "",
    }.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def test_a_folder_of_nodes_is_listed_without_importing(plugin: Path) -> None:
    before = set(sys.modules)
    catalog = Catalog.discover([plugin], installed=False)
    assert catalog.names() == ["deeper", "good"]
    assert catalog.families() == {"deep/er": ["deeper"], "lights": ["good"]}
    assert "good" in catalog
    assert not any(name.endswith("good") for name in set(sys.modules) - before)


def test_a_type_knows_its_place(plugin: Path) -> None:
    found = Catalog.discover([plugin], installed=False).get("good")
    assert (found.name, found.family, found.cls.__name__, found.plugin) == ("good", "lights", "Good", "plugin")
    assert found.file == plugin / "lights" / "good.py"
    assert found.shaders == plugin / "lights"


def test_shaders_lie_beside_the_nodes_folder(plugin: Path, tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    (whole / "shaders" / "lights").mkdir(parents=True)
    plugin.rename(whole / "nodes")
    found = Catalog.discover([whole], installed=False).get("good")
    assert found.shaders == whole / "shaders" / "lights"
    assert found.family == "lights"


def test_a_shader_with_a_header_there_is_a_type(plugin: Path, tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    (whole / "shaders" / "sky").mkdir(parents=True)
    plugin.rename(whole / "nodes")
    text = "out vec4 color;\nvoid main() { color = vec4(1.0); }\n"
    (whole / "shaders" / "sky" / "part.frag").write_text(text)
    (whole / "shaders" / "sky" / "haze.frag").write_text("/*---\ndoc: Haze.\n---*/\n" + text)
    catalog = Catalog.discover([whole], installed=False)
    assert "part" not in catalog
    found = catalog.get("haze")
    assert (found.family, found.is_shader, found.plugin) == ("sky", True, "whole")


def test_one_file(plugin: Path) -> None:
    catalog = Catalog.discover([plugin / "deep" / "er" / "deeper.py"], installed=False)
    assert catalog.names() == ["deeper"]
    assert catalog.get("deeper").shaders == plugin / "deep" / "er"


def test_unknown_names_and_paths(plugin: Path) -> None:
    catalog = Catalog.discover([plugin], installed=False)
    with pytest.raises(InputError, match=r"RG102 there is no node type 'goood'; did you mean 'good'\?"):
        catalog.get("goood")
    with pytest.raises(InputError, match="RG011 there is no plugin"):
        Catalog.discover([plugin / "nowhere"], installed=False)


@pytest.mark.parametrize("name", ["notes.txt", "tone.vert", "my.node.py", "pipe.py"])
def test_files_that_are_no_plugins(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name) if name == "pipe.py" else (tmp_path / name).touch()
    with pytest.raises(InputError, match=r"RG011 there is no plugin in '.*'; use a folder, a Python module"):
        Catalog.discover([tmp_path / name], installed=False)


def test_tests_beside_nodes_are_no_nodes(tmp_path: Path) -> None:
    for name in ("good", "test_good", "conftest", "contest"):
        (tmp_path / f"{name}.py").write_text(GOOD)
    assert Catalog.discover([tmp_path], installed=False).names() == ["contest", "good"]


def test_two_of_one_name(plugin: Path, tmp_path: Path) -> None:
    (tmp_path / "good.py").write_text(GOOD)
    catalog = Catalog.discover([plugin, tmp_path / "good.py"], installed=False)
    with pytest.raises(InputError, match=r"RG493 node type 'good' comes from 'plugin' .* and 'good' .*; rename one"):
        catalog.get("good")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\nraise RuntimeError('not\\ntoday')\n", r"odd.py:2:1: RG491 .* imported: RuntimeError: not today"),
        ("def f(:\n", r"odd.py:1:1: RG491 node type 'odd' cannot be imported: SyntaxError"),
        ("import nonexistent_module\n", r"odd.py:1:1: RG491 .*ModuleNotFoundError"),
        ("x = 1\n", r"odd.py: RG492 the module of node type 'odd' must define one Node class; it has none"),
        (
            GOOD.replace("._shared import SIZE", "math import pi as SIZE") + "\nclass Other(Good):\n    '''More.'''\n",
            r"odd.py: RG492 .* it has Good, Other",
        ),
        (
            GOOD.replace("._shared import SIZE", "math import pi as SIZE").replace("radiance =", "filter ="),
            r"odd.py:\d+:5: RG490 node type 'odd': 'filter' is reserved",
        ),
        (
            "from rendergraph.api import Node\n\nclass Odd(Node):\n    '''Odd.'''\n\n    ports = 3\n",
            r"odd.py:6:5: RG490 node type 'odd': 'ports' is reserved by the node's base class; choose another name",
        ),
        (
            "from rendergraph.api import Node\n\nclass Odd(Node):\n    '''Odd.'''\n",
            r"odd.py:3:1: RG490 node type 'odd': the class has no ports; add an output",
        ),
    ],
)
def test_a_wrong_module_is_told_with_its_file(tmp_path: Path, text: str, message: str) -> None:
    folder = tmp_path / "wrong"
    folder.mkdir()
    (folder / "odd.py").write_text(text)
    with pytest.raises(InputError, match=message):
        Catalog.discover([folder], installed=False).get("odd")


def test_bases_do_not_count(tmp_path: Path) -> None:
    text = GOOD.replace("._shared import SIZE", "math import pi as SIZE").replace("class Good(", "class _Base(")
    (tmp_path / "made.py").write_text(text + "\nclass Made(_Base):\n    '''Made.'''\n")
    assert Catalog.discover([tmp_path], installed=False).get("made").cls.__name__ == "Made"


def test_installed_packages_come_by_entry_point(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "someones_plugin"
    for folder in ("nodes/sky", "shaders/sky"):
        (package / folder).mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "nodes" / "__init__.py").write_text("raise RuntimeError('imported too early')\n")
    (package / "nodes" / "sky" / "clouds.py").write_text(GOOD.replace("._shared import SIZE", "math import pi as SIZE"))
    info = tmp_path / "someones_plugin-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: someones-plugin\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[rendergraph.nodes]\nsomeones = someones_plugin.nodes\ngone = no_such_package.nodes\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    catalog = Catalog.discover()
    assert "clouds" in catalog
    assert "tonemap" in catalog
    (package / "nodes" / "__init__.py").write_text("")
    found = catalog.get("clouds")
    assert found.shaders == package / "shaders" / "sky"
    assert (found.plugin, found.family) == ("someones", "sky")


def test_the_folder_of_a_project_stands_in_for_an_installed_copy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed = tmp_path / "site"
    for root in (installed / "my_clouds", tmp_path / "project"):
        (root / "nodes").mkdir(parents=True)
        (root / "__init__.py").touch()
        (root / "nodes" / "__init__.py").touch()
        (root / "nodes" / "clouds.py").write_text(GOOD.replace("._shared import SIZE", "math import pi as SIZE"))
    info = installed / "my_clouds-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: My.Clouds\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[rendergraph.nodes]\nclouds = my_clouds.nodes\n"
        "[rendergraph.extensions]\nclouds = my_clouds.no_such_module:EXTENSION\n"
    )
    monkeypatch.syspath_prepend(str(installed))
    project = tmp_path / "project"
    toml = project / "pyproject.toml"
    for name in ("another", "rendergraph", 3):
        toml.write_text(f"[project]\nname = {name!r}\n")
        with pytest.raises(InputError, match="RG493"):
            Catalog.discover([project]).get("clouds")
    toml.write_text('[project]\nname = "my-clouds"\n')
    catalog = Catalog.discover([project])
    assert catalog.get("clouds").file == project / "nodes" / "clouds.py"
    assert "tonemap" in catalog
    assert not catalog.extensions.problems
    assert Catalog.discover([project / "nodes"]).names() == Catalog.discover().names()


def test_the_standard_nodes_come_the_same_way() -> None:
    catalog = Catalog.discover()
    found = catalog.get("tonemap")
    assert found.plugin == "builtin"
    assert (found.shaders / "tonemap.frag").is_file()
    assert found.cls.__module__ == "rendergraph.nodes.display.tonemap"


def test_classes_at_hand(toy_catalog: Catalog) -> None:
    assert toy_catalog.get("shadow_pcf").cls.__name__ == "ShadowPcf"
    assert toy_catalog.get("shadow_map").cls.__name__ == "LightDepth"
    assert toy_catalog.get("tonemap").file.name == "toys.py"
    assert rendergraph.catalog.GROUP == "rendergraph.nodes"


def test_text_with_a_comma_within_braces_is_told_from_a_key(tmp_path: Path) -> None:
    file = tmp_path / "dim.frag"
    outputs = "outputs: {dimmed: {doc: The same, but darker.}}"
    file.write_text(f"/*---\n{outputs}\n---*/\nout vec4 dimmed;\nvoid main() {{ dimmed = vec4(0.0); }}\n")
    with pytest.raises(
        InputError, match=r"dim\.frag:2:35: RG440 'but darker.' is read as a key; put text with a comma"
    ):
        Catalog.discover([file], installed=False).get("dim")


def test_a_class_that_is_defined_again_replaces_the_loaded_one() -> None:
    def cell(text: str) -> type[Node]:
        class Flat(Node):
            __doc__ = text
            values = Output(Radiance, doc="The value.")

        return Flat

    before, after = cell("One."), cell("Two.")
    catalog = Catalog({}).with_classes({"flat": before})
    loaded = catalog.get("flat")
    assert loaded.cls is before
    assert catalog.with_classes({"flat": before}).get("flat") is loaded
    assert catalog.with_classes({"flat": after}).get("flat").cls is after
