"""What runs and in which order: culling, versions, messages, the least peak, reasons."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from msgspec.structs import replace

from rendergraph.errors import InputError
from rendergraph.expand import Expansion
from rendergraph.resources import folder
from rendergraph.schedule import Schedule, schedule
from rendergraph.schedule.dependencies import touched_ids
from rendergraph.steps import FunctionBinding, Read, Resource, Step, Write
from rendergraph.textures import BufferDesc, TextureDesc

MIB = 1 << 20


def reads(*ids: str) -> tuple[Read, ...]:
    """`a.x` reads version 1, `a.x:2` version 2, `a.x@` last frame's."""
    found = []
    for number, text in enumerate(ids):
        id, _, version = text.rstrip("@").partition(":")
        found.append(Read(f"input{number}", id, int(version or 1), previous=text.endswith("@")))
    return tuple(found)


def writes(*ids: str, **extra: Any) -> tuple[Write, ...]:
    """`a.x` makes version 1, `a.x:2` continues version 1."""
    found = []
    for text in ids:
        id, _, version = text.partition(":")
        write = Write(id.split(".")[1], id, int(version or 1), load="load" if int(version or 1) > 1 else "discard")
        found.append(replace(write, **extra))
    return tuple(found)


def step(name: str, takes: tuple[str, ...] = (), makes: tuple[str, ...] = ()) -> Step:
    """`node` or `node[2]`."""
    node, _, index = name.rstrip("]").partition("[")
    return Step(node, int(index or 0), "fullscreen", reads=reads(*takes), writes=writes(*makes))


def expansion(*steps: Step, image: str | None = None, sizes: dict[str, int] | None = None, **roles: str) -> Expansion:
    """Every resource is 1 MiB unless `sizes` says otherwise; what the last step writes is the picture."""
    ids = {id: None for one in steps for id in touched_ids(one)}
    shown = image or steps[-1].writes[-1].resource
    resources = {
        id: Resource(id, format_bytes((sizes or {}).get(id, 1)), roles.get(id.replace(".", "_"), "transient"))  # type: ignore[arg-type]
        for id in ids
    }
    return Expansion(steps, resources, {"image": shown})


def format_bytes(count: int) -> TextureDesc:
    return TextureDesc("texture2d", "rgba8", 512, 512 * count)


def order(found: Schedule) -> list[str]:
    return [f"{one.node}[{one.index}]" if one.index else one.node for one in found.steps]


def test_a_chain_keeps_its_order() -> None:
    found = schedule(
        expansion(step("c", ("b.x",), ("c.x",)), step("b", ("a.x",), ("b.x",)), step("a", (), ("a.x",)), image="c.x")
    )
    assert order(found) == ["a", "b", "c"]
    assert found.proven
    assert found.peak_bytes == found.lower_bound_bytes == 2 * MIB  # a and b while b runs, b and the picture
    assert found.peak_node == "b"


def test_readers_of_a_version_run_before_it_is_continued() -> None:
    steps = (
        step("light", (), ("light.x",)),
        step("glass", (), ("light.x:2",)),
        step("meter", ("light.x",), ("meter.x",)),
        step("show", ("light.x:2", "meter.x"), ("show.x",)),
    )
    assert order(schedule(expansion(*steps))) == ["light", "meter", "glass", "show"]


def test_a_function_s_reads_order_its_caller() -> None:
    binding = FunctionBinding("shadow", "shadows", "shadow.glsl", reads("sun.map"))
    light = replace(step("light", (), ("light.x",)), functions=(binding,))
    found = schedule(expansion(light, step("sun", (), ("sun.map",)), image="light.x"))
    assert order(found) == ["sun", "light"]


def test_last_frame_s_value_orders_nothing_and_keeps_its_writer() -> None:
    steps = (
        step("blend", ("draw.x", "blend.old@"), ("blend.x",)),
        step("draw", (), ("draw.x",)),
        step("keep", ("draw.x",), ("blend.old",)),
    )
    found = schedule(expansion(*steps, image="blend.x", blend_old="history"))
    assert sorted(order(found)) == ["blend", "draw", "keep"]
    assert found.whole_frame == {"blend.old"}
    assert found.shown == {"blend.x"}
    assert order(found) == ["draw", "blend", "keep"]  # last frame's value is read before this frame's is written
    assert found.history_copies == {"blend.old": 1}
    assert found.peak_bytes == (1 + 1 + 1) * MIB  # picture, history, draw.x


