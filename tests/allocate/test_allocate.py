"""Who shares memory with whom, and what is said of it."""

from __future__ import annotations

from itertools import pairwise

import pytest
from msgspec.structs import replace

from rendergraph.allocate import Physical, ResourcePlan, allocate
from rendergraph.schedule import Schedule
from rendergraph.steps import Read, Resource, Step, Write
from rendergraph.textures import BufferDesc, TextureDesc

RGBA8 = TextureDesc("texture2d", "rgba8", 256, 256)
R32F = TextureDesc("texture2d", "r32f", 256, 256)
DEPTH = TextureDesc("texture2d", "depth32f", 256, 256)
HALF = TextureDesc("texture2d", "rgba16f", 256, 256)
UNIT = RGBA8.bytes


def chain(*descs: TextureDesc | BufferDesc, roles: dict[int, str] | None = None) -> Schedule:
    """Step n reads what step n-1 wrote; the last resource is the picture."""
    resources = {
        f"n{n}.x": Resource(f"n{n}.x", desc, (roles or {}).get(n, "transient"))  # type: ignore[arg-type]
        for n, desc in enumerate(descs)
    }
    steps = tuple(
        Step(
            f"n{n}",
            0,
            "fullscreen",
            reads=(Read("source", f"n{n - 1}.x", 1),) if n else (),
            writes=(Write("x", f"n{n}.x", 1),),
        )
        for n in range(len(descs))
    )
    last = f"n{len(descs) - 1}.x"
    whole = {id for id, resource in resources.items() if resource.role == "history"}
    return Schedule(steps, resources, {"image": last}, {}, 0, "n1", 0, 0, whole_frame=frozenset(whole))


def members(plan: ResourcePlan) -> list[tuple[str, ...]]:
    return [physical.members for physical in plan.physicals]


def test_equal_descriptions_take_turns() -> None:
    plan = allocate(chain(RGBA8, RGBA8, RGBA8, RGBA8, RGBA8))
    assert members(plan) == [("n0.x", "n2.x", "n4.x"), ("n1.x", "n3.x")]
    assert plan.memory.no_reuse_bytes == 5 * UNIT
    assert plan.memory.allocated_bytes == 2 * UNIT
    assert plan.memory.tier == "descriptor"
    assert plan.released == {1: ("n0.x",), 2: ("n1.x",), 3: ("n2.x",), 4: ("n3.x",)}


def test_a_reader_s_own_target_is_never_what_it_reads() -> None:
    plan = allocate(chain(RGBA8, RGBA8, RGBA8, RGBA8))
    for one, next in pairwise(["n0.x", "n1.x", "n2.x", "n3.x"]):
        assert plan.placement[one] != plan.placement[next]


def test_equal_texel_classes_share_through_a_view() -> None:
    plan = allocate(chain(RGBA8, HALF, R32F, HALF))
    assert members(plan) == [("n0.x", "n2.x"), ("n1.x", "n3.x")]
    assert plan.physicals[0].desc == RGBA8
    assert plan.memory.tier == "view"
    assert plan.reasons["n2.x"] == "shares texture 0 with n0.x through a r32f view, dead after n1"


def test_views_are_not_used_where_they_save_nothing() -> None:
    # Both formats need a texture of their own at n1, so the later ones take one of their own format.
    plan = allocate(chain(RGBA8, R32F, RGBA8, R32F, HALF))
    assert members(plan)[:2] == [("n0.x", "n2.x"), ("n1.x", "n3.x")]
    assert plan.memory.tier == "descriptor"


@pytest.mark.parametrize(
    "other",
    [
        DEPTH,
        replace(RGBA8, samples=4),
        replace(RGBA8, mips=2),
        replace(RGBA8, width=128),
        replace(RGBA8, kind="texture2d_array"),
        replace(RGBA8, kind="texture_cube", layers=6),
        BufferDesc(UNIT),
    ],
)
def test_what_cannot_share(other: TextureDesc | BufferDesc) -> None:
    plan = allocate(chain(RGBA8, HALF, other, replace(HALF, height=64)))
    assert len(plan.physicals) == 4


def test_depth_shares_with_its_own_format_only() -> None:
    plan = allocate(chain(DEPTH, HALF, DEPTH, replace(DEPTH, format="depth24_stencil8"), replace(HALF, height=64)))
    assert members(plan)[0] == ("n0.x", "n2.x")
    assert len(plan.physicals) == 4


def test_buffers_share_where_they_are_of_one_size() -> None:
    plan = allocate(chain(BufferDesc(64), HALF, BufferDesc(64), BufferDesc(128), HALF))
    assert members(plan)[0] == ("n0.x", "n2.x")
    assert plan.reasons["n0.x"] == "shares buffer 0 with n2.x, which takes it over at n2"


def test_an_output_takes_what_is_free_and_keeps_it() -> None:
    plan = allocate(replace(chain(RGBA8, RGBA8, RGBA8, RGBA8), outputs={"image": "n3.x", "first": "n1.x"}))
    assert members(plan) == [("n0.x", "n2.x"), ("n1.x",), ("n3.x",)]
    assert (plan.lifetimes["n1.x"].first, plan.lifetimes["n1.x"].last) == (1, 3)
    assert plan.released == {1: ("n0.x",), 3: ("n2.x",)}
    taken = allocate(chain(RGBA8, RGBA8, RGBA8))
    assert members(taken) == [("n0.x", "n2.x"), ("n1.x",)]
    assert taken.reasons["n2.x"] == "output 'image', kept to the frame's end: shares texture 0 with n0.x, dead after n1"


