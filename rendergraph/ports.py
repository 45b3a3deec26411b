"""Ports: named connection points and textures of a node.

Sizes, formats, counts, samplers and initial contents may be constants or functions `(node, facts)`, which linking calls
once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, TypeAlias, TypeVar

from msgspec import Struct
from msgspec.structs import force_setattr, replace

from rendergraph.facts import Facts
from rendergraph.textures import (
    FORMATS,
    EnvironmentMap,
    Filter,
    Kind,
    Layout,
    Sampler,
    SceneData,
    Semantic,
    Signature,
    Wrap,
)
from rendergraph.typecheck import Known, Length, Range, validated

T = TypeVar("T")
Rule: TypeAlias = Annotated[Callable[[Any, Facts], T], "a function of node and facts"]
Ruled: TypeAlias = T | Rule[T]
"""A constant, or a function of the node and the facts known before scheduling."""

Meaning: TypeAlias = Annotated[Semantic, "a Semantic such as Radiance"]
Called: TypeAlias = Annotated[Signature, "a Signature such as ShadowLookup"]
Elements: TypeAlias = Annotated[Layout, "a Layout such as Layout('Spark', {'position': 'vec3'})"]
Count: TypeAlias = Annotated[int, Range(0)]
Texel: TypeAlias = Annotated[float | tuple[float, ...], Length(1, 4), "a number, up to four of them"]
"""One value for all channels, or one per channel."""
Shader: TypeAlias = Annotated[str, Length(1), "the name of a file"]
Positive: TypeAlias = Annotated[int, Range(1)]
Samples: TypeAlias = Literal[1, 2, 4, 8, 16]
FormatName: TypeAlias = Annotated[str, Known(tuple(FORMATS)), "a format such as 'rgba16f'"]
Sides: TypeAlias = Annotated[tuple[int, int], "width and height in whole texels"]
_Factor: TypeAlias = Annotated[float, Range(0, above=True)]
SizeRule: TypeAlias = Annotated[
    _Factor | tuple[Positive, Positive] | str | tuple[str, _Factor] | Rule[Sides],
    "a factor of the viewport above 0, width and height from 1 up, an input's name, that with a factor, a function",
]
"""A factor of the viewport, or of a view's own size; width and height; an input, also with a factor; a function."""


class Port(Struct, frozen=True, eq=False, dict=True):
    """One named connection point or texture of a node, with the name of the class attribute."""

    name: ClassVar[str] = ""
    owner: ClassVar[str] = ""

    def __set_name__(self, owner: type, name: str) -> None:
        vars(self).update(name=name, owner=owner.__name__)

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self.name}')"

    @cached_property
    def whole(self) -> Part:
        """The whole texture, as a part."""
        return Part(self)

    def mip(self, level: int) -> Part:
        """Return one level of the mip chain as an ordinary 2D texture."""
        return Part(self, mip=level)

    def layer(self, index: int) -> Part:
        """Return one array layer or cube face as an ordinary 2D texture."""
        return Part(self, layer=index)

    def sampled(self, filter: Filter = "nearest", wrap: Wrap = "clamp", compare: bool = False) -> Part:
        """Return the whole texture, read with this sampler; inputs declare theirs."""
        return self.whole.sampled(filter, wrap, compare)

    def tested(self) -> Part:
        """Return the texture attached read-only for the depth test, for an input that other steps sample."""
        return Part(self, use="depth_test")

    def stored(self) -> Part:
        """Return the whole texture, bound as an image of a drawing step, for loads, stores and atomics."""
        return self.whole.stored()


class Part(Struct, frozen=True):
    """A port's texture, or one mip or layer of it; `previous` is last frame's value, `link` the position in a list."""

    port: Port
    mip: Count | None = None
    layer: Count | None = None
    previous: bool = False
    sampler: Sampler | None = None
    use: Literal["depth_test", "image"] | None = None
    link: Count | None = None

    def __post_init__(self) -> None:
        validated(self, f"a part of '{getattr(self.port, 'name', '')}'")

    def at_mip(self, level: int) -> Part:
        """Return a level of the same layer."""
        return replace(self, mip=level)

    def at_layer(self, index: int) -> Part:
        """Return a layer of the same level."""
        return replace(self, layer=index)

    def sampled(self, filter: Filter = "nearest", wrap: Wrap = "clamp", compare: bool = False) -> Part:
        """Return the same part, read with this sampler."""
        return replace(self, sampler=validated(Sampler(filter, wrap, compare), "sampled"))

    def stored(self) -> Part:
        """Return the same part, bound as an image."""
        return replace(self, use="image")


class Input(Port, frozen=True, eq=False):
    """A texture, buffer, function or view that the node reads.

    Attributes:
        semantic: the required semantic; `Any` accepts everything, and a `function` needs a `Signature`.
        size: `same` as the pass's target, or `any`.
        filter, wrap, compare, anisotropy: the sampler.
        border: value outside the texture with `wrap="border"`; 1 by default, and 0 for comparisons.
        samples: `single`, `multi` (a multisampled texture) or `any`; a depth-test attachment takes any.
        layered: a `texture2d` may also be an array, whose layers steps read individually, as `port.layer(n)`.
        optional: it may stay unconnected; the shader is then compiled without `HAS_<NAME>`.
        many: it takes a list of links.
        use: `sample` it, attach it read-only for the `depth_test`, or load it as an `image`.
        group: the name of its group.
        element: the elements that a buffer must have.
        rays: `SceneData` also provides the BVH for `#include <trace.glsl>`.
    """

    semantic: Meaning | Called
    kind: Kind = "texture2d"
    size: Literal["same", "any"] = "same"
    filter: Ruled[Filter] = "nearest"
    wrap: Wrap = "clamp"
    compare: bool = False
    anisotropy: Positive = 1
    samples: Literal["single", "multi", "any"] = "single"
    layered: bool = False
    optional: bool = False
    many: bool = False
    use: Literal["sample", "depth_test", "image"] = "sample"
    group: str | None = None
    doc: str = ""
    border: Texel | None = None
    element: Elements | None = None
    rays: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.semantic, Semantic) and self.semantic == SceneData:
            force_setattr(self, "kind", "scene")

    def link(self, number: int) -> Part:
        """Return one texture of an input that takes a list, counted from 0; its name in the shader has no number."""
        return Part(self, link=number)

    @cached_property
    def sampler(self) -> Sampler | None:
        """How it is sampled; None if its filter is a rule."""
        return None if callable(self.filter) else self.sampler_of(self.filter)

    def sampler_of(self, filter: Filter) -> Sampler:
        """Return the sampler with this filter."""
        return Sampler(filter, self.wrap, self.compare, self.anisotropy, self.border)

    @cached_property
    def takes_scene(self) -> bool:
        """Whether it reads the scene's environment, or the scene's data, when unconnected."""
        return self.semantic in (EnvironmentMap, SceneData)