def test_a_second_texture_of_a_history_is_taken_where_reading_first_costs_more() -> None:
    """`wide` has to run before `keep` if the history is read first, and is then alive beside what `keep` needs."""
    steps = (
        step("large", (), ("large.x",)),
        step("keep", ("large.x",), ("keep.old",)),
        step("wide", ("keep.old@",), ("wide.x",)),
        step("show", ("keep.old", "wide.x"), ("show.x",)),
    )
    sizes = {"large.x": 8, "wide.x": 8, "keep.old": 1, "show.x": 1}
    found = schedule(expansion(*steps, sizes=sizes, keep_old="history"))
    assert order(found) == ["large", "keep", "wide", "show"]
    assert found.history_copies == {"keep.old": 2}
    assert found.peak_bytes == found.lower_bound_bytes == (2 + 8 + 1) * MIB
    small = schedule(expansion(*steps, sizes=sizes | {"wide.x": 1, "keep.old": 2}, keep_old="history"))
    assert small.history_copies == {"keep.old": 1}
    assert small.peak_bytes == small.lower_bound_bytes == (2 + 1 + 8) * MIB


def test_one_history_takes_a_second_texture_and_another_none() -> None:
    """`keep` as above; that `far` reads first costs nothing, and a second texture of `other.old` would cost 8 MiB."""
    steps = (
        step("large", (), ("large.x",)),
        step("keep", ("large.x",), ("keep.old",)),
        step("wide", ("keep.old@",), ("wide.x",)),
        step("far", ("other.old@",), ("far.x",)),
        step("other", (), ("other.old",)),
        step("show", ("keep.old", "wide.x", "far.x", "other.old"), ("show.x",)),
    )
    sizes = {"large.x": 8, "wide.x": 8, "keep.old": 1, "other.old": 8, "far.x": 1, "show.x": 1}
    found = schedule(expansion(*steps, sizes=sizes, keep_old="history", other_old="history"))
    assert found.history_copies == {"keep.old": 2, "other.old": 1}
    assert found.peak_bytes == found.lower_bound_bytes == (2 + 8 + 8 + 1 + 1) * MIB


@pytest.mark.parametrize("large", ["a.old", "b.old"])
def test_of_two_histories_that_cannot_both_be_read_first_the_larger_is(large: str) -> None:
    steps = (
        step("a", ("b.old@",), ("a.old",)),
        step("b", ("a.old@",), ("b.old",)),
        step("show", ("a.old", "b.old"), ("show.x",)),
    )
    found = schedule(expansion(*steps, sizes={large: 8}, a_old="history", b_old="history"))
    assert found.history_copies == {"a.old": 2, "b.old": 2} | {large: 1}
    assert found.peak_bytes == found.lower_bound_bytes == (2 + 8 + 1) * MIB


def test_a_history_that_its_writer_reads_takes_two_textures_in_any_order() -> None:
    """So nobody need wait for those who read it, and `more` is gone before `look.x` is there."""
    steps = (step("look", ("keep.old@",), ("look.x",)), step("keep", ("keep.old@",), ("keep.old", "keep.more")))
    found = schedule(expansion(*steps, image="look.x", keep_old="history"))
    assert order(found) == ["keep", "look"]
    assert found.peak_bytes == found.lower_bound_bytes == (2 + 1) * MIB


def test_nothing_unwanted_runs() -> None:
    steps = (
        step("a", (), ("a.x",)),
        step("lost", ("a.x",), ("lost.x", "lost.y")),
        step("after", ("lost.x",), ("after.x",)),
        step("show", ("a.x",), ("show.x",)),
    )
    found = schedule(replace(expansion(*steps), idle={"empty": "it recorded no step"}))
    assert order(found) == ["a", "show"]
    assert set(found.resources) == {"a.x", "show.x"}
    assert found.culled == {
        "lost": "lost.x and lost.y are read only by after, which does not run",
        "after": "nothing reads after.x",
        "empty": "it recorded no step",
    }


def test_a_node_loses_only_the_steps_nobody_needs() -> None:
    steps = (step("a", (), ("a.x",)), step("a[1]", (), ("a.y",)), step("show", ("a.x",), ("show.x",)))
    found = schedule(expansion(*steps))
    assert order(found) == ["a", "show"]
    assert found.culled == {}


