"""`rendergraph diff`: compare the structure of two pipelines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json


@click.command("diff", no_args_is_help=True)
@click.argument("a", shell_complete=options.offered("pipelines"))
@click.argument("b", shell_complete=options.offered("pipelines"))
@options.selection_options
@click.option(
    "--svg", type=options.NamedPath(dir_okay=False), metavar="FILE", help="Draw both graphs, differences in colour."
)
@options.json_option
def command(a: str, b: str, select: options.Select, svg: Path | None, as_json: bool) -> None:
    """Show the differences between two pipelines.

    Compares nodes, links and parameters after everything is resolved, and the plan: passes, bytes, peak. Nodes that
    differ only in their names are recognised. Needs no GPU. With unknown node types there is no plan, and the exit code
    is 3.

    \b
    Examples:
      rendergraph diff forward forward-prepass
      rendergraph diff forward my.yaml --svg difference.svg
      rendergraph diff forward forward-prepass --json
    """
    from rendergraph import diff
    from rendergraph.session import stages

    old, new = (options.sketch(select(name)) for name in (a, b))
    difference = diff.diff(old.graph, new.graph)
    missing = [problem.as_json() for problem in (*old.missing, *new.missing)]
    plans = None
    if not missing:
        was, now = (diff.figures(stages.plan(stages.expand(linked)).plan) for linked in (old, new))
        plans = was, now
    written: dict[str, Any] = {}
    if svg is not None:
        options.write(diff.diff_svg(old.graph, new.graph, difference), svg)
        written["svg"] = str(svg)
    if as_json:
        emit_json(diff.diff_json(difference, plans) | written | {"missing": missing})
    else:
        emit(written["svg"] if written else diff.diff_text(difference, plans).rstrip("\n"))
    options.exit_if_missing(old, new)
