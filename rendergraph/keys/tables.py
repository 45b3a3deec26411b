"""Tables: the keys of mappings in a file, known keys or names that authors choose."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import Any, TypeAlias

from msgspec import Struct, field

from rendergraph import typecheck
from rendergraph.document import Value
from rendergraph.typecheck import Schema, conversion_to, json_schema


class Key(Struct, frozen=True):
    """One key of a table.

    Attributes:
        type: the type of its values: an annotation, see `keys.values`, or a mapping.
        default: the value if the file has none; None means absent.
        unit: the unit's symbol, empty for a pure number.
        example: how it is written, for messages.
        code: error code for a value that does not fit; empty for the file's usual one.
    """

    name: str
    type: Type
    doc: str
    default: Any = None
    unit: str = ""
    required: bool = False
    example: str = ""
    code: str = ""


class Table(Struct, frozen=True, dict=True):
    """A mapping with known keys.

    Attributes:
        what: its name in messages, such as `light '{}'`, which is formatted with the entry's name.
        alternatives: keys of which exactly one is required, and the further keys that each allows, always or by its
            value.
        refused: keys that users might expect, with the message for each.
        code: error code for an unknown key; empty for the file's usual one.
    """

    what: str
    keys: tuple[Key, ...]
    alternatives: Mapping[str, tuple[Key, ...] | Mapping[str, tuple[Key, ...]]] = field(default_factory=dict)
    refused: Mapping[str, str] = field(default_factory=dict)
    code: str = ""

    @cached_property
    def _common(self) -> dict[str, Key]:
        return {key.name: key for key in self.keys}

    def keys_of(self, value: Value) -> dict[str, Key]:
        """Return the keys that a mapping may have; an alternative with an unknown value allows those of all values."""
        found = self._common
        for name, allowed in self.alternatives.items():
            given = value.get(name)
            if given is None or given.data is None:
                continue
            if not isinstance(allowed, tuple):
                allowed = allowed.get(str(given.data)) or tuple(key for keys in allowed.values() for key in keys)
            found = found | {key.name: key for key in allowed}
        return found

    def sections(self, name: str = "") -> Iterator[tuple[str, tuple[Key, ...]]]:
        """Yield the keys of the table and of nested tables, section by section, each with its name."""
        always = [key for allowed in self.alternatives.values() if isinstance(allowed, tuple) for key in allowed]
        keys = (*self.keys, *always)
        yield name, keys
        for key, allowed in self.alternatives.items():
            if not isinstance(allowed, tuple):
                yield from ((f"{name} ({key}: {word})", more) for word, more in allowed.items())
        for one in keys:
            inner = one.type.of if isinstance(one.type, MapOf) else one.type
            if isinstance(inner, Table):
                yield from inner.sections(f"{name} ({one.name})" if name else one.name)


class Naming(Struct, frozen=True):
    """Legal names: the pattern of a whole name, and its description, which follows `use`."""

    pattern: re.Pattern[str]
    words: str


FREE = Naming(re.compile(r"[^\x00-\x1f\x7f-\x9f]+\Z"), "text without control characters")


class MapOf(Struct, frozen=True):
    """A mapping with names that authors choose.

    Attributes:
        refused: names that have another meaning, with the message for each.
        null: values may be null; a table without required keys always may.
    """

    of: Type
    naming: Naming = FREE
    what: str = "name"
    refused: Mapping[str, str] = field(default_factory=dict)
    null: bool = True
    least: int = 0


class Recursive(Struct, frozen=True):
    """A table, or a value of a type in its place; `itself` means that it is the table of the whole file."""

    type: Any
    table: Callable[[], Table]
    itself: bool = True


Type: TypeAlias = "Table | MapOf | Recursive | Any"
"""The type of a key's values: a mapping, or an annotation."""


def brief(type: Type) -> str:
    """Return a short description of a type."""
    if isinstance(type, Table | MapOf):
        return "mapping"
    return typecheck.brief(type.type if isinstance(type, Recursive) else type)


def plain(value: Value, type: Type) -> Any:
    """Convert a validated value to plain Python by its type; nulls are left out of mappings."""
    if isinstance(type, Recursive):
        type = type.table() if isinstance(value.data, dict) and not type.itself else Any
    if not isinstance(type, Table | MapOf):
        return conversion_to(type)(value.plain())
    given = {name: child for name, child in value.items() if child.data is not None}
    if isinstance(type, MapOf):
        return {name: plain(child, type.of) for name, child in given.items()}
    keys = type.keys_of(value)
    return {name: plain(child, keys[name].type) for name, child in given.items() if name in keys}


