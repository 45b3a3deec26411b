"""The recipes of `docs/guide/results.md` for pandas and DuckDB, where these are installed: they are no dependencies."""

from __future__ import annotations

import importlib
import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from rendergraph.cli.app import main

PAGE = Path(__file__).parents[2] / "docs" / "guide" / "results.md"


def blocks(language: str) -> list[str]:
    found = re.findall(rf"^```{language}\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert found
    return found


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The sweep of the page, and a line that stands twice."""
    command = re.search(r"^\$ rendergraph (sweep .*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert command
    monkeypatch.chdir(tmp_path)
    assert main(command[1].split()) == 0
    file = tmp_path / "study" / "results.jsonl"
    file.write_text(file.read_text() + file.read_text().splitlines()[0] + "\n")
    return tmp_path


@pytest.mark.slow
@pytest.mark.skipif(find_spec("pandas") is None, reason="pandas is not installed")
def test_pandas_reads_both(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table, lines = blocks("py")
    found: dict[str, Any] = {}
    exec(table, found)
    kinds = {name: str(kind) for name, kind in found["table"].dtypes.items()}
    assert (kinds["shadows.taps"], kinds["flip"], kinds["repeats"], kinds["pareto"]) == (
        "int64",
        "float64",
        "int64",
        "bool",
    )
    exec(lines, found)
    assert (len(found["table"]), len(found["lines"]), len(found["settings"])) == (6, 6, 6)
    assert set(found["passes"]["node"]) == {"sun", "light", "display"}
    assert (found["lines"].set_index("name")["flip"] - found["table"].set_index("run")["flip"]).abs().max() < 1e-12
    assert "light" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.skipif(find_spec("duckdb") is None, reason="DuckDB is not installed")
def test_duckdb_reads_both(study: Path) -> None:
    duckdb: Any = importlib.import_module("duckdb")
    best, means, passes = (duckdb.sql(text).fetchall() for text in blocks("sql"))
    assert 1 <= len(best) <= 6
    assert [row[0] for row in means] == ["pbr", "phong"]
    assert {row[0] for row in passes} == {"sun", "light", "display"}
