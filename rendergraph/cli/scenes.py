"""`rendergraph scenes`: what is there to draw."""

from __future__ import annotations

from rendergraph.cli import options
from rendergraph.cli.shipped import list_files
from rendergraph.cli.words import click
from rendergraph.resources import shipped_scenes


@click.command("scenes")
@options.json_option
def command(as_json: bool) -> None:
    """List the shipped scenes, a line each.

    \b
    Examples:
      rendergraph scenes
      rendergraph scenes --json
    """
    hint = "`rendergraph run PIPELINE --scene NAME` draws one, `rendergraph explain NAME` says what is in it"
    list_files("scenes", shipped_scenes(), hint, as_json=as_json)
