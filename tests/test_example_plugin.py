"""The example plugin, installed from its own pyproject into a folder apart, and its own tests run against that."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "docs" / "examples" / "rendergraph-sketch"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy, so that building leaves nothing behind in the checkout."""
    copy = tmp_path_factory.mktemp("example") / EXAMPLE.name
    shutil.copytree(EXAMPLE, copy, ignore=shutil.ignore_patterns("__pycache__", ".*", "build", "*.egg-info"))
    return copy


@pytest.fixture(scope="module")
def site(source: Path) -> Path:
    if find_spec("setuptools") is None or int(version("setuptools").split(".")[0]) < 77:
        pytest.skip("building without network needs setuptools 77 or newer beside the tests")
    target = source.parent / "site"
    words = ["pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--target", str(target)]
    done = subprocess.run([sys.executable, "-m", *words, str(source)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return target


def python(site: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Python with the installed plugin, in a folder that is neither's source."""
    path = os.pathsep.join([str(site), *filter(None, [os.environ.get("PYTHONPATH")])])
    return subprocess.run(
        [sys.executable, *words],
        cwd=site, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_everything_is_installed(source: Path, site: Path) -> None:
    for file in (source / "rendergraph_sketch").rglob("*.*"):
        assert (site / file.relative_to(source)).is_file(), file


def test_it_is_found_by_its_entry_points(site: Path) -> None:
    done = python(site, "-m", "rendergraph.cli", "nodes", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    (outline,) = [node for node in told["nodes"] if node["name"] == "outline"]
    assert Path(outline["file"]).is_relative_to(site)
    added = {(entry["kind"], entry["name"], entry["plugin"]) for entry in told["extensions"]}
    assert added >= {("shading", "toon", "rendergraph-sketch"), ("mesh loader", ".stl", "rendergraph-sketch")}


def test_its_own_tests_pass(source: Path, site: Path) -> None:
    words = [
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "-c",
        str(source / "pyproject.toml"),
        str(source / "tests"),
    ]
    done = python(site, *words)
    assert done.returncode == 0, done.stdout + done.stderr
    assert " passed" in done.stdout
