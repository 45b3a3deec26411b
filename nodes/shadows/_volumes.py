"""Bases of the nodes that use shadow volumes."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from rendergraph.api import (
    Facts,
    Frame,
    Internal,
    ObjectFacts,
    Port,
    SceneError,
    State,
    Stencil,
    StencilFace,
    Steps,
    ViewMatrices,
    casting_lights,
    param,
    projection,
    structural,
)

from ._casting import Casting
from ._silhouettes import silhouette

Points = npt.NDArray[np.float64]
Z_PASS, Z_FAIL = 1, 2
_COUNTING = {
    Z_PASS: Stencil(StencilFace(depth_pass="incr_wrap"), StencilFace(depth_pass="decr_wrap")),
    Z_FAIL: Stencil(StencilFace(depth_fail="decr_wrap"), StencilFace(depth_fail="incr_wrap")),
}
INSIDE_VOLUMES = Stencil(StencilFace(func="notequal", depth_pass="zero"))
"""Passes inside a volume, and clears the count."""
OUTSIDE_VOLUMES = Stencil(StencilFace(func="equal"))
"""Passes outside all volumes."""
CLEAR_COUNT = Stencil(StencilFace(depth_pass="zero"))
"""Clears the count."""
_NAMES = {Z_PASS: "z-pass", Z_FAIL: "z-fail"}


class HasVolumes(Casting):
    """Base of the nodes that draw the shadow volumes of lights."""

    counting = Internal(
        kind="buffer", bytes=lambda node, facts: 4 * max(1, len(node.lights(facts)) * len(facts.objects))
    )

    length_of_sides: float = param(
        default=0.0,
        unit="m",
        min=0,
        max=1e6,
        doc="Length of the extrusion; 0 extrudes to infinity.",
    )
    unclosed: Literal["refuse", "skip"] = structural(
        default="refuse", doc="Whether casters with open meshes are an error or are skipped."
    )

    def casters(self, facts: Facts) -> tuple[ObjectFacts, ...]:
        """Return the objects that cast shadows.

        Raises:
            SceneError: the mesh of one of them is not closed.
        """
        casters = facts.drawn("casters")
        if self.unclosed == "skip":
            return tuple(one for one in casters if one.closed)
        for one in casters:
            if not one.closed:
                raise SceneError(f"{one.gap}; set `casts_shadow: false` or `unclosed: skip` to leave it out", one.name)
        return casters

    def draw_volumes(self, steps: Steps, layer: int, method: int, geometry: str, **options: Any) -> None:
        """Draw the casters of one counting method with a geometry shader; `options` are those of `steps.geometry`."""
        steps.geometry(
            vertex="shadow_volumes.vert",
            geometry=geometry,
            topology="triangles_adjacency",
            objects=[one.name for one in self.casters(steps.facts)],
            materials="none",
            counting=self.counting,
            first_method=layer * len(steps.facts.objects),
            defines=_defines(self.lights(steps.facts)[layer], method),
            **options,
        )

    def counting_method(self, touches: npt.NDArray[np.bool_]) -> npt.NDArray[np.int32]:
        """Return the counting method per object, given whether it may touch the near-plane pyramid."""
        return np.full(len(touches), Z_FAIL, np.int32)

    def counting_methods(self, frame: Frame) -> tuple[list[Any], npt.NDArray[np.int32]]:
        """Return the lights, and for each the counting method per object; 0 if the light cannot reach the object."""
        scene = frame.scene
        lights = [scene.lights[index] for index in casting_lights(self.light, scene.lights)]
        centers, radii = bounding_spheres(scene)
        methods = np.zeros((len(lights), len(scene.objects)), np.int32)
        for layer, light in enumerate(lights):
            touches = touches_near_pyramid(frame.camera, homogeneous_position(light), centers, radii)
            methods[layer] = self.counting_method(touches)
            if light.range is not None and light.type != "directional":
                methods[layer] *= np.linalg.norm(centers - light.position, axis=1) < radii + light.range
        return lights, methods

    def update(self, frame: Frame) -> None:
        """Upload the counting method per light and object."""
        frame.write(self.counting, self.counting_methods(frame)[1])


class CountsVolumes(HasVolumes):
    """Base of the nodes that count the shadow volumes that contain each pixel's surface (Crow 1977).

    A shadow volume is the space that a caster hides from a light. Its sides are extruded from the silhouette, the edges
    between lit and unlit faces. If a ray from the eye to a surface enters more volumes than it leaves, the surface is
    in shadow. `zpass` counts the faces in front of the surface (Heidmann 1991), which fails if the near plane
    intersects a volume; `zfail` counts those behind it, and needs caps (Bilodeau and Songy 1999, Carmack 2000). `auto`
    uses `zfail` only for objects that may touch the pyramid between the near plane's rectangle and the light (Everitt
    and Kilgard 2002).
    """

    sides = Internal(kind="buffer", bytes=lambda node, facts: 48 * node.max_triangles(facts))  # 3 edges for 2 faces
    faces = Internal(kind="buffer", bytes=lambda node, facts: 48 * node.max_triangles(facts))
    commands = Internal(kind="buffer", bytes=lambda node, facts: 80 * max(1, len(node.lights(facts))))

    method: Literal["auto", "zpass", "zfail"] = structural(
        default="auto", doc="Count faces in front of the surface, behind it, or choose per object."
    )
    silhouettes: Literal["gpu", "cpu"] = structural(
        default="gpu",
        doc="Find silhouettes in a geometry shader, or on the CPU in each frame, which sends less to the GPU.",
    )
    depth_clamp: bool = structural(default=True, doc="Clamp depth, so that a finite far plane does not clip volumes.")

    def max_triangles(self, facts: Facts) -> int:
        """Return an upper bound on the number of triangles in silhouettes."""
        return max(1, len(self.lights(facts)) * sum(one.triangles for one in self.casters(facts)))

    def count(self, steps: Steps, layer: int, stencil: Port, view: Port | None = None) -> None:
        """Count in the stencil how many volumes of a light contain each pixel's surface.

        Args:
            steps: records the steps.
            layer: index into the node's `lights`.
            stencil: depth of the surfaces from the pipeline's camera, with a stencil of zeros.
            view: a port that carries the view.
        """
        casters = self.casters(steps.facts)
        light = self.lights(steps.facts)[layer]
        methods = {"auto": (Z_PASS, Z_FAIL), "zpass": (Z_PASS,), "zfail": (Z_FAIL,)}[self.method]
        for method in methods if casters else ():
            state = State(
                depth_func="greater",
                depth_write=False,
                depth_clamp=self.depth_clamp,
                cull="none",
                front="counter_clockwise",
                stencil=_COUNTING[method],
            )
            options: dict[str, Any] = {
                "out": stencil,
                "view": view,
                "region": layer,
                "state": state,
                "label": f"{steps.lights[light].name}, {_NAMES[method]}",
            }
            if self.silhouettes == "gpu":
                self.draw_volumes(steps, layer, method, "shadow_volumes.geom", fragment=None, **options)
                continue
            command = 4 * layer + 2 * (method == Z_FAIL)
            options |= {"vertices": self.commands, "defines": _defines(light, method)}
            steps.draw(None, vertex="silhouette_sides.vert", sides=self.sides, command=command, **options)
            steps.draw(None, vertex="silhouette_caps.vert", faces=self.faces, command=command + 1, **options)

    def counting_method(self, touches: npt.NDArray[np.bool_]) -> npt.NDArray[np.int32]:
        """Return the counting method per object, given whether it may touch the near-plane pyramid."""
        return np.where(touches if self.method == "auto" else self.method == "zfail", Z_FAIL, Z_PASS)

    def update(self, frame: Frame) -> None:
        """Upload counting methods or silhouettes, and bound the region of the picture that each light can reach."""
        lights, methods = self.counting_methods(frame)
        for layer, light in enumerate(lights):
            if light.range is not None and light.type != "directional":
                frame.set_region(layer, *projection.sphere_bounds(frame.camera, light.position, light.range))
            else:
                frame.set_region(layer)
        if self.silhouettes == "gpu":
            frame.write(self.counting, methods)
        else:
            self._find_silhouettes(frame, lights, methods)

    def _find_silhouettes(self, frame: Frame, lights: list[Any], methods: npt.NDArray[np.int32]) -> None:
        """Upload the sides and caps of all lights one after the other, and the draw command of each range."""
        scene = frame.scene
        casters = [number for number, entry in enumerate(scene.objects) if self._is_caster(scene, entry)]
        sides, faces = [np.zeros((0, 4), np.float32)], [np.zeros((0, 4), np.float32)]
        commands = np.zeros((4 * len(lights), 5), np.int32)
        starts = [0, 0]
        for number in range(2 * len(lights)):
            layer, method = number // 2, (Z_PASS, Z_FAIL)[number % 2]
            for index in casters:
                if methods[layer, index] == method:
                    entry = scene.objects[index]
                    mesh, light = scene.meshes[entry.mesh], homogeneous_position(lights[layer])
                    found = silhouette(mesh, entry.transform, light, entry.pose)
                    sides.append(_as_vec4(found.sides))
                    if method == Z_FAIL or self.length_of_sides > 0:
                        faces.append(_as_vec4(found.lit))
            ends = sum(map(len, sides)) // 2, sum(map(len, faces)) // 3
            for kind in (0, 1):
                commands[2 * number + kind, :3] = 6 * (ends[kind] - starts[kind]), 1, 6 * starts[kind]
            starts = list(ends)
        frame.write(self.sides, np.concatenate(sides))
        frame.write(self.faces, np.concatenate(faces))
        frame.write(self.commands, commands)

    def _is_caster(self, scene: Any, entry: Any) -> bool:
        """Return whether an object is one of the `casters`."""
        is_opaque = entry.casts_shadow and not entry.hidden and scene.materials[entry.material].alpha_mode != "blend"
        return is_opaque and not scene.meshes[entry.mesh].edges.gap


def _as_vec4(points: Points) -> npt.NDArray[np.float32]:
    """Return points as vec4 with w = 1."""
    vectors = np.ones((points.size // 3, 4), np.float32)
    vectors[:, :3] = points.reshape(-1, 3)
    return vectors


def _defines(light: int, method: int) -> dict[str, int]:
    return {"LIGHT": light, "METHOD": method, "Z_PASS": Z_PASS, "Z_FAIL": Z_FAIL}


def homogeneous_position(light: Any) -> Points:
    """Return the homogeneous position of a light, shape (4,); with w = 0 it is the direction to the light."""
    if light.type == "directional":
        return np.array([*(-np.asarray(light.direction, np.float64)), 0.0])
    return np.array([*light.position, 1.0])


def bounding_spheres(scene: Any) -> tuple[Points, Points]:
    """Return centres (n, 3) and radii (n,) of bounding spheres of the scene's objects in world space."""
    boxes = [(entry.pose or scene.meshes[entry.mesh]).box for entry in scene.objects]
    object_boxes = np.array(boxes, np.float64).reshape(-1, 2, 3)
    transforms = np.array([entry.transform for entry in scene.objects]).reshape(-1, 4, 4)
    middle, half = object_boxes.mean(axis=1), np.ptp(object_boxes, axis=1) / 2
    centers = np.einsum("nij,nj->ni", transforms[:, :3, :3], middle) + transforms[:, :3, 3]
    return centers, np.linalg.norm(np.einsum("nij,nj->ni", np.abs(transforms[:, :3, :3]), half), axis=1)


