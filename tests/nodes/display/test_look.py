"""Looks against tables interpolated in float64, OpenColorIO, and closed forms; their mistakes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import pytest

import rendergraph as rg
from rendergraph.errors import InputError
from rendergraph.images import from_srgb

Floats = npt.NDArray[np.float64]
SIDE = 9
CONFIG = """ocio_profile_version: 2
environment: {}
roles: {scene_linear: linear, default: linear}
colorspaces:
  - !<ColorSpace> {name: linear}
displays: {screen: [!<View> {name: raw, colorspace: linear}]}
looks:
  - !<Look> {name: brighter, process_space: linear, transform: !<CDLTransform> {slope: [2, 1, 0.5]}}
  - !<Look> {name: flatter, process_space: linear, transform: !<CDLTransform> {offset: [0.1, 0.1, 0.1]}}
"""


def cube_text(table: Floats, kind: str = "3D", head: str = "") -> str:
    rows = "".join(f"{r:.9g} {g:.9g} {b:.9g}\n" for r, g, b in table.reshape(-1, 3))
    return f'TITLE "a look"  # a comment\n{head}LUT_{kind}_SIZE {len(table)}\n\n{rows}'


def display_colors(seed: int, count: int = 2048) -> Floats:
    """Random display colours, the corners and the greys among them, (1, n, 3)."""
    colors = np.random.default_rng(seed).random((count, 3))
    colors[:8] = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
    colors[8:40] = np.linspace(0, 1, 32)[:, None]
    return colors[None]


def eight_bits(session: rg.Session) -> float:
    """How far a value may lie from that of 8 bits: GPUs do not round exactly."""
    return (0.55 if session.device.software else 0.6) / 255


def through(session: rg.Session, colors: Floats, look: Path | str, *sets: str) -> Floats:
    """What a look makes of display colours, (1, n, 3) from 0 to 1; light is displayed as it is."""
    light = np.ones((*colors.shape[:2], 4), np.float32)
    light[..., :3] = from_srgb(colors)
    pipeline = rg.load(
        {"rendergraph": 1, "nodes": {"display": {"type": "tonemap"}}, "outputs": {"image": "display.color"}},
        sets=["display.curve=none", "display.dither=false", f"display.look={look}", *sets],
        size=(colors.shape[1], 1),
    ).set("display.radiance", light)
    found: Floats = np.asarray(session.render(pipeline)["image"], np.float64)[..., :3] / 255
    return found


def trilinear(table: Floats, colors: Floats) -> Floats:
    at = colors * (len(table) - 1)
    lower = np.minimum(at.astype(int), len(table) - 2)
    f, result = at - lower, np.zeros_like(colors)
    for corner in np.ndindex(2, 2, 2):
        r, g, b = np.moveaxis(lower + corner, -1, 0)
        weight = np.prod(np.where(corner, f, 1 - f), axis=-1, keepdims=True)
        result += weight * table[b, g, r]
    return result


def tetrahedral(table: Floats, colors: Floats) -> Floats:
    """Along the edges of a cell in the order of the fractions, the greatest first (Kasson et al. 1995)."""
    at = colors * (len(table) - 1)
    lower = np.minimum(at.astype(int), len(table) - 2)
    f = at - lower
    order = np.argsort(-f, axis=-1, kind="stable")
    place, result = lower.copy(), table[tuple(np.moveaxis(lower, -1, 0))[::-1]]
    for axis in range(3):
        step = np.take_along_axis(f, order[..., axis : axis + 1], axis=-1)
        before = table[tuple(np.moveaxis(place, -1, 0))[::-1]]
        np.put_along_axis(
            place, order[..., axis : axis + 1], np.take_along_axis(place, order[..., axis : axis + 1], -1) + 1, -1
        )
        result = result + step * (table[tuple(np.moveaxis(place, -1, 0))[::-1]] - before)
    return np.asarray(result)


def grid(side: int) -> Floats:
    steps = np.linspace(0, 1, side)
    blue, green, red = np.meshgrid(steps, steps, steps, indexing="ij")
    return np.stack([red, green, blue], axis=-1)


@pytest.mark.parametrize("kind", ["3D", "1D"])
def test_a_table_that_changes_nothing(session: rg.Session, tmp_path: Path, kind: str) -> None:
    table = grid(SIDE) if kind == "3D" else np.repeat(np.linspace(0, 1, 33)[:, None], 3, axis=1)
    (tmp_path / "same.cube").write_text(cube_text(table, kind))
    colors = np.round(display_colors(1) * 255) / 255
    np.testing.assert_array_equal(through(session, colors, tmp_path / "same.cube"), colors)


def test_tables_of_colors_are_interpolated_in_tetrahedra(session: rg.Session, tmp_path: Path) -> None:
    """Within the rounding to 8 bits; trilinear interpolation of the same table is far off."""
    table = np.random.default_rng(2).random((SIDE, SIDE, SIDE, 3))
    (tmp_path / "random.cube").write_text(cube_text(table))
    colors = display_colors(3)
    found = through(session, colors, tmp_path / "random.cube")
    np.testing.assert_allclose(found, tetrahedral(table, colors), atol=eight_bits(session))
    assert np.abs(found - trilinear(table, colors)).mean() > 5 / 255


@pytest.mark.parametrize("kind", ["3D", "1D"])
def test_smooth_tables_agree_with_opencolorio(session: rg.Session, tmp_path: Path, kind: str) -> None:
    smooth = grid(33) if kind == "3D" else np.repeat(np.linspace(0, 1, 256)[:, None], 3, axis=1)
    table = np.clip(smooth ** np.array([0.8, 1.0, 1.4]), 0, 1)
    if kind == "3D":
        table = 0.8 * table + 0.2 * table.mean(axis=-1, keepdims=True)
    (tmp_path / "smooth.cube").write_text(cube_text(table, kind))
    colors = display_colors(4)
    picture = oiio.ImageBuf(oiio.ImageSpec(colors.shape[1], 1, 3, "float"))
    picture.set_pixels(oiio.ROI(), np.ascontiguousarray(colors, np.float32))
    expected = oiio.ImageBufAlgo.ociofiletransform(picture, str(tmp_path / "smooth.cube"), unpremult=False)
    assert not expected.has_error, expected.geterror()
    found = through(session, colors, tmp_path / "smooth.cube")
    np.testing.assert_allclose(found, np.asarray(expected.get_pixels(oiio.FLOAT), np.float64), atol=1 / 255)


def test_the_domain_of_a_table(session: rg.Session, tmp_path: Path) -> None:
    """Colours outside of it are those at its border."""
    head = "DOMAIN_MIN 0.25 0 0\nDOMAIN_MAX 0.75 1 2\n"
    (tmp_path / "part.cube").write_text(cube_text(grid(SIDE), head=head))
    colors = display_colors(5)
    expected = np.clip((colors - (0.25, 0, 0)) / (0.5, 1, 2), 0, 1)
    np.testing.assert_allclose(through(session, colors, tmp_path / "part.cube"), expected, atol=eight_bits(session))


@pytest.mark.parametrize("kind", ["3D", "1D"])
def test_the_range_of_a_table_agrees_with_opencolorio(session: rg.Session, tmp_path: Path, kind: str) -> None:
    table = grid(SIDE) if kind == "3D" else np.repeat(np.linspace(0, 1, 33)[:, None], 3, axis=1)
    text = cube_text(table, kind, f"LUT_{kind}_INPUT_RANGE 0.25 1.5\n")
    (tmp_path / "part.cube").write_text(text.partition("\n")[2])  # OpenColorIO takes no TITLE beside a range
    colors = display_colors(7)
    picture = oiio.ImageBuf(oiio.ImageSpec(colors.shape[1], 1, 3, "float"))
    picture.set_pixels(oiio.ROI(), np.ascontiguousarray(colors, np.float32))
    expected = oiio.ImageBufAlgo.ociofiletransform(picture, str(tmp_path / "part.cube"), unpremult=False)
    found = through(session, colors, tmp_path / "part.cube")
    np.testing.assert_allclose(found, np.asarray(expected.get_pixels(oiio.FLOAT), np.float64), atol=1 / 255)


def test_a_name_without_a_look_is_refused() -> None:
    with pytest.raises(InputError, match=r"RG104 node 'display' .tonemap.: 'look_name' needs a 'look'"):
        rg.load("forward", sets=["display.look_name=flatter"]).link()


def test_other_files_of_opencolorio(session: rg.Session, tmp_path: Path) -> None:
    """A colour correction after the ASC: slope, offset and power of each channel."""
    (tmp_path / "warm.cc").write_text(
        '<ColorCorrection id="warm"><SOPNode><Slope>0.9 0.8 0.5</Slope><Offset>0.1 0 0</Offset><Power>1 1 1</Power>'
        "</SOPNode></ColorCorrection>"
    )
    colors = display_colors(6)
    found = through(session, colors, tmp_path / "warm.cc")
    np.testing.assert_allclose(found, colors * (0.9, 0.8, 0.5) + (0.1, 0, 0), atol=eight_bits(session))


def test_looks_of_a_configuration_change_light(session: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "config.ocio").write_text(CONFIG)
    colors = display_colors(7)
    first = through(session, colors, tmp_path / "config.ocio", "display.exposure=-1")
    light = from_srgb(colors) / 2
    np.testing.assert_allclose(from_srgb(first), np.clip(light * (2, 1, 0.5), 0, 1), atol=6e-3)
    second = through(session, colors, tmp_path / "config.ocio", "display.look_name=flatter")
    np.testing.assert_allclose(from_srgb(second), np.clip(from_srgb(colors) + 0.1, 0, 1), atol=6e-3)


def test_a_look_is_beside_the_file_that_names_it(session: rg.Session, tmp_path: Path) -> None:
    """In a pipeline that another one extends; a changed file is another look."""
    (tmp_path / "looks").mkdir()
    (tmp_path / "looks" / "base.yaml").write_text("extends: forward\nnodes: {display: {params: {look: dark.cube}}}\n")
    (tmp_path / "p.yaml").write_text("extends: ./looks/base.yaml\n")
    drawn = []
    for strength in (0.0, 0.5):
        (tmp_path / "looks" / "dark.cube").write_text(cube_text(grid(2) * strength))
        drawn.append(session.render(rg.load(tmp_path / "p.yaml", size=(16, 16)))["image"][..., :3].max())
    assert drawn[0] == 0
    assert 64 < drawn[1] <= 128
    (tmp_path / "looks" / "base.yaml").write_text("extends: forward\nnodes: {display: {params: {look: ../a.cube}}}\n")
    (tmp_path / "a.cube").write_text(cube_text(grid(2)))
    with pytest.raises(InputError, match=r"base.yaml:2:\d+: RG012 "):
        rg.load(tmp_path / "looks" / "base.yaml").link()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "look.cube:1: the file has neither LUT_1D_SIZE nor LUT_3D_SIZE"),
        ("LUT_3D_SIZE 2\nLUT_1D_SIZE 2\n", "look.cube:2: the file has both"),
        ("\nLUT_3D_SIZE two\n", "look.cube:2: LUT_3D_SIZE must be a whole number from 2 to 256"),
        ("LUT_3D_SIZE 300\n", "look.cube:1: LUT_3D_SIZE must be a whole number from 2 to 256"),
        ("LUT_1D_SIZE 2\nLUT_1D_SIZE 2\n", "look.cube:2: 'LUT_1D_SIZE' occurs twice"),
        ("LUT_1D_SIZE 2\n0 0 0\n# end\n", "look.cube:3: LUT_1D_SIZE 2 takes 2 rows, the file has 1"),
        ("LUT_1D_SIZE 2\n0 0 0\n1 1\n", "look.cube:3: expected three numbers, got 2"),
        ("LUT_1D_SIZE 2\n0 0 0\n1 1 1,0\n", "look.cube:3: expected three numbers, got '1 1 1,0'"),
        ("LUT_1D_SIZE 2\n0 0 nan\n1 1 1\n", "look.cube:2: expected finite numbers, got '0 0 nan'"),
        ("LUT_1D_SIZE 2\n0 0 0\nTITLE x\n1 1 1\n", "look.cube:3: 'TITLE' comes after the first row"),
        (
            "DOMAIN_MIN 0 0 1\nLUT_1D_SIZE 2\n0 0 0\n1 1 1\n",
            "look.cube:1: the start of the domain is not below its end",
        ),
        ("LUT_1D_SIZE 2\nLUT_1D_INPUT_RANGE 1 1\n0 0 0\n1 1 1\n", "look.cube:2: the start of the domain is not below"),
        ("LUT_1D_INPUT_RANGE 1\nLUT_1D_SIZE 2\n0 0 0\n1 1 1\n", "look.cube:1: LUT_1D_INPUT_RANGE takes two numbers"),
        ("DOMAIN_MAX 1 1\nLUT_1D_SIZE 2\n0 0 0\n1 1 1\n", "look.cube:1: expected three numbers, got '1 1'"),
    ],
)
def test_malformed_tables_are_told_with_both_places(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "look.cube").write_text(text)
    (tmp_path / "p.yaml").write_text("extends: forward\nnodes:\n  display: {params: {look: look.cube}}\n")
    with pytest.raises(InputError) as error:
        rg.load(tmp_path / "p.yaml").link()
    assert "p.yaml:3:28: RG104 node 'display' (tonemap): " in str(error.value)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("name", "text", "sets", "message"),
    [
        ("a.ocio", CONFIG, ("look_name=bright",), "has no look 'bright'; its looks are 'brighter', 'flatter'"),
        ("a.ocio", "nothing", (), "a.ocio: "),
        ("a.cube", "LUT_1D_SIZE 2\n0 0 0\n1 1 1\n", ("look_name=x",), "'look_name' is for configurations"),
        ("a.txt", "nothing", (), "a.txt: "),
        ("a.3dl", "nothing", (), "a.3dl: Error parsing .3dl file"),
    ],
)
def test_what_opencolorio_refuses(tmp_path: Path, name: str, text: str, sets: tuple[str, ...], message: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError) as error:
        rg.load("forward", sets=[f"display.look={tmp_path / name}", *(f"display.{one}" for one in sets)]).link()
    assert message in str(error.value)


def test_a_look_is_shown_by_its_path(tmp_path: Path) -> None:
    (tmp_path / "same.cube").write_text(cube_text(grid(2)))
    linked = rg.load("forward", sets=[f"display.look={tmp_path / 'same.cube'}"]).link()
    assert str(linked.graph["display"].node.look) == str(tmp_path / "same.cube")  # type: ignore[attr-defined]