def with_history(reader: int, written: int) -> ResourcePlan:
    """Of a chain of four, one step reads what another wrote in the last frame."""
    found = chain(RGBA8, RGBA8, RGBA8, RGBA8, roles={written: "history"})
    steps = list(found.steps)
    old = Read("old", f"n{written}.x", 1, previous=True)
    steps[reader] = replace(steps[reader], reads=(*steps[reader].reads, old))
    return allocate(replace(found, steps=tuple(steps)))


@pytest.mark.parametrize(("reader", "written"), [(2, 1), (1, 1)])
def test_history_takes_turns_where_it_is_read_after_or_while_it_is_written(reader: int, written: int) -> None:
    plan = with_history(reader, written)
    assert len(plan.placement["n1.x"]) == 2
    assert [physical.members for physical in plan.physicals].count(("n1.x",)) == 2
    assert plan.reasons["n1.x"] == "the next frame reads it: two textures take turns and nothing shares them"
    assert plan.memory.no_reuse_bytes == 5 * UNIT
    assert plan.bytes("n1.x") == 2 * UNIT


def test_history_that_is_read_before_it_is_written_has_one_texture() -> None:
    plan = with_history(0, 2)
    assert len(plan.placement["n2.x"]) == 1
    assert plan.lifetimes["n2.x"].first == 0
    assert plan.physicals[plan.placement["n2.x"][0]].members == ("n2.x",)
    assert "before it is written again: one texture" in plan.reasons["n2.x"]
    assert all("n2.x" not in ids for ids in plan.released.values())
    assert plan.memory.allocated_bytes == 3 * UNIT
    assert len(allocate(plan.schedule, alias=False).placement["n2.x"]) == 2


def test_no_aliasing_gives_each_its_own() -> None:
    plan = allocate(chain(RGBA8, RGBA8, RGBA8, RGBA8), alias=False)
    assert plan.memory.allocated_bytes == plan.memory.no_reuse_bytes == 4 * UNIT
    assert (plan.memory.next_tier, plan.memory.next_tier_bytes) == ("descriptor", 2 * UNIT)
    assert plan.reasons["n0.x"] == "aliasing is off"


WIDE = replace(HALF, width=512)


def test_a_heap_is_the_tier_after_views() -> None:
    plan = allocate(chain(HALF, RGBA8, RGBA8, WIDE, RGBA8))
    assert plan.memory.allocated_bytes == 8 * UNIT
    assert (plan.memory.next_tier, plan.memory.next_tier_bytes) == ("heap", 6 * UNIT)


def test_in_a_heap_textures_of_any_description_take_turns() -> None:
    plan = allocate(chain(HALF, RGBA8, DEPTH, WIDE, RGBA8), heap=True)
    assert members(plan) == [("n0.x", "n3.x"), ("n1.x", "n4.x"), ("n2.x",)]
    assert plan.memory.allocated_bytes == 6 * UNIT == sum(physical.bytes for physical in plan.physicals)
    assert plan.memory.tier == "heap"
    assert plan.memory.next_tier is None
    assert [physical.block for physical in plan.physicals] == [True, False, False]
    assert [plan.bytes(f"n{number}.x") for number in range(5)] == [2 * UNIT, UNIT, UNIT, 4 * UNIT, UNIT]
    assert plan.reasons["n3.x"].startswith("shares block 0 with n0.x, dead after")


def test_where_a_heap_saves_nothing_textures_share_as_without() -> None:
    plan = allocate(chain(RGBA8, R32F, RGBA8, R32F), heap=True)
    assert members(plan) == members(allocate(plan.schedule))
    assert plan.memory.tier == "descriptor"
    assert not any(physical.block for physical in plan.physicals)


def test_reasons_of_the_lonely() -> None:
    plan = allocate(chain(RGBA8, RGBA8, HALF))
    assert plan.reasons["n0.x"] == "whenever it is alive, all textures it could share are in use"
    assert allocate(chain(RGBA8, HALF)).reasons["n0.x"] == "no other texture is of its texel class and size"


def test_figures_are_the_schedule_s() -> None:
    plan = allocate(replace(chain(RGBA8, RGBA8), least_peak_bytes=9, lower_bound_bytes=7))
    assert plan.memory.as_json() == {
        "no_reuse_bytes": 2 * UNIT,
        "allocated_bytes": 2 * UNIT,
        "lower_bound_bytes": 7,
        "least_peak_bytes": 9,
        "peak_node": "n1",
        "proven": False,
        "tier": "descriptor",
        "next_tier": None,
        "next_tier_bytes": None,
    }


def test_an_empty_frame_needs_nothing() -> None:
    plan = allocate(Schedule((), {}, {}, {}, 0, None, 0, 0))
    assert plan.physicals == ()
    assert plan.memory.allocated_bytes == 0


def test_physicals_are_numbered_by_place() -> None:
    plan = allocate(chain(RGBA8, HALF, R32F, DEPTH, RGBA8))
    assert [physical.index for physical in plan.physicals] == list(range(len(plan.physicals)))
    assert all(isinstance(physical, Physical) and physical.bytes == physical.desc.bytes for physical in plan.physicals)
