"""Primaries of EXR files: stated when written, converted when read, as OpenColorIO does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import pytest

from rendergraph.images import PictureInfo, decode, decode_light, save_output
from rendergraph.images.decode import to_rec709
from rendergraph.images.encode import REC709
from rendergraph.scene.model import ImageSource

REC2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
ACESCG = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)


def wide_file(path: Path, pixels: npt.NDArray[np.float32], primaries: tuple[float, ...]) -> ImageSource:
    height, width, _ = pixels.shape
    spec = oiio.ImageSpec(width, height, 3, "float")
    spec.attribute("chromaticities", oiio.TypeDesc("float[8]"), primaries)
    out = oiio.ImageOutput.create("openexr")
    assert out is not None
    assert out.open(str(path), spec)
    assert out.write_image(pixels)
    assert out.close()
    return ImageSource(path)


@pytest.mark.parametrize(("primaries", "space"), [(REC2020, "Linear Rec.2020"), (ACESCG, "ACEScg")])
def test_other_primaries_are_converted(tmp_path: Path, primaries: tuple[float, ...], space: str) -> None:
    """Saturated colours outside of Rec. 709 are clipped; white stays white."""
    colors = np.random.default_rng(1).random((8, 16, 3), np.float32)
    colors[0, 0] = 1.0
    source = oiio.ImageBuf(oiio.ImageSpec(16, 8, 3, "float"))
    source.set_pixels(oiio.ROI(), colors)
    target = oiio.ImageBufAlgo.colorconvert(
        source, space, "Linear Rec.709 (sRGB)", colorconfig="ocio://cg-config-latest"
    )
    assert not target.has_error, target.geterror()
    expected = np.maximum(np.asarray(target.get_pixels(oiio.FLOAT)), 0)
    found = decode_light(wide_file(tmp_path / "wide.exr", colors, primaries))[..., :3].astype(np.float32)
    np.testing.assert_allclose(found, expected, atol=2e-3)
    np.testing.assert_allclose(found[0, 0], 1, atol=1e-3)


def test_rec709_and_data_stay_as_they_are(tmp_path: Path) -> None:
    colors = np.random.default_rng(2).random((8, 16, 3)).astype(np.float16).astype(np.float32)
    np.testing.assert_array_equal(decode_light(wide_file(tmp_path / "a.exr", colors, REC709))[..., :3], colors)
    data = decode(wide_file(tmp_path / "b.exr", colors, REC2020), srgb=False)
    np.testing.assert_array_equal(data[..., :3], colors)
    np.testing.assert_allclose(to_rec709(REC709), np.eye(3), atol=1e-12)


@pytest.mark.parametrize(("encoding", "stated"), [("linear", True), ("display", True), (None, False)])
def test_written_light_states_its_primaries(tmp_path: Path, encoding: str | None, stated: bool) -> None:
    save_output(tmp_path / "a.exr", np.zeros((4, 4, 3), np.float32), PictureInfo("any", "", encoding), {})
    image = oiio.ImageInput.open(str(tmp_path / "a.exr"))
    assert image is not None
    found = image.spec().get("chromaticities")
    image.close()
    assert found is None if not stated else np.allclose(found, REC709)
