"""The base of every node."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, ClassVar

from msgspec.structs import replace
from pydantic import BaseModel, ConfigDict, ValidationInfo, field_validator

from rendergraph.declare.parameters import Parameter
from rendergraph.ports import PORT_TYPES, Function, InOut, Input, Output, Port, Views
from rendergraph.steps import Frame, Steps

DROPPED: Any = None
"""What a subclass sets a port of its base to that it does without: `depth = DROPPED`."""


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
                    del found[name]  # a subclass drops a port by setting it to DROPPED, which is None
    return found


@cache
def _outputs_of(cls: type[Node]) -> dict[str, Output | InOut | Function | Views]:
    return {
        name: port
        for name, port in _ports_of(cls).items()
        if isinstance(port, Output | InOut | Function) or (isinstance(port, Views) and port.public)
    }


@cache
def _inputs_of(cls: type[Node]) -> dict[str, Input | InOut]:
    return {name: port for name, port in _ports_of(cls).items() if isinstance(port, Input | InOut)}


@cache
def _parameters_of(cls: type[Node]) -> dict[str, Parameter]:
    cls.model_rebuild(raise_errors=False)  # a type that was named before it was made
    found: dict[str, Parameter] = {}
    for name, info in cls.model_fields.items():
        declared = next((one for one in info.metadata if isinstance(one, Parameter)), Parameter("plain", info.default))
        found[name] = replace(declared, name=name, type=info.annotation)
    return found


class Node(BaseModel):
    """Base of every node: ports and parameters as class attributes, nothing more for a plain full-screen pass.

    Instances are frozen: they hold parameter values only. The type's name is the stem of its module.
    """

    model_config = ConfigDict(
        frozen=True,
        strict=True,
        extra="forbid",
        ignored_types=(*PORT_TYPES, type(DROPPED)),
        protected_namespaces=(),
        defer_build=True,  # bases are never made into nodes
    )

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        for name in [name for name in cls.__annotations__ if isinstance(vars(cls).get(name), Port)]:
            del cls.__annotations__[name]  # `color: Output = Output(…)` is a port too, and no parameter

    @field_validator("*", mode="after")
    @classmethod
    def _within_limits(cls, value: Any, info: ValidationInfo) -> Any:
        # Not pydantic's ge and le: a parameter may be a number or a colour, and the limits hold for each component.
        if wrong := cls.parameters()[str(info.field_name)].beyond(value):
            raise ValueError(wrong)
        return value

    shader: ClassVar[str | None] = None
    """Shader of the default `record`: a fragment shader, or a compute shader, which ends in `.comp`; the type's name
    with `.frag` where None."""

    def record(self, steps: Steps) -> None:
        """Append the steps of this pass; called before the schedule and without GL.

        By default one full-screen step, or one dispatch over the first texture that is written or else read.
        """
        shader = self.shader or f"{steps.type_name}.frag"
        if shader.endswith(".comp"):
            steps.compute(shader)
        else:
            steps.fullscreen(shader)

    def update(self, frame: Frame) -> None:
        """Compute what changes each frame on the CPU: views, buffers. Called once a frame, before any step runs."""

    def camera_jitter(self, frame: int) -> tuple[float, float]:
        """How far the camera's picture is moved in a frame, in texels, each way from -1 to 1.

        What puts pictures of many frames together asks for each to be taken at other places within its pixels. Every
        pass that is drawn with the camera sees it so; of several nodes the first that runs is asked.

        Args:
            frame: how many have been drawn since history began, from 0.
        """
        return 0.0, 0.0

    @classmethod
    def ports(cls) -> Mapping[str, Port]:
        """Every port by name, in the order of declaration, bases first."""
        return _ports_of(cls)

    @classmethod
    def inputs(cls) -> dict[str, Input | InOut]:
        """Ports that take links."""
        return _inputs_of(cls)

    @classmethod
    def outputs(cls) -> dict[str, Output | InOut | Function | Views]:
        """Ports that others may read."""
        return _outputs_of(cls)

    @classmethod
    def groups(cls) -> dict[str, tuple[str, ...]]:
        """Group name to the inputs it stands for."""
        table: dict[str, tuple[str, ...]] = {}
        for name, port in cls.inputs().items():
            if isinstance(port, Input) and port.group:
                table[port.group] = (*table.get(port.group, ()), name)
        return table

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """Parameters by name, in the order of declaration."""
        return _parameters_of(cls)
