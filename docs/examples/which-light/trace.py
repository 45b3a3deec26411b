"""One bounce of light in `room.yaml` by ray tracing in NumPy: `python trace.py traced.exr`.

Straight to the surfaces, one ray a pixel through its middle, then 24×24 stratified directions by the cosine; what the
light sends to where they end, if nothing is in its way. Outgoing radiance without the light's own.
"""

from __future__ import annotations

import sys

import numpy as np
import numpy.typing as npt
from OpenImageIO import ImageBuf, ImageSpec

Floats = npt.NDArray[np.float64]
SIZE, STRATA = (128, 96), 24
EYE, TANGENT = np.array([0, 1, 3.9]), np.tan(np.radians(20))
LIGHT, INTENSITY = np.array([0.1, 1.6, 0.4]), 5.0
WHITE, RED, GREEN = [0.73] * 3, [0.63, 0.065, 0.05], [0.14, 0.45, 0.091]
# Boxes: centre, half extents, turn about Y in degrees, colour. The room is one that is seen from within.
BOXES = [
    ((0, 1, 0), (1, 1, 1), 0, WHITE),
    ((-0.34, 0.6, -0.28), (0.3, 0.6, 0.3), 17, WHITE),
    ((0.33, 0.3, 0.34), (0.3, 0.3, 0.3), -17, WHITE),
]


def nearest(origin: Floats, along: Floats) -> tuple[Floats, Floats, Floats]:
    """Distance to what each ray hits, infinite where that is nothing; its normal and its colour."""
    best = np.full(len(origin), np.inf)
    normal, color = np.zeros_like(origin), np.zeros_like(origin)
    for number, (centre, half, degrees, paint) in enumerate(BOXES):
        angle = np.radians(degrees)
        turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
        start, step = (origin - centre) @ turn, along @ turn
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (-np.array(half) - start) / step, (np.array(half) - start) / step
        near, far = np.fmin(one, other), np.fmax(one, other)
        if number:
            axis = near.argmax(1)
            distance = near.max(1)
            hit = (distance < far.min(1)) & (distance > 1e-6)
            facing = -np.sign(step)
        else:  # from within: where rays leave, but for the open front
            axis = far.argmin(1)
            distance = far.min(1)
            front = (axis == 2) & (step[:, 2] > 0)
            entering = front | (near.max(1) > 1e-6)
            hit, facing = ~entering, -np.sign(step)
            outside = near.max(1) > 1e-6  # the eye's own rays come in by the front
            hit |= outside & (near.argmax(1) == 2) & (near.max(1) < distance) & ~((axis == 2) & (step[:, 2] > 0))
        rows = np.arange(len(origin))
        local = np.zeros_like(origin)
        local[rows, axis] = facing[rows, axis]
        nearer = hit & (distance < best)
        best = np.where(nearer, distance, best)
        normal = np.where(nearer[:, None], local @ turn.T, normal)
        painted = np.tile(np.array(paint), (len(origin), 1))
        if not number:
            painted[(axis == 0) & (step[:, 0] < 0)] = RED
            painted[(axis == 0) & (step[:, 0] > 0)] = GREEN
        color = np.where(nearer[:, None], painted, color)
    return best, normal, color


def lit(place: Floats, normal: Floats, color: Floats) -> Floats:
    """What surfaces send of the light's own."""
    towards = LIGHT - place
    apart = np.linalg.norm(towards, axis=1)
    along = towards / apart[:, None]
    free = nearest(place + 1e-5 * normal, along)[0] >= apart - 1e-4
    falls = INTENSITY * np.maximum((along * normal).sum(1), 0) / apart**2 * free
    return np.asarray(color / np.pi * falls[:, None])


def main() -> None:
    """Trace the picture and write it."""
    width, height = SIZE
    x, y = np.meshgrid((np.arange(width) + 0.5) / width * 2 - 1, 1 - (np.arange(height) + 0.5) / height * 2)
    along = np.stack([x * TANGENT * width / height, y * TANGENT, -np.ones_like(x)], -1).reshape(-1, 3)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    distance, normal, color = nearest(np.tile(EYE, (len(along), 1)), along)
    seen = np.nonzero(np.isfinite(distance))[0]
    picture, random = np.zeros_like(along), np.random.default_rng(1)
    for chunk in np.array_split(seen, max(1, len(seen) // 200)):
        place, up = EYE + along[chunk] * distance[chunk, None], normal[chunk]
        side = np.cross(up, np.where(np.abs(up[:, 1:2]) > 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]]))
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        cell = np.stack(np.meshgrid(np.arange(STRATA), np.arange(STRATA)), -1).reshape(1, -1, 2)
        u = (cell + random.random((len(chunk), STRATA**2, 2))) / STRATA
        radius, around = np.sqrt(u[..., :1]), 2 * np.pi * u[..., 1:]
        ways = radius * (np.cos(around) * side[:, None] + np.sin(around) * np.cross(up, side)[:, None])
        ways = (ways + np.sqrt(1 - radius**2) * up[:, None]).reshape(-1, 3)
        start = np.repeat(place + 1e-5 * up, STRATA**2, 0)
        far, faced, painted = nearest(start, ways)
        ends = np.isfinite(far)
        light = np.zeros_like(ways)
        light[ends] = lit(start[ends] + ways[ends] * far[ends, None], faced[ends], painted[ends])
        picture[chunk] = color[chunk] * light.reshape(len(chunk), -1, 3).mean(1)
    buffer = ImageBuf(ImageSpec(width, height, 3, "float"))
    buffer.set_pixels(buffer.roi, picture.reshape(height, width, 3).astype(np.float32))
    buffer.write(sys.argv[1], "half")


if __name__ == "__main__":
    main()
