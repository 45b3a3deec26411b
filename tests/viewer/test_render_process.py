"""The render process: one that hangs, dies or cannot start costs a request, and nothing else."""

from __future__ import annotations

import contextlib
import os
import signal
from pathlib import Path

import pytest

import rendergraph as rg
from rendergraph.errors import DeviceError, RenderError
from rendergraph.viewer.messages import RenderRequest
from rendergraph.viewer.render_process import RenderProcess

pytestmark = pytest.mark.slow

PICTURE = RenderRequest(rg.Selection("forward", size=(32, 18)))
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


def test_one_that_is_killed_or_hangs_is_ended_and_started_again(tmp_path: Path) -> None:
    (tmp_path / "sleeps.py").write_text(SLEEPS)
    file = tmp_path / "slow.yaml"
    file.write_text("nodes: {a: {type: sleeps}}\noutputs: {image: a.color}\nsize: [8, 8]\n")
    with contextlib.closing(RenderProcess(timeout=3.0)) as process:
        assert process.ask(PICTURE).files
        first = process.pid
        assert first is not None
        os.kill(first, signal.SIGKILL)
        with pytest.raises(RenderError, match=r"RG630 the render process ended \(SIGKILL\)"):
            process.ask(PICTURE)
        assert process.ask(PICTURE).files
        second = process.pid
        assert second != first
        with pytest.raises(RenderError, match="RG630 the render process did not answer within 3 s and was terminated"):
            process.ask(RenderRequest(rg.Selection(str(file), plugins=(tmp_path,))))
        assert process.pid is None
        process.start()
        third = process.pid
    assert third is not None
    for pid in (first, second, third):
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_without_a_device_the_reason_is_reported() -> None:
    with contextlib.closing(RenderProcess(device=99)) as process, pytest.raises(DeviceError, match="RG611"):
        process.ask(PICTURE)
