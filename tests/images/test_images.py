"""Pictures: what is written is read back, what is broken is refused."""

from __future__ import annotations

import contextlib
import math
import os
import stat
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

from rendergraph.errors import InputError, Problem, RenderError, UsageError
from rendergraph.images import (
    PictureInfo,
    Saved,
    check_target,
    decode,
    decode_light,
    from_srgb,
    heat_map,
    is_numbered,
    mapped,
    numbered,
    output_for,
    read,
    read_metadata,
    save_output,
    save_outputs,
    to_srgb,
    viewable,
    write,
)
from rendergraph.scene.model import ImageSource, SceneLimits

TEXT = "ambient: 0.03  # é 漢字 𝄞\n\t'quoted' \"twice\" \\ back\n" * 500


def ramp(*shape: int, top: float = 1.0, dtype: Any = np.float32) -> Any:
    return np.linspace(0, top, math.prod(shape), dtype=np.float32).reshape(shape).astype(dtype)


def names_of(path: Path) -> tuple[str, ...]:
    image = oiio.ImageInput.open(str(path))
    assert image is not None
    return tuple(image.spec().channelnames)


def write_raw(path: Path, spec: oiio.ImageSpec, pixels: Any) -> None:
    out = oiio.ImageOutput.create(path.suffix[1:])
    assert out is not None
    assert out.open(str(path), spec)
    assert out.write_image(pixels)
    out.close()


# --- write and read --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize(
    ("shape", "names"),
    [((5, 7), "Y"), ((5, 7, 1), "Y"), ((5, 7, 2), "RG"), ((5, 7, 3), "RGB"), ((5, 7, 4), "RGBA"), ((1, 1, 4), "RGBA")],
)
def test_exr_keeps_values_and_names(tmp_path: Path, shape: tuple[int, ...], names: str, half: bool) -> None:
    pixels = ramp(*shape, top=900.0, dtype=np.float16).astype(np.float32)
    write(tmp_path / "a.exr", pixels, half=half)
    back = read(tmp_path / "a.exr")
    assert names_of(tmp_path / "a.exr") == tuple(names)
    assert back.dtype == (np.float16 if half else np.float32)
    assert np.array_equal(back, pixels.reshape(*shape[:2], -1))


@pytest.mark.parametrize(("layers", "count"), [(1, 1), (3, 1), (12, 1), (2, 4), (120, 2)])
def test_exr_layers_come_back_in_order(tmp_path: Path, layers: int, count: int) -> None:
    pixels = ramp(layers, 3, 5, count)
    write(tmp_path / "a.exr", pixels)
    assert np.array_equal(read(tmp_path / "a.exr"), pixels)
    expected = [f"{layer:03d}.{name}" for layer in range(layers) for name in {1: "Y", 2: "RG", 4: "RGBA"}[count]]
    assert sorted(names_of(tmp_path / "a.exr")) == sorted(expected)


def test_top_row_is_first(tmp_path: Path) -> None:
    pixels = np.zeros((4, 3, 3), np.float32)
    pixels[0] = 1
    for name in ("a.exr", "a.hdr", "a.png", "a.jpg"):
        write(tmp_path / name, pixels)
        back = read(tmp_path / name).astype(np.float32)
        assert back[0].mean() > 0.9 * back.max() > back[2:].mean(), name


def test_nan_and_infinity_stay_in_exr(tmp_path: Path) -> None:
    pixels = np.array([[np.nan, np.inf, -np.inf, 1e6]], np.float32)
    write(tmp_path / "a.exr", pixels)
    assert np.array_equal(read(tmp_path / "a.exr")[..., 0], pixels, equal_nan=True)
    write(tmp_path / "h.exr", pixels, half=True)
    half = read(tmp_path / "h.exr")[0, :, 0].astype(np.float32)
    assert np.isnan(half[0])
    assert list(half[1:]) == [np.inf, -np.inf, 65504.0]


@pytest.mark.parametrize("count", [1, 3, 4])
def test_png_keeps_bytes(tmp_path: Path, count: int) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (9, 11, count), np.uint8)
    write(tmp_path / "a.png", pixels)
    assert np.array_equal(read(tmp_path / "a.png"), pixels)  # alpha 0 keeps its colours too


