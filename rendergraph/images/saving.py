"""Which output goes into which file, and what of it: one answer for the command line, Python and notebooks."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from rendergraph.errors import InputError, Place, Problem, UsageError, suggestion
from rendergraph.images.encode import EXTENSIONS, Job, write_all
from rendergraph.images.view import viewable
from rendergraph.textures import FORMATS

Pixels: TypeAlias = npt.NDArray[Any]


@dataclass(frozen=True)
class PictureInfo:
    """What an array's values are.

    Attributes:
        semantic: name of the semantic, `any` where unknown.
        format: the texture's format, a name in `textures.FORMATS`, empty where unknown.
        encoding: `display` for sRGB-encoded colours, `linear` for linear ones, else None.
    """

    semantic: str = "any"
    format: str = ""
    encoding: Literal["linear", "display"] | None = None

    @property
    def half(self) -> bool:
        """Whether half floats hold every value of the format."""
        return self.format in ("r16f", "rg16f", "rgba16f", "r11f_g11f_b10f")

    def channels(self, count: int) -> tuple[str, ...]:
        """The names of `count` channels in an EXR file."""
        known = FORMATS.get(self.format)
        if count == 1:
            is_depth = (known is not None and known.is_depth) or self.semantic in ("depth", "linear_depth")
            return ("Z",) if is_depth else ("Y",)
        return ("R", "G", "B", "A")[:count]


class Saved(NamedTuple):
    """One file to save.

    Attributes:
        path: where to; the extension chooses the format.
        pixels: (height, width), (height, width, channels) or (layers, height, width, channels), top row first.
        info: what the values are.
        raw: a tap: EXR and HDR keep the values, also of display colours.
    """

    path: Path
    pixels: Pixels
    info: PictureInfo
    raw: bool = False


def save_output(
    path: Path | str, pixels: Pixels, info: PictureInfo, metadata: Mapping[str, str], *, raw: bool = False
) -> None:
    """One output or tap as a file: see `save_outputs`."""
    save_outputs([Saved(Path(path), pixels, info, raw)], metadata)


def save_outputs(files: Sequence[Saved], metadata: Mapping[str, str]) -> None:
    """Outputs and taps as files that appear together.

    PNG and JPEG are made viewable. EXR and HDR hold linear light, so display colours are decoded; a tap's values are
    kept as they are.

    Raises:
        UsageError: an unknown extension.
        InputError: a format cannot hold the texture.
        RenderError: the disk or the folder does not take it.
    """
    jobs: list[Job] = []
    for path, pixels, info, raw in files:
        if EXTENSIONS[extension(path)] in ("png", "jpeg"):
            jobs.append((path, viewable(pixels, info.semantic), None, "data", False))
            continue
        shaped = pixels[..., np.newaxis] if pixels.ndim == 2 else pixels
        decoded = not raw and info.encoding == "display"
        half = decoded or info.half or pixels.dtype == np.float16
        jobs.append((path, shaped, info.channels(shaped.shape[-1]), "display" if decoded else "data", half))
    write_all(jobs, metadata)


def extension(path: Path) -> str:
    """A file's extension in lower case.

    Raises:
        UsageError: pictures of that kind are not written.
    """
    found = path.suffix.lower()
    if found in EXTENSIONS:
        return found
    what = f"'{path.suffix}' files are not written" if found else f"'{path}' has no extension to choose the format by"
    raise UsageError(Problem("RG501", f"{what}{suggestion(found, EXTENSIONS)}"))


def output_for(path: Path, outputs: Collection[str]) -> str:
    """The output a file takes that names none: by its extension `image` or `radiance`.

    Args:
        path: the file.
        outputs: the pipeline's outputs.

    Raises:
        UsageError: an unknown extension.
        InputError: the pipeline has no such output; an HDR format is content with `image`, which is decoded.
    """
    wanted = ("image",) if EXTENSIONS[extension(path)] in ("png", "jpeg") else ("radiance", "image")
    for name in wanted:
        if name in outputs:
            return name
    known = sorted(outputs)
    if not known:
        raise InputError(Problem("RG505", f"'{path}' takes the output '{wanted[0]}', but the pipeline has no outputs"))
    text = f"'{path}' takes the output '{wanted[0]}', which the pipeline lacks; name one: -o {known[0]}={path}"
    text += f" (there is {', '.join(known)})" if len(known) > 1 else ""
    raise InputError(Problem("RG505", text))


_HASHES = re.compile(r"#{2,}")


def is_numbered(path: Path) -> bool:
    """Whether a file name has a place for the frame's number: two `#` or more in a row."""
    return bool(_HASHES.search(path.name))


def numbered(path: Path, frame: int) -> Path:
    """The file of one frame: `a.####.png` becomes `a.0012.png`."""
    return path.with_name(_HASHES.sub(lambda match: f"{frame:0{len(match[0])}d}", path.name))


def check_target(path: Path) -> None:
    """Says before rendering that a file cannot be written.

    Raises:
        InputError: the folder is missing or cannot be written to, or something that is no file is in the way.
    """
    target = Path(os.path.realpath(path))
    folder, shown = target.parent, path.parent
    if not folder.is_dir():
        reason = f"there is no folder '{shown}'" if not folder.exists() else f"'{shown}' is no folder"
    elif target.is_dir():
        reason = "it is a folder"
    elif target.exists() and not target.is_file():
        reason = "it is not a regular file"
    elif not os.access(folder, os.W_OK | os.X_OK):
        reason = f"the folder '{shown}' cannot be written to"
    else:
        return
    raise InputError(Problem("RG504", f"cannot be written: {reason}", Place(str(path))))
