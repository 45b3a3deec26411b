"""Parse YAML text into values with their places.

Values are built from PyYAML's parse events, not by its loaders: those lose the place of an alias, run constructors that
the text chooses, read YAML 1.1 scalars (`1e-3` as text, `no` as false) and fail in many ways on hostile text. Here only
text, numbers, switches, null, lists and mappings are built, all under a budget.
"""

from __future__ import annotations

import sys
from functools import lru_cache
from pathlib import Path
from typing import TextIO

from rendergraph.document.parsing import YamlLimits, over_limit, parse, scalar
from rendergraph.document.values import BROKEN, Document, Source, Value, describe, from_plain, merge_patch, shown
from rendergraph.errors import InputError, Place, Problem
from rendergraph.stamps import record_read
from rendergraph.system import STDIN


def load(path: Path, *, limits: YamlLimits = YamlLimits(), keep_going: bool = False) -> Document:
    """Return the values of a YAML file; see `parse`. The caller decides whether it may be read."""
    text = read_text(path, limits, str(path))
    return parse(text, str(path), path=path, limits=limits, keep_going=keep_going)


def read_text(path: Path, limits: YamlLimits, name: str) -> str:
    raw = read_bytes(path, limits.bytes, name)
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        good = Source(name, path, raw[: error.start].decode("utf-8-sig", "replace"))
        line, column = good.at(len(good.text))
        where = Place(name, line, column)
        raise InputError(Problem("RG008", "the text is not UTF-8; save the file as UTF-8", where)) from None


def read_bytes(path: Path, most: int, name: str | None = None) -> bytes:
    """Return the bytes of a regular file, or of standard input, of at most `most` bytes."""
    name = shown(name or str(path))
    record_read(path)
    try:
        if is_standard_input(path):
            raw = _standard_input(sys.stdin, most)
            if not raw:
                text = "standard input is empty; workers of an executor have none: write the text to a file"
                raise InputError(Problem("RG011", text))
        elif not path.is_file() and path.exists():
            what = "is a folder; a file is expected" if path.is_dir() else "is not a regular file"
            raise InputError(Problem("RG011", f"'{name}' {what}"))
        else:
            with path.open("rb") as file:
                raw = file.read(most + 1)
    except FileNotFoundError:
        raise InputError(Problem("RG011", f"there is no file '{name}'")) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(Problem("RG011", f"cannot read '{name}': {reason}")) from None
    if len(raw) > most:
        raise InputError(Problem("RG007", over_limit("bytes", most), Place(name)))
    return raw


def is_standard_input(name: str | Path | None) -> bool:
    """Whether a file that the user named is the process's standard input."""
    return str(name) in ("-", STDIN)


@lru_cache(maxsize=1)
def _standard_input(stream: TextIO | None, most: int) -> bytes:
    """Return the bytes of the stream, which can be read only once."""
    return stream.buffer.read(most + 1) if stream is not None else b""
