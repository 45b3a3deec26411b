"""Write picture files."""

from __future__ import annotations

import contextlib
import shutil
import struct
import warnings
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from rendergraph import system
from rendergraph.errors import InputError, Place, Problem
from rendergraph.images.files import failed, staged
from rendergraph.images.viewable import from_srgb, to_bytes, to_srgb
from rendergraph.scene.image_files import is_text

Pixels: TypeAlias = npt.NDArray[Any]
Encoding: TypeAlias = Literal["linear", "display", "data"]

EXTENSIONS: dict[str, str] = {".png": "png", ".jpg": "jpeg", ".jpeg": "jpeg", ".exr": "openexr", ".hdr": "hdr"}
"""Extension, in lower case, to OpenImageIO's name of the format."""
HALF_MAX = 65504.0
REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""Chromaticities x and y of red, green, blue and white (ITU-R BT.709), stored in EXR files of light."""
PREFIX = "rendergraph:"

_NAMES = {1: ("Y",), 2: ("R", "G"), 3: ("R", "G", "B"), 4: ("R", "G", "B", "A")}
_EXACT_INTEGER = 1 << 24
# OpenEXR stores the time of writing, but equal pictures must give equal files.
_NO_DATE = "1970:01:01 00:00:00"
_PNG_COLOR_TYPES = {1: 0, 3: 2, 4: 6}
"""Grey, RGB and RGBA by their number of channels (PNG specification, 11.2.1)."""
_PNG_LEFT = 1
"""The PNG filter Sub, difference to the left; choosing a filter per row costs more than it saves."""
_PNG_LEVEL = 4


def write(
    path: Path | str,
    pixels: Pixels,
    *,
    channels: Sequence[str] | None = None,
    encoding: Encoding = "data",
    metadata: Mapping[str, str] | None = None,
    half: bool = False,
) -> None:
    """Write one picture atomically; the extension chooses the format.

    PNG and JPEG hold 8 bits: floats are clipped to 0…1 and rounded, after the sRGB curve if they are `linear`. EXR and
    HDR hold linear light: `display` values are decoded first. `data` is always written unchanged.

    Args:
        pixels: (height, width), (height, width, channels) or (layers, height, width, channels), top row first.
        channels: names for EXR; by default `Y`, `R,G`, `R,G,B` or `R,G,B,A`. Layers prepend `000.` and so on.
        encoding: the encoding of the values.
        metadata: texts stored in EXR and PNG files; `read_metadata` returns them.
        half: 16-bit floats in EXR; values beyond ±65504 become that.
    """
    write_all([(Path(path), pixels, channels, encoding, half)], metadata or {})


Job: TypeAlias = "tuple[Path, Pixels, Sequence[str] | None, Encoding, bool]"


def write_all(jobs: Sequence[Job], metadata: Mapping[str, str]) -> None:
    """Write several pictures atomically; each job has the arguments of `write`."""
    with staged([job[0] for job in jobs]) as parts:
        for part, job in zip(parts, jobs, strict=True):
            _write_job(job, part, metadata)


def picture_bytes(job: Job, metadata: Mapping[str, str]) -> bytes:
    """Return the bytes of the file that `write_all` would write; nothing is left behind if the process is killed."""
    with system.memory_file() as (path, file):
        _write_job(job, Path(path), metadata)
        return file.read()


def _write_job(job: Job, part: Path, metadata: Mapping[str, str]) -> None:
    path, pixels, channels, encoding, half = job
    shaped = pixels[..., np.newaxis] if pixels.ndim == 2 else pixels
    if EXTENSIONS[path.suffix.lower()] in ("png", "jpeg"):
        shaped, names, kind = _eight_bits(path, shaped, encoding), None, "uint8"
    else:
        names = tuple(channels or _NAMES[shaped.shape[-1]])
        shaped = _values(path, shaped)
        if encoding == "display":
            shaped = np.concatenate([from_srgb(shaped[..., :3]), shaped[..., 3:]], axis=-1)
        kind = "half" if half else "float"
        if path.suffix.lower() == ".hdr":
            shaped, names, kind = _radiance(path, shaped), None, "float"
        elif shaped.ndim == 4:
            names = tuple(f"{layer:03d}.{name}" for layer in range(len(shaped)) for name in names)
            shaped = np.moveaxis(shaped, 0, 2).reshape(*shaped.shape[1:3], -1)
    try:
        _write_file(job, part, shaped, names, kind, metadata)
    except OSError as error:
        raise failed(path, error.strerror or str(error)) from error


def _eight_bits(path: Path, pixels: Pixels, encoding: Encoding) -> Pixels:
    count = pixels.shape[-1]
    if pixels.ndim != 3 or count == 2:
        what = "layers" if pixels.ndim != 3 else "two channels"
        raise _error(path, f"{what} do not fit a {path.suffix[1:].upper()} picture; write an EXR")
    if encoding == "linear" and pixels.dtype != np.uint8:
        colors = to_bytes(to_srgb(np.nan_to_num(pixels[..., :3], nan=0.0, posinf=1.0, neginf=0.0)))
        pixels = np.concatenate([colors, to_bytes(pixels[..., 3:])], axis=-1)
    return to_bytes(pixels[..., :3] if count == 4 and EXTENSIONS[path.suffix.lower()] == "jpeg" else pixels)


def _values(path: Path, pixels: Pixels) -> Pixels:
    if np.issubdtype(pixels.dtype, np.floating):
        return pixels
    if pixels.size and max(int(pixels.max()), -int(pixels.min())) > _EXACT_INTEGER:
        raise _error(path, f"integers above {_EXACT_INTEGER} (24 bits) cannot be stored in a picture")
    # 8-bit arrays are colours, still to be divided by 255; wider integers are numbers.
    return pixels.astype(np.float32) / (255 if pixels.dtype == np.uint8 else 1)


def _radiance(path: Path, pixels: Pixels) -> Pixels:
    """Return three channels without negative values, as the Radiance format stores."""
    if pixels.ndim == 4:
        raise _error(path, "layers do not fit an HDR picture; write an EXR")
    if pixels.shape[-1] == 1:
        pixels = np.repeat(pixels, 3, axis=-1)
    elif pixels.shape[-1] == 2:
        pixels = np.concatenate([pixels, np.zeros_like(pixels[..., :1])], axis=-1)
    return np.nan_to_num(np.maximum(pixels[..., :3].astype(np.float32), 0), nan=0.0, posinf=1e38)


def _error(path: Path, reason: str) -> InputError:
    return InputError(Problem("RG508", reason, Place(str(path))))


def _write_file(
    job: Job, part: Path, pixels: Pixels, names: Sequence[str] | None, kind: str, metadata: Mapping[str, str]
) -> None:
    path, _, _, encoding, _ = job
    texts = {key if key.startswith(PREFIX) else PREFIX + key: text for key, text in metadata.items()}
    if kind == "uint8" and path.suffix.lower() == ".png":
        with open(part, "wb") as file:
            file.writelines(_png(pixels, texts))
        return
    import OpenImageIO as oiio  # loaded with the first picture that is not a PNG

    height, width, count = pixels.shape
    spec = oiio.ImageSpec(width, height, count, kind)
    if names:
        spec.channelnames = tuple(names)
    if path.suffix.lower() == ".exr":
        spec.attribute("compression", "zip")
        spec.attribute("DateTime", _NO_DATE)
        if encoding != "data" and names and "R" in names[0]:
            spec.attribute("chromaticities", oiio.TypeDesc("float[8]"), REC709)
    elif EXTENSIONS[path.suffix.lower()] == "jpeg":
        spec.attribute("Compression", "jpeg:95")
        spec.attribute("jpeg:subsampling", "4:4:4")
    for key, text in texts.items():
        spec.attribute(key, text)
    if kind == "half":
        finite = np.isfinite(pixels)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            pixels = np.where(finite, np.clip(pixels, -HALF_MAX, HALF_MAX), pixels).astype(np.float16)
    elif kind == "float":
        pixels = pixels.astype(np.float32)
    with _safe_place(path, part) as place:
        out = oiio.ImageOutput.create(EXTENSIONS[path.suffix.lower()])
        done = out is not None and out.open(place, spec) and out.write_image(np.ascontiguousarray(pixels))
        done = out is not None and out.close() and done
        if not done:
            reason = ((out and out.geterror()) or oiio.geterror() or "the disk may be full").splitlines()[0]
            raise failed(path, reason.replace(place, path.name))


@contextlib.contextmanager
def _safe_place(path: Path, part: Path) -> Iterator[str]:
    """Yield a path for OpenImageIO.

    On a full disk, the Radiance writer reports success and libjpeg ends the process, so these write to memory first;
    OpenEXR reports the failure. A picture whose name is not text is also written to memory.
    """
    if path.suffix.lower() == ".exr" and is_text(str(part)):
        yield str(part)
        return
    with system.memory_file() as (name, source):
        yield name
        with open(part, "wb") as target:
            shutil.copyfileobj(source, target, 1 << 20)


def _png(pixels: npt.NDArray[np.uint8], texts: Mapping[str, str]) -> Iterator[bytes]:
    """Yield the parts of a PNG file, in half the time of OpenImageIO, of sRGB pixels (height, width, 1, 3 or 4)."""
    height, width, count = pixels.shape
    yield b"\x89PNG\r\n\x1a\n"
    yield _png_chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, _PNG_COLOR_TYPES[count], 0, 0, 0))
    yield _png_chunk(b"sRGB", b"\0")
    for keyword, text in texts.items():
        yield _png_chunk(b"iTXt", keyword.encode("ascii") + b"\0\0\0\0\0" + text.encode())
    rows = _png_filtered(pixels.reshape(height, width * count), count)
    yield _png_chunk(b"IDAT", zlib.compress(rows.data, _PNG_LEVEL))
    yield _png_chunk(b"IEND", b"")


def _png_filtered(rows: npt.NDArray[np.uint8], count: int) -> npt.NDArray[np.uint8]:
    filtered = np.empty((rows.shape[0], rows.shape[1] + 1), np.uint8)
    filtered[:, 0] = _PNG_LEFT
    filtered[:, 1 : count + 1] = rows[:, :count]
    np.subtract(rows[:, count:], rows[:, :-count], out=filtered[:, count + 1 :])
    return filtered


def _png_chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(data, zlib.crc32(kind)))
