"""Trace a scene with Mitsuba: `python -m` this module and a folder, which `process.Tracer` starts.

The folder holds `request.json` and `arrays.npz`. Each line of standard input is a number of samples; when a pixel has
that many in all, the result is written to `result.npz`, and an empty line is printed.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
from rendergraph.pipelines.references.mitsuba.lights import Emission, Punctual, environment  # noqa: E402  they need the variant
from rendergraph.pipelines.references.mitsuba.surfaces import Surface, Tables  # noqa: E402

_PASS_RAYS = 1 << 21
"""Camera rays that are traced at once; each takes about 200 bytes."""
_MOST_LAYERS = 64


def build(request: Mapping[str, Any], arrays: Mapping[str, Any], tables: Tables) -> Any:
    """Return the Mitsuba scene of a request."""
    parts: dict[str, Any] = {"type": "scene"}
    for number, mesh in enumerate(request["meshes"]):
        parts[f"mesh{number}"] = _mesh(mesh, tables, arrays, request)
    for number, light in enumerate(request["lights"]):
        parts[f"light{number}"] = Punctual(light, request["shadows"])
    if request["environment"] is not None:
        parts["environment"] = environment(arrays["environment"], **request["environment"])
    elif request["ambient"]:
        parts["ambient"] = {"type": "constant", "radiance": {"type": "rgb", "value": request["ambient"]}}
    return mi.load_dict(parts)


def _mesh(values: Mapping[str, Any], tables: Tables, arrays: Mapping[str, Any], request: Mapping[str, Any]) -> Any:
    (vertex, face), (vertices, faces), material = values["first"], values["size"], values["material"]
    props, uv = mi.Properties(), 0
    props["bsdf"] = Surface(tables, face, request)
    if material >= 0:
        props["emission"] = Emission(tables, material, bool(arrays["flags"][face, 2]))
        uv = 2 * int(arrays["slot.emissive"][material, 5]) if "slot.emissive" in arrays else 0
    # Without normals Mitsuba's frame is the triangle's; `Surface` interpolates the normals itself.
    mesh = mi.Mesh("mesh", vertices, faces, props, has_vertex_normals=False, has_vertex_texcoords=True)
    buffers = mi.traverse(mesh)
    buffers["vertex_positions"] = arrays["vertex.position"][vertex : vertex + vertices, :3].ravel()
    buffers["vertex_texcoords"] = arrays["vertex.uv"][vertex : vertex + vertices, uv : uv + 2].ravel()
    buffers["faces"] = (arrays["corners"][face : face + faces] - np.uint32(vertex)).ravel()
    buffers.update()
    return mesh


def camera_rays(camera: Mapping[str, Any], x: Any, y: Any) -> Any:
    """Return rays through points of the picture, x and y 0 to 1 from the upper left corner, from near to far plane."""
    origin, direction = (
        mi.Vector3f(*rows[0]) + mi.Vector3f(*rows[1]) * x + mi.Vector3f(*rows[2]) * y
        for rows in (camera["origin"], camera["direction"])
    )
    length = dr.norm(direction)
    ray = mi.RayDifferential3f(mi.Point3f(origin + direction * camera["near"]), direction / length)
    ray.maxt = (camera["far"] - camera["near"]) * length
    return ray


@dr.syntax
def cull_back_faces(scene: Any, ray: Any) -> Any:
    """Return camera rays that begin beyond the back faces of single-sided materials, which rasterisers cull."""
    active, layers = mi.Bool(True), mi.UInt32(0)
    while active:
        si = scene.ray_intersect(mi.Ray3f(ray), active)
        active &= si.is_valid() & (si.wi.z < 0)
        active &= (si.bsdf().eval_attribute_1("single_sided", si, active) > 0) & (layers < _MOST_LAYERS)
        beyond = si.spawn_ray(ray.d)
        ray.maxt = dr.select(active, ray.maxt - si.t, ray.maxt)
        ray.o = dr.select(active, beyond.o, ray.o)
        layers += 1
    return ray


class Picture:
    """Sums of the samples of each pixel, and of their squares."""

    def __init__(self, request: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
        tables = Tables(arrays)
        self.request, self.scene = request, build(request, arrays, tables)
        # Shadow rays of `path` end at every surface, those of `volpath` ask the surface.
        kind = "volpath" if tables.passes_light else "path"
        self.integrator = mi.load_dict({"type": kind, "max_depth": request["bounces"] + 2, "rr_depth": 5})
        self.sampler = mi.load_dict({"type": "independent"})
        width, height = request["camera"]["size"]
        self.sums, self.samples, self.passes = np.zeros((6, height, width)), 0, 0

    def extend(self, samples: int) -> None:
        """Take samples until each pixel has this many."""
        camera = self.request["camera"]
        width, height = camera["size"]
        while self.samples < samples:
            count = min(max(1, _PASS_RAYS // (width * height)), samples - self.samples)
            self.sampler.seed(mi.UInt32(self.request["seed"] * 100_003 + self.passes), width * height * count)
            pixel = dr.arange(mi.UInt32, width * height * count) // dr.opaque(mi.UInt32, count)  # one program for all
            within = self.sampler.next_2d() if self.request["jitter"] else mi.Point2f(0.5)
            x, y = (pixel % width + within.x) / width, (pixel // width + within.y) / height
            ray = cull_back_faces(self.scene, camera_rays(camera, x, y))
            light, _, _ = self.integrator.sample(self.scene, self.sampler, ray)
            if self.request["environment"] is None and self.request["ambient"]:  # the camera does not see it
                light &= self.scene.ray_test(mi.Ray3f(ray))
            sums = [dr.block_sum(value, count) for value in (*light, *(light * light))]
            dr.eval(*sums)
            self.sums += np.stack([np.array(value, np.float64).reshape(height, width) for value in sums])
            self.samples, self.passes = self.samples + count, self.passes + 1

    def result(self) -> dict[str, Any]:
        """Return mean radiance, and the variance of this mean."""
        mean, square = np.moveaxis(self.sums.reshape(2, 3, *self.sums.shape[1:]), 1, -1) / self.samples
        variance = np.maximum(square - mean * mean, 0) / max(self.samples - 1, 1)
        return {"radiance": mean.astype(np.float32), "variance": variance.astype(np.float32)}


def main(folder: Path) -> None:
    with np.load(folder / "arrays.npz") as arrays:
        picture = Picture(json.loads((folder / "request.json").read_text()), dict(arrays))
    for line in sys.stdin:
        picture.extend(int(line))
        np.savez(folder / "result.npz", **picture.result())
        print(flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
