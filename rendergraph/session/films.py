"""How long a film is, and what moves in it."""

from __future__ import annotations

from typing import Literal

from rendergraph.errors import Place, Problem, UsageError
from rendergraph.scene import animate
from rendergraph.scene.model import Scene
from rendergraph.session.values import Expanded

CIRCLE_SECONDS = 4.0
"""Length of a turntable by default."""


def film_frames(
    scene: Scene,
    fps: float,
    frames: range | Literal["clip"] | None = None,
    seconds: float | None = None,
    *,
    turntable: bool = False,
) -> range:
    """Return the frames of a film: those given, as many as `seconds` take, or the scene's motion once.

    Raises:
        UsageError: both are given, or `clip` for a scene in which nothing moves.
    """
    if frames is not None and seconds is not None:
        raise UsageError(Problem("RG500", "frames and seconds both say how long the film is; leave out one"))
    if isinstance(frames, range):
        return frames
    length = animate.length(scene)
    if frames == "clip" and not length:
        raise UsageError(Problem("RG500", "frames: the scene has no clip, keyframes or orbit to be as long as"))
    seconds = seconds or (CIRCLE_SECONDS if turntable and frames is None else length)
    return range(1, max(1, round(seconds * fps)) + 1)


def standstill_warning(expanded: Expanded) -> list[Problem]:
    """Return a warning about several frames of a scene in which nothing moves."""
    linked, frames = expanded.linked, expanded.options.frames
    if animate.moves(linked.scene) or expanded.options.turntable or len(frames) == 1:
        return []
    text = f"nothing in the scene moves during {len(frames)} frames; --turntable takes the camera around it"
    return [Problem("RG629", text, Place(linked.graph.name), severity="warning")]
