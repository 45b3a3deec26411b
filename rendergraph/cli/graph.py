"""`rendergraph graph`: what is connected to what."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rendergraph.cli import options
from rendergraph.cli.output import emit_json
from rendergraph.cli.words import click

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
    help="What to draw it as; by default what the file's extension says, else text.",
)
@click.option("-o", "--output", type=options.NamedPath(dir_okay=False), metavar="FILE", help="Write a file.")
@options.json_option
def command(selection: Selection, format_name: str | None, output: Path | None, as_json: bool) -> None:
    """Draw the graph as text, DOT, Mermaid or SVG.

    Nodes whose type is missing are drawn as such; the exit code is then 3.

    \b
    Examples:
      rendergraph graph forward
      rendergraph graph forward --format mermaid
      rendergraph graph forward-prepass -o graph.svg
    """
    from rendergraph import diagrams

    sketch = options.sketched(selection)
    if as_json and not output:
        missing = [problem.as_json() for problem in sketch.missing]
        emit_json(diagrams.graph_json(sketch.graph) | {"missing": missing})
        options.conclude(sketch)
        return
    chosen = format_name or (_FORMATS.get(output.suffix.lower(), "text") if output else "text")
    text: str = getattr(diagrams, chosen)(sketch.graph)
    options.put(text, output, as_json=as_json)
    options.conclude(sketch)
