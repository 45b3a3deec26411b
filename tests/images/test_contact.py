"""The contact sheet: where pictures stand on it, how they are fitted, and that names are beneath."""

from __future__ import annotations

import numpy as np
import pytest

from rendergraph.images.viewable import contact_sheet


@pytest.mark.slow
def test_pictures_stand_in_rows_fitted_to_their_tiles_with_names_beneath() -> None:
    grown = np.array([[[255], [0]]], np.uint8)  # one row of two texels, which grow into squares
    shrunk = np.full((900, 1600, 3), (200, 10, 90), np.uint8)
    tall = np.full((400, 100, 1), 128, np.uint8)
    sheet = contact_sheet([(grown, "01 a.grown", "r8 2×1"), (shrunk, "02 b.shrunk", ""), (tall, "", "")])
    assert sheet.shape == (468, 676, 3)
    assert sheet.dtype == np.uint8
    assert tuple(sheet[102, 20]) == (255, 255, 255)
    assert tuple(sheet[102, 320]) == (0, 0, 0)
    assert tuple(sheet[14, 350]) == tuple(sheet[190, 660]) == (200, 10, 90)
    assert tuple(sheet[320, 172]) == (128, 128, 128)
    assert tuple(sheet[320, 20]) == tuple(sheet[440, 500]) == (32, 32, 32)
    names = sheet[192:228, 12:332].max()
    assert names > 200
    assert sheet[422:456, 12:332].max() == 32  # no name, no words
