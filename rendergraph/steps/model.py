"""A step: one draw, dispatch or clear with its reads, writes and fixed-function state; and the resources it uses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from msgspec import Struct

from rendergraph.errors import Place, Problem, node_named, shown_file
from rendergraph.textures import BufferDesc, Sampler, TextureDesc
from rendergraph.typecheck import Range, validated

Topology = Literal["points", "lines", "line_strip", "triangles", "triangle_strip", "triangles_adjacency"]
MaterialLevel = Literal["full", "alpha", "none"]
DrawOrder = Literal["front_to_back", "back_to_front", "scene"]
Use: TypeAlias = Literal["sample", "depth_test", "image", "buffer", "attach", "scene"]
UniformValue: TypeAlias = float | int | bool | Sequence[float] | Sequence[int]

MOST_STEPS = 10_000  # of one pipeline


Compare = Literal["never", "less", "equal", "lequal", "greater", "notequal", "gequal", "always"]
StencilOp = Literal["keep", "zero", "replace", "incr", "incr_wrap", "decr", "decr_wrap", "invert"]
BlendFactor = Literal[
    "zero",
    "one",
    "src_color",
    "one_minus_src_color",
    "dst_color",
    "one_minus_dst_color",
    "src_alpha",
    "one_minus_src_alpha",
    "dst_alpha",
    "one_minus_dst_alpha",
]
BlendOp = Literal["add", "subtract", "reverse_subtract", "min", "max"]
Cull = Literal["material", "back", "front", "none", "solid"]
Front = Literal["object", "counter_clockwise", "clockwise"]


_Byte: TypeAlias = Annotated[int, Range(0, 255)]
_Fraction: TypeAlias = Annotated[float, Range(0, 1)]
DepthBounds: TypeAlias = Annotated[tuple[_Fraction, _Fraction], "the least and the greatest depth, 0 to 1"]


class _Checked(Struct, frozen=True):
    """A value whose fields all fit their annotations."""

    def __post_init__(self) -> None:
        validated(self)


class Blend(_Checked, frozen=True):
    """Blending of one target: `source × src + destination × dst` with `op` in between."""

    src: BlendFactor = "one"
    dst: BlendFactor = "zero"
    src_alpha: BlendFactor | None = None
    dst_alpha: BlendFactor | None = None
    op: BlendOp = "add"

    @property
    def takes_destination(self) -> bool:
        """Whether the result depends on the target's contents."""
        drops_it = self.dst == "zero" and self.dst_alpha in (None, "zero") and self.op not in ("min", "max")
        factors = (self.src, self.dst, self.src_alpha or "", self.dst_alpha or "")
        return not drops_it or any("dst" in name for name in factors)


ADD = Blend("one", "one")
ALPHA = Blend("src_alpha", "one_minus_src_alpha", "one", "one_minus_src_alpha")
PREMULTIPLIED = Blend("one", "one_minus_src_alpha")
MULTIPLY = Blend("dst_color", "zero")


class StencilFace(_Checked, frozen=True):
    """Stencil test and operations of one face."""

    func: Compare = "always"
    reference: _Byte = 0
    read_mask: _Byte = 0xFF
    write_mask: _Byte = 0xFF
    stencil_fail: StencilOp = "keep"
    depth_fail: StencilOp = "keep"
    depth_pass: StencilOp = "keep"


class Stencil(_Checked, frozen=True):
    """Stencil state; a `back` of None equals the front."""

    front: StencilFace = StencilFace()
    back: StencilFace | None = None


class State(_Checked, frozen=True):
    """The fixed-function state of a step.

    Attributes:
        depth_test: compare with the attached depth; None: if a depth texture is attached to a geometry or draw step.
            Without the test, every fragment's depth is written.
        depth_func: the comparison of window depth, which is reversed: `greater` is nearer.
        depth_write: write depth; None: if the step writes depth.
        blend: one `Blend` for all targets, one per target, or None.
        color_mask: which of RGBA to write.
        cull: `material` culls back faces of single-sided materials; `back`, `front`, `none`; `solid` culls back faces
            of closed meshes with opaque, single-sided materials, which front faces hide from outside.
        front: which triangles are front faces: those that are counter-clockwise on the screen; with `object`,
            clockwise ones for objects that their transform mirrors, because that reverses the winding. A geometry
            shader that chooses the winding itself must not use `object`.
        stencil: stencil state, None for off.
        scissor: x, y, width, height in texels from the bottom left.
        polygon_offset: factor and units of filled triangles' depth, positive for nearer; not for `wireframe` lines.
        depth_bounds: minimum and maximum value in the depth texture for which fragments pass. Not every driver
            supports it (see `rendergraph doctor`); if unsupported, such a step is an error.
        depth_clamp: clamp instead of clipping at the near and far plane.
        clip_distances: how many `gl_ClipDistance[…]` the vertex or geometry shader writes: fragments with any below 0
            are clipped.
        wireframe: draw lines instead of filled triangles.
    """

    depth_test: bool | None = None
    depth_func: Compare = "gequal"
    depth_write: bool | None = None
    blend: Annotated[Blend | tuple[Blend | None, ...] | None, "a Blend such as ADD, a tuple of them, or None"] = None
    color_mask: Annotated[tuple[bool, bool, bool, bool], "four of True and False"] = (True, True, True, True)
    cull: Cull = "material"
    front: Front = "object"
    stencil: Stencil | None = None
    scissor: Annotated[tuple[int, int, int, int], "x, y, width and height in texels"] | None = None
    polygon_offset: Annotated[tuple[float, float], "a factor and units"] | None = None
    depth_bounds: DepthBounds | None = None
    depth_clamp: bool = False
    clip_distances: Annotated[int, Range(0, 8)] = 0
    wireframe: bool = False


