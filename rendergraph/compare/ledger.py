"""The results of a sweep: a file of lines that only grows, each with its checksum, so that a torn end does no harm."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rendergraph.errors import Place, Problem, RenderError
from rendergraph.images.files import flush

CHECKSUM = "sha256"


@dataclass(frozen=True)
class Ledger:
    """One JSON object a line; `sha256` is that of the rest, written with sorted keys and no blanks."""

    path: Path

    def read(self) -> tuple[list[dict[str, Any]], int]:
        """The records that are whole, in the order they were written, and how many lines are not."""
        try:
            lines = self.path.read_bytes().split(b"\n")
        except FileNotFoundError:
            return [], 0
        except OSError as error:
            raise self._failed(error) from error
        found = [_record(line) for line in lines if line.strip()]
        return [record for record in found if record is not None], sum(record is None for record in found)

    def append(self, record: Mapping[str, Any]) -> None:
        """Add a record; it is on the disk when this returns.

        Raises:
            RenderError: the disk does not take it.
        """
        line = json.dumps({**record, CHECKSUM: checksum(record)}, ensure_ascii=False) + "\n"
        try:
            new = not self.path.exists()
            handle = os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o666)
            try:
                size = os.fstat(handle).st_size
                torn = size > 0 and os.pread(handle, 1, size - 1) != b"\n"
                data = (b"\n" if torn else b"") + line.encode(errors="backslashreplace")
                while data:
                    data = data[os.write(handle, data) :]
                os.fsync(handle)
            finally:
                os.close(handle)
            if new:
                flush(self.path.parent)
        except OSError as error:
            raise self._failed(error) from error

    def _failed(self, error: OSError) -> RenderError:
        text = f"the results cannot be kept: {error.strerror or error}"
        return RenderError(Problem("RG507", text, Place(str(self.path))))


def checksum(record: Mapping[str, Any]) -> str:
    """SHA-256 of a record without its checksum."""
    rest = {key: value for key, value in record.items() if key != CHECKSUM}
    text = json.dumps(rest, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()


def _record(line: bytes) -> dict[str, Any] | None:
    try:
        record = json.loads(line)
    except ValueError:
        return None
    if not isinstance(record, dict) or record.get(CHECKSUM) != checksum(record):
        return None
    return record
