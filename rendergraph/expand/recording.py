"""First pass: every node that is needed records its requests, in reverse order."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path

from msgspec.structs import replace

from rendergraph.declare import Facts, Function, InOut, Input, Node, Part, Port, Views
from rendergraph.declare.blame import author_problem
from rendergraph.document import shown
from rendergraph.errors import InputError, Misuse, Problem, SceneError, is_interruption, node_named, suggestion
from rendergraph.glsl.source import needs
from rendergraph.link import Endpoint, Graph, GraphNode
from rendergraph.link.graph import depth_first
from rendergraph.steps import MOST_STEPS, StepRequest, Steps, UniformValue, define_text
from rendergraph.textures import BufferDesc, EnvironmentMap, SceneData, Semantic, Signature, TextureDesc

SCENE_DATA = Endpoint("", "the scene's data")
OF_SCENE: Mapping[Semantic | Signature, Endpoint] = {
    EnvironmentMap: Endpoint("", "the scene's environment"),
    SceneData: SCENE_DATA,
}
"""The sources of inputs that read the scene, if the file does not link them."""
_MOST_REQUESTS = 10 * MOST_STEPS
"""Maximum number of steps of one node, which might record endlessly."""


class Recording:
    """The `steps.Recorder` of one node.

    Attributes:
        unfilled: empty selections of objects that it would draw, if skipping them changes nothing.
        links: connected inputs whose textures have layers; those to `OF_SCENE` stand for the scene's.
    """

    def __init__(self, graph: Graph, node: GraphNode, used: set[str]) -> None:
        self.graph = graph
        self.node = node
        self.used_ports = used
        self.requests: list[StepRequest] = []
        self.unfilled: list[str] = []
        self.links = {name: tuple([e for e in ends if e.now not in graph.empty]) for name, ends in node.inputs.items()}
        for name, port in node.type.read.items():
            if port.takes_scene and not self.links.get(name) and graph.facts.of_scene(port.semantic):
                self.links[name] = (OF_SCENE[port.semantic],)
        self.own = {name: Endpoint(node.id, name) for name in node.type.written}
        self.defines = define_parameters(node.node, node.choices)
        self.uniforms = param_uniforms(node.node)
        self.includes = tuple([(name.upper(), file) for name, file in node.choices.items()])

    @cached_property
    def facts(self) -> Facts:
        graph, read = self.graph, self.node.type.read
        inputs = {
            name: graph.facts.of_scene(read[name].semantic)
            if ends[0] in OF_SCENE.values()
            else tuple([graph.textures[end.now] for end in ends if end.now in graph.textures])
            for name, ends in self.links.items()
            if ends
        }
        return replace(graph.facts, inputs=inputs)

    def run(self) -> str | None:
        """Call the node's `record`; return why the node is idle if it only leaves its inputs as they are."""
        node, ports = self.node, self.node.node.ports()
        steps = Steps(ports, node.id, node.type.name, self)  # pyright: ignore[reportArgumentType]  # cached facts
        try:
            _returns_nothing(node.node.record(steps))  # type: ignore[func-returns-value]  # third-party nodes may
        except InputError:
            raise
        except BaseException as error:  # anything that a node raises is its mistake
            if is_interruption(error):
                raise
            raise InputError(_author_problem(node, error)) from error
        if self.requests or not all(self.continues(ports[name]) for name in self.used_ports):
            return None
        if self.unfilled:
            return f"the scene has no {self.unfilled[0]} objects: there is nothing to draw"
        return "it recorded no step"

    def desc(self, port: Port) -> TextureDesc | BufferDesc:
        if isinstance(port, Input):
            return self.facts.input(port.name).storage
        return self.graph.textures[Endpoint(self.node.id, port.name)].storage

    def used(self, port: Port) -> bool:
        return port.name in self.used_ports

    def needs(self, parameter: str) -> tuple[str, ...]:
        return needs(self.node.choices[parameter]) if parameter in self.node.choices else ()

    def reads(self, out: Iterable[Part]) -> Mapping[str, Port]:
        """Return the inputs of a step that names none: all connected ones; only kept ones if it writes a kept port."""
        connected = {name: port for name, port in self.node.type.read.items() if self.links.get(name)}
        if any(is_kept(part.port) for part in out):
            return {name: port for name, port in connected.items() if all(map(self._lasts, self.links[name]))}
        return connected

    def _lasts(self, end: Endpoint) -> bool:
        return end in OF_SCENE.values() or is_kept(self.graph[end.node].node.ports()[end.port])

    def add(self, request: StepRequest) -> None:
        """Keep a request, unless it would draw nothing onto existing contents."""
        objects = request.options.get("objects")
        if isinstance(objects, tuple) and self.graph.knows_objects:
            names = [one.name for one in self.graph.facts.objects]
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
        """Refuse a condition on a step that does not exist or that the request does not depend on."""
        label = request.options.get("if_drawn")
        if not label:
            return
        labels = {one.options["label"]: one for one in self.requests if one.options.get("label")}
        if label not in labels:
            raise Misuse(f"if_drawn is '{label}', but no earlier step has that label{suggestion(label, labels)}")
        touched = {part_of(target).port.name for target in request.bindings.values()} | written_names(request)
        if touched.isdisjoint(written_names(labels[label])):
            raise Misuse(f"if_drawn is '{label}', but it neither reads nor continues what that step writes")

    def continues(self, port: Port) -> bool:
        """Whether a port continues the texture of another node."""
        return isinstance(port, InOut) and bool(self.links.get(port.name))

    def demands(self) -> list[Endpoint]:
        """Return the ports of other nodes that the recorded steps and the used functions read."""
        ports = self.node.node.ports()
        names: set[str] = set()
        for request in self.requests:
            for port in [part_of(target).port for target in request.reads]:
                names.add(port.name)
                if isinstance(port, Function):
                    names.update(port.read_names)
            names.update([name for name in written_names(request) if isinstance(ports[name], InOut)])
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
        return [end for name in names for end in self.links.get(name, ()) if end not in OF_SCENE.values()]


