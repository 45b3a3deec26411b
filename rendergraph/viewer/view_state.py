"""The state that all pages share: the shown picture, the edits, and the pipeline to compare with.

`ViewState.apply` handles a message of a page, `request` returns the picture to request, and `record` takes the
response. None of them blocks.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from msgspec import UNSET, Struct
from msgspec.structs import asdict, replace

from rendergraph.catalog import Catalog
from rendergraph.edit import PipelineText
from rendergraph.errors import Place, Problem, RendergraphError, UsageError, shown_file
from rendergraph.images.files import replace_text
from rendergraph.pipelines.environments import SHIPPED
from rendergraph.resources import shipped_pipelines, shipped_scenes
from rendergraph.scene.model import Camera
from rendergraph.scene.scene_values import camera_words, described_camera
from rendergraph.session import stages
from rendergraph.session.selection import MOST_FRAMES, Selection
from rendergraph.viewer import camera as cameras
from rendergraph.viewer import editing, messages
from rendergraph.viewer.messages import RenderRequest, Response

MOST_UNDO = 500
MOST_COMPARED = 50
"""Maximum number of snapshots and pipelines to compare with."""
CAMERA = "camera"
"""The path of the camera among the edits: a name, or text as for `--camera`."""
ENVIRONMENT = "environment"
FRAME = "frame"
"""The path of the frame among the edits, which is not a setting."""
_FILE = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*\.ya?ml")
_BARE = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*")  # a word that needs no quotes in YAML
_KEYWORDS = frozenset({"null", "true", "false", "Null", "NULL", "True", "TRUE", "False", "FALSE"})
_State = tuple[str | None, Mapping[str, str]]


class Edits(Struct, frozen=True):
    """The changes, with undo and redo."""

    current: Mapping[str, str] = {}  # settings by path: `ao.radius`, `shadows.type`, `light.occlusion`, `camera`
    text: str | None = None  # the file after changes of its graph; None stands for the file on disk
    before: tuple[_State, ...] = ()
    after: tuple[_State, ...] = ()

    @property
    def sets(self) -> tuple[str, ...]:
        return tuple(f"{path}={value}" for path, value in self.current.items() if path != FRAME)

    @property
    def state(self) -> _State:
        return self.text, self.current

    def set(self, path: str, value: Any, *, again: bool = False) -> Edits:
        """Set a value; `again` continues the last change (a slider being dragged) instead of adding one."""
        bare = isinstance(value, str) and _BARE.fullmatch(value) and value not in _KEYWORDS
        text = value if bare or path == CAMERA else json.dumps(value)
        if self.current.get(path) == text:
            return self
        current = {**self.current, path: text}
        if again and self.before and path in self.current:
            return replace(self, current=current, after=())
        return self.write(self.text, current)

    def differs_by(self, path: str) -> bool:
        """Return whether the last change was only of this path."""
        if not self.before:
            return False
        text, before = self.before[-1]
        return text == self.text and _without(before, path) == _without(self.current, path)

    def drop(self, path: str) -> Edits:
        return self.write(self.text, _without(self.current, path)) if path in self.current else self

    def write(self, text: str | None, current: Mapping[str, str]) -> Edits:
        """Change the text, and the settings beside it."""
        return Edits(current, text, (*self.before, self.state)[-MOST_UNDO:])

    def undo(self) -> Edits:
        if not self.before:
            return self
        text, current = self.before[-1]
        return Edits(current, text, self.before[:-1], (*self.after, self.state))

    def redo(self) -> Edits:
        if not self.after:
            return self
        text, current = self.after[-1]
        return Edits(current, text, (*self.before, self.state), self.after[:-1])

    def save(self, before: str, after: str, current: Mapping[str, str]) -> Edits:
        """Record that the file was written: undo states become changes relative to its former text."""

        def kept(states: tuple[_State, ...]) -> tuple[_State, ...]:
            return tuple((before if text is None else text, settings) for text, settings in states)

        here = (before if self.text is None else self.text, self.current)
        return Edits(current, after, (*kept(self.before), here)[-MOST_UNDO:])


@dataclass
class ViewState:
    """The state of the pages."""

    opened: Selection
    folder: Path
    fps: float = 30.0
    against: tuple[str, Selection] | None = None
    edits: Edits = field(default_factory=Edits)
    camera: Camera | None = None  # while it is being moved; a finished drag is an edit
    frame: int = 1
    playing: bool = False
    port: str = ""
    exposure: float = 0.0
    look: messages.Look = field(default_factory=messages.Look)
    held: bool = False  # whether something is being dragged
    revision: int = 0  # of the description that pages have

    def __post_init__(self) -> None:
        self._last_camera: Camera | None = None  # camera of the last picture
        self._sphere: cameras.Sphere = ((0.0, 0.0, 0.0), 1.0)
        self._others = dict([("as opened", self.opened), *([self.against] if self.against else [])])
        self._other = self.against[0] if self.against else None
        self._snapshots = 0
        self._own = editing.own_file(self.opened)
        self._disk = ""  # text of the opened file when its edits began or when it was written
        self._saved = self.edits.state
        self._written: set[Path] = set()  # files that were saved from here

    @property
    def selection(self) -> Selection:
        """The pipeline with all edits, including a moved camera."""
        if self.edits.text is None:
            return replace(self.opened, sets=(*self.opened.sets, *self.edits.sets))
        return replace(self.opened, source=shown_file(self.file), text=self.edits.text, sets=self.edits.sets)

    @property
    def file(self) -> Path:
        """The file that is being edited: the opened one, or a new one in the folder."""
        return self._own or self.folder / "variant.yaml"

    @property
    def is_changed(self) -> bool:
        return self.edits.state != self._saved

    @property
    def is_behind(self) -> bool:
        """Whether the opened file has changed on disk since the changes to its text began."""
        return self.edits.text is not None and self._own is not None and self._disk != _read(self._own)

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
            self.look,
            still=not (self.held or self.playing),
            known_revision=self.revision,
        )

    def as_json(self) -> dict[str, Any]:
        return {
            "edits": dict(self.edits.current),
            "flags": list(self.edits.sets) if self.edits.text is None else [],
            "file": self.file.name,
            "is_own": self._own is not None,
            "is_changed": self.is_changed,
            "is_rewired": self.edits.text is not None,
            "is_behind": self.is_behind,
            "can_undo": bool(self.edits.before),
            "can_redo": bool(self.edits.after),
            "frame": self.frame,
            "playing": self.playing,
            "port": self.port,
            "exposure_ev": self.exposure,
            "look": asdict(self.look),
            "camera": self.selection.camera,
            "moved": self.camera is not None or "=" in (self.selection.camera or ""),
            "others": list(self._others),
            "other": self._other,
            "pipelines": list(shipped_pipelines()),
            "scenes": list(shipped_scenes()),
            "environments": [*SHIPPED, "none"],
        }

    def follow(self) -> bool:
        """Take over the text of the opened file from the disk if it has changed there alone; settings stay."""
        if not self.is_behind or self.edits.text != self._disk or not (text := _read(self.file)):
            return False
        self._disk, self.edits = text, replace(self.edits, text=text, after=())
        self._saved = text, self._saved[1]
        return True

    def record(self, response: Response) -> None:
        if response.camera is not None:
            self._last_camera = response.camera
        if response.sphere is not None:
            self._sphere = response.sphere
        self.revision = int(response.facts.get("revision", self.revision))

    # --- the file ----------------------------------------------------------------------------------------------------

    def edit(self, operations: Sequence[Sequence[Any]]) -> list[str]:
        """Apply operations to the graph, and describe their further effects; a mistake changes nothing."""
        text, sets = self.edits.text, self.edits.current
        if text is None:
            text = self._disk = editing.text_of(self.opened)
            given = (setting.partition("=") for setting in self.opened.sets)
            sets = {**{path: value for path, _, value in given}, **sets}
        pipeline = PipelineText(text, self.file, Catalog.discover(self.opened.plugins), [])
        view = {path: value for path, value in sets.items() if path in (CAMERA, FRAME)}
        others = [f"{path}={value}" for path, value in sets.items() if path not in view]
        beside = editing.edited(pipeline, others, operations)
        self.edits = self.edits.write(pipeline.text, beside | view)
        return pipeline.notes

    def draft(self, name: object) -> tuple[str, str, str]:
        """Return what `save` would write under a name, the difference, and the digest of the existing file."""
        path = self.file if name is None else self._path(name)
        before = _read(path) if path == self._own or path in self._written else ""
        if path == self._own:
            text = editing.in_place(self.opened, self.selection, path, self.edits.text or before)
        else:
            text = editing.variant(self.opened, self.selection, path)
        if FRAME in self.edits.current:
            pipeline = PipelineText(text, path, Catalog.discover(self.opened.plugins))
            pipeline.view("page", {"frame": int(self.edits.current[FRAME])})
            text = pipeline.text
        return text, editing.difference(before, text, path.name), hashlib.sha256(before.encode()).hexdigest()

    def save(self, name: object, digest: str) -> str:
        """Write the file and return its text; `digest` identifies the contents of the opened file that it replaces."""
        path = self._path(name)
        text, _, found = self.draft(name)
        if path != self._own and path not in self._written:
            write_new(path, text)
            self._written.add(path)
        elif digest != found:
            raise UsageError(Problem("RG531", f"'{path.name}' has changed on disk; look at the difference first"))
        else:
            before = _read(path)
            replace_text(path, text)
            if path == self._own:
                self._disk, self.edits = text, self.edits.save(before, text, {})
        self._saved = self.edits.state
        return text

    def keep(self) -> Path | None:
        """Write unsaved changes into a separate file, and return it; None if there are none."""
        if not self.is_changed:
            return None
        stem = Path(self.opened.label).stem
        names = (f"{stem}-unsaved{number or ''}.yaml" for number in itertools.count())
        path = next(path for path in map(self.folder.joinpath, names) if not path.exists())
        try:
            text = editing.variant(self.opened, self.selection, path)
        except RendergraphError:
            text = editing.unlinked(self.opened, self.selection)
        write_new(path, text)
        return path

    def _path(self, name: object) -> Path:
        if self._own is not None and name == self._own.name:
            return self._own
        if not isinstance(name, str) or not _FILE.fullmatch(name):
            text = "variants are saved in the folder where `view` was started; expected a plain name"
            raise UsageError(Problem("RG500", f"{text}, as in variant.yaml"))
        path = self.folder / name
        if path not in self._written and (path.exists() or path.is_symlink()):
            raise UsageError(Problem("RG531", f"'{name}' exists; choose another name"))
        return path

    # --- messages ----------------------------------------------------------------------------------------------------

    def apply(self, message: messages.PageMessage) -> bool:
        """Handle a message of a page, and return whether another picture is needed."""
        match message:
            case messages.SetMessage(path, value, again):
                self.edits = self.edits.set(path, value, again=again)
            case messages.DropMessage(path):
                self._go_to(self.edits.drop(path))
            case messages.UndoMessage():
                self._go_to(self.edits.undo())
            case messages.RedoMessage():
                self._go_to(self.edits.redo())
            case messages.ReloadMessage():
                self.edits = self.edits.write(None, {p: v for p, v in self.edits.current.items() if p == CAMERA})
                self._saved = None, {}
            case messages.CameraMessage():
                self._move(message)
            case messages.LookMessage(port, exposure):
                self.port = self.port if port is None else port
                self.exposure = self.exposure if exposure is None else min(max(exposure, -24.0), 24.0)
                words = {"channel": message.channel, "scale": message.scale}
                limits = {"low": message.low, "high": message.high}
                changed: dict[str, Any] = {key: word for key, word in words.items() if word is not None}
                changed |= {key: limit for key, limit in limits.items() if limit is not UNSET}
                self.look = replace(self.look, **changed)
            case messages.FrameMessage(number):
                self.frame = min(max(number, 1), MOST_FRAMES)
                self._keep_frame()
            case messages.PlayMessage(on):
                self.playing = on
                if not on:
                    self._keep_frame()
            case messages.ViewMessage(name):
                self._look_through(name)
            case messages.KeepViewMessage(name):
                seen, environment = self._last_camera, self.selection.environment
                camera = self.selection.camera or (camera_words(seen) if seen else None)
                frame = self.frame if self.frame > 1 else None
                values = {"camera": camera, "frame": frame, "environment": environment and str(environment)}
                self.edit([["view", name, {key: value for key, value in values.items() if value is not None}]])
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
                shipped = replace(self.opened, source=name, sets=(), patches=())
                self._compare_with(name, selection or shipped)
        return True

    def _go_to(self, edits: Edits) -> None:
        if edits.current.get(FRAME) != self.edits.current.get(FRAME):
            self.frame = int(edits.current.get(FRAME, 1))
        self.edits = edits

    def _keep_frame(self) -> None:
        """Make the frame an edit; consecutive changes are one undo step."""
        if self.frame != int(self.edits.current.get(FRAME, 1)):
            self.edits = self.edits.set(FRAME, self.frame, again=self.edits.differs_by(FRAME))

    def _look_through(self, name: str) -> None:
        chosen = stages.view_of(stages.resolve(self.selection).spec, name)
        others = _without(self.edits.current, CAMERA, FRAME, ENVIRONMENT)
        self.camera, self.frame = None, int(chosen.get("frame", 1))
        self.edits = self.edits.write(self.edits.text, others | {path: str(value) for path, value in chosen.items()})

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
        """Make a moved camera an edit, once nothing is being dragged, so that it can be undone, saved and copied."""
        if self.camera is not None and not self.held:
            self.edits = self.edits.set(CAMERA, camera_words(self.camera))
            self.camera = None

    def _compare_with(self, name: str, selection: Selection) -> None:
        """Add a selection to compare with, replacing the oldest if there are too many."""
        if name not in self._others and len(self._others) == MOST_COMPARED:
            del self._others[list(self._others)[1]]  # the first is the file as it was opened
        self._others[name] = selection
        self._other = name


def _without(settings: Mapping[str, str], *paths: str) -> dict[str, str]:
    return {path: value for path, value in settings.items() if path not in paths}


def _read(path: Path) -> str:
    try:
        return path.read_text("utf-8-sig", "replace")
    except OSError:  # it was deleted; saving creates it again
        return ""


def write_new(path: Path, text: str) -> None:
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise UsageError(Problem("RG504", f"cannot be written: {error.strerror or error}", Place(path.name))) from None
