"""What a node declares: ports and parameters. The one source for checking, schema, docs, uniforms and diffs.

Sizes, formats and counts may be constants or functions `(node, facts)`; `Facts` is all such a function may ask.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeAlias, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator
from pydantic.fields import FieldInfo

from rendergraph.textures import FORMATS, Filter, Kind, Sampler, Semantic, Signature, TextureDesc, Wrap

if TYPE_CHECKING:
    from rendergraph.steps import Frame, Steps

T = TypeVar("T")
Ruled: TypeAlias = "T | Callable[[Any, Facts], T]"
"""A constant, or a function of the node and the facts known before the schedule."""

SizeRule: TypeAlias = "float | tuple[int, int] | str | tuple[str, float] | Callable[[Any, Facts], tuple[int, int]]"
"""A factor of the viewport; width and height; an input's name; an input's name with a factor; a function."""


@dataclass(frozen=True)
class LightFacts:
    """What is known of a light before the schedule: values that move are not."""

    name: str
    type: Literal["directional", "point", "spot"]


@dataclass(frozen=True)
class TextureInfo:
    """What an output has turned out to be.

    Attributes:
        desc: what it is allocated from (None for a buffer, view or function).
        semantic: what it means, after `any` and `like` are followed.
        view: the id of the view table it was drawn with (`camera`, or `node.port`), None if not drawn.
        lights: the scene's light index of each layer, empty where layers are not lights.
        bytes: size of a buffer, 0 for textures.
    """

    desc: TextureDesc | None
    semantic: Semantic
    view: str | None = None
    lights: tuple[int, ...] = ()
    bytes: int = 0


@dataclass(frozen=True)
class Facts:
    """What is known of a node's surroundings before the schedule.

    Attributes:
        viewport: width and height of the picture.
        lights: the scene's lights in its order.
        inputs: what each connected input carries; a `many` input has one entry a link.
    """

    viewport: tuple[int, int]
    lights: tuple[LightFacts, ...] = ()
    inputs: Mapping[str, tuple[TextureInfo, ...]] = field(default_factory=dict)

    def connected(self, name: str) -> bool:
        """Whether anything is linked to the input."""
        return bool(self.inputs.get(name))

    def input(self, name: str) -> TextureInfo:
        """What the input carries.

        Raises:
            KeyError: nothing is linked to it.
        """
        return self.inputs[name][0]


# --- ports -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Port:
    """One named connection point or texture of a node; its name is the class attribute's."""

    name: str = field(init=False, default="")

    def __set_name__(self, owner: type, name: str) -> None:
        object.__setattr__(self, "name", name)

    def mip(self, level: int) -> Part:
        """One level of the mip chain as an ordinary 2D texture."""
        return Part(self, mip=level)

    def layer(self, index: int) -> Part:
        """One array layer or cube face as an ordinary 2D texture."""
        return Part(self, layer=index)

    def sampled(self, filter: Filter = "nearest", wrap: Wrap = "clamp", compare: bool = False) -> Part:
        """The whole texture, read with this sampler; inputs have theirs declared."""
        return Part(self, sampler=Sampler(filter, wrap, compare))


@dataclass(frozen=True)
class Part:
    """A port's texture, or one mip or layer of it; `previous` is last frame's value of a history texture."""

    port: Port
    mip: int | None = None
    layer: int | None = None
    previous: bool = False
    sampler: Sampler | None = None

    def at_mip(self, level: int) -> Part:
        """The same layer's level."""
        return replace(self, mip=level)

    def at_layer(self, index: int) -> Part:
        """The same level's layer."""
        return replace(self, layer=index)

    def sampled(self, filter: Filter = "nearest", wrap: Wrap = "clamp", compare: bool = False) -> Part:
        """The same part, read with this sampler."""
        return replace(self, sampler=Sampler(filter, wrap, compare))


@dataclass(frozen=True, eq=False)
class Input(Port):
    """Something read.

    Attributes:
        semantic: what it must mean; `Any` takes everything.
        kind: kind of port; `function` takes a `Signature` as its semantic.
        size: `same` as the pass's target, or `any`.
        filter, wrap, compare, anisotropy: the sampler, `filter` also as a function of the node's parameters.
        samples: `single`, `multi` (a multisampled texture) or `any`.
        optional: it may stay unconnected; the shader is then compiled without `HAS_<NAME>`.
        many: it takes a list.
        use: `sample` it, attach it read-only for the `depth_test`, or load it as an `image`.
        group: the name of the group it belongs to.
        doc: one line.
    """

    semantic: Semantic | Signature
    kind: Kind = "texture2d"
    size: Literal["same", "any"] = "same"
    filter: Filter | Callable[[Any], Filter] = "nearest"
    wrap: Wrap = "clamp"
    compare: bool = False
    anisotropy: int = 1
    samples: Literal["single", "multi", "any"] = "single"
    optional: bool = False
    many: bool = False
    use: Literal["sample", "depth_test", "image"] = "sample"
    group: str | None = None
    doc: str = ""


