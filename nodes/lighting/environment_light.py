"""Image-based lighting."""

from __future__ import annotations

from typing import Any, ClassVar

from rendergraph.api import (
    EnvironmentLight,
    EnvironmentMap,
    Facts,
    Function,
    Input,
    Internal,
    IrradianceSH,
    Node,
    Output,
    Part,
    Radiance,
    Steps,
    define,
    param,
    structural,
)

_COARSEST = 2  # log2 of the side of the coarsest level of cells, as in the shader
_MAX_CELLS = 256  # along a side of a face
_HARMONICS_SIDE = 64  # texels of the faces that harmonics are projected from; with 16 a sun is off by 25 %


def _cube_size(node: Any, facts: Facts) -> tuple[int, int]:
    return node.size, node.size


def _cells_side(node: Any) -> int:
    """Return the number of cells along a side, a power of two, so that four cells form one of the next level."""
    return 1 << min(int(node.size), _MAX_CELLS).bit_length() - 1


def _cells_size(node: Any, facts: Facts) -> tuple[int, int]:
    return _cells_side(node), _cells_side(node)


def _levels(node: Any) -> int:
    return min(int(node.mips), int(node.size).bit_length())


def _sharp_levels(node: Any) -> int:
    """Return the number of levels in `specular`; the wide lobes in `rough` restart at a larger size."""
    return _levels(node) // 2


def _rough_size(node: Any, facts: Facts) -> tuple[int, int]:
    side = int(node.size) >> max(1, _sharp_levels(node) - 1)
    return side, side


