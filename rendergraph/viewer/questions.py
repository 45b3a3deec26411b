"""What the server asks the render process, and what it is told; plain values, for they travel through a pipe."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rendergraph.scene.model import Camera
from rendergraph.session.selection import Selection


@dataclass(frozen=True)
class Ask:
    """A picture.

    Attributes:
        selection: the pipeline with everything that was changed.
        camera: the camera that was moved by hand; None for the scene's own.
        frame: number, from 1.
        fps: frames a second.
        port: what to look at: an output's name, or a tap.
        stops: exposure of what holds light, in EV; the display's own output stays as it is.
        still: nothing moves: full size, without loss, with figures; else as fast as it goes.
        known: the revision of the description that the server has.
    """

    selection: Selection
    camera: Camera | None = None
    frame: int = 1
    fps: float = 30.0
    port: str = ""
    stops: float = 0.0
    still: bool = True
    known: int = 0


@dataclass(frozen=True)
class Thumbnails:
    """A small picture of every port of what was drawn last."""


@dataclass(frozen=True)
class Pixel:
    """The values of what is looked at, at a place: 0…1 from the left and from the top."""

    x: float
    y: float


@dataclass(frozen=True)
class Against:
    """Another pipeline drawn the same way, and how far the picture is from it."""

    selection: Selection


@dataclass(frozen=True)
class Variant:
    """The YAML of what differs from the file that was opened."""

    opened: Selection


@dataclass(frozen=True)
class Changed:
    """Has a file changed that went into the picture?"""


Question = Ask | Thumbnails | Pixel | Against | Variant | Changed


@dataclass(frozen=True)
class Answer:
    """What is said to a question.

    Attributes:
        facts: plain JSON values.
        files: pictures by name, encoded.
        problems: what is wrong, as JSON, each with the `node` that has it where it is known.
        camera: the camera the picture was taken with, None where no picture was.
        sphere: centre and radius around the scene.
    """

    facts: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)
    problems: tuple[Mapping[str, Any], ...] = ()
    camera: Camera | None = None
    sphere: tuple[tuple[float, float, float], float] | None = None
