"""The list of the documentation's pictures: it names every one, all are shown, and their commands pass `check`."""

from __future__ import annotations

import re
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest

from rendergraph.cli.app import main

DOCS = Path(__file__).parents[1] / "docs"
SPEC: Any = spec_from_file_location("draw", DOCS / "images" / "draw.py")
draw: Any = module_from_spec(SPEC)
sys.modules["draw"] = draw  # where the classes in it look up their annotations
SPEC.loader.exec_module(draw)
LIST: Any = draw.read()
FILES = {file.name for file in (DOCS / "images").iterdir() if file.suffix in (".png", ".jpg", ".svg")}
NOT_CHECKED = {"--tap", "--frames", "--subframes", "-o"}  # what `check` has no such words for, each with one behind it

CHECKED: set[tuple[str, ...]] = set()  # many a picture has the same first panel


def test_every_picture_is_listed_once_and_every_listed_one_is_there() -> None:
    listed = [*LIST.pictures, *LIST.drawings]
    assert sorted(listed) == sorted(FILES)


def test_every_picture_is_shown_on_a_page() -> None:
    pages = [DOCS.parent / "README.md", *(page for page in DOCS.rglob("*.md") if "generated" not in page.parts)]
    shown = {
        name
        for page in pages
        for name in re.findall(r"images/([\w-]+\.(?:png|jpg|svg))", page.read_text(encoding="utf-8"))
    }
    assert shown == FILES


def test_every_picture_has_one_way_to_be_made() -> None:
    wrong = [
        name
        for name, one in LIST.pictures.items()
        if sum(map(bool, (one.panels, one.program, one.measured, one.by_hand))) != 1
    ]
    assert wrong == []
    assert {Path(name).suffix for name in LIST.drawings} == {".svg"}
    told = " ".join(f"{one.program} {one.measured}" for one in LIST.pictures.values())
    programs = re.findall(r"[\w/-]+\.(?:py|yaml)\b", told)
    assert programs
    assert [program for program in programs if not (DOCS.parent / program).is_file()] == []


@pytest.mark.nightly(keep=24)
@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, one in LIST.pictures.items() if one.panels])
def test_the_commands_of_a_picture_pass_check(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = LIST.pictures[name]
    draw.prepare(picture, tmp_path)
    monkeypatch.chdir(tmp_path)
    for lines in draw.commands(picture):
        for words in lines:
            assert sum(word.endswith("{}") for word in words) == 1, words
            rest = iter(words[1:])
            kept = tuple(word for word in rest if word not in NOT_CHECKED or not next(rest))
            others = [word for word in kept if words[0] == "compare" and word.endswith(".yaml")][1:]
            kept = tuple(word for word in kept if word not in others)
            assert (words[0], len(others)) in {("run", 0), ("compare", 1)}
            once = (*kept, name if picture.page or picture.files else "")
            if once in CHECKED or (str(draw.SHARED) in " ".join(kept) and not draw.SHARED.is_dir()):
                continue
            CHECKED.add(once)
            assert main(["check", *kept]) == 0, capsys.readouterr().err


def test_a_sheet_is_put_together_as_its_entry_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Four flat pictures of known colours: their order, gaps, crops, and the mean of light and not of bytes."""
    import numpy as np

    from rendergraph import images

    def rendergraph(words: list[str]) -> int:
        shade = int(words[1])
        pixels = np.full((4, 4, 3), shade, np.uint8)
        pixels[::2] = 255 if shade == 7 else shade
        images.write(Path(words[words.index("-o") + 1]), pixels)
        return 0

    monkeypatch.setattr(draw, "rendergraph", rendergraph)
    panels = (
        "run 10",
        "run 20 + run 30",
        draw.Panel("run 7", shrink=2, enlarge=1),
        draw.Panel("run 40", crop=(1, 1, 2, 2)),
    )
    file = draw.draw("sheet.png", draw.Picture(panels=panels, columns=2, gap=1, crop=(0, 0, 2, 2)), tmp_path)
    shown = images.read(file)[..., 0]
    assert shown.shape == (5, 5)
    assert [int(shown[0, 0]), int(shown[0, 4]), int(shown[4, 4])] == [10, 50, 40]
    assert (shown[2] == 255).all()
    assert (shown[:, 2] == 255).all()
    assert abs(int(shown[4, 0]) - 188) <= 1  # half the light of white, sRGB encoded


def test_a_layout_magnifies_and_measures(tmp_path: Path) -> None:
    """Two grey panels: the frame and the inset of finer pixels, the error's colour for a known difference, JPEG."""
    import numpy as np

    from rendergraph import images

    layout: Any = sys.modules["images.layout"]
    panels = [np.full((40, 60, 3), shade, np.uint8) for shade in (100, 151)]  # 0.2 of white apart
    details = [panel.repeat(2, 0).repeat(2, 1) for panel in panels]
    details[1][30, 40] = (255, 0, 0)
    plan = layout.Layout(2, gap=4, inset=(10, 10, 20, 10), reference=0, top=0.4)
    sheet = layout.laid_out(panels, plan, details)
    assert sheet.shape == (40 + 4 + 30 + 4 + 40, 60 + 4 + 60, 3)
    assert sheet[8, 20].tolist() == [255, 196, 0]  # the frame around the part
    assert sheet[44 + 1, 64 + 30].tolist() == [255, 196, 0]  # and around its enlargement
    assert (sheet[44 + 2 : 44 + 28, 2:58] == 100).all()
    assert 1 <= (sheet[44:74, 64:] == (255, 0, 0)).all(axis=-1).sum() <= 4  # one pixel of 1.5 by 1.5
    half = layout.false_color(np.array(0.5))
    assert np.abs(sheet[-2, 70].astype(int) - half).max() <= 1
    layout.save(tmp_path / "a.jpg", sheet)
    assert np.abs(images.read(tmp_path / "a.jpg").astype(int) - sheet).mean() < 6
    labelled = layout.laid_out(panels[:1], layout.Layout(1, labels=("A",)))
    assert labelled.max() > 200
    assert labelled.min() < 90