def test_png_encodes_linear_light(tmp_path: Path) -> None:
    pixels = np.array([[[0.0, 0.18, 1.0, 0.5], [2.0, -1.0, np.nan, 1.0]]], np.float32)
    write(tmp_path / "a.png", pixels, encoding="linear")
    assert read(tmp_path / "a.png").tolist() == [[[0, 118, 255, 128], [255, 0, 0, 255]]]


def test_jpeg_has_no_alpha_and_is_close(tmp_path: Path) -> None:
    pixels = np.full((16, 16, 4), (200, 100, 50, 0), np.uint8)
    write(tmp_path / "a.jpeg", pixels)
    back = read(tmp_path / "a.jpeg")
    assert back.shape == (16, 16, 3)
    assert np.abs(back.astype(int) - pixels[..., :3]).max() <= 2


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_hdr_holds_three_channels(tmp_path: Path, count: int) -> None:
    pixels = ramp(6, 8, count, top=50.0) + 1
    write(tmp_path / "a.hdr", pixels)
    back = read(tmp_path / "a.hdr")
    expected = np.zeros((6, 8, 3), np.float32)
    expected[..., : min(count, 3)] = pixels[..., :3]
    if count == 1:
        expected[:] = pixels
    assert np.abs(back - expected).max() <= 50 / 128


def test_display_values_are_decoded_for_exr(tmp_path: Path) -> None:
    write(tmp_path / "a.exr", np.array([[[188, 0, 255, 128]]], np.uint8), encoding="display")
    assert read(tmp_path / "a.exr")[0, 0].tolist() == pytest.approx([0.5029, 0, 1, 128 / 255], abs=1e-4)


def test_whole_numbers_above_24_bits_are_refused(tmp_path: Path) -> None:
    write(tmp_path / "a.exr", np.array([[1 << 24, 7]], np.uint32))
    assert read(tmp_path / "a.exr").ravel().tolist() == [1 << 24, 7]
    for value in (np.array([[(1 << 24) + 1]], np.uint32), np.array([[-(1 << 24) - 1]], np.int32)):
        with pytest.raises(InputError, match=r"b\.exr: RG508 integers above 16777216 \(24 bits\)"):
            write(tmp_path / "b.exr", value)
    assert not (tmp_path / "b.exr").exists()


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.hdr"])
def test_layers_are_refused_where_they_do_not_fit(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="RG508 layers do not fit"):
        write(tmp_path / name, np.zeros((2, 3, 3, 1), np.float32))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["a.exr", "a.png"])
def test_metadata_comes_back(tmp_path: Path, name: str) -> None:
    assert len(TEXT.encode()) > 20_000
    write(tmp_path / name, ramp(4, 4, 3), metadata={"pipeline": TEXT, "device": "llvmpipe", "empty": ""})
    found = read_metadata(tmp_path / name)
    assert found["pipeline"] == TEXT
    assert found["device"] == "llvmpipe"


def test_equal_pictures_are_equal_files(tmp_path: Path) -> None:
    """Also a second later: some formats store the time."""
    files: list[dict[str, bytes]] = []
    for pause in (1.1, 0):
        for name in ("a.exr", "a.png", "a.jpg", "a.hdr"):
            write(tmp_path / name, ramp(8, 8, 3), metadata={"pipeline": TEXT})
        files.append({path.name: path.read_bytes() for path in tmp_path.iterdir()})
        time.sleep(pause)
    assert files[0] == files[1]


# --- whole or not at all ---------------------------------------------------------------------------------------------


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    write(tmp_path / "a.exr", ramp(4, 4, 3))
    before = (tmp_path / "a.exr").read_bytes()
    info = PictureInfo("radiance", "rgba16f", "linear")
    bad = Saved(tmp_path / "b.hdr", np.zeros((2, 4, 4, 1), np.float32), info)
    with pytest.raises(InputError, match="layers do not fit an HDR picture"):
        save_outputs([Saved(tmp_path / "a.exr", ramp(9, 9, 3), info), bad], {})
    assert (tmp_path / "a.exr").read_bytes() == before
    assert os.listdir(tmp_path) == ["a.exr"]


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 64 kB; skips where mounting is not allowed."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "none", folder], capture_output=True).returncode:
        pytest.skip("mounting a small file system is not allowed here")
    yield folder
    subprocess.run(["umount", folder], check=True)


