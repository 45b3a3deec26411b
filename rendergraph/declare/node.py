"""The base of every node."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from inspect import get_annotations
from typing import TYPE_CHECKING, Any, ClassVar, dataclass_transform, get_origin

from msgspec.structs import replace

from rendergraph.declare.parameters import Parameter, define, param, structural
from rendergraph.errors import Misuse, suggestion
from rendergraph.ports import Function, InOut, Input, Output, Port, Views, WrittenPort
from rendergraph.steps import Frame, Steps
from rendergraph.typecheck import hints_of, quoted

DROPPED: Any = None
"""What a subclass sets a port of its base to that it does without: `depth = DROPPED`."""


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(param, define, structural))
class Node:
    """Base of every node: ports and parameters as class attributes, nothing more for a plain full-screen pass.

    Instances are frozen and hold parameter values only; `dict(node)` has them. The type's name is the stem of its
    module.
    """

    def __init__(self, **values: Any) -> None:
        """Take values of parameters; the others have their defaults."""
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
        """Names and values of its parameters, for `dict(node)`."""
        return ((name, getattr(self, name)) for name in self.parameters())

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self)})"

    if not TYPE_CHECKING:  # to which the class is a frozen dataclass

        def __eq__(self, other: object) -> bool:
            return type(self) is type(other) and dict(self) == dict(other)

        def __hash__(self) -> int:
            return hash((type(self), *dict(self).values()))

        def __setattr__(self, name: str, value: object) -> None:
            raise Misuse(f"'{name}' cannot be set: a node holds its parameters, which never change, and nothing else")

    shader: ClassVar[str | None] = None
    """Shader of the default `record`: a fragment shader, or a compute shader, which ends in `.comp`; the type's name
    with `.frag` where None."""

    twin: ClassVar[str | None] = None
    """Type that computes the same exactly and takes this one's place, with the same outputs: `"traced_shadows"`.

    `compare --reference` puts it there to find out how much of the error comes from this technique.
    """

    def validate(self) -> None:
        """Refuse what types and limits of the parameters let through: `raise ValueError("far must be beyond near")`.

        Called whenever a node is made. The message is shown at the value that is to blame, or at the node.
        """

    def record(self, steps: Steps) -> None:
        """Append the steps of this pass; called before the schedule and without GL.

        By default one full-screen step, or one dispatch over the first texture that is written or else read; none if
        the node writes nothing, as one that only provides a function.
        """
        if not any(isinstance(port, WrittenPort) for port in steps.ports.values()):
            return
        shader = self.shader or f"{steps.type_name}.frag"
        if shader.endswith(".comp"):
            steps.compute(shader)
        else:
            steps.fullscreen(shader)

    def update(self, frame: Frame) -> None:
        """Compute what changes each frame on the CPU: views, buffers. Called once a frame, before any step runs."""

    def camera_jitter(self, frame: int) -> tuple[float, float]:
        """Return the camera's subpixel jitter in texels, each way from -1 to 1, for techniques that accumulate frames.

        It applies to every pass drawn with the camera; the first node that runs decides. `frame` counts from 0 since
        history began.
        """
        return 0.0, 0.0

    @classmethod
    @cache
    def ports(cls) -> Mapping[str, Port]:
        """Every port by name, in the order of declaration, bases first."""
        found: dict[str, Port] = {}
        for base in [base for base in reversed(cls.__mro__) if issubclass(base, Node)]:
            for name, value in vars(base).items():
                if isinstance(value, Port):
                    found[name] = value
                elif name in found:
                    del found[name]  # a subclass drops a port by setting it to DROPPED, which is None
        return found

    @classmethod
    @cache
    def inputs(cls) -> Mapping[str, Input | InOut]:
        """Ports that take links."""
        return {name: port for name, port in cls.ports().items() if isinstance(port, Input | InOut)}

    @classmethod
    @cache
    def outputs(cls) -> Mapping[str, Output | InOut | Function | Views]:
        """Ports that others may read."""
        return {
            name: port
            for name, port in cls.ports().items()
            if isinstance(port, Output | InOut | Function) or (isinstance(port, Views) and port.public)
        }

    @classmethod
    @cache
    def groups(cls) -> Mapping[str, tuple[str, ...]]:
        """Group name to the inputs it stands for."""
        table: dict[str, tuple[str, ...]] = {}
        for name, port in cls.inputs().items():
            if isinstance(port, Input) and port.group:
                table[port.group] = (*table.get(port.group, ()), name)
        return table

    @classmethod
    @cache
    def parameters(cls) -> Mapping[str, Parameter]:
        """Parameters by name, in the order of declaration."""
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
    """Return the name of the node type of a class that no module stands for: its own in snake case."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", cls.__name__).lower()
