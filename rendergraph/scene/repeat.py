"""Copies of an object or light: their positions and differences (`repeat:` of a scene file)."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import msgspec
import numpy as np
from msgspec import Struct

from rendergraph.errors import suggestion
from rendergraph.projection import unit
from rendergraph.scene.geometry import Doubles, euler_matrix
from rendergraph.scene.model import FARTHEST, Light, Matrix

COLUMNS = {
    "objects": {"at": 3, "rotate_degrees": 3, "scale": 1},
    "lights": {"at": 3, "color": 3, "intensity": 1, "range": 1},
}
"""The values that a file of copies may give for each copy, by section, with their numbers of components."""
_CSV = {
    **{axis: ("at", number) for number, axis in enumerate("xyz")},
    **{channel: ("color", number) for number, channel in enumerate("rgb")},
    **{f"rotate_{axis}": ("rotate_degrees", number) for number, axis in enumerate("xyz")},
    **{name: (name, 0) for name in ("scale", "intensity", "range")},
}
"""The columns of a text table, with their key and component."""
_RANDOM = ("at", "rotate_degrees", "scale", "color", "intensity", "choose")
"""The properties that vary. Each has its own random numbers, so that varying another one does not change them."""


class Copies(Struct, frozen=True, eq=False):
    """The n copies of an entry, as changes of the entry itself.

    Attributes:
        offsets: metres from the entry's position, (n, 3).
        turns: rotations about the entry's position after its own rotation and scale, (n, 3, 3); None for none.
        values: by key, a copy's replacement for the entry's value.
        factors: by key, factors on the entry's value, (n, 1) or (n, 3).
    """

    offsets: Doubles
    turns: Doubles | None = None
    values: Mapping[str, Sequence[Any]] = {}
    factors: Mapping[str, Doubles] = {}

    def placed(self, name: str, world: Matrix) -> Iterator[tuple[str, Matrix]]:
        """Yield the name and the transform of each copy of an object at a transform."""
        matrices = np.repeat(world[None], len(self.offsets), axis=0)
        matrices[:, :3, 3] += self.offsets
        if self.turns is not None:
            matrices[:, :3, :3] = self.turns @ world[:3, :3]
        return ((f"{name}.{number}", matrix) for number, matrix in enumerate(matrices))

    def lights(self, light: Light) -> list[Light]:
        """Return the copies of a light."""
        n = len(self.offsets)
        positions: Sequence[Any] = _tuples(np.array(light.position) + self.offsets)
        directions: Sequence[Any] = [light.direction] * n
        if self.turns is not None:
            directions = _tuples(unit(self.turns @ np.array(light.direction)))
        colors, intensities = ([*self.values.get(key, n * [getattr(light, key)])] for key in ("color", "intensity"))
        if "color" in self.factors:
            colors = _tuples(np.array(colors) * self.factors["color"])
        if "intensity" in self.factors:
            intensities = (np.array(intensities) * self.factors["intensity"][:, 0]).tolist()
        ranges = self.values.get("range", n * [light.range])
        rest = light.inner, light.outer, light.casts_shadow, light.extra
        rows = zip(positions, directions, colors, intensities, ranges, strict=True)
        return [Light(f"{light.name}.{number}", light.type, *row, *rest) for number, row in enumerate(rows)]


def count_of(values: Mapping[str, Any]) -> int:
    """Return the number of copies that `repeat` requests; 0 for a file, which has not been read."""
    if "grid" in values:
        return math.prod(values["grid"])
    return int(next((values[key] for key in ("line", "ring", "scatter") if key in values), 0))


def copies(values: Mapping[str, Any], columns: Mapping[str, Doubles]) -> Copies:
    """Return the copies that the values of `repeat` describe, with the columns of its file (see `read_columns`)."""
    offsets, turns = _layout(values, columns)
    n, vary, seed = len(offsets), values.get("vary", {}), values.get("seed", 0)
    if "at" in vary:
        offsets = offsets + _random(seed, "at", (n, 3), signed=True) * vary["at"]
    if "rotate_degrees" in vary:
        angles = _random(seed, "rotate_degrees", (n, 3), signed=True) * vary["rotate_degrees"]
        turns = turns @ euler_matrix(angles)
    if "scale" in vary:
        turns = turns * (1 + vary["scale"] * _random(seed, "scale", (n, 1, 1), signed=True))
    kept: dict[str, Sequence[Any]] = {
        key: columns[key][:, 0].tolist() for key in ("intensity", "range") & columns.keys()
    }
    if "color" in columns:
        kept["color"] = _tuples(columns["color"])
    choose = dict(values.get("choose", {}))
    order = choose.pop("order", "random")
    picks = np.arange(n) if order == "turn" or not choose else _random(seed, "choose", (n,))
    for key, choices in choose.items():
        index = picks % len(choices) if order == "turn" else (picks * len(choices)).astype(int)
        kept[key] = [choices[number] for number in index.tolist()]
    widths = [(key, width) for key, width in (("color", 3), ("intensity", 1)) if key in vary]
    factors = {key: 1 + vary[key] * _random(seed, key, (n, width), signed=True) for key, width in widths}
    return Copies(offsets, turns if (turns != np.eye(3)).any() else None, kept, factors)


def _layout(values: Mapping[str, Any], columns: Mapping[str, Doubles]) -> tuple[Doubles, Doubles]:
    """Return offsets (n, 3) and rotations without random changes, (n, 3, 3), or (1, 3, 3) for all."""
    none = np.eye(3)[None]
    if "grid" in values:
        nx, ny, nz = values["grid"]
        number = np.arange(nx * ny * nz)
        cell = np.stack([number % nx, number // nx % ny, number // (nx * ny)], axis=-1).astype(np.float64)
        if values.get("centered", False):
            cell -= (np.array([nx, ny, nz]) - 1) / 2
        return cell * values.get("step", (1.0, 1.0, 1.0)), none
    if "line" in values:
        n = values["line"]
        return np.arange(n)[:, None] * np.array(values.get("step", (1.0, 0.0, 0.0))), none
    if "ring" in values:
        n, arc = values["ring"], values.get("arc_degrees", 360.0)
        angles = values.get("start_degrees", 0.0) + np.linspace(0, arc, n, endpoint=abs(arc) < 360)
        radians = np.radians(angles)
        offsets = np.stack([np.cos(radians), np.zeros(n), -np.sin(radians)], axis=-1) * values.get("radius", 1.0)
        about_y = np.stack([np.zeros(n), angles, np.zeros(n)], axis=-1)
        return offsets, euler_matrix(about_y) if values.get("turned", False) else none
    if "scatter" in values:
        n = values["scatter"]
        spread = _random(values.get("seed", 0), "at", (n, 3), purpose=1) - 0.5
        return spread * values.get("size", (1.0, 1.0, 1.0)), none
    offsets = columns.get("at", np.zeros((len(next(iter(columns.values()))), 3)))
    turns = euler_matrix(columns["rotate_degrees"]) if "rotate_degrees" in columns else none
    return offsets, turns * columns["scale"][:, :, None] if "scale" in columns else turns


def _tuples(array: Doubles) -> list[Any]:
    return list(map(tuple, array.tolist()))


def _random(seed: int, key: str, shape: tuple[int, ...], *, purpose: int = 0, signed: bool = False) -> Doubles:
    """Return random numbers from 0 to 1, or -1 to 1, from raw bits, which are the same in every NumPy version."""
    from numpy.random import PCG64  # few scenes need it

    bits = PCG64([seed, _RANDOM.index(key), purpose]).random_raw(math.prod(shape))
    numbers: Doubles = (bits >> 11).reshape(shape) * np.float64(2.0**-53)
    return 2 * numbers - 1 if signed else numbers


# Files ----------------------------------------------------------------------------------------------------------------


def read_columns(data: bytes, ending: str, section: str, most: int, most_bytes: int) -> dict[str, Doubles]:
    """Return a file's values for each copy: by key of `COLUMNS`, finite numbers (n, 1) or (n, 3).

    A `.csv` has a header and a row for each copy, an `.npz` an array for each key, and a `.json` a mapping of those.
    The limits are of copies, and of the unpacked size of a compressed file.

    Raises:
        ValueError: the file is broken, or is not a table of copies.
    """
    if ending == ".csv":
        given = _csv_columns(data, section, most)
    elif ending == ".json":
        try:
            given = msgspec.json.decode(data, type=dict[str, Any])
        except (msgspec.DecodeError, RecursionError) as error:
            raise ValueError(f"is not a mapping of keys to lists: {error}") from None
    elif ending == ".npz":
        given = read_arrays(data, most_bytes)
    else:
        raise ValueError("is not a table of copies; use a file that ends in .csv, .json or .npz")
    known = COLUMNS[section]
    found = {}
    for key, values in given.items():
        if key not in known:
            raise ValueError(f"has '{key}', which {section} do not take{suggestion(key, known, most=len(known))}")
        found[key] = _column(key, values, known[key])
    lengths = {len(array) for array in found.values()}
    if len(lengths) != 1 or 0 in lengths:
        counts = ", ".join(f"{len(array)} for '{key}'" for key, array in found.items())
        raise ValueError(f"has different numbers of rows: {counts}" if len(lengths) > 1 else "has no rows")
    return found


def _column(key: str, values: object, width: int) -> Doubles:
    try:
        array = np.asarray(values, np.float64)
    except (ValueError, TypeError):
        raise ValueError(f"has '{key}' that is not a list of numbers of equal length") from None
    array = array[:, None] if array.ndim == 1 and width == 1 else array
    if array.ndim != 2 or array.shape[1] != width:
        raise ValueError(f"has '{key}' of the shape {array.shape}, not {'(n, 3)' if width == 3 else '(n,)'}")
    low = 0.0 if key in ("color", "intensity", "range") else -FARTHEST
    wrong = ~((array >= low) & (array <= FARTHEST)).all(axis=1)
    if key == "range":
        wrong |= array[:, 0] == 0
    if wrong.any():
        row = int(wrong.argmax())
        limits = "above 0" if key == "range" else "at least 0" if low == 0 else "finite"
        raise ValueError(f"has '{key}' {array[row].tolist()} in row {row + 1}; it must be {limits}")
    return array


def _csv_columns(data: bytes, section: str, most: int) -> dict[str, Any]:
    import csv  # only for such files

    columns = {name: target for name, target in _CSV.items() if target[0] in COLUMNS[section]}
    numbers: list[list[float]] = []
    rows = csv.reader(io.StringIO(data.decode("utf-8-sig", "replace")))
    try:
        header = [name.strip() for name in next(rows, [])]
        if wrong := [name for name in header if name not in columns or header.count(name) > 1]:
            hint = suggestion(wrong[0], columns, most=len(columns))
            raise ValueError(f"'{wrong[0]}' is not a column, or occurs twice{hint}")
        for row in filter(None, rows):
            if len(row) != len(header):
                raise ValueError(f"{len(row)} values, not {len(header)}")
            if len(numbers) >= most:
                raise ValueError("too many rows")
            numbers.append([float(value) for value in row])
    except (csv.Error, ValueError) as error:
        raise ValueError(f"has a mistake in line {rows.line_num}: {error}") from None
    array = np.array(numbers, np.float64).reshape(len(numbers), len(header))
    found: dict[str, Any] = {}
    for number, name in enumerate(header):
        key, channel = columns[name]
        blank = np.full((len(array), COLUMNS[section][key]), 1.0 if key == "color" else 0.0)
        found.setdefault(key, blank)[:, channel] = array[:, number]
    return found


def read_arrays(data: bytes, most_bytes: int) -> dict[str, Any]:
    """Return the arrays of an `.npz` file that unpacks to at most `most_bytes`; raise ValueError for a mistake."""
    import zipfile  # only for such files
    import zlib  # as zipfile

    broken = (ValueError, OSError, EOFError, KeyError, RuntimeError, MemoryError, zipfile.BadZipFile, zlib.error)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
        if unpacked <= most_bytes:
            with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
                return {str(key): arrays[key] for key in arrays.files}
    except broken as error:
        raise ValueError(f"is not a file of NumPy arrays: {error}") from None
    raise ValueError(f"unpacks to {unpacked:,} bytes, more than {most_bytes:,}")
