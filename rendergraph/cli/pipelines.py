"""`rendergraph pipelines`: what is there to draw with."""

from __future__ import annotations

from rendergraph.cli import options
from rendergraph.cli.shipped import list_files
from rendergraph.cli.words import click
from rendergraph.resources import shipped_pipelines


@click.command("pipelines")
@options.json_option
def command(as_json: bool) -> None:
    """List the shipped pipelines, a line each.

    \b
    Examples:
      rendergraph pipelines
      rendergraph pipelines --json
    """
    hint = "`rendergraph run NAME` draws one, `rendergraph explain NAME` says what is in it"
    list_files("pipelines", shipped_pipelines(), hint, as_json=as_json)
