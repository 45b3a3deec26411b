"""Properties of schedule and plan on random graphs, judged by a validator of its own.

The validator shares no code with the stages: it runs the frame on paper. Every physical holds, part by part, which
version of which resource was written there last; a step that finds anything else than what it asked for is a mistake.
"""

from __future__ import annotations

import itertools
import os
import random
import subprocess
import sys
from collections.abc import Iterator, Mapping
from typing import Literal

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from rendergraph.allocate import ResourcePlan, allocate
from rendergraph.expand import Expansion
from rendergraph.resources import shipped_pipelines
from rendergraph.schedule import Schedule, schedule
from rendergraph.session.pipeline import load
from rendergraph.steps import FunctionBinding, Read, Resource, Step, Write
from rendergraph.textures import FORMATS, BufferDesc, TextureDesc

DESCS: tuple[TextureDesc | BufferDesc, ...] = (
    TextureDesc("texture2d", "rgba8", 64, 64),
    TextureDesc("texture2d", "r32f", 64, 64),
    TextureDesc("texture2d", "rgba16f", 64, 64),
    TextureDesc("texture2d", "rgba8", 32, 32),
    TextureDesc("texture2d", "depth32f", 64, 64),
    TextureDesc("texture2d", "rgba8", 64, 64, samples=4),
    TextureDesc("texture_cube", "r32f", 32, 32, layers=6),
    TextureDesc("texture2d", "rgba16f", 64, 64, mips=3),
    BufferDesc(4096),
)


# --- random pipelines ------------------------------------------------------------------------------------------------


@st.composite
def expansions(draw: st.DrawFn, most: int = 12) -> Expansion:
    """Steps of one or two a node that read, draw, store, continue, clear and remember, in a legal program order.

    A compute step stores what it writes; what a buffer holds is stored by any step.
    """
    count = draw(st.integers(1, most))
    versions: dict[str, int] = {}
    resources: dict[str, Resource] = {}
    steps: list[Step] = []
    stale: list[str] = []  # history, readable by everybody as last frame's
    node, index = "", 0
    for number in range(count):
        node, index = (node, index + 1) if node and draw(st.integers(0, 4)) == 0 else (f"n{number:02}", 0)
        storing = draw(st.integers(0, 2)) == 0

        def use(id: str, storing: bool = storing) -> Literal["color", "image", "buffer"]:
            return "buffer" if isinstance(resources[id].desc, BufferDesc) else "image" if storing else "color"

        known = sorted(versions)
        taken = draw(st.lists(st.sampled_from(known), max_size=3, unique=True)) if known else []
        reads = [Read(f"input{place}", id, versions[id]) for place, id in enumerate(taken)]
        if len(stale) > 0 and draw(st.booleans()):
            reads.append(Read("old", draw(st.sampled_from(stale)), 1, previous=True))
        functions: tuple[FunctionBinding, ...] = ()
        if reads and draw(st.integers(0, 3)) == 0:
            functions = (FunctionBinding("shadow", "n00", "shadow.glsl", (reads.pop(),)),)
        writes: list[Write] = []
        continued = [id for id in known if draw(st.integers(0, 4)) == 0][:1]
        for id in continued:
            load = draw(st.sampled_from(["load", "load", "clear"]))
            if load == "load":
                reads.append(Read("target", id, versions[id], "attach"))
            versions[id] += 1
            writes.append(Write("target", id, versions[id], use(id), load=load))  # type: ignore[arg-type]
        for port in range(draw(st.integers(0 if continued else 1, 2))):
            id = f"{node}.p{index}{port}"
            history = draw(st.integers(0, 7)) == 0
            resources[id] = Resource(id, draw(st.sampled_from(DESCS)), "history" if history else "transient")
            versions[id] = 1
            stale += [id] if history else []
            writes.append(Write(f"p{index}{port}", id, 1, use(id)))
        kind: Literal["compute", "fullscreen"] = "compute" if storing else "fullscreen"
        steps.append(Step(node, index, kind, reads=tuple(reads), writes=tuple(writes), functions=functions))
    shown = draw(st.lists(st.sampled_from(sorted(versions)), min_size=1, max_size=2, unique=True))
    return Expansion(tuple(steps), resources, {f"output{place}": id for place, id in enumerate(shown)})


