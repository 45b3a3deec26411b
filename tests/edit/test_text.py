"""YAML text changed in place: the values are those of the change, and every other byte is as before."""

from __future__ import annotations

import copy
import json
import re
from collections import Counter
from typing import Any

import pytest
import yaml
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rendergraph.document import parse
from rendergraph.edit.text import DELETED, edit, rename
from rendergraph.errors import InputError

CASES = {
    "add with the file's line break": ("a: 1\r\nb: 2  # c\r\n", ("n",), 3, "a: 1\r\nb: 2  # c\r\nn: 3\r\n"),
    "add without a last line break": ("a: {b: 1}\nc: 2", ("n",), [1], "a: {b: 1}\nc: 2\nn: [1]"),
    "add before blank lines": (
        "a:\n    b: |\n      text\n\n\n# end\n",
        ("a", "n"),
        1,
        "a:\n    b: |\n      text\n    n: 1\n\n\n# end\n",
    ),
    "add behind a text that keeps them": (
        "a:\n  b: |+\n    x\n\nc: 1\n",
        ("a", "n"),
        1,
        "a:\n  b: |+\n    x\n\n  n: 1\nc: 1\n",
    ),
    "add to braces": ("a: {b: 1,  c: }\n", ("a", "n"), 1, "a: {b: 1,  c: , n: 1}\n"),
    "add to empty braces": ("a: { }\n", ("a", "n"), "x", "a: {n: x }\n"),
    "add a line in braces": (
        "a: {\n  b: 1,\n  c: 2  # c\n}\n",
        ("a", "n"),
        1,
        "a: {\n  b: 1,\n  c: 2,\n  n: 1  # c\n}\n",
    ),
    "add in place of a null": ("a:  # c\nb: 1\n", ("a", "n", "m"), 1, "a: {n: {m: 1}}  # c\nb: 1\n"),
    "add in a list": ("a:\n  - b: 1\n    c: 2\n", ("a", 0, "n"), 3, "a:\n  - b: 1\n    c: 2\n    n: 3\n"),
    "replace in a list": ("a: [x, y,  z]\n", ("a", 1), "w", "a: [x, w,  z]\n"),
    "replace lines": ("a:  # keep\n  # inside\n  b: 1  # x\nc: 2\n", ("a",), 5, "a: 5  # keep\n  # inside\nc: 2\n"),
    "replace lines at the end": ("c: 2\na:\n  b: 1", ("a",), 5, "c: 2\na: 5"),
    "replace a text": ("a: |  \n  x\n\nb: 1\n", ("a",), "é: 😀", 'a: "é: 😀"\n\nb: 1\n'),
    "delete a line": ("a: 1\n# of b\nb: 2  # too\nc: 3\n", ("b",), None, "a: 1\n# of b\nc: 3\n"),
    "delete the last line": ("a: 1\r\nb: 2", ("b",), None, "a: 1"),
    "delete the only entry": ("a:\n  b: 1\nc: 2\n", ("a", "b"), None, "a: {}\nc: 2\n"),
    "delete beside a dash": ("a:\n  - b: 1\n    c: 2\n", ("a", 0, "b"), None, "a:\n  - c: 2\n"),
    "delete the first in braces": ("a: {b: 1,  c: 2}\n", ("a", "b"), None, "a: {c: 2}\n"),
    "delete before a comment": ("a: {b: 1, # c\n  d: 2}\n", ("a", "b"), None, "a: { # c\n  d: 2}\n"),
    "delete the last in braces": ("a: {b: 1, # c\n  d: 2 }\n", ("a", "d"), None, "a: {b: 1 # c\n }\n"),
    "delete before a last comma": ("a: {b: 1, d: 2,}\n", ("a", "d"), None, "a: {b: 1, }\n"),
    "delete before a leading comma": ("a: {b: 1 # c\n  , d: 2}\n", ("a", "b"), None, "a: {d: 2}\n"),
    "delete below an alias": ("a: &x {b: 1, c: 2}\nd: *x\n", ("d", "b"), None, "a: &x {b: 1, c: 2}\nd: {c: 2}\n"),
    "set below an alias": ("a: &x {b: 1}\nd: *x\n", ("d", "b"), 2, "a: &x {b: 1}\nd: {b: 2}\n"),
    "replace an anchor nobody uses": ("a: &x {b: 1}\n", ("a",), 2, "a: 2\n"),
    "replace in any script": ("日本: {größe: 1}  # 😀\n", ("日本", "größe"), 2, "日本: {größe: 2}  # 😀\n"),
}


