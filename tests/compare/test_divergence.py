"""The first pass that differs, against changes that were made on purpose."""

from __future__ import annotations

import copy
import random
from typing import Any

import pytest

import rendergraph as rg
from rendergraph.compare import compare
from rendergraph.compare.results import Difference, passes
from rendergraph.compare.tasks import every_output, first_difference, taps
from rendergraph.diff import diff


def found(session: rg.Session, a: rg.Pipeline, b: rg.Pipeline, frame: int = 1) -> Difference | None:
    seen = [every_output(session, pipeline.check(), frame) for pipeline in (a, b)]
    return first_difference(seen[0], seen[1], b.plan(), b.link().graph, diff(a.link().graph, b.link().graph))


@pytest.mark.slow
def test_a_mutated_node_is_the_first_that_differs(make: Any, gl: rg.Session) -> None:
    """Fifty mutations of one parameter of one node; a change that changes no texel cannot be found."""
    hits = 0
    for seed in range(10):
        nodes = make.random_nodes(seed)
        last = f"{list(nodes)[-1]}.color"
        base = make(nodes, last)
        tapped = every_output(gl, base.check(), 2)
        chooser = random.Random(seed)
        for _ in range(5):
            name = chooser.choice(passes(base.plan()))
            mutated = copy.deepcopy(nodes)
            key = {"pattern": "seed", "mix": "gain", "trail": "weight"}[nodes[name]["type"]]
            mutated[name].setdefault("params", {})[key] = round(chooser.uniform(0.1, 0.9), 4)
            other = make(mutated, last)
            seen = every_output(gl, other.check(), 2)
            first = first_difference(
                tapped, seen, other.plan(), other.link().graph, diff(base.link().graph, other.link().graph)
            )
            hits += first is not None and (first.node, first.causes) == (name, (name,))
    assert hits >= 48


def test_equal_pipelines_part_nowhere(make: Any, gl: rg.Session) -> None:
    nodes = make.random_nodes(3)
    assert (
        found(gl, make(nodes, "j0.color" if "j0" in nodes else "m8.color"), make(nodes, f"{list(nodes)[-1]}.color"))
        is None
    )


def test_renamed_nodes_are_compared_with_what_they_were_called(make: Any, gl: rg.Session) -> None:
    nodes = {
        "p": {"type": "pattern"},
        "q": {"type": "mix", "inputs": {"a": "p.color"}},
        "r": {"type": "mix", "inputs": {"a": "q.color"}, "params": {"gain": 0.3}},
    }
    renamed = {
        "p": {"type": "pattern"},
        "first": {"type": "mix", "inputs": {"a": "p.color"}},
        "r": {"type": "mix", "inputs": {"a": "first.color"}, "params": {"gain": 0.7}},
    }
    first = found(gl, make(nodes, "r.color"), make(renamed, "r.color"))
    assert first is not None
    assert (first.node, first.base_node, first.port, first.causes) == ("r", "r", "color", ("r",))
    assert first.share > 0.9
    assert first.most is not None
    assert first.most > 0
    assert first.pixels[0].shape == (8, 8, 4)


def test_an_added_pass_is_told_as_the_cause(make: Any, gl: rg.Session) -> None:
    short = {"p": {"type": "pattern"}, "r": {"type": "mix", "inputs": {"a": "p.color"}}}
    longer = short | {
        "q": {"type": "mix", "inputs": {"a": "p.color"}, "params": {"twist": 3}},
        "r": {"type": "mix", "inputs": {"a": "q.color"}},
    }
    first = found(gl, make(short, "r.color"), make(longer, "r.color"))
    assert first is not None
    assert first.node == "r"
    assert set(first.causes) == {"q", "r"}
    assert (first.added, first.after) == (("q",), ", after added node q")


def test_a_function_that_changed_shows_in_the_pass_that_calls_it(gl: rg.Session) -> None:
    base = rg.load("forward", size=(64, 36))
    first = found(gl, base, base.set("shadows.taps", 1))
    assert first is not None
    assert (first.node, first.port, first.causes) == ("light", "radiance", ("shadows",))


def test_every_version_of_a_continued_texture_is_seen(make: Any, gl: rg.Session) -> None:
    nodes = {
        "p": {"type": "pattern"},
        "one": {"type": "stamp", "inputs": {"color": "p.color"}},
        "two": {"type": "stamp", "inputs": {"color": "one.color"}},
    }
    base = make(nodes, "two.color")
    assert taps(base.link().graph, base.plan()) == ["p.color", "one.color", "two.color"]
    first = found(gl, base, base.set("two.amount", 0.5))
    assert first is not None
    assert first.node == "two"


def test_a_step_for_a_table_does_not_make_a_node_the_first(gl: rg.Session) -> None:
    """`light` fills a table before `ao` runs, and lights after it."""
    base = rg.load("ssao-gtao", size=(48, 27))
    result = compare([base, base.set("ao.radius", 1)], frames=1, session=gl).results[1]
    assert result.first is not None
    assert (result.first.node, result.first.port) == ("ao", "occlusion")
