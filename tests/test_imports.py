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


def _imports(name: str, node: ast.AST, within: bool = False) -> Iterator[tuple[str, int, bool]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            for alias in child.names:
                yield alias.name, child.lineno, within
        elif isinstance(child, ast.ImportFrom):
            assert child.level == 0, f"{name}:{child.lineno}: a relative import"
            base = child.module or ""
            for alias in child.names:
                whole = f"{base}.{alias.name}"
                yield whole if whole in FILES else base, child.lineno, within
        elif isinstance(child, ast.stmt | ast.excepthandler | ast.match_case):  # expressions hold none
            yield from _imports(name, child, within or isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef))


def circles(edges: set[tuple[str, str]]) -> list[list[str]]:
    """The modules that reach themselves, those that do together."""
    found = nx.strongly_connected_components(nx.DiGraph(edges))
    return sorted(sorted(group) for group in found if len(group) > 1 or (*group, *group) in edges)


@pytest.mark.slow
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
