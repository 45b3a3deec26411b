"""The render process: one that hangs, dies or cannot start costs a question, and nothing else."""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

import rendergraph as rg
from rendergraph.errors import DeviceError, RenderError
from rendergraph.viewer.child import Child
from rendergraph.viewer.questions import Ask

pytestmark = pytest.mark.slow

PICTURE = Ask(rg.Selection("forward", size=(32, 18)))
SLEEPS = '''"""A node that takes its time."""

from __future__ import annotations

import time

from rendergraph.api import DisplayColor, Frame, Node, Output, Steps


class Sleeps(Node):
    """A node that takes its time."""

    color = Output(DisplayColor, format="rgba8", clear=0.0, doc="Nothing.")

    def record(self, steps: Steps) -> None:
        """Nothing but a clear."""
        time.sleep(60.0)
'''


@pytest.fixture
def child() -> Iterator[Child]:
    with contextlib.closing(Child(patience=60.0)) as found:
        yield found


def test_one_that_is_killed_is_started_again(child: Child) -> None:
    assert child.ask(PICTURE).files
    first = child.pid
    assert first is not None
    os.kill(first, signal.SIGKILL)
    with pytest.raises(RenderError, match=r"RG630 the render process ended \(SIGKILL\)"):
        child.ask(PICTURE)
    assert child.ask(PICTURE).files
    assert child.pid != first


def test_one_that_hangs_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rendergraph.viewer.child.FIRST", 30.0)
    (tmp_path / "sleeps.py").write_text(SLEEPS)
    file = tmp_path / "slow.yaml"
    file.write_text("nodes: {a: {type: sleeps}}\noutputs: {image: a.color}\nsize: [8, 8]\n")
    with contextlib.closing(Child(patience=3.0)) as child:
        assert child.ask(PICTURE).files
        first = child.pid
        with pytest.raises(RenderError, match="RG630 the render process did not answer within 3 s and was ended"):
            child.ask(Ask(rg.Selection(str(file), plugins=(tmp_path,))))
        assert child.pid is None
        assert child.ask(PICTURE).files
        assert child.pid != first


def test_without_a_device_the_reason_is_said() -> None:
    with (
        contextlib.closing(Child(device=99)) as child,
        pytest.raises(DeviceError, match="RG611"),
    ):
        child.ask(PICTURE)


def test_closing_ends_the_process(child: Child) -> None:
    child.start()
    pid = child.pid
    assert pid is not None
    child.close()
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
