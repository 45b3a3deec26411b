"""Link a PipelineSpec into a Graph: find types, check parameters, connect ports, infer textures; gather all errors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from msgspec.structs import replace

from rendergraph.catalog import Catalog, NodeType
from rendergraph.declare import CameraFacts, Facts, Input, LightFacts, MaterialFacts, TextureInfo
from rendergraph.document import Value
from rendergraph.errors import InputError, Option, Problem, suggestion
from rendergraph.facts import ObjectFacts, SceneDataFacts
from rendergraph.keys import MOST_PROBLEMS
from rendergraph.link.check import Ancestors, Checker, cycles, needs, port_kind, sources, versions
from rendergraph.link.graph import Endpoint, Graph, GraphNode, upstream_first
from rendergraph.link.infer import TextureInference
from rendergraph.link.instances import choice_files, instance, stand_in, unknown_type
from rendergraph.link.nodes import (
    Connector,
    Link,
    References,
    UnlinkedNode,
    bypass,
    line_of,
    mark_without_environment,
    missing_source,
    remove_disabled,
)
from rendergraph.resolve import NodeSpec, PipelineSpec
from rendergraph.textures import SEMANTICS, TEXTURE_KINDS, Radiance, TextureDesc


def link(
    spec: PipelineSpec,
    catalog: Catalog,
    lights: Sequence[LightFacts] = (),
    objects: Sequence[ObjectFacts] | None = None,
    environment: TextureDesc | None = None,
    scene_data: Callable[[bool], SceneDataFacts] = lambda rays: SceneDataFacts(),
    materials: Sequence[MaterialFacts] = (),
    camera: CameraFacts = CameraFacts(),
) -> Graph:
    """Return the checked graph, or raise with all mistakes, those in `spec.problems` included.

    Args:
        lights: the scene's lights in its order; sizes and layers may depend on them.
        objects: the scene's objects; None without a scene, where any may exist.
        scene_data: called if a node reads the scene's data, with whether rays are traced in it.
    """
    given, made_of = tuple(objects or ()), tuple(materials)
    facts = Facts(spec.size, tuple(lights), objects=given, environment=environment, materials=made_of, camera=camera)
    return _Linker(spec, catalog, facts, objects is not None, scene_data).graph()


def sketch(
    spec: PipelineSpec, catalog: Catalog, lights: Sequence[LightFacts] = (), environment: TextureDesc | None = None
) -> tuple[Graph, tuple[Problem, ...]]:
    """Return a graph for display, in which node types may be missing, and the problems about these."""
    try:
        return link(spec, catalog, lights, environment=environment), ()
    except InputError as error:
        linker = _Linker(spec, catalog, Facts(spec.size, tuple(lights), environment=environment), sketching=True)
        graph = linker.graph()
        lacking = {*linker.missing, *(problem for problem in spec.problems if problem.code == "RG130")}
        if any(problem not in lacking for problem in error.problems):
            raise
        return graph, error.problems


def fitting(
    spec: PipelineSpec,
    catalog: Catalog,
    lights: Sequence[LightFacts] = (),
    objects: Sequence[ObjectFacts] | None = None,
    environment: TextureDesc | None = None,
) -> dict[str, dict[str, list[str]]]:
    """Return for each input of each node the links that fit it, by id and name; for a group of inputs, ids of nodes.

    A file with mistakes is linked as far as possible.
    """
    facts = Facts(spec.size, tuple(lights), objects=tuple(objects or ()), environment=environment)
    linker = _Linker(spec, catalog, facts, objects is not None, sketching=True)
    graph, checker = linker.graph(), linker.checker
    ends = {str(end): end for end in checker.textures if end.port in checker.nodes[end.node].type.cls.outputs()}
    ends |= {name: end for name, end in graph.aliases.items() if end in checker.textures}
    found: dict[str, dict[str, list[str]]] = {}
    for id, draft in checker.nodes.items():
        others = {text: end for text, end in ends.items() if end.node != id}
        links = {}
        for name, port in draft.inputs.items():
            fit = {text: end for text, end in others.items() if checker.fits(draft, port, end)}
            meant = [text for text, end in fit.items() if checker.textures[end].semantic.name != "any"]
            links[name] = meant or [*fit]  # `any` fits everywhere, but is rarely what is wanted
        for group, members in draft.type.cls.groups().items():
            needed = [name for name in members if not draft.inputs[name].optional] or members
            ids = dict.fromkeys(text.rpartition(".")[0] for text in others)
            links[group] = [one for one in ids if all(f"{one}.{name}" in links[name] for name in needed)]
        found[id] = links
    return found


def endpoint(graph: Graph, text: str) -> Endpoint:
    """Return the port that `node.port` names, internals included; for taps."""
    if text in graph.aliases:
        return graph.aliases[text]
    node, _, port = text.rpartition(".")
    if not node and any(end.node == text for end in graph.textures):
        ends = [Endpoint(text, name) for name in graph[text].type.cls.outputs()]
        held = [str(end) for end in ends if end in graph.textures and graph.textures[end].holds_values]
        raise InputError(Problem("RG109", f"'{text}' is a node, not a port; write one of {', '.join(held[:20])}"))
    names = [known.id for known in graph.nodes]
    if node in graph.unlit:
        text = f"node '{node}' is left out: the scene has no environment; give it one (--environment)"
        raise InputError(Problem("RG132", text))
    if node in graph.disabled:
        text = f"node '{node}' is disabled, and nothing replaces '{port}'; enable it"
        raise InputError(Problem("RG132", text))
    if node not in names:
        hint = suggestion(node or text, names) if node else f"; write NODE.PORT{suggestion(text, names)}"
        raise InputError(Problem("RG109", f"there is no node '{node or text}'{hint}"))
    ports = [end.port for end, info in graph.textures.items() if end.node == node and info.holds_values]
    found = Endpoint(node, port)
    if found not in graph.textures:
        raise InputError(Problem("RG112", f"node '{node}' has no output '{port}'{suggestion(port, ports)}"))
    if not graph.textures[found].holds_values:
        raise InputError(Problem("RG129", f"'{text}' holds no texture; there is nothing to show"))
    return found


class _Linker:
    """Links one pipeline.

    Attributes:
        missing: problems about types that are missing or cannot be used.
        written: nodes by id as in the file.
        nodes: those that remain without the removed ones, whose links are bypassed.
    """

    def __init__(
        self,
        spec: PipelineSpec,
        catalog: Catalog,
        facts: Facts,
        knows_objects: bool = False,
        scene_data: Callable[[bool], SceneDataFacts] = lambda rays: SceneDataFacts(),
        sketching: bool = False,
    ) -> None:
        self.spec, self.catalog = spec, spec.catalog or catalog
        self.knows_objects, self.sketching = knows_objects, sketching
        self.missing: list[Problem] = []
        self.problems: list[Problem] = []
        self.warnings: list[Problem] = []
        self.types = self._types()
        self.references = References(spec, self.types)
        self.written = {id: self._bind(node) for id, node in spec.nodes.items() if id in self.types}
        connector = Connector(spec, self.catalog, self.references, self._report)
        for draft in self.written.values():
            connector.connect(draft)
        if facts.environment is None:
            mark_without_environment(self.written)
        self.nodes = remove_disabled(self.written, self.references)
        for draft in self.nodes.values():
            connector.complete(draft, self.written)
        self.outputs = self._outputs()
        scenes = [port for draft in self.nodes.values() for port in draft.inputs.values() if port.kind == "scene"]
        if scenes:
            facts = replace(facts, scene_data=scene_data(any(getattr(port, "rays", False) for port in scenes)))
        used = {found.source for found in self.outputs.values()}
        used |= {end.source for draft in self.nodes.values() for links in draft.links.values() for end in links}
        self.infer = TextureInference(self.nodes, facts, used)

    def graph(self) -> Graph:
        nodes, infer = self.nodes, self.infer
        order = upstream_first(sources(nodes))
        has_cycle = len(order) < len(nodes)  # of nodes, though their steps may form none
        cyclic = cycles(nodes) if has_cycle else []
        if has_cycle:
            infer.before = Ancestors(nodes)
        overwritten: Mapping[tuple[str, str], Problem] = {}
        self.problems += cyclic
        if not cyclic:
            found, overwritten = versions(nodes)
            self.problems += needs(nodes, self.outputs, self.written) + found
            self._check_subgraph_inputs()
            self._warn_of_unused_settings()
        textures: dict[Endpoint, TextureInfo] = {}
        if not cyclic or self.sketching:
            textures = self._textures(nodes if cyclic else dict.fromkeys([*order, *nodes]))
            self.checker = Checker(nodes, textures, infer, self.catalog)
        if not cyclic:
            self.problems += self.checker.check()
            self._check_outputs()
        type_warnings = dict.fromkeys(warning for one in self.types.values() for warning in one.warnings)
        members = {name: _member(draft, infer) for name, draft in nodes.items()}
        self.problems += infer.problems if not cyclic else ()
        problems = [*self.spec.problems, *self.problems]
        if problems and not self.sketching:
            raise InputError(_in_order(problems))
        return Graph(
            name=self.spec.name,
            members=members,
            outputs={name: found.source for name, found in self.outputs.items()},
            facts=infer.scene,
            textures=textures,
            aliases=self._aliases(),
            disabled=tuple(name for name, draft in self.written.items() if draft.spec.disabled is not None),
            knows_objects=self.knows_objects,
            unlit=tuple(name for name, draft in self.written.items() if draft.unlit),
            overwritten=overwritten,
            cyclic=_links(nodes) if has_cycle else {},
            warnings=(*type_warnings, *self.warnings),
        )

    def _report(self, problem: Problem) -> None:
        self.problems.append(problem)
        if len(self.problems) >= MOST_PROBLEMS and not self.sketching:
            raise InputError(_in_order([*self.spec.problems, *self.problems]))

    def _types(self) -> dict[str, NodeType]:
        found: dict[str, NodeType] = {}
        failed: set[str] = set()
        for node in self.spec.nodes.values():
            value = node.value.get("type")
            if not node.type or value is None:
                continue  # reported by `resolve`
            try:
                if node.type not in self.catalog:
                    raise InputError(value.problem("RG102", unknown_type(self.spec, self.catalog, node.type)))
                found[node.id] = self.catalog.get(node.type)
            except InputError as error:
                self.missing += error.problems
                for problem in error.problems if node.type not in failed or node.type not in self.catalog else ():
                    self._report(problem)
                failed.add(node.type)
                if self.sketching:
                    found[node.id] = stand_in(self.spec, node)
        return found

    def _bind(self, spec: NodeSpec) -> UnlinkedNode:
        node_type = self.types[spec.id]
        node, problems = instance(spec, node_type, self.spec.source_roots)
        choices, wrong = choice_files(spec, node_type, node, self.catalog.extensions)
        self.missing += wrong if self.spec.missing else ()
        for problem in (*problems, *wrong):
            self._report(problem)
        ports, inputs = node_type.cls.ports(), node_type.cls.inputs()
        return UnlinkedNode(spec, node_type, node, ports, inputs, {name: [] for name in inputs}, set(), choices)

    def _outputs(self) -> dict[str, Link]:
        found: dict[str, Link] = {}
        for name, value in self.spec.outputs.items():
            try:
                followed = self.references.follow("", value, name)
            except InputError as error:
                for problem in error.problems:
                    self._report(problem)
                continue
            if followed is None:
                continue
            led = bypass(followed, self.written, self.references)
            if not self.written[led.source.node].is_removed:
                found[name] = led
            else:
                self._report(missing_source(f"output '{name}' shows '{led.source}'", led, self.written))
        return found

    def _textures(self, order: Iterable[str]) -> dict[Endpoint, TextureInfo]:
        """Return the properties of all ports; in this order, rules rarely recurse upstream."""
        ports = [(id, name, port) for id in order for name, port in self.nodes[id].ports.items()]
        ends = [Endpoint(id, name) for id, name, port in ports if not isinstance(port, Input)]
        return {end: info for end in ends if (info := self.infer.info(end)) is not None}

    def _check_subgraph_inputs(self) -> None:
        """Check links into sub-pipelines against their declarations; wrong ones are cut and reported only here."""
        for draft in self.nodes.values() if self.spec.scopes else ():
            for name, links in draft.links.items():
                for found in [found for found in links if found.declared]:
                    info = self.infer.info(found.source)
                    problem = self._subgraph_input_problem(found, info.semantic.name) if info is not None else None
                    if problem is not None:
                        self._report(problem)
                        links.remove(found)
                        draft.failed.add(name)

    def _subgraph_input_problem(self, found: Link, carried: str) -> Problem | None:
        for entered in found.declared if carried != "any" else ():
            if entered.semantic not in (None, "any", carried):
                where = line_of(self.nodes[found.source.node].spec.place, entered.given.place)
                text = f"'{entered.name}' expects {entered.semantic}, but '{found.source}' ({where}) is {carried}"
                added = [added.value for added in self.catalog.extensions.semantics()]
                known = [semantic.name for semantic in (*SEMANTICS, *added)]
                text += "" if entered.semantic in known else suggestion(entered.semantic, known, most=0)
                return entered.given.problem("RG110", text)
        return None

    def _check_outputs(self) -> None:
        for name, found in self.outputs.items():
            info = self.infer.info(found.source)
            if found.source.previous:
                text = f"output '{name}' shows this frame; remove '@previous'"
                self._report(found.value.problem("RG127", text))
            elif info is not None:
                kind = port_kind(self.nodes[found.source.node].ports[found.source.port], info)
                if kind not in TEXTURE_KINDS:
                    text = f"output '{name}' shows a texture, but '{found.source}' is a {kind}"
                    self._report(found.value.problem("RG129", text))
                elif name == "image" and info.semantic.name == Radiance.name:
                    text = "output 'image' is scene-linear light without an output transform; add one "
                    text += "('rendergraph nodes display' lists them), or call the output 'radiance'"
                    self.warnings.append(found.value.problem("RG154", text).as_warning())

    def _warn_of_unused_settings(self) -> None:
        """Warn only about settings that were typed: the parameters of a file may be meant for other scenes."""
        for draft in self.nodes.values():
            for name, value in draft.spec.params.items():
                parameter = draft.type.cls.parameters().get(name) if value.source.path is None else None
                if parameter is None or not draft.links.get(parameter.unless):
                    continue
                path, place = f"{draft.spec.id}.{name}", f"{draft.spec.id}.{parameter.unless}"
                text = f"'{path}' changes nothing: '{place}' replaces it; -s {place}=null disconnects that"
                self.warnings.append(value.problem("RG155", text).as_warning())

    def _aliases(self) -> dict[str, Endpoint]:
        found: dict[str, Link] = {}
        for scope, inner in self.spec.scopes.items():
            for name, value in inner.outputs.items():
                followed = self.references.follow(scope, value, name)
                if followed is not None:
                    found[f"{scope[:-1]}.{name}"] = followed
        for draft in self.written.values():
            for name in draft.type.cls.outputs() if draft.is_removed else ():
                end = Endpoint(draft.spec.id, name)
                found[str(end)] = Link(end, draft.spec.value)
        led = {name: bypass(link, self.written, self.references).source for name, link in found.items()}
        return {name: end for name, end in led.items() if not self.written[end.node].is_removed}


def _member(draft: UnlinkedNode, infer: TextureInference) -> GraphNode:
    spec = draft.spec
    links = {name: tuple([found.source for found in ends]) for name, ends in draft.links.items() if ends}
    samplers = {
        name: infer.sampler(draft, port) for name, port in draft.type.read.items() if name in links or port.takes_scene
    }
    clears = {name: infer.clear(draft, port) for name, port in draft.type.written.items()}
    return GraphNode(spec.id, draft.type, draft.node, links, spec.place, draft.choices, samplers, clears)


def _links(nodes: Mapping[str, UnlinkedNode]) -> dict[tuple[str, str, Endpoint], Value]:
    return {
        (draft.spec.id, name, link.source): link.value
        for draft in nodes.values()
        for name, links in draft.links.items()
        for link in links
    }


def _in_order(problems: Sequence[Problem]) -> list[Problem]:
    """Return each problem once, sorted by file, in the order of their first problems, and by line."""
    origins: dict[str | Option | None, int] = {}
    for problem in problems:
        origins.setdefault(problem.place.origin if problem.place else None, len(origins))
    return sorted(
        dict.fromkeys(problems),
        key=lambda p: (origins[p.place.origin], p.place.line, p.place.column) if p.place else (origins[None], 0, 0),
    )


__all__ = ["Endpoint", "Graph", "GraphNode", "endpoint", "link", "sketch"]
