"""`rendergraph config`: print a pipeline with everything applied."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json, warn

if TYPE_CHECKING:
    from rendergraph.session import Selection


@click.command("config", no_args_is_help=True)
@options.pipeline_options
@options.json_option
def command(selection: Selection, as_json: bool) -> None:
    """Print the resolved pipeline, with origins.

    The file with `extends`, patches and settings applied, and beside each value the line it comes from. For a picture
    that `rendergraph run` wrote (EXR or PNG), the pipeline that made it.

    \b
    Examples:
      rendergraph config forward-prepass
      rendergraph config forward -s light.ambient=0.1 --json
      rendergraph config forward.png
    """
    from rendergraph.session import Selection, stages
    from rendergraph.session.picture_metadata import is_picture

    if is_picture(selection.source) and selection == Selection(selection.source):
        _of_picture(Path(selection.source), as_json)
        return
    spec = stages.resolve(selection).spec
    spec.check()
    warn(spec.notes)
    if as_json:
        emit_json({"pipeline": spec.name, "resolved": spec.plain(), "yaml": spec.to_yaml(origins=True)})
    else:
        emit(spec.to_yaml(origins=True).rstrip("\n"))


def _of_picture(path: Path, as_json: bool) -> None:
    from rendergraph.session.picture_metadata import metadata

    found = metadata(path)
    if as_json:
        emit_json({"picture": str(path), "yaml": found["pipeline"], "metadata": found})
        return
    for name, text in found.items():
        if name != "pipeline":
            emit(f"# {name}: " + " ".join(text.split()))
    emit(found["pipeline"].rstrip("\n"))
