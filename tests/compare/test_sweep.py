"""The product of axes: what is drawn, what is kept, what is found again."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

import fastjsonschema
import numpy as np
import pytest
from msgspec import structs

import rendergraph as rg
from rendergraph.cli.compare import summary
from rendergraph.compare.batches import batches
from rendergraph.compare.engine import sweep
from rendergraph.compare.export.table import csv_text
from rendergraph.compare.fingerprint import run_key
from rendergraph.compare.prepare import SweepOptions, prepare
from rendergraph.compare.report import sweep_page
from rendergraph.compare.results import pareto
from rendergraph.compare.runner import list_sweep
from rendergraph.compare.space import Axis, Space, parse_axis, pipelines, typed
from rendergraph.compare.store import RESULTS, SweepFolder, checksum, kept_runs, line_schema, read_results
from rendergraph.errors import InputError, UsageError
from rendergraph.images import read, write

AXES = tuple(parse_axis(x) for x in ("shadows.taps=1,3", "light.shading=pbr,phong", "display.curve=aces,none,neutral"))


@pytest.fixture
def base() -> rg.Pipeline:
    return rg.load("forward", size=(48, 27), scene="cornell_box").set("sun.resolution", 128)


@pytest.mark.slow
def test_a_sweep_draws_distinct_passes_and_the_pictures_of_single_runs(
    base: rg.Pipeline, gl: rg.Session, tmp_path: Path
) -> None:
    told = list_sweep(prepare(base, AXES, tmp_path / "out"), tmp_path / "out")
    found = sweep(base, AXES, tmp_path / "out", frames=1, session=gl)
    assert (found.executed, found.alone) == (1 + 2 * 2 + 2 * 2 * 3, 3 * 12)
    assert (told.executed, told.shared()) == (17, {"sun": (1, 12), "light": (4, 12), "display": (12, 12)})
    assert len(found.comparison.results) == 12
    for result in found.comparison.results:
        alone = base
        for path, value in result.settings.items():
            alone = alone.set(path, value)
        np.testing.assert_array_equal(gl.render(alone)["image"], result.pixels)
        np.testing.assert_array_equal(
            read(tmp_path / "out" / result.name / "image.png"), np.asarray(result.pixels)[..., :3]
        )
        told = json.loads((tmp_path / "out" / result.name / "run.json").read_text())
        assert told["settings"] == {path: typed(value) for path, value in result.settings.items()}
        assert told["flip"] == result.metrics.flip
        assert "nodes:" in told["resolved"]
    assert found.comparison.results[0].metrics.flip == 0
    records, torn = read_results(tmp_path / "out")
    assert ([record["name"] for record in records], torn) == ([r.name for r in found.comparison.results], 0)
    front = pareto(found.comparison.results)
    assert found.comparison.results[0].name in {result.name for result in front}
    assert "Pareto front" in sweep_page(found, "rendergraph sweep")


def test_figures_of_a_run_are_columns_everywhere(gl: rg.Session, tmp_path: Path) -> None:
    """Those of each run alone, also where it is read back."""
    shown = rg.load("overdraw", scene="cornell_box", size=(24, 16))
    axes = [parse_axis("overdraw.depth=null,prepass.depth")]
    for resume in (False, True):
        found = sweep(shown, axes, tmp_path / "out", frames=1, session=gl, resume=resume)
        results = found.comparison.results
        for result in results:
            alone = gl.render(shown.set("overdraw.depth", result.settings["overdraw.depth"]))
            assert result.figures == alone.figures
            assert set(result.figures) == {"mean", "maximum"}
        assert results[0].columns["mean"] > results[1].columns["mean"] > 0
        rows = list(csv.DictReader(io.StringIO(csv_text(found))))
        assert [float(row["mean"]) for row in rows] == [result.columns["mean"] for result in results]
        assert [run["figures"] for run in found.as_json()["runs"]] == [result.figures for result in results]
        page = sweep_page(found, "rendergraph sweep")
        assert '<th scope="col" class=num>maximum</th>' in page
        heads, told = summary(results)
        assert [row[heads.index("mean")] for row in told] == [f"{result.columns['mean']:.4g}" for result in results]


def test_resuming_draws_what_is_missing_and_nothing_else(base: rg.Pipeline, gl: rg.Session, tmp_path: Path) -> None:
    few = (AXES[0], Axis("display.curve", ("aces",)))
    first = sweep(base, few, tmp_path, frames=1, session=gl)
    with pytest.raises(InputError, match=r"RG504 cannot be written: it has results of a sweep; --resume adds"):
        sweep(base, few, tmp_path, frames=1, session=gl)
    again = sweep(base, few, tmp_path, frames=1, resume=True, session=gl)
    assert (again.executed, again.resumed) == (0, 2)
    assert [r.metrics for r in again.comparison.results] == [r.metrics for r in first.comparison.results]
    assert [r.times for r in again.comparison.results] == [r.times for r in first.comparison.results]
    more = sweep(base, (AXES[0], Axis("display.curve", ("aces", "none"))), tmp_path, frames=1, resume=True, session=gl)
    assert (more.executed, more.resumed) == (1 + 2 + 2, 2)
    (tmp_path / first.comparison.results[1].name / "image.png").write_bytes(b"spoilt")
    assert sweep(base, few, tmp_path, frames=1, resume=True, session=gl).resumed == 1


@pytest.mark.slow
def test_another_study_does_not_write_over_the_pictures_of_this_one(
    base: rg.Pipeline, gl: rg.Session, tmp_path: Path
) -> None:
    out, axes, truth = tmp_path / "out", AXES[:1], rg.load("shading-flat", size=(48, 27)).set("sun.resolution", 128)
    sweep(base, axes, out, frames=1, session=gl)
    before = {file: file.read_bytes() for file in out.rglob("*") if file.is_file()}
    others: list[tuple[rg.Pipeline, dict[str, Any], str]] = [
        (
            base.set("light.ambient", 0.1),
            {},
            r"other values \(-s, -p or the file\): nodes\.light\.params.* none, not .*0\.1",
        ),
        (base.with_size((40, 20)), {}, "size 48x27, not 40x20"),
        (truth, {}, "pipeline forward, not shading-flat"),
        (base, {"reference": truth}, "reference shadows.taps=1, not shading-flat"),
        (base, {"frame": 2}, "frame 1, not 2"),
        (base.select(shutter=0.5), {}, r"shutter None, not 0\.5"),
    ]
    for other, options, message in others:
        with pytest.raises(InputError, match=rf"RG504 .* of another study: .*{message}.*; use another folder: -o .*-2"):
            sweep(other, axes, out, frames=1, resume=True, session=gl, **options)
    assert {file: file.read_bytes() for file in out.rglob("*") if file.is_file()} == before


@pytest.mark.slow
def test_more_frames_are_measured_and_no_picture_is_drawn_again(
    base: rg.Pipeline, gl: rg.Session, tmp_path: Path
) -> None:
    axes = AXES[:1]
    first = sweep(base, axes, tmp_path, frames=1, session=gl)
    (tmp_path / RESULTS).write_bytes((tmp_path / RESULTS).read_bytes().split(b"\n")[0] + b"\n")
    pictures = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*.png")}
    more = sweep(base, axes, tmp_path, frames=3, resume=True, session=gl)
    assert (more.resumed, more.timed, more.redrawn) == (0, 2, 0)
    assert [result.times.frames for result in more.comparison.results] == [3, 3]
    assert [result.metrics for result in more.comparison.results] == [r.metrics for r in first.comparison.results]
    assert {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*.png")} == pictures
    for result in more.comparison.results:
        assert json.loads((tmp_path / result.name / "run.json").read_text())["frames"] == 3
    again = sweep(base, axes, tmp_path, frames=2, resume=True, session=gl)
    assert (again.resumed, again.timed, again.executed) == (2, 0, 0)


@pytest.mark.slow
def test_runs_are_kept_before_they_are_measured(base: rg.Pipeline, gl: rg.Session, tmp_path: Path) -> None:
    def interrupt(done: int, total: int) -> None:
        if kept_runs(tmp_path) == 2:
            raise KeyboardInterrupt

    axes = AXES[:1]
    with pytest.raises(KeyboardInterrupt):
        sweep(base, axes, tmp_path, frames=1, session=gl, progress=interrupt)
    assert kept_runs(tmp_path) == 2
    pictures = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*.png")}
    with pytest.raises(InputError, match="--resume adds what is missing"):
        sweep(base, axes, tmp_path, frames=1, session=gl)
    found = sweep(base, axes, tmp_path, frames=1, resume=True, session=gl)
    assert (found.resumed, found.timed) == (0, 2)
    assert {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*.png")} == pictures
    assert [json.loads(line)["frames"] for line in (tmp_path / RESULTS).read_text().splitlines()] == [1, 1]


@pytest.mark.slow
def test_what_is_drawn_together_is_few_enough_to_lose(base: rg.Pipeline) -> None:
    many = pipelines(base, Space((Axis("display.exposure", tuple(map(str, range(20)))),)).runs())
    assert [len(batch.numbers) for batch in batches([each.check() for each in many], range(20))] == [16, 4]


BAD = """// A colour; one of its modes is no GLSL.
/*---
outputs:
  color: {semantic: radiance, format: rgba16f, doc: The colour.}
params:
  mode: {default: 1, min: 1, max: 9, role: define, doc: Which.}
---*/
out vec4 color;
void main() {
#if MODE == 3
    color = vec4(nonsense);
#else
    color = vec4(1.0 / float(MODE));
#endif
}
"""


def bad(folder: Path) -> rg.Pipeline:
    (folder / "fx.frag").write_text(BAD)
    file = folder / "p.yaml"
    file.write_text("rendergraph: 1\nsize: [8, 8]\nnodes: {a: {type: fx}}\noutputs: {radiance: a.color}\n")
    return rg.load(file, plugins=[folder / "fx.frag"])


def test_what_would_be_drawn_is_listed_and_nothing_is(gl: rg.Session, tmp_path: Path) -> None:
    out, base = tmp_path / "out", bad(tmp_path)

    def told(values: str, **options: Any) -> tuple[list[Any], int, set[str]]:
        found = list_sweep(prepare(base, [f"a.mode={values}"], out), out, SweepOptions(frames=1, **options)).as_json()
        return [run["group"] for run in found["runs"]], found["kept"], {run["name"] for run in found["runs"]}

    assert told("1,2") == ([1, 1], 0, {"a.mode=1", "a.mode=2"})
    assert not out.exists()
    sweep(base, ["a.mode=1,2"], out, frames=1, session=gl)
    before = {file: file.stat().st_mtime_ns for file in out.rglob("*")}
    assert told("1,2,4", resume=True)[:2] == ([None, None, 1], 2)
    with pytest.raises(InputError, match="it has results of a sweep; --resume adds"):
        told("1,2")
    assert {file: file.stat().st_mtime_ns for file in out.rglob("*")} == before


def test_repeats_are_measured_anew_and_their_spread_is_told(gl: rg.Session, tmp_path: Path) -> None:
    out, base, axes = tmp_path / "out", bad(tmp_path), ["a.mode=1,2"]
    once = sweep(base, axes, out, frames=2, session=gl)
    assert [result.times.repeated for result in once.comparison.results] == [None, None]
    found = sweep(base, axes, out, frames=2, repeats=3, session=gl, resume=True)
    assert (found.timed, found.redrawn) == (2, 0)
    for result, row in zip(found.comparison.results, csv.DictReader(io.StringIO(csv_text(found))), strict=True):
        times, among = result.times, result.times.repeated
        assert (times.frames, len(times.repeats)) == (6, 3)
        assert among is not None
        assert times.headline.min <= among.min <= times.headline.median <= among.max <= times.headline.max
        assert [row[name] for name in ("repeats", "repeats_min_ms", "repeats_max_ms")] == [
            "3",
            f"{among.min}",
            f"{among.max}",
        ]
    assert [len(line["repeats"]) for line in lines(out)] == [0, 0, 3, 3]
    again = sweep(base, axes, out, frames=2, repeats=3, session=gl, resume=True)
    assert (again.resumed, again.executed) == (2, 0)
    assert [r.times for r in again.comparison.results] == [r.times for r in found.comparison.results]
    assert "(3)" in sweep_page(found, "rendergraph sweep")


def test_the_best_pictures_are_kept_and_no_others(gl: rg.Session, tmp_path: Path) -> None:
    """Against white; each run is a batch of its own, so that one after the other is beaten."""
    out, base, axes = tmp_path / "out", bad(tmp_path), ["a.mode=9,4,2,1,5"]
    truth = base.set("a.mode", 1)
    options: dict[str, Any] = {"frames": 1, "session": gl, "most_bytes": 1}
    found = sweep(base, axes, out, truth, kept="best", **options)
    front = {result.name for result in pareto(found.comparison.results)}
    assert "a.mode=1" in front
    assert {file.parent.name for file in out.glob("*/radiance.exr")} == front
    assert {r.name for r in found.comparison.results if r.pixels is not None} == front
    last = {line["name"]: line["picture"] for line in lines(out)}
    assert {name for name, picture in last.items() if picture} == front
    assert len(list(out.glob("*/run.json"))) == 5
    of_a_line = fastjsonschema.compile(line_schema())
    for line in lines(out):
        of_a_line(line)
    sweep_page(found, "rendergraph sweep")
    again = sweep(base, axes, out, truth, kept="best", resume=True, **options)
    assert (again.resumed, len(again.comparison.results)) == (5, 5)
    whole = sweep(base, axes, out, truth, resume=True, **options)
    assert (whole.resumed, len(list(out.glob("*/radiance.exr")))) == (len(front), 5)
    first = sweep(base, axes, tmp_path / "b", kept="best", **options)  # the first is measured against, and stays
    assert first.comparison.results[0].pixels is not None
    assert (tmp_path / "b" / "a.mode=9" / "radiance.exr").exists()


def lines(folder: Path) -> list[dict[str, Any]]:
    return read_results(folder)[0]


def test_a_value_that_fails_is_a_row_and_the_others_go_on(gl: rg.Session, tmp_path: Path) -> None:
    out, base = tmp_path / "out", bad(tmp_path)
    found = sweep(base, (Axis("a.mode", ("1", "2", "3", "4")),), out, frames=1, session=gl)
    assert [result.name for result in found.comparison.results] == ["a.mode=1", "a.mode=2", "a.mode=4"]
    (failure,) = found.failures
    assert (failure.name, failure.settings) == ("a.mode=3", {"a.mode": "3"})
    assert "RG410" in failure.text
    assert "nonsense" in failure.text
    assert "a-" not in failure.text
    told = {line["name"]: line.get("error") for line in lines(out)}
    assert told == {"a.mode=1": None, "a.mode=2": None, "a.mode=4": None, "a.mode=3": failure.text}
    assert "a.mode=3 failed" in sweep_page(found, "rendergraph sweep")
    rows = list(csv.DictReader(io.StringIO(csv_text(found))))
    assert [(row["a.mode"], bool(row["flip"]), row["error"]) for row in rows] == [
        ("1", True, ""),
        ("2", True, ""),
        ("4", True, ""),
        ("3", False, failure.text),
    ]
    of_a_line = fastjsonschema.compile(line_schema())
    for line in lines(out):
        of_a_line(line)
    again = sweep(base, (Axis("a.mode", ("1", "2", "3", "4")),), out, frames=1, session=gl, resume=True)
    assert (again.resumed, len(again.failures), len(lines(out))) == (3, 1, 4)
    with pytest.raises(InputError, match="RG410"):
        sweep(base, (Axis("a.mode", ("3", "1")),), tmp_path / "c", frames=1, session=gl)


def test_lines_that_were_lost_are_written_again(gl: rg.Session, tmp_path: Path) -> None:
    out, base, axes = tmp_path / "out", bad(tmp_path), (Axis("a.mode", ("1", "2", "4")),)
    options: dict[str, Any] = {"frames": 1, "session": gl, "resume": True}
    first = sweep(base, axes, out, frames=1, session=gl)
    whole = lines(out)
    (out / RESULTS).write_bytes((out / RESULTS).read_bytes()[:-300])
    (out / "a.mode=4" / ".image.png.0badcafe.part").touch()
    again = sweep(base, axes, out, **options)
    assert (again.resumed, again.executed, again.torn) == (3, 0, 1)
    assert sorted(map(str, lines(out))) == sorted(map(str, whole))
    assert not list(out.rglob("*.part"))
    (out / RESULTS).unlink()
    assert sweep(base, axes, out, **options).executed == 0
    assert len(lines(out)) == 3
    (out / RESULTS).unlink()
    run = out / "a.mode=2" / "run.json"
    told = json.loads(run.read_text())
    for changed in (told | {"flip": 0.0, "rmse": 0.0}, {name: told[name] for name in told if name != "frames"}):
        run.write_text(json.dumps(changed))
        again = sweep(base, axes, out, **options)
        assert (again.resumed, again.redrawn) == (2, 1)
        assert again.comparison.results[1].metrics == first.comparison.results[1].metrics
        (out / RESULTS).unlink()


def test_a_folder_has_one_sweep_at_a_time(gl: rg.Session, tmp_path: Path) -> None:
    out, base = tmp_path / "out", bad(tmp_path)

    def second(done: int, total: int) -> None:
        with pytest.raises(InputError, match="RG504 cannot be written: another sweep is running in it"):
            sweep(base, (Axis("a.mode", ("1",)),), out, frames=1, resume=True)
        seen.append(done)

    seen: list[int] = []
    sweep(base, (Axis("a.mode", ("1", "2")),), out, frames=1, session=gl, progress=second)
    assert seen
    assert sweep(base, (Axis("a.mode", ("1", "2")),), out, frames=1, session=gl, resume=True).resumed == 2


GLOW = """
from rendergraph.api import Node, Output, Radiance, Steps, param

