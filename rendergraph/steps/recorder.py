"""The interface of `record`: a list of requests, filled without GL."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from hashlib import sha1
from types import FrameType
from typing import Annotated, Any, Literal, Protocol, TypeAlias

from msgspec import Struct, field

from rendergraph.errors import Misuse, is_framework
from rendergraph.facts import Facts, LightFacts
from rendergraph.ports import Count, InOut, Input, Output, Part, Port, Positive, Shader, Texel, Views
from rendergraph.steps import checks
from rendergraph.steps.checks import Counts, Macro, checked
from rendergraph.steps.model import DrawOrder, MaterialLevel, SceneSource, State, Topology, UniformValue, Upload
from rendergraph.textures import BufferDesc, TextureDesc
from rendergraph.typecheck import quoted


# Methods of protocols have no bodies.
# pyright: reportReturnType=false
class Recorder(Protocol):
    """The interface of `Steps` to the stage that expands a graph; node authors never use it."""

    @property
    def facts(self) -> Facts:
        """Facts about the graph and the scene."""

    def desc(self, port: Port) -> TextureDesc | BufferDesc:
        """Return the description of a port's texture or buffer."""

    def used(self, port: Port) -> bool:
        """Whether any node reads an output."""

    def needs(self, parameter: str) -> tuple[str, ...]:
        """Return the needs of a parameter's choice."""

    def reads(self, out: Iterable[Part]) -> Mapping[str, Port]:
        """Return the inputs that a step reads if it names none."""

    def add(self, request: StepRequest) -> None:
        """Add a request."""


class StepRequest(Struct, frozen=True, gc=False):
    """A step as the node requested it, before its ports are mapped to resources.

    `caller` is the author's file and line of the call, None if the framework recorded the step; `reads_all` means that
    the call names no input, so the step reads all connected ones.
    """

    kind: Literal["fullscreen", "geometry", "draw", "compute", "clear", "mipmaps", "resolve", "upload"]
    shaders: tuple[tuple[str, str], ...] = ()
    out: tuple[tuple[str, Part], ...] = ()
    bindings: Mapping[str, Port | Part] = field(default_factory=dict)
    uniforms: Mapping[str, UniformValue] = field(default_factory=dict)
    defines: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    caller: tuple[str, int] | None = None
    reads_all: bool = False

    @property
    def reads(self) -> Iterator[Port | Part]:
        """Yield the ports whose textures, buffers or functions it reads."""
        yield from self.bindings.values()
        yield from self.options.get("attributes", {}).values()
        for name in BUFFER_OPTIONS:
            if isinstance(self.options.get(name), Port):
                yield self.options[name]


BUFFER_OPTIONS = ("vertices", "indices", "groups", "instances", "count", "object_commands")
"""Options of a step that may name a buffer."""
_COMMAND_BYTES = 20  # size of a draw command
Target: TypeAlias = Port | Part
Defines: TypeAlias = Annotated[Mapping[str, Macro], "a mapping from macros to values"]
IN_PLACE = ("<geometry.vert>", "<depth.vert>")
"""The vertex shaders known to keep objects in place."""
Objects: TypeAlias = Annotated[str | Sequence[str], "all, opaque, transparent, casters or a list of objects' names"]


