"""The state that all pages share: what is shown, what was edited, and what it is compared with.

`ViewState.apply` takes a message of a page, `request` returns the picture to ask for, and `record` takes the response.
None of them waits for anything.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from msgspec import UNSET, structs

from rendergraph.errors import Problem, UsageError
from rendergraph.resources import shipped_pipelines
from rendergraph.scene.camera_words import camera_words, described_camera
from rendergraph.scene.model import Camera
from rendergraph.session.selection import Selection
from rendergraph.viewer import camera as cameras
from rendergraph.viewer import messages
from rendergraph.viewer.messages import RenderRequest, Response

MOST_UNDO = 500
MOST_COMPARED = 50
"""Snapshots and pipelines that are kept to compare with."""
CAMERA = "camera"
"""The path of the camera among the edits: a name, or words as `--camera` takes them."""
_FILE = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*\.ya?ml")
_BARE = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*")  # a word that needs no quotes in YAML
_KEYWORDS = frozenset({"null", "true", "false", "Null", "NULL", "True", "TRUE", "False", "FALSE"})


@dataclass(frozen=True)
class Edits:
    """Settings by path (`ao.radius`, `shadows.type`, `light.occlusion`, `camera`) in order, with undo and redo."""

    current: Mapping[str, str] = field(default_factory=dict)
    before: tuple[Mapping[str, str], ...] = ()
    after: tuple[Mapping[str, str], ...] = ()

    @property
    def sets(self) -> tuple[str, ...]:
        return tuple(f"{path}={value}" for path, value in self.current.items())

    def set(self, path: str, value: Any, *, again: bool = False) -> Edits:
        """Set a value; `again` continues the last change (a slider that is still held) instead of adding one."""
        bare = isinstance(value, str) and _BARE.fullmatch(value) and value not in _KEYWORDS
        text = value if bare or path == CAMERA else json.dumps(value)
        if self.current.get(path) == text:
            return self
        current = {**self.current, path: text}
        if again and self.before and path in self.current:
            return replace(self, current=current, after=())
        return self._add(current)

    def drop(self, path: str) -> Edits:
        return self._add({p: v for p, v in self.current.items() if p != path}) if path in self.current else self

    def undo(self) -> Edits:
        if not self.before:
            return self
        return Edits(self.before[-1], self.before[:-1], (*self.after, self.current))

    def redo(self) -> Edits:
        if not self.after:
            return self
        return Edits(self.after[-1], (*self.before, self.current), self.after[:-1])

    def _add(self, current: Mapping[str, str]) -> Edits:
        return Edits(current, (*self.before, self.current)[-MOST_UNDO:])


@dataclass
class ViewState:
    """The state of the pages.

    Attributes:
        camera: while it is being moved; a drag that has ended is an edit.
        held: while something is dragged.
        revision: of the description that pages have.
    """

    opened: Selection
    folder: Path
    fps: float = 30.0
    against: tuple[str, Selection] | None = None
    edits: Edits = field(default_factory=Edits)
    camera: Camera | None = None
    frame: int = 1
    playing: bool = False
    port: str = ""
    exposure: float = 0.0
    held: bool = False
    revision: int = 0

    def __post_init__(self) -> None:
        self._last_camera: Camera | None = None  # of the last picture
        self._sphere: cameras.Sphere = ((0.0, 0.0, 0.0), 1.0)
        self._others: dict[str, Selection] = {"as opened": self.opened}
        self._other: str | None = None
        self._snapshots = 0
        if self.against is not None:
            self._others[self.against[0]] = self.against[1]
            self._other = self.against[0]

    @property
    def selection(self) -> Selection:
        """The pipeline with all edits, among them a camera that was moved."""
        return structs.replace(self.opened, sets=(*self.opened.sets, *self.edits.sets))

    @property
    def moved_camera(self) -> Camera | None:
        """The camera that was moved by hand; None if it is one of the scene's."""
        words = self.selection.camera or ""
        if self.camera is not None or "=" not in words or self._last_camera is None:
            return self.camera
        return described_camera(words, self._last_camera)

    @property
    def other(self) -> Selection | None:
        return self._others[self._other] if self._other is not None else None

    def request(self) -> RenderRequest:
        return RenderRequest(
            self.selection,
            self.camera,
            self.frame,
            self.fps,
            self.port,
            self.exposure,
            still=not (self.held or self.playing),
            known_revision=self.revision,
        )

    def as_json(self) -> dict[str, Any]:
        return {
            "edits": dict(self.edits.current),
            "flags": list(self.edits.sets),
            "can_undo": bool(self.edits.before),
            "can_redo": bool(self.edits.after),
            "frame": self.frame,
            "playing": self.playing,
            "port": self.port,
            "exposure_ev": self.exposure,
            "camera": self.selection.camera,
            "moved": self.camera is not None or "=" in (self.selection.camera or ""),
            "others": list(self._others),
            "other": self._other,
            "pipelines": list(shipped_pipelines()),
        }

    def record(self, response: Response) -> None:
        if response.camera is not None:
            self._last_camera = response.camera
        if response.sphere is not None:
            self._sphere = response.sphere
        self.revision = int(response.facts.get("revision", self.revision))

    def variant_file(self, name: object) -> Path:
        if not isinstance(name, str) or not _FILE.fullmatch(name):
            text = (
                "variants are saved in the folder where `view` was started; expected a plain name, as in variant.yaml"
            )
            raise UsageError(Problem("RG500", text))
        path = self.folder / name
        if path.exists() or path.is_symlink():
            raise UsageError(Problem("RG531", f"'{name}' exists; choose another name"))
        return path

    # --- messages ----------------------------------------------------------------------------------------------------

    def apply(self, message: messages.PageMessage) -> bool:
        """Do what a page asks for, and return whether another picture is needed."""
        match message:
            case messages.SetMessage(path, value, again):
                self.edits = self.edits.set(path, value, again=again)
            case messages.DropMessage(path):
                self.edits = self.edits.drop(path)
            case messages.UndoMessage():
                self.edits = self.edits.undo()
            case messages.RedoMessage():
                self.edits = self.edits.redo()
            case messages.CameraMessage():
                self._move(message)
            case messages.LookMessage(port, exposure):
                self.port = self.port if port is None else port
                self.exposure = self.exposure if exposure is None else min(max(exposure, -24.0), 24.0)
            case messages.FrameMessage(number):
                self.frame = min(max(number, 1), 1_000_000)
            case messages.PlayMessage(on):
                self.playing = on
            case messages.HoldMessage(on):
                was_held, self.held = self.held, on
                self._keep_camera()
                return was_held and not on  # the last picture is rendered once more in full quality
            case messages.RememberMessage():
                self._snapshots += 1
                self._compare_with(f"snapshot {self._snapshots}", self.selection)
            case messages.CompareMessage(None):
                self._other = None
            case messages.CompareMessage(str(name)):
                selection = self._others.get(name)
                if selection is None and name not in shipped_pipelines():
                    text = "compare with a shipped pipeline, a snapshot, or the pipeline of --against"
                    raise UsageError(Problem("RG500", text))
                shipped = structs.replace(self.opened, source=name, sets=(), patches=())
                self._compare_with(name, selection or shipped)
        return True

    def _move(self, message: messages.CameraMessage) -> None:
        if message.name is not UNSET:
            self.camera = None
            is_opened = message.name is None or message.name == self.opened.camera
            self.edits = self.edits.drop(CAMERA) if is_opened else self.edits.set(CAMERA, message.name)
            return
        camera = self.camera or self.moved_camera or self._last_camera
        for move in (cameras.orbit, cameras.pan, cameras.zoom, cameras.fly, cameras.frame):
            amounts = getattr(message, move.__name__)
            if camera is not None and amounts is not None:
                camera = move(camera, self._sphere, *amounts)
        self.camera = camera
        self._keep_camera()

    def _keep_camera(self) -> None:
        """Make a camera that was moved an edit, once nothing is held: it can be undone, saved and copied."""
        if self.camera is not None and not self.held:
            self.edits = self.edits.set(CAMERA, camera_words(self.camera))
            self.camera = None

    def _compare_with(self, name: str, selection: Selection) -> None:
        """Add something to compare with, in place of the oldest where there are too many."""
        if name not in self._others and len(self._others) == MOST_COMPARED:
            del self._others[list(self._others)[1]]  # the first is the file as it was opened
        self._others[name] = selection
        self._other = name
