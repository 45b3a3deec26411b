"""Run the tests of the nodes, and write the page that says how near each comes to what it allows: `docs/proofs.md`.

`make proofs` calls this. Only differences that `numpy.testing` compares are
measured. Tests that need the reference data beside the project are skipped without it.
"""

from __future__ import annotations

import ast
import datetime
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.catalog import Catalog

ROOT = Path(__file__).parents[1]
CATALOG = Catalog.discover()
COLUMNS = ("technique", "compared with", "nearest difference", "values", "tests", "test")
ROW = "| {} | {} | {} | {} | {} | {} |"
HEAD = """# How we know it is right

Every node is tested against something that does not share its code: a closed form, NumPy in float64, rays, path
tracing, a published value, or the same picture by another way. Each row says what a technique is compared with, and the
difference that came nearest to what its test allows.

Measured on {date} with {device} by `make proofs`.
Only differences of arrays are measured: where there is none, the test holds closed forms with limits of its own.
Techniques that share a test share its row of numbers.
[How wrong is each technique?](gallery/how-wrong.md) has the error of each approximation against its exact twin, and
[compare](guide/compare.md) measures any pipeline of yours."""


class Recorder:
    """What each test file compared: number of tests and comparisons, and the difference that is nearest its limit."""

    def __init__(self) -> None:
        self.files: dict[str, dict[str, Any]] = {}
        self._now = self._file("")
        self._allclose, self._equal = np.testing.assert_allclose, np.testing.assert_array_equal

    def _file(self, name: str) -> dict[str, Any]:
        return self.files.setdefault(name, {"tests": 0, "compared": 0, "exact": 0, "nearest": None})

    def record_close(self, actual: Any, desired: Any, rtol: float = 1e-7, atol: float = 0, **options: Any) -> None:
        """Do what `assert_allclose` does, and record the difference that is nearest its limit."""
        self._allclose(actual, desired, rtol=rtol, atol=atol, **options)
        found, wanted = (np.asarray(each, np.float64) for each in np.broadcast_arrays(actual, desired))
        allowed = atol + rtol * np.abs(wanted)
        valid = np.isfinite(found) & np.isfinite(wanted) & (allowed > 0)
        self._now["compared"] += int(found.size)
        if not valid.any():
            return
        error, limit = np.abs(found - wanted)[valid], allowed[valid]
        at = int(np.argmax(error / limit))
        before = self._now["nearest"]
        if before is None or error[at] / limit[at] > before[0] / before[1]:
            self._now["nearest"] = [float(error[at]), float(limit[at])]

    def record_equal(self, actual: Any, desired: Any, *rest: Any, **options: Any) -> None:
        """Do what `assert_array_equal` does, and count the values."""
        self._equal(actual, desired, *rest, **options)
        self._now["exact"] += int(np.size(actual))

    def pytest_runtest_call(self, item: pytest.Item) -> None:
        """Record what follows for the file of this test."""
        self._now = self._file(item.path.relative_to(ROOT).as_posix())

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count tests that passed."""
        if report.when == "call" and report.passed:
            self._file(report.nodeid.partition("::")[0])["tests"] += 1


def page(report: dict[str, Any]) -> str:
    """Return the page of what was measured."""
    files: dict[str, dict[str, Any]] = report["files"]
    texts = {name: (ROOT / name).read_text(encoding="utf-8") for name in files}
    parts = [HEAD.format(**report)]
    for family, names in sorted(CATALOG.families().items()):
        parts += [
            f"## {(family or 'others').capitalize()}",
            ROW.format(*COLUMNS) + "\n" + ROW.format(*["---"] * len(COLUMNS)),
        ]
        for name in names:
            found = CATALOG.get(name)
            file = test_of(name, texts)
            facts, near = files[file], files[file]["nearest"]
            parts[-1] += "\n" + ROW.format(
                f"[`{name}`](../{Path(found.file).relative_to(ROOT).as_posix()})",
                (ast.get_docstring(ast.parse(texts[file])) or "").partition("\n")[0],
                "" if near is None else f"{near[0]:.1e} of {near[1]:.1e}",
                f"{facts['compared'] + facts['exact']:,}",
                facts["tests"],
                f"[{Path(file).name}](../{file})",
            )
    return "\n\n".join(parts) + "\n"


def test_of(name: str, texts: dict[str, str]) -> str:
    """Return the file that tests a node type: the one with its name or the first part of it, or that names it most."""
    stems = {Path(file).stem.removeprefix("test_"): file for file in texts if "registry" not in file}
    if shared := [stem for stem in stems if name == stem or name.startswith(f"{stem}_")]:
        return stems[max(shared, key=len)]
    word = re.compile(rf"\b{name.replace('_', '[-_]')}\b")
    return max(stems.values(), key=lambda file: len(word.findall(texts[file])))


def main() -> int:
    """Measure, write the page, and return the exit code of the tests."""
    recorder = Recorder()
    np.testing.assert_allclose = recorder.record_close  # type: ignore[assignment]
    np.testing.assert_array_equal = recorder.record_equal
    code = pytest.main(["-q", "-p", "no:cacheprovider", str(ROOT / "tests" / "nodes")], plugins=[recorder])
    with rg.Session() as session:
        device = session.device.renderer
    found = {name: facts for name, facts in sorted(recorder.files.items()) if facts["tests"]}
    report = {"date": datetime.date.today().isoformat(), "device": device, "files": found}
    (ROOT / "docs" / "proofs.md").write_text(page(report), encoding="utf-8")
    return int(code)


if __name__ == "__main__":
    sys.exit(main())
