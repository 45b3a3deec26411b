"""Wrong pipeline files and exactly what is said about each.

A file starts with its messages, `#: line:column: code text`, and may have settings in a line `# -s 'PATH=VALUE'`.
"""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from rendergraph.catalog import Catalog
from rendergraph.declare import LightFacts
from rendergraph.errors import Problem, RendergraphError
from rendergraph.link import link
from rendergraph.resolve import resolve

FOLDER = Path(__file__).parent / "wrong_files"
FILES = sorted(FOLDER.glob("*.yaml"))
LIGHTS = (LightFacts("key", "directional"), LightFacts("lamp", "spot"))


def problems_of(path: Path, sets: list[str], catalog: Catalog) -> tuple[Problem, ...]:
    try:
        link(resolve(path, catalog=catalog, sets=sets), catalog, LIGHTS)
    except RendergraphError as error:
        return error.problems
    return ()


def message(problem: Problem, path: Path) -> str:
    place = f"{problem.place}: " if problem.place else ""
    text = f"{place}{problem.code} {problem.message}".removeprefix(f"{path}:")
    return re.sub(r"[^\s:]*toys\.py:\d+", "toys.py:LINE", text.replace(f"{FOLDER}/", ""))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_wrong_file_gets_its_messages(path: Path, toy_catalog: Catalog) -> None:
    lines = path.read_bytes().decode("utf-8", "replace").split("\n")
    expected = [line.removeprefix("#: ") for line in lines if line.startswith("#: ")]
    sets = [word for line in lines if line.startswith("# -s ") for word in shlex.split(line[2:]) if word != "-s"]
    found = problems_of(path, sets, toy_catalog)
    assert [message(problem, path) for problem in found] == expected
    assert all("\n" not in problem.message for problem in found)


def test_there_are_many() -> None:
    assert len(FILES) >= 60


def test_every_problem_shows_its_line(toy_catalog: Catalog) -> None:
    path = FOLDER / "unknown-param.yaml"
    (problem,) = problems_of(path, [], toy_catalog)
    assert str(problem).splitlines()[1:] == [
        "      display: {type: tonemap, params: {exposur: 1}, inputs: {radiance: light.radiance}}",
        "                                        ^",
    ]
