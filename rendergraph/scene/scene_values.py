"""Materials, lights, cameras and placements from a scene file's values, which keyframes change, and cameras as text."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from rendergraph.document import parse
from rendergraph.errors import InputError, Option, Place, Problem
from rendergraph.keys import Key, Validator, plain
from rendergraph.projection import look_at, unit
from rendergraph.scene import scene_keys
from rendergraph.scene.geometry import euler_matrix, placement, vec3
from rendergraph.scene.model import Camera, Light, Material, Matrix, Texture, Vec3

_LENSES = {"fov_y_degrees": "perspective", "height": "orthographic", "frustum": "frustum"}
"""Types of cameras by the key that chooses them."""
_LEAST_ALPHA = 1e-3
_WORDS = replace(scene_keys.CAMERA, keys=tuple(key for key in scene_keys.CAMERA.keys if key.name != "follow"))
"""A camera as text always has a target."""


def _fields(kind: type[Struct], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values that are fields of a material, a light or a camera with the same name."""
    return {key: values[key] for key in kind.__struct_fields__ if key in values}


def material(name: str, values: Mapping[str, Any], textures: Mapping[str, Texture]) -> Material:
    given = _fields(Material, values)
    r, g, b = given.get("emissive", (0.0, 0.0, 0.0) if "emissive" not in textures else (1.0, 1.0, 1.0))
    strength = values.get("emissive_strength", 1.0)
    given |= {"emissive": (r * strength, g * strength, b * strength), "textures": textures}
    if "metallic_roughness" in textures:  # a texture is multiplied by its factor, so without a factor it counts fully
        given.setdefault("metallic", 1.0)
    return Material(name, **given)


def light(name: str, values: Mapping[str, Any]) -> Light:
    """Return a light; raise ValueError for a mistake."""
    direction = unit(values.get("direction", (0.0, -1.0, 0.0)))
    if not direction.any():
        raise ValueError("'direction' has no length")
    inner, outer = values.get("inner_degrees", 0.0), values.get("outer_degrees", 45.0)
    if values["type"] == "spot" and inner >= outer:
        raise ValueError(f"'inner_degrees' ({inner:g}) must be below 'outer_degrees' ({outer:g})")
    given = _fields(Light, values) | {"position": values.get("at", (0.0, 0.0, 0.0)), "direction": vec3(direction)}
    return Light(name, **given, inner=math.radians(inner), outer=math.radians(outer))


def camera(name: str, values: Mapping[str, Any], followed: Vec3 | None = None) -> Camera:
    """Return a camera, which looks at `followed` if it follows an object; raise ValueError for a mistake."""
    near, far = values.get("near", 0.05), values.get("far", 100.0)
    if near >= far:
        raise ValueError(f"'near' ({near:g}) must be below 'far' ({far:g})")
    lenses = [key for key in _LENSES if key in values]
    if len(lenses) > 1:
        raise ValueError(f"has both '{lenses[0]}' and '{lenses[1]}'; choose one")
    if "height" in values and math.isinf(far):
        raise ValueError("an orthographic camera needs a finite 'far'")
    left, right, bottom, top = values.get("frustum", (-1.0, 1.0, -1.0, 1.0))
    if left >= right or bottom >= top:
        raise ValueError("'frustum' must be left < right, bottom < top")
    if "follow" in values and "target" in values:
        raise ValueError("has both 'follow' and 'target'; choose one")
    target = followed or values.get("target", (0.0, 0.0, 0.0))
    transform = look_at(values.get("eye", (0.0, 0.0, 5.0)), target, values.get("up", (0.0, 1.0, 0.0)))
    kind, fov_y = _LENSES[lenses[0] if lenses else "fov_y_degrees"], math.radians(values.get("fov_y_degrees", 45.0))
    return Camera(name, transform, **(_fields(Camera, values) | {"type": kind, "fov_y": fov_y, "target": target}))


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


# Coefficients of the empirical models ---------------------------------------------------------------------------------
#
# `kd = base (1 - metallic)`, `ks = f0`, `4n = 2/α² - 2` with `α = roughness²`; the ambient coefficient is the albedo
# (design.md §8).


def dielectric_f0(ior: float) -> float:
    """Return the reflectance at normal incidence, `((ior-1)/(ior+1))²`; an ior of 0 stands for infinity."""
    return 1.0 if ior == 0 else ((ior - 1) / (ior + 1)) ** 2


