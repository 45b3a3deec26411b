"""`rendergraph plan`: order, lifetimes, memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rendergraph.cli import options
from rendergraph.cli.output import emit, emit_json, warn
from rendergraph.cli.words import click

if TYPE_CHECKING:
    from rendergraph.session import Selection


@click.command("plan", no_args_is_help=True)
@options.pipeline_options
@options.json_option
@click.option("--no-alias", is_flag=True, help="Give every texture memory of its own.")
@options.heap_option
@click.option("--shuffle", type=int, metavar="SEED", help="Another legal order.")
def command(selection: Selection, as_json: bool, no_alias: bool, heap: bool, shuffle: int | None) -> None:
    """Show order, lifetimes and memory, with reasons.

    What runs in which order, how long each texture lives, which of them share memory, and the bytes.

    \b
    Examples:
      rendergraph plan forward
      rendergraph plan forward-prepass --size 1920x1080 --json
    """
    from rendergraph import diagrams
    from rendergraph.session import RenderOptions, stages

    linked = stages.link(stages.resolve(selection))
    warn(linked.warnings)
    plan = stages.plan(stages.expand(linked, RenderOptions(alias=not no_alias, heap=heap, shuffle=shuffle))).plan
    if as_json:
        emit_json(diagrams.plan_json(plan))
    else:
        emit(diagrams.plan_text(plan).rstrip("\n"))