# --- JSON Schema (draft 07, which editors support) --------------------------------------------------------------


def schema(type: Type) -> Schema:
    if isinstance(type, Recursive):
        place = "#" if type.itself else f"#/definitions/{type.table().what}"
        return {"anyOf": [json_schema(type.type), {"$ref": place}]}
    if isinstance(type, Table):
        return _table(type)
    if not isinstance(type, MapOf):
        return json_schema(type)
    values = schema(type.of)
    refused = {"not": {"enum": list(type.refused)}} if type.refused else {}
    return {
        "type": "object",
        "propertyNames": {**typecheck.Matching(type.naming.pattern).schema("string"), **refused},
        "additionalProperties": values if isinstance(type.of, Table) or not type.null else nullable(values),
        **({"minProperties": type.least} if type.least else {}),
    }


def file_schema(table: Table) -> Schema:
    """Return the schema of a kind of file; its `$id` ends in the version of the format."""
    kind = table.what.split()[1]  # of "a pipeline", "a scene file"
    head = {"$schema": "http://json-schema.org/draft-07/schema#", "$id": f"urn:rendergraph:{kind}:1"}
    types = [key.type for _, keys in table.sections() for key in keys]
    inner = [type.table() for type in types if isinstance(type, Recursive) and not type.itself]
    definitions = {"definitions": {each.what: _table(each) for each in inner}} if inner else {}
    return {**head, **_table(table), **definitions}


def as_markdown(value: Any) -> Any:
    """Return a schema that also has descriptions as Markdown, for editors that show it."""
    if isinstance(value, list):
        return [as_markdown(part) for part in value]
    if not isinstance(value, dict):
        return value
    text = value.get("description")
    is_markdown = isinstance(text, str) and ("`" in text or "\n" in text)
    more = {"markdownDescription": text} if is_markdown else {}
    return {key: as_markdown(part) for key, part in value.items()} | more


_GIVEN: Schema = {"not": {"type": "null"}}


def _table(table: Table) -> Schema:
    required = [key.name for key in table.keys if key.required]
    found = {
        "type": "object" if required or table.alternatives else ["object", "null"],
        "properties": _properties(table.keys),
        **({"required": required} if required else {}),
    }
    if not table.alternatives:
        return {**found, "additionalProperties": False}
    common: dict[str, Any] = {key.name: True for key in table.keys}
    rules = []
    for name, allowed in table.alternatives.items():
        for word, keys in [(None, allowed)] if isinstance(allowed, tuple) else allowed.items():
            condition = _has(name, _GIVEN if word is None else {"const": word})
            then = {"properties": common | _properties(keys), "additionalProperties": False}
            rules.append({"if": condition, "then": then})
    return {**found, "oneOf": [_has(name, _GIVEN) for name in table.alternatives], "allOf": rules}


def _has(name: str, values: Schema) -> Schema:
    return {"properties": {name: values}, "required": [name]}


def _properties(keys: tuple[Key, ...]) -> Schema:
    found: dict[str, Schema] = {}
    for key in keys:
        values, about = schema(key.type), key.doc
        if key.default is not None:
            about += f"\n\nDefault {json.dumps(key.default, ensure_ascii=False)}{' ' if key.unit else ''}{key.unit}."
        elif key.unit:
            about += f"\n\nin {key.unit}."
        found[key.name] = {**(values if key.required else nullable(values)), "description": about}
        if key.default is not None:
            found[key.name]["default"] = list(key.default) if isinstance(key.default, tuple) else key.default
    return found


def nullable(values: Schema) -> Schema:
    """Return a schema that also accepts null, which means absent."""
    if "oneOf" in values:  # `oneOf` must match null exactly once
        return {"anyOf": [values, {"type": "null"}]}
    if "anyOf" in values:
        return {**values, "anyOf": [*values["anyOf"], {"type": "null"}]}
    enum = {"enum": [*values["enum"], None]} if "enum" in values else {}
    kind = {"type": [values["type"], "null"]} if isinstance(values.get("type"), str) else {}
    return {**values, **enum, **kind}