@pytest.mark.parametrize("name", ["a.exr", "a.png", "a.jpg", "a.hdr"])
def test_a_full_disk_is_one_error_and_no_file(small_disk: Path, name: str) -> None:
    with pytest.raises(RenderError, match=r"a\.\w+: RG507 the picture cannot be written: "):
        write(small_disk / name, np.random.default_rng(0).random((256, 256, 3), dtype=np.float32))
    assert list(small_disk.iterdir()) == []


def test_the_file_has_ordinary_permissions_and_links_stay_links(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link.png").symlink_to(tmp_path / "real" / "a.png")
    write(tmp_path / "link.png", np.zeros((2, 2, 3), np.uint8))
    assert (tmp_path / "link.png").is_symlink()
    mask = os.umask(0)
    os.umask(mask)
    assert stat.S_IMODE((tmp_path / "real" / "a.png").stat().st_mode) == 0o666 & ~mask


def test_a_missing_folder_is_an_error_when_writing(tmp_path: Path) -> None:
    with pytest.raises(RenderError, match="RG507"):
        write(tmp_path / "no" / "a.png", np.zeros((2, 2, 3), np.uint8))


# --- which output, which file ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "outputs", "expected"),
    [
        ("a.png", ["image", "radiance"], "image"),
        ("a.JPG", ["image", "radiance"], "image"),
        ("a.exr", ["image", "radiance"], "radiance"),
        ("a.hdr", ["image", "radiance"], "radiance"),
        ("a.exr", ["image"], "image"),
    ],
)
def test_the_extension_chooses_the_output(name: str, outputs: list[str], expected: str) -> None:
    assert output_for(Path(name), outputs) == expected


def test_a_missing_output_is_said_with_a_way_out() -> None:
    with pytest.raises(InputError, match=r"RG505 'a.png' needs the output 'image', .*: -o ao=a.png \(available: ao, "):
        output_for(Path("a.png"), ["ao", "radiance"])
    with pytest.raises(UsageError, match=r"RG501 '.bmp' files are not written; available: \.exr"):
        output_for(Path("a.bmp"), ["image"])
    with pytest.raises(UsageError, match="RG501 'a' has no extension"):
        output_for(Path("a"), ["image"])


def test_frames_are_numbered_in_the_name_only() -> None:
    assert numbered(Path("b##/a.####.png"), 12) == Path("b##/a.0012.png")
    assert numbered(Path("a.##.png"), 1234) == Path("a.1234.png")
    assert not is_numbered(Path("b##/a#1.png"))


def test_targets_are_checked_before_rendering(tmp_path: Path) -> None:
    check_target(tmp_path / "a.png")
    (tmp_path / "file").write_text("")
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(InputError, match=r"RG504 cannot be written: there is no folder '.*no'"):
        check_target(tmp_path / "no" / "a.png")
    with pytest.raises(InputError, match="is not a folder"):
        check_target(tmp_path / "file" / "a.png")
    with pytest.raises(InputError, match="it is a folder"):
        check_target(tmp_path)
    with pytest.raises(InputError, match="it is not a regular file"):
        check_target(tmp_path / "pipe.png")


def test_an_output_is_decoded_for_exr_and_a_tap_is_not(tmp_path: Path) -> None:
    info = PictureInfo("display_color", "rgba8", "display")
    pixels = np.full((2, 2, 4), 188, np.uint8)
    save_output(tmp_path / "o.exr", pixels, info, {"pipeline": "x"})
    save_output(tmp_path / "t.exr", pixels, info, {}, raw=True)
    assert read(tmp_path / "o.exr")[0, 0, 0] == pytest.approx(0.5029, abs=3e-4)
    assert read(tmp_path / "t.exr")[0, 0, 0] == np.float32(188) / np.float32(255)
    save_output(tmp_path / "o.png", pixels, info, {"pipeline": "x"})
    assert np.array_equal(read(tmp_path / "o.png"), pixels[..., :3])  # a picture has no holes
    assert read_metadata(tmp_path / "o.png") == {"pipeline": "x"}


