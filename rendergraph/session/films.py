"""The length of a film, and whether anything moves in it."""

from __future__ import annotations

import math
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
        UsageError: a value is impossible, both are given, or `clip` for a scene in which nothing moves.
    """
    if frames is not None and seconds is not None:
        raise UsageError(Problem("RG500", "frames and seconds both say how long the film is; leave out one"))
    if seconds is not None and not (isinstance(seconds, int | float) and 0 < seconds < math.inf):
        raise UsageError(Problem("RG500", f"seconds: expected a number above 0, got {seconds!r}"))
    if not (isinstance(fps, int | float) and 0 < fps < math.inf):
        raise UsageError(Problem("RG500", f"fps: expected a number above 0, got {fps!r}"))
    if isinstance(frames, range) and (frames.step == 1 or len(frames) < 2):
        return frames
    if frames not in (None, "clip"):
        text = f"frames: expected consecutive numbers, as in range(1, 31), or 'clip', got {frames!r}"
        raise UsageError(Problem("RG500", text))
    length = animate.length(scene)
    if frames == "clip" and not length:
        raise UsageError(Problem("RG500", "frames: the scene has no clip, keyframes or orbit to be as long as"))
    seconds = seconds or (CIRCLE_SECONDS if turntable and frames is None else length)
    return range(1, max(1, round(seconds * fps)) + 1)


def standstill_warning(expanded: Expanded, *, film: bool, turntable: str = "--turntable") -> list[Problem]:
    """Return a warning about a film or several frames of a scene in which nothing moves; `turntable` is the way out."""
    linked, count = expanded.linked, len(expanded.options.frames)
    if animate.moves(linked.scene) or expanded.options.turntable or (count == 1 and not film):
        return []
    span = f" during {count} frames" if count > 1 else ", so the film is one frame"
    text = f"nothing in the scene moves{span}; {turntable} takes the camera around it"
    return [Problem("RG629", text, Place(linked.graph.name), severity="warning")]
