"""Reading a scene or mesh file: its root rule, limits and warnings, and meshes in shipped and plugins' formats.

Scene files are untrusted data. A path in one is resolved, including symbolic links, and checked against the root rule
before anything is opened; only regular files are read, and only up to a limit.
"""

from __future__ import annotations

import io
import re
import stat
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph.declare import NO_EXTENSIONS, Added, Extensions, MeshData
from rendergraph.declare.extensions import READ_IMAGES, ImageLoader, MeshLoader
from rendergraph.document import shown
from rendergraph.errors import InputError, Place, Problem, shown_file
from rendergraph.pipelines import formats
from rendergraph.pipelines.formats import MESHES as MESHES
from rendergraph.scene.geometry import face_normals, filled_normals
from rendergraph.scene.model import FARTHEST, Floats, ImageSource, Material, Mesh, Object, Scene, SceneLimits
from rendergraph.stamps import record_read

CheckPath: TypeAlias = Callable[[Path, Place | None], Path]
"""The root rule: returns the resolved path, or raises InputError if it leaves every root."""

_MOST_WARNINGS = 50
_UNAVAILABLE = ("RG011", "RG301")
"""Codes of the root rule for a path that does not exist."""
_WIDTHS = {"positions": (3,), "normals": (3,), "uv0": (2,), "uv1": (2,), "colors": (3, 4)}
_NOT_A_FILE = {"missing": "does not exist", "other": "is not a regular file", "unreadable": "cannot be read"}


def inside(folder: Path) -> CheckPath:
    """Return the root rule that keeps everything under one folder, with symbolic links resolved."""

    def check(path: Path, place: Place | None) -> Path:
        root, resolved = folder.resolve(), path.resolve()
        if not resolved.is_relative_to(root):
            text = f"'{shown(str(path))}' leaves the folder {root}; add its folder with --asset-root"
            raise InputError(Problem("RG302", text, place))
        return resolved

    return check


def printable(text: str) -> str:
    """Return a file's name with a replacement character for each unprintable character."""
    return "".join(c if c.isprintable() else "\ufffd" for c in text)


class UniqueNames:
    """Returns names that are unique within a file: `Box`, `Box_1`, `Box_2`."""

    def __init__(self) -> None:
        self._next: dict[str, int] = {}  # by name that is taken, the number to try next

    def unique(self, name: str, fallback: str) -> str:
        """Return `name`, or `fallback` if it is empty, with a number if it is taken."""
        base = printable(name) or fallback
        name, number = base, self._next.get(base, 1)
        while name in self._next:
            name = f"{base}_{number}"
            number += 1
        self._next |= {name: 1, base: number}
        return name