@pytest.mark.parametrize(
    ("info", "count", "names", "dtype"),
    [
        (PictureInfo("depth", "depth32f"), 1, "Z", np.float32),
        (PictureInfo("linear_depth", "r32f"), 1, "Z", np.float32),
        (PictureInfo("occlusion", "r8"), 1, "Y", np.float32),
        (PictureInfo("any", "rg16f"), 2, "RG", np.float16),
        (PictureInfo("radiance", "r11f_g11f_b10f", "linear"), 3, "RGB", np.float16),
        (PictureInfo("radiance", "rgba32f", "linear"), 4, "RGBA", np.float32),
    ],
)
def test_taps_have_the_contract_s_channels(
    tmp_path: Path, info: PictureInfo, count: int, names: str, dtype: Any
) -> None:
    save_output(tmp_path / "a.exr", ramp(3, 4, count), info, {}, raw=True)
    assert names_of(tmp_path / "a.exr") == tuple(names)
    assert read(tmp_path / "a.exr").dtype == dtype


def test_a_shadow_map_s_layers_are_depths(tmp_path: Path) -> None:
    save_output(tmp_path / "a.exr", ramp(2, 3, 4, 1), PictureInfo("shadow_map", "depth32f"), {}, raw=True)
    assert names_of(tmp_path / "a.exr") == ("000.Z", "001.Z")


# --- viewable --------------------------------------------------------------------------------------------------------


def test_srgb_is_its_own_inverse() -> None:
    values = np.linspace(0, 1, 256, dtype=np.float32)
    assert np.allclose(from_srgb(to_srgb(values)), values, atol=1e-6)
    assert np.array_equal((to_srgb(from_srgb(np.arange(256, dtype=np.uint8))) * 255 + 0.5).astype(int), np.arange(256))


@pytest.mark.parametrize(
    ("semantic", "values", "expected"),
    [
        ("radiance", [[0.0, 0.18, 8.0]], [[0, 118, 255]]),
        ("normal", [[0.0, -1.0, 1.0]], [[128, 0, 255]]),
        ("display_color", [[0.0, 0.5, 1.0]], [[0, 128, 255]]),
        ("any", [[0.0, 0.5, 1.0]], [[0, 128, 255]]),
        ("any", [[-4.0, 0.0, 2.0]], [[0, 128, 192]]),
        ("any", [[1.0, 2.0, 3.0]], [[0, 128, 255]]),
    ],
)
def test_colours_are_shown(semantic: str, values: list[list[float]], expected: list[list[int]]) -> None:
    assert viewable(np.array([values], np.float32), semantic)[0].tolist() == expected


def test_a_meaning_of_a_plugin_s_that_is_linear_light_is_shown_as_light() -> None:
    values = np.array([[0.0, 0.2, 1.0, 900.0]], np.float32)
    assert viewable(values, "glow", "linear").tolist() == viewable(values, "radiance").tolist()


def test_a_few_great_values_do_not_leave_the_rest_black() -> None:
    values = np.tile(np.linspace(0.0, 4.0, 100, dtype=np.float32), (100, 1))
    values[50, 50] = 60000.0
    shown = viewable(values, "heat")[..., 0]
    assert shown[50, 50] == 255
    assert np.abs(shown[0].astype(int) - np.linspace(0, 255, 100)).max() <= 4
    one = np.zeros((100, 100), np.float32)
    one[3, 4] = 7.0
    assert viewable(one, "heat").sum() == 255
    assert viewable(-one, "motion")[3:5, 4, 0].tolist() == [0, 128]


