"""How a picture was made: what is written into it, and read back, so that a picture's name stands for its pipeline.

A picture is untrusted as a pipeline file is: its paths are read as if that file stood in the current folder.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from msgspec import Struct

from rendergraph.errors import InputError, Place, Problem, shown_file
from rendergraph.resources import shipped_pipelines
from rendergraph.stamps import record_read

if TYPE_CHECKING:
    from rendergraph.document import Document, YamlLimits
    from rendergraph.session.values import Linked

PICTURES = frozenset({".png", ".jpg", ".jpeg", ".exr", ".hdr", ".bmp", ".tga"})
"""Extensions that make a name a picture's rather than a pipeline's."""
_MOST_FRAMES = 10**9


def is_picture(name: str | Path) -> bool:
    """Whether a name is a picture's."""
    return Path(name).suffix.lower() in PICTURES


def described(linked: Linked) -> dict[str, str]:
    """What the metadata of all its pictures says of what is drawn."""
    selection, path = linked.selection, linked.spec.path
    found = {
        "pipeline": linked.spec.to_yaml(origins=False),
        "folder": None if path is None or path in shipped_pipelines().values() else _inside(path.parent),
        "camera": selection.camera,
        "environment": None if selection.environment is None else shown_file(selection.environment.absolute()),
    }
    return {f"rendergraph:{name}": text for name, text in found.items() if text is not None}


def at_time(frame: int, fps: float) -> dict[str, str]:
    """What the metadata of one picture says of when it is; the first frame says nothing."""
    return {} if frame == 1 else {"rendergraph:frame": str(frame), "rendergraph:fps": f"{fps:g}"}


def _inside(folder: Path) -> str | None:
    """A folder as it lies in the current one; None elsewhere, and of the current one itself."""
    try:
        text = folder.resolve().relative_to(Path.cwd().resolve()).as_posix()
    except (ValueError, OSError):
        return None
    return None if text == "." else text


class Made(Struct, frozen=True):
    """What a picture says of how it was made.

    Attributes:
        document: its pipeline, resolved.
        camera, environment: what was said beside the file; None where nothing was.
        frame, fps: which frame it shows.
    """

    document: Document
    camera: str | None
    environment: Path | None
    frame: int
    fps: float


def metadata(path: Path) -> dict[str, str]:
    """What a picture says of how it was made, by name: `pipeline` at least.

    Raises:
        InputError: it cannot be read, or does not say.
    """
    from rendergraph.images import read_metadata  # most pipelines are files

    record_read(path)
    said = read_metadata(path)
    if "pipeline" not in said:
        text = "the picture does not say how it was made; EXR and PNG files that rendergraph wrote do"
        raise InputError(Problem("RG510", text, Place(str(path))))
    return said


def made(path: Path, limits: YamlLimits) -> Made:
    """How a picture was made.

    Raises:
        InputError: it cannot be read, or does not say.
    """
    from rendergraph.read import read  # see above

    said = metadata(path)
    home = PurePosixPath(said.get("folder", ""))
    inside = not home.is_absolute() and ".." not in home.parts
    document = read(Path(home if inside else "") / path.name, said["pipeline"], limits, name=str(path), keep_going=True)
    return Made(
        document,
        said.get("camera"),
        Path(said["environment"]) if "environment" in said else None,
        _frame(said),
        _fps(said),
    )


def _frame(said: Mapping[str, str]) -> int:
    text = said.get("frame", "")
    number = int(text) if re.fullmatch(r"[0-9]{1,10}", text) else 1
    return number if 1 <= number < _MOST_FRAMES else 1


def _fps(said: Mapping[str, str]) -> float:
    try:
        number = float(said.get("fps", ""))
    except ValueError:
        return 30.0
    return number if math.isfinite(number) and number > 0 else 30.0
