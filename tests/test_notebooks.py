"""The notebooks of the documentation run from top to bottom, and what their cells end with shows itself."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "docs/notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"), key=lambda path: int(path.stem.partition("-")[0]))
RUN = """
import ast, json, pathlib, sys
for cell in json.loads(pathlib.Path(sys.argv[1]).read_text())["cells"]:
    if cell["cell_type"] == "code":
        tree = ast.parse("".join(cell["source"]))
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, "<cell>", "exec"), globals())
        if last is not None:
            shown = eval(compile(ast.Expression(last.value), "<cell>", "eval"), globals())
            made = [getattr(shown, name)() for name in ("_repr_html_", "_repr_png_") if hasattr(shown, name)]
            assert made or isinstance(shown, (tuple, list, int, type(None))) or hasattr(shown, "savefig")
"""


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("notebook", [pytest.param(path, id=path.stem) for path in NOTEBOOKS])
def test_a_notebook_runs_from_top_to_bottom(notebook: Path, tmp_path: Path) -> None:
    if "figure" in notebook.stem:
        pytest.importorskip("matplotlib")
    done = subprocess.run(
        [sys.executable, "-c", RUN, str(notebook)], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]


def test_notebooks_are_stored_without_output_and_listed() -> None:
    assert len(NOTEBOOKS) == 10
    listed = (FOLDER.parent / "guide/python.md").read_text(encoding="utf-8")
    for path in NOTEBOOKS:
        assert f"notebooks/{path.name}" in listed
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)
