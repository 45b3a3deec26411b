"""`rendergraph plan`: order, lifetimes, memory."""

from __future__ import annotations

from typing import Any

from rendergraph.cli import options
from rendergraph.cli.output import emit, emit_json
from rendergraph.cli.words import click


@click.command("plan", no_args_is_help=True)
@options.pipeline_options
@options.json_option
@click.option("--no-alias", is_flag=True, help="Give every texture memory of its own.")
@click.option("--shuffle", type=int, metavar="SEED", help="Another legal order.")
def command(as_json: bool, no_alias: bool, shuffle: int | None, **selection: Any) -> None:
    """Show order, lifetimes and memory, with reasons.

    What runs in which order, how long each texture lives, which of them share memory, and the bytes.

    \b
    Examples:
      rendergraph plan forward
      rendergraph plan forward-prepass --size 1920x1080 --json
    """
    from rendergraph import views

    plan = options.load(**selection).plan(alias=not no_alias, shuffle=shuffle)
    if as_json:
        emit_json(views.plan_json(plan))
    else:
        emit(views.plan_text(plan).rstrip("\n"))
