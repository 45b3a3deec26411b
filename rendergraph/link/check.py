"""Check links: that their two ends agree, with the sizes of each pass's textures, and that they can run in an order."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Any, TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.catalog import Catalog
from rendergraph.declare import Function, InOut, Input, Node, Output, Port, TextureInfo, Views, WrittenPort
from rendergraph.errors import InputError, Problem
from rendergraph.link.graph import Endpoint, depth_first
from rendergraph.link.infer import TextureInference
from rendergraph.link.nodes import Link, UnlinkedNode, line_of, missing_source
from rendergraph.textures import FORMATS, TEXTURE_KINDS, Format, Semantic, Signature

Accepts = Callable[[type[Node]], bool]

_Mismatch = tuple[str, str, str, Accepts | None]
"""A code, what the input expects, what the source is, and which node types would convert."""


class Checker(Struct, eq=False):
    nodes: Mapping[str, UnlinkedNode]
    textures: Mapping[Endpoint, TextureInfo]
    infer: TextureInference
    catalog: Catalog
    problems: list[Problem] = []

    def check(self) -> list[Problem]:
        for draft in self.nodes.values():
            before = len(self.problems)
            for name, links in draft.links.items():
                for link in links:
                    info = self.textures.get(link.source.now)
                    # The output of a node that has lost its source may differ from what it would be.
                    if info is not None and not self.nodes[link.source.node].lost_links:
                        self._link(draft, draft.inputs[name], link, info)
            if len(self.problems) == before:
                self._sizes(draft)
        return self.problems

    def _link(self, draft: UnlinkedNode, port: Input | InOut, link: Link, info: TextureInfo) -> None:
        source = self.nodes[link.source.node].ports[link.source.port]
        given = port_kind(source, info)
        if link.source.previous and (isinstance(port, InOut) or given in ("function", "view")):
            what = "continues a texture of this frame" if isinstance(port, InOut) else f"expects a {given}"
            text = f"'{draft.spec.id}.{port.name}' {what}, which has no last frame's value; remove '@previous'"
            self.problems.append(link.value.problem("RG127", text))
        elif link.source.previous and getattr(source, "kept", False):
            text = f"'{link.source}' has no effect: the texture is kept, with one value in all frames"
            self.problems.append(link.value.problem("RG127", f"{text}; remove '@previous'"))
        else:
            for mismatch in self._mismatches(draft, port, source, info):
                self._report(draft, port, link, mismatch)

    def fits(self, draft: UnlinkedNode, port: Input | InOut, end: Endpoint) -> bool:
        """Return whether a link to a port would be accepted, sizes aside."""
        source = self.nodes[end.node].ports[end.port]
        return next(self._mismatches(draft, port, source, self.textures[end]), None) is None

    def _mismatches(
        self, draft: UnlinkedNode, port: Input | InOut, source: Port, info: TextureInfo
    ) -> Iterator[_Mismatch]:
        given, kind = port_kind(source, info), port.kind
        if isinstance(port, InOut):
            follows = port.like is not None and given in TEXTURE_KINDS
        else:
            follows = port.layered and given == "texture2d_array"
        if given != kind and not follows:
            yield "RG201", f"expects a {kind}", f"is a {given}", _by_kind(info, kind, port)
        elif isinstance(port.semantic, Signature):
            if isinstance(source, Function) and source.signature.name != port.semantic.name:
                yield "RG210", f"calls {port.semantic.name}()", f"provides {source.signature.name}()", None
        elif given != "view" and (wrong := _semantics(port.semantic, info.semantic)):
            yield wrong
        elif isinstance(port, Input) and info.desc is not None:
            if port.use != "depth_test":  # attached, not sampled: the other targets take its samples
                yield from _samples(port, info, info.desc.samples)
            if expected := self._format(draft, port, FORMATS[info.desc.format]):
                yield "RG215", expected, f"has the format {info.desc.format}", None
        elif isinstance(port, Input) and port.element not in (None, info.element):
            has = info.element.glsl if info.element is not None else "no declared elements"
            yield "RG215", f"expects elements {port.element.glsl}", f"has {has}", None

    def _format(self, draft: UnlinkedNode, port: Input, texel: Format) -> str:
        if port.use == "depth_test" and not texel.is_depth:
            return "is attached as depth"
        if port.compare and not texel.is_depth:
            return "compares with depth"
        if port.use == "image" and (texel.is_depth or texel.srgb):
            return "is loaded as an image, which excludes depth and sRGB"
        whole = texel.family in ("uint", "int") and not port.compare
        if whole and port.wrap == "border":  # a border's value is a float
            return "has a border, which excludes integers"
        named = isinstance(port.semantic, Semantic) and port.semantic.name != "any"
        if whole and named and draft.type.cls.__module__.startswith("rendergraph."):  # as shipped shaders declare it
            return "does not read integers"
        filtered = whole and self.infer.sampler(draft, port).filter != "nearest"
        return "is filtered, which excludes integers" if filtered else ""

    def _report(self, draft: UnlinkedNode, port: Input | InOut, link: Link, mismatch: _Mismatch) -> None:
        code, expected, given, converts = mismatch
        where = line_of(self.nodes[link.source.node].spec.place, link.value.place)
        text = f"'{draft.spec.id}.{port.name}' {expected}, but '{link.source}' ({where}) {given}"
        # The outputs of a node mostly have the same samples and size.
        way = "" if code in ("RG214", "RG216") else self._fitting(port, link, [self.nodes[link.source.node]])
        way = way or self._converters(converts)
        if not way and code == "RG216":
            way = '; a node that can read other sizes declares the input with size="any"'
        if not way and port.kind == "scene":
            way = "; leave the link out to read the scene of the pipeline"
        if not way and code == "RG201":
            way = self._fitting(port, link, [other for other in self.nodes.values() if other is not draft])
        self.problems.append(link.value.problem(code, text + way))

    def _fitting(self, port: Port, link: Link, nodes: Iterable[UnlinkedNode]) -> str:
        if not isinstance(port, Input):
            return ""
        outputs = [(node.spec.id, name, out) for node in nodes for name, out in node.type.cls.outputs().items()]
        ends = {Endpoint(id, name): out for id, name, out in outputs if (id, name) != link.source[:2]}
        fit = [f"'{end}'" for end, out in ends.items() if end in self.textures and _fits(port, out, self.textures[end])]
        return f"; {' or '.join(fit[:3])} would fit" if fit else ""

    def _sizes(self, draft: UnlinkedNode) -> None:
        """Check inputs of size `same` against the node's targets."""
        made: dict[tuple[int, int], str] = {}
        for name, port in draft.type.written.items():
            if isinstance(port, Output | InOut):
                needs = port.needs if isinstance(port, Output) else ()
                info = self.textures.get(Endpoint(draft.spec.id, name)) if all(map(draft.links.get, needs)) else None
                if info is not None and info.desc is not None:
                    made.setdefault(info.desc.size, name)
        if not made:
            return
        default = draft.type.cls.record is Node.record
        if default and len(made) > 1:
            (a, one), (b, other) = list(made.items())[:2]
            ends = f"'{draft.spec.id}.{one}' is {_size(a)} and '{draft.spec.id}.{other}' {_size(b)}"
            text = f"{ends}: all render targets of a pass must have the same size"
            self.problems.append(draft.spec.value.problem("RG216", text, key=True))
            return
        for name, taken in draft.type.read.items():
            for link in draft.links[name] if taken.size == "same" else ():
                info = self.textures.get(link.source.now)
                if info is None or info.desc is None or info.desc.size in made:
                    continue
                (size, target), *_ = made.items()
                expected = f"expects the size of '{draft.spec.id}.{target}', {_size(size)}"
                given = f"is {_size(info.desc.size)}"
                self._report(draft, taken, link, ("RG216", expected, given, _resizing(info)))

    def _converters(self, accepts: Accepts | None) -> str:
        """Suggest node types that convert; only here are types imported that the file does not use."""
        found = []
        for name in self.catalog.names() if accepts else ():
            with suppress(InputError):  # do not suggest a broken plugin
                found += [f"'{name}'"] if accepts and accepts(self.catalog.get(name).cls) else []
        return f"; {' or '.join(found[:3])} between them would convert" if found else ""


