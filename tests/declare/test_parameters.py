"""A parameter as a value: what a node says of it, once."""

from __future__ import annotations

import pickle
import re
from typing import Any, Literal

import pytest

from rendergraph.api import Node, define, param, structural
from rendergraph.declare import declaration_mistakes
from rendergraph.errors import Misuse
from rendergraph.typecheck import Range


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
    assert tint.violation((0.0, 0.5, 1.0)) is None
    assert tint.violation((0.0, 1.5, 1.0)) == "must be at most 1"
    assert tint.violation(float("nan")) == "must be finite"
    assert Hard.parameters()["gain"].violation(0.5) == "must be at least 1"
    assert Curved.parameters()["light"].violation("auto") is None


def test_a_node_takes_values_as_a_file_has_them() -> None:
    given: dict[str, Any] = {"gain": 2, "tint": [0, 1, 0.5], "light": ["sun"]}
    node: Any = Curved(**given)
    assert dict(node) == {"gain": 2.0, "tint": (0.0, 1.0, 0.5), "curve": "soft", "taps": 2, "light": ["sun"]}
    assert [type(number) for number in (node.gain, *node.tint)] == [float] * 4
    assert Curved(tint=1).tint == 1.0
    assert (Curved(gain=2) == Curved(gain=2.0), Curved() == Hard(), Curved(gain=2) == Curved()) == (True, False, False)
    assert len({Curved(gain=2), Curved(gain=2.0), Curved(), Hard()}) == 3
    assert repr(Hard(taps=4)) == "Hard(gain=2.0, tint=0.5, curve='soft', taps=4, light='auto')"
    assert pickle.loads(pickle.dumps(node)) == node


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "beyond": ({"tint": (0.0, 1.5, 1.0)}, "'tint': must be at most 1, got (0.0, 1.5, 1.0)"),
    "text": ({"gain": "1.5"}, "'gain': expected a number from 0 to 4, got '1.5'"),
    "a switch": ({"gain": True}, "'gain': expected a number from 0 to 4, got True"),
    "too few": ({"tint": [0.5, 0.5]}, "'tint': expected a number up to 1 or a list of 3 numbers, got [0.5, 0.5]"),
    "no choice": ({"taps": 3}, "'taps': expected one of 1, 2, 4, got 3"),
    "a fraction": ({"taps": 2.0}, "'taps': expected one of 1, 2, 4, got 2.0"),
    "a mixed list": ({"light": ["sun", 1]}, "'light': expected text or a list of words, got ['sun', 1]"),
    "endless": ({"gain": 10**400}, "'gain': must be from -3.4028235e+38 to 3.4028235e+38, got 100"),
    "unknown": ({"gian": 1.0}, "it has no parameter 'gian'; did you mean 'gain'?"),
    "all at once": (
        {"gain": 5, "taps": 3},
        "'gain': must be at most 4, got 5; 'taps': expected one of 1, 2, 4, got 3",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_node_refuses_a_value(name: str) -> None:
    values, said = WRONG[name]
    with pytest.raises(Misuse, match=re.escape(f"Curved: {said}")):
        Curved(**values)


def test_a_node_never_changes() -> None:
    node: Any = Curved()
    with pytest.raises(Misuse, match="'gain' cannot be set"):
        node.gain = 2.0
    with pytest.raises(Misuse, match="'scratch' cannot be set"):
        node.scratch = []


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
