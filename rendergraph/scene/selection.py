"""Which of a scene's objects a geometry step draws."""

from __future__ import annotations

from collections.abc import Callable

from rendergraph.scene.model import Material, Object, Scene

SELECTIONS: dict[str, Callable[[Object, Material], bool]] = {
    "all": lambda placed, material: True,
    "opaque": lambda placed, material: material.alpha_mode != "blend",
    "transparent": lambda placed, material: material.alpha_mode == "blend",
    "casters": lambda placed, material: placed.casts_shadow and material.alpha_mode != "blend",
}
"""By the names that steps use. Keyframes change none of this, so that it holds for all frames."""


def selected(scene: Scene, name: str) -> list[int]:
    """Indices of the objects that a selection takes in, in the scene's order."""
    takes = SELECTIONS[name]
    return [
        number
        for number, placed in enumerate(scene.objects)
        if not placed.hidden and takes(placed, scene.materials[placed.material])
    ]


def unfilled_selections(scene: Scene) -> frozenset[str]:
    """The selections that no object of the scene is in."""
    return frozenset(name for name in SELECTIONS if not selected(scene, name))