class Read(Struct, frozen=True, gc=False):
    """A resource that a step reads, and how.

    Attributes:
        name: the name in the shader.
        resource: id of the resource, `node.port`.
        version: the version that is read; versions order readers and writers.
        use: `sample`, `depth_test` (attached read-only), `image`, `buffer`, `attach` (the target of an `InOut` whose
            old contents stay) or `scene` (all of the scene's data).
        mip, layer: the part that is read, None for all.
        previous: reads last frame's value, which implies no order in this frame.
        kind: its kind in GLSL, `texture2d` if a single mip or layer is read.
    """

    name: str
    resource: str
    version: int
    use: Use = "sample"
    sampler: Sampler = Sampler()
    mip: int | None = None
    layer: int | None = None
    previous: bool = False
    kind: str = "texture2d"


class Write(Struct, frozen=True, gc=False):
    """A resource that a step writes, creating a new version.

    Attributes:
        name: the name in the shader, or the port's name.
        version: the version that this write creates; it continues `version - 1` if that is at least 1.
        load: `clear` first, `load` the old contents, or `discard`.
        clear: value of every channel, or one per channel.
        mip, layer: the part that is written, None for mip 0 and all layers (layered).
    """

    name: str
    resource: str
    version: int
    use: Literal["color", "depth", "image", "buffer"] = "color"
    load: Literal["clear", "load", "discard"] = "discard"
    clear: float | tuple[float, ...] = 0.0
    mip: int | None = None
    layer: int | None = None


class FunctionBinding(Struct, frozen=True):
    """One provider of a function that a step's shader calls; names in its text get the provider node's prefix.

    Attributes:
        signature: the function's name.
        node: the providing node's id.
        shader: the file of its text, relative to the providing node's shaders.
        reads: textures that the text samples, by the names in its text.
        includes: parameters whose choice comes from a plugin, in capitals, with the plugin's include.
    """

    signature: str
    node: str
    shader: str
    reads: tuple[Read, ...]
    defines: tuple[tuple[str, str], ...] = ()
    uniforms: tuple[tuple[str, UniformValue], ...] = ()
    includes: tuple[tuple[str, Path], ...] = ()


class Where(Struct, frozen=True, eq=False, gc=False):
    """Where a step was recorded. All are equal, so that equal steps are equal wherever they come from.

    Attributes:
        place: the node's place in the pipeline's file.
        caller: the author's file and line of the call that recorded it; None if the framework recorded it.
    """

    place: Place | None = None
    caller: tuple[str, int] | None = None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Where)

    def __hash__(self) -> int:
        return 0


