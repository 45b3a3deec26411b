"""Occlusion of a scene, as an array."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]
Occlusion = Callable[..., Floats]


@pytest.fixture
def occlusion(tmp_path: Path, session: rg.Session) -> Occlusion:
    """`occlusion(technique, scene, **params)`: the port's values, shape (height, width), top row first.

    The scene is a file, a shipped name, or the text of one without its first line.
    """

    def draw(technique: str, scene: str | Path, size: tuple[int, int] = (96, 72), **params: Any) -> Floats:
        if isinstance(scene, str) and "\n" in scene:
            file = tmp_path / "scene.yaml"
            file.write_text("scene: 1\n" + scene)
            scene = file
        pipeline = rg.load(
            f"ssao-{technique}",
            scene=scene,
            size=size,
            sets=[f"ao.{name}={value}" for name, value in params.items()],
            patches=[{"outputs": {"occlusion": "ao.occlusion"}}],
        )
        frame = session.render(pipeline, outputs=["occlusion"])
        with session.device.current():
            assert session.device.raw.error() is None
        return np.asarray(frame.arrays["occlusion"][..., 0], np.float64)

    return draw
