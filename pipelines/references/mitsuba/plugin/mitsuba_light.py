"""A node whose light comes from Mitsuba; `--reference mitsuba` is a pipeline of it."""

from __future__ import annotations

from typing import Any, Literal
from weakref import WeakKeyDictionary

import numpy as np
from rendergraph.pipelines.references.mitsuba.process import Tracer

from rendergraph.api import Facts, Frame, Internal, Luminance, Node, Output, Radiance, Steps, param, structural


def _bytes(node: Any, facts: Facts) -> int:
    return 24 * facts.viewport[0] * facts.viewport[1]


class MitsubaLight(Node):
    """Trace paths with Mitsuba 3, which computes everything itself: rays, shading, lights, textures.

    Samples accumulate from frame to frame for as long as neither the scene nor the camera changes.
    """

    radiance = Output(Radiance, format="rgba32f", doc="Scene-linear radiance, the mean so far.")
    variance = Output(Radiance, format="rgba32f", doc="Variance of this mean.")
    samples_taken = Output(Luminance, format="r32f", doc="Samples of each pixel so far.")
    traced = Internal(kind="buffer", bytes=_bytes)

    samples: int = param(default=16, min=1, max=4096, doc="Samples of each pixel in a frame.")
    max_bounces: int = param(default=4, min=0, max=64, doc="Reflections between surfaces; 0 is direct light only.")
    ambient: float = param(default=0.03, min=0, doc="Radiance from all sides, for scenes without an environment.")
    diffuse_lobe: Literal["lambert", "fresnel"] = structural(
        default="lambert", doc="Diffuse lobe: of all the light, or times 1 - F (glTF 2.0, appendix B)."
    )

    def record(self, steps: Steps) -> None:
        """Record the copy into textures."""
        width, height = steps.facts.viewport
        steps.fullscreen(
            "mitsuba_light.frag",
            traced=self.traced,
            out={name: getattr(self, name) for name in ("radiance", "variance", "samples_taken")},
            defines={"WIDTH": width, "HEIGHT": height},
            taken=0.0,
        )

    def update(self, frame: Frame) -> None:
        """Take the samples of a frame, and upload the mean of all so far."""
        if frame.changed() or self not in _TRACERS:
            scene: Any = frame.scene
            options: Any = {"bounces": self.max_bounces, "shared": self.diffuse_lobe == "fresnel"}
            options["decode"] = scene.decode
            _TRACERS[self] = Tracer(scene.scene, frame.camera, ambient=(self.ambient,) * 3, **options), 0
        tracer, taken = _TRACERS[self]
        taken += self.samples
        traced = tracer.trace(taken)
        _TRACERS[self] = tracer, taken
        frame.write(self.traced, np.concatenate([traced.radiance, traced.variance], axis=-1))
        frame.set_uniform("taken", float(taken))


_TRACERS: WeakKeyDictionary[MitsubaLight, tuple[Tracer, int]] = WeakKeyDictionary()
"""What traces for a node, and the samples so far. It ends with the node."""
