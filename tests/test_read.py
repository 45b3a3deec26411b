"""The grammar of pipeline files. Its messages are in `errors/wrong_files/`."""

from __future__ import annotations

from pathlib import Path

import pytest

from rendergraph.document import YamlLimits
from rendergraph.errors import InputError
from rendergraph.read import checked, entries, read, word

TEXT = """
rendergraph: 1
description: A test
nodes:
  a: {type: gbuffer}
  b-1: {type: blur, inputs: {source: a.albedo, more: [a.normal, a.depth], none: null}, params: {radius: 3}}
outputs: {image: b-1.blurred}
"""


def test_a_right_file_is_read_as_it_is() -> None:
    document = read(None, TEXT)
    assert document.root.plain()["nodes"]["b-1"]["inputs"] == {
        "source": "a.albedo",
        "more": ["a.normal", "a.depth"],
        "none": None,
    }
    assert list(entries(document.root, "nodes")) == ["a", "b-1"]
    assert list(entries(document.root, "nodes", "b-1", "inputs")) == ["source", "more"]
    assert word(document.root, "nodes", "a", "type") == "gbuffer"
    assert word(document.root, "nodes", "c", "type") is None


def test_a_file_is_named_by_its_path(tmp_path: Path) -> None:
    file = tmp_path / "f.yaml"
    file.write_text(TEXT + "node: {}\n")
    with pytest.raises(InputError, match=r"f.yaml:8:1: RG101 a pipeline has no key 'node'; did you mean 'nodes'\?"):
        read(file)
    with pytest.raises(InputError, match=r"^mine:8:1: RG101"):
        read(file, name="mine")


def test_going_on_leaves_out_what_is_wrong() -> None:
    wrong = TEXT.replace("type: gbuffer", "type: [gbuffer], typ: 1, inputs: {x: *nowhere}")
    document = read(None, wrong, keep_going=True)
    assert [problem.code for problem in document.problems] == ["RG006", "RG106", "RG105"]
    assert document.root.plain()["nodes"]["a"] == {"inputs": {}}
    assert ("nodes", "a", "type") in document.dropped
    assert ("nodes", "a", "inputs", "x") in document.dropped


def test_nulls_stay_for_merging() -> None:
    document = read(None, "nodes: {a: null, b: {type: null, params: null}}\noutputs: null\nscene: null")
    assert document.root.plain() == {
        "nodes": {"a": None, "b": {"type": None, "params": None}},
        "outputs": None,
        "scene": None,
    }


def test_a_patch_extends_nothing() -> None:
    with pytest.raises(InputError, match="RG101 a patch cannot extend a pipeline"):
        read(None, "extends: forward", patch=True)
    assert checked(read(None, TEXT), patch=True).root.plain() == read(None, TEXT).root.plain()


def test_an_empty_patch_is_none() -> None:
    with pytest.raises(InputError, match="RG013"):
        read(None, "", patch=True)


def test_limits_reach_the_yaml() -> None:
    with pytest.raises(InputError, match="--limit yaml-depth=N"):
        read(None, TEXT, YamlLimits(depth=2))


def test_nothing_to_read() -> None:
    with pytest.raises(ValueError, match="needs a path or a text"):
        read(None)
