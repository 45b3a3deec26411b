"""What the nodes share that choose the lights that cast."""

from __future__ import annotations

from rendergraph.api import Facts, Node, Output, Visibility, structural


class Casting(Node):
    """Base of the nodes that make shadows of lights, by maps or without."""

    light: str | tuple[str, ...] = structural(
        default="auto",
        doc="Lights that cast: names, or of those whose `casts_shadow` is left on `all`, or `auto`: the first "
        "directional, else spot, else point light.",
    )

    def lights(self, facts: Facts) -> tuple[int, ...]:
        """The lights that cast, as the scene's indices."""
        return facts.casting(self.light)


def visibility_of_lights() -> Output:
    """What those make that have no map: one layer for each of the node's `lights`, all lit at first."""
    return Output(
        Visibility,
        kind="texture2d_array",
        format="r16",
        clear=1.0,
        layers=lambda node, facts: len(node.lights(facts)),
        lights=lambda node, facts: node.lights(facts),
        doc="1 lit, 0 shadowed, one layer a light.",
    )
