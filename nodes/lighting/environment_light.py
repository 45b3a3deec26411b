"""Light from the picture around the scene."""

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

_COARSE = 2  # bits of the side of the coarsest cells, as in the shader
_MOST_CELLS = 256  # along a side of a face
_HARMONICS_SIDE = 64  # of the faces that harmonics are projected from: those of 16 texels misplace a sun by 25 %


def _cube_size(node: Any, facts: Facts) -> tuple[int, int]:
    return node.size, node.size


def _cells_side(node: Any) -> int:
    """A power of two, so that four cells are one of the level below."""
    return 1 << min(int(node.size), _MOST_CELLS).bit_length() - 1


def _cells_size(node: Any, facts: Facts) -> tuple[int, int]:
    return _cells_side(node), _cells_side(node)


def _levels(node: Any) -> int:
    return min(int(node.mips), int(node.size).bit_length())


def _sharp(node: Any) -> int:
    """How many of the levels are halved from the whole size; those of wide lobes begin anew, larger."""
    return _levels(node) // 2


def _rough_size(node: Any, facts: Facts) -> tuple[int, int]:
    side = int(node.size) >> max(1, _sharp(node) - 1)
    return side, side


class ImageBasedLight(Node):
    """Light from all around, by the picture that is there.

    What a diffuse surface gathers are nine spherical harmonics (Ramamoorthi and Hanrahan 2001). What a rough one
    mirrors is split into two factors (Karis 2013): the mean of the light around the mirrored direction, which is here,
    a level of a cube map for each roughness; and how much of an even light the surface mirrors, a table of the node
    that lights it. All of it is made once, when the scene is drawn first.
    """

    map = Input(
        EnvironmentMap, size="any", filter="trilinear", wrap="repeat", doc="The picture; unconnected, the scene's."
    )
    cells = Internal(
        kind="texture2d_array",
        format="rgba16f",
        layers=6,
        size=_cells_size,
        mips=lambda node, facts: _cells_side(node).bit_length() - _COARSE,
        kept=True,
        doc="Mean radiance of the cells of a cube, level by level.",
    )
    light_directions = Internal(
        kind="texture2d_array",
        format="rgba32f",
        layers=6,
        size=_cells_size,
        mips=lambda node, facts: _cells_side(node).bit_length() - _COARSE,
        kept=True,
        doc="Directions weighted by luminance: a cell's says where in it the light is, such as a sun, finer than half "
        "floats do beside a narrow lobe.",
    )
    cube = Internal(
        kind="texture_cube", format="rgba16f", size=_cube_size, mips=0, kept=True, doc="What lobes are sampled in."
    )
    specular = Output(
        Radiance,
        kind="texture_cube",
        format="rgba16f",
        size=_cube_size,
        mips=lambda node, facts: _sharp(node),
        kept=True,
        doc="Mean radiance over GGX's lobe around each direction; roughness grows evenly from level to level, from 0.",
    )
    rough = Output(
        Radiance,
        kind="texture_cube",
        format="rgba16f",
        size=_rough_size,
        mips=lambda node, facts: _levels(node) - _sharp(node),
        kept=True,
        doc="The levels of roughness that follow, to 1: with more texels than halving would leave them.",
    )
    between = Output(
        Radiance,
        kind="texture_cube",
        format="rgba16f",
        size=lambda node, facts: (node.size // 2, node.size // 2),
        mips=lambda node, facts: _sharp(node),
        kept=True,
        doc="The same at the roughnesses halfway after each level of `specular`.",
    )
    rough_between = Output(
        Radiance,
        kind="texture_cube",
        format="rgba16f",
        size=_rough_size,
        mips=lambda node, facts: _levels(node) - _sharp(node) - 1,
        kept=True,
        doc="The same halfway between the levels of `rough`.",
    )
    harmonics = Output(
        IrradianceSH,
        format="rgba32f",
        size=(16, 1),
        kept=True,
        doc="The radiance's nine harmonics, a texel each, then seven of constants of a diffuse surface's light.",
    )
    light: ClassVar[Function] = Function(
        EnvironmentLight,
        shader="environment_light.glsl",
        reads=("map", *(cube.sampled("trilinear") for cube in (specular, between, rough, rough_between)), "harmonics"),
        doc="Light from around a direction.",
    )

    size: int = structural(default=128, min=16, max=1024, unit="texels", doc="Side of the cube map's faces.")
    mips: int = structural(
        default=6, min=3, max=12, doc="Levels of roughness from 0 to 1; as many less one lie between."
    )
    samples: int = define(default=64, min=8, max=1024, doc="Directions that a texel averages where lobes are sampled.")
    integrated_from: float = structural(
        default=0.05,
        min=0.05,
        max=2,
        doc="Roughness from which on a lobe is integrated over all of the picture, and not sampled; 2 for none.",
    )
    level_bias: float = param(
        default=1.0,
        min=-2,
        max=4,
        unit="levels",
        doc="How much coarser than its own share of the lobe each sample is read, against fireflies.",
    )
    window: bool = define(
        default=True,
        doc="Damp the harmonics by as much as keeps what they give from falling below 0 behind a strong light.",
    )

    def record(self, steps: Steps) -> None:
        """Cells, harmonics of one level of theirs, and a dispatch for each roughness."""
        side = _cells_side(self)
        pictures = {"cells": self.cells, "light_directions": self.light_directions}
        steps.compute(
            "environment_cells.comp",
            over=(side, side, 6),
            map=self.map,
            out={name: picture.mip(0) for name, picture in pictures.items()},
            label="cells",
        )
        for level in range(1, steps.desc(self.cells).mips):
            steps.compute(
                "environment_downsample.comp",
                over=(side >> level, side >> level, 6),
                cells=self.cells.mip(level - 1),
                light_directions=self.light_directions.mip(level - 1),
                out={f"coarse_{name}": picture.mip(level) for name, picture in pictures.items()},
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
        for cubes, after in (((self.specular, self.rough), 0.0), ((self.between, self.rough_between), 0.5)):
            levels = [(cube, mip) for cube in cubes for mip in range(steps.desc(cube).mips)]
            for level, (cube, mip) in enumerate(levels):
                if level + after > 0:
                    self._filter(steps, cube, mip, (level + after) / last)

    def _to_cube(self, steps: Steps, level: Part, label: str) -> None:
        """The picture as the finest level of a cube map."""
        out = {"cube": level}
        steps.compute("environment_cube.comp", over=(self.size, self.size, 6), map=self.map, out=out, label=label)

    def _filter(self, steps: Steps, cube: Output, mip: int, roughness: float) -> None:
        """One level of a prefiltered cube map."""
        side = steps.desc(cube).mip_size(mip)[0]
        label, out = f"roughness {roughness:.2g}", {"specular": cube.mip(mip)}
        if roughness < self.integrated_from:
            source = self.cube.sampled("trilinear")
            over = (side, side, 6)
            steps.compute(
                "environment_specular.comp", over=over, cube=source, roughness=roughness, out=out, label=label
            )
            return
        over = (-(-side // 2), -(-side // 2), 6)  # four texels each
        steps.compute(
            "environment_integral.comp",
            over=over,
            cells=self.cells,
            light_directions=self.light_directions,
            roughness=roughness,
            out=out,
            label=label,
        )
