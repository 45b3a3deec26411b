"""`rendergraph nodes`: which node types there are."""

from __future__ import annotations

from pathlib import Path

from rendergraph.cli import options
from rendergraph.cli.describe import describe, summary
from rendergraph.cli.output import emit, emit_json, table, warn
from rendergraph.cli.words import click
from rendergraph.errors import InputError, Problem, suggestion


@click.command("nodes")
@click.argument("family", required=False)
@options.plugin_option
@options.json_option
def command(family: str | None, plugins: tuple[Path, ...], as_json: bool) -> None:
    """List the node types, all or of one family.

    `rendergraph explain NODE` tells everything about one. What plugins add beside node types comes last: meanings,
    choices of parameters, loaders, metrics.

    \b
    Examples:
      rendergraph nodes
      rendergraph nodes display --json
    """
    from rendergraph.catalog import Catalog

    catalog = Catalog.discover(plugins)
    families = catalog.families()
    if family is not None and family not in families:
        text = f"there is no family of nodes '{family}'{suggestion(family, families)}"
        raise InputError(Problem("RG511", text))
    found = [catalog.get(name) for key, names in families.items() if family in (None, key) for name in names]
    added = catalog.extensions.listed() if family is None else []
    if family is None:
        warn(catalog.extensions.warnings)
    if as_json:
        emit_json({"nodes": [describe(entry) for entry in found], "extensions": added})
        return
    if found:
        emit(
            table([(entry.family, entry.name, summary(entry)) for entry in found], ("family", "type", "what it makes"))
        )
    if added:
        rows = [(entry["kind"], entry["name"], entry["plugin"], entry["doc"]) for entry in added]
        emit("\n" + table(rows, ("added", "name", "plugin", "")))
