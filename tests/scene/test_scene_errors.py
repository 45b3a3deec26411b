"""The error pages of scenes: the wrong text gives exactly the message, the mended one loads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from rendergraph.errors import InputError
from rendergraph.resources import folder
from rendergraph.scene import animate
from rendergraph.scene.load import load

PAGES = sorted(path for path in folder("rendergraph.errors").glob("RG3[0-4]*.yaml"))


def said(text: str, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Messages of a text without the file's name."""
    name = "a.yaml" if kind == "scene" else "a.gltf" if text.startswith("{") else "a.obj"
    (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    try:
        scene = animate.complete(load(Path(name)))
        animate.at(scene, 1.0)
        problems = scene.warnings
    except InputError as error:
        problems = error.problems
    lines = [str(problem).splitlines()[0] for problem in problems]
    return [line.removeprefix(f"{name}:").removeprefix(" ") for line in lines]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_gives_exactly_its_message(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found: dict[str, Any] = yaml.safe_load(page.read_text())
    assert found.keys() >= {"code", "title", "kind", "about", "wrong", "message", "right"}
    assert page.stem.startswith(found["code"])
    assert said(found["wrong"], found["kind"], tmp_path, monkeypatch) == [found["message"]]
    assert said(found["right"], found["kind"], tmp_path, monkeypatch) == []
