"""What travels in the distribution: the four folders, whole, under one import name."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Iterator
from importlib.metadata import entry_points, version
from importlib.util import find_spec
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = {  # where it lies: where it is installed
    "rendergraph": "rendergraph",
    "nodes": "rendergraph/nodes",
    "shaders": "rendergraph/shaders",
    "pipelines": "rendergraph/pipelines",
}


def files(folder: str) -> Iterator[Path]:
    """Everything in a folder but what Python leaves there."""
    return (file for file in (ROOT / folder).rglob("*") if file.is_file() and "__pycache__" not in file.parts)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built wheel; from a copy, so that nothing is left behind in the checkout."""
    if find_spec("setuptools") is None:
        pytest.skip("building without network needs setuptools beside the tests")
    if int(version("setuptools").split(".")[0]) < 77:
        pytest.skip(f"setuptools {version('setuptools')} is older than what the build asks for")
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        (source / name).write_bytes((ROOT / name).read_bytes())
    for folder in FOLDERS:
        for file in files(folder):
            copy = source / file.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(file.read_bytes())
        (source / folder / "__pycache__").mkdir()
        (source / folder / "__pycache__" / "left.cpython-311.pyc").write_bytes(b"")
    words = ["pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", str(out), str(source)]
    done = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (built,) = out.glob("*.whl")
    return built


@pytest.mark.slow
def test_the_wheel_holds_every_file(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    wanted = {
        f"{home}/{file.relative_to(ROOT / folder).as_posix()}"
        for folder, home in FOLDERS.items()
        for file in files(folder)
    }
    assert wanted >= {"rendergraph/py.typed", "rendergraph/nodes/display/tonemap.py"}
    assert names == wanted


@pytest.mark.slow
def test_the_wheel_draws(wheel: Path, tmp_path: Path) -> None:
    """Unpacked apart from the checkout, with the libraries of this environment."""
    site, here = tmp_path / "site", tmp_path / "here"
    here.mkdir()
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    libraries = PurePosixPath(Path(pytest.__file__).parents[1].as_posix())
    program = (
        "import sys, pathlib\n"
        f"sys.path[:0] = [{str(site)!r}]; sys.path.append({str(libraries)!r})\n"
        "import rendergraph; from rendergraph.cli import main\n"
        f"assert pathlib.Path(rendergraph.__file__).is_relative_to({str(site)!r}), rendergraph.__file__\n"
        "from rendergraph.catalog import Catalog\n"
        f"assert pathlib.Path(Catalog.discover().get('tonemap').file).is_relative_to({str(site)!r})\n"
        "sys.exit(main(['run', 'forward-prepass', '--size', '32x18', '-o', 'wheel.png']))\n"
    )
    words = [sys.executable, "-I", "-S", "-c", program]
    done = subprocess.run(words, cwd=here, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (here / "wheel.png").stat().st_size > 100


@pytest.mark.nightly
def test_the_wheel_in_a_bare_environment_runs_every_command_of_the_readme(wheel: Path, tmp_path: Path) -> None:
    """With what `pip install` brings and nothing else, in an empty folder, at the size that readers get."""
    bare, here = tmp_path / "bare", tmp_path / "here"
    here.mkdir()
    subprocess.run([sys.executable, "-m", "venv", str(bare)], check=True)
    install = [str(bare / "bin" / "pip"), "install", "--quiet"]
    if subprocess.run([*install, "click"], capture_output=True, check=False).returncode != 0:
        pytest.skip("no package index")
    subprocess.run([*install, str(wheel)], check=True)
    environment = {"PATH": f"{bare / 'bin'}:/usr/bin:/bin", "HOME": str(tmp_path)}
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    ran = 0
    for language, text in re.findall(r"^```(\w+)\n(.*?)^```$", readme, re.MULTILINE | re.DOTALL):
        if named := re.match(r"# ([\w.-]+\.\w+)\n", text):
            (here / named[1]).write_text(text, encoding="utf-8")
        commands = re.findall(r"^\$ (rendergraph .*)$", text, re.MULTILINE)
        words = [["sh", "-c", command] for command in commands]
        if language == "python":
            words = [[str(bare / "bin" / "python"), "-I", "-c", text]]
        for command in words:
            done = subprocess.run(command, cwd=here, env=environment, capture_output=True, text=True, check=False)
            assert done.returncode == 0, f"{command[-1]}\n{done.stderr}"
            ran += 1
    assert ran >= 9
    made = {file.name for file in here.iterdir()}
    assert made >= {"full.png", "other.png", "study.png", "hard.png", "report.html", "forward.png"}


def test_the_standard_nodes_come_by_the_entry_point() -> None:
    found = {entry.name: entry.value for entry in entry_points(group="rendergraph.nodes")}
    assert found["builtin"] == "rendergraph.nodes"


@pytest.mark.parametrize("folder", ["nodes", "shaders", "pipelines"])
def test_installed_names_lead_to_the_folders(folder: str) -> None:
    spec = find_spec(f"rendergraph.{folder}")
    assert spec is not None
    assert spec.submodule_search_locations
    place = Path(next(iter(spec.submodule_search_locations)))
    assert {file.name for file in place.iterdir()} >= {file.name for file in (ROOT / folder).glob("*/")} - {
        "__pycache__"
    }


@pytest.mark.nightly
def test_the_source_distribution_has_what_its_tests_need(tmp_path: Path) -> None:
    """All that is in the repository but its list of ignored files, and the editor's and the server's own."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode != 0:
        pytest.skip("no checkout, whose list of files is compared")
    source = tmp_path / "source"
    subprocess.run(["git", "clone", "--quiet", "--no-hardlinks", str(ROOT), str(source)], check=True)
    program = f"from setuptools import build_meta; print(build_meta.build_sdist({str(tmp_path)!r}))"
    done = subprocess.run([sys.executable, "-c", program], cwd=source, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with tarfile.open(next(tmp_path.glob("*.tar.gz"))) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    wanted = {
        name for name in listed.stdout.splitlines() if not name.startswith((".github/", ".devcontainer/", ".git"))
    }
    assert wanted - names == set()


def test_an_index_shows_the_readmes_pictures_and_links(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs")
    release = importlib.import_module("_generate.release")
    found = release.absolute(
        "[![a](docs/a.png)](docs/a.md) [b](#b) [c](https://d.e/f) `[x]`", "https://g.h/r", "v1.0.0"
    )
    expected = "[![a](https://g.h/r/raw/v1.0.0/docs/a.png)](https://g.h/r/blob/v1.0.0/docs/a.md) [b](#b) [c](https://d.e/f) `[x]`"
    assert found == expected
    readme = release.absolute((ROOT / "README.md").read_text(encoding="utf-8"), "https://g.h/r", "v1.0.0")
    assert not re.findall(r"\]\((?!https?:|#)", readme)
    project = tomllib.loads(release.with_urls((ROOT / "pyproject.toml").read_text(encoding="utf-8"), "https://g.h/r"))
    assert project["project"]["urls"]["Issues"] == "https://g.h/r/issues"


def test_versions_agree() -> None:
    assert f"\nversion: {version('rendergraph')}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    import rendergraph

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["version"] == rendergraph.__version__
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert "## Unreleased" in changelog or f"## {rendergraph.__version__}" in changelog
