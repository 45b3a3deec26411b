"""Which of a scene's objects a geometry step draws, and what is known of them before the schedule."""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from rendergraph.facts import SELECTIONS, ObjectFacts
from rendergraph.scene.model import Mesh, Scene


def selected(scene: Scene, name: str) -> list[int]:
    """Indices of the objects that a selection takes in, in the scene's order."""
    takes = SELECTIONS[name]
    return [
        number
        for number, placed in enumerate(scene.objects)
        if not placed.hidden and takes(placed.casts_shadow, scene.materials[placed.material].alpha_mode == "blend")
    ]


def object_facts(scene: Scene) -> tuple[ObjectFacts, ...]:
    """What is known of the objects, in the scene's order."""
    closed = [cache(partial(is_closed, mesh)) for mesh in scene.meshes]
    found = []
    for placed in scene.objects:
        mesh, material = scene.meshes[placed.mesh], scene.materials[placed.material]
        found.append(
            ObjectFacts(
                placed.name,
                len(mesh.indices),
                len(mesh.positions),
                placed.casts_shadow,
                material.alpha_mode == "blend",
                material.double_sided,
                placed.hidden,
                closed[placed.mesh],
            )
        )
    return tuple(found)


def is_closed(mesh: Mesh) -> bool:
    """Whether each edge of a mesh, welded by position, has one triangle that runs it one way, and one the other way.

    Triangles without area count for nothing.
    """
    if not len(mesh.indices):
        return False
    _, welded = np.unique(mesh.positions, axis=0, return_inverse=True)
    corners = welded.reshape(-1)[mesh.indices].astype(np.int64)
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    count = int(corners.max(initial=0)) + 1
    one_way, times = np.unique(edges[:, 0] * count + edges[:, 1], return_counts=True)
    other_way = np.unique(edges[:, 1] * count + edges[:, 0])
    return len(corners) > 0 and bool((times == 1).all()) and np.array_equal(one_way, other_way)
