"""What is read of installed packages is what `importlib.metadata` says of them."""

from __future__ import annotations

import importlib.metadata
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from rendergraph import installed

INFO = """\
; a comment, and a group of somebody else
[console_scripts]
glow = glow.cli:main

[ rendergraph.nodes ]
# another
glow = glow.nodes
deep=glow.more : Tools.table [extra]
bare=glow.nodes [extra, other]
[other]
more = elsewhere
"""


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.syspath_prepend(str(tmp_path))
    yield tmp_path
    for name in [name for name in sys.modules if name.partition(".")[0] == "glow"]:
        del sys.modules[name]


def package(site: Path, folder: str, metadata: str = "METADATA", text: str = INFO) -> None:
    info = site / folder
    info.mkdir(parents=True)
    (info / metadata).write_text("Metadata-Version: 2.1\nName: My.Glow\nVersion: 1.2\n\nName: of the text\n")
    (info / "entry_points.txt").write_text(text)


def test_every_package_here_and_its_version() -> None:
    known = {installed.plain(found.name): found.version for found in reversed([*importlib.metadata.distributions()])}
    ours = {name: package.version for name, package in installed.packages().items()}
    assert ours == known
    assert {installed.plain(package.name) for package in installed.packages().values()} == ours.keys()


@pytest.mark.parametrize("group", ["console_scripts", "rendergraph.nodes", "pytest11"])
def test_every_entry_point_here(group: str) -> None:
    found = {(entry.name, entry.value) for entry in installed.entry_points(group)}
    assert found == {(entry.name, entry.value) for entry in importlib.metadata.entry_points(group=group)}
    assert found


@pytest.mark.parametrize(
    ("folder", "metadata"),
    [
        ("my_glow-1.2.dist-info", "METADATA"),
        ("my_glow-1.2-py3.11.egg-info", "PKG-INFO"),
        ("my_glow.egg-info", "PKG-INFO"),  # as a folder that is worked on has it
    ],
)
def test_one_that_is_written_by_hand(folder: str, metadata: str, site: Path) -> None:
    package(site, folder, metadata)
    plain, deep, bare = (
        entry for entry in installed.entry_points("rendergraph.nodes") if entry.package.name == "My.Glow"
    )
    assert [(entry.name, entry.module) for entry in (plain, deep, bare)] == [
        ("glow", "glow.nodes"),
        ("deep", "glow.more"),
        ("bare", "glow.nodes"),
    ]
    assert installed.version("my-glow") == installed.version("My_Glow") == "1.2"
    assert installed.version("no-such-package") is None


def test_an_egg(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package(site, "my_glow-1.2-py3.11.egg/EGG-INFO", "PKG-INFO")
    assert installed.version("my-glow") is None
    monkeypatch.syspath_prepend(str(site / "my_glow-1.2-py3.11.egg"))
    assert installed.versions(["My.Glow"]) == {"My.Glow": "1.2"}
    assert [entry.package.name for entry in installed.entry_points("rendergraph.nodes")][:2] == ["My.Glow", "My.Glow"]


def test_what_is_loaded(site: Path) -> None:
    package(site, "my_glow-1.2.dist-info")
    (site / "glow").mkdir()
    (site / "glow" / "__init__.py").touch()
    (site / "glow" / "more.py").write_text("class Tools:\n    table = 7\n")
    (site / "glow" / "nodes.py").write_text("")
    plain, deep, bare = (
        entry for entry in installed.entry_points("rendergraph.nodes") if entry.package.name == "My.Glow"
    )
    assert (plain.load().__name__, deep.load(), bare.load()) == ("glow.nodes", 7, plain.load())


def test_the_first_of_two_counts_and_what_cannot_be_read_says_nothing(
    site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package(site, "second/My.Glow-9.dist-info", text="[rendergraph.nodes]\nold = old\n")
    package(site, "my_glow-1.2.dist-info")
    (site / "bare-3.dist-info").mkdir()
    (site / "file-4.egg-info").touch()
    monkeypatch.setattr("sys.path", [str(site), str(site / "second"), str(site / "none")])
    assert [entry.name for entry in installed.entry_points("rendergraph.nodes")] == ["glow", "deep", "bare"]
    assert {name: package.version for name, package in installed.packages().items()} == {
        "my-glow": "1.2",
        "bare": "3",
        "file": "4",
    }
    assert installed.packages()["bare"].name == "bare"
