"""The example plugin, installed from its own pyproject into a folder apart, and its own tests run against that."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from importlib.metadata import entry_points, version
from importlib.util import find_spec
from pathlib import Path

import pytest

from rendergraph.cli.app import main

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "docs" / "examples" / "rendergraph-sketch"


def test_who_lacks_it_is_told_and_still_sees_the_graph(capsys: pytest.CaptureFixture[str]) -> None:
    """A node, a shading model and a mesh are missing; what is there is drawn, and what to install is said."""
    if "rendergraph-sketch" in {entry.dist.name for entry in entry_points(group="rendergraph.nodes") if entry.dist}:
        pytest.skip("it is installed")
    code = main(["graph", str(EXAMPLE / "scenes" / "sketch.yaml")])
    out, err = capsys.readouterr()
    assert code == 3
    assert "RG130 the pipeline needs the plugin 'rendergraph-sketch', which is not installed: pip install" in err
    for said in (
        "RG102 there is no node type 'outline'",
        "RG104 'light.shading'",
        "RG303 'gear.stl' is not a mesh file",
    ):
        assert said in err
    for said in ("outline", "gbuffer", "display.color"):
        assert said in out
    assert re.search(r"← radiance +light\.radiance", out)


def test_its_folder_stands_for_it_while_it_is_written(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["check", str(EXAMPLE / "scenes" / "sketch.yaml"), "--plugin", str(EXAMPLE / "rendergraph_sketch")]
    assert main(words) == 0, capsys.readouterr().err


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
        cwd=site,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_everything_is_installed(source: Path, site: Path) -> None:
    for file in (source / "rendergraph_sketch").rglob("*.*"):
        assert (site / file.relative_to(source)).is_file(), file


@pytest.mark.slow
def test_it_is_found_by_its_entry_points(site: Path) -> None:
    done = python(site, "-m", "rendergraph", "nodes", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    (outline,) = [node for node in told["nodes"] if node["name"] == "outline"]
    assert Path(outline["file"]).is_relative_to(site)
    added = {(entry["kind"], entry["name"], entry["plugin"]) for entry in told["extensions"]}
    assert added >= {("shading", "toon", "rendergraph-sketch"), ("mesh loader", ".stl", "rendergraph-sketch")}


@pytest.mark.nightly
@pytest.mark.slow
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