def test_a_node_whose_function_is_called_is_not_said_to_do_nothing() -> None:
    calls = replace(step("show", (), ("show.x",)), functions=(FunctionBinding("air_at", "fog", "fog.glsl", ()),))
    assert schedule(expansion(step("fog"), step("idle"), calls)).culled == {"idle": "it writes nothing"}


def test_a_whole_clear_needs_nothing_of_before_but_a_part_does() -> None:
    first, second = step("first", (), ("t.x",)), step("second")
    show = step("show", ("t.x:2",), ("show.x",))
    cleared = replace(second, writes=writes("t.x:2", load="clear"))
    part = replace(second, writes=writes("t.x:2", load="clear", layer=1))
    assert order(schedule(expansion(first, cleared, show))) == ["second", "show"]
    assert order(schedule(expansion(first, part, show))) == ["first", "second", "show"]


def test_order_holds_across_a_culled_version() -> None:
    steps = (
        step("one", (), ("t.x",)),
        step("meter", ("t.x",), ("meter.x",)),
        step("two", (), ("t.x:2",)),
        replace(step("three"), writes=writes("t.x:3", load="clear")),
        step("show", ("t.x:3", "meter.x"), ("show.x",)),
    )
    assert order(schedule(expansion(*steps))) == ["one", "meter", "three", "show"]


def test_mips_follow_the_writer_of_the_base_level() -> None:
    base = replace(step("down"), writes=writes("down.x", mip=0))
    chain = replace(step("down[1]", ("down.x",)), kind="mipmaps", writes=writes("down.x:2"))
    assert order(schedule(expansion(base, chain, step("show", ("down.x:2",), ("show.x",))))) == [
        "down",
        "down[1]",
        "show",
    ]


def test_a_buffer_filled_by_the_cpu_lives_the_whole_frame() -> None:
    silhouette = Step(
        "volume", 0, "draw", reads=(Read("edges", "volume.edges", 0, "buffer"),), writes=writes("volume.x")
    )
    base = expansion(step("a", (), ("a.x",)), silhouette, step("show", ("a.x", "volume.x"), ("show.x",)))
    found = schedule(
        replace(base, resources={**base.resources, "volume.edges": Resource("volume.edges", BufferDesc(64))})
    )
    assert found.whole_frame == {"volume.edges"}


def test_results_do_not_depend_on_the_order_of_nodes_or_keys() -> None:
    base = fan_out(4)
    first = schedule(base)
    for seed in range(5):
        chooser = random.Random(seed)
        steps, resources = list(base.steps), list(base.resources.items())
        chooser.shuffle(steps)
        chooser.shuffle(resources)
        assert schedule(replace(base, steps=tuple(steps), resources=dict(resources))) == first


def test_shuffle_draws_by_seed() -> None:
    orders = {tuple(order(schedule(fan_out(3), shuffle=seed))) for seed in range(20)}
    assert len(orders) > 5
    assert schedule(fan_out(3), shuffle=3) == schedule(fan_out(3), shuffle=3)


def fan_out(branches: int) -> Expansion:
    """Independent branches of three passes, listed breadth first, merged by one."""
    numbers = range(branches)
    steps = [step(f"draw{n}", (), (f"draw{n}.x",)) for n in numbers]
    steps += [step(f"light{n}", (f"draw{n}.x",), (f"light{n}.x",)) for n in numbers]
    steps += [step(f"show{n}", (f"light{n}.x",), (f"show{n}.x",)) for n in numbers]
    steps.append(step("merge", tuple(f"show{n}.x" for n in numbers), ("merge.x",)))
    sizes = (
        {f"draw{n}.x": 12 for n in numbers} | {f"light{n}.x": 8 for n in numbers} | {f"show{n}.x": 2 for n in numbers}
    )
    return expansion(*steps, sizes=sizes | {"merge.x": 4})


@pytest.mark.parametrize("branches", [1, 2, 6, 12])
def test_a_fan_out_runs_branch_by_branch_and_is_proven(branches: int) -> None:
    found = schedule(fan_out(branches))
    assert found.proven
    assert found.peak_bytes == (20 + 2 * (branches - 1)) * MIB  # the last branch beside what the others left
    assert [one.node.rstrip("0123456789") for one in found.steps] == ["draw", "light", "show"] * branches + ["merge"]


def test_a_budget_of_nothing_still_gives_a_good_order_and_claims_no_proof() -> None:
    found = schedule(fan_out(12), budget_s=0)
    assert not found.proven
    assert found.peak_bytes == schedule(fan_out(12)).peak_bytes


