"""Lighting while the geometry is drawn, once a light."""

from __future__ import annotations

from rendergraph.api import (
    ADD,
    PREMULTIPLIED,
    Depth,
    Input,
    Occlusion,
    Output,
    Port,
    Radiance,
    SceneRef,
    ShadowLookup,
    State,
    Steps,
    View,
    Visibility,
)  # fmt: skip

from ._lighting import Lighting


class ForwardMultipass(Lighting):
    """Radiance of the scene, drawn once for what needs no light and once more for each light, added up.

    How many lights became possible before shaders could loop: every light costs all the geometry again and every
    fragment that is seen, L (V + F). Passes after the first are drawn where depth is equal to what the first left.
    Surfaces with alpha blending cannot be added up light by light; they come last, under all lights at once.
    """

    view = Input(View, kind="view", optional=True, doc="What it is seen from; the pipeline's camera by default.")
    scene = Input(SceneRef, kind="scene", optional=True, doc="What is drawn; the pipeline's scene by default.")
    depth = Input(Depth, use="depth_test", optional=True, doc="Depth of a pre-pass, tested and not written.")
    lookup = Input(ShadowLookup, kind="function", many=True, optional=True, doc="Shadows to look up in place.")
    visibility = Input(
        Visibility, kind="texture2d_array", many=True, optional=True, doc="Shadows in screen space, one layer a light."
    )
    occlusion = Input(Occlusion, optional=True, doc="Scales the ambient light: 1 open, 0 closed.")
    radiance = Output(
        Radiance, format="rgba32f", clear=lambda node: (*node.background_rgb, 0.0),
        doc="Scene-linear radiance, float32: half floats would lose a step with every light. Alpha is coverage.",
    )  # fmt: skip
    surface_depth = Output(
        Depth, format="depth32f", clear=1.0, doc="Depth of the nearest opaque surface, where no pre-pass is connected."
    )

    def record(self, steps: Steps) -> None:
        """Ambient and emitted light first, then each light, then what is blended."""
        out: dict[str, Port] = {"radiance": self.radiance}
        if not steps.connected(self.depth):
            out["surface_depth"] = self.surface_depth
        steps.geometry("forward_multipass.frag", out=out, objects="opaque", defines={"FIRST_PASS": 1})
        added = State(blend=ADD, depth_func="equal", depth_write=False)
        for light in range(len(steps.lights) if self.wants_lights else 0):
            steps.geometry(
                "forward_multipass.frag", out=out, objects="opaque", state=added, per_light=light, light=light
            )
        blended = State(blend=PREMULTIPLIED, depth_write=False)
        steps.geometry("forward_lighting.frag", out=out, objects="transparent", order="back_to_front", state=blended)
