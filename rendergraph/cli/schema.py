"""`rendergraph schema`: JSON Schemas for editors and other programs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from rendergraph import reference
from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import warn
from rendergraph.errors import InputError, Problem, suggestion

if TYPE_CHECKING:
    from rendergraph.typecheck import Schema


_KINDS = ("pipeline", "scene", "sweep", "results", "results-csv")


@click.command("schema")
@click.argument("what", default="pipeline", metavar="[pipeline|scene|sweep|results|results-csv|FILE]")
@options.plugin_option
@click.option("-o", "--output", type=options.NamedPath(dir_okay=False), metavar="FILE", help="Write a file.")
@options.json_option
def command(what: str, plugins: tuple[Path, ...], output: Path | None, as_json: bool) -> None:
    """Print the JSON Schema of a kind of file.

    The schema of pipelines contains all installed nodes, and what shipped pipelines consist of, for files that extend
    them. FILE is a pipeline: its schema also contains what it extends and its shader files. A node type with errors is
    included by name only, with a warning. `results` describes the lines of a sweep's results.jsonl; `results-csv` is a
    Table Schema of its results.csv.

    \b
    Examples:
      rendergraph schema -o rendergraph.schema.json
      rendergraph schema scene -o scene.schema.json
      rendergraph schema results
      rendergraph schema my.yaml -o rendergraph.schema.json
    """
    if what in ("results", "results-csv"):
        from rendergraph.compare.export.table import csv_schema  # slower to import than the rest
        from rendergraph.compare.store import line_schema

        found = line_schema() if what == "results" else csv_schema()
    else:
        found = _of_pipelines(what, plugins) if what not in ("scene", "sweep") else _of_table(what)
    options.put(json.dumps(found, indent=2, ensure_ascii=False), output, as_json=as_json)


def _of_table(what: str) -> Schema:
    from rendergraph.keys import as_markdown, file_schema

    found: Schema = as_markdown(file_schema(reference.table_of(what)))
    return found


def _of_pipelines(what: str, plugins: tuple[Path, ...]) -> Schema:
    from rendergraph.catalog import Catalog
    from rendergraph.resolve import resolve
    from rendergraph.schema import base_of, schema, shipped_bases

    if what != "pipeline" and not Path(what).suffix:
        text = f"there is no schema of '{what}'{suggestion(what, _KINDS)}"
        raise InputError(Problem("RG511", text))
    catalog = Catalog.discover(plugins)
    warn(catalog.notes)
    bases = shipped_bases(catalog)
    if what != "pipeline":
        spec = resolve(Path(what), catalog=catalog)
        bases |= base_of(Path(what), spec)
        catalog = spec.catalog or catalog  # with the shader files it names
    found = schema(catalog, bases)
    warn([problem.as_warning() for problem in catalog.usable()[1]])
    warn(catalog.extensions.warnings)
    return found
