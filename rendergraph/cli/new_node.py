"""`rendergraph new-node`: a working node to change."""

from __future__ import annotations

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json, say

_KINDS = ("fullscreen", "compute", "geometry", "shader-only")


@click.command("new-node", no_args_is_help=True)
@click.argument("name")
@click.option("--kind", type=click.Choice(_KINDS), default=_KINDS[0], show_default=True, help="What it starts as.")
@click.option("--package", is_flag=True, help="Make a folder that can be installed and given to others.")
@options.json_option
def command(name: str, kind: str, package: bool, as_json: bool) -> None:
    """Write a working node into the current folder.

    A module, its shader, a pipeline that uses it and a test that passes; change them into yours. No file is ever
    overwritten.

    \b
    Examples:
      rendergraph new-node vignette
      rendergraph new-node grain --kind shader-only
      rendergraph new-node histogram --kind compute --package
    """
    from rendergraph.authoring import new_node

    made = new_node(name, kind, package=package)  # type: ignore[arg-type]  # click has checked the word
    if as_json:
        emit_json(
            {
                "node": made.name,
                "kind": made.kind,
                "files": [path.as_posix() for path in made.files],
                "commands": list(made.commands),
            }
        )
    else:
        emit("\n".join(path.as_posix() for path in made.files))
    say("next:\n" + "\n".join(f"  {line}" for line in made.commands))