def wide(count: int, seed: int) -> Expansion:
    """Passes that each read one to three of the 24 before; what nobody reads is merged by the last."""
    chooser = random.Random(seed)
    unread: dict[str, None] = {}
    steps, sizes = [], {"end.x": 8}
    for number in range(count - 1):
        recent = [f"n{other}.x" for other in range(max(0, number - 24), number)]
        taken = sorted(chooser.sample(recent, min(number, chooser.choice((1, 1, 2, 2, 3)))))
        steps.append(step(f"n{number}", tuple(taken), (f"n{number}.x",)))
        sizes[f"n{number}.x"] = chooser.choice((1, 2, 4, 8, 16, 32))
        unread = {id: None for id in unread if id not in taken} | {f"n{number}.x": None}
    return expansion(*steps, step("end", tuple(unread), ("end.x",)), sizes=sizes)


@pytest.mark.slow
def test_random_graphs_of_64_passes_are_proven_or_have_a_bound_below() -> None:
    found = [schedule(wide(64, seed)) for seed in range(8)]
    assert sum(one.proven for one in found) >= 3
    for one in found:
        assert one.lower_bound_bytes <= one.least_peak_bytes <= one.peak_bytes


def test_a_beam_finds_what_seeds_do_not() -> None:
    """And completes what the search has begun when the budget ends."""
    base = wide(40, 1)
    without, beam, best = (schedule(base, budget_s=budget) for budget in (0, 0.02, 1))
    assert best.proven
    assert without.lower_bound_bytes <= beam.lower_bound_bytes <= best.lower_bound_bytes == best.least_peak_bytes
    assert best.least_peak_bytes <= beam.least_peak_bytes < without.least_peak_bytes


def test_reasons_say_why() -> None:
    found = schedule(fan_out(2))
    assert found.reasons == {
        ("draw0", 0): "first of 2 that could run, reading from the outputs",
        ("light0", 0): "first of 2 that could run, reading from the outputs; releases draw0.x (12.0 MiB)",
        ("show0", 0): "first of 2 that could run, reading from the outputs; releases light0.x (8.0 MiB)",
        ("draw1", 0): "nothing else can run yet",
        ("light1", 0): "nothing else can run yet; releases draw1.x (12.0 MiB)",
        ("show1", 0): "nothing else can run yet; releases light1.x (8.0 MiB)",
        ("merge", 0): "everything else has run; releases show0.x and 1 more (4.0 MiB)",
    }


def chain(count: int) -> list[Step]:
    return [step(f"n{n}", (f"n{n - 1}.x",) if n else (), (f"n{n}.x",)) for n in range(count)]


def ladder(count: int) -> list[Step]:
    return [step(f"n{n}", tuple(f"n{m}.x" for m in (n - 1, n - 2) if m >= 0), (f"n{n}.x",)) for n in range(count)]


def star(count: int) -> list[Step]:
    """One texture read by all but the last step, which reads what they write."""
    arms = range(count - 2)
    steps = [step("hub", (), ("hub.x",)), *(step(f"n{n}", ("hub.x",), (f"n{n}.x",)) for n in arms)]
    return [*steps, step("end", tuple(f"n{n}.x" for n in arms), ("end.x",))]


