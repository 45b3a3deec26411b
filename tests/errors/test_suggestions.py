"""What a misspelt or half-remembered name is answered with."""

from __future__ import annotations

import pytest

from rendergraph.errors import suggestion

MANY = ["ssao-disc", "ssao-gtao", "ssao_hemisphere", "bloom", "kernel_size", *(f"filler{n}" for n in range(10))]


@pytest.mark.parametrize(
    ("word", "words", "said"),
    [
        ("ssao", MANY, "; did you mean one of ssao-disc, ssao-gtao, ssao_hemisphere?"),
        ("SSAO", MANY, "; did you mean one of ssao-disc, ssao-gtao, ssao_hemisphere?"),
        ("lamp", ["Lamp_left", "lamp-right"], "; did you mean one of Lamp_left, lamp-right?"),
        ("ssao-dics", MANY, "; did you mean 'ssao-disc'?"),
        ("kernal", MANY, "; did you mean 'kernel_size'?"),
        ("kernel", MANY, "; did you mean 'kernel_size'?"),
        ("--env", ["--environment", "--scene", "--size"], "; did you mean '--environment'?"),
        ("xyz", MANY, ""),
        ("xyz", ["b", "a"], "; available: a, b"),
        ("a", [f"a_{n}" for n in range(5)], "; did you mean one of a_0, a_1, a_2, a_3, a_4?"),
        ("a", [f"a_{n}" for n in range(6)], "; did you mean one of a_0, a_1, a_2, a_3 or 2 more?"),
        ("a", [], ""),
    ],
)
def test_suggestions(word: str, words: list[str], said: str) -> None:
    assert suggestion(word, words) == said
