"""What a node records: steps with what they read and write, and the fixed-function state they need.

A node's `record` fills a `Steps` without GL, so what a pass does can be read, tested and scheduled with no driver.
`Frame` is the other side: what `update` may do each frame on the CPU.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias

from rendergraph.declare import (
    Facts,
    Function,
    History,
    InOut,
    Input,
    Internal,
    LightFacts,
    Made,
    Node,
    Output,
    Part,
    Port,
    Views,
)  # fmt: skip
from rendergraph.textures import FORMATS, BufferDesc, Sampler, TextureDesc

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

Compare = Literal["never", "less", "equal", "lequal", "greater", "notequal", "gequal", "always"]
StencilOp = Literal["keep", "zero", "replace", "incr", "incr_wrap", "decr", "decr_wrap", "invert"]
BlendFactor = Literal[
    "zero", "one", "src_color", "one_minus_src_color", "dst_color", "one_minus_dst_color", "src_alpha",
    "one_minus_src_alpha", "dst_alpha", "one_minus_dst_alpha",
]  # fmt: skip
UniformValue: TypeAlias = "float | int | bool | Sequence[float] | Sequence[int]"


@dataclass(frozen=True)
class Blend:
    """Blending of one target: `source × src + destination × dst` with `op` between."""

    src: BlendFactor = "one"
    dst: BlendFactor = "zero"
    src_alpha: BlendFactor | None = None
    dst_alpha: BlendFactor | None = None
    op: Literal["add", "subtract", "reverse_subtract", "min", "max"] = "add"


ADD = Blend("one", "one")
ALPHA = Blend("src_alpha", "one_minus_src_alpha", "one", "one_minus_src_alpha")
PREMULTIPLIED = Blend("one", "one_minus_src_alpha")
MULTIPLY = Blend("dst_color", "zero")


@dataclass(frozen=True)
class StencilFace:
    """Stencil test and operations of one face."""

    func: Compare = "always"
    reference: int = 0
    read_mask: int = 0xFF
    write_mask: int = 0xFF
    stencil_fail: StencilOp = "keep"
    depth_fail: StencilOp = "keep"
    depth_pass: StencilOp = "keep"


@dataclass(frozen=True)
class Stencil:
    """Stencil state; `back` is the front's where None."""

    front: StencilFace = StencilFace()
    back: StencilFace | None = None


@dataclass(frozen=True)
class State:
    """The fixed function of a step.

    Attributes:
        depth_test: compare with the attached depth; None: yes where a depth texture is attached to a geometry or draw
            step.
        depth_func: the comparison.
        depth_write: write depth; None: yes where depth is written by the step.
        blend: one `Blend` for all targets, one a target, or None.
        color_mask: which of RGBA are written.
        cull: `material` culls back faces of single-sided materials; `back`, `front`, `none`.
        stencil: stencil state, None for off.
        scissor: x, y, width, height in texels from the bottom left.
        polygon_offset: factor and units.
        depth_clamp: clamp instead of clipping at the near and far plane.
        wireframe: draw lines instead of filled triangles.
    """

    depth_test: bool | None = None
    depth_func: Compare = "lequal"
    depth_write: bool | None = None
    blend: Blend | tuple[Blend | None, ...] | None = None
    color_mask: tuple[bool, bool, bool, bool] = (True, True, True, True)
    cull: Literal["material", "back", "front", "none"] = "material"
    stencil: Stencil | None = None
    scissor: tuple[int, int, int, int] | None = None
    polygon_offset: tuple[float, float] | None = None
    depth_clamp: bool = False
    wireframe: bool = False


@dataclass(frozen=True)
class Read:
    """A resource a step reads, and how.

    Attributes:
        name: the name in the shader.
        resource: id of the resource, `node.port`.
        version: which version of it; versions order readers and writers of one texture.
        use: `sample`, `depth_test` (attached read-only), `image`, `buffer` or `attach` (the target of an `InOut`
            whose old content stays).
        sampler: how it is sampled.
        mip, layer: the part read, None for all.
        previous: last frame's value; orders nothing in this frame.
        kind: the GLSL view of it, `texture2d` where a single mip or layer is read.
    """

    name: str
    resource: str
    version: int
    use: Literal["sample", "depth_test", "image", "buffer", "attach"] = "sample"
    sampler: Sampler = Sampler()
    mip: int | None = None
    layer: int | None = None
    previous: bool = False
    kind: str = "texture2d"


