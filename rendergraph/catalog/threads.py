"""What the node of a shader file records: one full-screen pass, or one dispatch over its threads."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

from rendergraph.catalog.entries import Entries
from rendergraph.catalog.rules import number_rule
from rendergraph.declare import Input, Node, Port, WrittenPort
from rendergraph.steps import Steps

if TYPE_CHECKING:
    from rendergraph.document import Value

Record: TypeAlias = "Callable[[Any, Steps], None]"
Threads: TypeAlias = "Callable[[Node, Steps], tuple[int, ...]]"


def fullscreen(entries: Entries) -> Record:
    """Its fragment shader over the whole target."""
    file = entries.file.name
    ordered = entries.in_locations()

    def record(self: Node, steps: Steps) -> None:
        if not ordered:
            steps.fullscreen(file)
            return
        ports = self.ports()  # the text says which attachment is which, so none of them is left out
        steps.fullscreen(file, out={name: ports[name] for name in ordered})

    return record


def compute(entries: Entries) -> Record:
    """Its compute shader, with as many groups as its threads need."""
    file = entries.file.name
    local = tuple(_local(entries, f"local_size_{axis}") for axis in "xyz")
    if not any(f"local_size_{axis}" in entries.globals.input_layout for axis in "xyz"):
        text = "a compute shader says how many threads a group has: layout(local_size_x = 8, local_size_y = 8) in;"
        entries.say("RG443", text, None)
    threads = _threads(entries)
    outputs = [name for name, port in entries.ports.items() if isinstance(port, WrittenPort)]

    def record(self: Node, steps: Steps) -> None:
        wanted = (*threads(self, steps), 1, 1)[:3]
        x, y, z = (max(1, -(-count // size)) for count, size in zip(wanted, local, strict=True))
        ports = self.ports()
        steps.compute(file, groups=(x, y, z), out={name: ports[name] for name in outputs})

    return record


def _local(entries: Entries, name: str) -> int:
    words = entries.globals.input_layout.get(name)
    if words is None:
        return 1
    try:
        value = entries.globals.number(words)
    except ValueError as error:
        entries.say("RG443", f"{name}: {error}", None)
        return 1
    if 1 <= value <= 1024:
        return value
    entries.say("RG443", f"{name} is a whole number from 1 to 1024, not {value}", None)
    return 1


def _threads(entries: Entries) -> Threads:
    """How many threads there are: those of a port's texels, or as many as the header says."""
    said = entries.header.threads
    if said is not None and not isinstance(said.data, str):
        return _counted(said)
    if said is not None and str(said.data).startswith("$"):
        return _counted(said)
    textures = [name for name, port in entries.ports.items() if isinstance(port, WrittenPort) and port.kind != "buffer"]
    name = str(said.data) if said is not None else (textures[0] if textures else "")
    port = entries.ports.get(name)
    if not isinstance(port, Input | WrittenPort) or port.kind == "buffer":
        if said is not None:
            entries.problems.append(said.problem("RG443", f"'threads' names no texture of this node: '{name}'"))
        else:
            text = "it makes no texture whose texels would be its threads; say threads: INPUT or threads: [x, y] above"
            entries.say("RG443", text, None)
    return lambda node, steps: _texels(node.ports()[name], steps)


def _counted(said: Value) -> Threads:
    rules = [number_rule(part) for part in (said.data if isinstance(said.data, list) else [said])]
    return lambda node, steps: tuple(rule if isinstance(rule, int) else rule(node, steps.facts) for rule in rules)


def _texels(port: Port, steps: Steps) -> tuple[int, ...]:
    if isinstance(port, Input) and not steps.connected(port):
        return (1,)
    desc = steps.desc(port)
    return desc.width, desc.height, desc.layers
