"""Messages: requests of the server to the render process, which travel through a pipe, and those of a page."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Union

from msgspec import UNSET, Meta, Struct, UnsetType, ValidationError, convert, json

from rendergraph.errors import Problem, UsageError
from rendergraph.scene.model import Camera
from rendergraph.session.selection import Selection


@dataclass(frozen=True)
class RenderRequest:
    """A picture of a pipeline with all edits: an output or tap, by a camera that was moved or the scene's own.

    A still one is of full size, lossless and with statistics; others are as fast as possible.
    """

    selection: Selection
    camera: Camera | None = None
    frame: int = 1
    fps: float = 30.0
    port: str = ""
    exposure: float = 0.0
    still: bool = True
    known_revision: int = 0


@dataclass(frozen=True)
class ThumbnailRequest:
    """A small picture of every port of the last frame."""

    pass


@dataclass(frozen=True)
class PixelRequest:
    """The values of the shown texture at a position: 0…1 from the left and from the top."""

    x: float
    y: float


@dataclass(frozen=True)
class CompareRequest:
    selection: Selection


@dataclass(frozen=True)
class VariantRequest:
    """A file that extends the opened pipeline by all edits, and shows the scene by the camera that was moved.

    It will be written into `folder`. A state that does not link is answered with its problems.
    """

    opened: Selection
    selection: Selection
    folder: Path


@dataclass(frozen=True)
class ChangedFilesRequest:
    """The input files of the picture that have changed."""

    pass


Request = RenderRequest | ThumbnailRequest | PixelRequest | CompareRequest | VariantRequest | ChangedFilesRequest


@dataclass(frozen=True)
class Response:
    """The response: JSON values, encoded pictures, problems with their node; camera and scene's sphere of a picture."""

    facts: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)
    problems: tuple[Mapping[str, Any], ...] = ()
    camera: Camera | None = None
    sphere: tuple[tuple[float, float, float], float] | None = None


# --- what a page sends to the server, as JSON -------------------------------------------------------------------------

LONGEST_VALUE = 20_000
"""Characters of a value."""


class PageMessage(Struct, frozen=True, tag_field="do", tag=lambda name: name.removesuffix("Message").lower()):
    """Anything that a page may send; its field `do` chooses the class."""


class SetMessage(PageMessage, frozen=True):
    path: Annotated[str, Meta(pattern=r"^[A-Za-z0-9_/-]+(\.[A-Za-z0-9_]+)?\Z")]
    value: Any
    again: bool = False  # continues the last change, as of a slider that is still held

    def __post_init__(self) -> None:
        if len(repr(self.value)) > LONGEST_VALUE:
            raise ValueError("the value is too long")
        is_name = isinstance(self.value, str) and re.fullmatch(r"[A-Za-z_][A-Za-z0-9_-]*", self.value)
        if self.path.endswith(".type") and not is_name:  # no page may name a file
            raise ValueError("a type must be the name of a node type; write a file's path into the pipeline instead")


class DropMessage(PageMessage, frozen=True):
    path: str


class UndoMessage(PageMessage, frozen=True):
    pass


class RedoMessage(PageMessage, frozen=True):
    pass


class CameraMessage(PageMessage, frozen=True):
    """Choose a camera by name, or move the current one by angles, shares of the picture or scene, or a factor."""

    name: str | UnsetType | None = UNSET
    orbit: tuple[float, float] | None = None
    pan: tuple[float, float] | None = None
    zoom: tuple[Annotated[float, Meta(gt=1e-3, lt=1e3)]] | None = None
    fly: tuple[float, float, float] | None = None
    frame: tuple[()] | None = None


class LookMessage(PageMessage, frozen=True):
    port: Annotated[str, Meta(pattern=r"^[A-Za-z0-9_/.@,=\[\]:-]*\Z", max_length=200)] | None = None
    exposure: float | None = None


class FrameMessage(PageMessage, frozen=True):
    number: int


class PlayMessage(PageMessage, frozen=True):
    on: bool


class HoldMessage(PageMessage, frozen=True):
    on: bool  # whether something is being dragged


class RememberMessage(PageMessage, frozen=True):
    pass


class CompareMessage(PageMessage, frozen=True):
    name: str | None


class PixelMessage(PageMessage, frozen=True):
    x: float
    y: float


class SaveMessage(PageMessage, frozen=True):
    name: Any


_MESSAGES: Any = Union[tuple(PageMessage.__subclasses__())]  # noqa: UP007  # a tuple of types


def parse_message(text: str) -> PageMessage:
    try:
        parsed: PageMessage = convert(json.decode(text, type=dict[str, Any]), _MESSAGES)
    except ValidationError as error:
        if not text.lstrip().startswith("{"):
            raise
        raise UsageError(Problem("RG500", f"malformed request from the page: {error}")) from None
    return parsed