def f0_of(material: Material) -> Vec3:
    """Return the specular reflectance at normal incidence, a mix of dielectric and metal."""
    f0, metallic = dielectric_f0(material.ior), material.metallic
    r, g, b = (
        min(f0 * tint, 1.0) * material.specular * (1 - metallic) + base * metallic
        for tint, base in zip(material.specular_color, material.base_color, strict=False)
    )
    return r, g, b


def exponent(roughness: float) -> float:
    alpha = max(roughness * roughness, _LEAST_ALPHA)
    return (1 / (alpha * alpha) - 1) / 2


def roughness_of(shininess: float) -> float:
    return math.sqrt(math.sqrt(1 / (2 * max(0.0, shininess) + 1)))


def phong_of(material: Material) -> tuple[Vec3, Vec3, Vec3, float]:
    """Return ambient, diffuse and specular coefficient and the exponent n: the material's own, or derived ones."""
    r, g, b, _ = material.base_color
    keep = 1 - material.metallic
    diffuse = material.diffuse or (r * keep, g * keep, b * keep)
    ambient = material.ambient or material.diffuse or (r, g, b)
    specular = material.specular_phong or f0_of(material)
    n = exponent(material.roughness) if material.shininess is None else material.shininess
    return ambient, diffuse, specular, n


# Cameras as text, for the command line and the metadata of pictures ---------------------------------------------------


def keys_of(text: str) -> dict[str, Any]:
    """Return the camera keys of a scene file in a text such as `eye=0,1,5 target=0,1,0 fov=40`.

    `fov` stands for `fov_y_degrees`.
    """
    words = [word.partition("=")[::2] for word in text.split()]
    keys = [(re.sub(r"^fov$", "fov_y_degrees", name), f"[{v}]" if "," in v else v) for name, v in words]
    validator = Validator(scene_keys.CODES)
    try:
        root = parse("".join(f"{json.dumps(name)}: {value}\n" for name, value in keys), "--camera").root
        valid = validator.value(root, Key("camera", _WORDS, ""))
        if validator.problems or valid is None:
            raise InputError(validator.problems)
    except InputError as error:
        here = Place(Option("--camera", text))
        raise InputError([problem.relocate(here) for problem in error.problems]) from None
    found: dict[str, Any] = plain(valid, _WORDS)
    return found


def _lens(camera: Camera) -> tuple[str, Any]:
    """Return the key that chooses a camera's type, with its value."""
    key = next(key for key, kind in _LENSES.items() if kind == camera.type)
    return key, {"fov_y_degrees": math.degrees(camera.fov_y), "height": camera.height}.get(key, camera.frustum)


def described_camera(text: str, other: Camera) -> Camera:
    """Return the camera of a text; values that it does not give come from another camera."""
    values = keys_of(text)
    given: dict[str, Any] = {key: getattr(other, key) for key in ("near", "far", "shutter", "aspect")}
    given["eye"] = vec3(other.transform[:3, 3])
    given["target"] = other.target or vec3(other.transform[:3, 3] - other.transform[:3, 2])
    given |= dict([_lens(other)]) if values.keys().isdisjoint(_LENSES) else {}
    try:
        return camera("camera", given | values)
    except ValueError as problem:
        raise InputError(Problem("RG321", f"camera: {problem}", Place(Option("--camera", text)))) from None


def camera_words(camera: Camera) -> str:
    """Return the text from which `described_camera` makes this camera, whatever the other camera is."""
    _, up, back, eye = (vec3(camera.transform[:3, column]) for column in range(4))
    lens, value = _lens(camera)
    # At the distance of its own target, around which a camera moved by hand turns.
    distance = 0.0 if camera.target is None else float(np.subtract(eye, camera.target) @ np.array(back))
    target = vec3(np.array(eye) - (distance if distance > 0 else 1.0) * np.array(back))
    name = "fov" if lens == "fov_y_degrees" else lens
    values = {"eye": eye, "target": target, "up": up, name: value, "near": camera.near, "far": camera.far}
    numbers = {key: given if isinstance(given, tuple) else (given,) for key, given in values.items()}
    return " ".join(f"{key}={','.join(map(repr, given))}" for key, given in numbers.items()).replace(
        "far=inf", "far=.inf"
    )
