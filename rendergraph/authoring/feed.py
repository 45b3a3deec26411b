"""What stands around a node that is checked: sources for its inputs, and readers for what no file can show.

Each source is a node of its own whose class and shader are made from the port it feeds. Its texture holds a smooth
pattern of values that the port's semantic allows, and carries the camera's view and the scene's first light, so that
whatever a reader may be given is there.
"""

from __future__ import annotations

import json
import re
import types
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rendergraph.api import Any as AnyTexel
from rendergraph.api import (
    Depth,
    Frame,
    Function,
    InOut,
    Input,
    Node,
    Output,
    Port,
    Radiance,
    Semantic,
    Signature,
    Steps,
    View,
    Views,
)
from rendergraph.authoring.variants import Variant
from rendergraph.catalog import Catalog, NodeType
from rendergraph.ports import Samples
from rendergraph.textures import FORMATS, TEXTURE_KINDS, TextureDesc

SIZE = (37, 23)
"""Of the picture: small, and no multiple of what work groups have."""

_VALUES = {  # by semantic, of `vec2 at` from 0 to 1 and `float wave` from 0 to 1
    "radiance": "vec4(4.0 * wave * at, 2.0 * wave, 1.0)",
    "emissive": "vec4(wave * at, 0.0, 1.0)",
    "normal": "vec4(normalize(vec3(2.0 * at - 1.0, 0.5 + wave)), 1.0)",
    "linear_depth": "vec4(1.0 + 9.0 * wave)",
}
_ANY_VALUE = "vec4(at, wave, 1.0)"
_DEPTHS = ("depth", "shadow_map")
_BUFFER_BYTES = 1 << 20
_FROM = "from-"  # before the name of what feeds an input; no port has it


@dataclass
class Surrounded:
    """A node type among sources and readers.

    Attributes:
        checked: what is checked.
        folder: where shaders and pipelines of the surroundings are written.
        sources: input to the type that feeds it.
        multisampled: input that takes one sample a texel or several, to the type that feeds it several.
        readers: output to the type that reads it.
    """

    checked: NodeType
    folder: Path
    sources: dict[str, NodeType] = field(default_factory=dict)
    multisampled: dict[str, NodeType] = field(default_factory=dict)
    readers: dict[str, NodeType] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, port in self.checked.cls.inputs().items():
            if isinstance(port, Input) and port.takes_scene:
                continue  # the scene has one
            samples = _samples(port)
            single: Samples = 4 if samples == "multi" else 1
            self.sources[name] = self._added("feed", name, _source(name, port, self.folder, single))
            if samples == "any" and port.kind in TEXTURE_KINDS:
                self.multisampled[name] = self._added("feed_samples", name, _source(name, port, self.folder, 4))
        for name, output in self.checked.cls.outputs().items():
            reader = _reader(name, output, self.folder)
            if reader is not None:
                self.readers[name] = self._added("use", name, reader)

    @property
    def fed(self) -> list[str]:
        """The inputs that are fed a texture which can be read back."""
        ports = self.checked.cls.inputs()
        return [name for name in self.sources if ports[name].kind in TEXTURE_KINDS and _samples(ports[name]) != "multi"]

    def _added(self, word: str, name: str, cls: type[Node]) -> NodeType:
        return NodeType(f"check_{word}_{name}", "", cls, Path(__file__), self.folder, "check-node")

    def catalog(self) -> Catalog:
        """The node's type and those around it."""
        around = (*self.sources.values(), *self.multisampled.values(), *self.readers.values())
        return Catalog({}, {entry.name: entry for entry in (self.checked, *around)})

    def pipeline(self, variant: Variant, scene: str) -> dict[str, Any]:
        """A pipeline file of one variant, as plain values; outputs are what feeds the node, then the node's.

        A variant without outputs is the sources alone.
        """
        cls, node = self.checked.cls, self.checked.name
        nodes: dict[str, Any] = {}
        inputs: dict[str, Any] = {}
        outputs: dict[str, str] = {}
        for name, source in self.sources.items():
            if name in variant.left_out:
                continue
            port = cls.inputs()[name]
            several = variant.multisampled and name in self.multisampled
            source = self.multisampled[name] if several else source
            nodes[source.name] = {"type": source.name}
            link = f"{source.name}.made"
            inputs[name] = [link] if isinstance(port, Input) and port.many else link
            if name in self.fed and not several:
                outputs[_FROM + name] = link
        if variant.outputs:
            nodes[node] = {"type": node, "inputs": inputs, "params": dict(variant.params)}
        for name in variant.outputs:
            reader = self.readers.get(name)
            if reader is None:
                outputs[name] = f"{node}.{name}"
            else:
                nodes[reader.name] = {"type": reader.name, "inputs": {"read": f"{node}.{name}"}}
                outputs[name] = f"{reader.name}.made"
        return {"rendergraph": 1, "size": list(SIZE), "scene": scene, "nodes": nodes, "outputs": outputs}

    def input_of(self, output: str) -> str:
        """The input that an output of the pipeline feeds; empty for an output of the node."""
        return output.removeprefix(_FROM) if output.startswith(_FROM) else ""

    def write(self, variant: Variant, scene: str) -> Path:
        """The pipeline of a variant as a file; JSON is YAML."""
        file = self.folder / "check.yaml"
        file.write_text(json.dumps(self.pipeline(variant, scene)), encoding="utf-8")
        return file


