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
    Radiance,
    Steps,
    define,
    param,
    structural,
)

_HARMONICS_SIDE = 64  # of the faces that harmonics are projected from: those of 16 texels misplace a sun by 25 %


def _cube_size(node: Any, facts: Facts) -> tuple[int, int]:
    return node.size, node.size


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
    cube = Internal(kind="texture_cube", format="rgba16f", size=_cube_size, mips=0, kept=True, doc="As a cube map.")
    leaning = Internal(
        kind="texture_cube",
        format="rgba16f",
        size=_cube_size,
        mips=0,
        kept=True,
        doc="Directions weighted by luminance: a level's texels say where in them the light is, such as a sun.",
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
        kind="buffer",
        bytes=256,
        kept=True,
        doc="16 vec4: the radiance's nine harmonics, then the constants of a diffuse surface's light.",
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
        default=0.25,
        min=0.1,
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
        """The cube with its levels, harmonics of one level, and a dispatch for each roughness."""
        steps.compute(
            "environment_cube.comp",
            over=(self.size, self.size, 6),
            map=self.map,
            out={"cube": self.cube, "leaning": self.leaning},
            label="cube",
        )
        steps.mipmaps(self.cube)
        steps.mipmaps(self.leaning)
        level = max(0, self.size.bit_length() - _HARMONICS_SIDE.bit_length())
        steps.compute(
            "environment_harmonics.comp",
            over=(256, 1, 1),
            cube=self.cube.sampled("trilinear"),
            level=level,
            out=self.harmonics,
            label="harmonics",
        )
        last = _levels(self) - 1
        for cubes, after in (((self.specular, self.rough), 0.0), ((self.between, self.rough_between), 0.5)):
            levels = [(cube, mip) for cube in cubes for mip in range(steps.desc(cube).mips)]
            for level, (cube, mip) in enumerate(levels):
                self._filter(steps, cube, mip, (level + after) / last)

    def _filter(self, steps: Steps, cube: Output, mip: int, roughness: float) -> None:
        """One level of a prefiltered cube map."""
        side = steps.desc(cube).mip_size(mip)[0]
        integrated = roughness >= self.integrated_from
        reads: dict[str, Any] = {"leaning": self.leaning.sampled("trilinear")} if integrated else {}
        steps.compute(
            "environment_integral.comp" if integrated else "environment_specular.comp",
            over=(side, side, 6),
            cube=self.cube.sampled("trilinear"),
            roughness=roughness,
            out={"specular": cube.mip(mip)},
            label=f"roughness {roughness:.2g}",
            **reads,
        )
