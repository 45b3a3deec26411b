"""Edges of meshes: which triangles meet there, and where a mesh is open."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest
from rendergraph.pipelines import shapes

from rendergraph.scene import pack
from rendergraph.scene.model import Material, Mesh, Object, Scene
from rendergraph.scene.triangles import Edges, find_edges, is_solid

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.uint32)
CLOSED = ("box", "sphere", "cylinder", "cone", "torus", "torus_knot")


def found(faces: Any, corners: Any = CORNERS) -> Edges:
    return find_edges(corners, faces)


@pytest.mark.parametrize(
    ("faces", "gap"),
    [
        (FACES, ""),
        (np.concatenate([FACES, [[0, 1, 1]]]), ""),  # without area
        (FACES[:3], "only one triangle has the edge from (0, 1, 0) to (1, 0, 0)"),
        (np.concatenate([FACES[:3], FACES[3:, ::-1]]), "two triangles turn the same way round at the edge from "),
        (np.concatenate([FACES, FACES]), "4 triangles share the edge from (0, 0, 0) to (0, 1, 0)"),
        (np.zeros((0, 3), np.uint32), "no triangle has an area"),
    ],
)
def test_a_mesh_is_closed_where_every_edge_has_two_sides(faces: Any, gap: str) -> None:
    edges = found(faces)
    assert edges.gap.startswith(gap)
    assert bool(edges.gap) == bool(gap)
    assert len(edges.triangles) == (0 if gap else 4)


def test_vertices_at_one_place_are_one() -> None:
    apart = CORNERS[FACES.reshape(-1)]
    apart[apart == 0] *= np.float32(-1)  # minus zero
    apart[:3] += 0.0
    edges = found(np.arange(12).reshape(4, 3), apart)
    assert not edges.gap
    assert len(edges.ends) == 6


@pytest.mark.parametrize("shape", CLOSED)
def test_neighbours_are_those_that_share_two_places(shape: str) -> None:
    """Each edge and each neighbour against a search by brute force, in the mesh and as it is packed."""
    mesh = shapes.mesh(shape)
    scene = Scene("s", objects=(Object("o", 0, 0, np.eye(4)),), meshes=(mesh,), materials=(Material("m"),))
    packed = pack.pack(scene)
    indices, records = pack.with_adjacency(packed)
    assert records["count"].tolist() == [indices.size]
    six = indices.reshape(-1, 6).astype(np.int64)
    for positions, triangles, beyond in (
        (mesh.positions, mesh.edges.triangles, mesh.edges.beyond),
        (packed.positions, six[:, ::2], six[:, 1::2]),
    ):
        places = [tuple(float(value) + 0.0 for value in point) for point in positions]
        corners = [[places[vertex] for vertex in triangle] for triangle in triangles]
        third = {(c[k], c[(k + 1) % 3]): c[(k + 2) % 3] for c in corners for k in range(3)}
        assert len(third) == 3 * len(corners)
        for c, across in zip(corners, beyond, strict=True):
            for k in range(3):
                assert third[c[(k + 1) % 3], c[k]] == places[across[k]]
    edges = mesh.edges
    assert 2 * len(edges.ends) == 3 * len(edges.triangles)
    runs = [{(t[k], t[(k + 1) % 3]) for k in range(3)} for t in edges.triangles.tolist()]
    assert all(
        tuple(ends) in runs[sides[0]] for ends, sides in zip(edges.ends.tolist(), edges.sides.tolist(), strict=True)
    )
    assert set(Counter(edges.sides.reshape(-1).tolist()).values()) == {3}


def test_open_meshes_have_no_triangles_with_adjacency() -> None:
    meshes = (shapes.mesh("plane"), shapes.mesh("box"), Mesh("none", CORNERS, FACES[:0], CORNERS))
    objects = tuple(Object(mesh.name, number, 0, np.eye(4)) for number, mesh in enumerate(meshes))
    packed = pack.pack(Scene("s", objects=objects, meshes=meshes, materials=(Material("m"),)))
    indices, records = pack.with_adjacency(packed)
    assert records["count"].tolist() == [0, 72, 0]
    assert records["first_index"].tolist() == [0, 0, 72]
    assert indices.max() < 24


@pytest.mark.parametrize(
    ("faces", "solid"),
    [
        (FACES, True),
        (np.concatenate([FACES, [[0, 1, 1]]]), True),  # without area
        (np.concatenate([FACES, FACES]), True),  # front faces hide back faces still
        (FACES[:, ::-1], False),  # inside out
        (FACES[:3], False),
        (np.concatenate([FACES[:3], FACES[3:, ::-1]]), False),
        (np.zeros((0, 3), np.uint32), False),
    ],
)
def test_a_mesh_is_solid_where_its_front_faces_hide_its_back_faces(faces: Any, solid: bool) -> None:
    assert is_solid(CORNERS, faces) is solid
    apart = CORNERS[faces].reshape(-1, 3)  # no vertex is shared, and zeros have signs
    apart[apart == 0] *= np.float32(-1)
    assert is_solid(apart, np.arange(len(apart)).reshape(-1, 3)) is solid


@pytest.mark.parametrize("shape", CLOSED)
def test_solid_is_what_is_closed(shape: str) -> None:
    made = shapes.mesh(shape)
    assert made.solid
    torn = Mesh("torn", made.positions, made.indices[1:], made.normals)
    assert not torn.solid
