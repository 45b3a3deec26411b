"""Generated shapes: closed, facing outwards, with unit normals and right-handed tangents."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rendergraph.pipelines.shapes import SHAPES, build, mesh

from rendergraph.projection import unit
from rendergraph.scene.geometry import face_normals
from rendergraph.scene.model import Mesh
from rendergraph.typecheck import conversion_to, fits

SOLIDS = sorted(set(SHAPES) - {"plane", "plant"})
SMALL: dict[str, dict[str, Any]] = {
    "sphere": {"segments": 3, "rings": 2},
    "cylinder": {"segments": 3},
    "cone": {"segments": 3},
    "torus": {"segments": 3, "sides": 3},
    "torus_knot": {"segments": 12, "sides": 3},
    "stairs": {"steps": 1},
    "arch": {"segments": 4, "spring": 0.0},
    "vault": {"segments": 2},
    "column": {"segments": 3},
}


def welded(found: Mesh) -> np.ndarray:
    _, number = np.unique(found.positions.view(np.uint32), axis=0, return_inverse=True)
    return number.reshape(-1)[found.indices]


def volume(found: Mesh) -> float:
    a, b, c = (found.positions[found.indices[:, k]].astype(np.float64) for k in range(3))
    return float(np.einsum("ni,ni->n", a, np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("values", ["default", "small"])
@pytest.mark.parametrize("shape", SOLIDS)
def test_closed_manifold_when_welded_by_position(shape: str, values: str) -> None:
    found = build(shape, **(SMALL.get(shape, {}) if values == "small" else {}))[0].mesh
    triangles = welded(found)
    assert all(len(set(row)) == 3 for row in triangles.tolist())
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    pairs = [tuple(edge) for edge in edges.tolist()]
    assert len(set(pairs)) == len(pairs), "an edge is used twice in one direction"
    assert {(b, a) for a, b in pairs} == set(pairs), "an edge has one side only"
    assert volume(found) > 0, "it faces inwards"


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_normals_and_tangents(shape: str) -> None:
    found = build(shape)[0].mesh
    assert found.tangents is not None
    assert found.uv0 is not None
    assert np.allclose(np.linalg.norm(found.normals, axis=1), 1, atol=1e-6)
    assert np.abs(np.einsum("ni,ni->n", found.normals, found.tangents[:, :3])).max() < 1e-6
    faces = face_normals(found.positions, found.indices)
    assert np.einsum("ni,nki->nk", faces, found.normals[found.indices].astype(np.float64)).min() > 0.9
    # The tangent is the direction of growing u, and the bitangent cross(N, T)·w that of falling v: up in the image.
    p, uv = found.positions.astype(np.float64), found.uv0.astype(np.float64)
    i, j, k = found.indices.T
    d1, d2, e1, e2 = p[j] - p[i], p[k] - p[i], uv[j] - uv[i], uv[k] - uv[i]
    det = e1[:, 0] * e2[:, 1] - e2[:, 0] * e1[:, 1]
    along = unit((d1 * e2[:, 1:] - d2 * e1[:, 1:]) / det[:, None])
    up = unit(-(d2 * e1[:, :1] - d1 * e2[:, :1]) / det[:, None])
    tangent, normal = found.tangents[found.indices].mean(axis=1), found.normals[found.indices].mean(axis=1)
    assert np.einsum("ni,ni->n", along, tangent[:, :3]).min() > 0.9
    assert np.einsum("ni,ni->n", up, np.cross(normal, tangent[:, :3]) * tangent[:, 3:]).min() > 0.9


def test_sphere_is_exact() -> None:
    found = mesh("sphere", radius=2.0, segments=64, rings=32)
    assert np.allclose(np.linalg.norm(found.positions, axis=1), 2, atol=1e-6)
    assert np.allclose(found.positions / 2, found.normals, atol=1e-6)
    assert volume(found) == pytest.approx(4 / 3 * np.pi * 8, rel=5e-3)


@pytest.mark.parametrize(
    ("shape", "values", "expected"),
    [
        ("box", {"size": (1.0, 2.0, 3.0)}, 6.0),
        ("stairs", {"size": (1.0, 1.0, 1.0), "steps": 4}, 0.625),
        ("cylinder", {"radius": 1.0, "height": 2.0, "segments": 256}, 2 * np.pi),
        ("cone", {"radius": 1.0, "height": 3.0, "segments": 256}, np.pi),
        ("torus", {"radius": 2.0, "tube": 0.5, "segments": 128, "sides": 64}, np.pi**2),
        (
            "arch",
            {"size": (4.0, 4.0, 0.5), "span": 2.0, "spring": 1.5, "segments": 128},
            0.5 * (16 - 2 * 1.5 - np.pi / 2),
        ),
        # What is below two barrels is 8 ∫ (1 - z) sqrt(1 - z²) dz over 0 to 1, in quarters of the block's base.
        ("vault", {"size": (2.0, 1.0, 2.0), "segments": 64}, 4 - 0.94 * 8 * (np.pi / 4 - 1 / 3)),
    ],
)
def test_volume(shape: str, values: dict[str, object], expected: float) -> None:
    assert volume(mesh(shape, **values)) == pytest.approx(expected, rel=5e-3)


def test_sphere_grid_spans_roughness_and_metallic() -> None:
    parts = build("sphere_grid", columns=5, rows=3)
    assert len(parts) == 15
    assert len({id(part.mesh) for part in parts}) == 1
    values = [dict(part.changes) for part in parts]
    assert values[0] == {"roughness": pytest.approx(0.1), "metallic": 0}
    assert values[-1] == {"roughness": 1, "metallic": 1}
    assert np.allclose(np.mean([part.local[:3, 3] for part in parts], axis=0), 0)


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_estimate_of_vertices_is_no_less_than_half(shape: str) -> None:
    kind = SHAPES[shape]
    found = build(shape)[0].mesh
    assert kind.vertices({key.name: key.default for key in kind.keys}) * 2 >= len(found.positions)


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_every_key_has_a_doc_and_a_legal_default(shape: str) -> None:
    for key in SHAPES[shape].keys:
        assert key.doc.endswith(".")
        default = list(key.default) if isinstance(key.default, tuple) else key.default
        assert fits(conversion_to(key.type)(default), key.type)
