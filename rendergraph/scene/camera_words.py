"""Cameras as text, for the command line and the metadata of pictures."""

from __future__ import annotations

import json
import math
import re
from typing import Any

import numpy as np
from msgspec.structs import replace

from rendergraph.document import parse
from rendergraph.errors import InputError, Option, Place, Problem
from rendergraph.keys import Key, Validator, plain
from rendergraph.scene import scene_keys, scene_values
from rendergraph.scene.geometry import vec3
from rendergraph.scene.model import Camera

_WORDS = replace(scene_keys.CAMERA, keys=tuple(key for key in scene_keys.CAMERA.keys if key.name != "follow"))
"""A camera as text always has a target."""


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


def described_camera(text: str, other: Camera) -> Camera:
    """Return the camera of a text; values that it does not give come from another camera."""
    values = keys_of(text)
    x, y, z = other.transform[:3, 3]
    given = {
        "eye": (x, y, z),
        "target": other.target or vec3(other.transform[:3, 3] - other.transform[:3, 2]),
        "near": other.near,
        "far": other.far,
        "shutter": other.shutter,
        "aspect": other.aspect,
    }
    if values.keys().isdisjoint(("fov_y_degrees", "height", "frustum")):
        kind = {"perspective": "fov_y_degrees", "orthographic": "height", "frustum": "frustum"}[other.type]
        given[kind] = {"fov_y_degrees": math.degrees(other.fov_y), "height": other.height}.get(kind, other.frustum)
    here = Place(Option("--camera", text))
    try:
        return scene_values.camera("camera", given | values)
    except InputError as error:
        raise InputError([problem.relocate(here) for problem in error.problems]) from None
    except ValueError as problem:
        raise InputError(Problem("RG321", f"camera: {problem}", here)) from None


def camera_words(camera: Camera) -> str:
    """Return the text from which `described_camera` makes this camera, whatever the other camera is."""
    _, up, back, eye = (vec3(camera.transform[:3, column]) for column in range(4))
    lens = {"perspective": math.degrees(camera.fov_y), "orthographic": camera.height}.get(camera.type, camera.frustum)
    name = {"perspective": "fov", "orthographic": "height"}.get(camera.type, "frustum")
    # At the distance of its own target, around which a camera moved by hand turns.
    distance = 0.0 if camera.target is None else float(np.subtract(eye, camera.target) @ np.array(back))
    target = vec3(np.array(eye) - (distance if distance > 0 else 1.0) * np.array(back))
    values = {"eye": eye, "target": target, "up": up, name: lens, "near": camera.near, "far": camera.far}
    texts = {
        key: ",".join(map(repr, value)) if isinstance(value, tuple) else repr(value) for key, value in values.items()
    }
    return " ".join(f"{key}={text}" for key, text in texts.items()).replace("far=inf", "far=.inf")
