"""USD stages as scenes: `reader` walks through a stage, `materials` and `lights` translate what it finds.

Pixar's `usd-core` reads them, which the extra `usd` installs.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rendergraph.scene.model import Scene
    from rendergraph.scene.reading import Reading


def read_usd(path: Path, reading: Reading) -> Scene:
    """Read the scene of a stage, with every layer that it refers to."""
    reading.check_file(path, "scene file")
    reading.check_bytes(path, "scene file")
    if find_spec("pxr") is None:
        raise reading.error("RG301", "USD files are read by usd-core; install it: pip install 'rendergraph[usd]'")
    from rendergraph.pipelines.formats.usd.reader import StageReader  # which imports usd-core

    return StageReader(path, reading).read()
