"""`rendergraph new-node`: a working node to change."""

from __future__ import annotations

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json, say

_KINDS = ("fullscreen", "compute", "geometry", "shader-only")


@click.command("new-node", no_args_is_help=True)
@click.argument("name")
@click.option("--kind", type=click.Choice(_KINDS), default=_KINDS[0], show_default=True, help="The template.")
@click.option("--package", is_flag=True, help="Write a folder that can be installed and shared.")
@options.json_option
def command(name: str, kind: str, package: bool, as_json: bool) -> None:
    """Write a working node into the current folder.

    A module, its shader, a pipeline that uses it and a test that passes, for you to change. No file is ever
    overwritten.

    \b
    Examples:
      rendergraph new-node vignette
      rendergraph new-node grain --kind shader-only
      rendergraph new-node histogram --kind compute --package
    """
    from rendergraph.authoring import new_node

    node = new_node(name, kind, package=package)  # type: ignore[arg-type]  # click has checked the word
    files = [path.as_posix() for path in node.files]
    if as_json:
        emit_json({"node": node.name, "kind": node.kind, "files": files, "commands": list(node.commands)})
    else:
        emit("\n".join(files))
    say("next:\n" + "\n".join(f"  {line}" for line in node.commands))
