"""The base class of all nodes."""

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
                elif name in found:
                    del found[name]  # a subclass drops a port by setting it to DROPPED, which is None
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
