"""What a node calls in `record`: a list of requests, filled without GL."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, TypeAlias

from rendergraph.declare import Facts, InOut, LightFacts, Node, Output, Part, Port
from rendergraph.steps.model import UniformValue
from rendergraph.steps.state import State
from rendergraph.textures import BufferDesc, TextureDesc


class Recorder(Protocol):
    """What `Steps` asks of the stage that expands a graph; node authors never meet it."""

    facts: Facts

    def desc(self, port: Port) -> TextureDesc | BufferDesc:
        """What a port's texture or buffer is allocated from."""
        ...

    def used(self, port: Port) -> bool:
        """Whether anybody reads an output."""
        ...

    def needs(self, parameter: str) -> tuple[str, ...]:
        """What a plugin's choice of a parameter needs."""
        ...

    def add(self, request: Request) -> None:
        """Keep a request."""
        ...


@dataclass(frozen=True)
class Request:
    """What a node asked for, before its ports are mapped to resources."""

    kind: Literal["fullscreen", "geometry", "draw", "compute", "clear", "mipmaps"]
    shaders: tuple[tuple[str, str], ...] = ()
    out: tuple[tuple[str, Part], ...] = ()
    bindings: Mapping[str, Port | Part] = field(default_factory=dict)
    default_inputs: bool = False
    uniforms: Mapping[str, UniformValue] = field(default_factory=dict)
    defines: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)


Target: TypeAlias = "Port | Part"


