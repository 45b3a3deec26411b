"""The shipped kinds of generated textures: their keys; each has a shader of its name in `shaders/textures/`.

A tile is one unit of `scale` wide. Colours are linear albedo: stone has 0.2 to 0.5, wood 0.1 to 0.4, fired clay 0.1 to
0.3, lime plaster and white marble up to 0.8.
"""

from __future__ import annotations

from collections.abc import Mapping

from rendergraph.declare import SceneKey, TextureKind
from rendergraph.resources import folder

_FOLDER = folder("rendergraph.shaders") / "textures"
_COLOR = tuple[float, float, float]


def _color(name: str, doc: str, default: tuple[float, float, float]) -> SceneKey:
    return SceneKey(name, _COLOR, doc, default, min=0, max=1)


def _count(name: str, doc: str, default: int) -> SceneKey:
    return SceneKey(name, int, doc, default, min=1, max=64)


def _share(name: str, doc: str, default: float, most: float = 1) -> SceneKey:
    return SceneKey(name, float, doc, default, min=0, max=most)


def _roughness(default: float) -> SceneKey:
    return _share("roughness", "Mean roughness; it varies by about a tenth.", default)


def _relief(default: float) -> SceneKey:
    return _share("relief", "Height from the lowest to the highest, in widths of the tile.", default, 0.2)


def _kind(name: str, doc: str, *keys: SceneKey) -> TextureKind:
    return TextureKind(doc, _FOLDER / f"{name}.glsl", keys)


TEXTURES: Mapping[str, TextureKind] = {
    "bricks": _kind(
        "bricks",
        "A wall of bricks or of hewn stone, in courses with mortar.",
        _color("color", "The bricks.", (0.29, 0.115, 0.07)),
        _color("mortar_color", "The mortar.", (0.42, 0.38, 0.33)),
        _count("columns", "Bricks of a course.", 4),
        _count("rows", "Courses; even, so that they fit together where the texture repeats.", 12),
        _share("bond", "By which share of its width each second course is shifted.", 0.5),
        SceneKey("mortar", float, "Width of the joints, in widths of the tile.", 0.011, min=0.001, max=0.1),
        _share("variation", "How much bricks differ in colour.", 0.5, 2),
        _relief(0.007),
        _share("wear", "How uneven and pitted bricks are.", 0.6, 2),
        _roughness(0.8),
    ),
    "planks": _kind(
        "planks",
        "Boards along u, with grain, knots and joints.",
        _color("color", "Early wood, the lightest part of the grain.", (0.38, 0.23, 0.12)),
        _color("dark_color", "Late wood, the darkest part.", (0.16, 0.075, 0.034)),
        _count("rows", "Boards beside each other.", 6),
        _count("columns", "Boards one behind the other.", 1),
        SceneKey("gap", float, "Width of the joints, in widths of the tile.", 0.006, min=0.001, max=0.1),
        _share("variation", "How much boards differ in colour.", 0.6, 2),
        _relief(0.004),
        _roughness(0.5),
    ),
    "tiles": _kind(
        "tiles",
        "Tiles with grout, in one colour or as a chequerboard of two.",
        _color("color", "The tiles.", (0.5, 0.42, 0.33)),
        _color("second_color", "Every second tile.", (0.5, 0.42, 0.33)),
        _color("grout_color", "The grout.", (0.3, 0.28, 0.25)),
        _count("columns", "Tiles along u; even, where there are two colours.", 4),
        _count("rows", "Tiles along v, likewise.", 4),
        SceneKey("grout", float, "Width of the joints, in widths of the tile.", 0.008, min=0.001, max=0.1),
        _share("variation", "How much tiles differ in colour.", 0.4, 2),
        _relief(0.004),
        _share("tilt", "Greatest slope by which a tile lies askew.", 0.01, 0.5),
        _roughness(0.3),
    ),
    "terrazzo": _kind(
        "terrazzo",
        "Chips of stone in a binder, ground and polished.",
        _color("color", "The binder.", (0.52, 0.49, 0.44)),
        _color("chip_color", "Half of the chips.", (0.62, 0.58, 0.52)),
        _color("second_color", "A third of the chips.", (0.26, 0.14, 0.085)),
        _color("third_color", "The other chips.", (0.075, 0.085, 0.09)),
        _count("cells", "The largest chips along one side.", 10),
        _share("density", "Share of the chips that are there.", 0.8),
        _roughness(0.22),
    ),
    "marble": _kind(
        "marble",
        "Polished marble with clouds and veins.",
        _color("color", "The stone.", (0.72, 0.7, 0.66)),
        _color("vein_color", "The veins.", (0.17, 0.17, 0.18)),
        _count("cells", "Clouds along one side.", 2),
        _share("veins", "How strong the veins are.", 0.8),
        _roughness(0.16),
    ),
    "noise": _kind(
        "noise",
        "Two colours mixed by fractal noise, with relief: plaster, soil, rock, ripples of water.",
        _color("color", "Where the noise is low.", (0.44, 0.38, 0.3)),
        _color("second_color", "Where it is high.", (0.58, 0.52, 0.43)),
        _count("cells", "Lumps along one side, of the largest ones.", 4),
        SceneKey("octaves", int, "Sizes of lumps, each half as large as the one before.", 8, min=1, max=10),
        _share("gain", "Height of each size relative to that of the one before.", 0.55),
        _share("contrast", "How far the colours are apart.", 0.8, 4),
        _relief(0.01),
        _share("pits", "Depth of small holes.", 0.0),
        _roughness(0.85),
    ),
    "cobbles": _kind(
        "cobbles",
        "Round stones in sand.",
        _color("color", "Half of the stones.", (0.25, 0.235, 0.215)),
        _color("second_color", "The other stones.", (0.33, 0.28, 0.23)),
        _color("sand_color", "What they lie in.", (0.2, 0.165, 0.12)),
        _count("cells", "Stones along one side.", 10),
        _share("gap", "Width of the joints, in widths of a stone.", 0.1),
        _share("spread", "0 puts the stones on a grid, 1 anywhere.", 0.75),
        _share("variation", "How much stones differ in colour.", 0.5, 2),
        _relief(0.02),
        _roughness(0.7),
    ),
    "leaf": _kind(
        "leaf",
        "One leaf with its ribs, for `alpha_mode: mask`: the stalk at the bottom of the tile, the tip at the top.",
        _color("color", "The blade.", (0.045, 0.13, 0.022)),
        _color("rib_color", "The ribs and the rim.", (0.16, 0.25, 0.06)),
        _share("width", "Of the blade, in widths of the tile.", 0.6),
        _share("lobes", "How deep its outline is cut.", 0.0),
        _relief(0.012),
        _roughness(0.45),
    ),
}
