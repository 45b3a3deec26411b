"""One port of every kind, for what is fed to nodes that are checked."""

from __future__ import annotations

from rendergraph.api import (
    ADD,
    Depth,
    Frame,
    Function,
    History,
    InOut,
    Input,
    Node,
    Output,
    Radiance,
    ShadowMap,
    Signature,
    State,
    Steps,
    Views,
    param,
)
from rendergraph.api import Any as AnyTexel

WEIGHT = Signature(
    name="weight",
    declaration="vec3 weight(vec2 uv, int n)",
    arguments=("uv", "n"),
    combine="*",
    neutral="vec3(1.0)",
    doc="A weight.",
)


class Zoo(Node):
    """One of each."""

    sky = Input(Radiance, kind="texture_cube", size="any", filter="linear", doc="A cube.")
    fog = Input(Radiance, kind="texture3d", size="any", filter="linear", doc="A volume.")
    layers = Input(AnyTexel, kind="texture2d_array", doc="An array.")
    samples = Input(Radiance, samples="multi", doc="Multisampled.")
    many = Input(Radiance, many=True, optional=True, doc="Several.")
    shadow_map = Input(ShadowMap, kind="texture2d_array", compare=True, filter="linear", doc="Compared.")
    depth = Input(Depth, doc="Depth with its view.")
    weights = Input(WEIGHT, kind="function", many=True, optional=True, doc="A function.")
    words = Input(AnyTexel, kind="buffer", doc="A buffer.")
    lit = InOut(Radiance, doc="Continued.")
    marks = InOut(AnyTexel, format="r8", clear=0, optional=True, doc="Continued, or made.")
    result = Output(Radiance, format="rgba32f", doc="A texture.")
    edges = Output(Radiance, format="rgba16f", samples=4, clear=0, doc="Multisampled.")
    numbers = Output(AnyTexel, kind="buffer", bytes=64, doc="A buffer.")
    weight_of = Function(WEIGHT, shader="zoo_weight.glsl", reads=("layers",), doc="A function.")
    seen = Views(doc="A view.")
    past = History(AnyTexel, format="r32f")

    gain: float = param(default=1.0, min=0, max=2, doc="A number.")
    slope: float = param(default=1.0, min=0, max=2, doc="A number that the function takes.")
    tint: tuple[float, float, float] = param(default=(1.0, 1.0, 1.0), min=0, max=2, doc="A colour.")

    def record(self, steps: Steps) -> None:
        """Steps of every kind."""
        steps.fullscreen(
            "zoo.frag",
            out={"result": self.result, "past": self.past},
            sky=self.sky,
            fog=self.fog,
            layers=self.layers,
            samples=self.samples,
            many=self.many,
            shadow_map=self.shadow_map,
            depth=self.depth,
            words=self.words,
            weights=self.weights,
            before=self.past.previous,
        )
        steps.fullscreen("zoo_add.frag", out=self.lit, state=State(blend=ADD), result=self.result)
        steps.fullscreen("zoo_mark.frag", out=self.marks, result=self.result)
        steps.compute("zoo.comp", groups=(1, 1, 1), out=self.numbers, result=self.result)
        steps.geometry("zoo_edges.frag", out=self.edges, materials="none")

    def update(self, frame: Frame) -> None:
        """The camera's view once more."""
        frame.set_views(self.seen, [frame.camera])
