"""`check` looks at an image's first bytes, drawing decodes it: both accept the same, and refuse with the same code."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from rendergraph.errors import InputError
from rendergraph.images import decode
from rendergraph.scene.model import ImageSource
from rendergraph.scene.reading import Reading, inside

KINDS = {
    ".png": "uint8",
    ".jpg": "uint8",
    ".exr": "half",
    ".hdr": "float",
    ".bmp": "uint8",
    ".tga": "uint8",
    ".gif": "uint8",
    ".tif": "uint8",
    ".webp": "uint8",
    ".ppm": "uint8",
    ".pgm": "uint8",
    ".pfm": "float",
    ".dpx": "uint16",
    ".sgi": "uint8",
    ".ico": "uint8",
    ".jp2": "uint8",
    ".iff": "uint8",
    ".rla": "uint8",
}


def verdicts(path: Path) -> tuple[str, str]:
    """The codes of what `check` and decoding say of a file, `fine` where they take it."""
    said = []
    reading = Reading(path.parent / "scene.yaml", inside(path.parent))
    for look in (lambda: reading.image(path, "texture"), lambda: decode(ImageSource(path), srgb=False)):
        try:
            look()
            said.append("fine")
        except InputError as error:
            said.append(error.problems[0].code)
    return said[0], said[1]


def written(path: Path, channels: int, kind: str, names: tuple[str, ...] = (), size: tuple[int, int] = (6, 4)) -> bool:
    spec = oiio.ImageSpec(*size, channels, kind)
    if names:
        spec.channelnames = names
    out = oiio.ImageOutput.create(str(path))
    if out is None or not out.open(str(path), spec):
        oiio.geterror()
        return False
    pixels = np.full((size[1], size[0], channels), 0.25, np.float32)
    fine = bool(out.write_image(pixels))
    out.close()
    return fine


@pytest.mark.parametrize("suffix", sorted(KINDS))
def test_check_takes_the_kinds_that_are_decoded(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"image{suffix}"
    if not written(path, 1 if suffix == ".pgm" else 3, KINDS[suffix]):
        pytest.skip(f"this OpenImageIO writes no {suffix}")
    read = suffix in (".png", ".jpg", ".exr", ".hdr", ".bmp", ".tga")
    assert verdicts(path) == (("fine", "fine") if read else ("RG351", "RG351"))
    renamed = path.rename(tmp_path / "image.png")  # the name says nothing, but for TGA
    assert verdicts(renamed) == (("fine", "fine") if read and suffix != ".tga" else ("RG351", "RG351"))


@pytest.mark.parametrize(
    ("names", "code"),
    [
        (("R", "G", "B"), "fine"),
        (("R", "G", "B", "A"), "fine"),
        (("Y",), "fine"),
        (("A", "Y"), "fine"),
        (("R", "G", "B", "Z"), "fine"),
        (("N.X", "N.Y", "N.Z"), "RG354"),
        (("R", "G"), "RG354"),
        (("Y", "RY", "BY"), "RG354"),
        (("Z",), "RG354"),
    ],
)
def test_check_asks_for_the_channels_that_are_decoded(names: tuple[str, ...], code: str, tmp_path: Path) -> None:
    path = tmp_path / "image.exr"
    assert written(path, len(names), "half", names)
    assert verdicts(path) == (code, code)


def test_a_deep_image_is_refused_by_both(tmp_path: Path) -> None:
    path = tmp_path / "image.exr"
    spec = oiio.ImageSpec(2, 2, 3, "half")
    spec.deep = True
    out = oiio.ImageOutput.create(str(path))
    assert out is not None
    assert out.open(str(path), spec)
    data = oiio.DeepData()
    data.init(spec)
    assert out.write_deep_image(data)
    out.close()
    assert verdicts(path) == ("RG354", "RG354")


@pytest.mark.parametrize("suffix", [".png", ".exr", ".bmp", ".tga", ".hdr"])
def test_what_is_too_large_is_refused_by_both(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"image{suffix}"
    assert written(path, 3, KINDS[suffix], size=(16_385, 1))
    assert verdicts(path) == ("RG353", "RG353")


def test_what_an_exr_shows_counts_as_what_it_stores(tmp_path: Path) -> None:
    path = tmp_path / "image.exr"
    spec = oiio.ImageSpec(2, 2, 3, "half")
    spec.full_width, spec.full_height = 16_000, 16_000
    out = oiio.ImageOutput.create(str(path))
    assert out is not None
    assert out.open(str(path), spec)
    out.write_image(np.zeros((2, 2, 3), np.float32))
    out.close()
    assert verdicts(path) == ("RG353", "RG353")
