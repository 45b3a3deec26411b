"""The base class of all nodes, and the parameters that are its annotated fields."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache, cached_property
from inspect import get_annotations
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, dataclass_transform, get_args, get_origin

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.errors import Misuse, suggestion
from rendergraph.ports import Function, InOut, Input, Output, Port, Views, WrittenPort
from rendergraph.steps import Frame, Steps
from rendergraph.typecheck import Brief, JsonSchema, Range, conversion_to, hints_of, quoted, test_of, words_for

Role = Literal["param", "define", "structural", "plain"]
_is_number = test_of(float)


class FileContent(Struct, frozen=True):
    """The existing file that a parameter names, with a digest of its content: a changed file is another value."""

    path: Path
    digest: str

    def __str__(self) -> str:
        return str(self.path)


InputFile = Annotated[
    FileContent, "a file's name", Brief("path"), JsonSchema(lambda: {"type": "string", "minLength": 1})
]
"""The type of a parameter that names a file: `look: InputFile | None = structural(default=None, doc=…)`."""


class Parameter(Struct, frozen=True, dict=True):
    """The declaration of a parameter; see `param`, `define` and `structural`.

    Attributes:
        role: a uniform (`param`), program text (`define`) or part of the plan (`structural`). A bare value on the class
            is `plain`, which is a mistake.
        limits: of each number in it, inclusive.
        open_name: the name under which plugins add choices, empty if they cannot.
        name, type: the field's name and annotation.
    """

    role: Role
    default: Any
    doc: str = ""
    unit: str = ""
    limits: Range = Range()
    glsl: str = ""
    open_name: str = ""
    needs: tuple[str, ...] = ()
    unless: str = ""
    name: str = ""
    type: Any = None

    @cached_property
    def choices(self) -> tuple[Any, ...]:
        """The values that its type lists, also as part of a union."""
        return _listed(self.type)

    @cached_property
    def words(self) -> tuple[str, ...]:
        """The choices that are words."""
        return tuple(choice for choice in self.choices if isinstance(choice, str))

    def closed(self, added: tuple[str, ...] = ()) -> Any:
        """Return its type; if plugins can add choices, a `Literal` of its own and the added ones."""
        return Literal[(*self.words, *added)] if self.open_name else self.type

    def takes(self, added: tuple[str, ...] = ()) -> str:
        """Return a description of the values that a file may give; `added` are the choices of plugins."""
        return words_for(self.closed(added), self.limits, file=True)

    def convert(self, value: object) -> Any:
        """Convert a file's value to the parameter's type: a list to a tuple, a whole number to a float.

        Raises:
            TypeError: it does not fit the type: `expected a whole number`.
            ValueError: a number is outside the limits: `must be at least 1`.
        """
        found = conversion_to(self.type)(value)
        if not test_of(self.type)(found):
            raise TypeError(f"expected {self.takes()}")
        if wrong := self.violation(found):
            raise ValueError(wrong)
        return found

    def violation(self, value: object) -> str | None:
        """Return what a value outside the limits must be; None for other values."""
        parts: tuple[Any, ...] = value if isinstance(value, tuple) else (value,)
        return next(filter(None, (self.limits.violation(number) for number in parts if _is_number(number))), None)


def _listed(annotation: Any) -> tuple[Any, ...]:
    parts = get_args(annotation)
    return parts if get_origin(annotation) is Literal else tuple(value for part in parts for value in _listed(part))


def param(
    *,
    default: Any,
    doc: str,
    unit: str = "",
    min: float | None = None,
    max: float | None = None,
    glsl: str = "",
    unless: str = "",
) -> Any:
    """Declare a parameter that becomes a uniform: changing it rebuilds nothing.

    Args:
        default: value if the file gives none.
        doc: one line.
        unit: the unit's symbol, empty for a pure number.
        min, max: smallest and largest legal value, inclusive.
        glsl: the uniform's type, if the annotation does not give it (`vec3` for a number or a colour).
        unless: an optional input that replaces it when connected; setting it then is a warning.
    """
    return Parameter("param", default, doc, unit, Range(min, max), glsl, unless=unless)


def define(
    *,
    default: Any,
    doc: str,
    unit: str = "",
    min: float | None = None,
    max: float | None = None,
    choices: str = "",
    needs: tuple[str, ...] = (),
) -> Any:
    """Declare a parameter that becomes program text: `#define NAME value`, and `#define NAME_CHOICE` for a choice.

    Numbers and switches become `#define SAMPLES 16`; a choice `smith: fast` becomes `#define SMITH SMITH_FAST`, where
    every choice has a number, so that shaders can test `#if SMITH == SMITH_FAST`.

    Args:
        default, doc, unit, min, max: see `param`.
        choices: the name under which plugins add choices, for a type such as `Literal["neutral", "aces"] | str`. Each
            choice is then an include, the node's own `curve/aces.glsl` among its shaders or the shared includes; the
            shader includes it by `#include <CURVE>`, and there are no numbers.
        needs: what such an include may request (`#pragma needs(…)`) and other choices do not need: `NEEDS_…` in the
            shader, `steps.needs(…)` in `record`.
    """
    return Parameter("define", default, doc, unit, Range(min, max), open_name=choices, needs=needs)


def structural(*, default: Any, doc: str, unit: str = "", min: float | None = None, max: float | None = None) -> Any:
    """Declare a parameter that is part of the plan, such as a resolution or a light's name."""
    return Parameter("structural", default, doc, unit, Range(min, max))


