"""Looks: colour tables in `.cube` files, and everything else that OpenColorIO reads."""

from __future__ import annotations

import re
import textwrap
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from rendergraph.api import InputFile

if TYPE_CHECKING:
    import OpenImageIO as oiio

CONFIGS = (".ocio", ".ocioz")
"""Extensions of OpenColorIO's configurations, whose looks apply to scene-linear light."""
MOST_ENTRIES = 256, 16384
"""Maximum number of entries along each side of a table of colours, and of a curve per channel."""
BAKED_SIDE = 65
DARKEST, RANGE = 2.0**-10, 17
"""Scene-linear values are spaced by log2(value / DARKEST + 1), up to DARKEST · 2^RANGE; as in `look.glsl`."""

Floats = npt.NDArray[np.float32]


class Look(Struct, frozen=True, eq=False):
    """A table of colours.

    Attributes:
        table: float32, (n, n, n, 3) by blue, green and red, or (n, 3), a curve for each channel.
        low, high: colours of the table's first and last entry.
        is_linear: whether it takes and gives scene-linear light in the spacing above, before the tone curve; otherwise
            display-encoded colours after it.
    """

    table: Floats
    low: tuple[float, float, float] = (0.0, 0.0, 0.0)
    high: tuple[float, float, float] = (1.0, 1.0, 1.0)
    is_linear: bool = False

    @property
    def texels(self) -> Floats:
        """The table with an alpha of 1."""
        return np.concatenate([self.table, np.ones((*self.table.shape[:-1], 1), np.float32)], axis=-1)

    @property
    def is_curve(self) -> bool:
        return self.table.ndim == 2


@lru_cache(maxsize=8)
def load_look(file: InputFile, name: str = "") -> Look:
    """Return the look in a file; `name` chooses one of a configuration.

    Raises:
        ValueError: the file is malformed, with its line, or the configuration has no such look.
    """
    suffix = file.path.suffix.lower()
    if suffix in CONFIGS:
        return _of_config(file, name)
    if name:
        raise ValueError(f"'look_name' is for configurations ({', '.join(CONFIGS)}), but '{file.path.name}' is a table")
    return _of_cube(file) if suffix == ".cube" else _of_transform(file)


def _of_cube(file: InputFile) -> Look:
    """Read a table in the format of Adobe's Cube LUT Specification 1.0 (2013)."""
    head: dict[str, tuple[int, list[str]]] = {}
    rows: list[list[str]] = []
    first = 0
    text = file.path.read_text("utf-8", "replace")
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        if words[0][0].isalpha() and words[0].lower() not in ("nan", "inf"):
            if rows:
                raise _wrong(file, number, f"'{words[0][:30]}' comes after the first row of the table")
            if words[0] in head:
                raise _wrong(file, number, f"'{words[0][:30]}' occurs twice")
            head[words[0]] = number, words[1:]
            continue
        first = first or number
        if len(words) != 3:
            raise _wrong(file, number, f"expected three numbers, got {len(words)}")
        rows.append(words)
    sizes = [key for key in ("LUT_1D_SIZE", "LUT_3D_SIZE") if key in head]
    if len(sizes) != 1:
        what = "both LUT_1D_SIZE and LUT_3D_SIZE" if sizes else "neither LUT_1D_SIZE nor LUT_3D_SIZE"
        raise _wrong(file, max((head[size][0] for size in sizes), default=1), f"the file has {what}")
    number, words = head[sizes[0]]
    is_cube = sizes[0] == "LUT_3D_SIZE"
    most = MOST_ENTRIES[0 if is_cube else 1]
    if len(words) != 1 or not words[0].isdecimal() or not 2 <= int(words[0]) <= most:
        raise _wrong(file, number, f"{sizes[0]} must be a whole number from 2 to {most}")
    side = int(words[0])
    low_key, high_key = "DOMAIN_MIN", "DOMAIN_MAX"
    if (span := sizes[0].replace("SIZE", "INPUT_RANGE")) in head:  # as DaVinci Resolve writes both for all channels
        number, words = head[span]
        if len(words) != 2 or low_key in head or high_key in head:
            raise _wrong(file, number, f"{span} takes two numbers and replaces {low_key} and {high_key}")
        head |= {low_key: (number, words[:1] * 3), high_key: (number, words[1:] * 3)}
    low = _row(file, *head.get(low_key, (0, ["0"] * 3)))
    high = _row(file, *head.get(high_key, (0, ["1"] * 3)))
    if not all(a < b for a, b in zip(low, high, strict=True)):
        number = head.get(high_key, head.get(low_key, (1, [])))[0]
        raise _wrong(file, number, "the start of the domain is not below its end")
    expected = side**3 if is_cube else side
    if len(rows) != expected:
        end = len(text.splitlines())
        raise _wrong(file, end, f"{sizes[0]} {side} takes {expected:,} rows, the file has {len(rows):,}")
    table = _numbers(file, rows, text)
    return Look(table.reshape(side, side, side, 3) if is_cube else table, low, high)