def _semantics(wanted: Semantic | Signature | None, given: Semantic) -> _Mismatch | None:
    if not isinstance(wanted, Semantic) or "any" in (wanted.name, given.name):
        return None
    if wanted.name != given.name:
        code, expected, name = "RG110", wanted.name, given.name
    elif wanted.space and given.space and wanted.space != given.space:
        code, expected, name = "RG202", f"{wanted.name} in {wanted.space} space", f"in {given.space} space"
    elif wanted.encoding and given.encoding and wanted.encoding != given.encoding:
        code, expected, name = "RG203", f"{wanted.encoding} {wanted.name}", f"{given.encoding} {given.name}"
    else:
        return None
    converts = _converting(lambda port: _means(port, given), lambda out, _: _means(out, wanted))
    return code, f"expects {expected}", f"is {name}", converts


def _converting(takes: Callable[[Input], bool], makes: Callable[[WrittenPort, Input], bool]) -> Accepts:
    """Accept node types that can be inserted between two nodes: they take the source and make what is expected."""

    def accepts(cls: type[Node]) -> bool:
        needed = [port for port in cls.inputs().values() if not port.optional]
        if len(needed) != 1 or not isinstance(port := needed[0], Input) or not takes(port):
            return False
        return any(makes(out, port) for out in cls.outputs().values() if isinstance(out, Output))

    return accepts


