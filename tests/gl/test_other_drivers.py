"""Another driver: OpenGL by way of Vulkan draws what llvmpipe draws, where it draws."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rendergraph.images import read

ICD = Path("/usr/share/vulkan/icd.d/lvp_icd.x86_64.json")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not ICD.exists(), reason="Mesa's Vulkan drivers are not installed"),
]


def drawn(name: str, folder: Path, **environment: str) -> tuple[int, Path, str]:
    """A shipped pipeline in a process of its own: its exit status, its picture, and what it said."""
    path = folder / f"{'-'.join([name, *environment.values()])}.exr".replace("/", "-")
    words = [sys.executable, "-m", "rendergraph", "run", name, "--size", "48x27", "-o", str(path)]
    done = subprocess.run(words, env=os.environ | environment, capture_output=True, text=True, timeout=300, check=False)
    return done.returncode, path, done.stderr


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("name", ["shading-unlit", "shading-flat", "forward", "deferred", "shadow-vsm"])
def test_zink_draws_the_same(name: str, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir(mode=0o700)
    status, found, said = drawn(
        name, tmp_path, GALLIUM_DRIVER="zink", LIBGL_ALWAYS_SOFTWARE="1", XDG_RUNTIME_DIR=str(tmp_path / "run")
    )
    assert status == 0, said
    assert "on zink" in said
    status, expected, _ = drawn(name, tmp_path)
    assert status == 0
    a, b = read(found).astype(np.float32), read(expected).astype(np.float32)
    assert np.quantile(np.abs(a - b), 0.99) <= 2e-3