def test_depths_are_stretched_and_the_background_is_white() -> None:
    depth = np.array([[0.3, 0.1, 0.2, 0.0]], np.float32)
    assert viewable(depth, "depth")[..., 0].tolist() == [[0, 255, 128, 255]]
    assert viewable(np.array([[2.0, 4.0, np.inf]], np.float32), "linear_depth")[..., 0].tolist() == [[0, 255, 255]]
    assert viewable(np.zeros((2, 2), np.float32), "depth").min() == 255
    assert viewable(np.full((2, 2), 0.5, np.float32), "depth").max() == 0


def test_nan_is_magenta_everywhere() -> None:
    for semantic in ("radiance", "depth", "normal", "visibility", "any"):
        shown = viewable(np.array([[[np.nan], [0.5]]], np.float32), semantic)
        assert shown[0, 0].tolist() == [255, 0, 255], semantic


def test_whole_numbers_get_colours() -> None:
    shown = viewable(np.arange(6, dtype=np.uint32).reshape(2, 3), "any")
    assert shown[0, 0].tolist() == [0, 0, 0]
    assert len({tuple(color) for color in shown.reshape(-1, 3).tolist()}) == 6


def test_layers_lie_in_a_grid_and_two_channels_are_red_and_green() -> None:
    layers = np.stack([np.full((2, 3, 1), value, np.float32) for value in (0.0, 0.2, 0.4)])
    sheet = viewable(layers, "visibility")
    assert sheet.shape == (4, 6, 1)
    assert sheet[2, 0, 0] == 102
    assert viewable(np.full((1, 1, 2), 1.0, np.float32), "any").tolist() == [[[255, 255, 0]]]
    still = np.array([[[0.0, 0.0], [2.0, -2.0]]], np.float32)
    assert viewable(still, "velocity").tolist() == [[[128, 128, 128], [255, 0, 128]]]


@pytest.mark.parametrize("semantic", ["radiance", "depth", "normal", "any", "visibility", "shadow_map"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.uint32, np.int32, np.float16, np.float32])
@pytest.mark.parametrize("shape", [(2, 3), (2, 3, 1), (2, 3, 2), (2, 3, 4), (5, 2, 3, 4), (6, 2, 3, 1)])
def test_every_texture_is_viewable(tmp_path: Path, semantic: str, dtype: Any, shape: tuple[int, ...]) -> None:
    values = np.random.default_rng(0).random(shape) * (1 if np.issubdtype(dtype, np.floating) else 100)
    shown = viewable(values.astype(dtype), semantic)
    assert shown.dtype == np.uint8
    assert shown.shape[2] in (1, 3)
    save_output(tmp_path / "a.png", values.astype(dtype), PictureInfo(semantic), {})
    save_output(tmp_path / "a.exr", values.astype(dtype), PictureInfo(semantic), {}, raw=True)


# --- decode ----------------------------------------------------------------------------------------------------------


def test_images_become_rgba(tmp_path: Path) -> None:
    write(tmp_path / "g.png", np.array([[10, 200]], np.uint8))
    assert decode(ImageSource(tmp_path / "g.png"), srgb=True).tolist() == [[[10, 10, 10, 255], [200, 200, 200, 255]]]
    write(tmp_path / "c.png", np.array([[[1, 2, 3, 0]]], np.uint8))
    data = (tmp_path / "c.png").read_bytes()
    for name in ("c.png", "embedded.glb"):
        found = decode(ImageSource(tmp_path / name, data), srgb=False)
        assert found.tolist() == [[[1, 2, 3, 0]]]


def test_more_than_eight_bits_stay_where_they_count(tmp_path: Path) -> None:
    write_raw(tmp_path / "w.png", oiio.ImageSpec(2, 1, 1, "uint16"), np.array([[[32768], [65535]]], np.uint16))
    data = decode(ImageSource(tmp_path / "w.png"), srgb=False)
    assert data.dtype == np.float16
    assert data[0, 0].tolist() == pytest.approx([0.5, 0.5, 0.5, 1], abs=1e-3)
    assert decode(ImageSource(tmp_path / "w.png"), srgb=True).dtype == np.uint8