def _samples(port: Input, info: TextureInfo, samples: int) -> Iterator[_Mismatch]:
    if port.samples == "single" and samples > 1:
        yield "RG214", "expects one sample per texel", f"has {samples} samples per texel", _resolving(info)
    elif port.samples == "multi" and samples == 1:
        yield "RG214", "expects several samples per texel", "has one", None


def _by_kind(info: TextureInfo, kind: str, port: Input | InOut) -> Accepts:
    given = info.desc.kind if info.desc is not None else ""
    meant = port.semantic if isinstance(port.semantic, Semantic) else info.semantic
    return _converting(
        lambda port: port.kind == given and _means(port, info.semantic),
        lambda out, _: out.kind == kind and _means(out, meant),
    )


def _resolving(info: TextureInfo) -> Accepts:
    return _converting(
        lambda port: port.samples != "single" and _means(port, info.semantic, any_too=True),
        lambda out, port: (
            _continues(out, port, info) and (out.samples == 1 or (out.samples is None and out.like is None))
        ),
    )


def _resizing(info: TextureInfo) -> Accepts:
    return _converting(
        lambda port: port.size == "any" and _means(port, info.semantic, any_too=True),
        lambda out, port: _continues(out, port, info) and out.like is None and out.size in (None, 1.0),
    )


def _fits(port: Input, output: Port, info: TextureInfo) -> bool:
    if isinstance(port.semantic, Signature):
        return isinstance(output, Function) and output.signature.name == port.semantic.name
    return port_kind(output, info) == port.kind and _means(port, info.semantic)


def port_kind(port: Port, info: TextureInfo) -> str:
    if isinstance(port, Function):
        return "function"
    if isinstance(port, Views):
        return "view"
    if info.desc is not None:
        return info.desc.kind
    return port.kind if isinstance(port, WrittenPort) else ""


def _means(port: Any, semantic: Semantic, *, any_too: bool = False) -> bool:
    own = port.semantic
    if not isinstance(own, Semantic):
        return False
    if own.name == "any":
        return any_too
    return own.name == semantic.name and own.space == semantic.space and own.encoding == semantic.encoding


def _continues(out: WrittenPort, port: Input, info: TextureInfo) -> bool:
    return out.like == port.name or (out.semantic is not None and _means(out, info.semantic, any_too=True))


def _size(size: Iterable[int]) -> str:
    return "×".join(map(str, size))


def cycles(nodes: Mapping[str, UnlinkedNode]) -> list[Problem]:
    """Report the cycles that are certain whichever steps the nodes record; `expand` finds the others (RG117).

    An output certainly waits for every input of a node without `record`, and for the input that it continues or is
    `like`.
    """
    import networkx as nx  # only for an error message

    links: dict[tuple[Endpoint, Endpoint], tuple[str, Link]] = {}
    for draft in nodes.values():
        for port in draft.type.cls.outputs().values():
            like = port.like if isinstance(port, WrittenPort) else None
            waits = draft.links if draft.type.cls.record is Node.record else {port.name, like}
            for name, ends in draft.links.items():
                for link in ends if name in waits else ():
                    if not link.source.previous:
                        links[link.source, Endpoint(draft.spec.id, port.name)] = name, link
    graph: nx.DiGraph[Any] = nx.DiGraph()
    graph.add_edges_from(links)
    rank = {name: number for number, name in enumerate(nodes)}

    def place(end: Endpoint) -> tuple[int, str]:
        return rank[end.node], end.port

    found = []
    for component in nx.strongly_connected_components(graph):
        first = min(component, key=place)
        if len(component) == 1 and not graph.has_edge(first, first):
            continue
        path = [a for a, _ in nx.find_cycle(graph.subgraph(sorted(component, key=place)), first)]
        steps = [(path[number], path[(number + 1) % len(path)]) for number in range(len(path))]
        names = [str(end) for end in path]
        value = links[steps[-1]][1].value
        if len(names) > 8:
            names[3:-3] = [f"{len(names) - 6} more"]
        text = (
            f"the nodes form a cycle, {' → '.join([*names, names[0]])}; append '@previous' to read last frame's value"
        )
        found.append(value.problem("RG117", text))
    return found


