"""Fixed-function state as differences: what is set already is not set again."""

from __future__ import annotations

from typing import Any, cast

from rendergraph.api import ADD, ALPHA, State, Stencil, StencilFace
from rendergraph.gl.raw import RawGL
from rendergraph.gl.state import Pieces, changes, pieces


class Names:
    """In place of the driver: every function is its name."""

    def __getattr__(self, name: str) -> Any:
        def called(*arguments: object) -> str:
            return name

        setattr(self, name, called)  # the same one from now on
        return called


RAW = cast(RawGL, Names())


def of(state: State, targets: int = 1, cull: str = "none") -> Pieces:
    return pieces(RAW, state, depth_test=state.depth_test is True, cull=cull, targets=targets)


def names(before: Pieces | None, after: Pieces) -> list[str]:
    return [cast(Any, call)() for call in changes(before, after)]


def test_equal_states_need_no_call() -> None:
    state = State(blend=ADD, depth_clamp=True, stencil=Stencil(StencilFace(func="equal", reference=2)))
    assert names(of(state), of(state)) == []


def test_only_what_differs_is_set() -> None:
    assert names(of(State()), of(State(blend=ADD))) == ["glEnablei", "glBlendFuncSeparatei", "glBlendEquationi"]
    assert names(of(State(blend=ADD)), of(State())) == ["glDisablei"]
    assert names(of(State()), of(State(), cull="back")) == ["glEnable", "glCullFace"]
    one, two = Stencil(StencilFace(reference=1)), Stencil(StencilFace(reference=2))
    assert set(names(of(State(stencil=one)), of(State(stencil=two)))) == {
        "glEnable",
        "glStencilFuncSeparate",
        "glStencilOpSeparate",
        "glStencilMaskSeparate",
    }


def test_a_target_that_was_not_there_gets_its_blending() -> None:
    before, after = of(State(blend=ADD)), of(State(blend=(ADD, ALPHA)), targets=2)
    assert names(before, after).count("glEnablei") == 2


def test_nothing_is_taken_for_set_at_the_beginning() -> None:
    calls = names(None, of(State()))
    assert {"glDisable", "glDisablei", "glFrontFace", "glPolygonMode"} == set(calls)
    assert calls.count("glDisable") == 5  # depth, culling, stencil, offset, clamp
