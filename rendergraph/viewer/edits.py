"""What somebody has changed on the page: settings as `-s` takes them, with undo and redo."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

_BARE = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*")  # a word that means itself in a file
_WORDS = frozenset({"null", "true", "false", "Null", "NULL", "True", "TRUE", "False", "FALSE"})
MOST = 500
"""Changes that can be undone."""


@dataclass(frozen=True)
class Edits:
    """Settings by path (`ao.radius`, `shadows.type`, `ao.enabled`, `light.occlusion`), in the order they were made.

    Attributes:
        now: path to the value's text.
        before, after: what undo and redo lead to, the nearest last.
    """

    now: Mapping[str, str] = field(default_factory=dict)
    before: tuple[Mapping[str, str], ...] = ()
    after: tuple[Mapping[str, str], ...] = ()

    @property
    def sets(self) -> tuple[str, ...]:
        """As the command line's `-s` has them."""
        return tuple(f"{path}={value}" for path, value in self.now.items())

    def set(self, path: str, value: Any, *, again: bool = False) -> Edits:
        """With one value set; `again` continues the last change (a slider that is still held) instead of adding one."""
        text = _text(value)
        if self.now.get(path) == text:
            return self
        return self._to({**self.now, path: text}, again=again and bool(self.before) and path in self.now)

    def dropped(self, path: str) -> Edits:
        """With one setting taken back."""
        return self._to({p: v for p, v in self.now.items() if p != path}) if path in self.now else self

    def undone(self) -> Edits:
        """As before the last change."""
        if not self.before:
            return self
        return Edits(self.before[-1], self.before[:-1], (*self.after, self.now))

    def redone(self) -> Edits:
        """As before the last undo."""
        if not self.after:
            return self
        return Edits(self.after[-1], (*self.before, self.now), self.after[:-1])

    def _to(self, now: Mapping[str, str], *, again: bool = False) -> Edits:
        if again:
            return replace(self, now=now, after=())
        return Edits(now, (*self.before, self.now)[-MOST:])


def _text(value: Any) -> str:
    """A value as the right side of a setting; a word that means itself needs no quotes."""
    if isinstance(value, str) and _BARE.fullmatch(value) and value not in _WORDS:
        return value
    return json.dumps(value)
