"""Shell completion of pipelines, scenes, node ids, their parameters and values."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph import reference
from rendergraph.cli.lazy_click import click
from rendergraph.errors import RendergraphError
from rendergraph.resources import shipped_pipelines, shipped_scenes

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from rendergraph.session.values import Linked

Context = click.Context
_BREAKS = "=:"
"""The word breaks of bash that occur in settings: bash completes the text after the last one."""


def complete(kind: str, ctx: Context, incomplete: str) -> list[CompletionItem]:
    """Return the words of a kind that begin with the typed text."""
    from click.shell_completion import CompletionItem

    items = [CompletionItem(word) for word in _WORDS[kind](ctx, incomplete) if word.startswith(incomplete)]
    is_path = incomplete and ("/" in incomplete or "." in incomplete or any(Path().glob(f"{incomplete}*")))
    if is_path and kind in _OR_FILES:
        items.append(CompletionItem(incomplete, type="file"))  # the shell lists files itself
    return items


def _topics(ctx: Context, incomplete: str) -> list[str]:
    from rendergraph.catalog import Catalog
    from rendergraph.pipelines.environments import SHIPPED

    names = {*Catalog.discover(()).names(), *reference.FILE_KINDS}
    return sorted({*names, *shipped_pipelines(), *shipped_scenes(), *SHIPPED})


def _environments(ctx: Context, incomplete: str) -> Iterable[str]:
    from rendergraph.pipelines.environments import SHIPPED

    return (*SHIPPED, "none")


def _families(ctx: Context, incomplete: str) -> Iterable[str]:
    from rendergraph.catalog import Catalog

    return filter(None, Catalog.discover(()).families())


def _cameras(ctx: Context, incomplete: str) -> Iterable[str]:
    linked = _linked(ctx)
    return linked.scene.cameras if linked else ()


def _settings(ctx: Context, incomplete: str) -> Iterable[str]:
    """Return what `-s` takes: node ids, then their parameters and inputs, then values."""
    linked = _linked(ctx)
    if linked is None:
        return ()
    path, equals, _ = incomplete.partition("=")
    node, dot, name = path.partition(".")
    if not dot:
        return [*(f"{name}=" for name in linked.spec.parameters), *(f"{node.id}." for node in linked.graph.nodes)]
    if node not in linked.graph:
        return ()
    if equals:
        return (f"{path}={value}" for value in _values(linked, node, name))
    cls = linked.graph[node].type.cls
    return (f"{node}.{name}=" for name in (*cls.parameters(), *cls.inputs(), "type", "enabled"))


def _ports(ctx: Context, incomplete: str) -> list[str]:
    linked = _linked(ctx)
    return [str(end) for end, info in linked.graph.textures.items() if info.desc is not None] if linked else []


_WORDS: dict[str, Callable[[Context, str], Iterable[str]]] = {
    "pipelines": lambda ctx, incomplete: shipped_pipelines(),
    "scenes": lambda ctx, incomplete: shipped_scenes(),
    "environments": _environments,
    "topics": _topics,
    "families": _families,
    "cameras": _cameras,
    "settings": _settings,
    "ports": _ports,
    "taps": lambda ctx, incomplete: [f"{port}=" for port in _ports(ctx, incomplete)],
}
_OR_FILES = ("pipelines", "scenes", "environments", "topics")


def _values(linked: Linked, node: str, name: str) -> Iterator[str]:
    node_type = linked.graph[node].type
    if name == "type":
        yield from linked.catalog.names()
    elif name == "enabled":
        yield from ("true", "false")
    elif name in node_type.cls.inputs():
        yield "null"
        yield from (str(end) for end in linked.graph.textures if end.node != node)
    else:
        parameters = reference.describe_node(node_type, linked.catalog.extensions)["parameters"]
        found: dict[str, Any] = next((one for one in parameters if one["name"] == name), {})
        yield from found.get("choices", ("true", "false") if isinstance(found.get("default"), bool) else ())


def _linked(ctx: Context) -> Linked | None:
    """Return the pipeline of the command line typed so far; None if there is none or it cannot be linked."""
    from rendergraph.session import Selection, stages

    named: Any = ctx.params.get("pipeline") or ctx.params.get("pipelines") or tuple(ctx.args)  # args: before a last -s
    source = named[0] if isinstance(named, tuple) and named else named
    if not isinstance(source, str):
        return None
    scene, plugins = ctx.params.get("scene"), tuple(map(Path, ctx.params.get("plugins") or ()))
    for sets in (tuple(ctx.params.get("sets") or ()), ()):
        try:
            return stages.sketch(stages.resolve(Selection(source, scene=scene, sets=sets, plugins=plugins)))
        except (RendergraphError, OSError):
            continue
    return None


def install() -> None:
    """Make bash complete words that contain `=`, and add no space after one that ends in `=` or `.`."""
    from click.shell_completion import BashComplete, add_completion_class

    class Bash(BashComplete):
        source_template = BashComplete.source_template.replace(
            'COMP_WORDS="${COMP_WORDS[*]}" COMP_CWORD=$COMP_CWORD', 'COMP_LINE="$COMP_LINE" COMP_POINT=$COMP_POINT'
        ).replace("    return 0\n", "    [[ ${COMPREPLY[0]} == *[=.] ]] && compopt -o nospace\n    return 0\n")

        def get_completion_args(self) -> tuple[list[str], str]:
            from click.shell_completion import split_arg_string

            line = os.environ["COMP_LINE"].encode()[: int(os.environ["COMP_POINT"])].decode(errors="replace")
            words = split_arg_string(line)[1:]
            self.incomplete = "" if line[-1:].isspace() or not words else words.pop()
            return words, self.incomplete

        def format_completion(self, item: CompletionItem) -> str:
            begun = max(self.incomplete.rfind(sign) for sign in _BREAKS) + 1
            return f"{item.type},{item.value[begun:]}"

    add_completion_class(Bash)