@pytest.mark.parametrize("name", ["e.exr", "e.hdr"])
def test_light_is_half_floats(tmp_path: Path, name: str) -> None:
    write(tmp_path / name, np.full((2, 2, 3), 3.5, np.float32))
    found = decode(ImageSource(tmp_path / name), srgb=True)
    assert found.dtype == np.float16
    assert found[0, 0].tolist() == [3.5, 3.5, 3.5, 1]


def test_broken_values_are_replaced_and_counted(tmp_path: Path) -> None:
    pixels = np.ones((2, 3, 3), np.float32)
    pixels[0, 0] = np.nan
    pixels[0, 1, 1] = np.inf
    pixels[1] = 1e9
    write(tmp_path / "a.exr", pixels)
    said: list[Problem] = []
    found = decode(ImageSource(tmp_path / "a.exr", label="sky"), srgb=False, warn=said.append)
    assert np.isfinite(found).all()
    assert found[0, 0].tolist() == [0, 0, 0, 1]
    assert found[0, 1, :2].tolist() == [1, 65504]
    assert [str(problem) for problem in said] == [
        "sky: warning: RG355 1 pixel is NaN or -inf, replaced by 0; 4 pixels are infinite or beyond 65504, replaced by 65504"
    ]


@pytest.mark.parametrize(("size", "warned"), [((4, 4), True), ((4, 3), True), ((8, 4), False), ((5, 3), False)])
def test_a_picture_that_is_not_all_around_is_said(tmp_path: Path, size: tuple[int, int], warned: bool) -> None:
    width, height = size
    pixels = np.random.default_rng(1).random((height, width, 3)).astype(np.float32)
    write(tmp_path / "a.exr", pixels)
    write(tmp_path / "even.exr", np.ones_like(pixels))
    said: list[Problem] = []
    for name in ("a", "even"):
        decode_light(ImageSource(tmp_path / f"{name}.exr", label=name), warn=said.append)
    wanted = f"a: warning: RG356 it is {width}×{height}, but an environment map is twice as wide as high; "
    assert [str(problem) for problem in said] == ([f"{wanted}it is stretched"] if warned else [])


def test_a_wrong_extension_does_not_matter(tmp_path: Path) -> None:
    write(tmp_path / "a.png", np.full((1, 1, 3), 7, np.uint8))
    os.rename(tmp_path / "a.png", tmp_path / "a.jpg")
    assert decode(ImageSource(tmp_path / "a.jpg"), srgb=False)[0, 0].tolist() == [7, 7, 7, 255]


def test_an_exr_is_placed_in_its_display_window(tmp_path: Path) -> None:
    spec = oiio.ImageSpec(2, 1, 3, "float")
    spec.x, spec.y = 1, -1
    spec.full_x, spec.full_y, spec.full_width, spec.full_height = 0, -1, 4, 2
    write_raw(tmp_path / "a.exr", spec, np.ones((1, 2, 3), np.float32))
    found = decode(ImageSource(tmp_path / "a.exr"), srgb=False)
    assert found[..., 0].tolist() == [[0, 1, 1, 0], [0, 0, 0, 0]]


@pytest.mark.parametrize(
    ("names", "text"),
    [(("Y", "RY", "BY"), "luminance and chroma"), (("N.X", "N.Y", "N.Z"), "the channels N.X, N.Y, N.Z; R, G, B")],
)
def test_unusable_channels_are_refused(tmp_path: Path, names: tuple[str, ...], text: str) -> None:
    write(tmp_path / "a.exr", np.zeros((2, 2, 3), np.float32), channels=names)
    with pytest.raises(InputError, match=f"RG354 .*{text}"):
        decode(ImageSource(tmp_path / "a.exr"), srgb=False)


def test_what_is_no_image_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "text.png").write_text("hello")
    (tmp_path / "empty.png").write_bytes(b"")
    for name, text in (
        ("none.png", "RG350 the image does not exist"),
        (".", "RG350 the image is not a regular file"),
        ("pipe.png", "RG350 the image is not a regular file"),
        ("text.png", "RG351 the image has an unknown format; PNG"),
        ("empty.png", "RG352 .* the file is empty"),
        ("a\0b.png", "RG350 the image cannot be read"),
    ):
        with pytest.raises(InputError, match=text):
            decode(ImageSource(tmp_path / name), srgb=False)


