"""One walk over a file: what its table does not know, or what does not fit, is said with its place and left out."""

from __future__ import annotations

from collections.abc import Iterable

from msgspec import Struct

from rendergraph.document import BROKEN, Value, said, shown
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.keys.forms import Form
from rendergraph.keys.tables import Key, Later, Names, Table, Takes

MOST_PROBLEMS = 100
"""Mistakes after which nobody reads on; finding the nearest name for each of a million takes hours."""


class Codes(Struct, frozen=True):
    """The codes of what can be wrong with one kind of file.

    Attributes:
        unknown: a key that is not known.
        wrong: a value that does not fit, or is missing.
        name: a name that is none.
        file: the whole is no mapping.
    """

    unknown: str
    wrong: str
    name: str
    file: str


class Walk:
    """Holds the values of one file against tables.

    Attributes:
        problems: what is wrong so far, in the order it was found.
        dropped: paths of what was left out, so that nobody complains that it is missing.
    """

    def __init__(self, codes: Codes, problems: Iterable[Problem] = ()) -> None:
        """Problems are those of the reading: values may then be broken, and of these nothing more is said."""
        self.codes = codes
        self.problems = list(problems)
        self.dropped: set[tuple[str, ...]] = set()
        self._broken = bool(self.problems)
        self._path: list[str] = []

    def say(self, value: Value, code: str, text: str, *, key: bool = False) -> None:
        """Note a mistake at a value, or at its key.

        Raises:
            InputError: there are too many.
        """
        self.problems.append(value.problem(code, text, key=key))
        if len(self.problems) >= MOST_PROBLEMS:
            raise InputError(self.problems)

    def root(self, value: Value, table: Table, holds: str) -> Value | None:
        """All of a file.

        Args:
            value: its outermost value.
            table: what it may hold.
            holds: what it holds usually, in words.
        """
        if isinstance(value.data, dict):
            return self._table(value, table, "")
        if value.data is not BROKEN:
            self.say(value, self.codes.file, f"{table.what} is a mapping with {holds}, this is {value.kind}")
        return None

    def take(self, value: Value, key: Key) -> Value | None:
        """A value as far as it is right; None where nothing of it is, or it is null."""
        return self._take(value, key, key.takes, key.name)

    def _take(self, value: Value, key: Key, takes: Takes, name: str) -> Value | None:
        """The same for what stands under a name in what the key takes."""
        size = len(value.data) if isinstance(value.data, dict) else -1
        if isinstance(takes, Later):
            takes = takes.table() if size >= 0 else takes.form
        if isinstance(takes, Form):
            if self._broken and _has_broken(value):
                return None
            if takes.fits(value):
                return value
            wanted, hint = takes.wanted, takes.hint(value)
        elif isinstance(takes, Table) and size >= 0:
            return self._table(value, takes, name)
        elif isinstance(takes, Names) and size >= takes.least:
            return self._names(value, key, takes)
        else:
            wanted, hint = "a mapping", ""
        if value.data is not BROKEN:
            example = f", as in {key.example}" if key.example else ""
            text = f"'{shown(name)}' takes {wanted}{example}, this is {said(value)}{hint}"
            self.say(value, key.code or self.codes.wrong, text)
        return None

    def _enter(self, kept: dict[str, Value], name: str, child: Value, key: Key, takes: Takes) -> None:
        """Keep a child as far as it is right; remember where something was left out."""
        self._path.append(name)
        if child.data is None:
            kept[name] = child
        elif (good := self._take(child, key, takes, name)) is not None:
            kept[name] = good
        else:
            self.dropped.add(tuple(self._path))
        self._path.pop()

    def _table(self, value: Value, table: Table, name: str) -> Value:
        what = table.what.format(shown(name))
        known = table.keys_of(value)
        kept: dict[str, Value] = {}
        for word, child in value.items():
            if word in known:
                self._enter(kept, word, child, known[word], known[word].takes)
                continue
            if word in table.refused:
                text = table.refused[word]
            elif child.data is None and " " in str(word):
                text = f"'{shown(word)}' reads as a key: text with a comma stands in quotes within {{…}}"
            else:
                text = f"{what} has no key '{shown(word)}'{suggestion(str(word), known)}"
            self.say(child, table.code or self.codes.unknown, text, key=True)
        self._missing(value, table, what)
        return value.with_data(kept)

    def _missing(self, value: Value, table: Table, what: str) -> None:
        def is_given(name: str) -> bool:
            found = value.get(name)
            return found is not None and found.data is not None

        if table.variants and sum(map(is_given, table.variants)) != 1:
            words = " or ".join(f"'{name}'" for name in table.variants)
            self.say(value, self.codes.wrong, f"{what} needs either {words}", key=True)
        for key in table.keys:
            if key.required and not is_given(key.name):
                example = f"; add {key.example}" if key.example else ""
                self.say(value, self.codes.wrong, f"{what} needs '{key.name}'{example}", key=True)

    def _names(self, value: Value, key: Key, names: Names) -> Value:
        kept: dict[str, Value] = {}
        for name, child in value.items():
            if not isinstance(name, str) or name in names.refused or not names.naming.pattern.match(name):
                text = names.refused.get(str(name)) or f"'{shown(name)}' is no {names.what}; {names.naming.words}"
                text += "; a blank stands between the ':' and the value" if ":" in str(name) else ""
                self.say(child, self.codes.name, text, key=True)
                self.dropped.add((*self._path, str(name)))
            elif child.data is None and isinstance(names.of, Table):
                kept[name] = child
                self._missing(child, names.of, names.of.what.format(shown(name)))
            elif child.data is None and not names.null:
                self._take(child, key, names.of, name)
            else:
                self._enter(kept, name, child, key, names.of)
        return value.with_data(kept)


def _has_broken(value: Value) -> bool:
    data = value.data
    parts = data if isinstance(data, list) else data.values() if isinstance(data, dict) else ()
    return data is BROKEN or any(map(_has_broken, parts))
