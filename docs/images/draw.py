"""Draw the pictures of the documentation again: `python docs/images/draw.py [PART OF A NAME …] [--compare]`.

`pictures.yaml` says of each file in this folder how it was made: mostly by `rendergraph run`, once for each panel. What
is printed is by how much the picture differs from the stored one, in 255ths; with `--compare` nothing else is done.
"""

from __future__ import annotations

import math
import os
import re
import runpy
import shlex
import shutil
import sys
from base64 import b64decode
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt
import yaml
from msgspec import Struct

from rendergraph import images
from rendergraph.cli import main as rendergraph
from rendergraph.document import Source, from_plain, load
from rendergraph.resolve import merge_patch
from rendergraph.resources import folder

HERE = Path(__file__).resolve().parent
DOCS = HERE.parent
sys.path.insert(0, str(DOCS))
from images.layout import Layout, laid_out, save  # noqa: E402  # beside this file

SHARED = Path(os.environ.get("RENDERGRAPH_SHARED", DOCS.parents[1] / "shared"))
SCENES = folder("rendergraph.pipelines") / "scenes"
SAME = 0.1
"""Up to this mean difference, in 255ths, a picture is kept: another driver rounds otherwise."""

Bytes = npt.NDArray[np.uint8]


class Panel(Struct, frozen=True, forbid_unknown_fields=True):
    """One picture of a sheet, and what of it is shown.

    Attributes:
        run: words after `rendergraph`; `{}` stands for the file, which without it is an `-o` of its own, `{docs}` for
            the documentation, `{shared}` for assets beside the project. With ` + ` between commands pictures are added.
            Of `compare`, it is the last pipeline's FLIP map.
        crop: x, y, width and height of the part that is shown, before it is enlarged.
        enlarge, shrink: how many times; pixels are repeated, or averaged as light.
    """

    run: str
    crop: tuple[int, int, int, int] | None = None
    enlarge: int = 0
    shrink: int = 0


class Picture(Struct, frozen=True, forbid_unknown_fields=True):
    """How one file is made: from panels, by a program, or neither.

    Attributes:
        panels: row by row; a text is a panel's `run`.
        always: words that each panel's pipeline is followed by.
        columns: panels of a row; all are in one by default.
        gap: white pixels between panels.
        labels: texts that are written into the panels.
        label_size: size of their font in pixels; by default it follows from the width of a row.
        inset: x, y, width and height of a part of every panel that is magnified below it, in pixels of what is shown.
        reference: number of the panel, from 0, whose differences from the others are shown in false colour below them.
        top: the difference, as a share of white, of the brightest of these colours.
        crop, enlarge, shrink: of panels that say nothing else.
        page: a page whose named blocks of code the commands find as files.
        files: further files: text, or a scene, whose `of` names a shipped one or one above that it is merged into.
        program: a Python program in `docs` or `tests` and its words, which writes the file into the current folder.
        measured: commands that measure what it shows anew. They take long, and their times are one machine's.
        by_hand: what was done instead, where no program draws it.
    """

    panels: tuple[str | Panel, ...] = ()
    always: str = ""
    columns: int = 0
    gap: int = 0
    labels: tuple[str, ...] = ()
    label_size: int = 0
    inset: tuple[int, int, int, int] | None = None
    reference: int = -1
    top: float = 0.25
    crop: tuple[int, int, int, int] | None = None
    enlarge: int = 1
    shrink: int = 1
    page: str = ""
    files: dict[str, str | dict[str, Any]] = {}
    program: str = ""
    measured: str = ""
    by_hand: str = ""


UNSCALED = Picture()


class List(Struct, frozen=True, forbid_unknown_fields=True):
    """All of `pictures.yaml`.

    Attributes:
        pictures: files by their names.
        drawings: SVG files that nothing makes: the file itself is what is edited.
    """

    pictures: dict[str, Picture]
    drawings: tuple[str, ...] = ()


def read() -> List:
    """The list.

    Raises:
        msgspec.ValidationError: it says something else than the classes above.
    """
    return msgspec.convert(yaml.safe_load((HERE / "pictures.yaml").read_text(encoding="utf-8")), List)


def commands(picture: Picture) -> list[list[list[str]]]:
    """The command lines of each panel, without the file that each writes: `{}`."""
    lines = [panel if isinstance(panel, str) else panel.run for panel in picture.panels]
    return [[_words(line, picture.always) for line in line.split(" + ")] for line in lines]


def _words(line: str, always: str) -> list[str]:
    """One command line; what always stands there comes first, so that a panel can say otherwise."""
    words = shlex.split(line)
    words[2:2] = shlex.split(always)
    words = [word.replace("{docs}", str(DOCS)).replace("{shared}", str(SHARED)) for word in words]
    return words if any("{}" in word for word in words) else [*words, "-o", "{}"]


