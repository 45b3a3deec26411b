"""Pictures on a sheet against NumPy: where they stand, the mean of their light, their labels; and the terms on one."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.errors import InputError

Floats = npt.NDArray[np.float64]
SMALL = ["sun.resolution=64", "display.dither=false"]


def sheet(pictures: list[str], size: tuple[int, int], **params: Any) -> rg.Pipeline:
    nodes = {"sheet": {"type": "contact_sheet", "inputs": {"pictures": pictures}, "params": params}}
    outputs = {"image": "sheet.color", "picture": "display.color", "depth": "light.surface_depth", "radiance": None}
    return rg.load("forward", size=size, sets=SMALL, patches=[{"nodes": nodes, "outputs": outputs}])


def decoded(c: Floats) -> Floats:
    return np.asarray(np.where(c > 0.04045, ((c + 0.055) / 1.055) ** 2.4, c / 12.92))


def encoded(c: Floats) -> Floats:
    return np.asarray(np.where(c > 0.0031308, 1.055 * np.maximum(c, 1e-9) ** (1 / 2.4) - 0.055, 12.92 * c))


def shrunk(picture: Floats, height: int, width: int) -> Floats:
    """The mean by area over each of fewer texels."""

    def shares(old: int, new: int) -> Floats:
        low, high = np.arange(new)[:, None] * old / new, np.arange(1, new + 1)[:, None] * old / new
        texel = np.arange(old)[None]
        return np.asarray(np.clip(np.minimum(texel + 1, high) - np.maximum(texel, low), 0, None) * new / old)

    return np.asarray(
        np.einsum("ij,jkc,lk->ilc", shares(picture.shape[0], height), picture, shares(picture.shape[1], width))
    )


def test_pictures_stand_in_a_grid_and_shrink_to_the_mean_of_their_light(session: rg.Session) -> None:
    pipeline = sheet(["display.color"] * 2 + ["light.surface_depth"], (64, 36), background=0.5)
    frame = session.render(pipeline)
    whole = frame["image"][..., :3] / 255
    picture, depth = frame["picture"][..., :3] / 255, frame.arrays["depth"].astype(np.float64)
    # (64 - 3 × 4) / 2 = 26 across, (36 - 3 × 4) / 2 = 12 down: 21 × 12 are shown, in the middle of the sheet.
    rows, columns = (4, 20), (9, 34)
    small = encoded(shrunk(decoded(picture), 12, 21))
    for x in columns:
        np.testing.assert_allclose(whole[4:16, x : x + 21], small, atol=0.6 / 255)
    np.testing.assert_allclose(whole[20:32, 9:30], np.repeat(shrunk(depth, 12, 21), 3, axis=-1), atol=0.6 / 255)
    free = np.ones((36, 64), bool)
    for y, x in [(rows[0], columns[0]), (rows[0], columns[1]), (rows[1], columns[0])]:
        free[y : y + 12, x : x + 21] = False
    np.testing.assert_allclose(whole[free], encoded(np.array(0.5)), atol=0.6 / 255)


def test_one_picture_alone_is_itself_and_what_is_small_shows_its_texels(session: rg.Session) -> None:
    frame = session.render(sheet(["display.color"], (40, 30), gap=0))
    np.testing.assert_array_equal(frame["image"][..., :3], frame["picture"][..., :3])
    nodes = {"sheet": {"type": "contact_sheet", "inputs": {"pictures": ["exposure.luminance"]}, "params": {"gap": 0}}}
    outputs = {"image": "sheet.color", "texel": "exposure.luminance", "radiance": None}
    patch = {"nodes": nodes, "outputs": outputs}
    frame = session.render(rg.load("hdr", size=(40, 30), sets=["sun.resolution=64"], patches=[patch]))
    assert 0.05 < frame.arrays["texel"][0, 0, 0] < 1
    np.testing.assert_allclose(frame["image"][:, 5:35, :3] / 255, frame.arrays["texel"][0, 0, 0], atol=0.6 / 255)
    assert (frame["image"][:, :5, :3] == frame["image"][0, 0, :3]).all()


def test_labels_are_written_in_dots(session: rg.Session) -> None:
    plain, written = (
        session.render(sheet(["display.color"], (40, 30), gap=0, labels=labels))["image"][..., :3].astype(int)
        for labels in ([], ["il"])
    )
    art = "###.#..\n.#..#..\n.#..#..\n.#..#..\n###.###"
    letters = np.array([[dot == "#" for dot in line] for line in art.split("\n")])
    assert (written[2:7, 2:9][letters] == 255).all()
    box = np.zeros((30, 40), bool)
    box[:9, :11] = True
    np.testing.assert_array_equal(written[~box], plain[~box])
    ground = box.copy()
    ground[2:7, 2:9] &= ~letters
    np.testing.assert_allclose(written[ground], plain[ground] / 4, atol=1)


def test_more_than_a_sheet_takes_is_said() -> None:
    with pytest.raises(InputError, match=r"RG209 node 'sheet' .*: it has 13 pictures; a sheet holds up to 12"):
        sheet(["display.color"] * 13, (40, 30)).check()
    with pytest.raises(InputError, match=r"RG209 node 'sheet' .*: it has 2 labels for 1 pictures"):
        sheet(["display.color"], (40, 30), labels=["a", "b"]).check()


def test_the_terms_sum_to_the_whole(session: rg.Session) -> None:
    terms = ("ambient", "diffuse", "specular", "emissive")
    outputs = {"image": None, "radiance": "light.radiance", **{name: f"{name}.radiance" for name in terms}}
    pipeline = rg.load("terms", size=(64, 36), sets=["sun.resolution=64"], patches=[{"outputs": outputs}])
    frame = session.render(pipeline)
    parts = [frame[name][..., :3].astype(np.float64) for name in terms]
    assert all(part.max() > 0.1 for part in parts)
    np.testing.assert_allclose(sum(parts), frame["radiance"][..., :3], rtol=3e-3, atol=1e-3)
