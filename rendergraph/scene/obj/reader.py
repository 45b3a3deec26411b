"""OBJ files as scenes.

Each `o` or `g` is an object, cut by material; names ending in NS cast no shadow and `ShadowPlaneNS` is not drawn. The v
coordinate is turned over, so that texture coordinates are glTF's. Missing normals are the mean of the adjacent faces'
within a smoothing group; `s off` gives flat faces, a file without any `s` is smooth within each object.
"""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rendergraph.document import shown
from rendergraph.projection import unit
from rendergraph.scene.geometry import MOST_CORNERS, Doubles, face_normals, mean_normals, newell, triangulate
from rendergraph.scene.model import Floats, Material, Mesh, Object, Scene
from rendergraph.scene.obj.mtl import read_mtl
from rendergraph.scene.obj.parser import ABSENT, Ints, Statements, parse
from rendergraph.scene.reading import Reading, UniqueNames, printable

_DEFAULT = "default"
_MOST_LIBRARIES = 256


def read_obj(path: Path, reading: Reading) -> Scene:
    """The scene in an OBJ file with the materials its MTL files give.

    Raises:
        InputError: the file is missing or malformed, an index out of range, a vertex not finite, or a limit passed.
    """
    parsed = parse(reading.read(path, "scene file"), reading)
    _check_indices(parsed, reading)
    library = _libraries(parsed, reading)
    if not len(parsed.sizes):
        reading.warn("RG332", "empty", "contains no face; nothing is drawn")
        return Scene(path.stem, path)
    try:
        places, faces = triangulate(parsed.positions, parsed.corners[:, 0], parsed.sizes)
    except ValueError as problem:
        line = int(parsed.lines[problem.args[0]])
        text = f"a concave face has more than {MOST_CORNERS} corners; cut it into smaller ones"
        raise reading.error("RG307", text, line=line) from None
    distinct = _distinct(parsed.corners[:, 0][places])
    if not distinct.all():
        line = int(parsed.lines[faces[np.flatnonzero(~distinct)[0]]])
        number = int((~distinct).sum())
        reading.warn("RG332", "degenerate", f"{number} triangles with a repeated corner are left out", line=line)
        places, faces = places[distinct], faces[distinct]
    normals, normal_of = _normals(parsed, reading)
    return _assemble(path, parsed, library, places, faces, normals, normal_of, reading)


def _distinct(triangles: Ints) -> npt.NDArray[np.bool_]:
    a, b, c = triangles.T
    result: npt.NDArray[np.bool_] = (a != b) & (b != c) & (c != a)
    return result


def _check_indices(parsed: Statements, reading: Reading) -> None:
    for column, (count, what) in enumerate(
        (
            (len(parsed.positions), "vertices"),
            (len(parsed.uvs), "texture coordinates"),
            (len(parsed.normals), "normals"),
        )
    ):
        values = parsed.corners[:, column]
        wrong = ((values < 0) | (values >= count)) & (values != ABSENT)
        if wrong.any():
            corner = int(np.flatnonzero(wrong)[0])
            face = int(np.searchsorted(np.cumsum(parsed.sizes), corner, side="right"))
            index = int(values[corner])
            text = f"index {index + 1 if index >= 0 else index - count} is out of range; there are {count} {what}"
            raise reading.error("RG305", text, line=int(parsed.lines[face]))


def _libraries(parsed: Statements, reading: Reading) -> dict[str, Material]:
    """Materials of every `mtllib`; a missing library is a warning."""
    library: dict[str, Material] = {}
    if len(parsed.libraries) > _MOST_LIBRARIES:
        raise reading.error("RG307", f"names more than {_MOST_LIBRARIES} material libraries")
    for text, line in parsed.libraries:
        whole = reading.find(text, line=line)
        names = [text] if whole is not None else re.split(r"\s+(?=\S)", text)
        for name in names:
            path = whole or reading.find(name.replace("\\", "/"), line=line)
            if path is not None:
                library |= {key: value for key, value in read_mtl(path, reading).items() if key not in library}
            else:
                text = f"material library '{shown(name)}' cannot be read; materials are the default one"
                reading.warn("RG330", f"mtllib {name}", text, line=line)
    return library


