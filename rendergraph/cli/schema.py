"""`rendergraph schema`: for editors."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from rendergraph.cli import options
from rendergraph.cli.output import warn
from rendergraph.cli.words import click


@click.command("schema")
@options.plugin_option
@click.option("-o", "--output", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE", help="Write a file.")
@options.json_option
def command(plugins: tuple[Path, ...], output: Path | None, as_json: bool) -> None:
    """Print the JSON Schema of pipeline files.

    It knows all installed nodes; editors complete and check pipelines with it. Of a type that fails it has the name
    alone, and says so.

    \b
    Examples:
      rendergraph schema -o rendergraph.schema.json
    """
    from rendergraph.catalog import Catalog
    from rendergraph.schema import schema

    catalog = Catalog.discover(plugins)
    warn(catalog.notes)
    text = json.dumps(schema(catalog), indent=2, ensure_ascii=False)
    warn([replace(problem, severity="warning") for problem in catalog.usable()[1]])
    warn(catalog.extensions.warnings)
    options.put(text, output, as_json=as_json)