# --- the validator ---------------------------------------------------------------------------------------------------


def needed(expansion: Expansion) -> set[tuple[str, int]]:
    """Keys of the steps something wanted depends on, by repeated passes over all of them."""
    last = {
        write.resource: max(w.version for s in expansion.steps for w in s.writes if w.resource == write.resource)
        for step in expansion.steps
        for write in step.writes
    }
    states = {(id, last[id]) for id in expansion.outputs.values()}
    keys: set[tuple[str, int]] = set()
    while True:
        before = len(states), len(keys)
        for step in expansion.steps:
            if step.key in keys or not states & {(write.resource, write.version) for write in step.writes}:
                continue
            keys.add(step.key)
            for read in step.all_reads:
                states.add((read.resource, last[read.resource] if read.previous else read.version))
            for write in step.writes:
                desc = expansion.resources[write.resource].desc
                part = write.mip is not None or write.layer is not None or getattr(desc, "mips", 1) > 1
                if part or write.load == "load" or write.use in ("image", "buffer"):
                    states.add((write.resource, write.version - 1))
        if (len(states), len(keys)) == before:
            return keys


def assert_legal(expansion: Expansion, found: Schedule) -> None:
    """Every kept step runs once and sees the versions it asks for."""
    keys = [step.key for step in found.steps]
    assert len(set(keys)) == len(keys)
    assert set(keys) == needed(expansion)
    kept = set(keys)
    newest: dict[str, int] = {}
    culled = {w.resource: set() for s in expansion.steps for w in s.writes}  # type: ignore[var-annotated]
    for step in expansion.steps:
        if step.key not in kept:
            for write in step.writes:
                culled[write.resource].add(write.version)
    for step in found.steps:
        for read in step.all_reads:
            if not read.previous and not by_itself(step, read):
                assert newest.get(read.resource, 0) == read.version, f"{step.key} reads {read}"
        for write in step.writes:
            skipped = set(range(newest.get(write.resource, 0) + 1, write.version))
            assert skipped <= culled[write.resource], f"{step.key} writes {write} too early"
            assert newest.get(write.resource, 0) < write.version
            newest[write.resource] = write.version
    running = {step.node for step in found.steps} | {f.node for step in found.steps for f in step.functions}
    assert set(found.culled) == ({step.node for step in expansion.steps} | set(expansion.idle)) - running
    assert set(found.resources) == {id for step in found.steps for id in ids_of(step)}


def by_itself(step: Step, read: Read) -> bool:
    """Whether a step that draws into several layers of a texture adds to what it wrote itself."""
    return read.use == "attach" and any(w.resource == read.resource and w.version == read.version for w in step.writes)


def ids_of(step: Step) -> set[str]:
    """What a step reads or writes."""
    return {read.resource for read in step.all_reads} | {write.resource for write in step.writes}


def peak_of(steps: tuple[Step, ...], expansion: Expansion) -> int:
    """The most live bytes, resource by resource and step by step."""
    touches: dict[str, list[int]] = {}
    for position, step in enumerate(steps):
        for id in ids_of(step):
            touches.setdefault(id, []).append(position)
    shown = expansion.outputs.values()
    return max(
        sum(
            expansion.resources[id].desc.bytes * copies_of(steps, id, expansion)
            for id, at in touches.items()
            if expansion.resources[id].role == "history" or at[0] <= position <= (len(steps) if id in shown else at[-1])
        )
        for position in range(len(steps))
    )