@dataclass(frozen=True, eq=False)
class Made(Port):
    """A texture or buffer that the node makes: the shared part of `Output`, `InOut`, `Internal` and `History`.

    Attributes:
        semantic: what it means; None with `like`.
        like: name of an input whose format, size, semantic, view and lights it takes over.
        kind: kind of texture, or `buffer`.
        format: a name in `textures.FORMATS`.
        size: see `SizeRule`; the viewport by default.
        mips: levels; 0 means the full chain.
        layers: array layers; a cube always has 6.
        samples: samples per texel.
        bytes: size of a `buffer`.
        clear: what it first holds; None discards, which is right where every texel is written.
        first: value of every channel in the first frame, where somebody reads `@previous`.
        view: name of a `Views` port, a `view` input or a texture input: the view it is drawn with. By default
            textures that a geometry step draws carry the view the step was drawn with.
        lights: name of an input whose layer-to-light table it carries, or the table itself.
        doc: one line.
    """

    semantic: Semantic | None = None
    like: str | None = None
    kind: Kind = "texture2d"
    format: Ruled[str] = "rgba16f"
    size: SizeRule = 1.0
    mips: Ruled[int] = 1
    layers: Ruled[int] = 1
    samples: Ruled[int] = 1
    bytes: Ruled[int] = 0
    clear: float | tuple[float, ...] | Callable[[Any], float | tuple[float, ...]] | None = None
    first: float = 0.0
    view: str | None = None
    lights: str | Callable[[Any, Facts], tuple[int, ...]] | None = None
    doc: str = ""


@dataclass(frozen=True, eq=False)
class Output(Made):
    """Something made for others.

    Attributes:
        needs: inputs that must be connected for this output to be used.
    """

    needs: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class InOut(Made):
    """A texture somebody else made, continued: each write is a new version, and readers of the old one run before.

    Attributes:
        optional: not connected, the node makes the texture itself from the `Made` fields.
    """

    optional: bool = False


@dataclass(frozen=True, eq=False)
class Internal(Made):
    """A scratch texture or buffer of the node's own, aliased like any other."""


@dataclass(frozen=True, eq=False)
class History(Made):
    """A texture of the node's own that outlives the frame: write `self.x`, read last frame's `self.x.previous`."""

    @property
    def previous(self) -> Part:
        """Last frame's value, `first` in the first frame."""
        return Part(self, previous=True)


@dataclass(frozen=True, eq=False)
class Views(Port):
    """A table of views that the node computes in `update`, one a layer of what it draws.

    Attributes:
        count: number of views.
        lights: the scene's light index of each view, empty where views are not lights'.
        public: whether others may connect it (it is then an output of kind `view`).
        doc: one line.
    """

    count: Ruled[int] = 1
    lights: Callable[[Any, Facts], tuple[int, ...]] | None = None
    public: bool = True
    doc: str = ""


@dataclass(frozen=True, eq=False)
class Function(Port):
    """A GLSL function that another node calls inside its own shader.

    Attributes:
        signature: the function it provides.
        shader: the file with the function's text, beside the node's shaders.
        reads: names of the inputs and internals its text samples.
        doc: one line.
    """

    signature: Signature
    shader: str
    reads: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    doc: str = ""


PORT_TYPES = (Port, Input, Made, Output, InOut, Internal, History, Views, Function)


# --- parameters ------------------------------------------------------------------------------------------------------


def _parameter(
    role: str, default: Any, unit: str, doc: str, min: float | None, max: float | None, extra: dict[str, Any]
) -> Any:
    limits = {key: value for key, value in (("minimum", min), ("maximum", max)) if value is not None}
    return Field(default=default, description=doc, json_schema_extra={"role": role, "unit": unit} | limits | extra)


def param(*, default: Any, doc: str, unit: str = "", min: float | None = None, max: float | None = None,
          glsl: str = "") -> Any:  # fmt: skip
    """A parameter that becomes a uniform: changing it rebuilds nothing.

    Args:
        default: value where the file gives none.
        doc: one line.
        unit: the unit's symbol, empty for a pure number.
        min, max: smallest and largest legal value, inclusive.
        glsl: the uniform's type where it is not what the annotation says (`vec3` for a number or a colour).
    """
    return _parameter("param", default, unit, doc, min, max, {"glsl": glsl} if glsl else {})


