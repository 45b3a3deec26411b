"""What may import what, where import-linter cannot look: the folders beside `rendergraph/`."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NODES = sorted((ROOT / "nodes").rglob("*.py"))
FRAMEWORK = sorted(file for folder in ("rendergraph", "pipelines") for file in (ROOT / folder).rglob("*.py"))


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
    """GL is made unimportable, as on a machine that has none; so is OpenImageIO, which a scene without images lacks."""
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
    """`problem.text`, `problem.message`, `place.file`, `detail["msg"]`, `str(problem)`: text beside a typed value."""
    if isinstance(node, ast.Call):
        named = isinstance(node.func, ast.Name) and node.func.id == "str" and bool(node.args)
        return named and getattr(node.args[0], "id", "") in ("problem", "mistake", "place", "origin")
    if isinstance(node, ast.Subscript):
        return isinstance(node.slice, ast.Constant) and node.slice.value == "msg"
    return isinstance(node, ast.Attribute) and node.attr in ("text", "message", "file") and _is_problem(node.value)


def _is_problem(node: ast.expr) -> bool:
    """A problem, its place or its origin, by the names they have everywhere."""
    name = node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")
    return name in ("problem", "mistake", "error", "warning", "place", "origin")


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


@pytest.mark.slow
def test_no_code_reads_a_message() -> None:
    """Whoever wants to know what a mistake is about asks its subject, its kind, its place or its code."""
    assert messages_read('if "x" in problem.text: pass\nre.match("a", mistake.text)\nstr(problem).split()') == [1, 2, 3]
    assert messages_read('error.place.file.startswith("--set ")\nplace.file == "patch"') == [1]
    files = {str(file): messages_read(file.read_text()) for file in FRAMEWORK}
    assert {file: lines for file, lines in files.items() if lines} == {}


def problems_edited(source: str) -> list[int]:
    """The lines of a module that make a message of another, or replace fields of a problem."""
    found = []
    for node in ast.walk(ast.parse(source)):
        parts: list[ast.expr] = []
        if isinstance(node, ast.JoinedStr):
            parts = [part.value for part in node.values if isinstance(part, ast.FormattedValue)]
        elif isinstance(node, ast.BinOp):
            parts = [node.left, node.right]
        elif isinstance(node, ast.Call):
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            parts = node.args if name in ("Problem", "problem") else []
            if name == "replace" and node.args and getattr(node.args[0], "id", "") in ("problem", "mistake", "warning"):
                found.append(node.lineno)
        found += [part.lineno for part in parts if _is_message(part) and getattr(part, "attr", "") != "file"]
    return found


@pytest.mark.slow
def test_a_problem_is_relocated_and_never_edited_on_its_way_up() -> None:
    """`Problem.relocate` gives it another place, a context and a hint."""
    assert problems_edited('f"in x: {problem.text}"\nproblem.message + "; or"\nreplace(problem, place=p)') == [1, 2, 3]
    files = [file for file in FRAMEWORK if file.parent.name != "errors"]
    edited = {str(file): problems_edited(file.read_text()) for file in files}
    assert {file: lines for file, lines in edited.items() if lines} == {}


def test_mitsuba_is_imported_by_its_own_programs_alone() -> None:
    """It and a software rasteriser do not get on in one process. Of `rendergraph/` import-linter says the same."""
    importers = set()
    for file in (ROOT / "pipelines").rglob("*.py"):
        for statement in ast.walk(ast.parse(file.read_text())):
            if isinstance(statement, ast.Import) and {name.name for name in statement.names} & {"mitsuba", "drjit"}:
                importers.add(file.relative_to(ROOT / "pipelines" / "references" / "mitsuba").stem)
    assert importers == {"lights", "render", "surfaces"}
