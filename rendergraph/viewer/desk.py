"""What everybody who looks at the page sees and changes: one state, whoever sends the message.

`Desk.said` takes a message of a page; `Desk.question` is what the render process is to be asked for it; `Desk.answered`
takes the answer. None of them waits for anything.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from msgspec import structs

from rendergraph.errors import Problem, RendergraphError, UsageError
from rendergraph.resources import shipped_pipelines
from rendergraph.scene.model import Camera
from rendergraph.session.selection import Selection
from rendergraph.viewer import camera as moving
from rendergraph.viewer.edits import Edits
from rendergraph.viewer.questions import Answer, Ask

JsonObject = Mapping[str, Any]

_PATH = re.compile(r"[A-Za-z0-9_/-]+(\.[A-Za-z0-9_]+)?")
_PORT = re.compile(r"[A-Za-z0-9_/.@,=\[\]:-]*")
_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
_FILE = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*\.ya?ml")
LONGEST = 20_000
"""Characters of a value."""
MOST_OTHERS = 50
"""Snapshots and pipelines that are kept to compare with."""


@dataclass
class Desk:
    """The state that the page shows.

    Attributes:
        opened: what the command line named.
        folder: where variants are saved.
        edits: what was changed since.
        camera: the camera that was moved by hand, None for the scene's own.
        frame, fps, playing: the moment that is drawn, and whether it goes on by itself.
        port, stops: what is looked at, and its exposure.
        held: something is being dragged: speed before quality.
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
    stops: float = 0.0
    held: bool = False
    revision: int = 0

    def __post_init__(self) -> None:
        self._selected = self.opened
        self._seen: Camera | None = None  # what the last picture was taken with
        self._sphere: moving.Sphere = ((0.0, 0.0, 0.0), 1.0)
        self._others: dict[str, Selection] = {"as opened": self.opened}
        self._other: str | None = None
        self._snapshots = 0
        if self.against is not None:
            self._others[self.against[0]] = self.against[1]
            self._other = self.against[0]

    @property
    def selection(self) -> Selection:
        """The pipeline with everything that was changed."""
        return structs.replace(self._selected, sets=(*self.opened.sets, *self.edits.sets))

    @property
    def other(self) -> Selection | None:
        """What the picture is compared with, None for nothing."""
        return self._others[self._other] if self._other is not None else None

    def question(self) -> Ask:
        """The picture that is wanted now."""
        still = not (self.held or self.playing)
        return Ask(
            self.selection, self.camera, self.frame, self.fps, self.port, self.stops, still=still, known=self.revision
        )

    def state(self) -> dict[str, Any]:
        """What the page shows of it, as plain JSON values."""
        return {
            "edits": dict(self.edits.now),
            "flags": list(self.edits.sets),
            "can_undo": bool(self.edits.before),
            "can_redo": bool(self.edits.after),
            "frame": self.frame,
            "playing": self.playing,
            "port": self.port,
            "stops": self.stops,
            "camera": self._selected.camera,
            "moved": self.camera is not None,
            "others": list(self._others),
            "other": self._other,
            "pipelines": list(shipped_pipelines()),
        }

    def answered(self, answer: Answer) -> None:
        """Take note of what a picture was taken with."""
        if answer.camera is not None:
            self._seen = answer.camera
        if answer.sphere is not None:
            self._sphere = answer.sphere
        self.revision = int(answer.facts.get("revision", self.revision))

    def file(self, name: object) -> Path:
        """Where a variant of that name is saved.

        Raises:
            UsageError: it is no plain name of a YAML file, or there is such a file.
        """
        if not isinstance(name, str) or not _FILE.fullmatch(name):
            text = "a variant is saved beside where `view` was started; its name is a plain one, as in variant.yaml"
            raise UsageError(Problem("RG500", text))
        path = self.folder / name
        if path.exists() or path.is_symlink():
            raise UsageError(Problem("RG531", f"'{name}' exists; choose another name"))
        return path

    # --- messages ----------------------------------------------------------------------------------------------------

    def said(self, message: JsonObject) -> bool:
        """Do what a page says.

        Returns:
            Whether another picture is wanted.

        Raises:
            UsageError: it is nothing that a page may say.
        """
        act = self._acts().get(str(message.get("do")))
        if act is None:
            raise UsageError(Problem("RG500", "the page asked for something that there is not"))
        try:
            return act(message) is not False
        except (KeyError, TypeError, ValueError) as error:
            raise UsageError(Problem("RG500", f"the page said something malformed: {error}")) from None

    def _acts(self) -> dict[str, Callable[[JsonObject], bool | None]]:
        return {
            "set": self._set,
            "drop": self._drop,
            "undo": self._undo,
            "redo": self._redo,
            "camera": self._move,
            "look": self._look,
            "frame": self._frame,
            "play": self._play,
            "hold": self._hold,
            "remember": self._remember,
            "compare": self._compare,
        }

    def _set(self, message: JsonObject) -> None:
        path, value = message["path"], message["value"]
        if not _PATH.fullmatch(path):
            raise ValueError("a path is NODE.NAME")
        if len(repr(value)) > LONGEST:
            raise ValueError("the value is too long")
        if path.endswith(".type") and not (isinstance(value, str) and _WORD.fullmatch(value)):
            raise ValueError("a type is the name of one; a file's path is written into the pipeline")  # and no page's
        self.edits = self.edits.set(path, value, again=bool(message.get("again")))

    def _drop(self, message: JsonObject) -> None:
        self.edits = self.edits.dropped(message["path"])

    def _undo(self, message: JsonObject) -> None:
        self.edits = self.edits.undone()

    def _redo(self, message: JsonObject) -> None:
        self.edits = self.edits.redone()

    def _move(self, message: JsonObject) -> None:
        if "name" in message:
            name = message["name"]
            if name is not None and not isinstance(name, str):
                raise ValueError("a camera has a name")
            self._selected, self.camera = structs.replace(self._selected, camera=name), None
            return
        now = self.camera or self._seen
        if now is None:
            return
        moves: dict[str, tuple[Callable[..., Camera], int]] = {
            "orbit": (moving.orbited, 2),
            "pan": (moving.panned, 2),
            "zoom": (moving.zoomed, 1),
            "fly": (moving.flown, 3),
            "frame": (moving.framed, 0),
        }
        for name, (move, count) in moves.items():
            if name in message:
                amounts = [_finite(amount) for amount in message[name]]
                if len(amounts) != count or (name == "zoom" and not 1e-3 < amounts[0] < 1e3):
                    raise ValueError(f"{name} takes {count} numbers")
                now = move(now, self._sphere, *amounts)
        self.camera = now

    def _look(self, message: JsonObject) -> None:
        port, stops = message.get("port", self.port), _finite(message.get("stops", self.stops))
        if len(port) > 200 or not _PORT.fullmatch(port):
            raise ValueError("a port is NODE.PORT")
        self.port, self.stops = port, min(max(stops, -24.0), 24.0)

    def _frame(self, message: JsonObject) -> None:
        self.frame = min(max(int(message["number"]), 1), 1_000_000)

    def _play(self, message: JsonObject) -> None:
        self.playing = bool(message["on"])

    def _hold(self, message: JsonObject) -> bool:
        before, self.held = self.held, bool(message["on"])
        return before and not self.held  # what was left is drawn once more, as it should be

    def _remember(self, message: JsonObject) -> bool:
        self._snapshots += 1
        self._keep(f"snapshot {self._snapshots}", self.selection)
        return True

    def _compare(self, message: JsonObject) -> bool:
        name = message["name"]
        if name is not None and name not in self._others:
            if name not in shipped_pipelines():
                raise ValueError("it is compared with a shipped pipeline, a snapshot, or what was named with --against")
            self._keep(name, structs.replace(self.opened, source=name, sets=(), patches=()))
        self._other = name
        return True

    def _keep(self, name: str, selection: Selection) -> None:
        """Something more to compare with, in place of the oldest where there are many."""
        if len(self._others) == MOST_OTHERS:
            del self._others[list(self._others)[1]]  # the first is the file as it was opened
        self._others[name] = selection
        self._other = name


def _finite(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError("a number is not finite")
    return number


def as_problems(error: RendergraphError) -> list[dict[str, Any]]:
    """What went wrong outside of the render process, as the page has it."""
    return [problem.as_json() | {"node": None} for problem in error.problems]
