"""Selection of the lights that cast shadows."""

from __future__ import annotations

from rendergraph.api import Facts, Node, Output, Visibility, structural


class Casting(Node):
    """Base of the nodes that compute shadows of selected lights, with maps or without."""

    light: str | tuple[str, ...] = structural(
        default="auto",
        doc="Lights that cast shadows: names, or `all` or `auto` (the first directional, else spot, else point light) "
        "of those without `casts_shadow: false`.",
    )

    def lights(self, facts: Facts) -> tuple[int, ...]:
        """Return the lights that cast shadows, as the scene's indices."""
        return facts.casting(self.light)


def visibility_of_lights() -> Output:
    """Return the output of techniques without a map: one layer for each of the node's `lights`, cleared to lit."""
    return Output(
        Visibility,
        kind="texture2d_array",
        format="r16",
        clear=1.0,
        layers=lambda node, facts: len(node.lights(facts)),
        lights=lambda node, facts: node.lights(facts),
        doc="1 is lit, 0 in shadow; one layer per light.",
    )
