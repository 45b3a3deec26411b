"""Every field of every port with everything that could be mistaken for it: a mistake with a name, or it works."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.allocate import allocate
from rendergraph.api import Any as AnyTexel
from rendergraph.api import (
    Depth,
    Function,
    History,
    InOut,
    Input,
    Internal,
    Node,
    Output,
    Part,
    Radiance,
    ShadowLookup,
    Views,
)
from rendergraph.catalog import Catalog
from rendergraph.declare import declaration_mistakes
from rendergraph.errors import InputError, Problem
from rendergraph.expand import expand
from rendergraph.schedule import schedule


def fails(*arguments: object) -> object:
    """A rule that does not work."""
    raise LookupError("never")


VALUES: tuple[Any, ...] = (
    None,
    True,
    False,
    -1,
    0,
    1,
    3,
    2**40,
    0.5,
    float("nan"),
    float("inf"),
    "",
    "color",
    "source",
    "linear",
    "rgba16f",
    "buffer",
    "texture2d_array",
    b"color",
    (),
    (1, 2),
    ("source", 0.5),
    ("source", "x"),
    (0.0, 1.0),
    [1],
    {},
    object(),
    int,
    np.zeros(2),
    np.float32(2),
    fails,
    lambda node, facts: None,
    lambda node, facts: -1,
    lambda node: "x",
    lambda node, facts: [1],
    lambda node, facts: (4, 4),
    lambda node, facts: float("inf"),
    lambda: 1,
    Radiance,
    Depth,
    ShadowLookup,
    Part,
)
PORTS: dict[str, tuple[type[Any], dict[str, Any]]] = {
    "input": (Input, {"semantic": AnyTexel, "optional": True, "doc": "D."}),
    "output": (Output, {"semantic": Radiance, "doc": "D."}),
    "in_out": (InOut, {"semantic": Radiance, "doc": "D.", "optional": True}),
    "internal": (Internal, {"semantic": Radiance}),
    "history": (History, {"semantic": Radiance}),
    "views": (Views, {"doc": "D."}),
    "function": (Function, {"signature": ShadowLookup, "shader": "a.glsl", "doc": "D."}),
}
FIELDS = [(port, name) for port, (cls, _) in PORTS.items() for name in cls.__struct_fields__]


def kind(port: object) -> type[Node]:
    """A node class with this port among others."""

    class Odd(Node):
        """Odd."""

        source = Input(AnyTexel, size="any", doc="Source.")
        color = Output(Radiance, doc="Colour.")
        odd = port

        def record(self, steps: Any) -> None:
            steps.fullscreen("a.frag", out=self.color)
            if isinstance(port, Output | InOut | Internal | History):
                if port.kind == "buffer":
                    steps.compute("a.comp", over=1, out=self.odd)
                else:
                    steps.fullscreen("a.frag", out={"odd": self.odd})

    return Odd


class Stranger(Node):
    """Another class."""

    color = Output(Radiance, doc="Colour.")


@pytest.mark.slow
@pytest.mark.parametrize(("port", "name"), FIELDS)
def test_nothing_is_a_traceback(tmp_path: Path, port: str, name: str) -> None:
    cls, given = PORTS[port]
    file = tmp_path / "odd.yaml"
    link = ", odd: s.color" if port == "input" else ""
    shown = ", odd: a.odd" if port in ("output", "in_out") else ""
    file.write_text(
        f"rendergraph: 1\nsize: [16, 8]\nnodes:\n  s: {{type: stranger}}\n  a: {{type: odd, inputs: {{source: s.color{link}}}}}\n"
        f"outputs: {{image: a.color{shown}}}\n"
    )
    told = 0
    for value in VALUES:
        node = kind(cls(**{**given, name: value}))
        mistakes = declaration_mistakes(node)
        assert all(mistake.subject and "\n" not in mistake.text for mistake in mistakes)
        told += bool(mistakes)
        if mistakes:
            continue
        pipeline = replace(rg.load(file), catalog=Catalog.of(Stranger, node, shaders=tmp_path))
        problems: tuple[Problem, ...] = ()
        try:
            allocate(schedule(expand(pipeline.link().graph)))
        except InputError as error:
            problems = error.problems
        assert all(problem.place is not None for problem in problems), (value, problems)
    assert told
