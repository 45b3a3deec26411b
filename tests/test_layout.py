"""Tests lie where the tested code does."""

from __future__ import annotations

from pathlib import Path

import pytest

TESTS = Path(__file__).parent
PACKAGE = TESTS.parent / "rendergraph"
NODES = TESTS.parent / "nodes"


def test_a_packages_tests_are_in_a_folder_of_its_name() -> None:
    packages = {file.parent.name for file in PACKAGE.glob("*/__init__.py")}
    assert {name for name in packages if not list((TESTS / name).glob("test_*.py"))} == set()


def test_tests_of_a_node_are_in_the_folder_of_its_family() -> None:
    families = {file.parent.name for file in NODES.glob("*/*.py")}
    family = {file.stem: file.parent.name for file in NODES.glob("*/*.py")}
    tests = {file.stem.removeprefix("test_"): file.parent.name for file in TESTS.glob("nodes/*/test_*.py")}
    assert set(tests.values()) <= families
    assert {stem: folder for stem, folder in tests.items() if family.get(stem, folder) != folder} == {}


def test_tests_of_a_file_run_in_one_process(request: pytest.FixtureRequest) -> None:
    if not request.config.getoption("loadgroup", False):
        pytest.skip("needs --dist loadgroup")
    assert request.node.nodeid.endswith("@test_layout")  # otherwise each process makes the fixtures of a file again
