"""The command line's page, from the same declarations as `--help`."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterator

import click

from rendergraph.cli.app import VERBS

from .markdown import block, page, prose, table

CODES = (
    (0, "done"),
    (1, "failed while running: disk, memory, GL"),
    (2, "the command line itself: an unknown verb or option, a malformed value"),
    (3, "something named there or in a file is missing or wrong: pipeline, scene, mesh, image, shader"),
    (4, "a comparison beyond its threshold"),
    (5, "no usable GL device"),
    (130, "interrupted"),
    (143, "terminated"),
)


def pages() -> Iterator[tuple[str, str]]:
    """One page."""
    verbs = {verb: importlib.import_module(f"rendergraph.cli.{verb.replace('-', '_')}").command for verb in VERBS}
    rows = [(f"[`{verb}`](#{verb})", prose(command.get_short_help_str(200))) for verb, command in verbs.items()]
    yield (
        "cli.md",
        page(
            "Command line",
            "Data goes to stdout, everything else to stderr. Every verb has `--json`, which prints one document, and "
            "`--help`.",
            table(("verb", ""), rows),
            *(_verb(verb, command) for verb, command in verbs.items()),
            f"## Exit codes\n\n{table(('code', 'meaning'), [(f'`{number}`', text) for number, text in CODES])}",
        ),
    )


def _verb(verb: str, command: click.Command) -> str:
    # click keeps the help option a command first makes, so the names the group gives it must be there already.
    names = ["-h", "--help"]
    context = click.Context(command, info_name=f"rendergraph {verb}", help_option_names=names)
    about, _, examples = inspect.cleandoc(command.help or "").partition("\b")
    lines = [f"$ {line.strip()}" for line in examples.splitlines()[2:] if line.strip()]
    options = [record for parameter in command.params if (record := parameter.get_help_record(context)) and record[1]]
    usage = f"rendergraph {verb} {' '.join(command.collect_usage_pieces(context))}"
    return "\n\n".join(
        [
            f"## {verb}",
            prose(about.strip()),
            block(usage, "text"),
            block("\n".join(lines), "console") if lines else "",
            table(("option", ""), [(f"`{names}`", prose(re.sub(r"\s+", " ", text))) for names, text in options]),
        ]
    )
