"""The page that says where the test of a thing is names all there is, and nothing that is not."""

from __future__ import annotations

import re
from pathlib import Path

TESTS = Path(__file__).parent
ROWS = [line.split("|")[1:-1] for line in (TESTS / "README.md").read_text().splitlines() if line.startswith("| ")]
PACKAGE = TESTS.parent / "rendergraph"
NODES = TESTS.parent / "nodes"


def named(column: int) -> list[str]:
    return [name for row in ROWS for name in re.findall(r"`([^`]+)`", row[column])]


def test_every_module_of_rendergraph_has_one_row() -> None:
    modules = [file.name for file in PACKAGE.glob("*.py") if file.name != "__init__.py"]
    packages = [file.parent.name for file in PACKAGE.glob("*/__init__.py")]
    assert sorted(name for name in named(0) if not name.endswith("/")) == sorted(modules + packages)


def test_every_test_has_a_row_and_every_row_a_test() -> None:
    places = [TESTS / name for name in named(2)]
    assert [place for place in places if not place.exists()] == []
    files = {file for file in TESTS.rglob("*.py") if file.name.startswith(("test_", "bench_"))}
    assert {file for file in files if not any(file.is_relative_to(place) for place in places)} == set()


def test_a_packages_tests_are_in_a_folder_of_its_name() -> None:
    packages = {file.parent.name for file in PACKAGE.glob("*/__init__.py")}
    assert {name for name in packages if not list((TESTS / name).glob("test_*.py"))} == set()


def test_tests_of_a_node_are_in_the_folder_of_its_family() -> None:
    families = {file.parent.name for file in NODES.glob("*/*.py")}
    family = {file.stem: file.parent.name for file in NODES.glob("*/*.py")}
    tests = {file.stem.removeprefix("test_"): file.parent.name for file in TESTS.glob("nodes/*/test_*.py")}
    assert set(tests.values()) <= families
    assert {stem: folder for stem, folder in tests.items() if family.get(stem, folder) != folder} == {}
