"""`rendergraph diff`: what differs in structure."""

from __future__ import annotations

from pathlib import Path

from rendergraph.cli import options
from rendergraph.cli.output import emit, emit_json
from rendergraph.cli.words import click


@click.command("diff", no_args_is_help=True)
@click.argument("a", shell_complete=options.offered("pipelines"))
@click.argument("b", shell_complete=options.offered("pipelines"))
@options.selection_options
@click.option(
    "--svg",
    "picture",
    type=options.NamedPath(dir_okay=False),
    metavar="FILE",
    help="Draw both graphs with the difference coloured.",
)
@options.json_option
def command(a: str, b: str, select: options.Select, picture: Path | None, as_json: bool) -> None:
    """Show what differs between two pipelines.

    Nodes, links and parameters after everything is resolved, and what that does to the plan: passes, bytes, peak.
    Nodes that are equal but for their names are recognised. Needs no GPU. Where node types are missing there is no
    plan, and the exit code is 3.

    \b
    Examples:
      rendergraph diff forward forward-prepass
      rendergraph diff forward my.yaml --svg difference.svg
      rendergraph diff forward forward-prepass --json
    """
    from rendergraph import diff
    from rendergraph.session import stages

    old, new = (options.sketched(select(name)) for name in (a, b))
    difference = diff.diff(old.graph, new.graph)
    missing = (*old.missing, *new.missing)
    plans = None
    if not missing:
        was, now = (diff.figures(stages.plan(stages.expand(found)).plan) for found in (old, new))
        plans = was, now
    if picture is not None:
        options.write(diff.diff_svg(old.graph, new.graph, difference), picture)
    if as_json:
        written = {} if picture is None else {"svg": str(picture)}
        lacking = {"missing": [problem.as_json() for problem in missing]}
        emit_json(diff.diff_json(difference, plans) | written | lacking)
    elif picture is not None:
        emit(str(picture))
    else:
        emit(diff.diff_text(difference, plans).rstrip("\n"))
    options.conclude(old, new)