# --- broken files ----------------------------------------------------------------------------------------------------


def sample(folder: Path, name: str) -> bytes:
    pixels = np.random.default_rng(2).random((33, 47, 4), dtype=np.float32)
    write(folder / name, pixels, encoding="linear", metadata={"pipeline": TEXT[:2000]})
    return (folder / name).read_bytes()


def refused(path: Path, capfd: pytest.CaptureFixture[str]) -> str:
    started = time.process_time()
    with pytest.raises(InputError, match=r"RG35[1234] ") as caught:
        decode(ImageSource(path), srgb=False)
    assert time.process_time() - started < 20  # an attack takes minutes; a slow machine does not
    assert capfd.readouterr().err == ""  # libpng's own words would stand beside ours
    assert len(caught.value.problems) == 1
    return str(caught.value)


@pytest.mark.parametrize("name", ["a.exr", "a.png", "a.hdr", "a.jpg"])
def test_truncated_files_are_refused_at_every_length(
    tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    data = sample(tmp_path, name)
    tail = 12 if name == "a.png" else 1  # a PNG without its last, empty chunk is complete
    for length in [*range(0, 40), *range(40, len(data) - tail, 997), len(data) - tail - 1]:
        (tmp_path / f"cut{name[1:]}").write_bytes(data[:length])
        message = refused(tmp_path / f"cut{name[1:]}", capfd)
        assert "\n" not in message


@pytest.mark.parametrize("name", ["a.exr", "a.png", "a.hdr", "a.jpg"])
def test_damaged_files_never_crash(tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]) -> None:
    data = sample(tmp_path, name)
    rng = np.random.default_rng(3)
    for _ in range(60):
        damaged = bytearray(data)
        for position in rng.integers(4, len(data), 6):
            damaged[position] = rng.integers(0, 256)
        (tmp_path / f"bad{name[1:]}").write_bytes(damaged)
        started = time.process_time()
        with contextlib.suppress(InputError):
            decode(ImageSource(tmp_path / f"bad{name[1:]}"), srgb=False)
        assert time.process_time() - started < 20  # an attack takes minutes; a slow machine does not
    assert capfd.readouterr().err == ""


def png(width: int, height: int, data: bytes = b"") -> bytes:
    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")


