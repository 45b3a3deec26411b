"""Films: frames as MP4, WebP or GIF, encoded by the ffmpeg of imageio-ffmpeg."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rendergraph.errors import Place, Problem, RenderError, UsageError, suggestion
from rendergraph.images.files import flush
from rendergraph.images.saving import check_target
from rendergraph.installed import require

_EVEN = "pad=ceil(iw/2)*2:ceil(ih/2)*2"
_PALETTE = "split[a][b];[a]palettegen=stats_mode=full[p];[b][p]paletteuse=dither=sierra2_4a"
ENDINGS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    ".mp4": ("libx264", "yuv420p", ("-vf", _EVEN, "-crf", "18", "-f", "mp4")),
    ".webp": ("libwebp_anim", "yuva420p", ("-quality", "90", "-loop", "0", "-f", "webp")),
    ".gif": ("gif", "pal8", ("-filter_complex", _PALETTE, "-loop", "0", "-f", "gif")),
}
"""The codec of each kind of film, its pixel format, and further options of ffmpeg.

Every player supports H.264 with 4:2:0 chroma; odd sides are padded by a black row or column. The others loop forever; a
GIF has its own palette of 256 colours.
"""


def is_film(path: Path) -> bool:
    return path.suffix.lower() in ENDINGS


def check_film(path: Path) -> Path:
    """Return the path of a film; raise if such a film cannot be written."""
    if not is_film(path):
        hint = suggestion(path.suffix, ENDINGS)
        raise UsageError(Problem("RG501", f"'{path.suffix}' films are not written{hint}"))
    require(f"{path.suffix} (a film)", "video", "imageio_ffmpeg")
    check_target(path)
    return path


@contextmanager
def films(paths: Iterable[Path], fps: float, first: int) -> Iterator[dict[Path, Film]]:
    """Open films that are complete if the block succeeds, and leave nothing behind if it fails."""
    opened = {path: Film(path, fps, first) for path in paths}
    try:
        yield opened
        for film in opened.values():
            film.close()
    finally:
        for film in opened.values():
            film.drop()


class Film:
    """A film whose frames are added in any order; the file appears when complete. The extension sets the format."""

    def __init__(self, path: Path, fps: float, first: int) -> None:
        """Prepare a film of `fps` frames per second that begins with frame number `first`."""
        self.path = path
        self._fps, self._next = fps, first
        self._early: dict[int, npt.NDArray[Any]] = {}
        target = Path(os.path.realpath(path))
        self._part = target.with_name(f".{target.name[:100]}.{os.urandom(4).hex()}.part")
        self._writer: Any = None

    def add(self, number: int, pixels: npt.NDArray[Any]) -> None:
        """Add one frame, uint8 of shape (height, width, 3 or more)."""
        self._early[number] = pixels
        while self._next in self._early:
            self._write(np.ascontiguousarray(self._early.pop(self._next)[..., :3]))
            self._next += 1

    def _write(self, pixels: npt.NDArray[Any]) -> None:
        if self._writer is None:
            imageio_ffmpeg: Any = import_module("imageio_ffmpeg")  # an optional package with few types

            codec, pixel_format, more = ENDINGS[self.path.suffix.lower()]
            self._writer = imageio_ffmpeg.write_frames(
                str(self._part),
                pixels.shape[1::-1],  # width and height
                fps=self._fps,
                codec=codec,
                pix_fmt_out=pixel_format,
                macro_block_size=1,
                quality=None,  # its default would overrule what `more` says
                output_params=list(more),
                ffmpeg_log_level="error",
            )
            self._writer.send(None)
        try:
            self._writer.send(pixels)
        except (OSError, StopIteration) as error:
            raise self._failed(error) from error

    def close(self) -> None:
        try:
            if self._writer is not None:
                self._writer.close()
                self._writer = None
            flush(self._part)
            os.replace(self._part, os.path.realpath(self.path))
        except (OSError, RuntimeError) as error:
            raise self._failed(error) from error

    def drop(self) -> None:
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()
        self._part.unlink(missing_ok=True)

    def _failed(self, error: Exception) -> RenderError:
        reason = " ".join(str(error).split())[:200] or "the encoder ended"
        return RenderError(Problem("RG507", f"the film cannot be written: {reason}", Place(str(self.path))))
