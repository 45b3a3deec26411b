"""Parameters of nodes that keyframes of the scene drive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.link import Graph
from rendergraph.scene.model import Scene
from rendergraph.scene.rig import Curve

if TYPE_CHECKING:
    from rendergraph.compile import Executable


def checked(graph: Graph, scene: Scene) -> list[Problem]:
    """Check the keyframes of `nodes.ID.PARAM`; return warnings about nodes that another pipeline may have.

    Raises:
        InputError: there is no such parameter, it cannot change from frame to frame, or a value does not fit it.
    """
    problems, warnings = [], []
    for node, name, curve in scene.node_curves:
        what = f"keyframes of 'nodes.{node}.{name}'"
        if node not in graph:
            text = f"{what}: the pipeline has no node '{node}'{suggestion(node, graph.members)}"
            warnings.append(Problem("RG218", text, curve.place, severity="warning"))
            continue
        parameters = graph[node].type.cls.parameters()
        if name not in parameters or parameters[name].role != "param":
            driven = [known for known, one in parameters.items() if one.role == "param"]
            why = "is fixed when the pipeline is compiled" if name in parameters else "is not a parameter"
            problems.append(Problem("RG219", f"{what}: '{name}' {why}{suggestion(name, driven, most=9)}", curve.place))
            continue
        for value in curve.values.tolist():
            try:
                kind = int if parameters[name].type is int else float
                parameters[name].convert(tuple(map(kind, value)) if isinstance(value, list) else kind(value))
            except (TypeError, ValueError) as error:
                shown = str(value) if isinstance(value, list) else f"{value:g}"
                problems.append(Problem("RG219", f"{what}: {shown}: it {error}", curve.place))
                break
    if problems:
        raise InputError(problems)
    return warnings


class Driven:
    """The driven parameters of a compiled pipeline, with their places in its programs."""

    def __init__(self, graph: Graph, scene: Scene, executable: Executable) -> None:
        """Find the places; InputError if there is none, or a program cannot take the value."""
        self._executable = executable
        self._curves: list[tuple[Curve, bool, int, list[Any]]] = []
        for node, name, curve in scene.node_curves:
            if node not in graph or name not in executable.uniforms.get(node, ()):
                continue  # its outputs are not requested
            parameter = graph[node].type.cls.parameters()[name]
            fill = int(parameter.glsl[3]) if parameter.glsl.startswith("vec") and curve.values.ndim == 1 else 0
            mismatch = executable.set_uniform(node, name, _value(curve, 0.0, parameter.type is int, fill))
            cells = executable.cells(node, name)
            if mismatch is not None or not cells:
                text = mismatch or "no shader that runs in every frame reads it"
                raise InputError(Problem("RG219", f"keyframes of 'nodes.{node}.{name}': {text}", curve.place))
            self._curves.append((curve, parameter.type is int, fill, cells))

    def set(self, time: float) -> None:
        """Set the uniforms to their values at a time."""
        for curve, whole, fill, cells in self._curves:
            value = _value(curve, time, whole, fill)
            for cell in cells:
                self._executable.write_uniform(cell, value)


def _value(curve: Curve, time: float, whole: bool, fill: int) -> Any:
    """Return the value of a uniform: rounded for a `whole` number, repeated to `fill` a vector."""
    value = curve.at(time)
    return round(value) if whole else (value,) * fill if fill else value
