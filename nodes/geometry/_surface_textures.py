"""What a G-buffer holds of a surface: the one list of its textures, as they are drawn and as they are read.

The classes at both ends still name each texture, in one line: type checkers and editors see a port only where a class
body assigns it. A test holds both against this list.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Emissive, Facts, Input, Material, Normal, ObjectFacts, Output, Semantic

from ._samples import own_samples

AlbedoRoot = Semantic("albedo_root", "Root of the linear base colour, 0 to 1: even steps of it are even to the eye.")


@dataclass(frozen=True)
class SurfaceTexture:
    """One texture of a G-buffer.

    Attributes:
        semantic: what it means.
        compact: its format with the precision `compact`.
        doc: what its channels hold, as they are written and as they are read.
        otherwise: what a reader takes that is not given it; such an input is optional.
        needs: the word of the shading models that look at it; all do where there is none.
        unless: the words of those that do not.
        where: which objects have anything to say there; where none of those that are opaque has, nobody looks at it.
    """

    semantic: Semantic
    compact: str
    doc: str
    otherwise: str = ""
    needs: str = ""
    unless: tuple[str, ...] = ("nothing",)
    where: Callable[[ObjectFacts], bool] | None = None

    def drawn(self) -> Output:
        """The port of a node that fills it."""
        return Output(self.semantic, format=self._format, clear=0.0, samples=own_samples, doc=self.doc)

    def read(self) -> Input:
        """The port of a node that lights what it holds."""
        doc = f"{self.doc} Unconnected: {self.otherwise}." if self.otherwise else self.doc
        return Input(self.semantic, group="gbuffer", optional=bool(self.otherwise), samples="any", doc=doc)

    def is_looked_at(self, needs: Collection[str], objects: Sequence[ObjectFacts]) -> bool:
        """Whether a shading model with these needs looks at it, of these objects."""
        looks = (not self.needs or self.needs in needs) and not any(word in needs for word in self.unless)
        return looks and (self.where is None or any(self.where(one) for one in objects if not one.blended))

    def _format(self, node: Any, facts: Facts) -> str:
        return self.compact if node.precision == "compact" else "rgba32f"


SURFACE_TEXTURES: Mapping[str, SurfaceTexture] = {
    "albedo": SurfaceTexture(
        AlbedoRoot, "rgb10_a2", "Root of the base colour; alpha is 1 where a surface is.", unless=()
    ),
    "normal": SurfaceTexture(Normal, "rgba16_snorm", "Unit normal for shading, world space; 0 where nothing is."),
    "material": SurfaceTexture(
        Material, "rgba16", "Metallic, roughness, occlusion, and 1 for surfaces that lights reach, 0 for unlit ones."
    ),
    "emissive": SurfaceTexture(Emissive, "r11f_g11f_b10f", "Emitted radiance.", where=lambda one: one.emissive),
    "specular": SurfaceTexture(
        AnyTexel,
        "rgba8",
        "Of what is not metal: root of the reflectance at normal incidence, and at grazing incidence in alpha.",
        otherwise="4 %, and 1",
        unless=("nothing", "phong"),
        where=lambda one: one.reflective,
    ),
    "grain": SurfaceTexture(
        AnyTexel,
        "rgba16_snorm",
        "Of materials with a grain: its unit direction, world space, and its strength in alpha.",
        otherwise="none",
        needs="grain",
    ),
    "phong_diffuse": SurfaceTexture(
        AnyTexel, "rgb10_a2", "Root of kd of the empirical models.", otherwise="derived", needs="phong"
    ),
    "phong_specular": SurfaceTexture(
        AnyTexel, "rgb10_a2", "Root of ks of the empirical models.", otherwise="derived", needs="phong"
    ),
    "phong_ambient": SurfaceTexture(
        AnyTexel, "rgb10_a2", "Root of ka of the empirical models.", otherwise="derived", needs="phong"
    ),
}