# --- sources ---------------------------------------------------------------------------------------------------------


def _samples(port: Input | InOut) -> str:
    """Which numbers of samples a port takes: `single`, `multi`, `any`."""
    return port.samples if isinstance(port, Input) else "single"


def _source(name: str, port: Input | InOut, folder: Path, samples: Samples) -> type[Node]:
    """The class of a node that feeds a port."""
    semantic = port.semantic
    if isinstance(semantic, Signature):
        return _function_source(semantic, folder)
    if port.kind == "view":
        return _node("Seen", made=Views(doc="The camera's view."), update=_camera("made"))
    if port.kind == "buffer":
        made = Output(AnyTexel, kind="buffer", bytes=_BUFFER_BYTES, doc="Zeros.")
        return _node("Zeros", made=made, record=lambda self, steps: steps.clear(self.made))
    assert port.kind != "function"  # whose semantic is a signature
    meaning = Radiance if semantic is None or semantic.name == "any" else semantic
    given = port.format if isinstance(port, InOut) and isinstance(port.format, str) else None
    image = isinstance(port, Input) and port.use == "image"
    depth = meaning.name in _DEPTHS or (given is not None and FORMATS[given].is_depth)
    format = given or ("depth32f" if depth else "rgba16f" if image else "rgba32f")
    layers = {"texture2d": 1, "texture_cube": 6}.get(port.kind, 1 if _has_lights(meaning) else 2)
    shader = f"feed_{name}.frag"
    (folder / shader).write_text(_pattern(meaning, format), encoding="utf-8")

    def record(self: Any, steps: Steps) -> None:
        targets = [self.made] if port.kind == "texture2d" else [self.made.layer(layer) for layer in range(layers)]
        for target in targets:
            steps.fullscreen(shader, out={"made": target})

    made = Output(
        meaning,
        kind=port.kind,
        format=format,
        layers=layers if port.kind == "texture2d_array" else None,
        size=(24, 24) if port.kind == "texture_cube" else None,
        samples=samples,
        view="views",
        lights=_first_light if _has_lights(meaning) else None,
        doc="A pattern.",
    )
    views = Views(count=layers, public=False, doc="The camera's view for each layer.")
    return _node("Pattern", made=made, views=views, record=record, update=_camera("views", layers))


def _has_lights(semantic: Semantic) -> bool:
    return semantic.name in ("shadow_map", "visibility")


def _first_light(node: Any, facts: Any) -> tuple[int, ...]:
    return (0,)


def _pattern(semantic: Semantic, format: str) -> str:
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
    """An `update` that sets a table to the camera's view."""

    def update(self: Any, frame: Frame) -> None:
        frame.set_views(getattr(self, port), [frame.camera] * count)

    return update


