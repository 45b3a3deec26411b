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
from rendergraph.pipelines.formats.obj.mtl import read_mtl
from rendergraph.pipelines.formats.obj.parser import ABSENT, Ints, Statements, parse
from rendergraph.pipelines.polygons import MOST_CORNERS, newell, triangulate

from rendergraph.document import shown
from rendergraph.projection import unit
from rendergraph.scene.geometry import Doubles, face_normals, mean_normals
from rendergraph.scene.model import Floats, Material, Mesh, Object, Scene
from rendergraph.scene.reading import Reading, UniqueNames, printable

_DEFAULT = "default"
_MOST_LIBRARIES = 256


def read_obj(path: Path, reading: Reading) -> Scene:
    """Read the scene in an OBJ file with the materials of its MTL files."""
    parsed = parse(reading.read(path, "scene file"), reading)
    _check_indices(parsed, reading)
    library = _libraries(parsed, reading)
    if not len(parsed.sizes):
        reading.warn("RG332", "empty", "contains no face; nothing is drawn")
        return Scene(path.stem, path)
    try:
        corners, faces = triangulate(parsed.positions, parsed.corners[:, 0], parsed.sizes)
    except ValueError as problem:
        line = int(parsed.lines[problem.args[0]])
        text = f"a concave face has more than {MOST_CORNERS} corners; cut it into smaller ones"
        raise reading.error("RG307", text, line=line) from None
    a, b, c = parsed.corners[:, 0][corners].T
    distinct = (a != b) & (b != c) & (c != a)
    if not distinct.all():
        line = int(parsed.lines[faces[np.flatnonzero(~distinct)[0]]])
        number = int((~distinct).sum())
        reading.warn("RG332", "degenerate", f"{number} triangles with a repeated corner are left out", line=line)
        corners, faces = corners[distinct], faces[distinct]
    return _assemble(path, parsed, library, corners, faces, reading)


def _check_indices(parsed: Statements, reading: Reading) -> None:
    tables = (parsed.positions, "vertices"), (parsed.uvs, "texture coordinates"), (parsed.normals, "normals")
    for column, (table, what) in enumerate(tables):
        values, count = parsed.corners[:, column], len(table)
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
    """Unit normals, the file's and then computed ones, and the number of the normal at each corner."""
    normals = unit(parsed.normals)
    corner_face = np.repeat(np.arange(len(parsed.sizes)), parsed.sizes)
    chosen = parsed.corners[:, 2].copy()
    used = chosen[chosen != ABSENT]
    zero = np.asarray(~normals.any(axis=1))
    if used.size and zero[used].any():
        number = int(zero[np.unique(used)].sum())
        reading.warn("RG332", "normals", f"{number} normals of length zero are computed from the faces")
        chosen[(chosen != ABSENT) & zero[np.where(chosen == ABSENT, 0, chosen)]] = ABSENT
    missing = chosen == ABSENT
    if not missing.any():
        return normals, chosen
    faces = _polygon_normals(parsed)
    corners = np.flatnonzero(missing)
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
    path: Path, parsed: Statements, library: dict[str, Material], places: Ints, faces: Ints, reading: Reading
) -> Scene:
    """Objects and meshes: one for each object, group and material, in the order of first use.

    Args:
        places: (m, 3), rows of `parsed.corners` that are the corners of triangles.
        faces: (m,), face of each triangle.
    """
    normals, normal_of = _normals(parsed, reading)
    states = parsed.states[faces][:, [0, 1, 3]]
    part, owners = _in_order(_numbered(states), states)
    if len(owners) > reading.limits.objects:
        raise reading.over(f"has {len(owners):,} objects", "objects")
    corners, corner_part = places.reshape(-1), np.repeat(part, 3)
    uv = parsed.corners[corners, 1]
    position, uv = parsed.corners[corners, 0], np.where(uv == ABSENT, -1, uv)
    key = np.stack([corner_part, position, uv, normal_of[corners]], axis=1)
    vertex = _numbered(key)  # keeps the order of its first column: the vertices of a part are neighbours
    count = int(vertex.max(initial=-1)) + 1
    if count > reading.limits.vertices:
        raise reading.over(f"has {count:,} vertices", "vertices")
    key = key[_firsts(vertex, count)]
    positions = parsed.positions[key[:, 1]].astype(np.float32)
    uvs, colors = _uvs(parsed, key[:, 2]), _colors(parsed, key[:, 1], reading)
    vertex_normals = normals[key[:, 3]].astype(np.float32)
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
        part_uvs, part_colors = _given(uvs, a, b, 0.0), _given(colors, a, b, 1.0)
        mesh = Mesh(name, positions[a:b], indices, vertex_normals[a:b], None, part_uvs, colors=part_colors)
        meshes.append(mesh)
        reading.warn_unmapped(name, materials[word][1], mesh)
        objects.append(Object(name, k, materials[word][0], np.eye(4), casts, hidden, node))
    return Scene(path.stem, path, tuple(objects), tuple(meshes), tuple(m for _, m in materials.values()))


def _firsts(numbers: Ints, count: int) -> Ints:
    """The first position of each number."""
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
    """For each part the name of its node, whether it is hidden, and whether it casts shadows.

    The name is the object's, or the group's if there is no object; an object of several groups gives `object/group`.
    """
    groups: dict[int, set[int]] = {}
    for number, group in {(int(row[0]), int(row[1])) for row in owners}:
        groups.setdefault(number, set()).add(group)
    result = []
    for number, group, _ in owners.tolist():
        words = [printable(parsed.names[0][number]), printable(parsed.names[1][group])]
        present = [word for word in words if word]
        node = words[0] if words[0] and len(groups[number]) == 1 else "/".join(present)
        casts = not any(word.endswith("NS") for word in present)
        result.append((node or "object", "ShadowPlaneNS" in present, casts))
    return result


def _material(word: str, library: dict[str, Material], parsed: Statements, reading: Reading) -> Material:
    if printable(word) in library:
        return library[printable(word)]
    if word:
        kind = f"usemtl {word}" if parsed.libraries else "usemtl"  # once for all if no library is named
        text = f"material '{shown(word)}' is in no material library; it is the default one"
        reading.warn("RG330", kind, text)
    return Material(printable(word) or _DEFAULT, base_color=(0.8, 0.8, 0.8, 1.0))


def _uvs(parsed: Statements, uv: Ints) -> Floats | None:
    """Texture coordinates of all vertices, v downwards; NaN for a vertex without."""
    if not (uv >= 0).any():
        return None
    uvs: Floats = (parsed.uvs[uv] * (1, -1) + (0, 1)).astype(np.float32)
    uvs[uv < 0] = np.nan
    return uvs


def _colors(parsed: Statements, position: Ints, reading: Reading) -> Floats | None:
    if np.isnan(parsed.colors).all():
        return None
    colors = np.ones((len(position), 4), np.float32)
    colors[:, :3] = np.clip(parsed.colors[position], 0, 1)
    if ((parsed.colors[position] < 0) | (parsed.colors[position] > 1)).any():
        reading.warn("RG332", "colors", "vertex colours outside 0 to 1 are clamped")
    return colors


def _given(values: Floats | None, a: int, b: int, fill: float) -> Floats | None:
    """The rows of a part with NaN filled; None if all of it is NaN."""
    if values is None or np.isnan(values[a:b, :2]).all():
        return None
    return np.nan_to_num(values[a:b], nan=fill)
