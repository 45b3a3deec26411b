"""The harness for checking a node: its variants, sources for its inputs, readers for outputs that no file can hold.

Each source is a node whose class and shader are generated from the port that it feeds. Its texture holds a smooth
pattern of values that the port's semantic allows, and carries the camera's view and the scene's first light, so that it
has everything that a reader may need.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rendergraph import api
from rendergraph.catalog import Catalog, NodeType
from rendergraph.declare import Input, Node
from rendergraph.errors import Problem
from rendergraph.ports import Samples
from rendergraph.textures import FORMATS, TEXTURE_KINDS, TextureDesc

SIZE = (37, 23)
"""Size of the picture: small, and not a multiple of the work group size."""

_VALUES = {  # by semantic, of `vec2 at` from 0 to 1 and `float wave` from 0 to 1
    "radiance": "vec4(4.0 * wave * at, 2.0 * wave, 1.0)",
    "reflections": "vec4(4.0 * wave * at, 2.0 * wave, at.x)",
    "emissive": "vec4(wave * at, 0.0, 1.0)",
    "normal": "vec4(normalize(vec3(2.0 * at - 1.0, 0.5 + wave)), 1.0)",
    "linear_depth": "vec4(1.0 + 9.0 * wave)",
}
_ANY_VALUE = "vec4(at, wave, 1.0)"
_DEPTHS = ("depth", "shadow_map")
_BUFFER_BYTES = 1 << 20
FROM = "from-"  # prefix of outputs that show a source; no port begins like this


MOST_VARIANTS = 200
"""Maximum number of variants of one node; further ones are not rendered."""


@dataclass(frozen=True)
class Report:
    """The result of a check: the type's name, the rendered variants in order, mistakes and warnings."""

    node: str
    variants: tuple[str, ...]
    problems: tuple[Problem, ...]

    @property
    def mistakes(self) -> tuple[Problem, ...]:
        return tuple(problem for problem in self.problems if problem.severity == "error")


@dataclass(frozen=True)
class NodeVariant:
    """One way to use a node; its name says how it differs from the default, whose name is empty."""

    name: str
    params: Mapping[str, Any] = field(default_factory=dict)
    unconnected: frozenset[str] = frozenset()
    outputs: tuple[str, ...] = ()
    multisampled: bool = False
    is_range_end: bool = False

    def without(self, cls: type[Node], inputs: Set[str]) -> NodeVariant:
        unconnected = self.unconnected | inputs
        usable = _usable(cls, unconnected)
        return replace(self, unconnected=unconnected, outputs=tuple(name for name in self.outputs if name in usable))


def variants(cls: type[Node]) -> list[NodeVariant]:
    seen: list[NodeVariant] = []
    for variant in _all(cls):
        if variant.outputs and variant not in seen and len(seen) < MOST_VARIANTS:
            seen.append(variant)
    return seen


def _all(cls: type[Node]) -> Iterator[NodeVariant]:
    everything = _usable(cls, frozenset())
    yield NodeVariant("", outputs=everything)
    for name, value, is_end in _values(cls):
        text = f"{name}={value}".lower() if isinstance(value, bool) else f"{name}={value}"
        yield NodeVariant(text, {name: value}, outputs=everything, is_range_end=is_end)
    optional = [name for name, port in cls.inputs().items() if port.optional]
    absent = {name: {name} for name in optional} | ({"optional inputs": {*optional}} if len(optional) > 1 else {})
    for text, names in absent.items():
        yield NodeVariant(f"without {text}", outputs=everything).without(cls, names)
    if any(isinstance(port, Input) and port.samples == "any" for port in cls.inputs().values()):
        yield NodeVariant("several samples", outputs=everything, multisampled=True)
    if len(everything) > 1:
        for name in everything:
            yield NodeVariant(f"{name} alone", outputs=(name,))


def _usable(cls: type[Node], unconnected: Set[str]) -> tuple[str, ...]:
    return tuple(name for name, port in cls.outputs().items() if not unconnected & set(getattr(port, "needs", ())))