def copies_of(steps: tuple[Step, ...], id: str, expansion: Expansion) -> int:
    """Textures of a resource: two where some step reads last frame's value when or after this frame's is written."""
    if expansion.resources[id].role != "history":
        return 1
    written = [number for number, step in enumerate(steps) if any(w.resource == id for w in step.writes)]
    read = [number for number, s in enumerate(steps) if any(r.resource == id and r.previous for r in s.all_reads)]
    return 2 if written and read and max(read) >= min(written) else 1


def assert_valid(plan: ResourcePlan, *, alias: bool = True) -> None:
    """No step finds a foreign value where it reads, and the bytes add up."""
    steps, resources = plan.schedule.steps, plan.resources
    holds: dict[int, tuple[str, int]] = {}
    newest: dict[str, int] = {}
    previous = {id for id, resource in resources.items() if resource.role == "history"}
    shown = set(plan.schedule.outputs.values())
    filled = {r.resource for step in steps for r in step.all_reads if r.version == 0 and not r.previous}
    for frame in range(3):  # history takes turns, so that a second and a third frame are part of it
        for name in filled:  # `update` writes these buffers before the frame, and what is the scene's is there
            assert isinstance(resources[name].desc, BufferDesc) or resources[name].role == "scene"
            holds[plan.placement[name][0]] = (name, 0)
        last = dict(newest)
        for position, step in enumerate(steps):
            for read in step.all_reads:
                physicals = plan.placement[read.resource]
                if read.previous:
                    if frame:
                        found = holds[physicals[(frame - 1) % len(physicals)]]
                        assert found == (read.resource, last.get(read.resource, 0)), "not last frame's value"
                elif not by_itself(step, read):
                    assert holds[physicals[frame % len(physicals)]] == (read.resource, read.version)
            for write in step.writes:
                physicals = plan.placement[write.resource]
                own = {plan.placement[w.resource] for w in step.writes if w.resource != write.resource}
                foreign = {plan.placement[r.resource] for r in step.all_reads if r.resource != write.resource}
                assert physicals not in own | foreign, f"{step.key} writes {write.resource} over what it uses"
                holds[physicals[frame % len(physicals)]] = (write.resource, write.version)
                newest[write.resource] = write.version
            for id in plan.released.get(position, ()):  # poison: nobody may look at it again
                for physical in plan.placement[id]:
                    assert holds[physical][0] == id, "released after somebody else moved in"
                    holds[physical] = ("poison", 0)
        for id in shown:
            assert holds[plan.placement[id][frame % len(plan.placement[id])]][0] == id
    users: dict[int, list[str]] = {}
    for id, physicals in plan.placement.items():
        base = Expansion(steps, resources, plan.schedule.outputs)
        assert len(physicals) == (copies_of(steps, id, base) if alias else 1 + (id in previous))
        for physical in physicals:
            users.setdefault(physical, []).append(id)
    assert sorted(users) == [physical.index for physical in plan.physicals] == list(range(len(plan.physicals)))
    for home in plan.physicals:
        assert sorted(home.members) == sorted(users[home.index])
        for id in home.members:
            if home.block:
                assert isinstance(resources[id].desc, TextureDesc)
                assert resources[id].desc.bytes <= home.desc.bytes
            else:
                assert_can_live_in(resources[id].desc, home.desc)
    memory = plan.memory
    given = {id for id, resource in resources.items() if resource.role == "scene"}  # uploaded beside the plan
    assert not given & {write.resource for step in steps for write in step.writes}
    made = [resource for id, resource in resources.items() if id not in given]
    homes = [home for home in plan.physicals if not given & set(home.members)]
    assert memory.allocated_bytes == sum(home.desc.bytes for home in homes)
    assert memory.no_reuse_bytes == sum(r.desc.bytes * (2 if r.role == "history" else 1) for r in made)
    assert memory.lower_bound_bytes <= memory.least_peak_bytes <= plan.schedule.peak_bytes
    assert plan.schedule.peak_bytes <= memory.allocated_bytes <= memory.no_reuse_bytes
    assert memory.proven == (memory.least_peak_bytes == memory.lower_bound_bytes)
    if memory.next_tier_bytes is not None:
        assert memory.next_tier_bytes < memory.allocated_bytes
        assert memory.next_tier_bytes >= plan.schedule.peak_bytes
    assert set(plan.reasons) == set(resources)