class Reading(Struct):
    """One file being read. Its methods take as `file` another file read on its behalf, such as an MTL."""

    path: Path
    check_path: CheckPath
    limits: SceneLimits = SceneLimits()
    extensions: Extensions = NO_EXTENSIONS
    _warnings: dict[tuple[str, str, str], Problem] = field(default_factory=dict)
    _images: dict[Path, ImageSource] = field(default_factory=dict)

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """Warnings about what was left out, replaced or clamped, in the order of discovery."""
        return tuple(self._warnings.values())

    def warn(self, code: str, kind: str, text: str, *, line: int = 0, file: Path | None = None) -> None:
        """Add a warning, unless there is one of the same kind about the same file, or there are too many."""
        if len(self._warnings) >= _MOST_WARNINGS:
            return
        place = self._place(line, file)
        self._warnings.setdefault((code, kind, place.file), Problem(code, text, place, severity="warning"))

    def add_warnings(self, problems: Iterable[Problem]) -> None:
        for problem in problems:
            self._warnings.setdefault((problem.code, problem.text, str(problem.place)), problem)

    def warn_unmapped(self, name: str, material: Material, mesh: Mesh) -> None:
        """Warn if a material has textures but the mesh has no coordinates for them."""
        for slot, texture in material.textures.items():
            if (mesh.uv1 if texture.uv else mesh.uv0) is None:
                text = f"'{shown(name)}' has no coordinates for its {slot} texture; its first texel is used everywhere"
                self.warn("RG333", "unmapped", text)

    def error(self, code: str, text: str, *, line: int = 0, file: Path | None = None) -> InputError:
        return InputError(Problem(code, text, self._place(line, file)))

    def over(self, what: str, limit: str) -> InputError:
        return self.error("RG307", self.limits.exceeded(what, limit))

    def _place(self, line: int, file: Path | None) -> Place:
        return Place(str(file or self.path), line, 1 if line else 0)

    def _name(self, path: Path) -> str:
        """Return a path for messages, relative to this file's folder if it lies below."""
        folder = self.path.parent.resolve()
        return shown(str(path.relative_to(folder) if path != self.path and path.is_relative_to(folder) else path))

    def resolve(self, name: str, *, line: int = 0, file: Path | None = None) -> Path:
        """Resolve a name in this file to a path inside the roots; the path need not exist."""
        if re.match(r"[A-Za-z][A-Za-z0-9+.-]+:", name) or "\0" in name:
            text = f"'{shown(name)}' is not a file path; only local files can be loaded"
            raise self.error("RG302", text, line=line, file=file)
        try:
            return self.check_path((file or self.path).parent / name, self._place(line, file))
        except (OSError, ValueError, RuntimeError) as problem:
            text = f"'{shown(name)}' cannot be followed: {_reason(problem)}"
            raise self.error("RG301", text, line=line, file=file) from None

    def find(self, name: str, *, line: int = 0, file: Path | None = None) -> Path | None:
        """Resolve a name of a file that may be missing; None if it is."""
        try:
            path = self.resolve(name, line=line, file=file)
        except InputError as error:
            if error.problems[0].code not in _UNAVAILABLE:
                raise
            return None
        return path if file_kind(path) == "file" else None

    def read(self, path: Path, what: str) -> bytes:
        """Return the bytes of a regular file within `file_bytes`."""
        self.check_file(path, what)
        try:
            self.check_bytes(path, what)
            return path.read_bytes()
        except (OSError, ValueError) as problem:
            raise self.error("RG301", f"{what} '{self._name(path)}' cannot be read: {_reason(problem)}") from None

    def check_file(self, path: Path, what: str) -> None:
        kind = file_kind(path)
        if kind != "file":
            text = f"{what} '{self._name(path)}' {_NOT_A_FILE[kind]}"
            raise InputError(Problem("RG301", text)) if path == self.path else self.error("RG301", text)

    def check_bytes(self, path: Path, what: str) -> None:
        size = path.stat().st_size
        if size > self.limits.file_bytes:
            raise self.over(f"{what} '{self._name(path)}' has {size:,} bytes", "file_bytes")

    def image(self, path: Path, what: str, *, line: int = 0) -> ImageSource:
        """Return an image file whose header is valid; a file is opened once."""
        if path not in self._images:
            record_read(path)
            loader: Added[ImageLoader] | None = None
            if path.suffix.lower() == ".npy":
                loader = Added(".npy", _read_npy, "rendergraph", path)
            elif path.suffix.lower() not in ("", *READ_IMAGES):
                loader = self.extensions.loader("images", path.suffix)
            source = ImageSource(path, None, shown(path.name), loader)
            if loader is None:
                source = self._checked(source, f"{what} '{self._name(path)}'", line)
            elif (kind := file_kind(path)) != "file":
                raise self.error("RG350", f"{what} '{self._name(path)}' {_NOT_A_FILE[kind]}", line=line)
            else:
                self.check_bytes(path, what)
            self._images[path] = source
        return self._images[path]

    def embedded_image(self, data: bytes, what: str) -> ImageSource:
        """Return an image inside this file whose header is valid."""
        return self._checked(ImageSource(self.path, data, f"{what} in {shown(self.path.name)}"), what, 0)

    def _checked(self, source: ImageSource, what: str, line: int) -> ImageSource:
        from rendergraph.scene.image_files import ImageError, read_header  # only for scenes with images

        try:
            size, channels = read_header(source, self.limits)
        except ImageError as error:
            raise self.error(error.code, f"{what} {error.reason}", line=line) from None
        return replace(source, size=size, channels=channels)


def _read_npy(data: bytes) -> npt.NDArray[Any]:
    """Return the array of an image in NumPy's own format."""
    found: npt.NDArray[Any] = np.load(io.BytesIO(data), allow_pickle=False)
    return found


def file_kind(path: Path) -> Literal["file", "missing", "other", "unreadable"]:
    """Return what is at a path, with symbolic links resolved."""
    record_read(path)
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return "missing"
    except (OSError, ValueError):
        return "unreadable"
    return "file" if stat.S_ISREG(mode) else "other"


def _reason(problem: Exception) -> str:
    """Return the operating system's text without path and number."""
    return getattr(problem, "strerror", None) or shown(str(problem))


# Meshes ---------------------------------------------------------------------------------------------------------------


def read_mesh(path: Path, reading: Reading, unknown: Problem, known: tuple[str, ...] = MESHES) -> Scene:
    """Read a mesh file as a scene; `unknown` is the problem if its extension is neither `known` nor a plugin's."""
    extension = path.suffix.lower()
    if extension in MESHES:
        return formats.read(path, reading)
    if (of_scenes := reading.extensions.loader("scenes", extension)) is not None:
        reading.check_file(path, "scene file")
        what = f"scene '{shown(path.name)}'"
        result = of_scenes.run("RG497", f"{what} cannot be read", path, reading)
        if not isinstance(result, Scene):
            raise _unusable(of_scenes, what, f"{type(result).__name__}, not a Scene")
        return result
    if (loader := reading.extensions.loader("meshes", extension)) is None:
        added: list[Added[Any]] = [*reading.extensions.added("scenes"), *reading.extensions.added("meshes")]
        names = [*known, *(one.name for one in added)]
        text = f"{unknown.text} {', '.join(dict.fromkeys(names))}"
        raise InputError([Problem(unknown.code, text, unknown.place), *reading.extensions.problems])
    return _read_plugin_mesh(path, loader, reading)