def _values(cls: type[Node]) -> Iterator[tuple[str, Any, bool]]:
    """Yield parameters that shape the program or plan, each value to try, and whether it is the end of a range."""
    for name, parameter in cls.parameters().items():
        if parameter.role == "param":
            continue
        default = parameter.default
        if parameter.type is bool:
            yield name, not default, False
        for choice in parameter.choices:
            if choice != default:
                yield name, choice, False
        if parameter.type in (int, float):
            for limit in (parameter.limits.low, parameter.limits.high):
                if limit is not None and limit != default:
                    yield name, parameter.type(limit), True


@dataclass
class HarnessGraph:
    """A node type with sources for its inputs and readers for its outputs, whose files are in `folder`."""

    checked: NodeType
    folder: Path
    sources: dict[str, NodeType] = field(default_factory=dict)
    multisampled: dict[str, NodeType] = field(default_factory=dict)
    readers: dict[str, NodeType] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, port in self.checked.cls.inputs().items():
            if isinstance(port, api.Input) and port.takes_scene:
                continue  # the scene is its source
            samples = _samples(port)
            single: Samples = 4 if samples == "multi" else 1
            self.sources[name] = self._type("feed", name, _source(name, port, self.folder, single))
            if samples == "any" and port.kind in TEXTURE_KINDS:
                self.multisampled[name] = self._type("feed_samples", name, _source(name, port, self.folder, 4))
        for name, output in self.checked.cls.outputs().items():
            if reader := _reader(name, output, self.folder):
                self.readers[name] = self._type("use", name, reader)

    @property
    def fed(self) -> list[str]:
        """The inputs whose source is a texture that can be read back."""
        ports = self.checked.cls.inputs()
        return [name for name in self.sources if ports[name].kind in TEXTURE_KINDS and _samples(ports[name]) != "multi"]

    def _type(self, word: str, name: str, cls: type[api.Node]) -> NodeType:
        return NodeType(f"check_{word}_{name}", "", cls, Path(__file__), self.folder, "check-node")

    def catalog(self) -> Catalog:
        harness = (*self.sources.values(), *self.multisampled.values(), *self.readers.values())
        return Catalog({}, {entry.name: entry for entry in (self.checked, *harness)})

    def write(self, variant: NodeVariant, scene: str) -> Path:
        """Write the pipeline of a variant; its outputs are the sources', then the node's, if the variant has any."""
        cls, node = self.checked.cls, self.checked.name
        nodes: dict[str, Any] = {}
        inputs: dict[str, Any] = {}
        outputs: dict[str, str] = {}
        for name, source in self.sources.items():
            if name in variant.unconnected:
                continue
            port = cls.inputs()[name]
            several = variant.multisampled and name in self.multisampled
            source = self.multisampled[name] if several else source
            nodes[source.name] = {"type": source.name}
            link = f"{source.name}.made"
            inputs[name] = [link] if isinstance(port, api.Input) and port.many else link
            if name in self.fed and not several:
                outputs[FROM + name] = link
        if variant.outputs:
            nodes[node] = {"type": node, "inputs": inputs, "params": dict(variant.params)}
        for name in variant.outputs:
            reader = self.readers.get(name)
            if reader is None:
                outputs[name] = f"{node}.{name}"
            else:
                nodes[reader.name] = {"type": reader.name, "inputs": {"read": f"{node}.{name}"}}
                outputs[name] = f"{reader.name}.made"
        pipeline = {"rendergraph": 1, "size": list(SIZE), "scene": scene, "nodes": nodes, "outputs": outputs}
        file = self.folder / "check.yaml"
        file.write_text(json.dumps(pipeline), encoding="utf-8")
        return file


# --- sources ---------------------------------------------------------------------------------------------------------


def _samples(port: api.Input | api.InOut) -> str:
    return port.samples if isinstance(port, api.Input) else "single"