def _function_source(signature: Signature, folder: Path) -> type[Node]:
    """A function that is neutral where a texture may stand for it, and else differs with each of its arguments."""
    shader = f"{signature.name}_fed.glsl"
    kind, value = signature.declaration.split()[0], signature.neutral
    if signature.texture is None and kind.startswith("vec"):
        takes = re.findall(r"(\w+)\s+(\w+)\s*[,)]", signature.declaration)
        parts = [f"dot({name}, {of}(0.3))" for of, name in takes if of in ("vec2", "vec3", "vec4")]
        parts += [f"0.3 * float({name})" for of, name in takes if of in ("float", "int", "uint", "bool")]
        value = f"{value} + 0.5 + 0.5 * sin({' + '.join(parts) or '0.3'})"
    (folder / shader).write_text(f"{signature.declaration} {{ return {value}; }}\n", encoding="utf-8")
    return _node("Called", made=Function(signature, shader=shader, doc="A pattern."))


# --- readers ---------------------------------------------------------------------------------------------------------


def _reader(name: str, port: Port, folder: Path) -> type[Node] | None:
    """The class of a node that makes a texture of what is none itself; None where a file can show the port."""
    value = Output(AnyTexel, format="rgba32f", doc="What was read.")
    if isinstance(port, Function):
        shader = f"use_{name}.frag"
        (folder / shader).write_text(_call(port.signature), encoding="utf-8")
        read = Input(port.signature, kind="function", many=True, doc="What is called.")
        return _node("Caller", read=read, made=value, shader=shader)
    if isinstance(port, Views):
        seen = Input(View, kind="view", doc="What is drawn with.")
        depth = Output(Depth, format="depth32f", clear=0.0, doc="The scene's depth.")
        return _node("Drawer", read=seen, made=depth, record=_draw)
    if getattr(port, "samples", None) not in (None, 1):
        read = Input(AnyTexel, samples="any", doc="What is read.")
        text = "uniform SAMPLER read;\nout vec4 made;\n"
        text += "void main() { made = vec4(texelFetch(read, ivec2(gl_FragCoord.xy), 0)); }\n"
        (folder / "use_samples.frag").write_text(text, encoding="utf-8")
        return _node("OneSample", read=read, made=value, record=_first_sample)
    if getattr(port, "kind", "") == "buffer":
        (folder / "use_buffer.frag").write_text(
            "layout(std430) readonly buffer read { uint words[]; };\nout vec4 made;\n"
            "void main() { made = vec4(words[uint(gl_FragCoord.x) % uint(words.length())]); }\n",
            encoding="utf-8",
        )
        semantic = getattr(port, "semantic", None) or AnyTexel
        read = Input(semantic, kind="buffer", doc="What is read.")
        return _node("Words", read=read, made=value, shader="use_buffer.frag")
    return None


def _first_sample(self: Any, steps: Steps) -> None:
    desc = steps.desc(self.read)
    assert isinstance(desc, TextureDesc)
    kind = {"uint": "usampler2D", "int": "isampler2D"}.get(FORMATS[desc.format].family, "sampler2D")
    steps.fullscreen("use_samples.frag", defines={"SAMPLER": kind + ("MS" if desc.samples > 1 else "")})


def _draw(self: Any, steps: Steps) -> None:
    steps.geometry(None, vertex="<depth.vert>", out=self.made, view=self.read, materials="none")


def _call(signature: Signature) -> str:
    """A shader that calls a function with zeros."""
    arguments = signature.declaration.partition("(")[2].rpartition(")")[0]
    kinds = [argument.split()[-2] for argument in arguments.split(",") if argument.strip()]
    zeros = ", ".join(f"{kind}(0)" for kind in kinds)
    result = signature.declaration.split()[0]
    column = "result[0]" if "mat" in result else "result"
    value = "vec4(result)" if result in ("float", "int", "uint", "bool") else f"vec4({column}.xxxx)"
    return f"out vec4 made;\nvoid main() {{ {result} result = {signature.name}({zeros}); made = {value}; }}\n"


def _node(name: str, *, shader: str | None = None, **attributes: Any) -> type[Node]:
    """A node class made of ports and functions."""
    body = {"__module__": __name__, "__doc__": "Made for a check.", "shader": shader, **attributes}
    return types.new_class(name, (Node,), exec_body=lambda space: space.update(body))
