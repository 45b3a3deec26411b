"""`rendergraph graph`: draw a pipeline's graph."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit_json

if TYPE_CHECKING:
    from rendergraph.session import Selection

_FORMATS = {".txt": "text", ".dot": "dot", ".gv": "dot", ".mmd": "mermaid", ".svg": "svg"}


@click.command("graph", no_args_is_help=True)
@options.pipeline_options
@click.option(
    "-f",
    "--format",
    "format_name",
    type=click.Choice(["text", "dot", "mermaid", "svg"]),
    help="Format; by default that of the file's extension, else text.",
)
@click.option("-o", "--output", type=options.NamedPath(dir_okay=False), metavar="FILE", help="Write a file.")
@options.json_option
def command(selection: Selection, format_name: str | None, output: Path | None, as_json: bool) -> None:
    """Draw the graph as text, DOT, Mermaid or SVG.

    Nodes of unknown types are marked as such; the exit code is then 3.

    \b
    Examples:
      rendergraph graph forward
      rendergraph graph forward --format mermaid
      rendergraph graph forward-prepass -o graph.svg
    """
    from rendergraph import diagrams

    sketch = options.sketch(selection)
    if as_json and not output:
        missing = [problem.as_json() for problem in sketch.missing]
        emit_json(diagrams.graph_json(sketch.graph) | {"missing": missing})
    else:
        default = _FORMATS.get(output.suffix.lower(), "text") if output else "text"
        text: str = getattr(diagrams, format_name or default)(sketch.graph)
        options.put(text, output, as_json=as_json)
    options.exit_if_missing(sketch)