def _source(name: str, port: api.Input | api.InOut, folder: Path, samples: Samples) -> type[api.Node]:
    semantic = port.semantic
    if isinstance(semantic, api.Signature):
        return _function_source(semantic, folder)
    if port.kind == "view":
        return _node("Seen", made=api.Views(doc="The camera's view."), update=_camera("made"))
    if port.kind == "buffer":
        made = api.Output(api.Any, kind="buffer", bytes=_BUFFER_BYTES, doc="Zeros.")
        return _node("Zeros", made=made, record=lambda self, steps: steps.clear(self.made))
    assert port.kind != "function"  # its semantic is a signature
    assert port.kind != "scene"  # the scene is its own source
    meaning = api.Radiance if semantic is None or semantic.name == "any" else semantic
    given = port.format if isinstance(port, api.InOut) and isinstance(port.format, str) else None
    image = isinstance(port, api.Input) and port.use == "image"
    depth = meaning.name in _DEPTHS or (given is not None and FORMATS[given].is_depth)
    format = given or ("depth32f" if depth else "rgba16f" if image else "rgba32f")
    layers = {"texture2d": 1, "texture_cube": 6}.get(port.kind, 1 if _has_lights(meaning) else 2)
    shader = f"feed_{name}.frag"
    (folder / shader).write_text(_pattern(meaning, format), encoding="utf-8")

    def record(self: Any, steps: api.Steps) -> None:
        targets = [self.made] if port.kind == "texture2d" else [self.made.layer(layer) for layer in range(layers)]
        for target in targets:
            steps.fullscreen(shader, out={"made": target})

    made = api.Output(
        meaning,
        kind=port.kind,
        format=format,
        layers=layers if port.kind in ("texture2d_array", "texture3d") else None,
        size=(24, 24) if port.kind == "texture_cube" else None,
        samples=samples,
        view="views",
        lights=(lambda node, facts: (0,)) if _has_lights(meaning) else None,
        doc="A pattern.",
    )
    views = api.Views(count=layers, public=False, doc="The camera's view for each layer.")
    return _node("Pattern", made=made, views=views, record=record, update=_camera("views", layers))


def _has_lights(semantic: api.Semantic) -> bool:
    return semantic.name in ("shadow_map", "visibility")


def _pattern(semantic: api.Semantic, format: str) -> str:
    value = _VALUES.get(semantic.name, _ANY_VALUE)
    head = "in vec2 v_uv;\n"
    body = "vec2 at = v_uv; float wave = 0.5 + 0.5 * sin(11.0 * at.x + 7.0 * at.y);"
    family = FORMATS[format].family
    if FORMATS[format].is_depth:
        return f"{head}void main() {{ {body} gl_FragDepth = wave > 0.9 ? 0.0 : 0.4 - 0.35 * wave; }}\n"
    kind = {"uint": "uvec4", "int": "ivec4"}.get(family, "vec4")
    scaled = f"{kind}(100.0 * {value})" if kind != "vec4" else value
    return f"{head}out {kind} made;\nvoid main() {{ {body} made = {scaled}; }}\n"


def _camera(port: str, count: int = 1) -> Any:
    def update(self: Any, frame: api.Frame) -> None:
        frame.set_views(getattr(self, port), [frame.camera] * count)

    return update


def _function_source(signature: api.Signature, folder: Path) -> type[api.Node]:
    """Return a node whose function is neutral if a texture can replace it, and otherwise varies with each argument."""
    shader = f"{signature.name}_fed.glsl"
    lines = [f"{each.declaration} {{ return {_varied(each)}; }}\n" for each in signature.functions]
    (folder / shader).write_text("".join(lines), encoding="utf-8")
    return _node("Called", made=api.Function(signature, shader=shader, doc="A pattern."))


def _varied(signature: api.Signature) -> str:
    kind, value = signature.declaration.split()[0], signature.neutral
    if signature.texture is None and kind.startswith(("vec", "float")):
        arguments = re.findall(r"(\w+)\s+(\w+)\s*[,)]", signature.declaration)
        parts = [f"dot({name}, {of}(0.3))" for of, name in arguments if of in ("vec2", "vec3", "vec4")]
        parts += [f"0.3 * float({name})" for of, name in arguments if of in ("float", "int", "uint", "bool")]
        value = f"{value} + 0.5 + 0.5 * sin({' + '.join(parts) or '0.3'})"
    return value


