"""`rendergraph check-node`: validate a node."""

from __future__ import annotations

from pathlib import Path

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit_json, say, warn
from rendergraph.errors import InputError, Problem, UsageError, suggestion

_LIMITS = ("import-seconds", "pass-seconds", "memory")


@click.command("check-node", no_args_is_help=True)
@click.argument("file", type=options.NamedPath())
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
def command(
    file: Path, scene: str | None, limits: tuple[tuple[str, int], ...], plugins: tuple[Path, ...], as_json: bool
) -> None:
    """Validate a node of your own in every variant.

    FILE is a Python module or a shader file. Checks docs and ranges, compiles the shaders with every choice and with
    inputs connected and not, and renders them: the node must write all outputs that it declares, change nothing else,
    and leak nothing. This happens in a process with limits. Exits with code 0 if the node is valid, else with code 3
    and every mistake with its line.

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
    default = CheckLimits()
    allowed = CheckLimits(
        given.get("import-seconds", default.import_seconds),
        given.get("pass-seconds", default.pass_seconds),
        given["memory"] << 20 if "memory" in given else default.memory,
    )
    report = check_node(file, plugins=plugins, scene=scene, limits=allowed)
    if report.mistakes:
        warn([problem for problem in report.problems if problem.severity == "warning"])
        raise InputError(report.mistakes)
    warn(report.problems)
    count = len(report.variants)
    warnings = len(report.problems)
    found = f"{warnings} warning{'' if warnings == 1 else 's'}, no mistakes" if warnings else "no problems"
    say(f"{report.node}: {found} in {count} variant{'' if count == 1 else 's'}")
    if as_json:
        emit_json(
            {
                "node": report.node,
                "file": str(file),
                "variants": list(report.variants),
                "warnings": [problem.as_json() for problem in report.problems],
            }
        )