def assert_can_live_in(desc: TextureDesc | BufferDesc, home: TextureDesc | BufferDesc) -> None:
    """What OpenGL demands of a texture view: all but the format equal, formats of one size of texel, depth as it is."""
    if isinstance(desc, BufferDesc) or isinstance(home, BufferDesc):
        assert desc == home
        return
    assert replace(desc, format=home.format) == home
    one, other = FORMATS[desc.format], FORMATS[home.format]
    assert one == other or (one.bytes == other.bytes and not one.is_depth and not other.is_depth)


def topological_orders(steps: tuple[Step, ...], expansion: Expansion) -> Iterator[tuple[Step, ...]]:
    """All legal orders, by the definition: backtracking over what a reader may see."""
    writers = {(w.resource, w.version): s.key for s in steps for w in s.writes}

    def must_wait(step: Step, left: list[Step], newest: Mapping[str, int]) -> bool:
        for read in step.all_reads:
            if not read.previous and newest.get(read.resource, 0) < read.version:
                return True
        for write in step.writes:
            for other in left:
                if other is step:
                    continue
                if any(w.resource == write.resource and w.version < write.version for w in other.writes):
                    return True
                if any(
                    r.resource == write.resource and r.version < write.version and not r.previous
                    for r in other.all_reads
                ):
                    return True
        return False

    def extend(done: tuple[Step, ...], left: list[Step], newest: dict[str, int]) -> Iterator[tuple[Step, ...]]:
        if not left:
            yield done
        for step in left:
            if not must_wait(step, left, newest):
                after = newest | {write.resource: write.version for write in step.writes}
                yield from extend((*done, step), [s for s in left if s is not step], after)

    assert len(writers) == sum(len(step.writes) for step in steps)
    return extend((), list(steps), {})


# --- properties ------------------------------------------------------------------------------------------------------


in_shares = pytest.mark.parametrize("share", [0, *(pytest.param(n, marks=pytest.mark.nightly) for n in range(1, 12))])
"""A twelfth of the random examples runs in `make check`, the rest in `make nightly`."""


@pytest.mark.slow
@in_shares
@given(
    expansions(),
    st.none() | st.integers(0, 9),
    st.booleans(),
    st.booleans(),
)
@settings(max_examples=25, deadline=None)
def test_orders_are_legal_and_plans_valid(
    share: int, base: Expansion, shuffle: int | None, alias: bool, heap: bool
) -> None:
    found = schedule(base, shuffle=shuffle)
    assert_legal(base, found)
    assert found.peak_bytes == peak_of(found.steps, base)
    assert_valid(allocate(found, alias=alias, heap=heap), alias=alias)


@pytest.mark.slow
@in_shares
@given(expansions(most=8))
@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_the_least_peak_is_that_of_all_orders(share: int, base: Expansion) -> None:
    found = schedule(base)
    peaks = [peak_of(order, base) for order in itertools.islice(topological_orders(found.steps, base), 50_000)]
    assert found.proven
    assert found.lower_bound_bytes == min(peaks)


@pytest.mark.slow
@in_shares
@given(expansions(most=8), st.sampled_from([0.0, 1e-5, 1e-4]))
@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_no_order_is_below_the_bound_whatever_the_budget(share: int, base: Expansion, budget_s: float) -> None:
    found = schedule(base, budget_s=budget_s)
    peaks = [peak_of(order, base) for order in itertools.islice(topological_orders(found.steps, base), 50_000)]
    assert found.lower_bound_bytes <= min(peaks) <= found.least_peak_bytes
    assert found.proven == (found.lower_bound_bytes == found.least_peak_bytes)