class Steps:
    """The list a node fills in `record`.

    Textures a step reads are given by the name they have in the shader (`source=self.source`); with none named the
    step reads every connected input under its own name. Other keyword values become the step's uniforms. `out` is a
    port, a part, or a mapping from the shader's output names; without it the step writes every output of the node
    that is used. A texture with a depth format is attached as depth.
    """

    def __init__(self, node: Node, node_id: str, type_name: str, recorder: Recorder) -> None:
        self.node = node
        self.node_id = node_id
        self.type_name = type_name
        self._recorder = recorder

    # What is known before the schedule ------------------------------------------------------------------------------

    @property
    def facts(self) -> Facts:
        """Viewport, lights, and what the inputs carry."""
        return self._recorder.facts

    @property
    def lights(self) -> tuple[LightFacts, ...]:
        """The scene's lights, in its order."""
        return self.facts.lights

    def connected(self, port: Port) -> bool:
        """Whether anything is linked to an input."""
        return self.facts.connected(port.name)

    def used(self, port: Port) -> bool:
        """Whether anybody reads an output; one that nobody reads need not be written."""
        return self._recorder.used(port)

    def needs(self, parameter: str) -> tuple[str, ...]:
        """What a plugin's choice of a parameter says that it needs; nothing where the choice is the node's own."""
        return self._recorder.needs(parameter)

    def desc(self, port: Port) -> TextureDesc:
        """Size, format, mips and layers of a port's texture."""
        found = self._recorder.desc(port)
        assert isinstance(found, TextureDesc), f"{port.name} is a buffer"
        return found

    # Steps ----------------------------------------------------------------------------------------------------------

    def fullscreen(
        self,
        shader: str,
        *,
        out: Target | Mapping[str, Target] | None = None,
        state: State = State(),
        defines: Mapping[str, Any] | None = None,
        **bindings: Target | UniformValue,
    ) -> None:
        """One fragment shader over the whole target."""
        self._add("fullscreen", {"fragment": shader}, out, bindings, defines, state=state)

    def geometry(
        self,
        fragment: str | None,
        *,
        vertex: str = "<geometry.vert>",
        geometry: str | None = None,
        out: Target | Mapping[str, Target] | None = None,
        state: State = State(),
        defines: Mapping[str, Any] | None = None,
        view: Port | None = None,
        view_index: int | None = 0,
        objects: str | Sequence[str] = "all",
        materials: Literal["full", "alpha", "none"] = "full",
        order: Literal["front_to_back", "back_to_front", "scene"] = "front_to_back",
        per_light: int | None = None,
        **bindings: Target | UniformValue,
    ) -> None:
        """The scene's objects, one indirect multi-draw a batch.

        Args:
            fragment: fragment shader, None for depth alone.
            vertex, geometry: other stages; the default vertex shader transforms by object and view.
            out, state, defines, bindings: see the class.
            view: a `Views` port or a `view` input; the node's connected `view` input, else the pipeline's camera.
            view_index: which view of it, None where a geometry shader sets `gl_Layer`.
            objects: `all`, `opaque`, `transparent`, `casters`, or object names.
            materials: what of the material the shader looks at.
            order: `front_to_back`, `back_to_front` or `scene`.
            per_light: one light's index, for a pass a light.
        """
        shaders = {"vertex": vertex, "geometry": geometry, "fragment": fragment}
        self._add(
            "geometry", shaders, out, bindings, defines, state=state, view=view, view_index=view_index,
            objects=objects if isinstance(objects, str) else tuple(objects), materials=materials, order=order,
            per_light=per_light,
        )  # fmt: skip

    def draw(
        self,
        fragment: str | None,
        *,
        vertex: str,
        vertices: int | Port,
        attributes: Mapping[str, Port] | None = None,
        geometry: str | None = None,
        topology: str = "triangles",
        instances: int = 1,
        out: Target | Mapping[str, Target] | None = None,
        state: State = State(),
        defines: Mapping[str, Any] | None = None,
        view: Port | None = None,
        view_index: int | None = 0,
        **bindings: Target | UniformValue,
    ) -> None:
        """A draw over the node's own buffers.

        Args:
            fragment, vertex, geometry: shaders.
            vertices: how many, or a buffer port whose first four 32-bit integers are the indirect draw command
                (count, instances, first, base instance).
            attributes: layout to buffer port, the layout as `3f 2f in_position in_uv`.
            topology, instances: as in OpenGL.
            out, state, defines, bindings: see the class.
            view, view_index: as for `geometry`.
        """
        shaders = {"vertex": vertex, "geometry": geometry, "fragment": fragment}
        self._add(
            "draw", shaders, out, bindings, defines, state=state, vertices=vertices, topology=topology, view=view,
            view_index=view_index, instances=instances, attributes=dict(attributes or {}),
        )  # fmt: skip

    def compute(
        self,
        shader: str,
        *,
        groups: tuple[int, int, int],
        out: Target | Mapping[str, Target] | None = None,
        defines: Mapping[str, Any] | None = None,
        **bindings: Target | UniformValue,
    ) -> None:
        """A compute dispatch: `out` is bound as images and buffers; barriers follow from who reads them next."""
        self._add("compute", {"compute": shader}, out, bindings, defines, groups=groups)

    def clear(self, out: Target, value: float | tuple[float, ...] = 0.0) -> None:
        """Fill a texture with one value."""
        self._add("clear", {}, out, {}, None, value=value)

    def mipmaps(self, out: Port) -> None:
        """Make mips 1 and up from mip 0 by 2×2 averages."""
        self._add("mipmaps", {}, out, {}, None)

    def _add(
        self,
        kind: Literal["fullscreen", "geometry", "draw", "compute", "clear", "mipmaps"],
        shaders: Mapping[str, str | None],
        out: Target | Mapping[str, Target] | None,
        bindings: Mapping[str, Target | UniformValue],
        defines: Mapping[str, Any] | None,
        **options: Any,
    ) -> None:
        targets: dict[str, Target]
        if out is None:
            targets = {
                name: port
                for name, port in self.node.ports().items()
                if isinstance(port, Output | InOut) and self.used(port)
            }
        elif isinstance(out, Port | Part):
            targets = {(out if isinstance(out, Port) else out.port).name: out}
        else:
            targets = dict(out)
        textures = {name: value for name, value in bindings.items() if isinstance(value, Port | Part)}
        uniforms = {name: value for name, value in bindings.items() if not isinstance(value, Port | Part)}
        self._recorder.add(
            Request(
                kind=kind,
                shaders=tuple((stage, file) for stage, file in shaders.items() if file is not None),
                out=tuple((name, part if isinstance(part, Part) else Part(part)) for name, part in targets.items()),
                bindings=textures,
                default_inputs=not textures and kind in ("fullscreen", "geometry", "draw", "compute"),
                uniforms=uniforms,
                defines={name: define_text(value) for name, value in (defines or {}).items()},
                options=options,
            )
        )


def define_text(value: object) -> str:
    """A Python value as macro text."""
    if isinstance(value, bool):
        return "1" if value else "0"
    return repr(value) if isinstance(value, float) else str(value)
