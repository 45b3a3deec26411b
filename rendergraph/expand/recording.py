"""First pass: every node that is needed records its requests, the last ones first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from functools import cached_property

from msgspec.structs import replace

from rendergraph.declare import Facts, Function, InOut, Input, Part, Port, Views
from rendergraph.declare.blame import happened
from rendergraph.document import shown
from rendergraph.errors import InputError, Misuse, Problem, SceneError, is_interruption, node_named, suggestion
from rendergraph.expand.model import ENVIRONMENT
from rendergraph.expand.parameters import define_parameters, param_uniforms
from rendergraph.glsl.source import needs
from rendergraph.link import Endpoint, Graph, GraphNode
from rendergraph.steps import MOST_STEPS, StepRequest, Steps
from rendergraph.textures import BufferDesc, TextureDesc

_MOST_REQUESTS = 10 * MOST_STEPS
"""Of one node, which might record without end; so many are told before they take all memory."""


class Recording:
    """The `steps.Recorder` of one node: keeps requests, answers what is known.

    Attributes:
        requests: what the node asked for, in order.
        unfilled: what it asked to draw and the scene has nothing of; left out where that changes nothing.
        links: connected inputs whose textures have layers; `ENVIRONMENT` stands for the scene's.
        own: the ends of the textures and buffers that the node makes or continues, by port.
        defines, uniforms, includes: what its parameters give to each of its steps.
    """

    def __init__(self, graph: Graph, node: GraphNode, used: set[str]) -> None:
        self.graph = graph
        self.node = node
        self.used_ports = used
        self.requests: list[StepRequest] = []
        self.unfilled: list[str] = []
        self.links: dict[str, tuple[Endpoint, ...]] = dict(node.inputs)
        if graph.empty:
            self.links = {
                name: tuple([e for e in ends if e.now not in graph.empty]) for name, ends in node.inputs.items()
            }
        if graph.environment is not None:
            around = [name for name, port in node.type.read.items() if port.takes_scene and not self.links.get(name)]
            self.links |= dict.fromkeys(around, (ENVIRONMENT,))
        self.own = {name: Endpoint(node.id, name) for name in node.type.written}
        self.defines = define_parameters(node.node, node.choices)
        self.uniforms = param_uniforms(node.node)
        self.includes = tuple([(name.upper(), file) for name, file in node.choices.items()])

    # What `steps.Recorder` promises to nodes ------------------------------------------------------------------------

    @property
    def facts(self) -> Facts:
        """What the node may ask."""
        return self._facts

    @cached_property
    def _facts(self) -> Facts:
        graph = self.graph
        facts = Facts(graph.size, graph.lights, objects=graph.objects or (), environment=graph.environment)
        inputs = {
            name: facts.of_scene
            if ends == (ENVIRONMENT,)
            else tuple([graph.textures[end.now] for end in ends if end.now in graph.textures])
            for name, ends in self.links.items()
            if ends
        }
        return replace(facts, inputs=inputs)

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
        """What the choice of a parameter needs."""
        return needs(self.node.choices[parameter]) if parameter in self.node.choices else ()

    def reads(self, out: Iterable[Part]) -> Mapping[str, Port]:
        """The inputs that a step reads which names none: those connected; what is kept reads those that are kept."""
        connected = {name: port for name, port in self.node.type.read.items() if self.links.get(name)}
        if any(is_kept(part.port) for part in out):
            return {name: port for name, port in connected.items() if all(map(self._lasts, self.links[name]))}
        return connected

    def _lasts(self, end: Endpoint) -> bool:
        return end == ENVIRONMENT or is_kept(self.graph[end.node].node.ports()[end.port])

    def add(self, request: StepRequest) -> None:
        """Keep a request, unless it would draw nothing onto what is there already."""
        objects = request.options.get("objects")
        if isinstance(objects, tuple) and self.graph.objects is not None:
            names = [one.name for one in self.graph.objects]
            for name in objects:
                if name not in names:
                    text = f"it draws object '{name}', which the scene does not have{suggestion(name, names)}"
                    raise Misuse(text, "RG431")
        if request.kind == "geometry" and objects in self.graph.unfilled:
            begun = {part for earlier in self.requests for _, part in earlier.out}
            if all(part in begun or self.continues(part.port) for _, part in request.out):
                self.unfilled.append(objects)
                return
        self._check_condition(request)
        if request.kind == "geometry" and request.options["topology"] == "triangles_adjacency":
            for one in self.facts.drawn(objects or "all"):
                if not one.closed:
                    raise SceneError(one.gap, one.name)
        if len(self.requests) == _MOST_REQUESTS:
            raise Misuse(f"it records more than {_MOST_REQUESTS} steps", "RG606")
        self.requests.append(request)

    def _check_condition(self, request: StepRequest) -> None:
        """Refuse a step that is to be left out after one that is not there, or that it need not follow."""
        label = request.options.get("if_drawn")
        if not label:
            return
        labels = {one.options["label"]: one for one in self.requests if one.options.get("label")}
        if label not in labels:
            raise Misuse(f"if_drawn is '{label}', but no earlier step has that label{suggestion(label, labels)}")
        named = [*request.bindings.values(), *(part for _, part in request.out)]
        touched = {(target.port if isinstance(target, Part) else target).name for target in named}
        if touched.isdisjoint(part.port.name for _, part in labels[label].out):
            raise Misuse(f"if_drawn is '{label}', but it neither reads nor continues what that step writes")

    def continues(self, port: Port) -> bool:
        """Whether a port goes on with a texture of somebody else's."""
        return isinstance(port, InOut) and bool(self.links.get(port.name))

    def demands(self) -> list[Endpoint]:
        """The ports of other nodes that the recorded steps and the used functions read."""
        ports = self.node.node.ports()
        names: set[str] = set()
        for request in self.requests:
            for target in request.bindings.values():
                port = target.port if isinstance(target, Part) else target
                names.add(port.name)
                if isinstance(port, Function):
                    names.update(port.read_names)
            names.update([part.port.name for _, part in request.out if isinstance(part.port, InOut)])
            view = request.options.get("view")
            if isinstance(view, Input):
                names.add(view.name)
        if self.requests and "view" in self.links:
            names.add("view")
        for name in self.used_ports:
            used = ports.get(name)
            if isinstance(used, Function):
                names.update(used.read_names)
            elif isinstance(used, InOut):  # whether or not a step writes it
                names.add(name)
        return [end for name in names for end in self.links.get(name, ()) if end != ENVIRONMENT]


