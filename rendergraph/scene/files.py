"""What every reader shares: where paths may lead, how much may be read, and what was left out.

Scene files are untrusted data. A path found in one is resolved, links followed, and handed to the caller's root rule
before anything is opened; only regular files are read, and only up to a limit.
"""

from __future__ import annotations

import re
import stat
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Literal, TypeAlias

from msgspec import Struct, field

from rendergraph.declare import NO_EXTENSIONS, READ_IMAGES, Extensions
from rendergraph.document import shown
from rendergraph.errors import InputError, Place, Problem
from rendergraph.scene import image_header
from rendergraph.scene.model import ImageSource, Material, Mesh
from rendergraph.stamps import record_read

CheckPath: TypeAlias = Callable[[Path, Place | None], Path]
"""The root rule: returns the resolved path, or raises InputError where it leaves every root."""


_MOST_WARNINGS = 50


class SceneLimits(Struct, frozen=True):
    """How much a scene may ask for.

    Attributes:
        file_bytes: bytes of one mesh or buffer file.
        vertices: vertices of one scene, before and after corners are split.
        objects: placed objects of one scene.
        memory_bytes: memory for what a file declares without holding it, such as accessors without a view.
        image_side: texels along one side of an image.
        image_bytes: decoded bytes of one image.
        image_ratio: decoded bytes for each byte of the file, where an image is above 64 MiB.
    """

    file_bytes: int = 2 << 30
    vertices: int = 100_000_000
    objects: int = 500_000
    memory_bytes: int = 256 << 20
    image_side: int = 16384
    image_bytes: int = 2 << 30
    image_ratio: int = 1000


def inside(folder: Path) -> CheckPath:
    """The root rule that keeps everything under one folder, links followed."""

    def check(path: Path, place: Place | None) -> Path:
        root, resolved = folder.resolve(), path.resolve()
        if not resolved.is_relative_to(root):
            text = f"'{shown(str(path))}' leaves the folder {root}; add its folder with --asset-root"
            raise InputError(Problem("RG302", text, place))
        return resolved

    return check


def named(text: str) -> str:
    """A name from a file as text that can be printed: what cannot becomes a replacement character."""
    return "".join(c if c.isprintable() else "\ufffd" for c in text)


class UniqueNames:
    """Hands out names that are unique within a file: `Box`, `Box_1`, `Box_2`."""

    def __init__(self) -> None:
        self._taken: set[str] = set()
        self._next: dict[str, int] = {}

    def unique(self, wanted: str, fallback: str) -> str:
        """`wanted`, or `fallback` where that is empty, with a number where it is taken."""
        base = named(wanted) or fallback
        name, number = base, self._next.get(base, 1)
        while name in self._taken:
            name = f"{base}_{number}"
            number += 1
        self._next[base] = number
        self._taken.add(name)
        return name