def prepare(picture: Picture, place: Path) -> None:
    """Write what the commands read into a folder."""
    if picture.page:
        text = (DOCS / picture.page).read_text(encoding="utf-8")
        for file, block in re.findall(r"^```\w+\n(?:#|//) ([\w/-]+\.\w+)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
            (place / file).parent.mkdir(parents=True, exist_ok=True)
            (place / file).write_text(block, encoding="utf-8")
    for file, content in picture.files.items():
        if isinstance(content, dict):
            scene = dict(content)
            if "of" in scene:
                other = str(scene.pop("of"))
                base = place / other if other in picture.files else SCENES / f"{other}.yaml"
                scene = merge_patch(load(base).root, from_plain(scene, Source(file))).plain()
            content = yaml.safe_dump(scene, sort_keys=False)
        (place / file).write_text(content, encoding="utf-8")


def draw(name: str, picture: Picture, place: Path) -> Path:
    """Draw one picture into a folder; a single panel that is shown whole stays as `run` wrote it, with its pipeline.

    Raises:
        RuntimeError: a command failed.
    """
    made = place / name
    if picture.program:
        program, *words = shlex.split(picture.program)
        before, sys.argv = sys.argv, [program, *words]
        try:
            with chdir(place), redirect_stdout(StringIO()):
                runpy.run_path(str(DOCS.parent / program), run_name="__main__")
        finally:
            sys.argv = before
        return made
    prepare(picture, place)
    panels, details = [], []
    file, report = place / "panel.png", place / "report.html"
    for panel, lines in zip(picture.panels, commands(picture), strict=True):
        total: Any = 0
        for words in lines:
            written = report if words[0] == "compare" else file
            with chdir(place), redirect_stdout(StringIO()):
                if rendergraph([*(word.replace("{}", str(written)) for word in words), "-q"]) != 0:
                    raise RuntimeError(f"{name}: rendergraph {shlex.join(words)}")
            if written == report:
                text = report.read_text(encoding="utf-8")
                file.write_bytes(b64decode(re.findall(r'base64,([^"]+)" alt="FLIP', text)[-1]))
            total = total + images.read(file)[..., :3].astype(np.uint16)
        asked = Panel(panel) if isinstance(panel, str) else panel
        panels.append(_shown(np.minimum(total, 255), asked, picture))
        is_whole = asked == Panel(asked.run) and picture.crop is None
        details.append(_shown(np.minimum(total, 255), asked, UNSCALED) if is_whole else panels[-1])
    panel = picture.panels[0]
    asked = Panel(panel) if isinstance(panel, str) else panel
    untouched = asked == Panel(asked.run) and (picture.crop, picture.enlarge, picture.shrink) == (None, 1, 1)
    is_one = len(panels) == 1 and len(commands(picture)[0]) == 1
    if untouched and is_one and not picture.labels and name.endswith(".png"):
        shutil.copy(file, made)
        return made
    columns = picture.columns or len(panels)
    layout = Layout(
        columns, picture.gap, picture.labels, picture.label_size, picture.inset, picture.reference, picture.top
    )
    save(made, laid_out(panels, layout, details))
    return made


def difference(old: Path, new: Path) -> float:
    """The mean difference of two pictures in 255ths, infinite where one is missing or their sizes differ."""
    if not old.exists():
        return math.inf
    a, b = (images.read(file)[..., :3].astype(np.float64) for file in (old, new))
    return float(np.abs(a - b).mean()) if a.shape[:2] == b.shape[:2] else math.inf


def _shown(pixels: Any, panel: Panel, picture: Picture) -> Bytes:
    """What of a panel is on the sheet."""
    shrink, enlarge, crop = panel.shrink or picture.shrink, panel.enlarge or picture.enlarge, panel.crop or picture.crop
    if shrink > 1:
        height, width = pixels.shape[0] // shrink, pixels.shape[1] // shrink
        light = images.from_srgb(np.asarray(pixels, np.float32) / 255).reshape(height, shrink, width, shrink, -1)
        pixels = np.rint(images.to_srgb(light.mean(axis=(1, 3))) * 255).astype(np.uint8)
    if crop:
        x, y, width, height = crop
        pixels = pixels[y : y + height, x : x + width]
    pixels = np.broadcast_to(pixels, (*pixels.shape[:2], 3))  # grey ones, too
    return np.asarray(pixels.repeat(enlarge, 0).repeat(enlarge, 1), np.uint8)


def main() -> None:
    """Draw those whose names hold one of the words, or all."""
    words = [word for word in sys.argv[1:] if word != "--compare"]
    for name, picture in read().pictures.items():
        if picture.by_hand or picture.measured or (words and not any(word in name for word in words)):
            continue
        with TemporaryDirectory() as place:
            made = draw(name, picture, Path(place))
            off = difference(HERE / name, made)
            print(f"{name}: {off:.2f}", flush=True)
            if off > SAME and "--compare" not in sys.argv:
                shutil.copy(made, HERE / name)


if __name__ == "__main__":
    main()