def part_of(target: Port | Part) -> Part:
    return target if isinstance(target, Part) else target.whole


def written_names(request: StepRequest) -> set[str]:
    """Return the names of the ports that a request writes."""
    return {part.port.name for _, part in request.out}


def is_kept(port: Port) -> bool:
    return bool(getattr(port, "kept", False))


def record_all(
    graph: Graph, order: list[str], outputs: Mapping[str, Endpoint]
) -> tuple[dict[str, Recording], dict[str, str]]:
    """Record every node that an output needs; return recordings in order, and idle nodes with their reasons."""
    history_readers = _history_readers(graph, outputs)
    while True:
        recordings, idle = _record(graph, order, outputs, history_readers, {})
        if not history_readers & idle.keys():
            return recordings, idle
        history_readers -= idle.keys()  # idle nodes do not read last frame's values either


def _history_readers(graph: Graph, outputs: Mapping[str, Endpoint]) -> set[str]:
    """Return the nodes that read last frame's values and contribute to an output."""
    ends = {node.id: [end for ends in node.inputs.values() for end in ends] for node in graph.nodes}
    readers = {name for name, found in ends.items() if any(end.previous for end in found)}
    if not readers:
        return readers
    sources = {name: [end.node for end in found] for name, found in ends.items()}
    reached = depth_first(sources, [end.node for end in outputs.values()])
    return readers.intersection(reached)


def _record(
    graph: Graph,
    order: list[str],
    outputs: Mapping[str, Endpoint],
    history_readers: set[str],
    demanded_before: Mapping[str, set[str]],
) -> tuple[dict[str, Recording], dict[str, str]]:
    """Record nodes in reverse order; `history_readers` may precede the nodes whose last values they read.

    In a cycle of nodes, a node may be recorded before some of its readers: `demanded_before` has what they read.
    """
    demanded: dict[str, set[str]] = {name: set(demanded_before.get(name, ())) for name in order}
    told: dict[str, int] = {}

    def demand(ends: Iterable[Endpoint]) -> None:
        for end in ends:
            demanded[end.node].add(end.port)

    demand(outputs.values())
    for name in history_readers:
        demand(end for ends in graph[name].inputs.values() for end in ends if end.previous)
    recordings: dict[str, Recording] = {}
    idle: dict[str, str] = {}
    reached: set[str] = set()  # nodes that are demanded, and those that would be if their textures had layers
    for name in reversed(order):
        node = graph[name]
        used = demanded[name]
        told[name] = len(used)
        if not used:
            idle[name] = _why_unread(graph, node, reached)
            continue
        reached.add(name)
        recording = Recording(graph, node, used)
        if reason := _why_idle(graph, node, used) or recording.run():
            idle[name] = reason
            demand(end for port in used for end in node.inputs.get(port, ()))
        else:
            recordings[name] = recording
            demand(recording.demands())
    if graph.cyclic and any(len(demanded[name]) > count for name, count in told.items()):
        return _record(graph, order, outputs, history_readers, demanded)
    return {name: recordings[name] for name in order if name in recordings}, idle


