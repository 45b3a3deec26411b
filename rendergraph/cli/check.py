"""`rendergraph check`: is it right?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from rendergraph.cli import options
from rendergraph.cli.output import amount, emit_json, say, warn
from rendergraph.cli.words import click

if TYPE_CHECKING:
    from rendergraph.session import Selection


@click.command("check", no_args_is_help=True)
@options.pipeline_options
@options.json_option
def command(selection: Selection, as_json: bool) -> None:
    """Find every mistake, without a GPU.

    Looks at the pipeline, everything it refers to, its scene and the options; given a sweep's file, at every run. Exits
    0 where all is well; exits 3 with every mistake, its line and the way out where not.

    \b
    Examples:
      rendergraph check forward
      rendergraph check forward --scene spheres -s light.ambient=0.1 --json
    """
    from rendergraph.compare.sweepfile import is_sweep
    from rendergraph.schema import outdated
    from rendergraph.session import stages
    from rendergraph.session.made import is_picture
    from rendergraph.settings import Roots

    if is_sweep(Path(selection.source)):
        from rendergraph.cli.sweep import check_file

        file = selection.source
        runs, warnings = check_file(Path(file), lambda name: replace(selection, source=name))
        warn(warnings)
        say(f"{file}: a sweep of {amount(runs, 'run')}")
        if as_json:
            emit_json({"sweep": file, "runs": runs, "warnings": [problem.as_json() for problem in warnings]})
        return
    linked = stages.link(stages.resolve(selection))
    warn(linked.warnings)
    stages.check(linked)
    graph, path = linked.graph, linked.spec.path
    stale = (
        path
        and not is_picture(path)
        and outdated(path, Roots.around(path, selection.asset_roots), linked.catalog, selection.plugins)
    )
    later = [stale] if stale else []
    warn(later)
    width, height = graph.size
    links = sum(len(ends) for node in graph.nodes for ends in node.inputs.values())
    say(f"{graph.name}: {len(graph.nodes)} nodes, {links} links, {width}×{height}, outputs {', '.join(graph.outputs)}")
    if as_json:
        emit_json(
            {
                "pipeline": graph.name,
                "size": [width, height],
                "nodes": len(graph.nodes),
                "links": links,
                "outputs": {name: str(end) for name, end in graph.outputs.items()},
                "warnings": [problem.as_json() for problem in [*linked.warnings, *later]],
            }
        )