def touches_near_pyramid(camera: ViewMatrices, light: Points, centers: Points, radii: Points) -> npt.NDArray[np.bool_]:
    """Return which spheres may touch the pyramid between the near plane's rectangle and a light (Lengyel 2002).

    Only objects in it cast shadows onto the near plane; for all others z-pass is right.

    Args:
        camera: the view with the near plane.
        light: homogeneous position of the light.
        centers, radii: the spheres.
    """
    corners = projection.frustum_corners(camera, far=2 * max(camera.near, 1e-6))[[0, 1, 3, 2]]
    middle = corners.mean(axis=0)
    near_normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
    light_vector = light[:3] - light[3] * middle
    if abs(near_normal @ light_vector) <= 1e-9 * np.linalg.norm(near_normal) * np.linalg.norm(light_vector):
        return np.ones(len(centers), bool)  # the light lies in the near plane: there is no pyramid
    touches = np.ones(len(centers), bool)
    normals = [near_normal * np.sign(near_normal @ light_vector)]
    for start, stop in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        normal = np.cross(stop - start, light[:3] - light[3] * start)
        normals.append(normal * np.sign(normal @ (middle - start)))
    for normal, point in zip(normals, corners[[0, 0, 1, 2, 3]], strict=True):
        touches &= (centers - point) @ normal > -radii * np.linalg.norm(normal)
    return touches
