"""Programs that fail leave nothing behind."""

from __future__ import annotations

import pytest

import rendergraph as rg
from rendergraph.gl.programs import ProgramError, link

VERTEX = "#version 450 core\nvoid main() { gl_Position = vec4(0.0); }"
FRAGMENT = "#version 450 core\nout vec4 color;\nvoid main() { color = vec4(1.0); }"
WRONG = "#version 450 core\nvoid main() { nothing; }"
UNLINKED = "#version 450 core\nin vec4 nobody;\nout vec4 color;\nvoid main() { color = nobody; }"


@pytest.mark.parametrize(
    "texts",
    [
        {"vertex": VERTEX, "fragment": WRONG},
        {"vertex": WRONG, "fragment": FRAGMENT},
        {"vertex": VERTEX, "geometry": WRONG, "fragment": FRAGMENT},
        {"vertex": VERTEX, "fragment": UNLINKED},
        {"compute": WRONG},
    ],
    ids=["fragment", "vertex", "geometry", "link", "compute"],
)
def test_a_program_that_fails_leaves_nothing(texts: dict[str, str]) -> None:
    def alive() -> list[int]:
        raw = session.device.raw
        return [name for name in range(1, 200) if raw.glIsProgram(name) or raw.glIsShader(name)]

    with rg.Session() as session, session.current():
        kept = link(session.device, {"vertex": VERTEX, "fragment": FRAGMENT})
        before = alive()
        for _ in range(3):
            with pytest.raises(ProgramError, match="failed"):
                link(session.device, texts)
        assert alive() == before
        assert kept.glo in before
        assert session.device.raw.error() is None
