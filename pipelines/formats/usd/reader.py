"""A USD stage as a scene: its meshes, shapes and instances at the stage's first time code, in metres and with Y up.

Faces become triangles, and texture coordinates are turned over, so that they are glTF's. What has no counterpart here
is left out with a warning.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pxr import Tf, Usd, UsdGeom, UsdLux, UsdShade
from rendergraph.pipelines.formats.usd.lights import camera_of, environment_of, lights_of
from rendergraph.pipelines.formats.usd.materials import Materials
from rendergraph.pipelines.polygons import MOST_CORNERS, triangulate
from rendergraph.pipelines.shapes import mesh as shape_mesh

from rendergraph.document import shown
from rendergraph.projection import unit
from rendergraph.scene.geometry import Doubles, filled_normals
from rendergraph.scene.model import FARTHEST, Camera, Environment, Light, Matrix, Mesh, Object, Scene
from rendergraph.scene.reading import Reading, UniqueNames

Ints = npt.NDArray[np.int64]
_Z_TO_Y = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float64)
_AXES = {"X": (1, 2, 0), "Y": (0, 1, 2), "Z": (2, 0, 1)}
"""Where a shape's X, Y and Z, with Y its axis, go for a shape about another axis."""
_POINTS = ("vertex", "varying")


class StageReader:
    """Reads one stage."""

    def __init__(self, path: Path, reading: Reading) -> None:
        self.path, self.reading = path, reading
        try:
            self.stage = Usd.Stage.Open(str(path))
        except Tf.ErrorException as error:
            reason = shown(str(error).strip().splitlines()[-1], 200)
            raise reading.error("RG304", f"the stage cannot be read: {reason}") from None
        for layer in self.stage.GetUsedLayers():
            if layer.realPath and Path(layer.realPath) != path.resolve():
                reading.check_file(reading.resolve(layer.realPath), "layer")
        self.time = Usd.TimeCode(self.stage.GetStartTimeCode())
        self.transforms = UsdGeom.XformCache(self.time)
        metres = float(UsdGeom.GetStageMetersPerUnit(self.stage))
        up = _Z_TO_Y if UsdGeom.GetStageUpAxis(self.stage) == UsdGeom.Tokens.z else np.eye(4)
        self.to_metres: Matrix = up @ np.diag([metres, metres, metres, 1.0])
        self.materials = Materials(reading, self.time)
        self.names = UniqueNames()
        self.objects: list[Object] = []
        self.meshes: list[Mesh] = []
        self.vertices = 0
        self._made: dict[str, list[tuple[int, int]]] = {}  # by a prim's path: its meshes, and their materials

    def read(self) -> Scene:
        """Return the scene of all that is active, visible, and neither a proxy nor a guide."""
        lights: list[Light] = []
        cameras: dict[str, Camera] = {}
        environment: Environment | None = None
        walk = iter(Usd.PrimRange(self.stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
        for prim in walk:
            if not self._is_shown(prim):
                walk.PruneChildren()
            elif prim.IsA(UsdGeom.PointInstancer):
                self._instances(prim)
                walk.PruneChildren()  # prototypes that lie below it are drawn by it alone
            elif prim.IsA(UsdGeom.Gprim):
                self._place(prim, self._in_world(prim), prim.GetName())
            elif prim.IsA(UsdGeom.Camera):
                name = self.names.unique(prim.GetName(), "camera")
                cameras[name] = camera_of(prim, name, self._in_world(prim), self.time, self.to_metres)
            elif prim.IsA(UsdLux.DomeLight) or prim.IsA(UsdLux.DomeLight_1):
                environment = environment_of(prim, self._in_world(prim), self.time, self.reading)
            elif prim.HasAPI(UsdLux.LightAPI):
                name = self.names.unique(prim.GetName(), "light")
                lights += lights_of(prim, name, self._in_world(prim), self.time, self.reading)
        if not self.objects:
            self.reading.warn("RG332", "empty", "contains no mesh; nothing is drawn")
        made = tuple(self.objects), tuple(self.meshes), tuple(self.materials.made)
        return Scene(self.path.stem, self.path, *made, tuple(lights), cameras, environment)

    def _is_shown(self, prim: Any) -> bool:
        if not prim.IsA(UsdGeom.Imageable):
            return not prim.IsA(UsdShade.Material)
        found = UsdGeom.Imageable(prim)
        if found.GetVisibilityAttr().Get(self.time) == UsdGeom.Tokens.invisible:
            return False
        return found.ComputePurpose() in (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)

    def _in_world(self, prim: Any) -> Matrix:
        """A prim's transform to the world in metres with Y up, for column vectors."""
        if UsdGeom.Xformable(prim).TransformMightBeTimeVarying():
            self._stands(prim, "moves")
        return self._matrix(self.transforms.GetLocalToWorldTransform(prim))

    def _matrix(self, matrix: Any) -> Matrix:
        result: Matrix = self.to_metres @ np.array(matrix, np.float64).T
        return result

    def _stands(self, prim: Any, what: str) -> None:
        text = f"'{shown(prim.GetName())}' {what}; its motion is left out, and it is as at the stage's first time code"
        self.reading.warn("RG330", "motion", text)

    # --- objects ------------------------------------------------------------------------------------------------------

    def _place(self, prim: Any, transform: Matrix, name: str) -> None:
        """Add an object for each material of a prim."""
        source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        key = str(source.GetPath())
        if key not in self._made:
            parts = self._mesh(prim) if prim.IsA(UsdGeom.Mesh) else self._shape(prim)
            self._made[key] = list(parts)
        node = self.names.unique(name, "object")
        for number, (mesh, material) in enumerate(self._made[key]):
            if len(self.objects) >= self.reading.limits.objects:
                raise self.reading.over(f"has more than {len(self.objects):,} objects", "objects")
            part = self.names.unique(f"{node}#{number}", "object") if number else node
            self.objects.append(Object(part, mesh, material, transform, node=node))

    def _instances(self, prim: Any) -> None:
        """Objects of a point instancer: its prototypes, each at its points."""
        instancer = UsdGeom.PointInstancer(prim)
        prototypes = [self.stage.GetPrimAtPath(target) for target in instancer.GetPrototypesRel().GetTargets()]
        numbers = instancer.GetProtoIndicesAttr().Get(self.time) or ()
        matrices = instancer.ComputeInstanceTransformsAtTime(self.time, self.time)
        world = self.transforms.GetLocalToWorldTransform(prim)
        for number, matrix in zip(numbers, matrices, strict=False):
            root = prototypes[number]
            # The instance's transform holds the prototype's own; what is below it follows.
            inverse = self.transforms.GetLocalToWorldTransform(root).GetInverse()
            for part in Usd.PrimRange(root, Usd.TraverseInstanceProxies()):
                if part.IsA(UsdGeom.Gprim) and self._is_shown(part):
                    within = self.transforms.GetLocalToWorldTransform(part) * inverse
                    self._place(part, self._matrix(within * matrix * world), f"{prim.GetName()}/{part.GetName()}")

    def _shape(self, prim: Any) -> Iterator[tuple[int, int]]:
        """The mesh of a basic shape, which our own shapes are scaled and turned to."""
        kind = prim.GetTypeName()

        def get(name: str) -> Any:
            return prim.GetAttribute(name).Get(self.time)

        if kind == "Cube":
            shape = shape_mesh("box", size=[get("size")] * 3)
        elif kind == "Sphere":
            shape = shape_mesh("sphere", radius=get("radius"))
        elif kind in ("Cylinder", "Cone"):
            shape = shape_mesh(kind.lower(), radius=get("radius"), height=get("height"))
        elif kind == "Plane":
            shape = shape_mesh("plane", size=[get("width"), get("length")])
        else:
            self.reading.warn("RG330", f"shape {kind}", f"'{kind}' is no shape that is drawn; it is left out")
            return
        axis = get("axis") if prim.HasAttribute("axis") else "Y"
        x, y, z = _AXES[axis]
        arrays = (shape.positions, shape.normals)
        positions, normals = (np.stack([array[:, x], array[:, y], array[:, z]], axis=1) for array in arrays)
        given = UsdGeom.Gprim(prim).GetDisplayColorAttr().Get(self.time) or []
        color = [*given[0], 1.0] if len(given) == 1 and self.materials.of(prim) is None else None
        tint = None if color is None else np.tile(np.array(color, np.float32), (len(positions), 1))
        made = Mesh(prim.GetName(), positions, shape.indices, normals, None, shape.uv0, None, tint)
        yield self._add(made, prim, is_tinted=tint is not None)

    def _mesh(self, prim: Any) -> Iterator[tuple[int, int]]:
        """The meshes of a polygon mesh, one for each of its materials."""
        found, name = UsdGeom.Mesh(prim), shown(prim.GetName())
        if found.GetPointsAttr().ValueMightBeTimeVarying() or prim.HasRelationship("skel:skeleton"):
            self._stands(prim, "changes its shape")
        points = np.array(found.GetPointsAttr().Get(self.time) or (), np.float64).reshape(-1, 3)
        sizes = np.array(found.GetFaceVertexCountsAttr().Get(self.time) or (), np.int64)
        corners = np.array(found.GetFaceVertexIndicesAttr().Get(self.time) or (), np.int64)
        if sizes.sum() != len(corners) or (len(corners) and not 0 <= corners.min() <= corners.max() < len(points)):
            raise self.reading.error("RG305", f"mesh '{name}' has corners without a point, or faces without a corner")
        if not (np.abs(points) <= FARTHEST).all():
            raise self.reading.error("RG305", f"mesh '{name}' has points that are not finite, or beyond {FARTHEST:g}")
        whole = np.flatnonzero(sizes >= 3)  # of two corners there is nothing to see
        rows = np.flatnonzero(np.repeat(sizes >= 3, sizes))
        try:
            triangles, faces = triangulate(points, corners[rows], sizes[whole])
        except ValueError:
            text = f"mesh '{name}' has a concave face of more than {MOST_CORNERS} corners; cut it into smaller ones"
            raise self.reading.error("RG307", text) from None
        triangles, faces = rows[triangles], whole[faces]
        if found.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
            triangles = triangles[:, ::-1]
        table = _Corners(np.repeat(np.arange(len(sizes)), sizes), corners)
        normals = self._normals(found, table, points, triangles, faces)
        for material_prim, chosen in self._subsets(prim, faces):
            used, indices = np.unique(triangles[chosen], return_inverse=True)
            coordinates = table.values(prim, self.materials.coordinates(material_prim or prim), self.time, 2)
            columns = [points[corners[used]], normals[used]]
            if coordinates is not None:
                columns.append(coordinates[used] * (1, -1) + (0, 1))
            colors = table.values(prim, "displayColor", self.time, 3)
            if colors is not None:
                columns.append(colors[used])
            rows_of, back = _distinct(np.concatenate(columns, axis=1, dtype=np.float32))
            table_of = back[indices].reshape(-1, 3).astype(np.uint32)
            filled, _ = filled_normals(rows_of[:, :3], table_of, rows_of[:, 3:6].astype(np.float64))
            uv = None if coordinates is None else np.ascontiguousarray(rows_of[:, 6:8])
            tint = None
            if colors is not None and self.materials.of(material_prim or prim) is None:
                tint = np.concatenate([rows_of[:, -3:], np.ones((len(rows_of), 1), np.float32)], axis=1)
            positions = np.ascontiguousarray(rows_of[:, :3])
            made = Mesh(prim.GetName(), positions, table_of, filled, None, uv, None, tint)
            yield self._add(made, material_prim or prim, is_tinted=tint is not None)

    def _normals(self, found: Any, table: _Corners, points: Doubles, triangles: Ints, faces: Ints) -> Doubles:
        """A normal for each corner: the mesh's own, smooth ones of a subdivision surface, or those of its faces."""
        corners = table.points
        own = table.values(found.GetPrim(), "normals", self.time, 3)
        if own is None and (given := found.GetNormalsAttr().Get(self.time)):
            own = table.spread(np.array(given, np.float64), found.GetNormalsInterpolation())
        if own is not None:
            return unit(own)
        a, b, c = np.moveaxis(points[corners[triangles]], 1, 0)
        by_face = np.zeros((int(table.faces.max(initial=-1)) + 1, 3))
        np.add.at(by_face, faces, np.cross(b - a, c - a))
        by_corner = unit(by_face)[table.faces]
        if found.GetSubdivisionSchemeAttr().Get() == UsdGeom.Tokens.none:
            return by_corner
        text = f"'{shown(found.GetPrim().GetName())}' is a subdivision surface; its control mesh is drawn, smooth"
        self.reading.warn("RG333", "subdivision", text)
        total = np.zeros(points.shape)
        np.add.at(total, corners, by_corner)
        return unit(total)[corners]

    def _subsets(self, prim: Any, faces: Ints) -> Iterator[tuple[Any, npt.NDArray[np.bool_]]]:
        """The triangles of each material: the prim that it is bound to, None for the mesh, and which triangles."""
        left = np.ones(len(faces), bool)
        for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
            chosen = np.isin(faces, np.array(subset.GetIndicesAttr().Get(self.time) or (), np.int64)) & left
            left &= ~chosen
            if chosen.any():
                yield subset.GetPrim(), chosen
        if left.any():
            yield None, left

    def _add(self, mesh: Mesh, bound: Any, *, is_tinted: bool = False) -> tuple[int, int]:
        self.vertices += len(mesh.positions)
        if self.vertices > self.reading.limits.vertices:
            raise self.reading.over(f"has {self.vertices:,} vertices", "vertices")
        owner = bound if bound.IsA(UsdGeom.Gprim) else bound.GetParent()  # of a subset
        is_double_sided = bool(UsdGeom.Gprim(owner).GetDoubleSidedAttr().Get())
        material = self.materials.number(bound, is_double_sided=is_double_sided, is_tinted=is_tinted)
        self.reading.warn_unmapped(mesh.name, self.materials.made[material], mesh)
        self.meshes.append(mesh)
        return len(self.meshes) - 1, material


class _Corners:
    """The corners of a mesh's faces: the face and the point of each."""

    def __init__(self, faces: Ints, points: Ints) -> None:
        self.faces, self.points = faces, points

    def spread(self, values: Doubles, interpolation: str) -> Doubles | None:
        """Return a row for each corner; None where there are fewer rows than the mesh needs."""
        places = {"uniform": self.faces, **dict.fromkeys(_POINTS, self.points)}.get(interpolation)
        if interpolation == "constant":
            places = np.zeros(len(self.faces), np.int64)
        if places is None:
            places = np.arange(len(self.faces))
        return values[places] if int(places.max(initial=-1)) < len(values) else None

    def values(self, prim: Any, name: str, time: Any, width: int) -> Doubles | None:
        """Return the values of a primvar at each corner, (n, width); None if it has none."""
        found = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
        given = found.ComputeFlattened(time) if found and found.HasValue() else None
        if given is None or not len(given):
            return None
        values = np.array(given, np.float64)
        return self.spread(values, found.GetInterpolation()) if values.shape[1:] == (width,) else None


def _distinct(rows: npt.NDArray[np.float32]) -> tuple[npt.NDArray[np.float32], Ints]:
    """The distinct rows, and for each row the number of its own."""
    keys = np.ascontiguousarray(rows).view(np.dtype((np.void, rows.dtype.itemsize * rows.shape[1]))).reshape(-1)
    _, first, back = np.unique(keys, return_index=True, return_inverse=True)
    return rows[first], back.reshape(-1)
