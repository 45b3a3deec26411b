"""Messages: requests of the server to the render process, sent through a pipe, and those of a page."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Union

from msgspec import UNSET, Meta, Struct, UnsetType, ValidationError, convert, json

from rendergraph.errors import Problem, UsageError
from rendergraph.scene.model import Camera
from rendergraph.session.selection import Selection


class Look(Struct, frozen=True):
    """How a texture is shown: one channel or all, and the mapping of a range; by default as its semantic suggests."""

    channel: str = ""
    scale: str = ""
    low: float | None = None
    high: float | None = None


class RenderRequest(Struct, frozen=True):
    """A picture of a pipeline with all edits: an output or tap, from a moved camera or the scene's own.

    A still picture has full size, no loss and statistics; others are as fast as possible.
    """

    selection: Selection
    camera: Camera | None = None
    frame: int = 1
    fps: float = 30.0
    port: str = ""
    exposure: float = 0.0
    look: Look = Look()
    still: bool = True
    known_revision: int = 0


class ThumbnailRequest(Struct, frozen=True):
    """A small picture of the first texture of each of these nodes in the last frame; None for every port."""

    nodes: frozenset[str] | None = None


class PixelRequest(Struct, frozen=True):
    """The values of the shown texture at a position: 0…1 from the left and from the top."""

    x: float
    y: float


class CompareRequest(Struct, frozen=True):
    selection: Selection


class ChangedFilesRequest(Struct, frozen=True):
    """The input files of the picture that have changed."""


Request = RenderRequest | ThumbnailRequest | PixelRequest | CompareRequest | ChangedFilesRequest


class Response(Struct, frozen=True):
    """A response: JSON values, encoded pictures, problems with their node; camera and bounding sphere of a picture."""

    facts: dict[str, Any] = {}
    files: Mapping[str, bytes] = {}
    problems: tuple[Mapping[str, Any], ...] = ()
    camera: Camera | None = None
    sphere: tuple[tuple[float, float, float], float] | None = None


# --- what a page sends to the server, as JSON -------------------------------------------------------------------------

LONGEST_VALUE = 20_000
"""Maximum length of a value."""
_NAME = re.compile("[A-Za-z_][A-Za-z0-9_-]*")


class PageMessage(Struct, frozen=True, tag_field="do", tag=lambda name: name.removesuffix("Message").lower()):
    """Anything that a page may send; its field `do` chooses the class."""


class SetMessage(PageMessage, frozen=True):
    path: Annotated[str, Meta(pattern=r"^[A-Za-z0-9_/-]+(\.[A-Za-z0-9_]+)?\Z")]
    value: Any
    again: bool = False  # continues the last change, such as a slider being dragged

    def __post_init__(self) -> None:
        if len(repr(self.value)) > LONGEST_VALUE:
            raise ValueError("the value is too long")
        is_name = isinstance(self.value, str) and _NAME.fullmatch(self.value)
        if self.path in ("scene", "environment") and not is_name:
            raise ValueError("choose a shipped one; write a file's path into the pipeline instead")
        if self.path.endswith(".type") and not is_name:  # no page may name a file
            raise ValueError("a type must be the name of a node type; write a file's path into the pipeline instead")


class DropMessage(PageMessage, frozen=True):
    path: str


class UndoMessage(PageMessage, frozen=True):
    pass


class RedoMessage(PageMessage, frozen=True):
    pass


class CameraMessage(PageMessage, frozen=True):
    """Choose a camera by name, or move the current one by angles, fractions of picture or scene, or a factor."""

    name: str | UnsetType | None = UNSET
    orbit: tuple[float, float] | None = None
    pan: tuple[float, float] | None = None
    zoom: tuple[Annotated[float, Meta(gt=1e-3, lt=1e3)]] | None = None
    fly: tuple[float, float, float] | None = None
    frame: tuple[()] | None = None


class LookMessage(PageMessage, frozen=True):
    port: Annotated[str, Meta(pattern=r"^[A-Za-z0-9_/.@,=\[\]:-]*\Z", max_length=200)] | None = None
    exposure: float | None = None
    channel: Literal["", "R", "G", "B", "A"] | None = None
    scale: Literal["", "linear", "log", "heat"] | None = None
    low: float | UnsetType | None = UNSET
    high: float | UnsetType | None = UNSET


class ViewMessage(PageMessage, frozen=True):
    """Show a named view of the file."""

    name: str


class KeepViewMessage(PageMessage, frozen=True, tag="keep_view"):
    """Write camera, frame and environment into the file as a named view."""

    name: Annotated[str, Meta(pattern=r"^[A-Za-z_][A-Za-z0-9_-]{0,99}\Z")]


class VisibleMessage(PageMessage, frozen=True):
    """The nodes of the graph that are visible on a page."""

    nodes: Annotated[list[str], Meta(max_length=2000)]


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


class EditMessage(PageMessage, frozen=True):
    """Operations on the graph, as in `rendergraph edit`; together they are one undo step."""

    operations: Annotated[list[list[Any]], Meta(min_length=1, max_length=16)]

    def __post_init__(self) -> None:
        for name, *words in (operation or [""] for operation in self.operations):
            kinds = OPERATIONS.get(name) if isinstance(name, str) else None
            if kinds is None or len(words) != len(kinds) or not all(map(isinstance, words, kinds)):
                raise ValueError(f"'{name}' is not an operation with these arguments")
            if len(repr(words)) > LONGEST_VALUE:
                raise ValueError("the operation is too long")
            if name in ("add", "retype", "insert") and not _NAME.fullmatch(words[1]):  # no page may name a file
                raise ValueError("a type must be the name of a node type")


OPERATIONS: Mapping[str, tuple[type, ...]] = {
    "add": (str, str, dict),
    "delete": (str,),
    "rename": (str, str),
    "connect": (str, list),
    "disconnect": (str,),
    "retype": (str, str),
    "disable": (str,),
    "enable": (str,),
    "insert": (str, str, str),
    "duplicate": (str, str),
}
"""Methods of `PipelineText` that a page may call, with the types of their arguments."""


class ReloadMessage(PageMessage, frozen=True):
    """Reload the file from disk, discarding the changes to it."""


class TypesMessage(PageMessage, frozen=True):
    """Request the node types that can be added."""


class DraftMessage(PageMessage, frozen=True):
    """Request what saving would write, under a name or to the edited file."""

    name: Any = None


class SaveMessage(PageMessage, frozen=True):
    """Save under a name; for the opened file itself, `digest` is that of the draft that was shown."""

    name: Any
    digest: str = ""


_MESSAGES: Any = Union[tuple(PageMessage.__subclasses__())]  # noqa: UP007  # a tuple of types


def parse_message(text: str) -> PageMessage:
    try:
        parsed: PageMessage = convert(json.decode(text, type=dict[str, Any]), _MESSAGES)
    except ValidationError as error:
        if not text.lstrip().startswith("{"):
            raise
        raise UsageError(Problem("RG500", f"malformed request from the page: {error}")) from None
    return parsed
