"""`rendergraph nodes`: which node types there are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rendergraph.cli import options
from rendergraph.cli.describe import describe, summary
from rendergraph.cli.output import emit, emit_json, table, warn
from rendergraph.cli.words import click
from rendergraph.errors import InputError, Problem, suggestion

if TYPE_CHECKING:
    from rendergraph.catalog import NodeType


@click.command("nodes")
@click.argument("family", required=False, shell_complete=options.offered("families"))
@options.plugin_option
@options.json_option
def command(family: str | None, plugins: tuple[Path, ...], as_json: bool) -> None:
    """List the node types, all or of one family.

    `rendergraph explain NODE` tells everything about one. What plugins add beside node types comes last: meanings,
    choices of parameters, loaders, metrics. Types of a plugin that fails are left out and told, and the exit code is 3.

    \b
    Examples:
      rendergraph nodes
      rendergraph nodes display --json
    """
    from rendergraph.catalog import Catalog

    catalog = Catalog.discover(plugins)
    warn(catalog.notes)
    families = catalog.families()
    if family is not None and family not in families:
        text = f"there is no family of nodes '{family}'{suggestion(family, filter(None, families))}"
        raise InputError(Problem("RG511", text))
    found, problems = catalog.usable(name for key, names in families.items() if family in (None, key) for name in names)
    warn(problems)
    added = catalog.extensions.listed() if family is None else []
    if family is None:
        warn(catalog.extensions.warnings)
    if as_json:
        wrong = [problem.as_json() for problem in problems]
        emit_json({"nodes": [describe(entry) for entry in found], "extensions": added, "problems": wrong})
    elif found:
        emit(_text(found))
    if added and not as_json:
        rows = [(entry["kind"], entry["name"], entry["plugin"], entry["doc"]) for entry in added]
        emit("\n" + table(rows, ("added", "name", "plugin", "")))
    if problems:
        click.get_current_context().exit(InputError.exit_code)


def _text(found: Sequence[NodeType]) -> str:
    """The types beneath their families, in columns that all families share."""
    rows = table([(f"  {entry.name}", summary(entry)) for entry in found]).splitlines()
    starts = [number for number, row in enumerate(rows) if row[2:3].strip()]
    lines: list[str] = []
    family = None
    for number, row in enumerate(rows):
        if number in starts and (entry := found[starts.index(number)]).family != family:
            family = entry.family
            lines.append(family or "of no family")
        lines.append(row)
    return "\n".join(lines)
