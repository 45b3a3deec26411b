"""Link a PipelineSpec into a Graph: find types, check parameters, connect ports, infer textures; gather all errors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from msgspec import Struct

from rendergraph.catalog import Catalog, NodeType
from rendergraph.declare import CameraFacts, Facts, LightFacts, MaterialFacts, TextureInfo
from rendergraph.document import Value
from rendergraph.errors import InputError, Option, Problem, suggestion
from rendergraph.facts import ObjectFacts, SceneDataFacts
from rendergraph.keys import MOST_PROBLEMS
from rendergraph.link.check import Checker, port_kind
from rendergraph.link.connect import Connector
from rendergraph.link.graph import Endpoint, Graph, GraphNode, upstream_first
from rendergraph.link.infer import TextureInference, output_ends
from rendergraph.link.instances import choice_files, instance
from rendergraph.link.nodes import (
    Link,
    References,
    UnlinkedNode,
    bypass,
    line_of,
    mark_without_environment,
    missing_source,
    remove_disabled,
)
from rendergraph.link.order import Ancestors, cycles, needs, sources, versions
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
    given = None if objects is None else tuple(objects)
    scene = environment, scene_data, tuple(materials), camera
    return _Linker(spec, spec.catalog or catalog, tuple(lights), given, *scene).graph()


def sketch(
    spec: PipelineSpec, catalog: Catalog, lights: Sequence[LightFacts] = (), environment: TextureDesc | None = None
) -> tuple[Graph, tuple[Problem, ...]]:
    """Return a graph for display, in which node types may be missing, and the problems about these."""
    try:
        return link(spec, catalog, lights, environment=environment), ()
    except InputError as error:
        linker = _Linker(spec, spec.catalog or catalog, tuple(lights), None, environment, sketching=True)
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
    given = None if objects is None else tuple(objects)
    linker = _Linker(spec, spec.catalog or catalog, tuple(lights), given, environment, sketching=True)
    graph = linker.graph()
    checker = linker.checker
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


class _Linker(Struct, eq=False):
    """Links one pipeline; `missing` holds the problems about types that are missing or cannot be used."""

    spec: PipelineSpec
    catalog: Catalog
    lights: tuple[LightFacts, ...]
    objects: tuple[ObjectFacts, ...] | None
    environment: TextureDesc | None
    scene_data: Callable[[bool], SceneDataFacts] = lambda rays: SceneDataFacts()
    materials: tuple[MaterialFacts, ...] = ()
    camera: CameraFacts = CameraFacts()
    sketching: bool = False
    missing: list[Problem] = []
    problems: list[Problem] = []
    warnings: list[Problem] = []
    checked: Checker | None = None

    @property
    def checker(self) -> Checker:
        assert self.checked is not None  # `graph` has been called
        return self.checked

    def graph(self) -> Graph:
        types = self._types()
        references = References(self.spec, types)
        nodes = {node.id: self._bind(node, types[node.id]) for node in self.spec.nodes.values() if node.id in types}
        connector = Connector(self.spec, self.catalog, references, self._report)
        for draft in nodes.values():
            connector.connect(draft)
        if self.environment is None:
            mark_without_environment(nodes)
        written, nodes = nodes, remove_disabled(nodes, references)
        for draft in nodes.values():
            connector.complete(draft, written)
        outputs = self._outputs(references, written)
        order = upstream_first(sources(nodes))
        cyclic = cycles(nodes) if len(order) < len(nodes) else []
        used = {end.source for draft in nodes.values() for links in draft.links.values() for end in links}
        used |= {found.source for found in outputs.values()}
        scenes = [port for draft in nodes.values() for port in draft.inputs.values() if port.kind == "scene"]
        facts = Facts(
            self.spec.size,
            self.lights,
            objects=self.objects or (),
            environment=self.environment,
            scene_data=self.scene_data(any(getattr(port, "rays", False) for port in scenes)) if scenes else None,
            materials=self.materials,
            camera=self.camera,
        )
        infer = TextureInference(nodes, facts, used)
        textures: dict[Endpoint, TextureInfo] = {}
        overwritten: Mapping[tuple[str, str], Problem] = {}
        if len(order) < len(nodes):
            infer.before = Ancestors(nodes)
        if cyclic:
            self.problems += cyclic
            if self.sketching:
                textures = self._textures(list(nodes), nodes, infer)
                self.checked = Checker(nodes, textures, infer, self.catalog)
        else:
            found, overwritten = versions(nodes)
            self.problems += needs(nodes, outputs, written) + found
            self._check_subgraph_inputs(nodes, infer)
            self._warn_of_unused_settings(nodes)
            textures = self._textures(dict.fromkeys([*order, *nodes]), nodes, infer)
            self.checked = Checker(nodes, textures, infer, self.catalog)
            self.problems += self.checked.check()
            self._check_outputs(nodes, outputs, infer)
        members = {name: _member(draft, infer) for name, draft in nodes.items()}
        self.problems += infer.problems if not cyclic else ()
        problems = [*self.spec.problems, *self.problems]
        if problems and not self.sketching:
            raise InputError(_in_order(problems))
        return Graph(
            name=self.spec.name,
            members=members,
            outputs={name: found.source for name, found in outputs.items()},
            facts=facts,
            textures=textures,
            aliases=self._aliases(references, written),
            disabled=tuple(name for name, draft in written.items() if draft.spec.disabled is not None),
            knows_objects=self.objects is not None,
            unlit=tuple(name for name, draft in written.items() if draft.unlit),
            overwritten=overwritten,
            cyclic=_links(nodes) if len(order) < len(nodes) else {},
            warnings=(*dict.fromkeys(warning for one in types.values() for warning in one.warnings), *self.warnings),
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
                    from rendergraph.link.instances import unknown_type  # only for missing types

                    raise InputError(value.problem("RG102", unknown_type(self.spec, self.catalog, node.type)))
                found[node.id] = self.catalog.get(node.type)
            except InputError as error:
                self.missing += error.problems
                if node.type not in failed or node.type not in self.catalog:
                    self.problems += error.problems
                failed.add(node.type)
                if self.sketching:
                    from rendergraph.link.instances import stand_in  # only for missing types

                    found[node.id] = stand_in(self.spec, node)
                elif len(self.problems) >= MOST_PROBLEMS:
                    raise InputError(_in_order([*self.spec.problems, *self.problems])) from None
        return found

    def _bind(self, spec: NodeSpec, node_type: NodeType) -> UnlinkedNode:
        node, problems = instance(spec, node_type, self.spec.source_roots)
        choices, wrong = choice_files(spec, node_type, node, self.catalog.extensions)
        self.missing += wrong if self.spec.missing else ()
        for problem in (*problems, *wrong):
            self._report(problem)
        ports, inputs = node_type.cls.ports(), node_type.cls.inputs()
        return UnlinkedNode(spec, node_type, node, ports, inputs, {name: [] for name in inputs}, set(), choices)

    def _outputs(self, references: References, written: Mapping[str, UnlinkedNode]) -> dict[str, Link]:
        found: dict[str, Link] = {}
        for name, value in self.spec.outputs.items():
            try:
                followed = references.follow("", value, name)
            except InputError as error:
                for problem in error.problems:
                    self._report(problem)
                continue
            if followed is None:
                continue
            led = bypass(followed, written, references)
            if not written[led.source.node].is_removed:
                found[name] = led
            else:
                self._report(missing_source(f"output '{name}' shows '{led.source}'", led, written))
        return found

    def _textures(
        self, order: Iterable[str], nodes: Mapping[str, UnlinkedNode], infer: TextureInference
    ) -> dict[Endpoint, TextureInfo]:
        """Return the properties of all ports; in this order, rules rarely recurse upstream."""
        textures: dict[Endpoint, TextureInfo] = {}
        for name in order:
            for end in output_ends(nodes[name]):
                info = infer.info(end)
                if info is not None:
                    textures[end] = info
        return textures

    def _check_subgraph_inputs(self, nodes: Mapping[str, UnlinkedNode], infer: TextureInference) -> None:
        """Check links into sub-pipelines against their declarations; wrong ones are cut and reported only here."""
        for draft in nodes.values() if self.spec.scopes else ():
            for name, links in draft.links.items():
                for found in [found for found in links if found.declared]:
                    info = infer.info(found.source)
                    problem = (
                        self._subgraph_input_problem(nodes, found, info.semantic.name) if info is not None else None
                    )
                    if problem is not None:
                        self._report(problem)
                        links.remove(found)
                        draft.failed.add(name)

    def _subgraph_input_problem(self, nodes: Mapping[str, UnlinkedNode], found: Link, carried: str) -> Problem | None:
        for entered in found.declared:
            if entered.semantic is not None and "any" not in (entered.semantic, carried):
                if entered.semantic == carried:
                    continue
                where = line_of(nodes[found.source.node].spec.place, entered.given.place)
                text = f"'{entered.name}' expects {entered.semantic}, but '{found.source}' ({where}) is {carried}"
                added = [added.value for added in self.catalog.extensions.semantics()]
                known = [semantic.name for semantic in (*SEMANTICS, *added)]
                text += "" if entered.semantic in known else suggestion(entered.semantic, known, most=0)
                return entered.given.problem("RG110", text)
        return None

    def _check_outputs(
        self, nodes: Mapping[str, UnlinkedNode], outputs: Mapping[str, Link], infer: TextureInference
    ) -> None:
        for name, found in outputs.items():
            info = infer.info(found.source)
            if found.source.previous:
                text = f"output '{name}' shows this frame; remove '@previous'"
                self._report(found.value.problem("RG127", text))
            elif info is not None:
                kind = port_kind(nodes[found.source.node].ports[found.source.port], info)
                if kind not in TEXTURE_KINDS:
                    text = f"output '{name}' shows a texture, but '{found.source}' is a {kind}"
                    self._report(found.value.problem("RG129", text))
                elif name == "image" and info.semantic.name == Radiance.name:
                    text = (
                        "output 'image' is scene-linear light without an output transform; add one "
                        "('rendergraph nodes display' lists them), or call the output 'radiance'"
                    )
                    self.warnings.append(found.value.problem("RG154", text).as_warning())

    def _warn_of_unused_settings(self, nodes: Mapping[str, UnlinkedNode]) -> None:
        """Warn only about settings that were typed: the parameters of a file may be meant for other scenes."""
        for draft in nodes.values():
            for name, value in draft.spec.params.items():
                parameter = draft.type.cls.parameters().get(name) if value.source.path is None else None
                if parameter is None or not draft.links.get(parameter.unless):
                    continue
                path, place = f"{draft.spec.id}.{name}", f"{draft.spec.id}.{parameter.unless}"
                text = f"'{path}' changes nothing: '{place}' replaces it; -s {place}=null disconnects that"
                self.warnings.append(value.problem("RG155", text).as_warning())

    def _aliases(self, references: References, written: Mapping[str, UnlinkedNode]) -> dict[str, Endpoint]:
        found: dict[str, Link] = {}
        for scope, inner in self.spec.scopes.items():
            for name, value in inner.outputs.items():
                followed = references.follow(scope, value, name)
                if followed is not None:
                    found[f"{scope[:-1]}.{name}"] = followed
        for draft in written.values():
            for name in draft.type.cls.outputs() if draft.is_removed else ():
                end = Endpoint(draft.spec.id, name)
                found[str(end)] = Link(end, draft.spec.value)
        led = {name: bypass(link, written, references).source for name, link in found.items()}
        return {name: end for name, end in led.items() if not written[end.node].is_removed}


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
