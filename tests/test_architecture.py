"""What may import what, where import-linter cannot look: the folders beside `rendergraph/`."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NODES = sorted((ROOT / "nodes").rglob("*.py"))


@pytest.mark.parametrize("file", NODES, ids=lambda file: file.stem)
def test_nodes_import_the_api_and_each_other_and_nothing_else_of_rendergraph(file: Path) -> None:
    for statement in ast.walk(ast.parse(file.read_text())):
        if isinstance(statement, ast.ImportFrom) and statement.level == 0:
            module = statement.module or ""
            assert not module.startswith("rendergraph") or module == "rendergraph.api", (file, statement.lineno)
            assert module.split(".")[0] not in ("nodes", "moderngl", "OpenImageIO"), (file, statement.lineno)
        elif isinstance(statement, ast.Import):
            assert not any(name.name.startswith(("rendergraph", "moderngl")) for name in statement.names), file


def test_the_framework_names_no_standard_node() -> None:
    names = {file.stem for file in NODES if not file.stem.startswith("_")}
    for file in (ROOT / "rendergraph").rglob("*.py"):
        words = {node.value for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Constant)}
        assert not {word for word in words if isinstance(word, str) and word in names} - {"shadow_map"}, file


@pytest.mark.parametrize("verb", ["check", "plan", "graph"])
def test_everything_before_compile_works_without_gl(verb: str, tmp_path: Path) -> None:
    """The GL and image libraries are made unimportable, as on a machine that has none."""
    script = (
        "import sys\n"
        "for name in ('moderngl', 'glcontext', '_moderngl', 'OpenImageIO'): sys.modules[name] = None\n"
        f"sys.argv = ['rendergraph', '{verb}', 'forward']\n"
        "from rendergraph.cli import main\nmain()\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