class Steps:
    """The list of steps that a node fills in `record`.

    Input textures are keywords with their names in the shader (`source=self.source`); a step that names none reads
    every connected input under its own name, except those given as None (`source=None`). Other keyword values become
    the step's uniforms. `out` is a port, a part, or a mapping from the shader's output names; by default the step
    writes every used output of the node. A texture with a depth format is attached as depth. In drawing steps
    `port.stored()` binds a texture as an image, and a buffer is bound as a storage block. Ports that a subclass drops
    are None and are ignored. A step with a `region` number draws in the rectangle that `update` sets for that number
    (`Frame.set_region`), and before that everywhere. A `label` is the step's name in plans and `bench --steps`, in
    addition to its node and number. `if_drawn` is the label of an earlier step of the node: if that step drew nothing,
    the device skips this one, without the CPU waiting for the result.
    """

    def __init__(self, ports: Mapping[str, Port], node_id: str, type_name: str, recorder: Recorder) -> None:
        self.ports = ports
        self.node_id = node_id
        self.type_name = type_name
        self._recorder = recorder

    # Queries before scheduling ------------------------------------------------------------------------------

    @property
    def facts(self) -> Facts:
        """Viewport, lights, and the textures at the inputs."""
        return self._recorder.facts

    @property
    def lights(self) -> tuple[LightFacts, ...]:
        """The scene's lights, in its order."""
        return self.facts.lights

    def connected(self, port: Port | None) -> bool:
        """Return whether an input is connected; False for one that the class drops."""
        if port is None:
            return False
        return self.facts.connected(checks.declared_port(self.ports, port, "connected's argument").name)

    def used(self, port: Port | None) -> bool:
        """Return whether any node reads an output; unused ones, and ones that the class drops, need not be written."""
        return port is not None and self._recorder.used(checks.declared_port(self.ports, port, "used's argument"))

    def draws(self, objects: str | Sequence[str]) -> bool:
        """Return whether a geometry step with these `objects` would draw anything: `transparent`, …, or names."""
        return bool(self.facts.drawn(checks.objects(objects)))

    def needs(self, parameter: str) -> tuple[str, ...]:
        """Return the needs of a parameter's choice, if its choices are includes."""
        return self._recorder.needs(parameter)

    def desc(self, port: Port) -> TextureDesc:
        """Return size, format, mips and layers of a port's texture.

        Raises:
            Misuse: it is not a port of this node, holds no texture, or is an input that is not connected.
        """
        own = checks.declared_port(self.ports, port, "desc's argument")
        found = self._desc(own)
        if found is None:
            raise checks.unconnected(own)
        if isinstance(found, BufferDesc):
            raise Misuse(f"'{own.name}' holds no texture; its description has no size or format")
        return found

    def _check_buffer(self, name: str, value: object, least: int = 0) -> None:
        port = checks.buffer(self.ports, value, name)
        self._connected(port)
        if isinstance(desc := self._desc(port), BufferDesc) and desc.bytes < least:
            raise Misuse(f"{name} reads {least} bytes of '{port.name}', which holds {desc.bytes}")

    def _connected(self, port: Port) -> None:
        if isinstance(port, Input) and not self.facts.connected(port.name):
            raise checks.unconnected(port)

    def _desc(self, port: Port) -> TextureDesc | BufferDesc | None:
        if isinstance(port, Input) and not self.facts.connected(port.name):
            return None
        return self._recorder.desc(port)

    # Steps ----------------------------------------------------------------------------------------------------------

    @checked
    def fullscreen(
        self,
        shader: Shader,
        *,
        out: Target | Mapping[str, Target] | None = None,
        state: State = State(),
        region: Count | None = None,
        if_drawn: str = "",
        defines: Defines | None = None,
        label: str = "",
        **bindings: Target | UniformValue | None,
    ) -> None:
        """Run one fragment shader over the whole target."""
        options = {"label": label, "state": state, "region": region, "if_drawn": if_drawn}
        self._add("fullscreen", {"fragment": shader}, out, bindings, defines, **options)

    @checked
    def geometry(
        self,
        fragment: Shader | None,
        *,
        vertex: Shader = "<geometry.vert>",
        geometry: Shader | None = None,
        out: Target | Mapping[str, Target] | None = None,
        state: State = State(),
        region: Count | None = None,
        if_drawn: str = "",
        defines: Defines | None = None,
        label: str = "",
        view: Port | None = None,
        view_index: Count | None = 0,
        objects: Objects = "all",
        materials: MaterialLevel = "full",
        order: DrawOrder = "front_to_back",
        in_place: bool | None = None,
        per_light: Count | None = None,
        topology: Literal["triangles", "triangles_adjacency"] = "triangles",
        commands: Port | None = None,
        **bindings: Target | UniformValue | None,
    ) -> None:
        """Draw the scene's objects, with one indirect multi-draw per batch.

        Args:
            fragment: fragment shader, None for depth only.
            vertex, geometry: other stages; the default vertex shader transforms by object and view.
            out, state, region, if_drawn, defines, label, bindings: see the class.
            view: a `Views` port, a `view` input or a texture that carries one; by default the node's connected `view`
                input, else the pipeline's camera.
            view_index: index of the view, None if a geometry shader sets `gl_Layer`.
            objects: `all`, `opaque`, `transparent`, `casters`, an object's name or several.
            materials: the part of the material that the shader uses.
            order: `front_to_back`, `back_to_front` or `scene`.
            in_place: whether triangles stay where the objects are, so that objects outside the view (with
                `view_index=None` outside all views) are culled. By default true for `<geometry.vert>` and
                `<depth.vert>` without a geometry shader; set it for your own shaders if it holds.
            per_light: one light's index, for a pass per light.
            topology: `triangles_adjacency` gives a geometry shader six vertices per triangle: after each corner the
                vertex across the edge to the next one; vertices with equal positions count as one. The objects must be
                `closed`.
            commands: a buffer port with a draw command for every object of the scene, in its order, written by an
                earlier step: `DrawCommand` of `#include <scene.glsl>`. The step draws those of its `objects` whose
                command has an instance, in the scene's order. It culls none of them; that is up to the shader that
                writes the commands.
        """
        if commands is not None:
            if order == "back_to_front" or topology == "triangles_adjacency":
                wrong = "order='back_to_front'" if order == "back_to_front" else "topology='triangles_adjacency'"
                raise Misuse(f"both commands and {wrong} are given; commands draw triangles in the scene's order")
            self._check_buffer("commands", commands, _COMMAND_BYTES * len(self.facts.objects))
        if per_light is not None and per_light >= len(self.lights):
            raise Misuse(f"per_light is {per_light}, but the scene has {len(self.lights)} lights, counted from 0")
        shaders = {"vertex": vertex, "geometry": geometry, "fragment": fragment}
        if in_place is None:
            in_place = vertex in IN_PLACE and geometry is None
        target = {"label": label, "state": state, "region": region, "if_drawn": if_drawn}
        camera = {"view": view, "view_index": view_index, "in_place": in_place}
        selection = {"objects": checks.objects(objects), "materials": materials, "order": order, "per_light": per_light}
        options = target | camera | selection | {"topology": topology, "object_commands": commands}
        self._add("geometry", shaders, out, bindings, defines, **options)

    @checked
    def draw(
        self,
        fragment: Shader | None,
        *,
        vertex: Shader,
        vertices: Count | Port,
        command: Count = 0,
        commands: Positive = 1,
        count: Port | None = None,
        indices: Port | None = None,
        attributes: Mapping[str, Port] | None = None,
        geometry: Shader | None = None,
        topology: Topology = "triangles",
        instances: Count | Port = 1,
        out: Target | Mapping[str, Target] | None = None,
        state: State = State(),
        region: Count | None = None,
        defines: Defines | None = None,
        label: str = "",
        view: Port | None = None,
        view_index: Count | None = 0,
        **bindings: Target | UniformValue | None,
    ) -> None:
        """Draw the node's own buffers.

        Args:
            fragment, vertex, geometry: shaders.
            vertices: a count, or a buffer port with indirect draw commands: four 32-bit integers (count, instances,
                first, base instance) and an ignored one; with `indices` five (count, instances, first index, base
                vertex, base instance).
            command, commands: the first command, from 0, and the number of commands. An earlier step may write
                fewer: a command of zeros draws nothing.
            count: a buffer port whose first 32-bit integer is the number of `commands` to draw. Commands beyond it
                must be zeros: a driver without `GL_ARB_indirect_parameters` draws them, too.
            indices: a buffer port of 32-bit indices.
            attributes: layout to buffer port, with layouts such as `3f 2f in_position in_uv`; with `/i` after the
                formats (`4f/i in_color`) they advance per instance.
            topology: as in OpenGL.
            instances: a number, or a buffer port whose first 32-bit integer is the number.
            out, state, region, defines, label, bindings: see the class.
            view, view_index: as for `geometry`.
        """
        if isinstance(vertices, Port | Part):
            self._check_buffer("vertices", vertices, 20 * (command + commands) - (4 if indices is None else 0))
        else:
            checks.check_argument("vertices", vertices, Count)
        is_indirect = isinstance(vertices, Port | Part)
        if count is not None:
            if not is_indirect:
                raise Misuse("count is given without commands; give vertices=BUFFER, or instances=BUFFER")
            self._check_buffer("count", count, 4)
        if isinstance(instances, Port | Part):
            if is_indirect:
                raise Misuse("both vertices and instances are buffers; a command holds its number of instances")
            self._check_buffer("instances", instances, 4)
        else:
            checks.check_argument("instances", instances, Count)
        if indices is not None:
            self._check_buffer("indices", indices)
        buffers = checks.attributes(self.ports, attributes)
        for port in buffers.values():
            self._connected(port)
        shaders = {"vertex": vertex, "geometry": geometry, "fragment": fragment}
        target = {"label": label, "state": state, "region": region, "view": view, "view_index": view_index}
        source = {"vertices": vertices, "command": command, "commands": commands, "indices": indices, "count": count}
        shape = {"topology": topology, "instances": instances, "attributes": buffers}
        self._add("draw", shaders, out, bindings, defines, **target, **source, **shape)

    @checked
    def compute(
        self,
        shader: Shader,
        *,
        over: Target | Counts | None = None,
        groups: Counts | Port | None = None,
        command: Count = 0,
        out: Target | Mapping[str, Target] | None = None,
        defines: Defines | None = None,
        label: str = "",
        **bindings: Target | UniformValue | None,
    ) -> None:
        """Dispatch a compute shader, with `out` bound as images and buffers; barriers are added automatically.

        Args:
            shader: the compute shader, whose `layout(local_size_x = …)` is the size of a work group.
            over: a texture to cover with one invocation per texel, or the number of invocations along x, y and z. By
                default the first texture that it writes, else the first that it reads. The last work groups may extend
                beyond the edge; the shader must skip those invocations.
            groups: the number of work groups instead, or a buffer port that holds it: three 32-bit integers.
            command: index of the triple, from 0.
            out, defines, label, bindings: see the class.
        """
        if groups is not None and over is not None:
            raise Misuse("both over and groups are given; over determines the number of groups")
        if isinstance(groups, Port | Part):
            self._check_buffer("groups", groups, 12 * (command + 1))
        options: dict[str, Any] = {"over": over}
        if groups is not None:
            given = groups if isinstance(groups, Port) else checks.counts("groups", groups)
            options = {"groups": given, "command": command}
        self._add("compute", {"compute": shader}, out, bindings, defines, label=label, **options)

    def clear(self, out: Target, value: float | tuple[float, ...] = 0.0) -> None:
        """Fill a texture with one value in every channel, or one per channel; a buffer with 0."""
        part = checks.part_of(self.ports, out, "out")
        numbers = checks.uniform("value", value)
        checks.check_argument("value", numbers, Texel)
        if getattr(part.port, "kind", "") == "buffer" and numbers != 0:
            raise Misuse(f"'{part.port.name}' is a buffer, which can only be cleared to 0")
        self._add("clear", {}, out, {}, None, value=numbers)

    @checked
    def upload(self, out: Target, values: Any, *, changes_with: Sequence[SceneSource] = (), label: str = "") -> None:
        """Upload values from the CPU to a texture or buffer.

        They are computed once, and again when a parameter of the node or anything in `changes_with` has changed. They
        are uploaded again after such a change, or when their memory was reused, which `kept=True` prevents.

        Args:
            out: a port, or a mip or layer of it.
            values: an array, or a function that takes a `FrameScene` and returns one. For a texture its shape is
                (height, width, channels), preceded by layers or depth if there are several; axes of length 1 may be
                left out. `texelFetch` at (x, y) reads `values[y, x]`. Formats with 8-bit channels take bytes, or
                floats from 0 to 1. A buffer takes an array of any shape, in its own type.
            changes_with: the parts of the scene that the function uses: `transforms`, `lights`, `materials`,
                `environment`, `camera`; plugins' keys belong to their section, those of objects to `transforms`.
            label: see the class.
        """
        part = checks.part_of(self.ports, out, "out")
        targets = checks.targets(self.ports, part)
        if desc := self._desc(part.port):
            checks.check_part(part, desc)
        if callable(values):
            function = getattr(values, "__func__", values)  # a reimported module has new functions
            content = f"{id(function):#x} of {getattr(values, '__self__', None)!r}"
        else:
            values = checks.texels(part.port.name, values, desc, part.mip, part.layer)
            content = f"{values.dtype} {values.shape} {sha1(values.tobytes()).hexdigest()}"
        given: dict[str, Any] = {"values": Upload(values, tuple(changes_with), content)}
        out_of, caller = tuple(targets.items()), _caller()
        self._recorder.add(StepRequest("upload", out=out_of, uniforms=given, options={"label": label}, caller=caller))

    def mipmaps(self, out: Port) -> None:
        """Generate mips 1 and up from mip 0 by 2×2 averages."""
        port = checks.declared_port(self.ports, out, "out")
        if isinstance(out, Part):
            raise Misuse(f"out is a part of '{port.name}'; mips are generated for whole textures")
        desc = self._desc(port)
        if isinstance(desc, BufferDesc) or (desc is not None and desc.mips == 1):
            raise Misuse(f"'{port.name}' has no mips to generate; declare it with mips=0 for the whole chain")
        self._add("mipmaps", {}, out, {}, None)

    def resolve(self, source: Port, out: Port) -> None:
        """Resolve the samples of `source` to their mean on the device: correct only for colours.

        A mean of depths, unit vectors or integers is meaningless: use a shader that chooses a sample instead.
        """
        ports = checks.declared_port(self.ports, source, "source"), checks.declared_port(self.ports, out, "out")
        checks.check_resolve(*ports, [self._desc(port) for port in ports])
        self._add("resolve", {}, out, {"source": source}, None)

    def _add(
        self,
        kind: Literal["fullscreen", "geometry", "draw", "compute", "clear", "mipmaps", "resolve"],
        shaders: Mapping[str, str | None],
        out: Target | Mapping[str, Target] | None,
        bindings: Mapping[str, Target | UniformValue | None],
        defines: Defines | None,
        **options: Any,
    ) -> None:
        if out is None:
            written = {name: port for name, port in self.ports.items() if isinstance(port, Output | InOut)}
            targets = {name: port.whole for name, port in written.items() if self._recorder.used(port)}
        else:
            targets = checks.targets(self.ports, out)
        textures, uniforms = self._bindings(bindings)
        for part in (*targets.values(), *textures.values()):
            if isinstance(part, Part) and (part.mip, part.layer) != (None, None) and (desc := self._desc(part.port)):
                checks.check_part(part, desc)
        if options.get("view") is not None:
            view = checks.declared_port(self.ports, options["view"], "view")
            if not isinstance(view, Views | Input | InOut):
                raise Misuse(f"view is {quoted(view)}; it is a Views port or an input that carries views")
        if "over" in options:
            options["invocations"] = self._invocations(options.pop("over"), targets, textures)
        reads: Mapping[str, Target] = textures
        caller, reads_all = _caller(), not textures and kind in ("fullscreen", "geometry", "draw", "compute")
        if reads_all:
            every = self._recorder.reads(targets.values())
            reads = {name: port for name, port in every.items() if bindings.get(name, port) is not None}
        request = StepRequest(
            kind=kind,
            shaders=tuple([(stage, file) for stage, file in shaders.items() if file is not None]),
            out=tuple(targets.items()),
            bindings=reads,
            uniforms=uniforms,
            defines={name: checks.macro(name, value) for name, value in (defines or {}).items()},
            options=options,
            caller=caller,
            reads_all=reads_all and caller is not None and bool(reads),
        )
        self._recorder.add(request)

    def _bindings(
        self, bindings: Mapping[str, Target | UniformValue | None]
    ) -> tuple[dict[str, Target], dict[str, UniformValue]]:
        """Split keyword arguments into a step's reads, by names in the shader, and its uniforms."""
        textures: dict[str, Target] = {}
        uniforms: dict[str, UniformValue] = {}
        for name, value in bindings.items():
            if value is None and isinstance(self.ports.get(name), Input | InOut | None):
                continue  # an input that the step does not read, or a port that the class drops
            if not isinstance(value, Port | Part):
                uniforms[name] = checks.uniform(name, value)
                continue
            port = checks.declared_port(self.ports, value, name)
            if isinstance(port, Views):
                raise Misuse(f"{name} is the view table '{port.name}'; give it as `view=` to a step that draws")
            textures[name] = checks.part_of(self.ports, value, name) if isinstance(value, Part) else port
        return textures, uniforms

    def _invocations(
        self, over: Target | Counts | None, targets: Mapping[str, Part], reads: Mapping[str, Target]
    ) -> tuple[int, int, int]:
        """Return how many invocations a dispatch needs along each axis."""
        if over is not None and not isinstance(over, Port | Part | str):
            return checks.counts("over", over)
        if over is not None:
            part = checks.part_of(self.ports, over, "over")
            desc = self._desc(part.port)
            if isinstance(desc, BufferDesc):
                raise Misuse(f"over is the buffer '{part.port.name}'; give the number of invocations, as in over=256")
            if desc is None:
                raise Misuse(f"over is input '{part.port.name}', which is not connected; check `steps.connected` first")
            checks.check_part(part, desc)
            return _texels(desc, part)
        for part in (*targets.values(), *self._reads(reads)):
            desc = self._desc(part.port)
            if isinstance(desc, TextureDesc):
                return _texels(desc, part)
        if not targets:
            return 1, 1, 1  # its outputs are unused
        raise Misuse("no texture determines the number of work groups; give over or groups")

    def _reads(self, named: Mapping[str, Target]) -> Iterator[Part]:
        """Yield a step's reads; every input if it names none."""
        for target in named.values() or (port for port in self.ports.values() if isinstance(port, Input | InOut)):
            part = target if isinstance(target, Part) else target.whole
            if getattr(part.port, "kind", "function") not in ("view", "function"):
                yield part


def _caller() -> tuple[str, int] | None:
    """Return the author's line that requested a step; None if the framework requested it."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and frame.f_globals.get("__package__") == __package__:
        frame = frame.f_back
    if frame is None or is_framework(str(frame.f_globals.get("__name__"))):
        return None
    return frame.f_code.co_filename, frame.f_lineno


def _texels(desc: TextureDesc, part: Part) -> tuple[int, int, int]:
    return *desc.mip_size(part.mip or 0), 1 if part.layer is not None else desc.mip_layers(part.mip or 0)