@pytest.mark.parametrize(
    ("width", "height", "text"),
    [
        (2**31 - 1, 2**31 - 1, "RG352"),
        (16385, 1, "RG353 the image is 16385×1 pixels, the limit is 16,384; --limit scene-image-side=N"),
        (16000, 16000, "RG353 the image takes 1,024,000,000 bytes decoded and"),
        (100, 100, "RG352"),
    ],
)
def test_png_headers_that_lie(
    tmp_path: Path, width: int, height: int, text: str, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.png").write_bytes(png(width, height))
    assert text in refused(tmp_path / "a.png", capfd)


@pytest.mark.parametrize(
    "window",
    [(0, 0, 2**31 - 2, 2**31 - 2), (0, 0, 99999, 99999), (-(2**31), 0, 2**31 - 1, 5), (9, 9, 5, 5), (0, 0, 46, 10**6)],
)
@pytest.mark.parametrize("attribute", [b"dataWindow", b"displayWindow"])
def test_exr_headers_that_lie(
    tmp_path: Path, attribute: bytes, window: tuple[int, ...], capfd: pytest.CaptureFixture[str]
) -> None:
    data = bytearray(sample(tmp_path, "a.exr"))
    start = data.index(b"box2i\0", data.index(attribute)) + 10
    data[start : start + 16] = struct.pack("<4i", *window)
    (tmp_path / "a.exr").write_bytes(data)
    refused(tmp_path / "a.exr", capfd)


@pytest.mark.parametrize("size", ["-Y 2000000000 +X 2000000000", "-Y 16000 +X 16000", "-Y 0 +X 5", "-Y 33 +X -47", "x"])
def test_hdr_headers_that_lie(tmp_path: Path, size: str, capfd: pytest.CaptureFixture[str]) -> None:
    data = sample(tmp_path, "a.hdr").replace(b"-Y 33 +X 47", size.encode())
    (tmp_path / "a.hdr").write_bytes(data)
    refused(tmp_path / "a.hdr", capfd)


def test_threads_decode_together_and_stderr_comes_back(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "bad.png").write_bytes(sample(tmp_path, "a.png")[:5000])

    def attempt(number: int) -> bool:
        with contextlib.suppress(InputError):
            return decode(ImageSource(tmp_path / ("a.png" if number % 2 else "bad.png")), srgb=False) is not None
        return False

    with ThreadPoolExecutor(8) as pool:
        assert sum(pool.map(attempt, range(200))) == 100
    os.write(2, b"still here")
    assert capfd.readouterr().err == "still here"


def test_limits_can_be_set(tmp_path: Path) -> None:
    write(tmp_path / "a.png", np.zeros((20, 30, 3), np.uint8))
    decode(ImageSource(tmp_path / "a.png"), srgb=False, limits=SceneLimits(image_side=30))
    with pytest.raises(InputError, match="RG353 the image is 30×20 pixels, the limit is 29; --limit"):
        decode(ImageSource(tmp_path / "a.png"), srgb=False, limits=SceneLimits(image_side=29))


@pytest.mark.slow
def test_a_bomb_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.png").write_bytes(png(4500, 4500, bytes(4500 * 18001)))
    assert "the limit is 1,000; --limit scene-image-ratio=N" in refused(tmp_path / "a.png", capfd)


def test_shared_images_decode(shared: Path) -> None:
    files = [p for p in sorted((shared / "assets").rglob("*")) if p.suffix in (".png", ".jpg", ".jpeg", ".hdr", ".exr")]
    assert files
    for path in files[:12] + files[-4:]:
        assert decode(ImageSource(path), srgb=False).shape[-1] == 4


def test_openimageio_is_imported_on_first_use() -> None:
    code = "import sys, rendergraph.images; sys.exit('OpenImageIO' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_a_png_is_written_without_openimageio(tmp_path: Path) -> None:
    """It takes longer to import than a picture takes to draw."""
    code = "import sys, numpy\nfrom rendergraph.images import write\n"
    code += "write('a.png', numpy.full((2, 3, 4), 7, 'u1'))\nassert 'OpenImageIO' not in sys.modules\n"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path)
    assert (read(tmp_path / "a.png") == 7).all()


def test_a_chosen_range_is_mapped_and_what_is_beyond_is_marked() -> None:
    ramp = np.array([[0.0, 0.25, 0.5, 1.0, 2.0, np.nan, np.inf]], np.float32)
    grey, words = mapped(ramp, "linear", None, 2.0)
    assert words == "linear from 0 to 2; blue below, red above, magenta where it is NaN"
    assert grey[0, :5, 0].tolist() == [0, 32, 64, 128, 255]
    assert grey[0, 5].tolist() == [255, 0, 255]
    assert grey[0, 6].tolist() == [255, 40, 40]
    below, _ = mapped(ramp, "linear", 0.5, 1.0)
    assert below[0, 0].tolist() == [40, 80, 255]
    assert below[0, 2:4, 0].tolist() == [0, 255]
    steps = np.array([[0.01, 0.1, 1.0, 10.0]])
    assert mapped(steps, "log", None, None)[0][0, :, 0].tolist() == [0, 85, 170, 255]
    heat, _ = mapped(np.stack([steps] * 3, axis=-1), "heat", 0.0, 10.0)
    np.testing.assert_array_equal(heat, heat_map(steps / 10))


@pytest.mark.parametrize("scale", ["linear", "log", "heat"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, 3.0])
def test_a_constant_texture_has_a_picture_in_every_mapping(scale: str, value: float) -> None:
    array = np.full((2, 2, 3, 2), value, np.float32)
    assert mapped(array, scale, None, None)[0].shape == (2, 6, 3)