# --- readers ---------------------------------------------------------------------------------------------------------


def _reader(name: str, port: api.Port, folder: Path) -> type[api.Node] | None:
    """Return the class of a node that turns an output into a texture; None if the output is a texture."""
    value = api.Output(api.Any, format="rgba32f", doc="The values.")
    if isinstance(port, api.Function):
        shader = f"use_{name}.frag"
        (folder / shader).write_text(_call(port.signature), encoding="utf-8")
        many = port.signature.combine != ""
        read = api.Input(port.signature, kind="function", many=many, doc="The function.")
        return _node("Caller", read=read, made=value, shader=shader)
    if isinstance(port, api.Views):
        seen = api.Input(api.View, kind="view", doc="The view.")
        depth = api.Output(api.Depth, format="depth32f", clear=0.0, doc="The scene's depth.")
        return _node("Drawer", read=seen, made=depth, record=_draw)
    if getattr(port, "samples", None) not in (None, 1):
        read = api.Input(api.Any, samples="any", doc="The texture.")
        text = "uniform SAMPLER read;\nout vec4 made;\n"
        text += "void main() { made = vec4(texelFetch(read, ivec2(gl_FragCoord.xy), 0)); }\n"
        (folder / "use_samples.frag").write_text(text, encoding="utf-8")
        return _node("OneSample", read=read, made=value, record=_first_sample)
    if getattr(port, "kind", "") == "buffer":
        text = "layout(std430) readonly buffer read { uint words[]; };\nout vec4 made;\n"
        text += "void main() { made = vec4(words[uint(gl_FragCoord.x) % uint(words.length())]); }\n"
        (folder / "use_buffer.frag").write_text(text, encoding="utf-8")
        semantic = getattr(port, "semantic", None) or api.Any
        read = api.Input(semantic, kind="buffer", doc="The texture.")
        return _node("Words", read=read, made=value, shader="use_buffer.frag")
    return None


def _first_sample(self: Any, steps: api.Steps) -> None:
    desc = steps.desc(self.read)
    assert isinstance(desc, TextureDesc)
    kind = {"uint": "usampler2D", "int": "isampler2D"}.get(FORMATS[desc.format].family, "sampler2D")
    steps.fullscreen("use_samples.frag", defines={"SAMPLER": kind + ("MS" if desc.samples > 1 else "")})


def _draw(self: Any, steps: api.Steps) -> None:
    steps.geometry(None, vertex="<depth.vert>", out=self.made, view=self.read, materials="none")


def _call(signature: api.Signature) -> str:
    body = "vec4 at = fract(gl_FragCoord.xyxy * vec4(0.037, 0.041, 0.043, 0.047)) + 0.1; made = vec4(0.0);"
    return f"out vec4 made;\nvoid main() {{ {body} {' '.join(map(_added, signature.functions))} }}\n"


def _added(signature: api.Signature) -> str:
    arguments = signature.declaration.partition("(")[2].rpartition(")")[0]
    kinds = [argument.split()[-2] for argument in arguments.split(",") if argument.strip()]
    pattern = {"float": "at.x", "bool": "at.x > 0.5"} | {f"vec{count}": f"vec{count}(at)" for count in (2, 3, 4)}
    values = ", ".join(pattern.get(kind, f"{kind}(0)") for kind in kinds)  # with zeros, a term may have no effect
    result = signature.declaration.split()[0]
    column = "result[0]" if "mat" in result else "result"
    value = "vec4(result)" if result in ("float", "int", "uint", "bool") else f"vec4({column}.xxxx)"
    return f"{{ {result} result = {signature.name}({values}); made += {value}; }}"


def _node(name: str, *, shader: str | None = None, **attributes: Any) -> type[api.Node]:
    body = {"__module__": __name__, "__doc__": "Part of a check.", "shader": shader, **attributes}
    return type(name, (api.Node,), body)