class Reading(Struct):
    """One file being read: its path, the root rule, the limits, what plugins read, and the warnings so far."""

    path: Path
    check_path: CheckPath
    limits: SceneLimits = SceneLimits()
    extensions: Extensions = NO_EXTENSIONS
    _warnings: dict[tuple[str, str, str], Problem] = field(default_factory=dict)
    _images: dict[Path, tuple[ImageSource, image_header.Header]] = field(default_factory=dict)

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """What was left out, replaced or clamped, in the order it was found."""
        return tuple(self._warnings.values())

    def warn(self, code: str, kind: str, text: str, *, line: int = 0, file: Path | None = None) -> None:
        """Say something once: a second warning of the same kind about the same file is dropped, so are too many."""
        if len(self._warnings) >= _MOST_WARNINGS:
            return
        place = Place(str(file or self.path), line, 1 if line else 0)
        self._warnings.setdefault((code, kind, place.file), Problem(code, text, place, severity="warning"))

    def add_warnings(self, problems: Iterable[Problem]) -> None:
        """Take over what another file's reader warned of."""
        for problem in problems:
            self._warnings.setdefault((problem.code, problem.message, str(problem.place)), problem)

    def named(self, path: Path) -> str:
        """A path for messages: relative to this file's folder where it lies below."""
        folder = self.path.parent.resolve()
        return shown(str(path.relative_to(folder) if path != self.path and path.is_relative_to(folder) else path))

    def error(self, code: str, text: str, *, line: int = 0, file: Path | None = None) -> InputError:
        """An error in this file, to be raised by the caller."""
        return InputError(Problem(code, text, Place(str(file or self.path), line, 1 if line else 0)))

    def over(self, what: str, limit: str, code: str = "RG307") -> InputError:
        """An error for a limit passed; names the limit."""
        most = getattr(self.limits, limit)
        return self.error(code, f"{what}, the limit is {most:,}; --limit scene-{limit.replace('_', '-')}=N allows more")

    def beside(self, name: str, *, line: int = 0, file: Path | None = None) -> Path:
        """The file `name` means, relative to this one, inside the roots; it need not exist.

        Raises:
            InputError: it is a URL, holds a NUL, or leaves the roots.
        """
        holder = file or self.path
        if re.match(r"[A-Za-z][A-Za-z0-9+.-]+:", name) or "\0" in name:
            raise self.error("RG302", f"'{shown(name)}' is no path; only files are read", line=line, file=holder)
        place = Place(str(holder), line, 1 if line else 0)
        try:
            return self.check_path(holder.parent / name, place)
        except (OSError, ValueError, RuntimeError) as problem:
            raise self.error(
                "RG301", f"'{shown(name)}' cannot be followed: {reason(problem)}", line=line, file=holder
            ) from None

    def beside_if_there(self, name: str, *, line: int = 0, file: Path | None = None) -> Path | None:
        """The file `name` means, None where there is none.

        Raises:
            InputError: it is a URL, holds a NUL, or leaves the roots.
        """
        try:
            path = self.beside(name, line=line, file=file)
        except InputError as error:
            if error.problems[0].code not in _NOT_THERE:
                raise
            return None
        return path if file_kind(path) == "file" else None

    def say_unmapped(self, name: str, material: Material, mesh: Mesh) -> None:
        """Warn where a material has textures, and the mesh no coordinates for them."""
        for slot, texture in material.textures.items():
            if (mesh.uv1 if texture.uv else mesh.uv0) is None:
                text = f"'{shown(name)}' has no coordinates for its {slot} texture, whose first texel is everywhere"
                self.warn("RG333", "unmapped", text)

    def read(self, path: Path, what: str, *, line: int = 0) -> bytes:
        """The bytes of a regular file within `file_bytes`.

        Raises:
            InputError: it is missing, unreadable, no regular file, or too large.
        """
        self.exists(path, what, line=line)
        try:
            if path.stat().st_size > self.limits.file_bytes:
                raise self.over(f"{what} '{self.named(path)}' has {path.stat().st_size:,} bytes", "file_bytes")
            return path.read_bytes()
        except (OSError, ValueError) as problem:
            raise self.error("RG301", f"{what} '{self.named(path)}' cannot be read: {reason(problem)}") from None

    def exists(self, path: Path, what: str, *, line: int = 0, code: str = "RG301") -> None:
        """Check that a path is a regular file.

        Raises:
            InputError: it is not.
        """
        kind = file_kind(path)
        if kind == "file":
            return
        if path == self.path:
            raise InputError(Problem(code, f"{what} '{self.named(path)}' {_NOT[kind]}"))
        raise self.error(code, f"{what} '{self.named(path)}' {_NOT[kind]}", line=line)

    def image(self, path: Path, what: str, *, line: int = 0) -> ImageSource:
        """An image file whose header is plausible.

        Raises:
            InputError: it is missing, no image, or beyond the limits.
        """
        return self.image_with_header(path, what, line=line)[0]

    def image_with_header(self, path: Path, what: str, *, line: int = 0) -> tuple[ImageSource, image_header.Header]:
        """The same with what the header says; a file is looked into once."""
        if path in self._images:
            return self._images[path]
        self.exists(path, what, line=line, code="RG350")
        loader = None if path.suffix.lower() in ("", *READ_IMAGES) else self.extensions.image_loader(path.suffix)
        if loader is not None:
            if path.stat().st_size > self.limits.file_bytes:
                raise self.over(f"{what} '{self.named(path)}' has {path.stat().st_size:,} bytes", "file_bytes")
            source = ImageSource(path, None, shown(path.name), loader)
            self._images[path] = source, image_header.Header(path.suffix.lower()[1:])
            return self._images[path]
        try:
            size = path.stat().st_size
            with path.open("rb") as file:
                head = file.read(image_header.HEAD_BYTES)
        except OSError as problem:
            raise self.error("RG350", f"{what} '{self.named(path)}' cannot be read: {reason(problem)}") from None
        label = shown(path.name)
        header = self._check_header(head, size, f"{what} '{label}'", path.suffix, line)
        self._images[path] = ImageSource(path, None, label), header
        return self._images[path]

    def embedded_image(self, data: bytes, what: str) -> ImageSource:
        """An image inside this file whose header is plausible.

        Raises:
            InputError: it is no image, or beyond the limits.
        """
        self._check_header(data[: image_header.HEAD_BYTES], len(data), what, "", 0)
        return ImageSource(self.path, data, f"{what} in {shown(self.path.name)}")

    def _check_header(self, head: bytes, size: int, what: str, suffix: str, line: int) -> image_header.Header:
        try:
            facts = image_header.read(head, suffix)
        except image_header.NoImageError as problem:
            raise self.error("RG351", f"{what} {problem}", line=line) from None
        except image_header.ChannelsError as problem:
            raise self.error("RG354", f"{what} {problem}", line=line) from None
        except ValueError as problem:
            raise self.error("RG352", f"{what} {problem}", line=line) from None
        decoded = facts.decoded_bytes
        if facts.width is None or facts.height is None or decoded is None:
            return facts
        if facts.width < 1 or facts.height < 1:
            raise self.error("RG352", f"{what} is {facts.width}×{facts.height} texels", line=line)
        if max(facts.width, facts.height) > self.limits.image_side:
            raise self.over(f"{what} is {facts.width}×{facts.height} texels", "image_side", "RG353")
        if decoded > self.limits.image_bytes:
            raise self.over(f"{what} decodes to {decoded:,} bytes", "image_bytes", "RG353")
        if decoded > 64 << 20 and decoded > self.limits.image_ratio * size:
            raise self.over(f"{what} decodes to {decoded:,} bytes from {size:,}", "image_ratio", "RG353")
        return facts


_NOT_THERE = ("RG011", "RG301")
"""What the root rule says of a path that leads nowhere."""
_NOT = {"missing": "does not exist", "other": "is not a regular file", "unreadable": "cannot be read"}


def file_kind(path: Path) -> Literal["file", "missing", "other", "unreadable"]:
    """What stands at a path, links followed."""
    record_read(path)
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return "missing"
    except (OSError, ValueError):
        return "unreadable"
    return "file" if stat.S_ISREG(mode) else "other"


def reason(problem: Exception) -> str:
    """The operating system's words without path and number."""
    return getattr(problem, "strerror", None) or shown(str(problem))