@dataclass(frozen=True)
class Write:
    """A resource a step writes: version `version` comes into being.

    Attributes:
        name: the name in the shader, or the port's name.
        resource: id of the resource.
        version: the version that this write makes; it continues `version - 1` where that is at least 1.
        use: `color`, `depth`, `image`, `buffer`.
        load: `clear` first, `load` what is there, or `discard`.
        clear: value of every channel, or one a channel.
        mip, layer: the part written, None for mip 0 and all layers (layered).
    """

    name: str
    resource: str
    version: int
    use: Literal["color", "depth", "image", "buffer"] = "color"
    load: Literal["clear", "load", "discard"] = "discard"
    clear: float | tuple[float, ...] = 0.0
    mip: int | None = None
    layer: int | None = None


@dataclass(frozen=True)
class FunctionBinding:
    """One provider of a function a step's shader calls; its text's names get the provider node's prefix.

    Attributes:
        signature: the function's name.
        node: the providing node's id.
        shader: the file of its text, relative to the providing node's shaders.
        reads: what the text samples, by the names in its text.
        defines: the provider's own defines.
        uniforms: the provider's parameters that are uniforms.
    """

    signature: str
    node: str
    shader: str
    reads: tuple[Read, ...]
    defines: tuple[tuple[str, str], ...] = ()
    uniforms: tuple[tuple[str, UniformValue], ...] = ()


@dataclass(frozen=True)
class Step:
    """One draw, dispatch, clear or mip chain.

    Attributes:
        node: id of the node that recorded it.
        index: its number within the node.
        kind: what it does; a `copy` is the framework's own, of a version that is wanted and then written over.
        shaders: stage to file name (`fragment`, `vertex`, `geometry`, `compute`), relative to the node's shaders, or
            `<name>` for one in `shaders/include/`.
        reads, writes: resources, with versions.
        functions: providers of functions its shader calls.
        defines: names and program text.
        uniforms: names and values that belong to this step alone.
        state: fixed function.
        size: width and height of the target in texels.
        samples: samples of the target.
        view: id of the view table a geometry step is drawn with.
        view_index: which view of it; None where the shader chooses by `gl_Layer`.
        objects: which objects a geometry step draws: `all`, `opaque`, `masked_or_opaque`, `transparent`, `casters`, or
            names.
        materials: what of the material its shader looks at: `full`, `alpha` (only what an alpha mask needs) or `none`.
        order: `front_to_back` (free to regroup), `back_to_front` or `scene` (kept as given).
        per_light: a light's index where the step draws for one light alone.
        vertices: vertex count of a `draw` step, or the name of the buffer that holds the indirect command.
        topology: primitives of a `draw` step.
        instances: instance count of a `draw` step.
        attributes: for a `draw` step, buffer resource to attribute names with formats (`3f in_position`).
        groups: work groups of a compute step.
        label: shown in plans and GL debug groups.
    """

    node: str
    index: int
    kind: Literal["fullscreen", "geometry", "draw", "compute", "clear", "mipmaps", "copy"]
    shaders: tuple[tuple[str, str], ...] = ()
    reads: tuple[Read, ...] = ()
    writes: tuple[Write, ...] = ()
    functions: tuple[FunctionBinding, ...] = ()
    defines: tuple[tuple[str, str], ...] = ()
    uniforms: tuple[tuple[str, UniformValue], ...] = ()
    state: State = State()
    size: tuple[int, int] = (1, 1)
    samples: int = 1
    view: str | None = None
    view_index: int | None = 0
    objects: str | tuple[str, ...] = "all"
    materials: Literal["full", "alpha", "none"] = "full"
    order: Literal["front_to_back", "back_to_front", "scene"] = "front_to_back"
    per_light: int | None = None
    vertices: int | str = 3
    topology: Literal["points", "lines", "line_strip", "triangles", "triangle_strip", "triangles_adjacency"] = "triangles"
    instances: int = 1
    attributes: tuple[tuple[str, str], ...] = ()
    groups: tuple[int, int, int] = (1, 1, 1)
    label: str = ""

    @property
    def key(self) -> tuple[str, int]:
        """Node id and number: unique within a pipeline."""
        return self.node, self.index

    @property
    def all_reads(self) -> tuple[Read, ...]:
        """Reads of the step and of the functions it calls."""
        return self.reads + tuple(read for function in self.functions for read in function.reads)


