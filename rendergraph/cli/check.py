"""`rendergraph check`: validate a pipeline or a sweep file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import amount, emit_json, say, warn

if TYPE_CHECKING:
    from rendergraph.session import Selection


@click.command("check", no_args_is_help=True)
@options.pipeline_options
@options.json_option
def command(selection: Selection, as_json: bool) -> None:
    """Find every error, without a GPU.

    Checks the pipeline, everything it refers to, its scene and the options; of a sweep file, every run. Exits 0 if
    there are no errors. Otherwise exits 3 and prints each error with its line and how to fix it.

    \b
    Examples:
      rendergraph check forward
      rendergraph check forward --scene spheres -s light.ambient=0.1 --json
    """
    from rendergraph.compare.sweepfile import is_sweep
    from rendergraph.schema import outdated
    from rendergraph.session import stages
    from rendergraph.session.picture_metadata import is_picture
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
    linked = options.link(selection)
    later = list(stages.check(linked).warnings)
    graph, path = linked.graph, linked.spec.path
    if path and not is_picture(path):
        stale = outdated(path, Roots.of_file(path, selection.asset_roots), linked.catalog, selection.plugins)
        later += [stale] if stale else []
    warn(later)
    width, height = graph.size
    links = sum(len(ends) for node in graph.nodes for ends in node.inputs.values())
    say(f"{graph.name}: {len(graph.nodes)} nodes, {links} links, {width}×{height}, outputs {', '.join(graph.outputs)}")
    if as_json:
        report = {"pipeline": graph.name, "size": [width, height], "nodes": len(graph.nodes), "links": links}
        outputs = {name: str(end) for name, end in graph.outputs.items()}
        emit_json(report | {"outputs": outputs, "warnings": [one.as_json() for one in (*linked.warnings, *later)]})
