"""Which of a scene's objects a geometry step draws, and what is known of them before the schedule."""

from __future__ import annotations

from functools import partial
from operator import attrgetter

from rendergraph.facts import SELECTIONS, ObjectFacts
from rendergraph.scene.model import Scene


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
                scene.has_grain(material),
                scene.emits(material),
                scene.reflects(material),
                mesh.name,
                partial(attrgetter("edges.gap"), mesh),
                partial(attrgetter("plane"), mesh),
                partial(attrgetter("convex"), mesh),
            )
        )
    return tuple(found)