Role = Literal["transient", "internal", "output", "history"]


@dataclass(frozen=True)
class Resource:
    """A texture or buffer of the pipeline before it has memory.

    Attributes:
        id: `node.port` of whoever made it first; an `InOut` continues the id.
        desc: what it is allocated from.
        role: `transient` and `internal` may be aliased; `output` and `history` live the whole frame.
        first: every channel's value before the first frame, for history.
        view: id of the view table it is drawn with.
        lights: the scene's light index of each layer.
    """

    id: str
    desc: TextureDesc | BufferDesc
    role: Role = "transient"
    first: float = 0.0
    view: str | None = None
    lights: tuple[int, ...] = ()

    @property
    def bytes(self) -> int:
        """Bytes by formula; a history texture has two copies."""
        return self.desc.bytes * (2 if self.role == "history" else 1)


class Recorder(Protocol):
    """What `Steps` asks of the stage that expands a graph; node authors never meet it."""

    facts: Facts

    def desc(self, port: Port) -> TextureDesc | BufferDesc: ...

    def used(self, port: Port) -> bool: ...

    def add(self, request: Request) -> None: ...


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


# --- per frame -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class ViewMatrices:
    """One view: column-vector matrices as float64 arrays of shape (4, 4), and the size drawn at.

    Attributes:
        view: world to view space.
        projection: view space to clip space, z in -w…w.
        size: width and height in texels.
        near, far: distances in metres; far may be infinite.
        light: the scene's light index it belongs to, -1 for none.
    """

    view: npt.NDArray[np.float64]
    projection: npt.NDArray[np.float64]
    size: tuple[int, int]
    near: float
    far: float
    light: int = -1


class FrameScene(Protocol):
    """The scene of one frame, with `scene.model`'s values.

    Attributes:
        lights: in the scene's order.
        bounds: least and greatest corner of what is drawn.
        objects: placed objects with `name`, `mesh`, `material`, `transform`, `casts_shadow`, `hidden`.
        meshes: what an object's `mesh` counts through; `box` is a mesh's least and greatest corner.
        materials: what an object's `material` counts through.
    """

    @property
    def lights(self) -> Sequence[Any]: ...

    @property
    def bounds(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]: ...

    @property
    def objects(self) -> Sequence[Any]: ...

    @property
    def meshes(self) -> Sequence[Any]: ...

    @property
    def materials(self) -> Sequence[Any]: ...


class Frame(Protocol):
    """What `update` may ask and do.

    Attributes:
        index: frame number, from 1.
        time: seconds since frame 1.
        camera: the pipeline's camera in this frame.
        scene: the scene in this frame.
    """

    index: int
    time: float
    camera: ViewMatrices

    @property
    def scene(self) -> FrameScene: ...

    def connected(self, port: Port) -> bool:
        """Whether anything is linked to an input."""

    def set_views(self, port: Views, views: Sequence[ViewMatrices]) -> None:
        """Set the views of a declared table."""

    def write(self, port: Port, values: npt.NDArray[Any]) -> None:
        """Upload into a declared buffer; the array's bytes may be fewer than the buffer's."""


__all__ = [
    "ADD", "ALPHA", "FORMATS", "MULTIPLY", "PREMULTIPLIED", "Blend", "Callable", "Frame", "Function", "FunctionBinding",
    "History", "Input", "Internal", "Made", "Read", "Recorder", "Request", "Resource", "State", "Stencil", "StencilFace",
    "Step", "Steps", "ViewMatrices", "Write",
]  # fmt: skip