def _why_unread(graph: Graph, node: GraphNode, reached: set[str]) -> str:
    for name in node.node.outputs():
        end = Endpoint(node.id, name)
        links = (ends for reader in graph.nodes if reader.id in reached for ends in reader.inputs.values())
        if end in graph.empty and any(end in ends for ends in links):
            reached.add(node.id)
            return f"{end} has no layers: {_why_empty(graph, node, name)}"
    return "no requested output depends on it"


def _why_empty(graph: Graph, node: GraphNode, name: str) -> str:
    """Explain why a texture has no layers, as far as its declaration shows."""
    ports = node.node.ports()
    named = [getattr(ports[name], rule, None) for rule in ("like", "lights", "view")]
    for source in named:
        ends = node.inputs.get(source, ()) if isinstance(source, str) else ()
        if ends and ends[0].now in graph.empty:
            return f"{ends[0]} has none"
    tables = [ports[source] for source in named if isinstance(source, str) and isinstance(ports.get(source), Views)]
    if all(getattr(port, "lights", None) is None for port in (ports[name], *tables)):
        return "there is nothing to draw"
    kinds = Counter(light.type for light in graph.facts.lights)
    listed = " and ".join(f"{count} {kind}" for kind, count in kinds.items())
    return f"it uses none of the scene's lights ({listed})" if listed else "the scene has no light"


def _why_idle(graph: Graph, node: GraphNode, used: set[str]) -> str | None:
    if not graph.empty:
        return None
    if all(Endpoint(node.id, name) in graph.empty for name in used):
        return f"{node.id}.{min(used)} has no layers: {_why_empty(graph, node, min(used))}"
    for name, port in node.type.read.items():
        ends = node.inputs.get(name, ())
        if ends and not port.optional and all(end.now in graph.empty for end in ends):
            return f"{ends[0]} has no layers: there is nothing to read"
    return None


def _returns_nothing(value: object) -> None:
    """Refuse a `record` that returns something: with `yield` or `async` in it, it has not run at all."""
    if value is not None:
        close = getattr(value, "close", None)
        if callable(close):
            close()
        raise Misuse(f"`record` returned a {type(value).__name__}; it must call steps.… and return nothing")


def _author_problem(node: GraphNode, error: BaseException) -> Problem:
    who = node_named(node.id, node.type.name)
    if isinstance(error, SceneError):
        subject = f"{node.id}.{error.subject}"
        return Problem("RG209", f"{who}: {shown(error, 200)}", node.place, subject=subject)
    problem = author_problem(error, type(node.node), node.type.file)
    if isinstance(error, Misuse):
        return problem.relocate(node.place, code=error.code, context=who)
    return problem.relocate(node.place, context=f"{who} failed while recording")


def define_parameters(node: Node, choices: Mapping[str, Path]) -> tuple[tuple[str, str], ...]:
    """Return the macros of `define` parameters: numbers and switches as they are, a choice as one of its numbers."""
    macros: list[tuple[str, str]] = []
    for name, parameter in node.parameters().items():
        if parameter.role != "define":
            continue
        value = getattr(node, name)
        if name in choices:
            macros += [(f"NEEDS_{need}".upper(), "1") for need in needs(choices[name])]
        elif isinstance(value, str):
            words = [f"{name}_{choice}".upper().replace("-", "_") for choice in parameter.words]
            macros += [(word, str(number)) for number, word in enumerate(words)]
            macros.append((name.upper(), f"{name}_{value}".upper().replace("-", "_")))
        else:
            macros.append((name.upper(), define_text(value)))
    return tuple(macros)


def param_uniforms(node: Node) -> tuple[tuple[str, UniformValue], ...]:
    """Return the values of `param` parameters; a number given for a vector fills it."""
    uniforms: list[tuple[str, UniformValue]] = []
    for name, parameter in node.parameters().items():
        if parameter.role == "param":
            value = getattr(node, name)
            if parameter.glsl.startswith("vec") and not isinstance(value, tuple):
                value = (float(value),) * int(parameter.glsl[3])
            uniforms.append((name, value))
    return tuple(uniforms)
