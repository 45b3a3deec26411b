"""Tables: what the mappings of a file hold, as keys that are known or as names that are free."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import Any, TypeAlias

from msgspec import Struct, field

from rendergraph.document import Value
from rendergraph.keys.forms import Form, Schema, regular


class Key(Struct, frozen=True):
    """One key of a table.

    Attributes:
        name: as written in the file.
        takes: what its values are.
        doc: one line.
        default: the value where the file has none; None where that means absent.
        unit: the unit's symbol, empty for a pure number.
        required: it must be there.
        example: how it is written, for messages.
        code: of the mistake that a value does not fit; empty where it is the file's usual one.
    """

    name: str
    takes: Takes
    doc: str
    default: Any = None
    unit: str = ""
    required: bool = False
    example: str = ""
    code: str = ""


Variant: TypeAlias = "tuple[Key, ...] | Mapping[str, tuple[Key, ...]]"
"""The keys that a key brings with it, whatever its value, or by its value."""


class Table(Struct, frozen=True, dict=True):
    """A mapping of known keys.

    Attributes:
        what: how messages name it, `light '{}'`, with its own name put in.
        keys: what it may hold.
        variants: keys of which exactly one is there, and the keys that each brings with it: always the same, or by the
            word that is its value.
        refused: keys that one might look for, and what is said of them.
        code: of an unknown key; empty where it is the file's usual one.
    """

    what: str
    keys: tuple[Key, ...]
    variants: Mapping[str, Variant] = field(default_factory=dict)
    refused: Mapping[str, str] = field(default_factory=dict)
    code: str = ""

    @cached_property
    def _own(self) -> dict[str, Key]:
        return {key.name: key for key in self.keys}

    def keys_of(self, value: Value) -> dict[str, Key]:
        """The keys that a mapping may hold; where its variant is not known, those of all."""
        found = self._own
        for name, brings in self.variants.items():
            given = value.get(name)
            if given is None or given.data is None:
                continue
            if isinstance(brings, tuple):
                known = [brings]
            else:
                own = brings.get(str(given.data))
                known = list(brings.values()) if own is None else [own]
            found = found | {key.name: key for keys in known for key in keys}
        return found

    def sections(self, name: str = "") -> Iterator[tuple[str, tuple[Key, ...]]]:
        """All keys of it and of what is in it, section by section, each with its name."""
        always = [key for brings in self.variants.values() if isinstance(brings, tuple) for key in brings]
        keys = (*self.keys, *always)
        yield name, keys
        for key, brings in self.variants.items():
            if not isinstance(brings, tuple):
                yield from ((f"{name} ({key}: {word})", own) for word, own in brings.items())
        for one in keys:
            inner = one.takes.of if isinstance(one.takes, Names) else one.takes
            if isinstance(inner, Table):
                yield from inner.sections(f"{name} ({one.name})" if name else one.name)


class Naming(Struct, frozen=True):
    """Which names are good.

    Attributes:
        pattern: of all of a name.
        words: what makes one.
    """

    pattern: re.Pattern[str]
    words: str


FREE = Naming(re.compile(r"[^\x00-\x1f\x7f-\x9f]+\Z"), "names are text")


class Names(Struct, frozen=True):
    """A mapping of free names.

    Attributes:
        of: what each name has.
        naming: which names there may be.
        what: a name, in words.
        refused: names that have another meaning, and what is said of them.
        null: a name may have null; a table of no required key always may.
        least: how many there are at least.
    """

    of: Takes
    naming: Naming = FREE
    what: str = "name"
    refused: Mapping[str, str] = field(default_factory=dict)
    null: bool = True
    least: int = 0


class Later(Struct, frozen=True):
    """A table that holds itself, or a value in its place.

    Attributes:
        form: of the value.
        table: what gives the table.
    """

    form: Form
    table: Callable[[], Table]


Takes: TypeAlias = "Form | Table | Names | Later"
"""What a key takes: a value, or a mapping."""


def briefly(takes: Takes) -> str:
    """What a key takes, in a word or two for a table."""
    if isinstance(takes, Later):
        return takes.form.shown
    return takes.shown if isinstance(takes, Form) else "mapping"


def plain(value: Value, takes: Takes) -> Any:
    """What a value that fits means, as plain Python; what is null is left out of mappings."""
    if isinstance(takes, Form):
        return takes.plain(value)
    if isinstance(takes, Later):
        return value.plain()
    given = {name: child for name, child in value.items() if child.data is not None}
    if isinstance(takes, Names):
        return {name: plain(child, takes.of) for name, child in given.items()}
    keys = takes.keys_of(value)
    return {name: plain(child, keys[name].takes) for name, child in given.items() if name in keys}


# --- JSON Schema (draft 07, which is what editors read) --------------------------------------------------------------


def schema(takes: Takes) -> Schema:
    """The JSON Schema of what a key takes."""
    if isinstance(takes, Form):
        return takes.schema()
    if isinstance(takes, Later):
        return {"anyOf": [takes.form.schema(), {"$ref": "#"}]}
    if isinstance(takes, Table):
        return _table(takes)
    values = schema(takes.of)
    refused = {"not": {"enum": list(takes.refused)}} if takes.refused else {}
    return {
        "type": "object",
        "propertyNames": {"pattern": regular(takes.naming.pattern), **refused},
        "additionalProperties": nullable(values) if takes.null and isinstance(takes.of, Form) else values,
        **({"minProperties": takes.least} if takes.least else {}),
    }


def file_schema(table: Table) -> Schema:
    """The JSON Schema of a file."""
    return {"$schema": "http://json-schema.org/draft-07/schema#", **_table(table)}


def as_markdown(value: Any) -> Any:
    """A schema, where editors that show Markdown are told what is written in it; the others take it as it stands."""
    if isinstance(value, list):
        return [as_markdown(part) for part in value]
    if not isinstance(value, dict):
        return value
    text = value.get("description")
    is_markdown = isinstance(text, str) and ("`" in text or "\n" in text)
    more = {"markdownDescription": text} if is_markdown else {}
    return {key: as_markdown(part) for key, part in value.items()} | more


def _table(table: Table) -> Schema:
    required = [key.name for key in table.keys if key.required]
    found = {
        "type": "object" if required or table.variants else ["object", "null"],
        "properties": {key.name: key_schema(key) for key in table.keys},
        **({"required": required} if required else {}),
    }
    if not table.variants:
        return {**found, "additionalProperties": False}
    known: dict[str, Any] = {key.name: True for key in table.keys}
    rules = []
    for name, brings in table.variants.items():
        for word, own in [(None, brings)] if isinstance(brings, tuple) else brings.items():
            condition = {"type": "string"} if word is None else {"const": word}
            rules.append(
                {
                    "if": {"properties": {name: condition}, "required": [name]},
                    "then": {
                        "properties": known | {key.name: key_schema(key) for key in own},
                        "additionalProperties": False,
                    },
                }
            )
    one = [{"properties": {name: {"type": "string"}}, "required": [name]} for name in table.variants]
    return {**found, "oneOf": one, "allOf": rules}


def key_schema(key: Key) -> Schema:
    """The JSON Schema of a key, with its docs."""
    values = schema(key.takes)
    default = list(key.default) if isinstance(key.default, tuple) else key.default
    about = f"{key.doc}\n\n{default_words(default, key.unit)}".rstrip() if default is not None or key.unit else key.doc
    found = {**(values if key.required else nullable(values)), "description": about}
    return found if default is None else {**found, "default": default}


def default_words(default: Any, unit: str) -> str:
    """`Default 45 °.`, or the unit alone."""
    value = "" if default is None else f"Default {json.dumps(default, ensure_ascii=False)}"
    return " ".join(part for part in (value, f"in {unit}" if unit and not value else unit) if part) + "."


def nullable(values: Schema) -> Schema:
    """The same or null, which stands for what is not there."""
    if isinstance(values.get("type"), str):
        found = {**values, "type": [values["type"], "null"]}
        return found | ({"enum": [*values["enum"], None]} if "enum" in values else {})
    if "enum" in values:
        return {**values, "enum": [*values["enum"], None]}
    if "anyOf" in values:
        return {**values, "anyOf": [*values["anyOf"], {"type": "null"}]}
    return values
