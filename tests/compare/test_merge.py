"""Graphs as one: what is the same is drawn once, and every picture is the one it was."""

from __future__ import annotations

import copy
import random
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.compare.batches import batches, merge, render_batch
from rendergraph.compare.results import passes
from rendergraph.link import Graph
from rendergraph.resources import shipped_pipelines


def distinct(graphs: Sequence[Graph]) -> int:
    """Passes that differ in type, parameters or what they read, counted by writing all of it out; no cycles."""

    def key(graph: Graph, name: str) -> tuple[Any, ...]:
        node = graph[name]
        reads = tuple(
            (port, tuple((key(graph, end.node), end.port) for end in ends))
            for port, ends in sorted(node.inputs.items())
        )
        return node.type.name, repr(node.node), reads

    return len({key(graph, name) for graph in graphs for name in needed(graph)})


def needed(graph: Graph) -> set[str]:
    """Nodes that are drawn."""
    from rendergraph.allocate import allocate
    from rendergraph.expand import expand
    from rendergraph.schedule import schedule

    return set(passes(allocate(schedule(expand(graph)))))


def pictures(
    session: rg.Session, variants: Sequence[rg.Pipeline], frame: int = 1, most_bytes: int = 1 << 30
) -> list[Any]:
    """Every variant's picture, drawn together."""
    drawn: dict[int, Any] = {}
    planned = [variant.check() for variant in variants]
    for batch in batches(planned, range(len(variants)), most_bytes):
        for number, arrays in render_batch(session, batch, frame):
            drawn[number] = arrays["radiance"]
    return [drawn[number] for number in range(len(variants))]


def alone(session: rg.Session, variants: Sequence[rg.Pipeline], frame: int = 1) -> list[Any]:
    return [session.render(variant, frames=range(1, frame + 1))["radiance"] for variant in variants]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_random_variants_draw_each_distinct_pass_once_and_the_same_pictures(
    make: Any, gl: rg.Session, seed: int
) -> None:
    chooser = random.Random(seed)
    nodes = make.random_nodes(seed, 7)
    variants = []
    for _ in range(4):
        other = copy.deepcopy(nodes)
        for name in chooser.sample(list(nodes), 2):
            if nodes[name]["type"] == "mix":
                other[name].setdefault("params", {})["gain"] = chooser.choice([0.2, 0.8])
        variants.append(make(other, f"{list(nodes)[-1]}.color"))
    (batch,) = batches([variant.check() for variant in variants], range(4))
    assert batch.pass_count == distinct([variant.link().graph for variant in variants])
    for together, own in zip(pictures(gl, variants, 3), alone(gl, variants, 3), strict=True):
        np.testing.assert_array_equal(together, own)


def test_ids_do_not_matter(make: Any) -> None:
    a = make({"p": {"type": "pattern"}, "q": {"type": "mix", "inputs": {"a": "p.color"}}}, "q.color")
    b = make({"x": {"type": "pattern"}, "y": {"type": "mix", "inputs": {"a": "x.color"}}}, "y.color")
    graph, names = merge([a.link().graph, b.link().graph])
    assert [node.id for node in graph.nodes] == ["p", "q"]
    assert names == ({"p": "p", "q": "q"}, {"x": "p", "y": "q"})
    assert {str(end) for end in graph.outputs.values()} == {"q.color"}


def test_a_texture_that_two_continue_is_made_for_each(make: Any, gl: rg.Session) -> None:
    def nodes(amount: float | None) -> dict[str, Any]:
        found: dict[str, Any] = {
            "p": {"type": "pattern"},
            "early": {"type": "mix", "inputs": {"a": "p.color"}},
            "late": {"type": "mix", "inputs": {"a": "early.color"}},
        }
        if amount is not None:
            found["stamp"] = {"type": "stamp", "inputs": {"color": "p.color"}, "params": {"amount": amount}}
            found["late"] = {"type": "mix", "inputs": {"a": "stamp.color", "b": "early.color"}}
        return found

    variants = [make(nodes(amount), "late.color") for amount in (0.25, 0.5, None, 0.25)]
    graph, _ = merge([variant.link().graph for variant in variants])
    assert sum(node.type.name == "pattern" for node in graph.nodes) == 3
    for together, own in zip(pictures(gl, variants), alone(gl, variants), strict=True):
        np.testing.assert_array_equal(together, own)