def _normals(parsed: Statements, reading: Reading) -> tuple[Doubles, Ints]:
    """Unit normals, and which one each corner has: the file's, or computed ones behind them."""
    normals = unit(parsed.normals)
    corner_face = np.repeat(np.arange(len(parsed.sizes)), parsed.sizes)
    chosen = parsed.corners[:, 2].copy()
    used = chosen[chosen != ABSENT]
    zero = np.asarray(~normals.any(axis=1))
    if used.size and zero[used].any():
        number = int(zero[np.unique(used)].sum())
        reading.warn("RG332", "normals", f"{number} normals of length zero are computed from the faces")
        chosen[(chosen != ABSENT) & zero[np.where(chosen == ABSENT, 0, chosen)]] = ABSENT
    lacking = chosen == ABSENT
    if not lacking.any():
        return normals, chosen
    faces = _polygon_normals(parsed)
    corners = np.flatnonzero(lacking)
    face, vertex = corner_face[corners], parsed.corners[corners, 0]
    group = parsed.states[face, 2]
    flat = (group == 0) & parsed.has_smoothing
    # Flat corners share one normal for each face; smooth ones one for each vertex, smoothing group and object.
    key = np.stack([np.where(flat, -1 - face, vertex), group, parsed.states[face, 0]], axis=1)
    vertices = _numbered(key)
    mean = mean_normals(faces, vertices, face, int(vertices.max()) + 1)
    mean[~mean.any(axis=1)] = (0.0, 0.0, 1.0)
    chosen[corners] = len(normals) + vertices
    return np.concatenate([normals, mean]), chosen


def _polygon_normals(parsed: Statements) -> Doubles:
    """Unit normals of whole polygons, however they are cut."""
    result = np.zeros((len(parsed.sizes), 3))
    starts = np.cumsum(parsed.sizes) - parsed.sizes
    for size in np.unique(parsed.sizes):
        rows = np.flatnonzero(parsed.sizes == size)
        corners = parsed.corners[:, 0][starts[rows, None] + np.arange(size)]
        if size == 3:
            result[rows] = face_normals(parsed.positions, corners)
        else:
            points = parsed.positions[corners]
            result[rows] = unit(newell(points - points[:, :1]))
    return result


def _numbered(columns: Ints) -> Ints:
    """A number for each distinct row, from 0."""
    key = columns[:, 0] - columns[:, 0].min()
    for column in columns.T[1:]:
        low, span = int(column.min()), int(column.max() - column.min()) + 1
        if int(key.max()) > 2**62 // span:
            key = np.unique(key, return_inverse=True)[1].reshape(-1)
        key = key * span + (column - low)
    return np.unique(key, return_inverse=True)[1].reshape(-1)


def _assemble(
    path: Path,
    parsed: Statements,
    library: dict[str, Material],
    places: Ints,
    faces: Ints,
    normals: Doubles,
    normal_of: Ints,
    reading: Reading,
) -> Scene:
    """Objects and meshes: one for each object, group and material, in the order of first use."""
    states = parsed.states[faces][:, [0, 1, 3]]
    part, owners = _in_order(_numbered(states), states)
    if len(owners) > reading.limits.objects:
        raise reading.over(f"has {len(owners):,} objects", "objects")
    corners, corner_part = places.reshape(-1), np.repeat(part, 3)
    uv = parsed.corners[corners, 1]
    key = np.stack(
        [corner_part, parsed.corners[corners, 0], np.where(uv == ABSENT, -1, uv), normal_of[corners]], axis=1
    )
    vertex = _numbered(key)  # keeps the order of its first column: the vertices of a part lie behind each other
    count = int(vertex.max(initial=-1)) + 1
    if count > reading.limits.vertices:
        raise reading.over(f"has {count:,} vertices", "vertices")
    key = key[_firsts(vertex, count)]
    columns = _Columns(parsed, key, normals, reading)
    vertex_starts = np.searchsorted(key[:, 0], np.arange(len(owners) + 1))
    order = np.argsort(part, kind="stable")
    triangles = vertex.reshape(-1, 3)[order]
    triangle_starts = np.searchsorted(part[order], np.arange(len(owners) + 1))
    names, parts_of = UniqueNames(), Counter[str]()
    materials: dict[str, tuple[int, Material]] = {}
    meshes, objects = [], []
    for k, (node, hidden, casts) in enumerate(_owners(parsed, owners)):
        word = parsed.names[3][owners[k, 2]]
        if word not in materials:
            materials[word] = (len(materials), _material(word, library, parsed, reading))
        a, b = int(vertex_starts[k]), int(vertex_starts[k + 1])
        indices = (triangles[triangle_starts[k] : triangle_starts[k + 1]] - a).astype(np.uint32)
        name = names.unique(f"{node}#{parts_of[node]}" if parts_of[node] else node, "object")
        parts_of[node] += 1
        meshes.append(columns.mesh(name, a, b, indices))
        reading.warn_unmapped(name, materials[word][1], meshes[-1])
        objects.append(Object(name, k, materials[word][0], np.eye(4), casts, hidden, node))
    listed = tuple(material for _, material in materials.values())
    return Scene(path.stem, path, tuple(objects), tuple(meshes), listed, warnings=reading.warnings)