@pytest.mark.parametrize(("text", "path", "value", "after"), CASES.values(), ids=CASES)
def test_an_edit_by_example(text: str, path: tuple[Any, ...], value: Any, after: str) -> None:
    assert edit(text, path, DELETED if value is None else value) == after


def test_a_key_by_example() -> None:
    assert rename('a: {"b":1}  # c\n', ("a", "b"), "n") == 'a: {"n":1}  # c\n'
    assert rename("? a\n: 1\n'b': 2\n", ("b",), "n") == "? a\n: 1\nn: 2\n"


# --- texts of every style ---------------------------------------------------------------------------------------------

WORDS = st.sampled_from(["a", "light", "no", "x-1", "größe", "日本", "😀 b", "a b", "0x", "null ", "#1", "- q", "k: v"])
SCALARS = st.one_of(st.none(), st.booleans(), st.integers(-99, 99), st.floats(-9, 9, width=16), WORDS)
KEYS = st.sampled_from(["a", "b", "light", "no", "größe", "日本", "k-1", "a.b", "😀"])
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=6,
)
TREES = st.dictionaries(KEYS, VALUES, min_size=1, max_size=4)


class Writer:
    """Writes a value as YAML with styles, spaces, comments and line breaks that are drawn."""

    def __init__(self, draw: Any) -> None:
        self._draw = draw
        self.newline = draw(st.sampled_from(["\n", "\r\n"]))

    def pick(self, *choices: Any) -> Any:
        return self._draw(st.sampled_from(choices))

    def scalar(self, value: Any, *, key: bool = False, flow: bool = False) -> str:
        if isinstance(value, str):
            plain = re.fullmatch(r"[^\W\d][\w.-]*", value) is not None and value not in ("null", "true", "false")
            quoted = ["'" + value.replace("'", "''") + "'", '"' + value.replace('"', '\\"') + '"']
            return str(self.pick(*quoted, *([value] * 3 if plain else [])))
        if value is None:
            return str(self.pick("null", "~", *([] if key or flow else [""])))
        return {True: "true", False: "false"}[value] if isinstance(value, bool) else repr(value)

    def entry(self, name: str, value: Any) -> str:
        key = self.scalar(name, key=True)
        if value is None and self.pick(True, False):
            return f"{key}: "
        return key + (":" if key[0] == '"' and self.pick(True, False) else ": ") + self.flow(value)

    def comment(self) -> str:
        return str(self.pick("", "", "", "  # ein Rest: {x}, [y]", " # c"))

    def own_line(self, indent: int) -> str:
        return str(self.pick("", "", "", " " * indent + "# above, {a: 1}" + self.newline, self.newline))

    def flow(self, value: Any) -> str:
        gap = self.pick("", "", " ", self.newline + "        ", f" # in, [side]{self.newline}        ")
        if isinstance(value, dict):
            inner = f",{gap or ' '}".join(self.entry(*item) for item in value.items())
            end = self.pick("", " ", ",") if value else self.pick("", " ")
            return f"{{{gap}{inner}{end}}}"
        if isinstance(value, list):
            return "[" + f",{gap or ' '}".join(map(self.flow, value)) + "]"
        return str(self.scalar(value, flow=True))

    def block(self, tree: dict[str, Any], indent: int) -> str:
        text = ""
        for key, value in tree.items():
            text += self.own_line(indent) + " " * indent + self.scalar(key, key=True) + ":"
            if isinstance(value, dict) and value and self.pick(True, True, False):
                text += self.comment() + self.newline + self.block(value, indent + self.pick(1, 2, 4))
            elif isinstance(value, str) and value.isalnum() and self.pick(True, False, False):
                more = self.newline if self.pick(True, False) else ""
                text += " |-" + self.newline + " " * (indent + 3) + value + self.newline + more
            else:
                written = self.scalar(value) if not isinstance(value, dict | list) else self.flow(value)
                text += (self.pick(" ", "   ") + written if written else "") + self.comment() + self.newline
        return text