def _numbers(file: InputFile, rows: list[list[str]], text: str) -> Floats:
    try:
        table = np.array(rows, np.float64)
    except ValueError:
        table = np.full((1, 3), np.nan)
    with np.errstate(over="ignore"):
        found = table.astype(np.float32)
    if np.isfinite(found).all():
        return found
    for number, line in enumerate(text.splitlines(), 1):  # again, to find the line
        words = line.partition("#")[0].split()
        if words and (not words[0][0].isalpha() or words[0].lower() in ("nan", "inf")):
            _row(file, number, words)
    raise AssertionError("one of the rows has no finite numbers")


def _row(file: InputFile, number: int, words: list[str]) -> tuple[float, float, float]:
    try:
        x, y, z = map(float, words)
    except ValueError:
        raise _wrong(file, number, f"expected three numbers, got '{' '.join(words)[:60]}'") from None
    if not np.isfinite(np.array([x, y, z], np.float32)).all():
        raise _wrong(file, number, f"expected finite numbers, got '{' '.join(words)[:60]}'")
    return x, y, z


def _wrong(file: InputFile, line: int, text: str) -> ValueError:
    return ValueError(f"{file.path}:{line}: {text}")


def _of_transform(file: InputFile) -> Look:
    """Compute a table of any other file that OpenColorIO reads: `.3dl`, `.csp`, `.clf`, `.cdl`, `.cc` and so on."""
    import OpenImageIO as oiio

    steps = np.linspace(0, 1, BAKED_SIDE)
    result = oiio.ImageBufAlgo.ociofiletransform(_grid(steps), str(file.path), unpremult=False)
    return Look(_baked(file, result))


def _of_config(file: InputFile, name: str) -> Look:
    """Compute a table of a look of a configuration, for scene-linear light with the primaries of Rec. 709."""
    import OpenImageIO as oiio

    config = oiio.ColorConfig(str(file.path))
    if problem := config.geterror():
        raise ValueError(f"{file.path}: {_reason(problem)}")
    looks = list(config.getLookNames())
    name = name or next(iter(looks), "")
    if name not in looks:
        known = f"its looks are {', '.join(map(repr, looks))}" if looks else "it has none"
        raise ValueError(f"{file.path} has no look '{name}'; {known}")
    values = DARKEST * (np.exp2(np.linspace(0, 1, BAKED_SIDE) * RANGE) - 1)
    spaces = set(config.getColorSpaceNames())
    found = config.resolve("lin_rec709_scene")
    space = found if found in spaces else "scene_linear"
    result = oiio.ImageBufAlgo.ociolook(_grid(values), name, space, space, unpremult=False, colorconfig=str(file.path))
    colors = np.maximum(_baked(file, result), 0)
    return Look((np.log2(colors / DARKEST + 1) / RANGE).astype(np.float32), is_linear=True)


def _grid(steps: npt.NDArray[np.float64]) -> oiio.ImageBuf:
    """Return a picture of all colours with these values, red fastest."""
    import OpenImageIO as oiio

    side = len(steps)
    blue, green, red = np.meshgrid(steps, steps, steps, indexing="ij")
    colors = np.stack([red, green, blue], axis=-1).reshape(side * side, side, 3)
    picture = oiio.ImageBuf(oiio.ImageSpec(side, side * side, 3, "float"))
    picture.set_pixels(oiio.ROI(), np.ascontiguousarray(colors, np.float32))
    return picture


def _baked(file: InputFile, result: oiio.ImageBuf) -> Floats:
    import OpenImageIO as oiio

    if result.has_error:
        raise ValueError(f"{file.path}: {_reason(result.geterror())}")
    colors = np.asarray(result.get_pixels(oiio.FLOAT))
    return colors.reshape(BAKED_SIDE, BAKED_SIDE, BAKED_SIDE, 3)


def _reason(text: str) -> str:
    """Return the message of the first reader for the file's extension, if several have tried."""
    parts = re.split(r"'[^']*' failed with: ", text)
    return textwrap.shorten(parts[min(1, len(parts) - 1)], 200, placeholder=" …") or "OpenColorIO cannot read it"
