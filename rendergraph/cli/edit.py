"""Verbs that change a file's text: `edit` and `upgrade`."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json, say, warn
from rendergraph.errors import InputError, Problem, UsageError

if TYPE_CHECKING:
    from rendergraph.catalog import Catalog
    from rendergraph.edit import PipelineText

# By operation: minimum and maximum number of arguments, and the arguments as the help shows them.
_OPERATIONS: Mapping[str, tuple[int, int, str]] = {
    "add": (2, 1000, "ID TYPE [NAME=VALUE]..."),
    "delete": (1, 1, "ID"),
    "rename": (2, 2, "ID NEW_ID"),
    "connect": (2, 1000, "NODE.INPUT LINK..."),
    "disconnect": (1, 1, "NODE.INPUT"),
    "set": (2, 2, "NODE.PARAM VALUE"),
    "retype": (2, 2, "ID TYPE"),
    "disable": (1, 1, "ID"),
    "enable": (1, 1, "ID"),
    "insert": (3, 5, "ID TYPE NODE.INPUT [INPUT OUTPUT]"),
    "duplicate": (2, 2, "ID NEW_ID"),
}
_dry_run = click.option("--dry-run", is_flag=True, help="Show the difference, and write nothing.")


@click.command("edit", no_args_is_help=True, context_settings={"ignore_unknown_options": True})  # -1 is a value
@click.argument("file", type=options.FILE)
@click.argument("operation", type=click.Choice([*_OPERATIONS]))
@click.argument("words", nargs=-1)
@_dry_run
@options.plugin_option
@options.json_option
def edit(
    file: Path, operation: str, words: tuple[str, ...], dry_run: bool, plugins: tuple[Path, ...], as_json: bool
) -> None:
    """Change a pipeline file: its nodes, links and parameters.

    Everything else, comments and order included, stays byte for byte. Prints the difference, writes the file as a whole
    and checks the result. Exit code 3 means that the file was written but has mistakes, which are listed as by `check`.
    In a file that extends another, inherited values are changed by new entries.

    The operations: `add ID TYPE [NAME=VALUE]...` with links and parameters by name, `delete ID` with the links to it,
    `rename ID NEW_ID`, `connect NODE.INPUT LINK...` (`outputs.NAME` is an output of the file), `disconnect NODE.INPUT`,
    `set NODE.PARAM VALUE` (or the name of a parameter of the pipeline; `null` is the default), `retype ID TYPE`,
    `disable ID`, `enable ID`, `insert ID TYPE NODE.INPUT [INPUT OUTPUT]` into a link, `duplicate ID NEW_ID`.

    \b
    Examples:
      rendergraph edit my.yaml add ao ssao_hemisphere depth=gbuffer.depth normal=gbuffer.normal
      rendergraph edit my.yaml connect light.occlusion ao.occlusion
      rendergraph edit my.yaml set display.exposure -0.5 --dry-run
      rendergraph edit my.yaml insert glow bloom display.radiance
    """
    if unknown := next((word for word in words if word.startswith("--")), None):
        raise click.NoSuchOption(unknown, ctx=click.get_current_context())
    least, most, shown = _OPERATIONS[operation]
    if not least <= len(words) <= most or (operation == "insert" and len(words) == 4):
        raise UsageError(Problem("RG500", f"expected `rendergraph edit FILE {operation} {shown}`"))
    from rendergraph.document import parse
    from rendergraph.errors import Option

    def value(text: str) -> Any:
        return parse(text, Option(operation, text)).root.plain() if text.strip() else text

    given: Sequence[Any] = words
    if operation == "add":
        pairs = [word.partition("=") for word in words[2:]]
        if wrong := [name for name, equals, _ in pairs if not equals]:
            raise UsageError(Problem("RG500", f"'{wrong[0]}' is not NAME=VALUE; see 'rendergraph edit --help'"))
        given = (*words[:2], {name: value(text) for name, _, text in pairs})
    elif operation == "connect":
        given = (words[0], words[1:])
    elif operation == "set":
        given = (words[0], value(words[1]))
    catalog = options.find_catalog(plugins)
    before, pipeline = _opened(file, catalog)
    getattr(pipeline, operation)(*given)
    _finish(pipeline, before, dry_run, plugins, as_json)


@click.command("upgrade", no_args_is_help=True)
@click.argument("file", type=options.FILE)
@_dry_run
@options.plugin_option
@options.json_option
def upgrade(file: Path, dry_run: bool, plugins: tuple[Path, ...], as_json: bool) -> None:
    """Rewrite a file of an earlier version.

    FILE is a pipeline or a shader. A pipeline gets its format version if that is missing. In a shader, old names of
    shared includes and of their declarations (RG449) are replaced. No node type, port or parameter has been renamed
    yet. Everything else stays byte for byte.

    \b
    Examples:
      rendergraph upgrade my.yaml --dry-run
      rendergraph upgrade fog.frag
    """
    from rendergraph.catalog import SHADERS, Catalog
    from rendergraph.edit import upgraded_shader

    catalog = Catalog.discover(plugins)
    before, pipeline = _opened(file, catalog)
    if file.suffix in (*SHADERS, ".vert", ".geom", ".glsl"):
        pipeline.text = upgraded_shader(file, before)
    else:
        pipeline.upgrade()
    if pipeline.text == before:
        say(f"{file}: nothing to upgrade")
    _finish(pipeline, before, dry_run, plugins, as_json, check=file.suffix in (".yaml", ".yml"))


def _opened(file: Path, catalog: Catalog) -> tuple[str, PipelineText]:
    from rendergraph.document import YamlLimits, read_text
    from rendergraph.edit import PipelineText
    from rendergraph.resources import is_name, shipped_pipelines

    if is_name(str(file)) and str(file) in shipped_pipelines() and not file.exists():
        text = f"'{file}' is shipped; write a file with `extends: {file}` and edit that"
        raise InputError(Problem("RG015", text))
    text = read_text(file, YamlLimits(), str(file))
    return text, PipelineText(text, file, catalog)


def _finish(
    pipeline: PipelineText, before: str, dry_run: bool, plugins: tuple[Path, ...], as_json: bool, check: bool = True
) -> None:
    """Print the difference, write the file, and report what `check` finds in it."""
    from rendergraph.images.files import replace_text
    from rendergraph.session import Selection, stages

    file, after = pipeline.path, pipeline.text
    old, new = (text.splitlines() for text in (before, after))
    difference = "\n".join(difflib.unified_diff(old, new, str(file), str(file), n=1, lineterm=""))
    if after != before and not dry_run:
        replace_text(file, after)
    if difference and not as_json:
        emit(difference)
    for note in pipeline.notes:
        say(note)
    mistakes: tuple[Problem, ...] = ()
    if check:
        try:
            linked = stages.link(stages.resolve(Selection(str(file), text=after, plugins=plugins), pipeline.catalog))
            warn([*linked.warnings, *stages.check(linked).warnings])
            say(linked.graph.summary)
        except InputError as error:
            mistakes = tuple(error.problems)
    if as_json:
        report = {"file": str(file), "written": after != before and not dry_run, "difference": difference}
        emit_json(report | {"notes": pipeline.notes, "errors": [problem.as_json() for problem in mistakes]})
        click.get_current_context().exit(InputError.exit_code if mistakes else 0)
    if mistakes:
        raise InputError(mistakes)
