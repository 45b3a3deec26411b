"""`run`: which picture goes into which file."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rendergraph import images


def test_without_a_file_the_picture_is_named_after_the_pipeline(cli: Any, fake: Any) -> None:
    result = cli("run", "some/where.yaml")
    assert result.code == 0
    assert result.out == "where.png\n"
    assert "not drawn: idle: nobody reads it" in result.err
    assert "6×4, 0 passes, drawn in 1.0 ms on none (software: not comparable to a GPU)" in result.err
    assert images.read("where.png").shape == (4, 6, 3)
    assert fake.calls["outputs"] == ("image",)
    assert fake.calls["frames"] == range(1, 2)


def test_json_is_one_document_with_the_paths(cli: Any, fake: Any) -> None:
    result = cli("run", "x", "-o", "a.png", "-o", "b.exr", "--tap", "n.p=c.exr", "--json")
    assert result.json["outputs"] == ["a.png", "b.exr", "c.exr"]
    assert set(result.json) == {
        "pipeline",
        "device",
        "size",
        "passes",
        "frame_ms",
        "steps_run",
        "memory",
        "culled",
        "figures",
        "outputs",
    }
    assert fake.calls["outputs"] == ("image", "radiance")
    assert fake.calls["taps"] == ("n.p",)


def test_outputs_of_one_texel_are_figures_of_the_run(cli: Any, fake: Any) -> None:
    fake.figures = ("share", "pair")
    result = cli("run", "x", "-o", "a.png", "--json")
    assert fake.calls["outputs"] == ("image", "share", "pair")
    assert result.json["figures"] == {"share": 0.25, "pair": [1.0, 2.0]}
    assert "share: 0.25\npair: 1, 2\n" in result.err


@pytest.mark.parametrize(
    ("outputs", "file", "expected"),
    [
        (("image", "radiance"), "a.png", "image"),
        (("image", "radiance"), "a.JPEG", "image"),
        (("image", "radiance"), "a.exr", "radiance"),
        (("image",), "a.hdr", "image"),
        (("image", "radiance"), "radiance=a.png", "radiance"),
        (("image", "radiance"), "./a=b.png", "image"),
    ],
)
def test_the_extension_or_the_name_chooses_the_output(
    cli: Any, fake: Any, outputs: tuple[str, ...], file: str, expected: str
) -> None:
    fake.graph.outputs = dict.fromkeys(outputs)
    assert cli("run", "x", "-o", file).code == 0
    assert fake.calls["outputs"] == (expected,)


def test_a_pipeline_without_the_output_is_told(cli: Any, fake: Any) -> None:
    fake.graph.outputs = {"ao": None}
    result = cli("run", "x")
    assert result.code == 3
    assert result.err == ("RG505 'x.png' needs the output 'image', which the pipeline lacks; name one: -o ao=x.png\n")
    assert not fake.calls


def test_frames_are_numbered(cli: Any, fake: Any, tmp_path: Path) -> None:
    result = cli("run", "x", "--frames", "9-11", "-o", "a.####.png", "--fps", "25")
    assert result.out.split() == ["a.0009.png", "a.0010.png", "a.0011.png"]
    assert fake.calls["fps"] == 25
    assert images.read("a.0010.png")[0, 0, 0] == 255
    assert cli("run", "x", "--frames", "2-3", "--json").json["outputs"] == ["x.0002.png", "x.0003.png"]
    assert cli("run", "x", "--frames", "7", "-o", "one.png").out == "one.png\n"


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (
            ["-o", "a.bmp"],
            2,
            "RG501 '.bmp' files are not written; available: .exr, .gif, .hdr, .jpeg, .jpg, .mp4, .png, .webp",
        ),
        (["-o", "a"], 2, "RG501 'a' has no extension to choose the format by; name it 'a.png'"),
        (["-o", "a.png", "--tap", "n.p=./a.png"], 2, "RG502 two outputs have the same file 'a.png'; name two files"),
        (["-o", "a.png", "-o", "link/a.png"], 2, "RG502 two outputs have the same file 'link/a.png'"),
        (["--environment", "sky.hdr", "-o", "sky.hdr"], 2, "RG502 'sky.hdr' is also an input of this run"),
        (
            ["--frames", "1-9", "-o", "a.png"],
            2,
            "RG503 9 frames do not fit one file 'a.png'; number them: 'a.####.png'",
        ),
        (["-o", "no/a.png"], 3, "no/a.png: RG504 cannot be written: there is no folder 'no'"),
        (["-o", "sky.hdr/a.png"], 3, "RG504 cannot be written: 'sky.hdr' is not a folder"),
        (["--tap", "n.p=folder.exr"], 3, "folder.exr: RG504 cannot be written: it is a folder"),
    ],
)
def test_wrong_targets_are_said_before_rendering(
    cli: Any, fake: Any, tmp_path: Path, words: list[str], code: int, message: str
) -> None:
    (tmp_path / "link").symlink_to(tmp_path)
    (tmp_path / "sky.hdr").write_text("")
    (tmp_path / "folder.exr").mkdir()
    result = cli("run", "x", *words)
    assert (result.code, result.out) == (code, "")
    assert message in result.err
    assert not fake.calls


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write everywhere")
def test_a_folder_without_permission_is_said_before_rendering(cli: Any, fake: Any, tmp_path: Path) -> None:
    (tmp_path / "locked").mkdir(mode=0o555)
    result = cli("run", "x", "-o", "locked/a.png")
    assert result.code == 3
    assert "RG504 cannot be written: the folder 'locked' cannot be written to" in result.err
    assert not fake.calls


def test_modes_reach_the_renderer(cli: Any, fake: Any) -> None:
    cli("run", "x", "--no-alias", "--poison", "--shuffle", "7", "--device", "1")
    asked = {key: fake.calls[key] for key in ("alias", "poison", "shuffle", "device", "fps")}
    assert asked == {"alias": False, "poison": True, "shuffle": 7, "device": 1, "fps": 30.0}


def test_the_selection_reaches_the_stages(cli: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from rendergraph.errors import InputError, Problem
    from rendergraph.session import Selection, stages

    seen: list[Selection] = []

    def resolve(selection: Selection) -> Any:
        seen.append(selection)
        raise InputError(Problem("RG015", "enough"))

    monkeypatch.setattr(stages, "resolve", resolve)
    words = "run x --scene s.glb --camera c --environment e.hdr --size 4x5 -s a.b=1 -s c=2 -p p.yaml --asset-root r"
    assert cli(*words.split(), "--plugin", "n", "--limit", "yaml-depth=9").code == 3
    expected = Selection(
        source="x",
        scene="s.glb",
        camera="c",
        environment=Path("e.hdr"),
        size=(4, 5),
        sets=("a.b=1", "c=2"),
        patches=(Path("p.yaml"),),
        asset_roots=(Path("r"),),
        plugins=(Path("n"),),
        limits=(("yaml-depth", 9),),
    )
    assert seen == [expected]


def test_a_failure_keeps_the_frames_that_are_done(cli: Any, fake: Any, tmp_path: Path) -> None:
    from rendergraph.errors import Problem, RenderError

    fake.fail = RenderError(Problem("RG604", "the driver reported out of memory while drawing"))
    result = cli("run", "x", "--frames", "1-3", "-o", "a.##.png", "-o", "b.##.exr")
    assert result.code == 1
    assert result.out.split() == ["a.01.png", "b.01.exr"]
    assert sorted(os.listdir(tmp_path)) == ["a.01.png", "b.01.exr"]


def test_one_pass_is_a_pass(capsys: pytest.CaptureFixture[str]) -> None:
    from rendergraph.cli.output import say_summary

    device = {"renderer": "none", "software": False}
    report: dict[str, Any] = {
        "culled": {},
        "figures": {},
        "device": device,
        "size": (6, 4),
        "passes": [{}],
        "frame_ms": {"median": 1.0},
    }
    for ran in ([1], [1, 0]):
        say_summary(report | {"steps_run": ran})
    one, two = "drawn in 1.0 ms", "1.0 ms a frame"
    assert capsys.readouterr().err == f"6×4, 1 pass, {one} on none\n6×4, 1 pass, {two} on none\n"


def test_no_picture_takes_the_place_of_a_texture_that_is_read(cli: Any, tmp_path: Path) -> None:
    images.write(tmp_path / "wood.0001.png", np.full((2, 2, 3), 90, np.uint8))
    (tmp_path / "s.yaml").write_text(
        "scene: 1\nobjects: {o: {shape: box, size: [1, 1, 1], material: m}}\n"
        "materials: {m: {base_color_texture: wood.0001.png}}\n"
    )
    before = (tmp_path / "wood.0001.png").read_bytes()
    (tmp_path / "link").symlink_to(tmp_path)
    for name in ("wood.0001.png", "link/wood.0001.png", "wood.####.png"):
        found = cli("run", "forward", "--scene", "s.yaml", "--size", "8x8", "-o", name)
        assert (found.code, found.err) == (2, f"RG502 '{name}' is also an input of this run; write to another file\n")
    assert (tmp_path / "wood.0001.png").read_bytes() == before
    assert cli("run", "forward", "--scene", "s.yaml", "--size", "8x8", "-o", "wood2.png").code == 0


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("run", "forward", "--asset-root", "none"), 3, "--asset-root: RG011 there is no folder 'none'"),
        (("check", "forward", "--asset-root", "file"), 3, "--asset-root: RG011 'file' is a file; expected a folder"),
        (("run", "forward", "--asset-root", ""), 2, "invalid value for '--asset-root': '' is not the name of a file"),
        (("run", "forward", "--plugin", ""), 2, "invalid value for '--plugin': '' is not the name of a file"),
        (
            ("run", "forward", "--tap-all", ""),
            2,
            "invalid value for '--tap-all': '' is not the name of a file or folder",
        ),
        (("run", "forward", "-p", ""), 2, "invalid value for '-p'"),
        (("graph", "forward", "-o", ""), 2, "invalid value for '-o'"),
        (("sweep", "forward", "-x", "shadows.taps=1", "-o", ""), 2, "invalid value for '-o'"),
        (("compare", "forward", "forward", "-o", ""), 2, "invalid value for '-o'"),
        (("check-node", ""), 2, "invalid value for 'FILE'"),
    ],
)
def test_an_empty_word_is_no_path_and_a_root_is_a_folder(
    cli: Any, tmp_path: Path, words: tuple[str, ...], code: int, message: str
) -> None:
    (tmp_path / "file").touch()
    found = cli(*words)
    assert found.code == code
    assert message in found.err


@pytest.mark.slow
def test_names_of_any_bytes_are_names(cli: Any) -> None:
    name = "a\udcff"
    small = ("--size", "8x8", "-s", "sun.resolution=64", "-s", "environment.size=16", "-n", "1")
    assert cli("sweep", "forward", "-x", "shadows.taps=1", *small, "-o", name).code == 0
    assert (
        cli("sweep", "forward", "-x", "shadows.taps=1", *small, "-o", name, "--resume", "--json").json["resumed"] == 1
    )
    assert cli("compare", "forward", "forward", *small, "-o", f"{name}.html").code == 0
    for ending in ("png", "exr", "hdr"):
        assert cli("run", "forward", *small[:2], "-o", f"{name}.{ending}").code == 0
        assert cli("compare", "forward", "--reference", f"{name}.{ending}", *small).code == 0