@st.composite
def documents(draw: Any) -> tuple[str, dict[str, Any]]:
    tree = draw(TREES)
    writer = Writer(draw)
    head = writer.pick("", "", f"# yaml-language-server: $schema=x{writer.newline}", f"---{writer.newline}")
    text = head + (writer.block(tree, 0) if writer.pick(True, True, False) else writer.flow(tree) + writer.newline)
    if writer.pick(True, False):
        text = text.rstrip("\r\n")
    assume(plain(text) == tree)
    return text, tree


def plain(text: str) -> Any:
    try:
        return parse(text).root.plain()
    except InputError:
        return None


def paths(tree: Any, before: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every entry of every mapping below mappings."""
    if not isinstance(tree, dict):
        return []
    return [path for key, child in tree.items() for path in [(*before, key), *paths(child, (*before, key))]]


def span(text: str, path: tuple[Any, ...]) -> tuple[int, int]:
    """Where an entry stands, from its key to the end of its value: from PyYAML's other parser."""
    node: Any = yaml.compose(text, yaml.SafeLoader)
    key = node
    for step in path:
        key, node = next((k, v) for k, v in node.value if k.value == str(step))
    last = node
    while isinstance(last, yaml.CollectionNode) and not last.flow_style:
        last = last.value[-1][1] if isinstance(last, yaml.MappingNode) else last.value[-1]
    end = last.end_mark.index
    if getattr(last, "style", None) == "|":
        end = len(text[:end].rstrip())
    return key.start_mark.index, max(end, key.end_mark.index)


def lost(before: str, after: str) -> tuple[str, str, int]:
    """What is removed, what is put there, and where: between the longest common beginning and end."""
    start = next(
        (i for i, (x, y) in enumerate(zip(before, after, strict=False)) if x != y), min(len(before), len(after))
    )
    most = min(len(before), len(after)) - start
    end = next((i for i in range(most) if before[-1 - i] != after[-1 - i]), most)
    return before[start : len(before) - end], after[start : len(after) - end], start


def lines(text: str) -> list[str]:
    return re.findall(r"[^\r\n]*(?:\r\n|\n|\Z)", text)


@settings(max_examples=40, deadline=None)
@given(documents(), st.data())
def test_a_value_is_replaced_and_nothing_else(document: tuple[str, dict[str, Any]], data: st.DataObject) -> None:
    text, tree = document
    path, value = data.draw(st.sampled_from(paths(tree))), data.draw(VALUES)
    after = edit(text, path, value)
    expected = copy.deepcopy(tree)
    holder = expected
    for step in path[:-1]:
        holder = holder[step]
    holder[path[-1]] = value
    assert repr(plain(after)) == repr(expected)
    first, last = span(text, path)
    if "\n" in text[first:last]:  # a value in lines takes the comment of its last line
        last += len(text[last:].partition("\n")[0])
    removed, _, at = lost(text, after)
    assert after == text or (first <= at and at + len(removed) <= last + 2)
    assert comments(after) >= comments(text[:first]) + comments(text[last:])


def comments(text: str) -> Counter[str]:
    return Counter(re.findall(r"(?:(?<=\s)|^)#[^\r\n]*", text))


@settings(max_examples=40, deadline=None)
@given(documents(), st.data())
def test_an_entry_is_added_and_nothing_is_lost(document: tuple[str, dict[str, Any]], data: st.DataObject) -> None:
    text, tree = document
    holders = [(), *(path for path in paths(tree) if isinstance(plain_at(tree, path), dict))]
    path, value = data.draw(st.sampled_from(holders)), data.draw(VALUES)
    more = data.draw(st.sampled_from([("new",), ("new", "inner")]))
    after = edit(text, (*path, *more), value)
    expected = copy.deepcopy(tree)
    plain_at(expected, path)["new"] = value if len(more) == 1 else {"inner": value}
    assert repr(plain(after)) == repr(expected)
    removed, _, _ = lost(text, after)
    assert removed == ""
    assert after.count("\r") == (after.count("\n") if "\r" in text else 0)


def plain_at(tree: Any, path: tuple[Any, ...]) -> Any:
    for step in path:
        tree = tree[step]
    return tree


@settings(max_examples=40, deadline=None)
@given(documents(), st.data())
def test_an_entry_is_deleted_with_its_line_or_comma(document: tuple[str, dict[str, Any]], data: st.DataObject) -> None:
    text, tree = document
    path = data.draw(st.sampled_from(paths(tree)))
    after = edit(text, path, DELETED)
    expected = copy.deepcopy(tree)
    del plain_at(expected, path[:-1])[path[-1]]
    assert repr(plain(after)) == repr(expected)
    only = len(plain_at(tree, path[:-1])) == 1 and len(path) > 1
    first, last = span(text, path[:-1] if only else path)
    put = text[first : span(text, path)[0]] if only else ""
    put += "" if not only else "}" if letters(put).endswith("{") else "{}"
    with_line = last + len(text[last:].partition("\n")[0])
    if len(tree) > 1 or only:
        assert letters(after) in (
            letters(text[:first] + put + text[last:]),
            letters(text[:first] + put + text[with_line:]),
        )
    assert comments(after) >= comments(text[:first]) + comments(text[with_line:])


def letters(text: str) -> str:
    """Without spaces, commas and comments."""
    return re.sub(r"[\s,]", "", re.sub(r"(?:(?<=\s)|^)#[^\r\n]*", "", text))


@settings(max_examples=40, deadline=None)
@given(documents(), st.data())
def test_a_key_is_renamed_and_nothing_else(document: tuple[str, dict[str, Any]], data: st.DataObject) -> None:
    text, tree = document
    path = data.draw(st.sampled_from(paths(tree)))
    after = rename(text, path, "new_name")
    first, _ = span(text, path)
    removed, _, at = lost(text, after)
    assert first <= at + len(removed) <= len(text)
    assert text[:first] == after[:first]
    node: Any = yaml.compose(text, yaml.SafeLoader)
    for step in path[:-1]:
        node = next(v for k, v in node.value if k.value == str(step))
    key = next(k for k, _ in node.value if k.value == str(path[-1]))
    first, last = key.start_mark.index, key.end_mark.index
    assert after in [text[:first] + written + text[last:] for written in ("new_name", '"new_name"')]
    assert list(plain_at(plain(after), path[:-1])) == [
        "new_name" if name == path[-1] else name for name in plain_at(tree, path[:-1])
    ]


@settings(max_examples=40, deadline=None)
@given(documents(), st.lists(SCALARS, max_size=3) | st.dictionaries(KEYS, VALUES, max_size=3), st.data())
def test_what_an_anchor_shares_changes_alone_or_not_at_all(
    document: tuple[str, dict[str, Any]], shared: Any, data: st.DataObject
) -> None:
    text, tree = document
    assume(not text.startswith(("{", "---", "#")))
    newline = "\r\n" if "\r\n" in text else "\n"
    text = f"first: &x {Writer(data.draw).flow(shared)}{newline}{text.rstrip()}{newline}last: {{in: *x}}{newline}"
    tree = {"first": shared, **tree, "last": {"in": shared}}
    assume(plain(text) == tree)
    path = data.draw(st.sampled_from(paths(tree)))
    value = data.draw(st.one_of(VALUES, st.just(DELETED)))
    expected = copy.deepcopy(json.loads(json.dumps(tree)))
    if value is DELETED:
        del plain_at(expected, path[:-1])[path[-1]]
    else:
        plain_at(expected, path[:-1])[path[-1]] = value
    try:
        after = plain(edit(text, path, value))
    except InputError:
        assert path[0] == "first"  # nothing else is refused
    else:
        assert repr(after) == repr(expected)
