"""Build materials, lights, cameras and placements from a scene file's values; keyframes rebuild them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal

from msgspec.structs import replace

from rendergraph.facts import NO_EXTRA
from rendergraph.projection import look_at, unit
from rendergraph.scene.geometry import euler_matrix, placement, vec3
from rendergraph.scene.model import Camera, Light, Material, Matrix, Texture, Vec3

_PLAIN = frozenset(Material.__struct_fields__) - {"name", "emissive", "textures"}
"""Fields of a material that equal a scene file's values; `extra` holds those of plugins' keys."""


def material(name: str, values: Mapping[str, Any], textures: Mapping[str, Texture]) -> Material:
    given = {key: value for key, value in values.items() if key in _PLAIN}
    r, g, b = values.get("emissive", (0.0, 0.0, 0.0) if "emissive" not in textures else (1.0, 1.0, 1.0))
    strength = values.get("emissive_strength", 1.0)
    if "metallic_roughness" in textures:  # a texture is multiplied by its factor, so without a factor it counts fully
        given.setdefault("metallic", 1.0)
    return Material(name, emissive=(r * strength, g * strength, b * strength), textures=textures, **given)


def light(name: str, values: Mapping[str, Any]) -> Light:
    """Return a light; raise ValueError for a mistake."""
    direction = unit(values.get("direction", (0.0, -1.0, 0.0)))
    if not direction.any():
        raise ValueError("'direction' has no length")
    inner, outer = values.get("inner_degrees", 0.0), values.get("outer_degrees", 45.0)
    if values["type"] == "spot" and inner >= outer:
        raise ValueError(f"'inner_degrees' ({inner:g}) must be below 'outer_degrees' ({outer:g})")
    return Light(
        name,
        values["type"],
        values.get("at", (0.0, 0.0, 0.0)),
        vec3(direction),
        values.get("color", (1.0, 1.0, 1.0)),
        values.get("intensity", 1.0),
        values.get("range"),
        math.radians(inner),
        math.radians(outer),
        values.get("casts_shadow", True),
        values.get("extra", NO_EXTRA),
    )


def camera(name: str, values: Mapping[str, Any], followed: Vec3 | None = None) -> Camera:
    """Return a camera, which looks at `followed` if it follows an object; raise ValueError for a mistake."""
    near, far = values.get("near", 0.05), values.get("far", 100.0)
    if near >= far:
        raise ValueError(f"'near' ({near:g}) must be below 'far' ({far:g})")
    given = [key for key in ("fov_y_degrees", "height", "frustum") if key in values]
    if len(given) > 1:
        raise ValueError(f"has both '{given[0]}' and '{given[1]}'; choose one")
    if "height" in values and math.isinf(far):
        raise ValueError("an orthographic camera needs a finite 'far'")
    if "frustum" in values and not (
        values["frustum"][0] < values["frustum"][1] and values["frustum"][2] < values["frustum"][3]
    ):
        raise ValueError("'frustum' must be left < right, bottom < top")
    if "follow" in values and "target" in values:
        raise ValueError("has both 'follow' and 'target'; choose one")
    target = followed or values.get("target", (0.0, 0.0, 0.0))
    transform = look_at(values.get("eye", (0.0, 0.0, 5.0)), target, values.get("up", (0.0, 1.0, 0.0)))
    kind: Literal["perspective", "orthographic", "frustum"] = (
        "orthographic" if "height" in values else "frustum" if "frustum" in values else "perspective"
    )
    return Camera(
        name,
        transform,
        kind,
        math.radians(values.get("fov_y_degrees", 45.0)),
        values.get("height", 2.0),
        values.get("frustum"),
        near,
        far,
        target,
        values.get("extra", NO_EXTRA),
        values.get("shutter", 0.0),
        values.get("aspect"),
    )


def placed(values: Mapping[str, Any]) -> Matrix:
    """Return the transform of an object: scale, then rotation, then translation."""
    rotation = values.get("rotation")
    if rotation is None:
        rotation = euler_matrix(values.get("rotate_degrees", (0.0, 0.0, 0.0)))
    return placement(values.get("at", (0.0, 0.0, 0.0)), rotation, values.get("scale", (1.0, 1.0, 1.0)))


def light_matrix(original: Light) -> Matrix:
    """Return the transform of a light: at its position, with -Z along its direction."""
    matrix = look_at((0.0, 0.0, 0.0), original.direction)
    matrix[:3, 3] = original.position
    return matrix


def moved_light(original: Light, matrix: Matrix) -> Light:
    """Return a light with the position and direction of a transform, whose scale is ignored."""
    direction = unit(-matrix[:3, 2])
    moved = replace(original, position=vec3(matrix[:3, 3]))
    return replace(moved, direction=vec3(direction)) if direction.any() else moved
