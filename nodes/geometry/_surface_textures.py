"""The textures of a G-buffer, as they are written and as they are read.

The nodes that write and read them still assign each port in their class body, because type checkers and editors see
only those. A test compares both with this list.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rendergraph.api import AlbedoRoot, Emissive, Facts, Input, Material, Normal, ObjectFacts, Output, Semantic
from rendergraph.api import Any as AnyTexel

from ._samples import own_samples


@dataclass(frozen=True)
class SurfaceTexture:
    """One texture of a G-buffer.

    Attributes:
        semantic: the meaning of its texels.
        compact: the format for the precision `compact`.
        doc: the contents of its channels.
        default: what readers use if it is not connected; such an input is optional.
        needs: a word of `#pragma needs`; only shading models with it read the texture, all if it is empty.
        unless: words of shading models that do not read it.
        is_relevant: whether an object needs it; if no opaque object does, it is not read.
    """

    semantic: Semantic
    compact: str
    doc: str
    default: str = ""
    needs: str = ""
    unless: tuple[str, ...] = ("nothing",)
    is_relevant: Callable[[ObjectFacts], bool] | None = None

    def output(self) -> Output:
        """Return the port of a node that writes it."""
        return Output(self.semantic, format=self._format, clear=0.0, samples=own_samples, doc=self.doc)

    def input(self) -> Input:
        """Return the port of a node that reads it."""
        doc = f"{self.doc} Unconnected: {self.default}." if self.default else self.doc
        return Input(self.semantic, group="gbuffer", optional=bool(self.default), samples="any", doc=doc)

    def is_needed(self, needs: Collection[str], objects: Sequence[ObjectFacts]) -> bool:
        """Return whether a shading model with these needs reads it, for these objects."""
        is_read = (not self.needs or self.needs in needs) and not any(word in needs for word in self.unless)
        return is_read and (
            self.is_relevant is None or any(self.is_relevant(one) for one in objects if not one.blended)
        )

    def _format(self, node: Any, facts: Facts) -> str:
        return self.compact if node.precision == "compact" else "rgba32f"


SURFACE_TEXTURES: Mapping[str, SurfaceTexture] = {
    "albedo": SurfaceTexture(
        AlbedoRoot, "rgb10_a2", "Square root of the base colour; alpha is 1 on surfaces.", unless=()
    ),
    "normal": SurfaceTexture(Normal, "rgba16_snorm", "Unit shading normal in world space; 0 on the background."),
    "material": SurfaceTexture(
        Material, "rgba16", "Metallic, roughness, occlusion; alpha is 0 for unlit surfaces, else 1."
    ),
    "emissive": SurfaceTexture(Emissive, "r11f_g11f_b10f", "Emitted radiance.", is_relevant=lambda one: one.emissive),
    "specular": SurfaceTexture(
        AnyTexel,
        "rgba8",
        "Square root of f0 of the dielectric part; alpha is its f90.",
        default="f0 of 0.04 and f90 of 1",
        unless=("nothing", "phong"),
        is_relevant=lambda one: one.reflective,
    ),
    "grain": SurfaceTexture(
        AnyTexel,
        "rgba16_snorm",
        "Unit tangent of anisotropic materials in world space; alpha is the strength of the anisotropy.",
        default="none",
        needs="grain",
    ),
    "phong_diffuse": SurfaceTexture(
        AnyTexel,
        "rgb10_a2",
        "Square root of kd of the empirical models.",
        default="derived from the other textures",
        needs="phong",
    ),
    "phong_specular": SurfaceTexture(
        AnyTexel,
        "rgb10_a2",
        "Square root of ks of the empirical models.",
        default="derived from the other textures",
        needs="phong",
    ),
    "phong_ambient": SurfaceTexture(
        AnyTexel,
        "rgb10_a2",
        "Square root of ka of the empirical models.",
        default="derived from the other textures",
        needs="phong",
    ),
}