def is_kept(port: Port) -> bool:
    """Whether what a port makes outlives the frame."""
    return bool(getattr(port, "kept", False))


def record_all(
    graph: Graph, order: list[str], wanted: Mapping[str, Endpoint]
) -> tuple[dict[str, Recording], dict[str, str]]:
    """Record every node that something wanted needs; the others are idle, with the reason.

    Args:
        graph: a checked graph.
        order: node ids in reading order.
        wanted: what must exist at the end of the frame.

    Returns:
        Recordings by node id in the same order, and idle nodes with their reasons.
    """
    remembering = _remembering(graph, wanted)
    while True:
        recordings, idle = _recorded(graph, order, wanted, remembering)
        if not remembering & idle.keys():
            return recordings, idle
        remembering -= idle.keys()  # whoever does nothing does not read last frame's values either


def _remembering(graph: Graph, wanted: Mapping[str, Endpoint]) -> set[str]:
    """Nodes that read last frame's values and that something wanted can be reached from."""
    remembering = {node.id for node in graph.nodes for ends in node.inputs.values() for end in ends if end.previous}
    reached: set[str] = set()
    stack = [end.node for end in wanted.values()] if remembering else []
    while stack:
        name = stack.pop()
        if name not in reached:
            reached.add(name)
            stack += [end.node for ends in graph[name].inputs.values() for end in ends]
    return remembering & reached


