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


OUR_WORDS = {"shadow_map", "resolve", "contact_sheet"}  # a semantic, a stage and kind of step, a picture of many taps


def test_the_framework_names_no_standard_node() -> None:
    names = {file.stem for file in NODES if not file.stem.startswith("_")}
    for file in (ROOT / "rendergraph").rglob("*.py"):
        words = {node.value for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Constant)}
        assert not {word for word in words if isinstance(word, str) and word in names} - OUR_WORDS, file


@pytest.mark.parametrize("verb", ["check", *(pytest.param(verb, marks=pytest.mark.slow) for verb in ("plan", "graph"))])
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


_READS = {"startswith", "endswith", "removeprefix", "removesuffix", "partition", "rpartition", "find", "index", "split"}
_SEARCHES = {"match", "search", "fullmatch", "findall", "finditer", "sub"}


def _is_message(node: ast.expr) -> bool:
    """`problem.text`, `mistake.text`, `detail["msg"]`, `str(problem)`: what is said, where the value beside it knows."""
    if isinstance(node, ast.Call):
        named = isinstance(node.func, ast.Name) and node.func.id == "str" and bool(node.args)
        return named and isinstance(node.args[0], ast.Name) and node.args[0].id in ("problem", "mistake")
    if isinstance(node, ast.Subscript):
        return isinstance(node.slice, ast.Constant) and node.slice.value == "msg"
    holder = node.value if isinstance(node, ast.Attribute) and node.attr in ("text", "message") else None
    return isinstance(holder, ast.Name) and holder.id in ("problem", "mistake", "error")


def messages_read(source: str) -> list[int]:
    """The lines of a module that look for something in a message."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Compare) and any(isinstance(way, ast.In | ast.NotIn) for way in node.ops):
            looked = node.comparators
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in _READS:
            looked = [node.func.value]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in _SEARCHES:
            looked = list(node.args)
        elif isinstance(node, ast.Subscript):
            looked = [node.value]
        else:
            continue
        found += [node.lineno for one in looked if _is_message(one)]
    return found


def test_no_code_reads_a_message() -> None:
    """Whoever wants to know what a mistake is about asks its subject, its kind, its place or its code."""
    assert messages_read('if "x" in problem.text: pass\nre.match("a", mistake.text)\nstr(problem).split()') == [1, 2, 3]
    files = {str(file): messages_read(file.read_text()) for file in (ROOT / "rendergraph").rglob("*.py")}
    assert {file: lines for file, lines in files.items() if lines} == {}
