"""First pass: every node that is needed records its requests, the last ones first."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from rendergraph.declare import Facts, Function, InOut, Input, Part, Port
from rendergraph.errors import InputError, Problem
from rendergraph.expand.model import is_empty
from rendergraph.link import Endpoint, Graph, GraphNode
from rendergraph.steps import Request, Steps
from rendergraph.textures import BufferDesc, TextureDesc


class Recorder:
    """The `steps.Recorder` of one node: keeps requests, answers what is known.

    Attributes:
        requests: what the node asked for, in order.
        links: connected inputs whose textures have layers.
        facts: what the node may ask.
    """

    def __init__(self, graph: Graph, node: GraphNode, used: set[str]) -> None:
        self.graph = graph
        self.node = node
        self.used_ports = used
        self.requests: list[Request] = []
        self.links = {
            name: tuple(end for end in ends if not is_empty(graph.textures.get(now(end))))
            for name, ends in node.inputs.items()
        }
        self.facts = Facts(
            viewport=graph.size,
            lights=graph.lights,
            inputs={
                name: tuple(graph.textures[now(end)] for end in ends if now(end) in graph.textures)
                for name, ends in self.links.items()
                if ends
            },
        )

    # What `steps.Recorder` promises to nodes ------------------------------------------------------------------------

    def desc(self, port: Port) -> TextureDesc | BufferDesc:
        """What a port's texture or buffer is allocated from."""
        if isinstance(port, Input):
            found = self.facts.input(port.name).desc
            return found if found is not None else BufferDesc(self.facts.input(port.name).bytes)
        info = self.graph.textures[Endpoint(self.node.id, port.name)]
        return info.desc if info.desc is not None else BufferDesc(info.bytes)

    def used(self, port: Port) -> bool:
        """Whether anybody reads an output."""
        return port.name in self.used_ports

    def needs(self, parameter: str) -> tuple[str, ...]:
        """What a plugin's choice of a parameter needs."""
        choice = self.node.choices.get(parameter)
        return choice.needs if choice is not None else ()

    def add(self, request: Request) -> None:
        """Keep a request."""
        self.requests.append(request)

    def reads_of(self, request: Request) -> Iterator[tuple[str, Port | Part]]:
        """Names and ports a request reads, with the default inputs filled in."""
        if not request.default_inputs:
            yield from request.bindings.items()
            return
        for name, port in self.node.node.inputs().items():
            if isinstance(port, Input) and self.links.get(name):
                yield name, port

    def demands(self) -> Iterator[Endpoint]:
        """The ports of other nodes that the recorded steps and the used functions read."""
        ports = self.node.node.ports()
        names: set[str] = set()
        for request in self.requests:
            for _, target in self.reads_of(request):
                port = target.port if isinstance(target, Part) else target
                names |= {port.name, *(port.read_names if isinstance(port, Function) else ())}
            names |= {part.port.name for _, part in request.out if isinstance(part.port, InOut)}
            view = request.options.get("view")
            names |= {view.name} if isinstance(view, Input) else set()
            if "view" in self.links:
                names.add("view")
        for name in self.used_ports:
            used = ports.get(name)
            if isinstance(used, Function):
                names.update(used.read_names)
        for name in names:
            yield from self.links.get(name, ())


def now(end: Endpoint) -> Endpoint:
    """The port itself, also where last frame's value is meant."""
    return replace(end, previous=False) if end.previous else end


def record_all(
    graph: Graph, order: list[str], wanted: Mapping[str, Endpoint]
) -> tuple[dict[str, Recorder], dict[str, str]]:
    """Record every node that something wanted needs; the others are idle, with the reason.

    Args:
        graph: a checked graph.
        order: node ids in topological order.
        wanted: what must exist at the end of the frame.

    Returns:
        Recorders by node id in the same order, and idle nodes with their reasons.
    """
    demanded: dict[str, set[str]] = {name: set() for name in order}
    for end in wanted.values():
        demanded[end.node].add(end.port)
    for node in graph.nodes:  # last frame's readers may come earlier in the order, so all of them count
        for ends in node.inputs.values():
            for end in ends:
                if end.previous:
                    demanded[end.node].add(end.port)
    recorders: dict[str, Recorder] = {}
    idle: dict[str, str] = {}
    for name in reversed(order):
        node = graph[name]
        used = demanded[name]
        if not used:
            idle[name] = "nothing that is wanted reads its outputs"
            continue
        reason = _nothing_to_do(graph, node, used)
        if reason:
            idle[name] = reason
            for port in used:  # what it would continue is passed on as it is
                for end in node.inputs.get(port, ()):
                    demanded[end.node].add(end.port)
            continue
        recorder = Recorder(graph, node, used)
        steps = Steps(node.node, name, node.type.name, recorder)
        try:
            node.node.record(steps)
        except InputError:
            raise
        except Exception as error:  # whatever a stranger's node raises is a mistake in that node
            raise InputError(author_problem(node, error)) from error
        recorders[name] = recorder
        for end in recorder.demands():
            demanded[end.node].add(end.port)
    return {name: recorders[name] for name in order if name in recorders}, idle


def _nothing_to_do(graph: Graph, node: GraphNode, used: set[str]) -> str | None:
    """Why a node has nothing to record: what it would draw, or what it must read, has no layers."""
    made = [graph.textures.get(Endpoint(node.id, name)) for name in used]
    if made and all(is_empty(info) for info in made):
        return f"{node.id}.{min(used)} has no layers: there is nothing to draw"
    for name, port in node.node.inputs().items():
        ends = node.inputs.get(name, ())
        required = isinstance(port, Input) and not port.optional
        if required and ends and all(is_empty(graph.textures.get(now(end))) for end in ends):
            return f"{ends[0]} has no layers: there is nothing to read"
    return None


def author_line(node: GraphNode, error: Exception) -> str:
    """The line of the node's own module that an error came through, as `file:line: `; empty where there is none."""
    import traceback

    frames = [f for f in traceback.extract_tb(error.__traceback__) if f.filename == str(node.type.file)]
    return f"{frames[-1].filename}:{frames[-1].lineno}: " if frames else ""


def author_problem(node: GraphNode, error: Exception) -> Problem:
    """What a node's own code raised, with the author's line."""
    where = author_line(node, error)
    text = f"node '{node.id}' ({node.type.name}) failed while recording: {where}{type(error).__name__}: {error}"
    return Problem("RG420", text, node.place)


def topological(graph: Graph) -> list[str]:
    """Node ids so that each stands behind what it reads in this frame; the file's order where that leaves a choice."""
    import networkx as nx

    dag: nx.DiGraph[str] = nx.DiGraph()
    dag.add_nodes_from(graph.dag.nodes)
    dag.add_edges_from((a, b) for a, b, data in graph.dag.edges(data=True) if not data["previous"])
    place = {name: number for number, name in enumerate(dag)}
    return list(nx.lexicographical_topological_sort(dag, key=place.__getitem__))
