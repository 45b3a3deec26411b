"""Results in Python: by name, as tables, and as figures; sweeps without a folder; differences of pipelines."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.errors import InputError, UsageError
from rendergraph.installed import require

SIZE = (48, 27)
AXES = {"light.shading": ["phong", "pbr"], "shadows.taps": [1, 2]}


@pytest.fixture(scope="module")
def compared() -> rg.Comparison:
    return rg.compare(["forward", "shading-phong"], size=SIZE, frames=1)


@pytest.fixture(scope="module")
def swept() -> rg.Sweep:
    return rg.sweep("forward", AXES, size=SIZE, frames=1)


def test_results_are_taken_by_name_or_number(compared: rg.Comparison, swept: rg.Sweep) -> None:
    assert [result.name for result in compared] == ["forward", "shading-phong"]
    assert compared["forward"] is compared[0]
    assert compared["shading-phong"].metrics.flip > 0
    assert len(swept) == 4
    assert swept["light.shading=pbr,shadows.taps=2"].settings["shadows.taps"] == "2"
    with pytest.raises(KeyError, match="there is no result 'forwrd'; did you mean 'forward'"):
        compared["forwrd"]


def test_a_sweep_without_a_folder_keeps_its_pictures(swept: rg.Sweep) -> None:
    assert all(result.pixels is not None and result.pixels.shape[:2] == (27, 48) for result in swept)


def test_results_become_tables(swept: rg.Sweep, compared: rg.Comparison) -> None:
    table = swept.to_dict()
    assert table["light.shading"] == ["phong", "phong", "pbr", "pbr"]
    assert table["shadows.taps"] == [1, 2, 1, 2]
    assert table["flip"] == [result.metrics.flip for result in swept]
    assert compared.to_dict()["run"] == ["forward", "shading-phong"]
    pandas = pytest.importorskip("pandas")
    frame = swept.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame.groupby("light.shading")["flip"].max().index) == ["pbr", "phong"]


def test_a_figure_has_magnified_crops_and_a_caption(compared: rg.Comparison, swept: rg.Sweep, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    made = compared.figure({"knot": (10, 5, 8, 6)}, caption="Two models.", errors=True)
    axes: Any = np.array(made.axes).reshape(3, 2)
    assert [axis.get_title().partition("\n")[0] for axis in axes[0]] == ["forward", "shading-phong"]
    pixels = compared["shading-phong"].pixels
    assert pixels is not None
    np.testing.assert_array_equal(axes[2, 1].images[0].get_array(), pixels[5:11, 10:18, :3])
    assert axes[2, 0].get_ylabel() == "knot"
    made.savefig(tmp_path / "a.pdf")
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    assert len(swept.figure().axes) == 4
    with pytest.raises(InputError, match=r"crop \(40, 0, 20, 5\): expected .* within 48×27 pixels"):
        compared.figure([(40, 0, 20, 5)])


def test_compare_writes_figures_and_tables(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    command = [sys.executable, "-m", "rendergraph", "compare", "forward", "--with", "light.shading=phong", "-n", "1"]
    names = ["figure.pdf", "table.tex", "table.csv"]
    for name in names:
        options = ["--size", "32x18", "-o", name, *(["--crop", "1,1,8,8"] if name.endswith("pdf") else [])]
        subprocess.run([*command, *options], cwd=tmp_path, check=True, capture_output=True)
    assert (tmp_path / names[0]).read_bytes().startswith(b"%PDF")
    tex = (tmp_path / names[1]).read_text()
    assert "light.shading=phong" in tex
    assert r"$\infty$" in tex
    assert r"10--90 \%" in tex or "GPU ms" not in tex
    assert [row["run"] for row in csv.DictReader((tmp_path / names[2]).read_text().splitlines())] == [
        "forward",
        "light.shading=phong",
    ]


def test_a_missing_library_is_named_with_its_extra() -> None:
    with pytest.raises(UsageError, match=r"a figure needs not-there; pip install 'rendergraph\[figures\]'"):
        require("a figure", "figures", "not_there")


def test_diff_and_flip_are_public() -> None:
    difference = rg.diff("forward", rg.load("forward").set("shadows.taps", 1))
    assert [(one.node, one.name) for one in difference.parameters] == [("shadows", "taps")]
    assert "shadows.taps" in str(difference)
    grey, white = np.full((16, 16, 3), 128, np.uint8), np.full((16, 16, 3), 255, np.uint8)
    assert rg.flip(grey, grey).max() == 0
    assert rg.flip(grey, white).min() > 0.3


def test_no_library_for_results_is_imported_before_it_is_used() -> None:
    code = "import sys, json, rendergraph as rg; rg.compare, rg.sweep, rg.diff; print(json.dumps([*sys.modules]))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert not {"matplotlib", "pandas", "moderngl", "OpenImageIO"} & set(json.loads(found))


def test_a_texture_is_shown_in_false_colours_with_a_scale(gl: rg.Session, tmp_path: Path) -> None:
    frame = gl.render("forward", SIZE, taps=["sun.shadow_map", "light.radiance"])
    shown = frame.show("sun.shadow_map", layer=0)
    values = frame.arrays["sun.shadow_map"]
    assert (shown.low, shown.high) == (float(values.min()), float(values.max()))
    assert shown.pixels.shape[-1] == 3
    html = shown._repr_html_()
    assert f"{shown.high:g}" in html
    assert "linear-gradient" in html
    assert frame.show("light.radiance").low is None
    red = frame.show("light.radiance", channel=0, low=0, high=2)
    assert (red.name, red.low, red.high) == ("light.radiance, channel 0", 0, 2)
    assert shown.save(tmp_path / "a.png").exists()
    with pytest.raises(InputError, match="'image' has no layers, so there is no layer 2"):
        frame.show("image", layer=2)
    with pytest.raises(InputError, match=r"'light\.radiance' has 4 channels, so there is no channel 9"):
        frame.show("light.radiance", channel=9)
    with pytest.raises(KeyError, match=r"no output 'sun\.shadow_mp'; did you mean 'sun\.shadow_map'"):
        frame.show("sun.shadow_mp")
