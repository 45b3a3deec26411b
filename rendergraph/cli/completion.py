"""What a shell offers on TAB: pipelines, scenes, node ids, their parameters and the values these take."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.cli.words import click
from rendergraph.errors import RendergraphError
from rendergraph.resources import shipped_pipelines, shipped_scenes

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from rendergraph.session.values import Linked

Context = click.Context
Parameter = click.Parameter
_BREAKS = "=:"
"""Of bash's word breaks, those that stand in settings: it completes what comes after the last one."""


def pipelines(ctx: Context, param: Parameter, incomplete: str) -> list[CompletionItem]:
    """Shipped pipelines and files."""
    return [*_matching(shipped_pipelines(), incomplete), *_files(incomplete)]


def scenes(ctx: Context, param: Parameter, incomplete: str) -> list[CompletionItem]:
    """Shipped scenes and files."""
    return [*_matching(shipped_scenes(), incomplete), *_files(incomplete)]


def topics(ctx: Context, param: Parameter, incomplete: str) -> list[CompletionItem]:
    """What `explain` explains."""
    from rendergraph.catalog import Catalog
    from rendergraph.cli.explain import FILES

    names = {*Catalog.discover(()).names(), *shipped_pipelines(), *shipped_scenes(), *FILES}
    return [*_matching(sorted(names), incomplete), *_files(incomplete)]


def families(ctx: Context, param: Parameter, incomplete: str) -> list[CompletionItem]:
    """Families of nodes."""
    from rendergraph.catalog import Catalog

    return _matching(filter(None, Catalog.discover(()).families()), incomplete)


def cameras(ctx: Context, param: Parameter, incomplete: str) -> list[CompletionItem]:
    """Cameras of the pipeline's scene."""
    linked = _linked(ctx)
    return _matching(linked.scene.cameras, incomplete) if linked else []


def settings(ctx: Context, param: Parameter, incomplete: str) -> list[CompletionItem]:
    """What `-s` takes: node ids, then their parameters and inputs, then values."""
    linked = _linked(ctx)
    if linked is None:
        return []
    path, equals, _ = incomplete.partition("=")
    node, dot, name = path.partition(".")
    if not dot:
        words = [f"{name}=" for name in linked.spec.parameters] + [f"{node.id}." for node in linked.graph.nodes]
        return _matching(words, incomplete)
    if node not in linked.graph:
        return []
    if equals:
        return _matching((f"{path}={value}" for value in _values(linked, node, name)), incomplete)
    cls = linked.graph[node].type.cls
    return _matching((f"{node}.{name}=" for name in (*cls.parameters(), *cls.inputs(), "type", "enabled")), incomplete)


def ports(ctx: Context, param: Parameter, incomplete: str) -> list[CompletionItem]:
    """What `--metric` takes."""
    from click.shell_completion import CompletionItem

    return [CompletionItem(item.value.rstrip("=")) for item in taps(ctx, param, incomplete)]


def taps(ctx: Context, param: Parameter, incomplete: str) -> list[CompletionItem]:
    """What `--tap` takes: ports that hold a texture."""
    linked = _linked(ctx)
    if linked is None or "=" in incomplete:
        return []
    ports = (str(end) for end, info in linked.graph.textures.items() if info.desc is not None)
    return _matching((f"{port}=" for port in ports), incomplete)


def _values(linked: Linked, node: str, name: str) -> Iterator[str]:
    """What a parameter, an input or the type of a node can be."""
    from rendergraph.cli.describe import describe

    found = linked.graph[node].type
    if name == "type":
        yield from linked.catalog.names()
    elif name == "enabled":
        yield from ("true", "false")
    elif name in found.cls.inputs():
        yield "null"
        yield from (str(end) for end in linked.graph.textures if end.node != node)
    else:
        described = describe(found, linked.catalog.extensions)["parameters"]
        known: dict[str, Any] = next((one for one in described if one["name"] == name), {})
        yield from known.get("choices", ("true", "false") if isinstance(known.get("default"), bool) else ())


def _linked(ctx: Context) -> Linked | None:
    """The pipeline of the command line, as far as it is typed; None where there is none that could be looked at."""
    from rendergraph.session import Selection, stages

    named: Any = ctx.params.get("pipeline") or ctx.params.get("pipelines") or tuple(ctx.args)  # left over by a last -s
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


def _matching(words: Iterable[str], incomplete: str) -> list[CompletionItem]:
    from click.shell_completion import CompletionItem

    return [CompletionItem(word) for word in words if word.startswith(incomplete)]


def _files(incomplete: str) -> list[CompletionItem]:
    """The shell's own files, where the word looks like one's name."""
    from click.shell_completion import CompletionItem

    looks = "/" in incomplete or "." in incomplete or any(Path().glob(f"{incomplete}*")) if incomplete else False
    return [CompletionItem(incomplete, type="file")] if looks else []


def install() -> None:
    """Make bash complete words with `=` inside, and put no blank behind one that is to be gone on with."""
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