def butterfly(count: int) -> list[Step]:
    """Layers of 64 steps as in a fast Fourier transform: each step reads two of the layer before."""
    steps = []
    for layer in range(count // 64):
        for n in range(64):
            taken = tuple(f"l{layer - 1}_{m}.x" for m in (n, n ^ 1 << layer % 6)) if layer else ()
            steps.append(step(f"l{layer}_{n}", taken, (f"l{layer}_{n}.x",)))
    return [*steps, step("end", tuple(f"l{count // 64 - 1}_{n}.x" for n in range(64)), ("end.x",))]


def dense(count: int) -> list[Step]:
    """Each step reads thirty of those before."""
    chooser = random.Random(3)
    taken = [chooser.sample(range(n), min(n, 30)) for n in range(count)]
    steps = [step(f"n{n}", tuple(f"n{m}.x" for m in taken[n]), (f"n{n}.x",)) for n in range(count)]
    return [*steps, step("end", tuple(f"n{n}.x" for n in range(count)), ("end.x",))]


def tree(count: int) -> list[Step]:
    """A binary tree, leaves first: many equal branches of which no order is best at a glance."""
    reads = {n: tuple(f"n{m}.x" for m in (2 * n + 1, 2 * n + 2) if m < count) for n in range(count)}
    return [step(f"n{n}", reads[n], (f"n{n}.x",)) for n in reversed(range(count))]


def histories(count: int) -> list[Step]:
    """Each step writes a history, and reads last frame's value of two others."""
    taken = [(f"n{(n + 1) % count}.old@", f"n{(7 * n + 3) % count}.old@") for n in range(count)]
    steps = [step(f"n{n}", taken[n], (f"n{n}.old",)) for n in range(count)]
    return [*steps, step("end", tuple(f"n{n}.old" for n in range(count)), ("end.x",))]


@pytest.mark.parametrize("count", [990, pytest.param(150, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("shape", [chain, ladder, star, butterfly, dense, tree, histories])
def test_any_shape_is_planned_in_two_seconds(shape: Callable[[int], list[Step]], count: int) -> None:
    """Textures of random sizes, as equal ones hide what is hard."""
    steps = shape(count)
    chooser = random.Random(count)
    sizes = {write.resource: chooser.choice((1, 2, 4, 8, 16)) for one in steps for write in one.writes}
    roles = {one.node + "_old": "history" for one in steps if shape is histories}
    base = expansion(*steps, sizes=sizes, **roles)
    start = time.process_time()
    found = schedule(base)
    assert time.process_time() - start < 2
    assert len(found.steps) == len(steps)
    assert found.lower_bound_bytes <= found.least_peak_bytes <= found.peak_bytes


def test_four_hundred_outputs_are_planned_in_two_seconds() -> None:
    """Of which each needs a large texture of its own, dead by the end."""
    numbers = range(400)
    steps = [step(f"a{n}", (), (f"a{n}.x",)) for n in numbers] + [
        step(f"b{n}", (f"a{n}.x",), (f"b{n}.x",)) for n in numbers
    ]
    base = expansion(*steps, sizes={f"a{n}.x": n % 50 + 1 for n in numbers})
    start = time.process_time()
    found = schedule(replace(base, outputs={f"output{n}": f"b{n}.x" for n in numbers}))
    assert time.process_time() - start < 2
    assert found.proven


@pytest.mark.slow
def test_ten_thousand_steps_take_seconds() -> None:
    chooser = random.Random(1)
    steps = [step("n0", (), ("n0.x",))]
    for n in range(1, 10_000):
        steps.append(step(f"n{n}", tuple({f"n{n - 1}.x", f"n{max(0, n - chooser.randrange(1, 9))}.x"}), (f"n{n}.x",)))
    start = time.process_time()
    found = schedule(expansion(*steps))
    assert len(found.steps) == 10_000
    assert time.process_time() - start < 30  # quadratic would be hours; the bound is loose for slow machines


# --- messages --------------------------------------------------------------------------------------------------------

WRONG = {
    "RG602": expansion(
        step("light", (), ("light.radiance",)),
        step("glow", (), ("light.radiance:2", "glow.mask")),
        step("compose", ("light.radiance", "glow.mask"), ("compose.color",)),
    ),
    "RG604": Expansion((), {"show.color": Resource("show.color", format_bytes(1))}, {"image": "show.color"}),
    "RG605": expansion(
        step("light", (), ("light.radiance",)),
        step("sky", (), ("light.radiance:2",)),
        step("fog", (), ("light.radiance:2",)),
    ),
    "RG606": Expansion((step("peel"),) * 20_000, {}, {}),
}


@pytest.mark.parametrize("code", sorted(WRONG))
def test_the_page_of_a_code_has_its_message(code: str) -> None:
    (page,) = Path(folder("rendergraph.errors")).glob(f"{code}-*.yaml")
    expected = yaml.safe_load(page.read_text(encoding="utf-8"))["message"]
    with pytest.raises(InputError, match=code) as caught:
        schedule(WRONG[code])
    assert str(caught.value) == expected


def test_a_first_write_that_loads_is_refused() -> None:
    one = replace(step("a"), writes=writes("a.x", load="load"))
    with pytest.raises(InputError, match=r"RG603 node 'a': the first step that writes 'a\.x' loads"):
        schedule(expansion(one))


def test_all_problems_come_at_once() -> None:
    steps = (step("a", ("a.raw:0",), ("a.x",)), step("b", ("b.raw:0", "a.x"), ("b.x",)))
    with pytest.raises(InputError, match="RG601") as caught:
        schedule(expansion(*steps))
    assert len(caught.value.problems) == 2
