"""What a declaration may and may not say."""

from __future__ import annotations

from rendergraph.api import Node, Output, Radiance, define, structural
from rendergraph.declare import declaration_mistakes


def test_words_of_glsl_are_refused_where_they_would_reach_a_shader() -> None:
    class Half(Node):
        """A parameter named like a GLSL word."""

        radiance = Output(Radiance, doc="Radiance.")
        precision: int = define(default=1, doc="A macro.")

    assert any("'precision' is reserved" in mistake.text for mistake in declaration_mistakes(Half))


def test_a_structural_parameter_may_be_named_like_one() -> None:
    class Full(Node):
        """The same as part of the plan."""

        radiance = Output(Radiance, doc="Radiance.")
        precision: int = structural(default=1, doc="Part of the plan.")

    assert declaration_mistakes(Full) == []
