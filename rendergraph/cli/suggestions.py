"""Suggestions for verbs and options that do not exist."""

from __future__ import annotations

from pathlib import Path

import yaml

from rendergraph.cli.lazy_click import click
from rendergraph.errors import nearest

_FLOOR = 0.7
"""Similarity below which a word is another word: `width` is not `watch` (0.6), `siez` is `size` (0.75)."""


def meant_by(word: str, kind: str) -> str | None:
    """Return the entry for another program's word in `meanings`, `needless` or `verbs` of the table."""
    table = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))
    return next((advice for advice, words in table[kind].items() if word in words.split()), None)


def unknown_option(error: click.NoSuchOption, context: click.Context) -> str:
    name = error.option_name
    if not name.startswith("--"):  # click reports only the first letter of `-width`
        name = next((word for word in context.obj or () if word.startswith(name)), name)
    return f"unknown option '{name}'{_meant(name, context)}"


def _meant(name: str, context: click.Context) -> str:
    word = name.lstrip("-").partition("=")[0].lower().replace("_", "-")
    own = _options(context.command)
    if (advice := meant_by(word, "meanings")) is not None:
        # Only `run` writes pictures.
        picture = advice.startswith("-o ") and "." in advice and context.command.name != "run"
        known = advice.startswith("rendergraph") or (advice.partition(" ")[0] in own and not picture)
        return f"; did you mean '{advice}'" + ("?" if known else " of `rendergraph run`?")
    if (reason := meant_by(word, "needless")) is not None:
        return f"; leave it out: {reason}"
    if (near := nearest(word, {option[2:] for option in own if option.startswith("--")}, floor=_FLOOR)) is not None:
        return f"; did you mean '--{near}'?"
    root = context.find_root()
    assert isinstance(root.command, click.Group)
    verbs = {verb: root.command.get_command(root, verb) for verb in root.command.list_commands(root)}
    owners = [f"`{verb}`" for verb, command in verbs.items() if command and name in _options(command)]
    return f"; it is an option of {', '.join(owners)}" if owners else ""


def _options(command: click.Command) -> list[str]:
    return [option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)]
