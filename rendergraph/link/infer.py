"""Infer the size, format, layers and view of every texture from the rules that nodes declare.

Each rule is evaluated once, on demand. So a rule may look at what is connected to its node, whatever the order of nodes
in the file, and `@previous` needs no special order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Annotated, Any, NoReturn, Optional

from msgspec.structs import replace

from rendergraph import textures
from rendergraph.declare import Facts, Function, InOut, Input, Node, Port, TextureInfo, Views, WrittenPort
from rendergraph.declare.blame import author_problem
from rendergraph.document import shown
from rendergraph.errors import Problem, SceneError, is_interruption, node_named
from rendergraph.link.graph import Endpoint
from rendergraph.link.nodes import UnlinkedNode
from rendergraph.ports import Count, FormatName, Positive, Samples, Sides, Texel
from rendergraph.textures import MOST_SIDE, Filter, Sampler, Semantic, TextureDesc, full_mip_count
from rendergraph.typecheck import fits, quoted, words_for

CAMERA = "camera"
_DRAWN = {"albedo", "depth", "emissive", "linear_depth", "material", "normal", "radiance", "shadow_map"}
DEFAULT_FORMAT = "rgba16f"
_LIGHTS = Annotated[Sequence[Count], "the indices of lights"]
# pyright knows no `|` of Annotated
_TEXEL, _FORMATNAME = Optional[Texel], Optional[FormatName]  # noqa: UP045
_COUNT, _SAMPLES = Optional[Count], Optional[Samples]  # noqa: UP045


class _Unknown(Exception):
    """A value this depends on is wrong and has been reported."""


class _LazyInfos(Sequence[TextureInfo]):
    """The textures an input reads, inferred on access: asking whether there are any evaluates no rule."""

    def __init__(self, infer: TextureInference, ends: Sequence[Endpoint]) -> None:
        self._infer = infer
        self._ends = ends

    def __len__(self) -> int:
        return len(self._ends)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self._infer.known(end) for end in self._ends[index]]
        return self._infer.known(self._ends[index])


class _LazyInputs(Mapping[str, Any]):
    def __init__(self, infer: TextureInference, draft: UnlinkedNode) -> None:
        self._infer = infer
        self._draft = draft

    def __getitem__(self, name: str) -> Sequence[TextureInfo]:
        links = self._draft.links[name]
        if not links:
            port = self._draft.inputs[name]
            given = self._infer.scene.of_scene(port.semantic) if isinstance(port, Input) and port.semantic else ()
            if given:
                return given
            raise KeyError(name)
        return _LazyInfos(self._infer, [link.source for link in links])

    def __iter__(self) -> Iterator[str]:
        return (name for name in self._draft.links if self.get(name))

    def __len__(self) -> int:
        return sum(1 for _ in self)


class TextureInference:
    def __init__(self, nodes: Mapping[str, UnlinkedNode], scene: Facts, used: set[Endpoint]) -> None:
        self.nodes = nodes
        self.scene = scene
        self.used = {end.now for end in used}
        self.problems: list[Problem] = []
        self.infos: dict[Endpoint, TextureInfo | None] = {}
        self.before: Mapping[str, set[str]] | None = None  # where nodes form a cycle, all that each of them needs
        self._open: set[Endpoint] = set()
        self._facts: dict[str, Facts] = {}
        self._answers: dict[tuple[str, int], Any] = {}
        self._samplers: dict[Endpoint, Sampler] = {}

    def info(self, end: Endpoint) -> TextureInfo | None:
        """Return the properties of a port, None where they cannot be inferred."""
        end = end.now
        if end not in self.infos:
            if end in self._open:
                self._report(end, "RG213", "its size or format depends on itself through a cycle of links")
                return None
            self._open.add(end)
            try:
                self.infos[end] = self._evaluate(end)
            except _Unknown:
                self.infos[end] = None
            finally:
                self._open.discard(end)
        return self.infos[end]

    def known(self, end: Endpoint) -> TextureInfo:
        """Return the properties for a rule that cannot continue without them."""
        info = self.info(end)
        if info is None:
            raise _Unknown
        return info

    def sampler(self, draft: UnlinkedNode, port: Input) -> Sampler:
        """Return how an input is sampled; `nearest` where the rule for its filter fails."""
        if port.sampler is not None:
            return port.sampler
        end = Endpoint(draft.spec.id, port.name)
        if end not in self._samplers:
            smooth: Filter = "nearest"
            with suppress(_Unknown):
                smooth = self._checked_value(end, "filter", port.filter, Filter)
            self._samplers[end] = port.sampler_of(smooth)
        return self._samplers[end]

    def clear(self, draft: UnlinkedNode, port: WrittenPort) -> Texel | None:
        """Return the initial contents of a texture or buffer; None where they are undefined or the rule fails."""
        value: Texel | None = None
        with suppress(_Unknown):
            value = self._checked_value(Endpoint(draft.spec.id, port.name), "clear", port.clear, _TEXEL)
        return value

    def _checked_value(self, end: Endpoint, what: str, rule: Any, annotation: Any, code: str = "RG209") -> Any:
        """Return a constant, which was checked at its declaration, or the value of the author's function."""
        if not callable(rule):
            return rule
        value = self._rule_value(end, what, rule)
        if not fits(value, annotation):
            self._stop(end, code, f"the rule for its {what} gives {quoted(value)}, not {words_for(annotation)}")
        return value

    def _report(self, end: Endpoint, code: str, text: str) -> None:
        self._add(end, Problem(code, text, subject=end.port))

    def _add(self, end: Endpoint, problem: Problem, code: str = "", doing: str = "") -> None:
        draft = self.nodes[end.node]
        context = f"'{end}' ({draft.type.name}){doing}"
        self.problems.append(draft.spec.value.relocate(problem, key=True, code=code, context=context))

    def _stop(self, end: Endpoint, code: str, text: str) -> NoReturn:
        self._report(end, code, text)
        raise _Unknown

    def _evaluate(self, end: Endpoint) -> TextureInfo | None:
        draft = self.nodes[end.node]
        port = draft.ports[end.port]
        if draft.type.missing:
            return None
        if isinstance(port, Function):
            return TextureInfo(None, Semantic(port.signature.name, port.signature.doc))
        if isinstance(port, Views):
            count = self._checked_value(end, "count", port.count, _COUNT)
            lights = self._view_lights(end, port)
            if count is None:
                count = len(lights) if port.lights else 1
            return TextureInfo(None, textures.View, view=str(end), lights=lights, views=count)
        if isinstance(port, InOut) and draft.links.get(port.name):
            return self.info(draft.links[port.name][0].source)
        return self._made(end, draft, port) if isinstance(port, WrittenPort) else None

    def _facts_of(self, draft: UnlinkedNode) -> Facts:
        if draft.spec.id not in self._facts:
            self._facts[draft.spec.id] = replace(self.scene, inputs=_LazyInputs(self, draft))
        return self._facts[draft.spec.id]

    def _rule_value(self, end: Endpoint, what: str, rule: Callable[[Node, Facts], Any]) -> Any:
        """Return the result of a rule; ports that share a function share its result."""
        key = end.node, id(rule)
        if key not in self._answers:
            self._answers[key] = self._call_rule(end, what, rule)
        return self._answers[key]

    def _call_rule(self, end: Endpoint, what: str, rule: Callable[[Node, Facts], Any]) -> Any:
        draft = self.nodes[end.node]
        try:
            return rule(draft.node, self._facts_of(draft))
        except _Unknown:
            raise
        except BaseException as error:  # third-party code
            if is_interruption(error):
                raise
            missing = isinstance(error, KeyError) and bool(error.args) and error.args[0] in draft.inputs
            if missing and (end not in self.used or not draft.inputs[error.args[0]].optional):
                raise _Unknown from None  # the port is unused, or the missing input is reported elsewhere
            if missing:
                self._report(end, "RG212", f"its {what} needs input '{error.args[0]}', which is not connected")
            elif isinstance(error, SceneError):
                self._refused(draft, error)
            else:
                problem = author_problem(error, draft.type.cls, subject=end.port)
                self._add(end, problem, "RG209", f": the rule for its {what} fails")
            raise _Unknown from None

    def _refused(self, draft: UnlinkedNode, error: SceneError) -> None:
        """Report a rule's own error at the parameter it names, once: several rules may raise the same."""
        value, key = draft.spec.value, True
        for param in draft.spec.params.values():
            for part in param.data if isinstance(param.data, list) else [param]:
                if error.subject and part.data == error.subject:
                    value, key = part, False
        who = node_named(draft.spec.id, draft.type.name)
        problem = value.problem("RG209", f"{who}: {shown(error, 200)}", key=key)
        if problem not in self.problems:
            self.problems.append(problem)

    def _made(self, end: Endpoint, draft: UnlinkedNode, port: WrittenPort) -> TextureInfo:
        like = self._linked(draft, port.like)
        if port.kind == "buffer":
            if port.element is None:
                size = self._checked_value(end, "bytes", port.bytes, Positive)
            else:
                size = port.element.dtype.itemsize * self._checked_value(end, "count", port.count, Positive)
            return TextureInfo(None, port.semantic or textures.Any, bytes=size, element=port.element)
        semantic = port.semantic or (like.semantic if like is not None else textures.Any)
        view, lights = self._view(end, draft, port, semantic)
        drawing_view = self._drawing_view(draft) if view is None and port.like is None else None
        table = draft.ports.get(port.view) if port.view else None
        lit = callable(port.lights) or (isinstance(table, Views) and table.lights is not None)
        layers = len(lights) if lit and port.kind == "texture2d_array" else 1
        desc = self._desc(end, port, like.desc if like is not None else None, layers)
        if like is not None:
            view, lights = view or like.view, lights or like.lights
        if drawing_view is not None and desc.size == self._size(*drawing_view, None):
            view = str(drawing_view[0])  # its texels correspond to those drawn with this view
        return TextureInfo(desc, semantic, view, lights)

    def _linked(self, draft: UnlinkedNode, name: str | None) -> TextureInfo | None:
        links = draft.links.get(name, []) if name else []
        return self.known(links[0].source) if links else None

    def _desc(self, end: Endpoint, port: WrittenPort, like: TextureDesc | None, usual: int) -> TextureDesc:
        draft = self.nodes[end.node]
        size = self._size(end, port, like)
        name = self._checked_value(end, "format", port.format, _FORMATNAME, "RG211")
        name = name or (like.format if like is not None else DEFAULT_FORMAT)
        kind = like.kind if like is not None and port.kind == "texture2d" else port.kind
        layers = self._checked_value(end, "layers", port.layers, _COUNT)
        if layers is None:
            layers = like.layers if like is not None else usual
        layers = 6 if kind == "texture_cube" else layers
        full = full_mip_count(*size, layers if kind == "texture3d" else 1)
        mips = self._checked_value(end, "mips", port.mips, Count) or full
        samples = self._checked_value(end, "samples", port.samples, _SAMPLES)
        if samples is None:
            samples = 1 if mips > 1 or kind in ("texture3d", "texture_cube") else self._samples_of(draft, like, size)
        if kind == "texture2d" and layers != 1:
            self._stop(end, "RG208", f"a texture2d has 1 layer, not {layers}; the kind with layers is texture2d_array")
        if mips > full:
            self._stop(end, "RG208", f"a texture of {size[0]}×{size[1]} has 1 to {full} mips, not {mips}")
        if samples > 1 and (mips > 1 or kind in ("texture3d", "texture_cube")):
            self._stop(end, "RG208", f"a texture cannot have {samples} samples per texel with mips, in 3D or in a cube")
        return TextureDesc(kind, name, *size, layers=layers, mips=mips, samples=samples)

    def _samples_of(self, draft: UnlinkedNode, like: TextureDesc | None, size: tuple[int, int]) -> int:
        """Samples of a texture that declares none: those of `like`, or of a depth attached beside it."""
        if like is not None:
            return like.samples
        for name in [name for name, port in draft.type.read.items() if port.use == "depth_test"]:
            info = self._linked(draft, name)
            if info is not None and info.desc is not None and info.desc.size == size:
                return info.desc.samples
        return 1

    def _size(self, end: Endpoint, port: WrittenPort | Views, like: TextureDesc | None) -> tuple[int, int]:
        rule: Any = 1.0 if port.size is None else port.size
        draft = self.nodes[end.node]
        factor, base = 1.0, self.scene.viewport
        if callable(rule):
            base = self._checked_value(end, "size", rule, Sides)
        elif isinstance(rule, str) or (isinstance(rule, tuple) and isinstance(rule[0], str)):
            name, factor = (rule, 1.0) if isinstance(rule, str) else (rule[0], float(rule[1]))
            source = self._linked(draft, name)  # not connected: the viewport
            base = source.desc.size if source is not None and source.desc is not None else base
        elif isinstance(rule, tuple):
            base = rule
        else:
            factor = float(rule)
            if like is not None and port.size is None:
                base = like.size
            elif isinstance(port, WrittenPort) and (drawing_view := self._drawing_view(draft)) is not None:
                base = self._size(*drawing_view, None)
        width, height = base if factor == 1.0 else [max(1, math.ceil(side * factor - 1e-9)) for side in base]
        if not (1 <= width <= MOST_SIDE and 1 <= height <= MOST_SIDE):
            self._stop(end, "RG207", f"its size is {width}×{height}; width and height must be from 1 to {MOST_SIDE}")
        return width, height

    def _drawing_view(self, draft: UnlinkedNode) -> tuple[Endpoint, Views] | None:
        """The view with a size of its own that a node draws with, or that its per-texel inputs were drawn with."""
        for given, links in draft.links.items():
            port = draft.inputs[given]
            if isinstance(port, Input) and port.kind != "view" and port.size == "any":
                continue
            for link in links:
                if self.before is not None and draft.spec.id in self.before[link.source.node]:
                    continue  # its size may depend on the one in question
                info = self.info(link.source) if not link.source.previous else None
                if info is None or info.view is None or info.view == CAMERA:
                    continue
                maker, _, name = info.view.rpartition(".")
                end = Endpoint(maker, name)
                table = self.nodes[end.node].ports[end.port]
                if isinstance(table, Views) and table.size is not None:
                    return end, table
        return None

    def _view_lights(self, end: Endpoint, port: Views) -> tuple[int, ...]:
        return tuple(self._checked_value(end, "lights", port.lights, _LIGHTS)) if port.lights else ()

    def _view(
        self, end: Endpoint, draft: UnlinkedNode, port: WrittenPort, semantic: Semantic
    ) -> tuple[str | None, tuple[int, ...]]:
        """Return the view table it is drawn with, and the light of each layer."""
        named: Port | None = draft.ports.get(port.view) if port.view else None
        view: str | None = None
        lights: tuple[int, ...] = ()
        if isinstance(named, Views):
            view = str(Endpoint(draft.spec.id, named.name))
            lights = self._view_lights(Endpoint(draft.spec.id, named.name), named)
        elif isinstance(named, Input | InOut):
            view, lights = self._carried(draft, named)
        elif isinstance(drawn := draft.ports.get("view"), Input) and drawn.kind == "view" and semantic.name in _DRAWN:
            view, lights = self._carried(draft, drawn)
        if callable(port.lights):
            lights = tuple(self._checked_value(end, "lights", port.lights, _LIGHTS))
        elif port.lights:
            table: Port | None = draft.ports.get(port.lights)
            if isinstance(table, Views):
                lights = self._view_lights(Endpoint(draft.spec.id, table.name), table)
            else:
                source = self._linked(draft, port.lights)
                lights = source.lights if source is not None else ()
        return view, lights

    def _carried(self, draft: UnlinkedNode, port: Input | InOut) -> tuple[str | None, tuple[int, ...]]:
        source = self._linked(draft, port.name)
        if source is not None:
            return source.view, source.lights
        return (CAMERA if port.kind == "view" else None), ()
