"""Small pipelines of node classes that stand in the tests, on the shared session."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

import rendergraph as rg
from rendergraph.api import Any as AnyTexel
from rendergraph.api import History, InOut, Input, Internal, Node, Output, Radiance, Steps, define, param
from rendergraph.catalog import Catalog


class Pattern(Node):
    """A pattern."""

    color = Output(Radiance, format="rgba32f", doc="Pattern.")
    seed: float = param(default=1.0, doc="Variation.")


class Mix(Node):
    """Two inputs, weighted."""

    a = Input(AnyTexel, doc="One.")
    b = Input(AnyTexel, optional=True, doc="Two.")
    color = Output(Radiance, format="rgba32f", doc="Both.")
    between = Internal(Radiance, format="rgba32f")
    gain: float = param(default=0.5, doc="Weight.")
    twist: int = define(default=1, min=1, max=9, doc="Program text.")

    def record(self, steps: Steps) -> None:
        """By way of an internal texture."""
        if steps.connected(self.b):
            steps.fullscreen("mix.frag", a=self.a, b=self.b, out=self.between)
        else:
            steps.fullscreen("mix.frag", a=self.a, out=self.between)
        steps.fullscreen("copy.frag", source=self.between, out=self.color)


class Stamp(Node):
    """Adds to what somebody else made, in place."""

    color = InOut(Radiance, doc="Continued.")
    amount: float = param(default=0.25, doc="What is added.")

    def record(self, steps: Steps) -> None:
        """One step over what is there."""
        from rendergraph.api import ADD, State

        steps.fullscreen("stamp.frag", out=self.color, state=State(blend=ADD), lift=self.amount)


class Trail(Node):
    """The mean of now and last frame."""

    source = Input(AnyTexel, doc="Now.")
    color = Output(Radiance, format="rgba32f", doc="Mean.")
    kept = History(Radiance, format="rgba32f")
    weight: float = param(default=0.5, doc="Of last frame.")

    def record(self, steps: Steps) -> None:
        """Mix with last frame, and keep."""
        steps.fullscreen("trail.frag", source=self.source, old=self.kept.previous, out=self.color)
        steps.fullscreen("copy.frag", source=self.color, out=self.kept)


CLASSES = (Pattern, Mix, Stamp, Trail)
SHADERS = {
    "pattern.frag": "uniform float seed; out vec4 color; void main() { color = "
    "fract(sin(dot(gl_FragCoord.xy, vec2(12.9898, 78.233)) + seed) * vec4(43758.5453, 2.31, 7.77, 9.1)); }",
    "mix.frag": "uniform sampler2D a;\n#ifdef HAS_B\nuniform sampler2D b;\n#endif\n"
    "uniform float gain; out vec4 between; void main() { ivec2 at = ivec2(gl_FragCoord.xy);\n"
    "between = gain * texelFetch(a, at, 0) + float(TWIST) * 0.125;\n"
    "#ifdef HAS_B\nbetween += (1.0 - gain) * texelFetch(b, at.yx, 0);\n#endif\n}",
    "copy.frag": "uniform sampler2D source; out vec4 color; void main() "
    "{ color = texelFetch(source, ivec2(gl_FragCoord.xy), 0); }",
    "stamp.frag": "uniform float lift; out vec4 color; void main() { color = vec4(lift); }",
    "trail.frag": "uniform sampler2D source; uniform sampler2D old; uniform float weight; out vec4 color; void main() "
    "{ ivec2 at = ivec2(gl_FragCoord.xy); color = mix(texelFetch(source, at, 0), texelFetch(old, at, 0), weight); }",
}


class Maker:
    """Makes pipelines of these classes."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.made = 0
        for name, source in SHADERS.items():
            (folder / name).write_text(source)
        self.catalog = Catalog.of(*CLASSES, shaders=folder)

    def __call__(
        self, nodes: dict[str, Any], output: str, name: str = "p", size: tuple[int, int] = (8, 8)
    ) -> rg.Pipeline:
        text = {"rendergraph": 1, "size": list(size), "nodes": nodes, "outputs": {"radiance": output}}
        self.made += 1  # files are read when they are needed: each has a name of its own
        path = self.folder / f"v{self.made}.yaml"
        path.write_text(yaml.safe_dump(text, sort_keys=False))
        return replace(rg.load(path), catalog=self.catalog)

    @staticmethod
    def random_nodes(seed: int, count: int = 9) -> dict[str, Any]:
        """A connected graph of patterns, mixes and trails; everything reaches the last node."""
        chooser = random.Random(seed)
        nodes: dict[str, Any] = {f"p{i}": {"type": "pattern", "params": {"seed": float(i)}} for i in range(2)}
        free = list(nodes)
        for number in range(count):
            a = chooser.choice(free)
            b = chooser.choice([name for name in nodes if name != a])
            name = f"m{number}"
            if chooser.random() < 0.2:
                nodes[name] = {"type": "trail", "inputs": {"source": f"{a}.color"}}
            else:
                gain = round(chooser.uniform(0.3, 0.7), 3)
                nodes[name] = {
                    "type": "mix",
                    "inputs": {"a": f"{a}.color", "b": f"{b}.color"},
                    "params": {"gain": gain},
                }
                free = [other for other in free if other != b]
            free = [other for other in free if other != a] + [name]
        last = free[0]
        for number, other in enumerate(free[1:]):
            nodes[f"j{number}"] = {"type": "mix", "inputs": {"a": f"{last}.color", "b": f"{other}.color"}}
            last = f"j{number}"
        return nodes


@pytest.fixture
def make(tmp_path: Path) -> Maker:
    return Maker(tmp_path)
