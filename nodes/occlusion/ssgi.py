"""Screen-space global illumination from discs."""

from __future__ import annotations

from typing import Any

from rendergraph.api import (
    DROPPED,
    Depth,
    Facts,
    Frame,
    Input,
    Internal,
    Normal,
    Part,
    Radiance,
    Steps,
    Views,
    param,
)

from ._interreflection import Interreflection
from ._screen_space import reduced_size


def _views_beyond(_node: Any, facts: Facts) -> int:
    return len(facts.inputs["beyond_depth"]) if facts.connected("beyond_depth") else 0


def _layers_beyond(node: Any, facts: Facts) -> int:
    return max(1, _views_beyond(node, facts))


def _size_beyond(_node: Any, facts: Facts) -> tuple[int, int]:
    desc = facts.input("beyond_depth").desc if facts.connected("beyond_depth") else None
    return desc.size if desc is not None else (1, 1)


class SSGI(Interreflection):
    """Compute one bounce of diffuse light between the surfaces in the picture.

    Screen-space global illumination as the counterpart of `ssao_disc`: each sample is a disc in space that emits its
    diffuse radiance, with the form factor `A cos e cos r / (π d² + A)` (Bunnell, "Dynamic Ambient Occlusion and
    Indirect Lighting", 2005). Discs hidden by nearer ones in the same direction emit nothing, nor do back faces. Light
    from surfaces outside the picture is missing.
    """

    occlusion = DROPPED
    back_depth = Input(
        Depth,
        optional=True,
        doc="Depth of a G-buffer of back faces, whose light is gathered, too; needs the other two `back_` inputs.",
    )
    back_normal = Input(Normal, optional=True, doc="Unit normal of back faces, world space.")
    back_diffuse = Input(Radiance, optional=True, doc="Diffuse radiance that leaves back faces.")
    beyond_depth = Input(
        Depth,
        size="any",
        optional=True,
        many=True,
        doc="Depth of pictures with other views from the same eye, which show surfaces outside this one; needs the "
        "other two `beyond_` inputs of the same views.",
    )
    beyond_normal = Input(
        Normal, size="any", optional=True, many=True, doc="Unit normal in those pictures, world space."
    )
    beyond_diffuse = Input(Radiance, size="any", optional=True, many=True, doc="Diffuse radiance in those pictures.")
    beyond_views = Views(count=_views_beyond, public=False, doc="The views of those pictures.")
    beyond_surfaces = Internal(
        kind="texture2d_array",
        format="rgba32f",
        size=_size_beyond,
        layers=_layers_beyond,
        view="beyond_views",
        clear=0.0,
    )
    beyond_light = Internal(
        kind="texture2d_array", format="rgba16f", size=_size_beyond, layers=_layers_beyond, clear=0.0
    )
    back_surfaces = Internal(format="rgba32f", size=reduced_size, view="back_depth")

    radius: float = param(
        default=2.5, unit="m", min=1e-6, max=1e6, doc="Surfaces farther away than this emit no light."
    )

    def record(self, steps: Steps) -> None:
        """Record sampling, filtering and the reflection of light."""
        reads: dict[str, Any] = {"diffuse": self.diffuse, "wider": 1.0}
        macros = {"LIGHT": 1}
        if all(steps.connected(port) for port in (self.back_depth, self.back_normal, self.back_diffuse)):
            reads |= {"back_surfaces": self.back_surfaces, "back_diffuse": self.back_diffuse}
            macros["BACK"] = 1
            steps.fullscreen(
                "surfaces.frag",
                out={"surfaces": self.back_surfaces},
                depth=self.back_depth,
                normal=self.back_normal,
                reduced_size=steps.desc(self.back_surfaces).size,
                defines=self.size_defines(steps),
            )
        if beyond := self.pictures_beyond(steps):
            reads |= {"beyond_surfaces": self.beyond_surfaces, "beyond_light": self.beyond_light}
            macros["BEYOND"] = len(steps.facts.inputs["beyond_depth"])
            for layer, pictures in beyond.items():
                surfaces, light = self.beyond_surfaces.layer(layer), self.beyond_light.layer(layer)
                steps.fullscreen("beyond_surfaces.frag", out={"surfaces": surfaces, "light": light}, **pictures)
            for layer in set(range(macros["BEYOND"])) - beyond.keys():
                steps.clear(self.beyond_surfaces.layer(layer))  # background
        self.sample_and_filter(
            steps,
            "discs.frag",
            {"indirect": self.indirect},
            has_vector=True,
            denoise_passes=self.denoise,
            defines=macros,
            **reads,
        )
        self.reflect_indirect(steps)

    def pictures_beyond(self, steps: Steps) -> dict[int, dict[str, Any]]:
        """Return the inputs of the pictures with other views, by layer, where all three are connected."""
        by_view: dict[str, dict[str | None, Part]] = {}
        for name, port in (
            ("depth", self.beyond_depth),
            ("normal", self.beyond_normal),
            ("diffuse", self.beyond_diffuse),
        ):
            infos = steps.facts.inputs[port.name] if steps.connected(port) else ()
            by_view[name] = {info.view: port.link(number) for number, info in enumerate(infos)}
        infos = steps.facts.inputs["beyond_depth"] if steps.connected(self.beyond_depth) else ()
        return {
            number: {name: parts[info.view] for name, parts in by_view.items()}
            for number, info in enumerate(infos)
            if all(info.view in parts for parts in by_view.values())
        }

    def update(self, frame: Frame) -> None:
        """Set the views of the other pictures."""
        if frame.connected(self.beyond_depth):
            frame.set_views(self.beyond_views, frame.views(self.beyond_depth))
