"""Every argument of every step with everything that could be mistaken for it: refused by name, or carried out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.allocate import allocate
from rendergraph.api import (
    ADD,
    Frame,
    History,
    InOut,
    Input,
    Internal,
    Node,
    Output,
    Part,
    Radiance,
    State,
    Steps,
    Views,
    param,
)
from rendergraph.api import Any as AnyTexel
from rendergraph.catalog import Catalog
from rendergraph.errors import InputError, RendergraphError
from rendergraph.expand import expand
from rendergraph.schedule import schedule


class Stranger(Node):
    """Another class."""

    color = Output(Radiance, doc="Colour.")


class Odd(Node):
    """Does whatever a test says."""

    act: ClassVar[Callable[[Odd, Steps], None]]
    source = Input(AnyTexel, size="any", doc="Source.")
    unlinked = Input(AnyTexel, optional=True, doc="Nothing.")
    many = Input(AnyTexel, many=True, optional=True, doc="Several.")
    state_of = InOut(AnyTexel, optional=True, doc="Continued.")
    color = Output(Radiance, doc="Colour.")
    array = Internal(Radiance, kind="texture2d_array", layers=3, mips=0)
    cube = Internal(Radiance, kind="texture_cube", size=(8, 8))
    numbers = Internal(kind="buffer", bytes=64)
    kept = History(Radiance)
    views = Views(count=2, doc="Views.")
    gain: float = param(default=1.0, doc="Gain.")

    def record(self, steps: Steps) -> None:
        type(self).act(self, steps)
        steps.fullscreen("odd.frag", out=self.color)

    def update(self, frame: Frame) -> None:
        frame.set_views(self.views, [frame.camera] * 2)


VALUES: tuple[Any, ...] = (
    None,
    True,
    -1,
    0,
    1,
    3,
    2**40,
    0.5,
    float("nan"),
    "",
    "color",
    "source",
    b"color",
    (),
    (1, 2, 3),
    (1, 2, 3, 4, 5),
    [0.5],
    {},
    {"color": 1},
    {"a": Odd.color},
    {1: 2},
    object(),
    int,
    Odd,
    np.zeros(2),
    np.float32(2),
    np.array(["a"]),
    lambda: 1,
    Odd.source,
    Odd.unlinked,
    Odd.many,
    Odd.state_of,
    Odd.color,
    Odd.array,
    Odd.cube,
    Odd.numbers,
    Odd.kept,
    Odd.views,
    Odd.kept.previous,
    Odd.array.mip(1),
    Odd.array.layer(2),
    Odd.array.layer(3),
    Odd.cube.layer(5),
    Odd.array.mip(1).at_layer(1),
    Odd.numbers.mip(0),
    Part(Odd.color, previous=True),
    Stranger.color,
    Output(Radiance),
    State(),
    State(blend=ADD),
    ADD,
    {"3f in_position": Odd.numbers},
    {"3f in_position": Odd.color},
    iter("ab"),
)
ARGUMENTS: dict[str, dict[str, Any]] = {
    "fullscreen": {
        "shader": "a.frag",
        "out": None,
        "state": State(),
        "defines": None,
        "value": 1,
        "texture": Odd.source,
    },
    "geometry": {
        "fragment": "a.frag",
        "vertex": "a.vert",
        "geometry": None,
        "out": None,
        "state": State(),
        "defines": None,
        "view": None,
        "view_index": 0,
        "objects": "all",
        "materials": "full",
        "order": "scene",
        "per_light": None,
        "value": 1,
        "texture": Odd.source,
    },
    "draw": {
        "fragment": "a.frag",
        "vertex": "a.vert",
        "vertices": 3,
        "attributes": None,
        "geometry": None,
        "topology": "points",
        "instances": 1,
        "out": None,
        "state": State(),
        "defines": None,
        "view": None,
        "view_index": 0,
        "value": 1,
        "texture": Odd.source,
    },
    "compute": {"shader": "a.comp", "over": None, "groups": None, "out": None, "defines": None, "texture": Odd.source},
    "clear": {"out": Odd.color, "value": 0.0},
    "mipmaps": {"out": Odd.array},
    "desc": {"port": Odd.color},
    "used": {"port": Odd.color},
    "connected": {"port": Odd.source},
}


def cases() -> Iterator[tuple[str, str]]:
    for method, arguments in ARGUMENTS.items():
        for argument in arguments:
            yield method, argument


SHADERS = {
    "stranger.frag": "out vec4 color; void main() { color = vec4(1.0); }",
    "odd.frag": "out vec4 color; void main() { color = vec4(1.0); }",
    "a.frag": "out vec4 any; void main() { any = vec4(1.0); }",
    "a.vert": "void main() { gl_Position = vec4(0.0, 0.0, 0.0, 1.0); }",
    "a.comp": "layout(local_size_x = 1) in; void main() {}",
}


@pytest.fixture(scope="module")
def pipeline(tmp_path_factory: pytest.TempPathFactory) -> rg.Pipeline:
    file: Path = tmp_path_factory.mktemp("odd") / "odd.yaml"
    for name, text in SHADERS.items():
        (file.parent / name).write_text(text)
    file.write_text(
        "rendergraph: 1\nsize: [16, 8]\nnodes:\n  s: {type: stranger}\n  a: {type: odd, inputs: {source: s.color}}\n"
        "outputs: {image: a.color}\n"
    )
    return replace(rg.load(file), catalog=Catalog.of(Stranger, Odd, shaders=file.parent))


@pytest.mark.slow
@pytest.mark.parametrize(("method", "argument"), list(cases()))
def test_nothing_is_a_traceback(pipeline: rg.Pipeline, gl: rg.Session, method: str, argument: str) -> None:
    refused = 0
    for value in VALUES:
        arguments = ARGUMENTS[method] | {argument: value}

        def act(node: Odd, steps: Steps, arguments: dict[str, Any] = arguments) -> None:
            getattr(steps, method)(**arguments)

        Odd.act = act
        try:
            allocate(schedule(expand(pipeline.link().graph)))
        except InputError as error:
            refused += 1
            (problem,) = error.problems
            assert "node 'a' (odd)" in problem.message, (value, problem.message)
            assert "Error: " not in problem.message, (value, problem.message)
            assert "test_odd_arguments.py:" in problem.message, (value, problem.message)
            continue
        try:  # what may be recorded may be drawn, or the shader or the device does not fit
            gl.render(pipeline, warm_up=False)
        except RendergraphError as error:
            codes = {problem.code for problem in error.problems}
            assert codes <= {"RG400", "RG410", "RG411", "RG430", "RG431", "RG434", "RG435", "RG436"}, (value, codes)
    with gl.device.current():
        assert gl.device.raw.error() is None
    assert refused