def define(*, default: Any, doc: str, unit: str = "", min: float | None = None, max: float | None = None) -> Any:
    """A parameter that becomes program text: `#define NAME value`, and `#define NAME_CHOICE` for a choice.

    Numbers and switches become `#define SAMPLES 16`; a choice `curve: aces` becomes `#define CURVE CURVE_ACES`, where
    every choice has a number, so that shaders say `#if CURVE == CURVE_ACES`.
    """
    return _parameter("define", default, unit, doc, min, max, {})


def structural(*, default: Any, doc: str, unit: str = "", min: float | None = None, max: float | None = None) -> Any:
    """A parameter that is part of the plan: a resolution, a light's name."""
    return _parameter("structural", default, unit, doc, min, max, {})


# --- nodes -----------------------------------------------------------------------------------------------------------

_IDENTIFIER = re.compile(r"[a-z][a-z0-9_]*\Z")


@cache
def _ports_of(cls: type[Node]) -> dict[str, Port]:
    # Every stage asks for ports of every node, and pydantic's base classes hold hundreds of attributes.
    found: dict[str, Port] = {}
    for base in reversed(cls.__mro__):
        if issubclass(base, Node):
            for name, value in vars(base).items():
                if isinstance(value, Port):
                    found[name] = value
                elif name in found:
                    del found[name]  # a subclass may drop a port by setting it to None
    return found


class Node(BaseModel):
    """Base of every node: ports and parameters as class attributes, nothing more for a plain full-screen pass.

    Instances are frozen: they hold parameter values only. The type's name is the stem of its module.
    """

    model_config = ConfigDict(
        frozen=True, strict=True, extra="forbid", ignored_types=PORT_TYPES, protected_namespaces=(),
    )  # fmt: skip

    @field_validator("*", mode="after")
    @classmethod
    def _within_limits(cls, value: Any, info: ValidationInfo) -> Any:
        # Not pydantic's ge and le: a parameter may be a number or a colour, and the limits hold for each component.
        extra = cls.model_fields[str(info.field_name)].json_schema_extra
        limits = extra if isinstance(extra, Mapping) else {}
        for number in value if isinstance(value, tuple) else (value,):
            if isinstance(number, bool) or not isinstance(number, int | float):
                continue
            if not math.isfinite(number):
                raise ValueError("must be finite")
            low, high = limits.get("minimum"), limits.get("maximum")
            if isinstance(low, int | float) and number < low:
                raise ValueError(f"must be at least {low}")
            if isinstance(high, int | float) and number > high:
                raise ValueError(f"must be at most {high}")
        return value

    shader: ClassVar[str | None] = None
    """Fragment shader of the default `record`; the type's name with `.frag` where None."""

    def record(self, steps: Steps) -> None:
        """Append the steps of this pass; called before the schedule and without GL. One full-screen step by default."""
        steps.fullscreen(self.shader or f"{steps.type_name}.frag")

    def update(self, frame: Frame) -> None:
        """Compute what changes each frame on the CPU: views, buffers. Called once a frame, before any step runs."""

    @classmethod
    def ports(cls) -> dict[str, Port]:
        """Every port by name, in the order of declaration, bases first."""
        return dict(_ports_of(cls))

    @classmethod
    def inputs(cls) -> dict[str, Input | InOut]:
        """Ports that take links."""
        return {name: port for name, port in cls.ports().items() if isinstance(port, Input | InOut)}

    @classmethod
    def outputs(cls) -> dict[str, Output | InOut | Function | Views]:
        """Ports that others may read."""
        return {
            name: port
            for name, port in cls.ports().items()
            if isinstance(port, Output | InOut | Function) or (isinstance(port, Views) and port.public)
        }

    @classmethod
    def groups(cls) -> dict[str, tuple[str, ...]]:
        """Group name to the inputs it stands for."""
        table: dict[str, tuple[str, ...]] = {}
        for name, port in cls.inputs().items():
            if isinstance(port, Input) and port.group:
                table[port.group] = (*table.get(port.group, ()), name)
        return table

    @classmethod
    def parameters(cls) -> dict[str, FieldInfo]:
        """Parameter name to its pydantic field; `role_of` tells uniform, define and structural apart."""
        return cls.model_fields

    @classmethod
    def role_of(cls, parameter: str) -> Literal["param", "define", "structural"]:
        """How a parameter reaches the program."""
        extra = cls.model_fields[parameter].json_schema_extra
        return extra["role"] if isinstance(extra, Mapping) and "role" in extra else "structural"  # type: ignore[return-value]


