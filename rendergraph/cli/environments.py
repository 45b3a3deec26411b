"""`rendergraph environments`: what can be around a scene."""

from __future__ import annotations

from rendergraph.cli import options
from rendergraph.cli.output import emit, emit_json, table
from rendergraph.cli.words import click


@click.command("environments")
@options.json_option
def command(as_json: bool) -> None:
    """List the shipped environments, a line each.

    \b
    Examples:
      rendergraph environments
      rendergraph environments --json
    """
    from rendergraph.scene.environments import SHIPPED

    if as_json:
        emit_json({"environments": [{"name": name, "line": line} for name, line in SHIPPED.items()]})
        return
    emit(table(list(SHIPPED.items())))
    emit("\n`rendergraph run PIPELINE --environment NAME` lights by one; a scene file says environment: {file: NAME}")