class WrittenPort(Port, frozen=True, eq=False):
    """A texture or buffer that the node writes: the shared part of `Output`, `InOut`, `Internal` and `History`.

    Attributes:
        like: an input whose semantic, format, size, layers, view and lights are its defaults.
        format: a name in `textures.FORMATS`; `rgba16f` by default.
        size: see `SizeRule`; the viewport by default.
        mips: levels; 0 means the full chain.
        layers: array layers, or the depth of a 3D texture; a cube always has 6. By default an array has one layer per
            light, if its `lights` are a rule or those of its view table, else 1.
        samples: samples per texel; by default those of `like`, else of an input of the same size that is attached for
            the `depth_test`, else 1.
        bytes: size of a `buffer`.
        element, count: type and number of a buffer's elements, in place of `bytes`.
        clear: initial contents; None leaves them undefined, for passes that write every texel.
        first: value of every channel that `@previous` reads in the first frame; by default 0, and for a continued
            texture the value of its first writer.
        view: the view that it is drawn with: a `Views` port, a `view` input or a texture input. By default, textures
            that a geometry step draws carry the step's view.
        lights: an input whose table of lights by layer it carries, or the table itself.
    """

    semantic: Meaning | None = None
    like: str | None = None
    kind: Literal["texture2d", "texture2d_array", "texture3d", "texture_cube", "buffer"] = "texture2d"
    format: Ruled[FormatName] | None = None
    size: SizeRule | None = None
    mips: Ruled[Count] = 1
    layers: Ruled[Count] | None = None
    samples: Samples | Rule[int] | None = None
    bytes: Ruled[Count] = 0
    clear: Ruled[Texel | None] = None
    first: float | None = None
    view: str | None = None
    lights: str | Rule[tuple[int, ...]] | None = None
    doc: str = ""
    element: Elements | None = None
    count: Ruled[Count] = 0


class Output(WrittenPort, frozen=True, eq=False):
    """A result for other nodes.

    Attributes:
        needs: inputs that must be connected for this output to be used.
        kept: it is kept from frame to frame: its steps run only when they are new or a value that they use has
            changed. They must not depend on anything that moves, or on textures or buffers that are not kept.
    """

    needs: tuple[str, ...] = ()
    kept: bool = False


class InOut(WrittenPort, frozen=True, eq=False):
    """A texture of another node that this node continues: a write is a new version, after all readers of the old one.

    If it is `optional` and not connected, the node creates the texture from the `WrittenPort` fields.
    """

    optional: bool = False


class Internal(WrittenPort, frozen=True, eq=False):
    """A scratch texture or buffer of the node, aliased like any other; `kept` as for `Output` (a table, noise)."""

    kept: bool = False


class History(WrittenPort, frozen=True, eq=False):
    """The node's own texture that persists between frames: write `self.x`, read last frame's `self.x.previous`."""

    @property
    def previous(self) -> Part:
        """Last frame's value; `first` in the first frame."""
        return Part(self, previous=True)


class Views(Port, frozen=True, eq=False):
    """A table of views that the node computes in `update`, one for each layer that it draws.

    Attributes:
        count: number of views; by default the number of its lights, or 1 without lights.
        size: see `SizeRule`; the viewport by default. It is the default size, also for factors, of textures drawn with
            it and of textures computed from those texel by texel.
        lights: index of the scene's light for each view, empty if the views do not belong to lights.
        public: whether other nodes may connect it (it is then an output of kind `view`).
        compute: function of the `Frame` that returns the views of each frame, in place of `update`. It does not depend
            on the node's parameters, so the page of `view` can change them without calling it.
    """

    count: Ruled[Count] | None = None
    size: SizeRule | None = None
    lights: Rule[tuple[int, ...]] | None = None
    public: bool = True
    compute: Callable[[Any], Sequence[Any]] | None = None
    doc: str = ""


class Function(Port, frozen=True, eq=False):
    """A GLSL function that another node calls inside its own shader.

    Attributes:
        shader: the file with the function's text, beside the node's shaders.
        reads: the ports that its text samples: names, or `port.sampled(…)` for internals and outputs, which are
            otherwise read unfiltered and from their first mip. Unconnected inputs and unwritten internals are left
            out, and `HAS_<NAME>` is then undefined.
    """

    signature: Called
    shader: Shader
    reads: tuple[str | Part, ...] = ()
    needs: tuple[str, ...] = ()
    doc: str = ""

    @property
    def read_names(self) -> tuple[str, ...]:
        """The names of the ports in `reads`."""
        return tuple(read.port.name if isinstance(read, Part) else read for read in self.reads)
