"""The command line's page, from the same declarations as `--help`."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator

import click

from rendergraph.cli import commands
from rendergraph.errors import EXIT_CODES

from .markdown import block, page, prose, table


def pages() -> Iterator[tuple[str, str]]:
    """One page."""
    verbs = commands()
    rows = [(f"[`{name}`](#{name})", prose(command.get_short_help_str(200))) for name, command in verbs.items()]
    yield (
        "cli.md",
        page(
            "Command line",
            "Data goes to stdout, everything else to stderr. Every verb has `--json`, which prints one document, "
            "`--quiet`, which prints only errors, and `--help`. On a terminal errors are marked in colour; "
            "`NO_COLOR=1` leaves that out.",
            table(("verb", ""), rows),
            *(_verb(name, command) for name, command in verbs.items()),
            "## Exit codes",
            table(("code", "meaning"), [(f"`{number}`", text) for number, text in EXIT_CODES.items()]),
        ),
    )


def _verb(name: str, command: click.Command) -> str:
    # click keeps the help option a command first makes, so the names the group gives it must be there already.
    names = ["-h", "--help"]
    context = click.Context(command, info_name=f"rendergraph {name}", help_option_names=names)
    about, _, examples = inspect.cleandoc(command.help or "").partition("\b")
    lines = [f"$ {line.strip()}" for line in examples.splitlines()[2:] if line.strip()]
    options = [record for parameter in command.params if (record := parameter.get_help_record(context)) and record[1]]
    usage = f"rendergraph {name} {' '.join(command.collect_usage_pieces(context))}"
    return "\n\n".join(
        [
            f"## {name}",
            prose(about.strip()),
            block(usage, "text"),
            block("\n".join(lines), "console") if lines else "",
            table(("option", ""), [(f"`{names}`", prose(re.sub(r"\s+", " ", text))) for names, text in options]),
        ]
    )
