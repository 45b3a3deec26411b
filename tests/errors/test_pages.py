"""The pages of error codes: their wrong text gets exactly their message, their right text gets none."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import yaml

from rendergraph.catalog import Catalog
from rendergraph.declare import LightFacts
from rendergraph.errors import Problem, RendergraphError
from rendergraph.link import link
from rendergraph.resolve import resolve
from rendergraph.resources import folder
from rendergraph.settings import load

PARTS = Path(__file__).parent / "wrong_files" / "parts"
LIGHTS = (LightFacts("key", "directional"), LightFacts("lamp", "spot"))
MODULES = ("document", "settings", "catalog", "read", "resolve", "link")
PAGES = {path.name[:5]: path for path in sorted(folder("rendergraph.errors").glob("RG*.yaml"))}
ELSEWHERE = (  # need several files or a GPU
    "RG018",
    "RG131",
    "RG152",
    "RG155",
    "RG204",
    "RG205",
    "RG206",
    "RG401",
    "RG493",
    "RG494",
    "RG495",
    "RG496",
    "RG497",
    "RG498",
)


def own_codes() -> set[str]:
    """Codes that the stages before the schedule use."""
    root = folder("rendergraph")
    files = [file for name in MODULES for file in (*root.glob(f"{name}.py"), *root.glob(f"{name}/*.py"))]
    return {code for file in files for code in re.findall(r'"(RG\d{3})"', file.read_text(encoding="utf-8"))}


NAMES = {"settings": "rendergraph.toml", "node": "glow.py", "shader": "glow.frag", "compute": "glow.comp"}
CHECKED = sorted(own_codes() - set(ELSEWHERE))


def page_of(code: str) -> dict[str, Any]:
    page: dict[str, Any] = yaml.safe_load(PAGES[code].read_text(encoding="utf-8"))
    return page


def said(kind: str, text: str, where: Path, catalog: Catalog) -> list[str]:
    """Everything that is said about a text, without the file's name."""
    file = where / NAMES.get(kind, "pipeline.yaml")
    file.write_text(text, encoding="utf-8")
    found: tuple[Problem, ...] = ()
    try:
        if kind == "pipeline":
            spec = resolve(file, catalog=catalog)
            found = (*spec.notes, *link(spec, catalog, LIGHTS).warnings)
        elif kind == "command":
            words = shlex.split(text)
            sets = [words[number + 1] for number, word in enumerate(words) if word == "-s"]
            link(resolve(PARTS / "forward.yaml", catalog=catalog, sets=sets), catalog, LIGHTS)
        elif kind == "settings":
            load(file)
        else:
            found = Catalog.discover([file], installed=False).get("glow").warnings
    except RendergraphError as error:
        found = error.problems
    return [str(problem).splitlines()[0].removeprefix(f"{file}:").removeprefix(" ") for problem in found]


@pytest.mark.parametrize("code", CHECKED)
def test_a_page_tells_the_truth(code: str, tmp_path: Path, toy_catalog: Catalog) -> None:
    page = page_of(code)
    (tmp_path / "base.yaml").write_text((PARTS / "forward.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    assert said(page["kind"], page["wrong"], tmp_path, toy_catalog) == [page["message"]]
    assert code in page["message"]
    right = tmp_path / "right"
    right.mkdir()
    (right / "base.yaml").write_text((PARTS / "forward.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    assert said(page["kind"], page["right"], right, toy_catalog) == []


@pytest.mark.parametrize("code", sorted({*CHECKED, *ELSEWHERE}))
def test_every_code_has_a_whole_page(code: str) -> None:
    page = page_of(code)
    assert set(page) == {"code", "title", "kind", "about", "wrong", "message", "right"}
    assert page["code"] == code
    assert PAGES[code].name.startswith(f"{code}-")
    assert not page["title"].endswith(".")
