"""`rendergraph check`: is it right?"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rendergraph.cli import options
from rendergraph.cli.output import amount, emit_json, say, warn
from rendergraph.cli.words import click


@click.command("check", no_args_is_help=True)
@options.pipeline_options
@options.json_option
def command(as_json: bool, **selection: Any) -> None:
    """Find every mistake, without a GPU.

    Looks at the pipeline, everything it refers to, its scene and the options; given a sweep's file, at every run. Exits
    0 where all is well; exits 3 with every mistake, its line and the way out where not.

    \b
    Examples:
      rendergraph check forward
      rendergraph check forward --scene spheres -s light.ambient=0.1 --json
    """
    from rendergraph.compare.axes import is_sweep
    from rendergraph.schema import outdated
    from rendergraph.settings import Roots

    if is_sweep(Path(selection["pipeline"])):
        from rendergraph.cli.sweep import check_file

        file = selection.pop("pipeline")
        runs, warnings = check_file(Path(file), selection)
        warn(warnings)
        say(f"{file}: a sweep of {amount(runs, 'run')}")
        if as_json:
            emit_json({"sweep": file, "runs": runs, "warnings": [problem.as_json() for problem in warnings]})
        return
    pipeline = options.load(**selection)
    graph = pipeline.check()
    said = {str(problem) for problem in pipeline.warnings}
    later = [problem for problem in graph.warnings if str(problem) not in said]
    file = pipeline.spec.path
    stale = file and outdated(file, Roots.around(file, pipeline.asset_roots), pipeline.catalog, pipeline.plugins)
    later += [stale] if stale else []
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
                "warnings": [problem.as_json() for problem in [*pipeline.warnings, *later]],
            }
        )