def test_last_frame_closes_circles(make: Any, gl: rg.Session) -> None:
    def nodes(gain: float) -> dict[str, Any]:
        return {
            "p": {"type": "pattern"},
            "loop": {"type": "mix", "inputs": {"a": "p.color", "b": "loop.color@previous"}},
            "end": {"type": "mix", "inputs": {"a": "loop.color"}, "params": {"gain": gain}},
        }

    variants = [make(nodes(gain), "end.color") for gain in (0.2, 0.8)]
    (batch,) = batches([variant.check() for variant in variants], range(2))
    assert batch.pass_count == 4
    for together, own in zip(pictures(gl, variants, 4), alone(gl, variants, 4), strict=True):
        np.testing.assert_array_equal(together, own)


def test_batches_share_the_first_passes_whichever_axis_comes_first(make: Any) -> None:
    """Eight patterns, each mixed in eight ways: 16 runs a batch, so two patterns a batch are drawn once each."""
    nodes = {"p": {"type": "pattern"}, "q": {"type": "mix", "inputs": {"a": "p.color"}}}
    base = make(nodes, "q.color")
    values = [number / 10 for number in range(8)]
    first = [base.set("p.seed", seed).set("q.gain", gain).check() for seed in values for gain in values]
    swapped = [base.set("p.seed", seed).set("q.gain", gain).check() for gain in values for seed in values]
    for planned in (first, swapped):
        found = batches(planned, range(64))
        assert sorted(number for batch in found for number in batch.numbers) == list(range(64))
        assert sum(batch.pass_count for batch in found) == 8 + 64


def test_a_batch_ends_where_what_follows_shares_less(make: Any) -> None:
    nodes = {"p": {"type": "pattern"}, "q": {"type": "mix", "inputs": {"a": "p.color"}}}
    base = make(nodes, "q.color")
    planned = [
        base.set("p.seed", seed / 10).set("q.gain", gain / 10).check() for seed in range(3) for gain in range(10)
    ]
    found = batches(planned, range(30))
    assert [len(batch.numbers) for batch in found] == [10, 10, 10]
    assert sum(batch.pass_count for batch in found) == 3 + 30


def test_little_memory_means_several_batches(make: Any, gl: rg.Session) -> None:
    nodes = {"p": {"type": "pattern"}, "q": {"type": "mix", "inputs": {"a": "p.color"}}}
    base = make(nodes, "q.color")
    variants = [base.set("q.gain", gain / 10) for gain in range(6)]
    few = batches([variant.check() for variant in variants], range(6), most_bytes=4 * 8 * 8 * 16)
    assert len(few) > 1
    assert sorted(number for batch in few for number in batch.numbers) == list(range(6))
    for together, own in zip(pictures(gl, variants, most_bytes=1), alone(gl, variants), strict=True):
        np.testing.assert_array_equal(together, own)


@pytest.mark.slow
def test_the_shutter_of_the_camera_is_open_together_as_alone(gl: rg.Session) -> None:
    base = rg.load("motion-blur", size=(48, 27)).select(shutter=1.0).set("light.shading", "unlit")
    variants = [base.set("blur.radius", radius) for radius in (0.005, 0.1)]
    together, own = pictures(gl, variants, 6), alone(gl, variants, 6)
    np.testing.assert_array_equal(together, own)
    assert not np.array_equal(*own)


@pytest.mark.slow
def test_functions_and_views_are_renamed_with_their_nodes(gl: rg.Session) -> None:
    base = rg.load("forward-prepass", scene="cornell_box", size=(48, 27))
    variants = [base.set("sun.resolution", size).set("shadows.taps", taps) for size in (64, 256) for taps in (1, 3)]
    forms = [rg.load("forward", scene="cornell_box", size=(48, 27)).set("sun.resolution", size) for size in (64, 256)]
    variants += [form.set("shadows.taps", 1) for form in forms]
    (batch,) = batches([variant.check() for variant in variants], range(6))
    assert batch.pass_count == 1 + 2 + 4 + 4 + 4 + 2 + 2  # prepass, sun, shadows, light and display twice
    for together, own in zip(pictures(gl, variants), alone(gl, variants), strict=True):
        np.testing.assert_array_equal(together, own)


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_pipelines())
def test_every_shipped_pipeline_is_drawn_as_alone(gl: rg.Session, name: str) -> None:
    base = rg.load(name, size=(48, 27))
    base = base.set("sun.resolution", 64) if "sun" in base.link().graph.dag else base
    ends = {end.node for end in base.link().graph.outputs.values()}
    variants = [base, *(base.set("display.exposure", 0.5) for _ in range("display" in ends))]
    planned = [variant.check() for variant in variants]
    (batch,) = batches(planned, range(len(variants)))
    drawn = [arrays for _, arrays in render_batch(gl, batch, 2)]
    assert batch.pass_count <= len(passes(base.plan())) + 1
    for arrays, variant in zip(drawn, variants, strict=True):
        for output, pixels in gl.render(variant, frames=range(1, 3)).arrays.items():
            np.testing.assert_array_equal(arrays[output], pixels)