DROPPED: Any = None
"""The value with which a subclass removes a port of its base: `depth = DROPPED`."""


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(param, define, structural))
class Node:
    """Base class of all nodes: ports and parameters are class attributes; a full-screen pass needs nothing else.

    Instances are frozen and hold parameter values only; `dict(node)` has them. The type's name is the stem of its
    module.
    """

    def __init__(self, **values: Any) -> None:
        """Create a node with values of parameters; the others have their defaults."""
        parameters = self.parameters()
        wrong = []
        for name in values:
            try:
                values[name] = parameters[name].convert(values[name])
            except KeyError:
                wrong.append(f"it has no parameter '{name}'{suggestion(name, parameters)}")
            except (TypeError, ValueError) as error:
                wrong.append(f"'{name}': {error}, got {quoted(values[name])}")
        if wrong:
            raise Misuse(f"{type(self).__name__}: {'; '.join(wrong)}")
        vars(self).update({name: parameter.default for name, parameter in parameters.items()} | values)
        self.validate()

    def __iter__(self) -> Iterator[tuple[str, Any]]:
        """Yield the names and values of the parameters, for `dict(node)`."""
        return ((name, getattr(self, name)) for name in self.parameters())

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self)})"

    if not TYPE_CHECKING:  # type checkers see a frozen dataclass

        def __eq__(self, other: object) -> bool:
            return type(self) is type(other) and dict(self) == dict(other)

        def __hash__(self) -> int:
            return hash((type(self), *dict(self).values()))

        def __setattr__(self, name: str, value: object) -> None:
            raise Misuse(f"'{name}' cannot be set: a node holds its parameters, which never change, and nothing else")

    shader: ClassVar[str | None] = None
    """Shader of the default `record`: a fragment shader, or a compute shader, which ends in `.comp`; None stands for
    the type's name with `.frag`."""

    twin: ClassVar[str | None] = None
    """Type with the same outputs that computes them exactly and can replace this one: `"traced_shadows"`.

    `compare --reference` substitutes it to find out how much of the error comes from this technique.
    """

    def validate(self) -> None:
        """Check what types and limits of parameters cannot express: `raise ValueError("far must be beyond near")`.

        Called whenever a node is created. The message is shown at the value that causes it, or at the node.
        """

    def record(self, steps: Steps) -> None:
        """Append the steps of this pass; called before the schedule and without GL.

        By default, record one full-screen step, or one dispatch over the first texture that is written or else read;
        nothing if the node writes nothing, such as one that only provides a function.
        """
        if not any(isinstance(port, WrittenPort) for port in steps.ports.values()):
            return
        shader = self.shader or f"{steps.type_name}.frag"
        if shader.endswith(".comp"):
            steps.compute(shader)
        else:
            steps.fullscreen(shader)

    def update(self, frame: Frame) -> None:
        """Compute what changes each frame on the CPU: views, buffers. Called once per frame, before any step runs."""

    def camera_jitter(self, frame: int) -> tuple[float, float]:
        """Return the camera's subpixel jitter in texels, each way from -1 to 1, for techniques that accumulate frames.

        It applies to every pass drawn with the camera; the first node that runs decides. `frame` counts from 0 at the
        start of the history.
        """
        return 0.0, 0.0

    @classmethod
    @cache
    def ports(cls) -> Mapping[str, Port]:
        """Return every port by name, in the order of declaration, bases first."""
        found: dict[str, Port] = {}
        for base in [base for base in reversed(cls.__mro__) if issubclass(base, Node)]:
            for name, value in vars(base).items():
                if isinstance(value, Port):
                    found[name] = value
                else:
                    found.pop(name, None)  # a subclass drops a port by setting it to DROPPED, which is None
        return found

    @classmethod
    @cache
    def inputs(cls) -> Mapping[str, Input | InOut]:
        """Return the ports that take links."""
        return {name: port for name, port in cls.ports().items() if isinstance(port, Input | InOut)}

    @classmethod
    @cache
    def outputs(cls) -> Mapping[str, Output | InOut | Function | Views]:
        """Return the ports that other nodes may read."""
        return {
            name: port
            for name, port in cls.ports().items()
            if isinstance(port, Output | InOut | Function) or (isinstance(port, Views) and port.public)
        }

    @classmethod
    @cache
    def groups(cls) -> Mapping[str, tuple[str, ...]]:
        """Return each group's name with its inputs."""
        table: dict[str, tuple[str, ...]] = {}
        for name, port in cls.inputs().items():
            if isinstance(port, Input) and port.group:
                table[port.group] = (*table.get(port.group, ()), name)
        return table

    @classmethod
    @cache
    def parameters(cls) -> Mapping[str, Parameter]:
        """Return parameters by name, in the order of declaration."""
        hints = hints_of(cls)  # resolved now, as annotations may name types that are defined later
        found: dict[str, Parameter] = {}
        for base in [base for base in reversed(cls.__mro__) if issubclass(base, Node)]:
            for name in {**get_annotations(base), **vars(base)}:
                value, hint = vars(base).get(name), hints.get(name, ClassVar)
                plain = name[0] != "_" and ClassVar not in (hint, get_origin(hint)) and not isinstance(value, Port)
                if isinstance(value, Parameter):
                    found[name] = replace(value, name=name, type=hints.get(name, value.type))
                elif plain or (name in found and not isinstance(value, Port)):
                    found[name] = Parameter("plain", value, name=name, type=hint)
        return found


def type_name(cls: type[Node]) -> str:
    """Return the type name of a class that is not named after a module: the class's name in snake case."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", cls.__name__).lower()