def _firsts(numbers: Ints, count: int) -> Ints:
    """Where each number stands first."""
    first = np.zeros(count, np.int64)
    first[numbers[::-1]] = np.arange(len(numbers) - 1, -1, -1)  # of equal targets the last assignment stays
    return first


def _in_order(part: Ints, states: Ints) -> tuple[Ints, Ints]:
    """Parts renumbered in the order of first use, and the state of each."""
    first = _firsts(part, int(part.max(initial=-1)) + 1)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rank[part], states[first[order]]


def _owners(parsed: Statements, owners: Ints) -> list[tuple[str, bool, bool]]:
    """For each part its node's name, whether it is hidden, and whether it casts shadows.

    The name is the object's, or the group's where there is no object; an object of several groups gives `object/group`.
    """
    groups: dict[int, set[int]] = {}
    for number, group in {(int(row[0]), int(row[1])) for row in owners}:
        groups.setdefault(number, set()).add(group)
    result = []
    for number, group, _ in owners.tolist():
        words = [printable(parsed.names[0][number]), printable(parsed.names[1][group])]
        given = [word for word in words if word]
        node = words[0] if words[0] and len(groups[number]) == 1 else "/".join(given)
        casts = not any(word.endswith("NS") for word in given)
        result.append((node or "object", "ShadowPlaneNS" in given, casts))
    return result


def _material(word: str, library: dict[str, Material], parsed: Statements, reading: Reading) -> Material:
    if printable(word) in library:
        return library[printable(word)]
    if word:
        kind = f"usemtl {word}" if parsed.libraries else "usemtl"  # where none is named, once for all
        text = f"material '{shown(word)}' is in no material library; it is the default one"
        reading.warn("RG330", kind, text)
    return Material(printable(word) or _DEFAULT, base_color=(0.8, 0.8, 0.8, 1.0))


class _Columns:
    """The attributes of all vertices, to be cut into meshes; NaN where a vertex lacks one."""

    def __init__(self, parsed: Statements, key: Ints, normals: Doubles, reading: Reading) -> None:
        place, uv, normal = key[:, 1], key[:, 2], key[:, 3]
        self.positions = parsed.positions[place].astype(np.float32)
        self.normals = normals[normal].astype(np.float32)
        self.uvs: Floats | None = None
        self.colors: Floats | None = None
        if (uv >= 0).any():
            self.uvs = (parsed.uvs[uv] * (1, -1) + (0, 1)).astype(np.float32)
            self.uvs[uv < 0] = np.nan
        if not np.isnan(parsed.colors).all():
            colors = parsed.colors[place]
            if ((colors < 0) | (colors > 1)).any():
                reading.warn("RG332", "colors", "vertex colours outside 0 to 1 are clamped")
            self.colors = np.ones((len(place), 4), np.float32)
            self.colors[:, :3] = np.clip(colors, 0, 1)

    def mesh(self, name: str, a: int, b: int, indices: npt.NDArray[np.uint32]) -> Mesh:
        """The mesh of vertices a to b; corners without texture coordinates have (0, 0), without colour white."""
        uvs = None if self.uvs is None or np.isnan(self.uvs[a:b]).all() else np.nan_to_num(self.uvs[a:b])
        colors = (
            None
            if self.colors is None or np.isnan(self.colors[a:b, :3]).all()
            else np.nan_to_num(self.colors[a:b], nan=1.0)
        )
        return Mesh(name, self.positions[a:b], indices, self.normals[a:b], None, uvs, colors=colors)
