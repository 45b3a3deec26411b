"""Light between surfaces, from discs on the screen."""

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
    """Light that reaches a surface from the others around it in the picture: one bounce of diffuse interreflection.

    Screen-space global illumination as the counterpart of `ssao_disc`: each sample is a disc in space that sends its
    diffuse radiance over, `A cos e cos r / (π d² + A)` of it (Bunnell, "Dynamic Ambient Occlusion and Indirect
    Lighting", 2005). Along each arm a disc that lies behind nearer ones is not seen and sends nothing; nor does the
    back of a face. Light of what the picture does not show is missing.
    """

    occlusion = DROPPED
    back_depth = Input(
        Depth, optional=True, doc="Of a G-buffer of back faces, whose light is gathered too; the other two with it."
    )
    back_normal = Input(Normal, optional=True, doc="Unit normal of back faces, world space.")
    back_diffuse = Input(Radiance, optional=True, doc="Radiance that back faces send, without its specular part.")
    beyond_depth = Input(
        Depth,
        size="any",
        optional=True,
        many=True,
        doc="Of pictures with other views from the same eye, where what lies beside this one is looked for; the other "
        "two of the same views with it.",
    )
    beyond_normal = Input(Normal, size="any", optional=True, many=True, doc="Unit normal there, world space.")
    beyond_diffuse = Input(Radiance, size="any", optional=True, many=True, doc="Radiance sent there, without specular.")
    beyond_views = Views(count=_views_beyond, public=False, doc="The views of the pictures beyond.")
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

    radius: float = param(default=2.5, unit="m", min=1e-6, max=1e6, doc="Nothing farther away than this sends light.")

    def record(self, steps: Steps) -> None:
        """Surfaces, light, the neighbours' mean, full size; then what is made of it."""
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
                reduced=steps.desc(self.back_surfaces).size,
                defines=self.sizes(steps),
            )
        if beyond := self.pictures_beyond(steps):
            reads |= {"beyond_surfaces": self.beyond_surfaces, "beyond_light": self.beyond_light}
            macros["BEYOND"] = len(steps.facts.inputs["beyond_depth"])
            for layer, pictures in beyond.items():
                surfaces, light = self.beyond_surfaces.layer(layer), self.beyond_light.layer(layer)
                steps.fullscreen("beyond.frag", out={"surfaces": surfaces, "light": light}, **pictures)
            for layer in set(range(macros["BEYOND"])) - beyond.keys():
                steps.clear(self.beyond_surfaces.layer(layer))  # nothing is there
        self.look(
            steps, "discs.frag", {"indirect": self.indirect}, four=True, smooth=self.denoise, defines=macros, **reads
        )
        self.send_on(steps)

    def pictures_beyond(self, steps: Steps) -> dict[int, dict[str, Any]]:
        """Depth, normals and light of one view each, by the number of the view; of whole threes alone."""
        found: dict[str, dict[str | None, Part]] = {}
        for name, port in (
            ("depth", self.beyond_depth),
            ("normal", self.beyond_normal),
            ("diffuse", self.beyond_diffuse),
        ):
            infos = steps.facts.inputs[port.name] if steps.connected(port) else ()
            found[name] = {info.view: port.link(number) for number, info in enumerate(infos)}
        infos = steps.facts.inputs["beyond_depth"] if steps.connected(self.beyond_depth) else ()
        return {
            number: {name: parts[info.view] for name, parts in found.items()}
            for number, info in enumerate(infos)
            if all(info.view in parts for parts in found.values())
        }

    def update(self, frame: Frame) -> None:
        """The views of what lies beside the picture."""
        if frame.connected(self.beyond_depth):
            frame.set_views(self.beyond_views, frame.views(self.beyond_depth))
