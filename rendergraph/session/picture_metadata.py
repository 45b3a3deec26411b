"""How a picture was made: metadata that is written into it and read back, so that a picture can stand for its pipeline.

A picture is as untrusted as a pipeline file: its paths are resolved as if that file were in the current folder.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from msgspec import Struct

from rendergraph.errors import InputError, Place, Problem, shown_file
from rendergraph.pipelines.environments import SHIPPED
from rendergraph.resources import shipped_pipelines
from rendergraph.session.selection import MOST_SUBFRAMES
from rendergraph.stamps import record_read

if TYPE_CHECKING:
    from rendergraph.document import Document, YamlLimits
    from rendergraph.session.values import Expanded, Linked

PICTURES = frozenset({".png", ".jpg", ".jpeg", ".exr", ".hdr", ".bmp", ".tga"})
"""Extensions of pictures, which distinguish them from pipelines."""
ENVIRONMENT_NAMES = frozenset({"none", *SHIPPED})
"""Values of `--environment` that are not files."""
_MOST_FRAMES = 10**9


def is_picture(name: object) -> bool:
    """Return whether the extension is that of a picture."""
    if not isinstance(name, str | Path) or "\n" in str(name):
        return False
    return Path(name).suffix.lower() in PICTURES


def pipeline_metadata(linked: Linked) -> dict[str, str]:
    """Return the metadata of all pictures of a pipeline."""
    selection, path = linked.selection, linked.spec.path
    fields = {
        "pipeline": linked.spec.to_yaml(origins=False),
        "folder": None if path is None or path in shipped_pipelines().values() else _inside(path.parent),
        **selection.view_fields,
    }
    if selection.environment is not None:
        name = str(selection.environment)
        fields["environment"] = name if name in ENVIRONMENT_NAMES else shown_file(selection.environment.absolute())
    return {f"rendergraph:{name}": text for name, text in fields.items() if text is not None}


def frame_metadata(frame: int, fps: float, subframes: int = 1) -> dict[str, str]:
    """Return the metadata of one frame; the first frame has none unless it is a mean of moments."""
    found = {"rendergraph:subframes": str(subframes)} if subframes > 1 else {}
    return found | ({"rendergraph:frame": str(frame), "rendergraph:fps": f"{fps:g}"} if frame > 1 or found else {})


def turntable_metadata(expanded: Expanded) -> dict[str, str]:
    """Return the metadata of a turntable: its frames, and the camera that it began with, if one was chosen."""
    turned, begun = expanded.options.turntable, expanded.linked.selection.camera
    if turned is None:
        return {}
    return {"rendergraph:turntable": f"{turned[0]}-{turned[-1]}" + (f" from {begun}" if begun else "")}


def _inside(folder: Path) -> str | None:
    """Return a folder relative to the current one; None if it lies elsewhere or is the current one."""
    try:
        text = folder.resolve().relative_to(Path.cwd().resolve()).as_posix()
    except (ValueError, OSError):
        return None
    return None if text == "." else text


class PictureMetadata(Struct, frozen=True):
    """How a picture was made: its pipeline; what was chosen beside it, by field of `Selection`; its frame."""

    document: Document
    view: dict[str, Any]
    frame: int
    fps: float
    subframes: int = 1


def metadata(path: Path) -> dict[str, str]:
    """Return the metadata of a picture by name, at least `pipeline`; InputError if it has none."""
    from rendergraph.images import read_metadata  # most pipelines are files

    record_read(path)
    fields = read_metadata(path)
    if "pipeline" not in fields:
        text = "the picture has no pipeline in its metadata; EXR and PNG files written by rendergraph have one"
        raise InputError(Problem("RG510", text, Place(str(path))))
    return fields


def read_picture_metadata(path: Path, limits: YamlLimits) -> PictureMetadata:
    """Return how a picture was made; InputError if it does not say so."""
    from rendergraph.read import read  # see above

    fields = metadata(path)
    home = PurePosixPath(fields.get("folder", ""))
    inside = not home.is_absolute() and ".." not in home.parts
    document = read(
        Path(home if inside else "") / path.name, fields["pipeline"], limits, name=str(path), keep_going=True
    )
    return PictureMetadata(
        document,
        {name: kind(fields[name]) for name, kind in _VIEW.items() if name in fields},
        _whole(fields, "frame", _MOST_FRAMES),
        _fps(fields),
        _whole(fields, "subframes", MOST_SUBFRAMES + 1),
    )


def _whole(fields: Mapping[str, str], name: str, most: int) -> int:
    text = fields.get(name, "")
    number = int(text) if re.fullmatch(r"[0-9]{1,10}", text) else 1
    return number if 1 <= number < most else 1


def _fps(fields: Mapping[str, str]) -> float:
    try:
        number = float(fields.get("fps", ""))
    except ValueError:
        return 30.0
    return number if math.isfinite(number) and number > 0 else 30.0


def _share(text: str) -> float | None:
    return float(text) if re.fullmatch(r"0(\.[0-9]{1,20})?|1(\.0)?", text) else None


_VIEW: Mapping[str, Any] = {"camera": str, "environment": Path, "variant": str, "ground": bool, "shutter": _share}