def sources(nodes: Mapping[str, UnlinkedNode]) -> dict[str, set[str]]:
    return {
        name: {link.source.node for links in draft.links.values() for link in links if not link.source.previous}
        for name, draft in nodes.items()
    }


def needs(
    nodes: Mapping[str, UnlinkedNode], outputs: Mapping[str, Link], written: Mapping[str, UnlinkedNode]
) -> list[Problem]:
    """Report used ports whose needed input is not connected; `written` includes disabled nodes."""
    problems = []
    users = [link for draft in nodes.values() for links in draft.links.values() for link in links]
    for link in [*users, *outputs.values()]:
        source = nodes[link.source.node]
        wanted: Iterable[str] = getattr(source.ports[link.source.port], "needs", ())
        for name in wanted:
            if not source.links.get(name) and name not in source.failed:
                where = line_of(source.spec.place, link.value.place)
                text = f"'{link.source}' needs input '{name}' of '{source.spec.id}' ({where})"
                if name in source.lost_links:
                    problems.append(missing_source(text, replace(source.lost_links[name], value=link.value), written))
                else:
                    problems.append(link.value.problem("RG116", f"{text}, which is not connected"))
    return problems


def versions(nodes: Mapping[str, UnlinkedNode]) -> tuple[list[Problem], dict[tuple[str, str], Problem]]:
    """Check that each version has one writer (`InOut`), after all its readers; outputs keep their version.

    Returns:
        The problems; and, by reader and writer, those that apply if the reader cannot run between the writer's steps.
    """
    writers: _Writers = {}
    problems: list[Problem] = []
    for draft in nodes.values():
        for name, port in draft.inputs.items():
            for link in draft.links[name] if isinstance(port, InOut) else ():
                if link.source.previous:
                    continue
                if link.source in writers:
                    other, port_name, written = writers[link.source]
                    where = line_of(written.value.place, link.value.place)
                    text = f"'{draft.spec.id}.{name}' and '{other.spec.id}.{port_name}' ({where}) both continue "
                    problems.append(link.value.problem("RG126", f"{text}'{link.source}'; link one to the other"))
                else:
                    writers[link.source] = draft, name, link
    return _readers(nodes, writers) if writers and not problems else (problems, {})


_Writers: TypeAlias = dict[Endpoint, tuple[UnlinkedNode, str, Link]]
"""By texture, the node and its `InOut` that continue it, and the link."""


def _readers(
    nodes: Mapping[str, UnlinkedNode], writers: _Writers
) -> tuple[list[Problem], dict[tuple[str, str], Problem]]:
    problems = []
    suspects: dict[tuple[str, str], Problem] = {}
    before = Ancestors(nodes)
    for draft in nodes.values():
        for name, links in draft.links.items():
            for link in links:
                now = link.source.now
                if now not in writers:
                    continue
                writer, port_name, written = writers[now]
                if link is written or (writer is draft and not link.source.previous):
                    continue
                newer = f"'{writer.spec.id}.{port_name}'"
                where = line_of(written.value.place, link.value.place)
                if link.source.previous:
                    text = f"{newer} ({where}) overwrites '{now}', last frame's value too; read {newer[:-1]}@previous'"
                    problems.append(link.value.problem("RG127", text))
                elif writer.spec.id in before[draft.spec.id]:
                    text = f"'{draft.spec.id}.{name}' reads '{now}', but '{draft.spec.id}' also needs {newer} ({where})"
                    problem = link.value.problem("RG128", f"{text}, which overwrites it; read {newer}")
                    if writer.type.cls.record is Node.record:
                        problems.append(problem)
                    else:
                        suspects[draft.spec.id, writer.spec.id] = problem
    return problems, suspects


class Ancestors(dict[str, set[str]]):
    """All nodes that a node needs in the same frame, computed on demand."""

    def __init__(self, nodes: Mapping[str, UnlinkedNode]) -> None:
        super().__init__()
        self._sources = sources(nodes)

    def __missing__(self, name: str) -> set[str]:
        self[name] = {*depth_first(self._sources, self._sources[name])}
        return self[name]
