"""What comes along, each with the line that says what it shows."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rendergraph.cli.output import emit, emit_json, table
from rendergraph.resources import opening


def list_files(kind: str, files: Mapping[str, Path], hint: str, *, as_json: bool) -> None:
    """Names with the first comment of their files, and below what to do with one."""
    if as_json:
        emit_json({kind: [{"name": name, "line": opening(path), "file": str(path)} for name, path in files.items()]})
        return
    emit(table([(name, opening(path)) for name, path in files.items()]))
    emit(f"\n{hint}")