class Step(Struct, frozen=True, gc=False):
    """One draw, dispatch, clear or mip chain.

    Attributes:
        node: id of the node that recorded it.
        index: its number within the node.
        kind: the kind; the framework adds a `copy` of a version that is needed after it is overwritten.
        shaders: stage to file name (`fragment`, `vertex`, `geometry`, `compute`), relative to the node's shaders, or
            `<name>` for one in `shaders/include/`.
        includes: parameters whose choice comes from a plugin, in capitals, with the plugin's include.
        defines: names and program text.
        size, samples: width and height of the target in texels, and its samples.
        view: id of the view table of a geometry step.
        view_index: which view of it; None if the shader chooses by `gl_Layer`.
        objects: which objects a geometry step draws: `all`, `opaque`, `transparent`, `casters`, or names.
        materials: the part of the material that its shader uses: `full`, `alpha` (for an alpha mask) or `none`.
        order: `front_to_back` (free to regroup), `back_to_front` or `scene` (unchanged).
        in_place: whether a geometry step's triangles stay where the objects are, so that objects can be culled.
        region: number of the node's rectangle to which `update` restricts it; None for the whole target.
        if_drawn: number of a step of the node; if that has no visible fragments, the device skips this step.
        per_light: a light's index if the step draws for only one light.
        vertices: vertex count of a `draw` step, or the name of the buffer that holds the indirect command.
        command, commands: the first command in that buffer and the number of commands; likewise for `groups`.
        count: the name of the buffer with the number of commands to draw; empty for all.
        instances: their number, or the name of the buffer that holds it.
        object_commands: for a geometry step, the name of the buffer with a command for each object, or empty.
        indices: the name of the buffer that holds the indices, or empty.
        topology: primitives of a `draw` step; `triangles` or `triangles_adjacency` of a geometry step.
        attributes: for a `draw` step, buffer resource to attribute names with formats (`3f in_position`).
        groups: work groups of a compute step, or the name of the buffer that holds their number.
        invocations: number of invocations of a compute step along x, y and z, instead of `groups`.
        label: the author's name for it, or a copy's purpose; in plans and timings.
        type: the node's type.
        where: where it was recorded, which is not part of its identity.
    """

    node: str
    index: int
    kind: Literal["fullscreen", "geometry", "draw", "compute", "clear", "mipmaps", "resolve", "copy", "upload"]
    shaders: tuple[tuple[str, str], ...] = ()
    reads: tuple[Read, ...] = ()
    writes: tuple[Write, ...] = ()
    functions: tuple[FunctionBinding, ...] = ()
    includes: tuple[tuple[str, Path], ...] = ()
    defines: tuple[tuple[str, str], ...] = ()
    uniforms: tuple[tuple[str, UniformValue], ...] = ()
    state: State = State()
    size: tuple[int, int] = (1, 1)
    samples: int = 1
    view: str | None = None
    view_index: int | None = 0
    objects: str | tuple[str, ...] = "all"
    materials: MaterialLevel = "full"
    order: DrawOrder = "front_to_back"
    in_place: bool = False
    region: int | None = None
    if_drawn: int | None = None
    per_light: int | None = None
    vertices: int | str = 3
    command: int = 0
    commands: int = 1
    count: str = ""
    object_commands: str = ""
    indices: str = ""
    topology: Topology = "triangles"
    instances: int | str = 1
    attributes: tuple[tuple[str, str], ...] = ()
    groups: tuple[int, int, int] | str = (1, 1, 1)
    invocations: tuple[int, int, int] | None = None
    label: str = ""
    type: str = ""
    where: Where = Where()

    def problem(self, code: str, text: str, subject: str = "") -> Problem:
        """Return a problem of the step, as `node 'id' (type): file:line: …`, at the node's place in the pipeline."""
        return self.relocate(Problem(code, text, subject=subject))

    def relocate(self, problem: Problem) -> Problem:
        """Return a problem that was found without knowing the step as a problem of this step."""
        caller = self.where.caller
        line = Place(shown_file(caller[0]), caller[1], 1) if caller is not None else None
        return problem.relocate(self.where.place, context=node_named(self.node, self.type), cause=line)

    @property
    def key(self) -> tuple[str, int]:
        """Node id and number: unique within a pipeline."""
        return self.node, self.index

    @property
    def reads_scene(self) -> bool:
        """Whether it, or a function that it calls, reads the scene's data."""
        return any(read.use == "scene" for read in self.all_reads)

    @property
    def all_reads(self) -> tuple[Read, ...]:
        """Reads of the step and of the functions it calls."""
        if not self.functions:
            return self.reads
        return self.reads + tuple(read for function in self.functions for read in function.reads)


SceneSource = Literal["transforms", "lights", "materials", "environment", "camera"]


class Upload(Struct, frozen=True, eq=False):
    """Values that the CPU writes to a texture or buffer: an array, or a function of the scene.

    Attributes:
        sources: the parts of the scene on which the function depends.
        content: a key that is equal for equal values.
    """

    values: Any
    sources: tuple[SceneSource, ...] = ()
    content: str = ""

    def __eq__(self, other: object) -> bool:
        return repr(self) == repr(other)

    def __hash__(self) -> int:
        return hash(self.content)

    def __repr__(self) -> str:
        return f"Upload({self.content})"


Role = Literal["transient", "internal", "output", "history", "kept", "scene"]


class Resource(Struct, frozen=True, gc=False):
    """A texture or buffer of the pipeline before it has memory.

    Attributes:
        id: `node.port` of its first writer; an `InOut` continues the id.
        role: `transient` and `internal` may be aliased; `output`, `history` and `kept` live the whole frame,
            the last two from frame to frame; a `scene` resource already exists, and takes no memory here.
        first: every channel's value before the first frame, for history.
        view: id of the view table it is rendered with.
        lights: index of the scene's light for each layer.
        note: its contents, if the description cannot express them.
    """

    id: str
    desc: TextureDesc | BufferDesc
    role: Role = "transient"
    first: float = 0.0
    view: str | None = None
    lights: tuple[int, ...] = ()
    note: str = ""

    @property
    def bytes(self) -> int:
        """Bytes by formula; a history texture has two copies, and resources of the scene count 0."""
        return self.desc.bytes * {"history": 2, "scene": 0}.get(self.role, 1)