def _recorded(
    graph: Graph, order: list[str], wanted: Mapping[str, Endpoint], remembering: set[str]
) -> tuple[dict[str, Recording], dict[str, str]]:
    """The same where it is known who reads last frame's values; those may come earlier in the order than the makers."""
    demanded: dict[str, set[str]] = {name: set() for name in order}
    for end in wanted.values():
        demanded[end.node].add(end.port)
    for name in remembering:
        for ends in graph[name].inputs.values():
            for end in ends:
                if end.previous:
                    demanded[end.node].add(end.port)
    recordings: dict[str, Recording] = {}
    idle: dict[str, str] = {}
    reached: set[str] = set()  # nodes that are demanded, and those that would be if what they make had layers
    for name in reversed(order):
        node = graph[name]
        used = demanded[name]
        if not used:
            idle[name] = _unread(graph, node, reached)
            continue
        reached.add(name)
        reason = _nothing_to_do(graph, node, used)
        if reason:
            idle[name] = reason
            _pass_on(node, used, demanded)
            continue
        recording = Recording(graph, node, used)
        steps = Steps(node.node.ports(), name, node.type.name, recording)
        try:
            _returns_nothing(node.node.record(steps))  # type: ignore[func-returns-value]  # a stranger's may
        except InputError:
            raise
        except BaseException as error:  # whatever a stranger's node raises is a mistake in that node
            if is_interruption(error):
                raise
            raise InputError(_author_problem(node, error)) from error
        ports = node.node.ports()
        if not recording.requests and all(recording.continues(ports[port]) for port in used):
            idle[name] = (
                f"the scene has no {recording.unfilled[0]} objects: there is nothing to draw"
                if recording.unfilled
                else "it recorded no step"
            )
            _pass_on(node, used, demanded)
            continue
        recordings[name] = recording
        for end in recording.demands():
            demanded[end.node].add(end.port)
    return {name: recordings[name] for name in order if name in recordings}, idle


def _unread(graph: Graph, node: GraphNode, reached: set[str]) -> str:
    """Why nobody reads a node: nothing is linked to it that is wanted, or what would be read has no layers."""
    for name in node.node.outputs():
        end = Endpoint(node.id, name)
        links = (ends for reader in graph.nodes if reader.id in reached for ends in reader.inputs.values())
        if end in graph.empty and any(end in ends for ends in links):
            reached.add(node.id)
            return f"{end} has no layers: {_no_layers(graph, node, name)}"
    return "nothing that is wanted reads its outputs"


def _no_layers(graph: Graph, node: GraphNode, name: str) -> str:
    """Why a texture has no layers, as far as that shows in its declaration."""
    ports = node.node.ports()
    named = [getattr(ports[name], rule, None) for rule in ("like", "lights", "view")]
    for source in named:
        ends = node.inputs.get(source, ()) if isinstance(source, str) else ()
        if ends and ends[0].now in graph.empty:
            return f"{ends[0]} has none"
    tables = [ports[source] for source in named if isinstance(source, str) and isinstance(ports.get(source), Views)]
    if all(getattr(port, "lights", None) is None for port in (ports[name], *tables)):
        return "there is nothing to draw"
    kinds = Counter(light.type for light in graph.lights)
    listed = " and ".join(f"{count} {kind}" for kind, count in kinds.items())
    return f"it takes none of the scene's lights ({listed})" if listed else "the scene has no light"


def _pass_on(node: GraphNode, used: set[str], demanded: Mapping[str, set[str]]) -> None:
    """What an idle node would continue is demanded as it is."""
    for port in used:
        for end in node.inputs.get(port, ()):
            demanded[end.node].add(end.port)


def _nothing_to_do(graph: Graph, node: GraphNode, used: set[str]) -> str | None:
    """Why a node has nothing to record: what it would draw, or what it must read, has no layers."""
    if not graph.empty:
        return None
    if all(Endpoint(node.id, name) in graph.empty for name in used):
        return f"{node.id}.{min(used)} has no layers: {_no_layers(graph, node, min(used))}"
    for name, port in node.type.read.items():
        ends = node.inputs.get(name, ())
        if ends and not port.optional and all(end.now in graph.empty for end in ends):
            return f"{ends[0]} has no layers: there is nothing to read"
    return None


def _returns_nothing(value: object) -> None:
    """A `record` with `yield` or `async` in it has not run at all."""
    if value is not None:
        close = getattr(value, "close", None)
        if callable(close):
            close()
        raise Misuse(f"`record` gives back a {type(value).__name__}; it calls steps.… and returns nothing")


def _author_problem(node: GraphNode, error: BaseException) -> Problem:
    """What a node's own code raised or asked for wrongly, with the author's line."""
    who = node_named(node.id, node.type.name)
    if isinstance(error, SceneError):
        return Problem("RG209", f"{who}: {shown(error, 200)}", node.place)
    problem = happened(error, type(node.node), node.type.file)
    if isinstance(error, Misuse):
        return problem.relocate(node.place, code=error.code, context=who)
    return problem.relocate(node.place, context=f"{who} failed while recording")
