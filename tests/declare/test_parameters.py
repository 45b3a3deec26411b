"""A parameter as a value: what a node says of it, once."""

from __future__ import annotations

from typing import Literal

import pytest
from pydantic import ValidationError

from rendergraph.annotations import Range
from rendergraph.api import Node, define, param, structural
from rendergraph.declare import declaration_mistakes


class Curved(Node):
    """A node."""

    gain: float = param(default=1.0, unit="EV", min=0, max=4, doc="Gain.")
    tint: float | tuple[float, float, float] = param(default=0.5, max=1, glsl="vec3", doc="Tint.")
    curve: Literal["soft", "hard"] | str = define(default="soft", choices="curve", needs=("luma",), doc="Curve.")
    taps: Literal[1, 2, 4] = define(default=2, doc="Taps.")
    light: str | list[str] = structural(default="auto", doc="A light.")


class Hard(Curved):
    """The same with another default."""

    gain: float = param(default=2.0, min=1, doc="Gain.")


def test_a_parameter_is_what_its_node_says() -> None:
    found = Curved.parameters()
    assert list(found) == ["gain", "tint", "curve", "taps", "light"]
    gain, curve = found["gain"], found["curve"]
    assert (gain.name, gain.role, gain.type, gain.default, gain.doc) == ("gain", "param", float, 1.0, "Gain.")
    assert (gain.unit, gain.limits, found["tint"].glsl) == ("EV", Range(0, 4), "vec3")
    assert (curve.open_name, curve.needs, curve.words) == ("curve", ("luma",), ("soft", "hard"))
    assert (found["taps"].choices, found["taps"].words) == ((1, 2, 4), ())


def test_a_subclass_says_a_parameter_anew() -> None:
    gain, before = Hard.parameters()["gain"], Curved.parameters()["gain"]
    assert (gain.default, gain.limits, gain.unit) == (2.0, Range(1), "")
    assert before.default == 1.0
    assert Hard.parameters()["taps"] == Curved.parameters()["taps"]


def test_what_a_file_may_give_is_said_in_words() -> None:
    words = {name: parameter.takes() for name, parameter in Curved.parameters().items()}
    assert words == {
        "gain": "a number from 0 to 4",
        "tint": "a number up to 1 or a list of 3 numbers",
        "curve": "one of soft, hard",
        "taps": "one of 1, 2, 4",
        "light": "text or a list of words",
    }
    assert Curved.parameters()["curve"].takes(("cubic",)) == "one of soft, hard, cubic"
    assert Hard.parameters()["gain"].takes() == "a number from 1 up"


def test_limits_hold_for_each_component() -> None:
    tint = Curved.parameters()["tint"]
    assert tint.beyond((0.0, 0.5, 1.0)) is None
    assert tint.beyond((0.0, 1.5, 1.0)) == "must be at most 1"
    assert tint.beyond(float("nan")) == "must be finite"
    assert Hard.parameters()["gain"].beyond(0.5) == "must be at least 1"
    assert Curved.parameters()["light"].beyond("auto") is None
    with pytest.raises(ValidationError, match="must be at most 1"):
        Curved(tint=(0.0, 1.5, 1.0))


def test_a_bare_value_is_plain() -> None:
    class Bare(Node):
        """A node."""

        gain: float = 1.0

    assert Bare.parameters()["gain"].role == "plain"
    assert "parameter 'gain' is a plain value" in declaration_mistakes(Bare)[0].text


def test_a_type_may_be_named_before_it_is_made() -> None:
    assert Early.parameters()["mode"].words == ("near", "far")
    assert declaration_mistakes(Early) == []


class Early(Node):
    """A node."""

    mode: Mode = define(default="near", doc="Mode.")


Mode = Literal["near", "far"]