@pytest.mark.slow
@in_shares
@given(expansions(most=7))
@settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_what_is_allocated_is_near_the_least_of_all_orders(share: int, base: Expansion) -> None:
    found = schedule(base)
    allocated = allocate(found).memory.allocated_bytes
    orders = itertools.islice(topological_orders(found.steps, base), 300)
    least = min(allocate(replace(found, steps=order)).memory.allocated_bytes for order in orders)
    assert allocated <= 1.5 * least  # a local search: not always the least, never far


@pytest.mark.slow
@in_shares
@given(expansions(), st.randoms(use_true_random=False))
@settings(max_examples=8, deadline=None)
def test_results_do_not_depend_on_the_order_of_nodes_and_keys(
    share: int, base: Expansion, chooser: random.Random
) -> None:
    nodes = list(dict.fromkeys(step.node for step in base.steps))
    chooser.shuffle(nodes)
    steps = tuple(step for node in nodes for step in base.steps if step.node == node)
    resources = list(base.resources.items())
    chooser.shuffle(resources)
    wanted = list(base.outputs.items())
    chooser.shuffle(wanted)
    other = Expansion(steps, dict(resources), dict(wanted))
    assert schedule(other) == schedule(base)
    assert allocate(schedule(other)) == allocate(schedule(base))


@pytest.mark.slow
@in_shares
@given(expansions(), st.integers(0, 1000))
@settings(max_examples=8, deadline=None)
def test_a_forgotten_reader_is_caught(share: int, base: Expansion, seed: int) -> None:
    """The validator itself: cut a lifetime short, and it says so wherever that can be seen."""
    plan = allocate(schedule(base))
    chooser = random.Random(seed)
    candidates = [
        id for id, life in plan.lifetimes.items() if life.first < life.last and id not in plan.schedule.whole_frame
    ]
    if not candidates:
        return
    id = chooser.choice(sorted(candidates))
    released = {position: tuple(one for one in ids if one != id) for position, ids in plan.released.items()}
    first = plan.lifetimes[id].first
    released[first] = (*released.get(first, ()), id)
    first_versions = {w.version for w in plan.schedule.steps[first].writes if w.resource == id}
    last_reads = plan.schedule.steps[plan.lifetimes[id].last].all_reads
    if any(read.resource == id and read.version in first_versions and not read.previous for read in last_reads):
        with pytest.raises(AssertionError):
            assert_valid(replace(plan, released=released))


@pytest.mark.nightly(keep=24)
@pytest.mark.parametrize("name", sorted(shipped_pipelines()))
def test_shipped_pipelines_are_proven_and_valid(name: str) -> None:
    base = load(name).expand().expansion
    found = schedule(base)
    assert found.proven
    assert_legal(base, found)
    for alias in (True, False):
        assert_valid(allocate(found, alias=alias), alias=alias)


@pytest.mark.slow
def test_results_do_not_depend_on_the_hash_seed() -> None:
    program = """
import random, sys
from rendergraph.allocate import allocate
from rendergraph.expand import Expansion
from rendergraph.schedule import schedule
from rendergraph.steps import Read, Resource, Step, Write
from rendergraph.textures import TextureDesc
chooser = random.Random(7)
steps, resources = [], {}
for n in range(30):
    reads = {f"n{chooser.randrange(max(0, n - 6), n)}.x" for _ in range(2)} if n else set()
    steps.append(Step(f"n{n}", 0, "fullscreen", reads=tuple(Read(f"i{k}", id, 1) for k, id in enumerate(sorted(reads))),
                      writes=(Write("x", f"n{n}.x", 1),)))
    format = chooser.choice(["rgba8", "r32f", "rgba16f"])
    resources[f"n{n}.x"] = Resource(f"n{n}.x", TextureDesc("texture2d", format, 64, 64))
plan = allocate(schedule(Expansion(tuple(steps), resources, {"image": "n29.x", "other": "n27.x"})))
print([step.key for step in plan.schedule.steps], plan.physicals, plan.memory, plan.reasons, plan.schedule.reasons)
"""
    texts = {
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "PYTHONHASHSEED": str(seed)},
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        for seed in range(3)
    }
    assert len(texts) == 1
