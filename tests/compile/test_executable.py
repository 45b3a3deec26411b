"""The flat list of calls of a frame: what is written once, what by each draw, and what is left out."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

from rendergraph.compile.executable import CompiledStep, Draw, Executable, SortedDraws
from rendergraph.gl.state import Pieces
from rendergraph.steps import Step

LOG: list[str] = []
say = LOG.append  # one object: states are compared by what they call


class Program:
    """Writes its uniforms into a log."""

    def __init__(self, glo: int, *looks_at: str) -> None:
        self.glo = glo
        self.looks_at = looks_at
        self.blocks: dict[str, int] = {}
        self.uniforms = looks_at

    def writer(self, name: str, value: Any) -> Callable[[], None] | None:
        return partial(say, f"{self.glo}.{name}={value}") if name in self.looks_at else None


def draw(program: Program, call: str, state: str = "", **uniforms: Any) -> Draw:
    pieces: Pieces = {"blend": (partial(say, f"blend {state}"),)}
    return Draw(cast(Any, program), uniforms, pieces if state else None, partial(say, call))


def step(number: int, *draws: Draw, **more: Any) -> CompiledStep:
    return CompiledStep(Step("n", number, "fullscreen"), draws=list(draws), **more)


def executable(*steps: CompiledStep) -> Executable:
    nothing = cast(Any, None)
    plan = cast(Any, SimpleNamespace(resources={}, schedule=SimpleNamespace(steps=[one.step for one in steps])))
    made = Executable(
        nothing, plan, nothing, nothing, nothing, binds=[[]], steps=[list(steps)], timers=[nothing] * len(steps)
    )
    made.assemble()
    return made


def run(made: Executable) -> list[str]:
    """What one frame calls."""
    LOG.clear()
    for listed in made.lists[0]:
        for call in listed.calls:
            call()
    return LOG.copy()


def statics(made: Executable) -> list[str]:
    LOG.clear()
    for call in made.statics:
        call()
    return LOG.copy()


def test_what_all_draws_agree_on_is_written_once_and_not_in_the_frame() -> None:
    blur = Program(1, "radius", "axis")
    made = executable(
        step(0, draw(blur, "across", radius=4, axis=0, unread=1)), step(1, draw(blur, "down", radius=4, axis=1))
    )
    assert statics(made) == ["1.radius=4"]
    assert run(made) == ["1.axis=0", "across", "1.axis=1", "down"]


def test_two_programs_do_not_share_their_uniforms() -> None:
    made = executable(step(0, draw(Program(1, "gain"), "one", gain=1), draw(Program(2, "gain"), "two", gain=2)))
    assert statics(made) == ["1.gain=1", "2.gain=2"]
    assert run(made) == ["one", "two"]


def test_state_is_set_where_it_changes_over_the_bounds_of_steps() -> None:
    program = Program(1)
    made = executable(
        step(0, draw(program, "a", "add"), draw(program, "b", "add")),
        step(1, draw(program, "dispatch")),
        step(2, draw(program, "c", "add"), draw(program, "d", "over")),
    )
    assert run(made) == ["blend add", "a", "b", "dispatch", "c", "blend over", "d"]


def test_draws_in_the_eyes_order_set_their_state_each_and_leave_it_unknown() -> None:
    program = Program(1, "tint")
    parts = [draw(program, "", "over", tint=1), draw(program, "", "add", tint=2)]
    ordered = SortedDraws(parts, lambda part, first, count: say(f"part {part}"), runs=[(1, 0, 1), (0, 0, 2)])
    made = executable(step(0, draw(program, "a", "over", tint=1), sorted=ordered), step(1, draw(program, "b", "over")))
    assert run(made) == [
        *("blend over", "1.tint=1", "a"),
        *("blend add", "1.tint=2", "part 1"),
        *("blend over", "1.tint=1", "part 0"),
        *("blend over", "b"),
    ]


def test_zero_and_minus_zero_are_two_values() -> None:
    blur = Program(1, "axis")
    made = executable(step(0, draw(blur, "across", axis=0.0)), step(1, draw(blur, "down", axis=-0.0)))
    assert run(made) == ["1.axis=0.0", "across", "1.axis=-0.0", "down"]


def test_a_changed_parameter_moves_from_the_whole_frame_into_its_draws() -> None:
    blur = Program(1, "axis")
    made = executable(step(0, draw(blur, "across", axis=0)), step(1, draw(blur, "down", axis=0)))
    assert run(made) == ["across", "down"]
    made.fresh = False
    steps = [Step("n", number, "fullscreen", uniforms=(("axis", number),)) for number in (0, 1)]
    made.set_uniforms({step.key: step for step in steps})
    assert made.fresh
    assert statics(made) == []
    assert run(made) == ["1.axis=0", "across", "1.axis=1", "down"]