def _read_plugin_mesh(path: Path, loader: Added[MeshLoader], reading: Reading) -> Scene:
    """Return the scene of a plugin's loader: an object for each `MeshData`, whose arrays are all checked."""
    reading.check_file(path, "scene file")
    reading.check_bytes(path, "mesh")
    what = f"mesh '{shown(path.name)}'"
    result = loader.run("RG497", f"{what} cannot be read", path)
    parts = [result] if isinstance(result, MeshData) else result
    if not isinstance(parts, Sequence) or not all(isinstance(part, MeshData) for part in parts):
        raise _unusable(loader, what, f"{type(result).__name__}, not MeshData or a list of it")
    if not parts:
        reading.warn("RG332", "empty", "contains no triangle; nothing is drawn")
    names = UniqueNames()
    objects, meshes, materials = [], [], []
    vertices = 0
    for number, part in enumerate(parts):
        name = names.unique(str(part.name), path.stem)
        try:
            mesh = check_mesh(part, name)
            r, g, b = (_factor("base_color", value) for value in part.base_color)
            metallic, roughness = _factor("metallic", part.metallic), _factor("roughness", part.roughness)
        except (ValueError, TypeError, OverflowError) as error:
            raise _unusable(loader, what, f"a mesh ({number}) whose {error}") from None
        vertices += len(mesh.positions)
        if vertices > reading.limits.vertices:
            raise reading.over(f"{what} has {vertices:,} vertices", "vertices")
        objects.append(Object(name, number, number, np.eye(4), node=name))
        meshes.append(mesh)
        materials.append(Material(name, (r, g, b, 1.0), metallic, roughness))
    return Scene(path.stem, path, tuple(objects), tuple(meshes), tuple(materials))


def _unusable(loader: Added[Any], what: str, text: str) -> InputError:
    text = f"{what} cannot be read: the loader of plugin '{loader.plugin}' returned {text}"
    return InputError(Problem("RG498", text, Place(shown_file(loader.file))))


def check_mesh(part: MeshData, name: str = "") -> Mesh:
    """Return the mesh of arrays; raise ValueError for a mistake, with a text that begins with the attribute's name."""
    arrays = {key: _floats(key, getattr(part, key)) for key in _WIDTHS}
    positions = arrays.pop("positions")
    if positions is None or not len(positions):
        raise ValueError("positions are missing")
    indices = _indices(part.indices, len(positions))
    for key, array in arrays.items():
        if array is not None and len(array) != len(positions):
            raise ValueError(f"{key} are {len(array)}, its positions {len(positions)}")
    colors = arrays["colors"]
    if colors is not None and colors.shape[1] == 3:
        arrays["colors"] = np.concatenate([colors, np.ones((len(colors), 1), np.float32)], axis=1)
    normals = arrays.pop("normals")
    doubles = np.zeros(positions.shape) if normals is None else normals.astype(np.float64)
    filled, _ = filled_normals(positions, indices, doubles)
    has_area = face_normals(positions, indices).any(axis=1)
    return Mesh(name, positions, indices[has_area], filled, None, arrays["uv0"], arrays["uv1"], arrays["colors"])


def _floats(key: str, values: npt.ArrayLike | None) -> Floats | None:
    if values is None:
        return None
    with np.errstate(over="ignore"):  # values beyond single precision become infinite
        array = np.ascontiguousarray(values, np.float32)
    if array.ndim != 2 or array.shape[1] not in _WIDTHS[key]:
        expected = " or ".join(f"(n, {width})" for width in _WIDTHS[key])
        raise ValueError(f"{key} have the shape {array.shape}, not {expected}")
    if not (np.abs(array) <= FARTHEST).all():
        raise ValueError(f"{key} are not all finite, or beyond {FARTHEST:g}")
    return array


def _indices(values: npt.ArrayLike, count: int) -> npt.NDArray[np.uint32]:
    array = np.asarray(values)
    if array.ndim != 2 or array.shape[1] != 3 or not np.issubdtype(array.dtype, np.integer):
        raise ValueError(f"indices are {array.dtype} of shape {array.shape}, not whole numbers of shape (m, 3)")
    if len(array) and (int(array.min()) < 0 or int(array.max()) >= count):
        raise ValueError(f"indices go from {array.min()} to {array.max()}, its positions are {count}")
    return np.ascontiguousarray(array, np.uint32)


def _factor(key: str, value: float) -> float:
    if not 0 <= value <= 1:
        raise ValueError(f"{key} is {value}, not from 0 to 1")
    return float(value)
