"""The shipped shapes: generated meshes with exact normals, texture coordinates and tangents.

Each has its centre at the origin and +Y up, sizes in metres. Seen from outside, u runs to the right and v downwards.
Closed shapes are closed 2-manifolds once vertices are welded by position: seams and poles repeat their positions bit by
bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec import Struct
from msgspec.structs import replace
from rendergraph.pipelines.architecture import arch, column, plant, vault
from rendergraph.pipelines.meshes import cap, grid, in_metres, joined, lathe, side_mesh
from rendergraph.pipelines.polygons import clip_ears

from rendergraph.keys import Key
from rendergraph.keys.values import choice, number, vector, whole
from rendergraph.projection import unit
from rendergraph.scene.geometry import translation
from rendergraph.scene.model import Matrix, Mesh

Doubles = npt.NDArray[np.float64]


class ShapePart(Struct, frozen=True, eq=False):
    """One mesh of a shape.

    Attributes:
        local: its transform within the shape, (4, 4).
        suffix: appended to the object's name, empty for the only part.
        changes: material values of this part that replace the material's.
    """

    mesh: Mesh
    local: Matrix
    suffix: str = ""
    changes: tuple[tuple[str, float], ...] = ()


class Shape(Struct, frozen=True):
    """A kind of shape: its parameters and function; `vertices` estimates their number beforehand."""

    doc: str
    keys: tuple[Key, ...]
    make: Callable[..., Mesh | list[ShapePart]]
    vertices: Callable[[Mapping[str, Any]], int] = lambda values: 100


def build(shape: str, **values: Any) -> list[ShapePart]:
    """Build the parts of a shape; parameters that are not given have their defaults."""
    kind = SHAPES[shape]
    given = {key.name: key.default for key in kind.keys} | values
    measured = given.pop("uv") == "metres"
    parts = kind.make(**given)
    parts = parts if isinstance(parts, list) else [ShapePart(parts, np.eye(4))]
    return [replace(part, mesh=in_metres(part.mesh)) for part in parts] if measured else parts


def mesh(shape: str, **values: Any) -> Mesh:
    """The mesh of a shape of one part."""
    return build(shape, **values)[0].mesh


def plane(size: Sequence[float], segments: int) -> Mesh:
    """A horizontal rectangle facing +Y, `size` along X and Z."""
    t = np.linspace(0, 1, segments + 1)
    u, v = np.meshgrid(t, t)
    positions = np.stack([(u - 0.5) * size[0], np.zeros_like(u), (v - 0.5) * size[1]], axis=-1)
    return side_mesh("plane", positions, grid(segments, segments), (0, 1, 0), np.stack([u, v], axis=-1), (1, 0, 0))


def box(size: Sequence[float]) -> Mesh:
    half = np.asarray(size, np.float64) / 2
    parts = []
    for right, up, out in (
        ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
        ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
        ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
        ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
        ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ((-1, 0, 0), (0, 1, 0), (0, 0, -1)),
    ):
        u, v = np.array([[0, 0], [0, 1], [1, 1], [1, 0]]).T[:, :, None]
        positions = (np.asarray(out) + (2 * u - 1) * np.asarray(right) + (1 - 2 * v) * np.asarray(up)) * half
        parts.append(side_mesh("side", positions, [[0, 1, 2], [0, 2, 3]], out, np.concatenate([u, v], axis=1), right))
    return joined("box", parts)


def sphere(radius: float, segments: int, rings: int) -> Mesh:
    """A UV sphere with exact normals."""
    theta = np.pi * np.arange(rings + 1) / rings
    sin, cos = np.sin(theta), np.cos(theta)
    sin[0] = sin[-1] = 0.0  # poles are one point
    return lathe("sphere", [(radius * s, radius * c, s, c) for s, c in zip(sin, cos, strict=True)], segments)


def cylinder(radius: float, height: float, segments: int) -> Mesh:
    half = height / 2
    side = lathe("side", [(radius, half, 1, 0), (radius, -half, 1, 0)], segments)
    return joined("cylinder", [side, cap(radius, half, True, segments), cap(radius, -half, False, segments)])


def cone(radius: float, height: float, segments: int) -> Mesh:
    """An upright cone, its tip at the top, with a flat base."""
    half = height / 2
    tip = lathe("side", [(0, half, height, radius), (radius, -half, height, radius)], segments)
    phi = 2 * np.pi * (np.arange(segments + 1) + 0.5) / segments  # the tip has no normal: each side's own stands there
    slope = unit([height, radius])
    normals = tip.normals.copy()
    normals[: segments + 1] = np.stack(
        [slope[0] * np.sin(phi), np.full(segments + 1, slope[1]), slope[0] * np.cos(phi)], axis=1
    )
    side = Mesh("side", tip.positions, tip.indices, normals, tip.tangents, tip.uv0)
    return joined("cone", [side, cap(radius, -half, False, segments)])


def torus(radius: float, tube: float, segments: int, sides: int) -> Mesh:
    """A ring in the XZ plane: `radius` to the middle of a tube of radius `tube`."""
    theta = np.pi - 2 * np.pi * (np.arange(sides + 1) % sides) / sides
    profile = [(radius + tube * c, tube * s, c, s) for c, s in zip(np.cos(theta), np.sin(theta), strict=True)]
    return lathe("torus", profile, segments)


def torus_knot(radius: float, tube: float, p: int, q: int, segments: int, sides: int) -> Mesh:
    """A tube along a (p, q) torus knot: p turns about the axis, q through the hole.

    The knot lies on a torus of radii `radius` and 0.4·`radius`, whose own normal is at right angles to the knot
    everywhere: with the knot's direction it makes a frame that closes without twist.
    """
    i = np.arange(segments + 1) % segments
    s = 2 * np.pi * i / segments
    minor = 0.4 * radius
    out = np.stack([np.cos(q * s) * np.cos(p * s), np.sin(q * s), -np.cos(q * s) * np.sin(p * s)], axis=1)
    ring = np.stack([np.cos(p * s), np.zeros_like(s), -np.sin(p * s)], axis=1)
    center = radius * ring + minor * out
    ahead = (
        np.stack([-np.sin(p * s), np.zeros_like(s), -np.cos(p * s)], axis=1)
        * (p * (radius + minor * np.cos(q * s)))[:, None]
    )
    ahead += (
        q * minor * np.stack([-np.sin(q * s) * np.cos(p * s), np.cos(q * s), np.sin(q * s) * np.sin(p * s)], axis=1)
    )
    ahead = unit(ahead)
    side = np.cross(ahead, out)
    angle = 2 * np.pi * (np.arange(sides + 1) % sides) / sides
    normals = np.cos(angle)[:, None, None] * out + np.sin(angle)[:, None, None] * side
    positions = center + tube * normals
    u, v = np.meshgrid(np.arange(segments + 1) / segments * max(p, q) * 2, np.arange(sides + 1) / sides)
    uv = np.stack([u, v], axis=-1)
    return side_mesh("torus_knot", positions, grid(segments, sides), normals, uv, np.tile(ahead, (sides + 1, 1)))


def stairs(size: Sequence[float], steps: int) -> Mesh:
    """A solid flight of stairs that climbs towards -Z, within `size`."""
    width, height, depth = size
    profile = [(0.0, 0.0)]
    for k in range(steps):
        profile += [(k / steps, (k + 1) / steps), ((k + 1) / steps, (k + 1) / steps)]
    profile.append((1.0, 0.0))
    zy = np.array(profile)
    left = np.stack([np.full(len(zy), -width / 2), (zy[:, 1] - 0.5) * height, (0.5 - zy[:, 0]) * depth], axis=1)
    right = left * (-1, 1, 1)
    uv = np.stack([zy[:, 0], 1 - zy[:, 1]], axis=1)
    ears = clip_ears(left)
    parts = [
        side_mesh("left", left, ears, (-1, 0, 0), uv * (-1, 1) + (1, 0), (0, 0, 1)),
        side_mesh("right", right, ears[:, ::-1], (1, 0, 0), uv, (0, 0, -1)),
    ]
    for a, b in zip(range(len(left)), [*range(1, len(left)), 0], strict=True):
        corners = np.stack([left[b], left[a], right[a], right[b]])
        normal = unit(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
        square = [[0, 0], [0, 1], [1, 1], [1, 0]]
        parts.append(side_mesh("tread", corners, [[0, 1, 2], [0, 2, 3]], normal, square, (1, 0, 0)))
    return joined("stairs", parts)


def sphere_grid(
    radius: float,
    columns: int,
    rows: int,
    spacing: float,
    roughness: Sequence[float],
    metallic: Sequence[float],
    segments: int,
    rings: int,
) -> list[ShapePart]:
    """Spheres in the XY plane: roughness increases from left to right, metallic from bottom to top."""
    ball = sphere(radius, segments, rings)
    parts = []
    for row, metal in enumerate(np.linspace(metallic[0], metallic[1], rows)):
        for place, rough in enumerate(np.linspace(roughness[0], roughness[1], columns)):
            at = ((place - (columns - 1) / 2) * spacing, (row - (rows - 1) / 2) * spacing, 0.0)
            changes = (("roughness", float(rough)), ("metallic", float(metal)))
            parts.append(ShapePart(ball, translation(at), f"/{place}_{row}", changes))
    return parts


def _range(name: str, doc: str, default: tuple[float, float]) -> Key:
    return Key(name, vector(2, 0, 1), doc, default)


LENGTH = number(0, above=True)
_RADIUS = Key("radius", LENGTH, "Radius.", 0.5, "m")
_HEIGHT = Key("height", LENGTH, "Extent along Y.", 1.0, "m")
_SIZE = Key("size", vector(3, 0, above=True), "Extent along X, Y and Z.", (1.0, 1.0, 1.0), "m")
_SIDES = Key("sides", whole(3, 1024), "Sides around the tube.", 24)
_RINGS = Key("rings", whole(2, 1024), "Rows from pole to pole.", 24)
_SEGMENTS = Key("segments", whole(3, 2048), "Sides around the axis.", 48)
_UV = Key("uv", choice("unit", "metres"), "Texture coordinates: 0 to 1 across each side, or lengths on it.", "unit")
_KINDS: dict[str, Shape] = {
    "plane": Shape(
        "A horizontal rectangle facing +Y.",
        (
            Key("size", vector(2, 0, above=True), "Extent along X and Z.", (1.0, 1.0), "m"),
            Key("segments", whole(1, 1024), "Squares along each side.", 1),
        ),
        plane,
        lambda v: (v["segments"] + 1) ** 2,
    ),
    "box": Shape("A box.", (_SIZE,), box),
    "sphere": Shape(
        "A sphere of latitude and longitude.",
        (_RADIUS, _SEGMENTS, _RINGS),
        sphere,
        lambda v: (v["segments"] + 1) * (v["rings"] + 1),
    ),
    "cylinder": Shape(
        "An upright cylinder with caps.",
        (_RADIUS, _HEIGHT, _SEGMENTS),
        cylinder,
        lambda v: 4 * (v["segments"] + 1),
    ),
    "cone": Shape(
        "An upright cone with a base.",
        (Key("radius", LENGTH, "Radius of the base.", 0.5, "m"), _HEIGHT, _SEGMENTS),
        cone,
        lambda v: 3 * (v["segments"] + 1),
    ),
    "torus": Shape(
        "A ring around Y.",
        (
            Key("radius", LENGTH, "From the centre to the middle of the tube.", 0.5, "m"),
            Key("tube", LENGTH, "Radius of the tube.", 0.2, "m"),
            _SEGMENTS,
            _SIDES,
        ),
        torus,
        lambda v: (v["segments"] + 1) * (v["sides"] + 1),
    ),
    "torus_knot": Shape(
        "A tube along a torus knot around Y.",
        (
            Key("radius", LENGTH, "Radius of the torus the knot lies on.", 0.5, "m"),
            Key("tube", LENGTH, "Radius of the tube.", 0.1, "m"),
            Key("p", whole(1, 32), "Turns about the axis.", 2),
            Key("q", whole(1, 32), "Turns through the hole.", 3),
            Key("segments", whole(3, 8192), "Segments along the knot.", 192),
            _SIDES,
        ),
        torus_knot,
        lambda v: (v["segments"] + 1) * (v["sides"] + 1),
    ),
    "stairs": Shape(
        "A solid flight of stairs that climbs towards -Z.",
        (_SIZE, Key("steps", whole(1, 200), "Number of steps.", 5)),
        stairs,
        lambda v: 12 * v["steps"],
    ),
    "arch": Shape(
        "A wall with a round-arched opening from its foot up.",
        (
            Key("size", vector(3, 0, above=True), "Extent along X, Y and Z.", (3.0, 4.0, 0.5), "m"),
            Key("span", LENGTH, "Width of the opening.", 2.0, "m"),
            Key("spring", number(0), "Height at which it begins to be round.", 2.0, "m"),
            Key("segments", whole(4, 256), "Sides of the round.", 32),
        ),
        arch,
        lambda v: 4 * v["segments"] + 40,
    ),
    "vault": Shape(
        "A block with a groin vault as its underside.",
        (
            Key("size", vector(3, 0, above=True), "Extent along X, Y and Z.", (3.0, 1.6, 3.0), "m"),
            Key("segments", whole(2, 64), "Sides from the crown to a wall.", 12),
        ),
        vault,
        lambda v: 8 * (v["segments"] + 2) ** 2 + 16 * v["segments"],
    ),
    "column": Shape(
        "A round column with base and capital.",
        (
            Key("radius", LENGTH, "Radius of the foot of its shaft; the base reaches 1.4 of it.", 0.2, "m"),
            Key("height", LENGTH, "Extent along Y.", 2.4, "m"),
            _SEGMENTS,
        ),
        column,
        lambda v: 70 * (v["segments"] + 1),
    ),
    "plant": Shape(
        "Leaves that bend down, for a material with a `leaf` texture and `double_sided`; not closed.",
        (
            Key("leaves", whole(1, 20000), "Number of leaves.", 24),
            Key("length", LENGTH, "Length of a leaf.", 0.6, "m"),
            Key("width", LENGTH, "Width of its image.", 0.3, "m"),
            Key("crown", vector(3, 0), "Extent of a bush; 0 for leaves from one point.", (0.0, 0.0, 0.0), "m"),
            Key("droop", number(0, 180), "How far a leaf bends down.", 70.0, "°"),
            Key("seed", whole(0), "Another number gives another plant.", 0),
        ),
        plant,
        lambda v: 10 * v["leaves"],
    ),
    "sphere_grid": Shape(
        "Spheres in the XY plane, objects `name/column_row`: roughness to the right, metallic up.",
        (
            Key("radius", LENGTH, "Radius of one sphere.", 0.4, "m"),
            Key("columns", whole(1, 64), "Values of roughness.", 5),
            Key("rows", whole(1, 64), "Values of metallic.", 5),
            Key("spacing", LENGTH, "Between centres.", 1.0, "m"),
            _range("roughness", "At the left and at the right.", (0.1, 1.0)),
            _range("metallic", "At the bottom and at the top.", (0.0, 1.0)),
            _SEGMENTS,
            _RINGS,
        ),
        sphere_grid,
        lambda v: (v["segments"] + 1) * (v["rings"] + 1),
    ),
}
SHAPES = {name: replace(shape, keys=(*shape.keys, _UV)) for name, shape in _KINDS.items()}
