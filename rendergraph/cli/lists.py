"""`rendergraph nodes`, `pipelines`, `scenes` and `environments`: what is available."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from itertools import groupby
from pathlib import Path
from typing import Any

from rendergraph import reference
from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json, sections, table, warn
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.resources import opening, shipped_pipelines, shipped_scenes


def _verb(kind: str, find: Callable[[], Mapping[str, Path | str]], hint: str) -> click.Command:
    """Return a verb that lists what `find` returns: name to a file that begins with a comment, or to a line of text."""

    def command(as_json: bool) -> None:
        found = {
            name: {"line": one} if isinstance(one, str) else {"line": opening(one), "file": str(one)}
            for name, one in find().items()
        }
        if as_json:
            emit_json({kind: [{"name": name, **entry} for name, entry in found.items()]})
        else:
            emit(table([(name, entry["line"]) for name, entry in found.items()]))
            emit(f"\n{hint}")

    command.__doc__ = f"""List the shipped {kind}.

    \b
    Examples:
      rendergraph {kind}
      rendergraph {kind} --json
    """
    return click.command(kind)(options.json_option(command))


pipelines = _verb(
    "pipelines", shipped_pipelines, "`rendergraph run NAME` renders a pipeline, `rendergraph explain NAME` describes it"
)
scenes = _verb(
    "scenes",
    shipped_scenes,
    "`rendergraph run PIPELINE --scene NAME` renders a scene, `rendergraph explain NAME` describes it",
)
environments = _verb(
    "environments",
    lambda: import_module("rendergraph.pipelines.environments").SHIPPED,
    "`rendergraph run PIPELINE --environment NAME` uses one, as does environment: {file: NAME} in a scene file",
)


@click.command("nodes")
@click.argument("family", required=False, type=options.Parsed("FAMILY", offers="families"))
@options.plugin_option
@options.json_option
def nodes(family: str | None, plugins: tuple[Path, ...], as_json: bool) -> None:
    """List the node types, all or of one family.

    `rendergraph explain NODE` describes a node. Other things that plugins add come last: port types, parameter choices,
    loaders, metrics, keys of scene files. Node types with errors are left out with a warning, and the exit code is 3.

    \b
    Examples:
      rendergraph nodes
      rendergraph nodes display --json
    """
    catalog = options.find_catalog(plugins)
    families = catalog.families()
    if family is not None and family not in families:
        text = f"unknown family of nodes '{family}'{suggestion(family, filter(None, families))}"
        raise InputError(Problem("RG511", text))
    names = (name for key, members in families.items() if family in (None, key) for name in members)
    found, problems = catalog.usable(names)
    warn(problems)
    added: list[dict[str, Any]] = []
    if family is None:
        added = catalog.extensions.listed()
        warn(catalog.extensions.warnings)
    if as_json:
        described = [reference.describe_node(node_type) for node_type in found]
        emit_json({"nodes": described, "extensions": added, "problems": [problem.as_json() for problem in problems]})
    else:
        rows: list[tuple[str, ...]] = []
        for title, members in groupby(found, key=lambda node_type: node_type.family or "no family"):
            rows += [(title,), *((f"  {one.name}", reference.summary(one)) for one in members)]
        extensions = [(entry["kind"], entry["name"], entry["plugin"], entry["doc"]) for entry in added]
        if text := sections(table(rows), table(extensions, ("added", "name", "plugin", "")) if extensions else ""):
            emit(text)
    if problems:
        click.get_current_context().exit(InputError.exit_code)
