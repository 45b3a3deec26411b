"""`rendergraph init`: a project to work in."""

from __future__ import annotations

from pathlib import Path

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.new_node import print_files


@click.command("init")
@click.argument("folder", default=".", type=options.NamedPath(file_okay=False))
@options.json_option
def command(folder: Path, as_json: bool) -> None:
    """Start a project in the current folder or in a new one.

    A pipeline, a scene, a node with its shader and test, the settings file `rendergraph.toml`, which names the folder
    of nodes, schemas for editors and a `.gitignore`. Inside the project all of them are found without options. No file
    is ever overwritten; a `.gitignore` and schemas that are there stay.

    \b
    Examples:
      rendergraph init
      rendergraph init study
    """
    from rendergraph.authoring import new_project

    print_files(new_project(folder), {"folder": str(folder)}, as_json)
