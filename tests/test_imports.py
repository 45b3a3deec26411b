"""Modules import no circle, for their types neither; what is imported late says why."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import networkx as nx
import pytest

ROOT = Path(__file__).parents[1]
FILES = {
    ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): file
    for file in sorted((ROOT / "rendergraph").rglob("*.py"))
    if "templates" not in file.parts
}
LAZY = ("rendergraph.cli", "rendergraph.session")  # each verb and each stage is loaded when it is first wanted


@cache
def imports(name: str) -> list[tuple[str, int, bool]]:
    """Every module of ours and every library that a module imports, with its line and whether a function does it."""
    return list(_imports(name, ast.parse(FILES[name].read_text())))


def _imports(name: str, tree: ast.Module) -> Iterator[tuple[str, int, bool]]:
    inside = {
        id(statement)
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for statement in ast.walk(function)
    }
    for statement in ast.walk(tree):
        if isinstance(statement, ast.Import):
            for alias in statement.names:
                yield alias.name, statement.lineno, id(statement) in inside
        elif isinstance(statement, ast.ImportFrom):
            assert statement.level == 0, f"{name}:{statement.lineno}: a relative import"
            base = statement.module or ""
            for alias in statement.names:
                whole = f"{base}.{alias.name}"
                yield whole if whole in FILES else base, statement.lineno, id(statement) in inside


def circles(edges: set[tuple[str, str]]) -> list[list[str]]:
    """The modules that reach themselves, those that do together."""
    found = nx.strongly_connected_components(nx.DiGraph(edges))
    return sorted(sorted(group) for group in found if len(group) > 1 or (*group, *group) in edges)


def test_no_module_reaches_itself() -> None:
    """What functions import counts too, but for the package's own, by which its names are there when they are wanted."""
    edges = {
        (name, other)
        for name in FILES
        for other, _, within in imports(name)
        if other in FILES and not (within and name == "rendergraph")
    }
    assert len(edges) > 500
    assert circles(edges) == []


def test_a_circle_is_found() -> None:
    assert circles({("a", "b"), ("b", "c"), ("c", "b"), ("d", "d")}) == [["b", "c"], ["d"]]


@pytest.mark.parametrize("name", [name for name in FILES if not name.startswith(LAZY)])
def test_an_import_within_a_function_says_why(name: str) -> None:
    lines = FILES[name].read_text().splitlines()
    late = [line for _, line, within in imports(name) if within]
    silent = [lines[line - 1].strip() for line in late if "  # " not in lines[line - 1].replace("# type: ignore", "")]
    assert silent == []