from ._strength import STRENGTH
from .more import helpers


class Glow(Node):
    \"\"\"One colour.\"\"\"

    color = Output(Radiance, format="rgba16f", doc="The colour.")
    much: float = param(default=1.0, min=0, max=9, doc="How much.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("glow.frag", strength=STRENGTH * helpers.ONE)
"""


@pytest.mark.slow
def test_results_are_kept_only_as_long_as_what_they_were_drawn_from(gl: rg.Session, tmp_path: Path) -> None:
    files = {
        "plugin/glow.py": GLOW,
        "plugin/_strength.py": "STRENGTH = 0.5\n",
        "plugin/more/__init__.py": "",
        "plugin/more/helpers.py": "ONE = 1.0\n",
        "plugin/glow.frag": '#include "shape.glsl"\nuniform float strength, much;  // a comment\n'
        "out vec4 color;\nvoid main() { color = vec4(shape() * strength * much); }\n",
        "plugin/shape.glsl": "float shape() { return 1.0; }\n",
        "plugin/other.frag": "out vec4 color;\nvoid main() { color = vec4(1.0); }\n",
        "scene.yaml": "scene: 1\nmaterials: {m: {base_color_texture: t.png}}\n"
        "objects: {o: {shape: plane, size: [1, 1], material: m}}\n",
        "p.yaml": "rendergraph: 1\nsize: [8, 8]\nscene: scene.yaml\nnodes: {g: {type: glow}}\n"
        "outputs: {radiance: g.color}\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    picture = tmp_path / "t.png"
    write(picture, np.zeros((2, 2, 3), np.uint8))

    def drawn() -> int:
        base = rg.load(tmp_path / "p.yaml", plugins=[tmp_path / "plugin"])
        axes = (Axis("g.much", ("1", "2")),)
        found = sweep(base, axes, tmp_path / "out", frames=1, resume=True, session=gl)
        return 2 - found.resumed

    assert drawn() == 2
    assert drawn() == 0
    for name, old, new in (
        ("plugin/shape.glsl", "1.0", "0.9"),
        ("plugin/glow.frag", "* much", "* 0.5 * much"),
        ("plugin/glow.py", "ONE)", "ONE * 0.5)"),
        ("plugin/_strength.py", "0.5", "0.6"),
        ("plugin/more/helpers.py", "1.0", "0.7"),
        ("scene.yaml", "[1, 1]", "[2, 1]"),
    ):
        file = tmp_path / name
        file.write_text(file.read_text().replace(old, new))
        assert drawn() == 2, name
        assert drawn() == 0, name
    write(picture, np.ones((2, 2, 3), np.uint8))
    assert drawn() == 2
    for name, old, new in (("plugin/glow.frag", "a comment", "b comment"), ("plugin/other.frag", "1.0", "0.5")):
        file = tmp_path / name
        file.write_text(file.read_text().replace(old, new))
        assert drawn() == 0, name


def test_what_is_chosen_beside_the_file_decides_a_picture(base: rg.Pipeline) -> None:
    views: list[dict[str, Any]] = [{}, {"camera": "eye=0,1,5 target=0,1,0"}, {"shutter": 0.0}, {"shutter": 0.5}]
    planned = [base.select(**view).check() for view in (*views, {"ground": True})]
    planned.append(structs.replace(planned[0], linked=with_variant(planned[0].linked)))
    assert len({run_key(one, 1, "") for one in planned}) == len(planned)


def with_variant(linked: Any) -> Any:
    return structs.replace(linked, selection=structs.replace(linked.selection, variant="sea"))


def test_runs_of_one_view_are_measured_as_in_the_whole_sweep(base: rg.Pipeline) -> None:
    axes = {"environment": ["dawn", "noon"], "display.curve": ["aces", "none"]}
    whole = prepare(base, axes, Path("out"))
    part = prepare(base, axes, Path("out"), options=SweepOptions(only=(2, 3)))
    assert [run.name for run in part.runs] == [run.name for run in whole.runs[2:]]
    assert [run.reference_key for run in part.runs] == [run.reference_key for run in whole.runs[2:]]
    assert whole.runs[0].reference_key != whole.runs[2].reference_key


def test_runs_of_two_views_whose_names_would_be_equal_have_folders_of_their_own(
    base: rg.Pipeline, gl: rg.Session, tmp_path: Path
) -> None:
    cameras = ["eye=0,1,5 target=0,0,0", "eye=0,1,5  target=0,0,0"]
    names = ["camera=eye=0,1,5_target=0,0,0", "camera=eye=0,1,5_target=0,0,0-2"]
    runs = prepare(base, {"camera": cameras}, Path("out")).runs
    assert [run.name for run in runs] == names
    assert [run.folder for run in runs] == [Path("out") / name for name in names]
    assert [run.settings["camera"] for run in runs] == cameras
    (second,) = prepare(base, {"camera": cameras}, Path("out"), options=SweepOptions(only=(1,))).runs
    assert (second.name, second.settings["camera"]) == (names[1], cameras[1])
    found = sweep(base, {"camera": cameras}, tmp_path, frames=1, session=gl)
    assert [result.name for result in found] == names
    assert sorted(path.name for path in tmp_path.iterdir() if path.is_dir()) == names


@pytest.mark.slow
def test_a_reference_picture_counts_by_its_content(base: rg.Pipeline, gl: rg.Session, tmp_path: Path) -> None:
    axes = (Axis("display.curve", ("aces", "none")),)
    picture = tmp_path / "reference.png"
    for shade in (10, 20):
        write(picture, np.full((27, 48, 3), shade, np.uint8))
        options: dict[str, Any] = {"frames": 1, "resume": True, "session": gl, "reference": picture}
        assert sweep(base, axes, tmp_path / "out", **options).resumed == 0
        assert sweep(base, axes, tmp_path / "out", **options).resumed == 2


def test_a_torn_line_is_left_out_and_the_file_goes_on(tmp_path: Path) -> None:
    folder, path = SweepFolder.read(tmp_path), tmp_path / RESULTS
    folder.append({"key": "a", "ssim": 0.5})
    folder.append({"key": "b", "name": "ä"})
    whole = path.read_bytes()
    path.write_bytes(whole[:-7])
    assert read_results(tmp_path) == ([{"key": "a", "ssim": 0.5, "sha256": checksum({"key": "a", "ssim": 0.5})}], 1)
    folder.append({"key": "c"})
    records, torn = read_results(tmp_path)
    assert ([record["key"] for record in records], torn) == (["a", "c"], 1)
    path.write_bytes(path.read_bytes().replace(b"0.5", b"0.6"))
    assert read_results(tmp_path)[1] == 2
    assert path.read_bytes().startswith(whole[:10])


@pytest.mark.slow
def test_batches_that_do_not_fit_are_split(base: rg.Pipeline, gl: rg.Session, tmp_path: Path) -> None:
    together = sweep(base, AXES[:2], tmp_path / "a", frames=1, session=gl)
    split = sweep(base, AXES[:2], tmp_path / "b", frames=1, most_bytes=1, session=gl)
    assert split.executed == split.alone > together.executed
    assert [r.metrics for r in split.comparison.results] == [r.metrics for r in together.comparison.results]


def test_a_pipeline_or_a_picture_is_the_reference(base: rg.Pipeline, gl: rg.Session, tmp_path: Path) -> None:
    truth = base.set("shadows.taps", 3)
    gl.render(truth).save(tmp_path / "truth.png")
    references: list[rg.Pipeline | Path] = [truth, tmp_path / "truth.png"]
    for number, reference in enumerate(references):
        found = sweep(base, AXES[:1], tmp_path / str(number), reference, frames=1, session=gl)
        assert [result.metrics.flip == 0 for result in found.comparison.results] == [False, True]


def fake(ms: float, flip: float, not_finite: int = 0) -> Any:
    from types import SimpleNamespace

    times, figures = SimpleNamespace(headline=SimpleNamespace(median=ms)), SimpleNamespace(flip=flip)
    return SimpleNamespace(times=times, metrics=figures, not_finite=not_finite)


def test_the_front_is_what_nothing_beats() -> None:
    slow, quick, worse, broken = fake(3, 0.1), fake(1, 0.5), fake(2, 0.6), fake(0.5, float("nan"))
    assert pareto([slow, quick, worse, broken]) == [quick, slow]
    hidden = fake(0.5, 0.0, not_finite=3)  # 8 bits show nothing of it
    assert pareto([slow, quick, hidden]) == [quick, slow]


@pytest.mark.nightly
def test_each_scene_of_a_sweep_is_measured_against_its_own_reference(tmp_path: Path) -> None:
    axes = {"scene": ["cornell_box", "shadow_study"], "light.shading": ["phong", "pbr"]}
    base = rg.load("forward", size=(32, 18))
    first = sweep(base, axes, tmp_path / "first", frames=1)
    flips = [result.metrics.flip for result in first.comparison.results]
    assert [flip == 0 for flip in flips] == [True, False, True, False]
    assert "RG" not in str(first.comparison.warnings)
    again = sweep(base, axes, tmp_path / "first", frames=1, resume=True)
    assert (again.resumed, again.executed) == (4, 0)
    against = sweep(base, axes, tmp_path / "against", "shading-pbr", frames=1)
    assert [result.metrics.flip == 0 for result in against.comparison.results] == [False, True, False, True]
    lights = {"scene.lights.lamp.intensity": [10, 80], "light.shading": ["phong", "pbr"]}
    lit = sweep(base.with_scene("cornell_box"), lights, tmp_path / "lit", "shading-pbr", frames=1)
    assert [result.metrics.flip == 0 for result in lit.comparison.results] == [False, True, False, True]
    with pytest.raises(UsageError, match="a picture cannot be the reference of several scenes"):
        sweep(base, axes, tmp_path / "none", Path("a.png"), frames=1)
