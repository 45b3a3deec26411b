"""`rendergraph new-node`: a working node to change."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json, say

if TYPE_CHECKING:
    from rendergraph.authoring import NewNode

_KINDS = ("fullscreen", "compute", "geometry", "shader-only")


@click.command("new-node", no_args_is_help=True)
@click.argument("name")
@click.option("--kind", type=click.Choice(_KINDS), default=_KINDS[0], show_default=True, help="The template.")
@click.option("--package", is_flag=True, help="Write a folder that can be installed and shared.")
@options.json_option
def command(name: str, kind: str, package: bool, as_json: bool) -> None:
    """Write a working node into the current folder.

    A module, its shader, a pipeline that uses it and a test that passes, for you to change. In the folder of a project,
    which `rendergraph init` starts, module and shader go into its folder of nodes. No file is ever overwritten.

    \b
    Examples:
      rendergraph new-node vignette
      rendergraph new-node grain --kind shader-only
      rendergraph new-node histogram --kind compute --package
    """
    from rendergraph.authoring import new_node

    node = new_node(name, kind, package=package)  # type: ignore[arg-type]  # click has checked the word
    print_files(node, {"node": node.name, "kind": node.kind}, as_json)
    if any("--plugin" in line for line in node.commands) and not package:
        say("in the folder of a project, which `rendergraph init` starts, nodes are found without --plugin")


def print_files(written: NewNode, about: dict[str, str], as_json: bool) -> None:
    """Print which files were written, and what to type next."""
    files = [path.as_posix() for path in written.files]
    emit_json({**about, "files": files, "commands": list(written.commands)}) if as_json else emit("\n".join(files))
    say("next:\n" + "\n".join(f"  {line}" for line in written.commands))
