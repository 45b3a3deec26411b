"""`rendergraph plan`: show order, lifetimes and memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json

if TYPE_CHECKING:
    from rendergraph.session import Selection


@click.command("plan", no_args_is_help=True)
@options.pipeline_options
@options.json_option
@options.alias_option
@options.heap_option
@click.option("--shuffle", type=int, metavar="SEED", help="Use another legal order.")
@click.option("--every-step", is_flag=True, help="Give each step that makes a kept value a row of its own.")
def command(
    selection: Selection, as_json: bool, no_alias: bool, heap: bool, shuffle: int | None, every_step: bool
) -> None:
    """Show order, lifetimes and memory, with reasons.

    Lists the order of the steps, how long each texture lives, which textures share memory, and the bytes. Steps that
    make values kept from frame to frame, such as tables and environment maps, share a row.

    \b
    Examples:
      rendergraph plan forward
      rendergraph plan forward-prepass --size 1920x1080 --json
    """
    from rendergraph import diagrams
    from rendergraph.session import RenderOptions, stages

    render_options = RenderOptions(alias=not no_alias, heap=heap, shuffle=shuffle)
    plan = stages.plan(stages.expand(options.link(selection), render_options)).plan
    emit_json(diagrams.plan_json(plan)) if as_json else emit(
        diagrams.plan_text(plan, every_step=every_step).rstrip("\n")
    )
