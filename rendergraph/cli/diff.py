"""`rendergraph diff`: what differs in structure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rendergraph.cli import options
from rendergraph.cli.output import emit, emit_json
from rendergraph.cli.words import click


@click.command("diff", no_args_is_help=True)
@click.argument("a")
@click.argument("b")
@options.selection_options
@click.option(
    "--svg",
    "picture",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Draw both graphs with the difference coloured.",
)
@options.json_option
def command(a: str, b: str, picture: Path | None, as_json: bool, **selection: Any) -> None:
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

    (old, was), (new, now) = (options.sketched(pipeline=name, **selection) for name in (a, b))
    difference = diff.diff(was, now)
    missing = [problem for pipeline in (old, new) for problem in pipeline.sketch[1]]
    plans = None if missing else (diff.figures(old.plan()), diff.figures(new.plan()))
    if picture is not None:
        options.write(diff.diff_svg(was, now, difference), picture)
    if as_json:
        written = {} if picture is None else {"svg": str(picture)}
        lacking = {"missing": [problem.as_json() for problem in missing]}
        emit_json(diff.diff_json(difference, plans) | written | lacking)
    elif picture is not None:
        emit(str(picture))
    else:
        emit(diff.diff_text(difference, plans).rstrip("\n"))
    options.conclude(old, new)
