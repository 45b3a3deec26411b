"""Verbs for authors: `init`, `copy`, `new-node`, `check-node`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import amount, emit, emit_json, say, warn
from rendergraph.errors import InputError, Problem, UsageError, suggestion

if TYPE_CHECKING:
    from rendergraph.authoring import NewNode

_KINDS = ("fullscreen", "compute", "geometry", "shader-only")
_LIMITS = ("import-seconds", "pass-seconds", "memory")


@click.command("init")
@click.argument("folder", default=".", type=options.FOLDER)
@options.json_option
def init(folder: Path, as_json: bool) -> None:
    """Start a project in the current folder or in a new one.

    Writes a pipeline, a scene, a node with its shader and test, the settings file `rendergraph.toml`, which names the
    folder of nodes, schemas for editors and a `.gitignore`. Inside the project all of them are found without options.
    No file is ever overwritten; an existing `.gitignore` and existing schemas are kept.

    \b
    Examples:
      rendergraph init
      rendergraph init study
    """
    from rendergraph.authoring import new_project

    print_files(new_project(folder), {"folder": str(folder)}, as_json)


@click.command("copy", no_args_is_help=True)
@click.argument("name", type=options.TOPIC)
@options.json_option
def copy(name: str, as_json: bool) -> None:
    """Copy a shipped pipeline, scene or node to edit.

    Writes the copy into the current folder. A pipeline or scene keeps its name; use it by path: `./NAME.yaml`. A node
    becomes the type `my_NAME`, with its shaders. If a name is ambiguous, write `pipeline:NAME`, `scene:NAME` or
    `node:NAME`. No file is ever overwritten.

    \b
    Examples:
      rendergraph copy deferred
      rendergraph copy cornell_box
      rendergraph copy node:bloom
    """
    from rendergraph.authoring import copy_shipped

    print_files(copy_shipped(name), {"copied": name}, as_json)


@click.command("new-node", no_args_is_help=True)
@click.argument("name")
@click.option("--kind", type=click.Choice(_KINDS), default=_KINDS[0], show_default=True, help="The template.")
@click.option("--package", is_flag=True, help="Write a folder that can be installed and shared.")
@options.json_option
def new_node(name: str, kind: str, package: bool, as_json: bool) -> None:
    """Write a working node into the current folder.

    Writes a module, its shader, a pipeline that uses it and a passing test as a starting point. In a project that
    `rendergraph init` started, the module and the shader go into its folder of nodes. No file is ever overwritten.

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
        say("in a project that `rendergraph init` started, nodes are found without --plugin")


def print_files(written: NewNode, about: dict[str, str], as_json: bool) -> None:
    files = [path.as_posix() for path in written.files]
    emit_json({**about, "files": files, "commands": list(written.commands)}) if as_json else emit("\n".join(files))
    say("next:\n" + "\n".join(f"  {line}" for line in written.commands))


@click.command("check-node", no_args_is_help=True)
@click.argument("file", type=options.PATH)
@click.option(
    "--scene", metavar="FILE", help="Scene for geometry nodes: a shipped name, a scene file, .obj, .gltf, .glb."
)
@click.option(
    "--limit",
    "limits",
    multiple=True,
    type=options.LIMIT,
    help="Change a limit: import-seconds (10), pass-seconds (30), memory in MiB (2048).",
)
@options.plugin_option
@options.json_option
def check_node(
    file: Path, scene: str | None, limits: tuple[tuple[str, int], ...], plugins: tuple[Path, ...], as_json: bool
) -> None:
    """Validate a node of your own in every variant.

    FILE is a Python module or a shader file. Checks docs and ranges, compiles the shaders with every choice, with and
    without optional inputs, and renders them. The node must write all outputs that it declares, change nothing else
    and leak nothing. The check runs in a process with limits. Exits with code 0 if the node is valid; otherwise prints
    every mistake with its line and exits with code 3.

    \b
    Examples:
      rendergraph check-node vignette.py
      rendergraph check-node grain.frag --json
    """
    from rendergraph.authoring import CheckLimits, check_node

    given = dict(limits)
    for name in given:
        if name not in _LIMITS:
            raise UsageError(Problem("RG500", f"unknown limit '{name}'{suggestion(name, _LIMITS)}"))
    named = {name.replace("-", "_"): most << 20 if name == "memory" else most for name, most in given.items()}
    report = check_node(file, plugins=plugins, scene=scene, limits=CheckLimits(**named))
    if report.mistakes:
        warn([problem for problem in report.problems if problem.severity == "warning"])
        raise InputError(report.mistakes)
    warn(report.problems)
    found = f"{amount(len(report.problems), 'warning')}, no mistakes" if report.problems else "no problems"
    say(f"{report.node}: {found} in {amount(len(report.variants), 'variant')}")
    if as_json:
        warnings = [problem.as_json() for problem in report.problems]
        emit_json({"node": report.node, "file": str(file), "variants": list(report.variants), "warnings": warnings})