# Words that cannot be a GLSL identifier, that hide a built-in function used everywhere, or that pydantic's base owns.
RESERVED_NAMES: frozenset[str] = frozenset(
    ["attribute", "const", "uniform", "varying", "buffer", "shared", "coherent", "volatile", "restrict", "readonly", "writeonly", "layout", "centroid", "flat", "smooth", "noperspective", "patch", "sample", "break", "continue", "do", "for", "while", "switch", "case", "default", "if", "else", "subroutine", "in", "out", "inout", "float", "double", "int", "void", "bool", "true", "false", "invariant", "precise", "discard", "return", "mat2", "mat3", "mat4", "vec2", "vec3", "vec4", "ivec2", "ivec3", "ivec4", "bvec2", "bvec3", "bvec4", "uint", "uvec2", "uvec3", "uvec4", "lowp", "mediump", "highp", "precision", "struct", "common", "partition", "active", "asm", "class", "union", "enum", "typedef", "template", "this", "resource", "goto", "inline", "noinline", "public", "static", "extern", "external", "interface", "long", "short", "half", "fixed", "unsigned", "superp", "input", "output", "hvec2", "hvec3", "hvec4", "fvec2", "fvec3", "fvec4", "sampler3DRect", "filter", "image", "sizeof", "cast", "namespace", "using", "texture", "sampler2D", "sampler3D", "samplerCube", "image2D", "abs", "acos", "all", "any", "asin", "atan", "ceil", "clamp", "cos", "cross", "degrees", "determinant", "distance", "dot", "equal", "exp", "exp2", "floor", "fma", "fract", "inverse", "inversesqrt", "length", "log", "log2", "main", "max", "min", "mix", "mod", "modf", "normalize", "not", "pow", "radians", "reflect", "refract", "round", "sign", "sin", "smoothstep", "sqrt", "step", "tan", "transpose", "trunc", "copy", "json", "dict", "schema", "construct", "fields", "validate", "record", "update", "ports", "inputs", "outputs", "groups", "parameters", "shader", "role_of"]
)


def declaration_mistakes(cls: type[Node]) -> list[str]:
    """What is wrong with a node's declaration, one sentence each; empty where it is fine.

    Checked: names are GLSL identifiers and distinct, docs exist, defaults lie inside their range, formats exist, `like`, `view`,
    `lights`, `needs` and `reads` name ports of this node.
    """
    mistakes: list[str] = []
    ports = cls.ports()
    names = [*ports, *cls.parameters()]
    for name in names:
        if not _IDENTIFIER.match(name) or name.startswith("gl_") or "__" in name:
            mistakes.append(f"'{name}' is not a lower-case GLSL identifier")
        elif name in RESERVED_NAMES or name.startswith("model_"):
            mistakes.append(f"'{name}' is reserved by GLSL or by the node's base class; choose another name")
    for name in set(ports) & set(cls.parameters()):
        mistakes.append(f"'{name}' is both a port and a parameter")
    if not (cls.__doc__ or "").strip() or cls.__doc__ == Node.__doc__:
        mistakes.append("the class has no docstring")
    for name, port in ports.items():
        doc = getattr(port, "doc", "")
        if not doc and not isinstance(port, Internal | History):
            mistakes.append(f"port '{name}' has no doc")
        if isinstance(port, Made):
            if isinstance(port.format, str) and port.format not in FORMATS:
                mistakes.append(f"port '{name}' has an unknown format '{port.format}'")
            if port.semantic is None and port.like is None and not isinstance(port, Internal | History):
                mistakes.append(f"port '{name}' has neither a semantic nor `like`")
            for rule in ("like", "view", "lights"):
                target = getattr(port, rule)
                if isinstance(target, str) and target not in ports:
                    mistakes.append(f"port '{name}' is {rule} '{target}', which is no port")
        for rule in ("needs", "reads"):
            mistakes += [
                f"port '{name}' {rule} '{target}', which is no port"
                for target in getattr(port, rule, ())
                if target not in ports
            ]
    for name, info in cls.parameters().items():
        if not info.description:
            mistakes.append(f"parameter '{name}' has no doc")
    try:
        cls.model_validate(cls().model_dump(), strict=False)
    except ValueError as error:
        mistakes.append(f"a default lies outside its range: {error}")
    return mistakes


def names_of(things: Sequence[Port]) -> tuple[str, ...]:
    """The names of ports."""
    return tuple(thing.name for thing in things)
