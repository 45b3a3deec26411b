"""Whether the two ends of each link agree, and the textures of a pass among themselves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from msgspec import Struct

from rendergraph.catalog import Catalog
from rendergraph.declare import Function, InOut, Input, Node, Output, Port, TextureInfo, Views, WrittenPort
from rendergraph.errors import InputError, Problem
from rendergraph.link.graph import Endpoint
from rendergraph.link.infer import TextureInference
from rendergraph.link.nodes import Link, UnlinkedNode, line_of
from rendergraph.textures import FORMATS, TEXTURE_KINDS, Semantic, Signature

Accepts = Callable[[type[Node]], bool]


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
                port = draft.inputs[name]
                for link in links:
                    self._link(draft, port, link)
            if len(self.problems) == before:
                self._sizes(draft)
        return self.problems

    def _link(self, draft: UnlinkedNode, port: Input | InOut, link: Link) -> None:
        info = self.textures.get(link.source.now)
        if info is None:
            return
        source = self.nodes[link.source.node].ports[link.source.port]
        given, taken = port_kind(source, info), port.kind
        if isinstance(port, InOut) and port.like is not None and given in TEXTURE_KINDS:
            taken = given  # type: ignore[assignment]
        if link.source.previous and (isinstance(port, InOut) or given in ("function", "view")):
            what = "continues a texture of this frame" if isinstance(port, InOut) else f"takes a {given}"
            text = f"'{draft.spec.id}.{port.name}' {what}, which has no last frame's value; remove '@previous'"
            self.problems.append(link.value.problem("RG127", text))
        elif link.source.previous and getattr(source, "kept", False):
            text = f"'{link.source}' has no effect: the texture is kept, with one value in all frames"
            self.problems.append(link.value.problem("RG127", f"{text}; remove '@previous'"))
        elif given != taken:
            self._report(
                draft, port, link, "RG201", f"takes a {taken}", f"is a {given}", self._by_kind(info, taken, port)
            )
        elif isinstance(port.semantic, Signature):
            self._signature(draft, port, link, source, port.semantic)
        elif (taken != "view" and not self._semantic(draft, port, link, info)) or info.desc is None:
            return
        elif isinstance(port, Input):
            self._samples(draft, port, link, info)
            self._format(draft, port, link, info)

    def _signature(self, draft: UnlinkedNode, port: Input | InOut, link: Link, source: Port, wanted: Signature) -> None:
        if isinstance(source, Function) and source.signature.name != wanted.name:
            carried = f"provides {source.signature.name}()"
            self._report(draft, port, link, "RG210", f"calls {wanted.name}()", carried, None)

    def _semantic(self, draft: UnlinkedNode, port: Input | InOut, link: Link, info: TextureInfo) -> bool:
        carried = info.semantic
        wanted = port.semantic
        if not isinstance(wanted, Semantic) or "any" in (wanted.name, carried.name):
            return True
        if wanted.name != carried.name:
            code, takes, carries = "RG110", wanted.name, carried.name
        elif wanted.space and carried.space and wanted.space != carried.space:
            code, takes, carries = "RG202", f"{wanted.name} in {wanted.space} space", f"it in {carried.space} space"
        elif wanted.encoding and carried.encoding and wanted.encoding != carried.encoding:
            code, takes, carries = "RG203", f"{wanted.encoding} {wanted.name}", f"{carried.encoding} {carried.name}"
        else:
            return True
        self._report(
            draft, port, link, code, f"takes {takes}", f"carries {carries}", self._by_semantic(carried, wanted)
        )
        return False

    def _samples(self, draft: UnlinkedNode, port: Input, link: Link, info: TextureInfo) -> None:
        assert info.desc is not None
        samples = info.desc.samples
        if port.use == "depth_test":
            return  # attached, not sampled: what is drawn beside it follows
        if port.samples == "single" and samples > 1:
            carries = f"has {samples} samples a texel"
            self._report(draft, port, link, "RG214", "takes one sample a texel", carries, self._resolving(info))
        elif port.samples == "multi" and samples == 1:
            self._report(draft, port, link, "RG214", "takes several samples a texel", "has one", None)

    def _format(self, draft: UnlinkedNode, port: Input, link: Link, info: TextureInfo) -> None:
        assert info.desc is not None
        texel = FORMATS[info.desc.format]
        takes = ""
        if port.use == "depth_test" and not texel.is_depth:
            takes = "is attached as depth"
        elif port.compare and not texel.is_depth:
            takes = "compares with depth"
        elif port.use == "image" and (texel.is_depth or texel.srgb):
            takes = "is loaded as an image, so no depth and no sRGB"
        elif texel.family in ("uint", "int") and not port.compare:
            smooth = self.infer.sampler(draft, port).filter
            takes = "is filtered, so no whole numbers" if smooth != "nearest" else ""
        if takes:
            self._report(draft, port, link, "RG215", takes, f"has the format {info.desc.format}", None)

    def _report(
        self, draft: UnlinkedNode, port: Port, link: Link, code: str, takes: str, carries: str, hint: Accepts | None
    ) -> None:
        text = f"'{draft.spec.id}.{port.name}' {takes}, but '{link.source}'{self._at(link)} {carries}"
        # The outputs of a node mostly have the same samples and size.
        way = "" if code in ("RG214", "RG216") else self._neighbour(port, link)
        way = way or self._converters(hint)
        if not way and code == "RG216":
            way = '; a node that can read other sizes declares the input with size="any"'
        if not way and code == "RG201":
            way = self._elsewhere(draft, port)
        self.problems.append(link.value.problem(code, text + way))

    def _elsewhere(self, draft: UnlinkedNode, port: Port) -> str:
        if not isinstance(port, Input) or isinstance(port.semantic, Signature):
            return ""
        fit = [
            f"'{node}.{name}'"
            for node, other in self.nodes.items()
            for name, made in other.type.cls.outputs().items()
            if other is not draft
            and (info := self.textures.get(Endpoint(node, name))) is not None
            and port_kind(made, info) == port.kind
            and _means(port, info.semantic)
        ]
        return f"; {' or '.join(fit[:3])} would fit" if fit else ""

    def _neighbour(self, port: Port, link: Link) -> str:
        source = self.nodes[link.source.node]
        for name, other in source.type.cls.outputs().items():
            info = self.textures.get(Endpoint(link.source.node, name))
            if name == link.source.port or info is None or not isinstance(port, Input):
                continue
            if isinstance(port.semantic, Signature):
                fits = isinstance(other, Function) and other.signature.name == port.semantic.name
            else:
                fits = port_kind(other, info) == port.kind and _means(port, info.semantic)
            if fits:
                return f"; '{link.source.node}.{name}' would fit"
        return ""

    def _at(self, link: Link) -> str:
        return f" ({line_of(self.nodes[link.source.node].spec.place, link.value.place)})"

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
                takes = f"takes the size of '{draft.spec.id}.{target}', {_size(size)}"
                carries = f"is {_size(info.desc.size)}"
                self._report(draft, taken, link, "RG216", takes, carries, self._resizing(info))

    def _converters(self, accepts: Accepts | None) -> str:
        """Suggest node types that convert; only here are types imported that the file does not use."""
        if accepts is None:
            return ""
        found = []
        for name in self.catalog.names():
            try:
                if accepts(self.catalog.get(name).cls):
                    found.append(f"'{name}'")
            except InputError:
                continue  # a broken plugin is no way out
        if not found:
            return ""
        return f"; {' or '.join(found[:3])} between them would convert"

    def _by_semantic(self, carried: Semantic, wanted: Semantic) -> Accepts:
        return lambda cls: (
            any(_means(port, carried) for port in _only_input(cls))
            and any(_means(port, wanted) for port in _outputs(cls))
        )

    def _by_kind(self, info: TextureInfo, kind: str, port: Input | InOut) -> Accepts:
        given = info.desc.kind if info.desc is not None else ""
        meant = port.semantic if isinstance(port.semantic, Semantic) else info.semantic
        return lambda cls: (
            any(p.kind == given and _means(p, info.semantic) for p in _only_input(cls))
            and any(p.kind == kind and _means(p, meant) for p in _outputs(cls))
        )

    def _resolving(self, info: TextureInfo) -> Accepts:
        return lambda cls: any(
            port.samples != "single"
            and _means(port, info.semantic, any_too=True)
            and any(_continues(out, port, info) and _is_single(out) for out in _outputs(cls))
            for port in _only_input(cls)
        )

    def _resizing(self, info: TextureInfo) -> Accepts:
        return lambda cls: any(
            port.size == "any"
            and _means(port, info.semantic, any_too=True)
            and any(
                _continues(out, port, info) and out.like is None and out.size in (None, 1.0) for out in _outputs(cls)
            )
            for port in _only_input(cls)
        )


def port_kind(port: Port, info: TextureInfo) -> str:
    if isinstance(port, Function):
        return "function"
    if isinstance(port, Views):
        return "view"
    if info.desc is not None:
        return info.desc.kind
    return port.kind if isinstance(port, WrittenPort) else ""


def _only_input(cls: type[Node]) -> list[Input]:
    """The input of a type that needs no other: such a node can be inserted between two."""
    needed = [port for port in cls.inputs().values() if not port.optional]
    return [port for port in needed if isinstance(port, Input)] if len(needed) == 1 else []


def _outputs(cls: type[Node]) -> Iterator[WrittenPort]:
    return (port for port in cls.outputs().values() if isinstance(port, Output))


def _means(port: Any, semantic: Semantic, *, any_too: bool = False) -> bool:
    own = port.semantic
    if not isinstance(own, Semantic):
        return False
    if own.name == "any":
        return any_too
    return own.name == semantic.name and own.space == semantic.space and own.encoding == semantic.encoding


def _continues(out: WrittenPort, port: Input, info: TextureInfo) -> bool:
    return out.like == port.name or (out.semantic is not None and _means(out, info.semantic, any_too=True))


def _is_single(out: WrittenPort) -> bool:
    return out.samples == 1 or (out.samples is None and out.like is None)


def _size(size: Iterable[int]) -> str:
    return "×".join(map(str, size))