class ImageBasedLight(Node):
    """Light surfaces by an environment map (image-based lighting).

    Diffuse light is represented by nine spherical harmonics (Ramamoorthi and Hanrahan 2001). Specular light uses the
    split-sum approximation (Karis 2013): this node prefilters the environment with the GGX lobe, one level of a cube
    map per roughness, and the lighting node has a table of the BRDF factors. All of it is computed once, when the scene
    is first rendered.
    """

    map = Input(
        EnvironmentMap,
        size="any",
        filter="trilinear",
        wrap="repeat",
        doc="The environment map; the scene's by default.",
    )
    cells = Internal(
        kind="texture2d_array",
        format="rgba16f",
        layers=6,
        size=_cells_size,
        mips=lambda node, facts: _cells_side(node).bit_length() - _COARSEST,
        kept=True,
        doc="Mean radiance of the cells of a cube map, with all levels.",
    )
    light_directions = Internal(
        kind="texture2d_array",
        format="rgba32f",
        layers=6,
        size=_cells_size,
        mips=lambda node, facts: _cells_side(node).bit_length() - _COARSEST,
        kept=True,
        doc="Mean direction of the light of each cell, such as that of the sun; float32, because half floats are too "
        "coarse for narrow lobes.",
    )
    cube = Internal(
        kind="texture_cube",
        format="rgba16f",
        size=_cube_size,
        mips=0,
        kept=True,
        doc="The environment as a cube map, from which lobes are sampled.",
    )
    specular = Output(
        Radiance,
        kind="texture_cube",
        format="rgba16f",
        size=_cube_size,
        mips=lambda node, facts: _sharp_levels(node),
        kept=True,
        doc="Radiance averaged over the GGX lobe around each direction, with evenly increasing roughness per level.",
    )
    rough = Output(
        Radiance,
        kind="texture_cube",
        format="rgba16f",
        size=_rough_size,
        mips=lambda node, facts: _levels(node) - _sharp_levels(node),
        kept=True,
        doc="The following levels, up to roughness 1, with more texels than a mip chain would have.",
    )
    between = Output(
        Radiance,
        kind="texture_cube",
        format="rgba16f",
        size=lambda node, facts: (node.size // 2, node.size // 2),
        mips=lambda node, facts: _sharp_levels(node),
        kept=True,
        doc="Levels halfway between those of `specular`.",
    )
    rough_between = Output(
        Radiance,
        kind="texture_cube",
        format="rgba16f",
        size=_rough_size,
        mips=lambda node, facts: _levels(node) - _sharp_levels(node) - 1,
        kept=True,
        doc="Levels halfway between those of `rough`.",
    )
    harmonics = Output(
        IrradianceSH,
        format="rgba32f",
        size=(16, 1),
        kept=True,
        doc="Nine spherical harmonics of the radiance, one per texel, then seven texels of irradiance coefficients.",
    )
    light: ClassVar[Function] = Function(
        EnvironmentLight,
        shader="environment_light.glsl",
        reads=("map", *(cube.sampled("trilinear") for cube in (specular, between, rough, rough_between)), "harmonics"),
        doc="Radiance from a direction, averaged over a lobe.",
    )

    size: int = structural(default=128, min=16, max=1024, unit="texels", doc="Side of the cube map's faces.")
    mips: int = structural(
        default=6, min=3, max=12, doc="Levels of roughness from 0 to 1; another level lies halfway between each two."
    )
    samples: int = define(default=64, min=8, max=1024, doc="Samples per texel, for lobes that are sampled.")
    integrated_from: float = structural(
        default=0.05,
        min=0.05,
        max=2,
        doc="Roughness from which lobes are integrated over the whole environment instead of sampled; 2 samples all.",
    )
    level_bias: float = param(
        default=1.0,
        min=-2,
        max=4,
        unit="levels",
        doc="Bias of the mip level that samples read, against fireflies.",
    )
    window: bool = define(
        default=True,
        doc="Damp the harmonics just enough that the irradiance is not negative opposite a strong light.",
    )

    def record(self, steps: Steps) -> None:
        """Record the cells, the harmonics of one of their levels, and a dispatch per roughness."""
        side = _cells_side(self)
        levels = {"cells": self.cells, "light_directions": self.light_directions}
        steps.compute(
            "environment_cells.comp",
            over=(side, side, 6),
            map=self.map,
            out={name: texture.mip(0) for name, texture in levels.items()},
            label="cells",
        )
        for level in range(1, steps.desc(self.cells).mips):
            steps.compute(
                "environment_downsample.comp",
                over=(side >> level, side >> level, 6),
                cells=self.cells.mip(level - 1),
                light_directions=self.light_directions.mip(level - 1),
                out={f"coarse_{name}": texture.mip(level) for name, texture in levels.items()},
                label=f"{side >> level} cells",
            )
        steps.compute(
            "environment_harmonics.comp",
            over=(256, 1, 1),
            cells=self.cells,
            level=max(0, side.bit_length() - _HARMONICS_SIDE.bit_length()),
            out=self.harmonics,
            label="harmonics",
        )
        self._to_cube(steps, self.specular.mip(0), "roughness 0")
        if self.integrated_from > 0.5 / (_levels(self) - 1):
            self._to_cube(steps, self.cube.mip(0), "cube")
            steps.mipmaps(self.cube)
        last = _levels(self) - 1
        for cubes, offset in (((self.specular, self.rough), 0.0), ((self.between, self.rough_between), 0.5)):
            mips = [(cube, mip) for cube in cubes for mip in range(steps.desc(cube).mips)]
            for level, (cube, mip) in enumerate(mips):
                if level + offset > 0:
                    self._filter(steps, cube, mip, (level + offset) / last)

    def _to_cube(self, steps: Steps, level: Part, label: str) -> None:
        """Record the conversion of the environment map to the finest level of a cube map."""
        out = {"cube": level}
        steps.compute("environment_cube.comp", over=(self.size, self.size, 6), map=self.map, out=out, label=label)

    def _filter(self, steps: Steps, cube: Output, mip: int, roughness: float) -> None:
        """Record one level of a prefiltered cube map."""
        side = steps.desc(cube).mip_size(mip)[0]
        label, out = f"roughness {roughness:.2g}", {"specular": cube.mip(mip)}
        if roughness < self.integrated_from:
            source = self.cube.sampled("trilinear")
            over = (side, side, 6)
            steps.compute(
                "environment_specular.comp", over=over, cube=source, roughness=roughness, out=out, label=label
            )
            return
        over = (-(-side // 2), -(-side // 2), 6)  # each invocation computes four texels
        steps.compute(
            "environment_integral.comp",
            over=over,
            cells=self.cells,
            light_directions=self.light_directions,
            roughness=roughness,
            out=out,
            label=label,
        )
