"""The language of axes: values, ranges and spans, what goes together, samples; and the file of a sweep."""

from __future__ import annotations

import math
import time
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rendergraph as rg
from rendergraph.compare.space import Axis, Space, Span, parse_axis, parse_range, pipelines, run_name
from rendergraph.compare.sweepfile import is_sweep, read_sweep
from rendergraph.errors import InputError


@pytest.fixture
def base() -> rg.Pipeline:
    return rg.load("forward", size=(48, 27), scene="cornell_box").set("sun.resolution", 128)


def test_types_are_an_axis(base: rg.Pipeline) -> None:
    axes = [parse_axis("display.type=tonemap"), parse_axis("display.exposure=0,1")]
    assert len(pipelines(base, Space.of(axes).runs())) == 2


@pytest.mark.parametrize(
    ("text", "axis"),
    [
        ("ao.samples=8,16, 32", Axis("ao.samples", ("8", "16", "32"))),
        ("light.ambient=[0, 0, 0],0.1", Axis("light.ambient", ("[0, 0, 0]", "0.1"))),
        ("a.b='x,y',\"z]\"", Axis("a.b", ("'x,y'", '"z]"'))),
        ("samples=4", Axis("samples", ("4",))),
        ("light.lookup=null,shadows.lookup", Axis("light.lookup", ("null", "shadows.lookup"))),
    ],
)
def test_axes_are_read(text: str, axis: Axis) -> None:
    assert parse_axis(text) == axis


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("ao.samples", "is not PATH=VALUE,VALUE"),
        ("=3", "is not PATH=VALUE,VALUE"),
        ("ao.samples=", "axis 'ao.samples' has no values"),
        ("ao.samples=1,,2", "has an empty value in '1,,2'"),
        ("ao.samples=1,2,1", "has the value 1 twice"),
    ],
)
def test_malformed_axes_are_told(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parse_axis(text)


def test_many_values_are_read_in_no_time() -> None:
    start = time.monotonic()
    assert len(parse_axis("a.b=" + ",".join(map(str, range(100_000)))).values) == 100_000
    with pytest.raises(ValueError, match="has the value 7 twice"):
        parse_axis("a.b=" + ",".join(map(str, [*range(100_000), 7])))
    assert time.monotonic() - start < 20  # comparing each with each takes minutes


def test_axes_as_a_whole_are_checked() -> None:
    with pytest.raises(InputError, match="RG524 the sweep has no axis"):
        Space(()).check()
    with pytest.raises(InputError, match=r"two axes have the path 'a.b'"):
        Space((Axis("a.b", ("1",)), Axis("a.b", ("2",)))).check()
    with pytest.raises(InputError, match="make 12000 runs, more than 10000"):
        Space.of({"a": range(120), "b": "1:100:1"}).check()


def test_an_axis_that_names_nothing_is_told_once_with_the_right_name(base: rg.Pipeline) -> None:
    axes = [parse_axis("shadows.tap=1,2,3"), parse_axis("dispaly.curve=aces"), parse_axis("light.shading=pbr,phnog")]
    with pytest.raises(InputError) as caught:
        pipelines(base, Space.of(axes).runs())
    assert [str(problem) for problem in caught.value.problems] == [
        "-x dispaly.curve=aces: RG109 there is no node 'dispaly'; did you mean 'display'?",
        "-x shadows.tap=1: RG103 node 'shadows' (shadow_pcf) has no param or input 'tap'; did you mean 'taps'?",
        "-x light.shading=phnog: RG104 'light.shading': expected one of unlit, phong, blinn_phong, anisotropic, pbr, "
        "got 'phnog'; did you mean 'phong'?",
    ]


def test_folders_have_names_that_every_system_takes() -> None:
    assert run_name({"ao.samples": "8", "shadows.type": "shadow_vsm"}) == "ao.samples=8,shadows.type=shadow_vsm"
    assert run_name({"a.b": "../../x y"}) == "a.b=.._.._x_y"
    assert run_name({"": "//"}) == "="


def test_a_sweep_is_a_file_too(tmp_path: Path) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(
        "sweep: 1\npipeline: forward\nscene: spheres\nsize: [48, 27]\nframes: 2\nreference: ./truth.png\n"
        "set: {light.ambient: 0.1}\naxes:\n  shadows.taps: [1, 3]\n  light.shading: [pbr, phong]\n"
    )
    found = read_sweep(path)
    assert is_sweep(path)
    assert (found.pipeline, found.scene, found.size) == ("forward", "spheres", (48, 27))
    assert found.options == {"frames": 2, "minimise": ()}
    assert found.reference == str(tmp_path / "truth.png")
    assert found.sets == ("light.ambient=0.1",)
    assert found.space == Space((Axis("shadows.taps", ("1", "3")), Axis("light.shading", ("pbr", "phong"))))


def test_wrong_files_get_all_their_mistakes(tmp_path: Path) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(
        "sweep: 2\naxis: {a.b: [1]}\nsize: [48]\naxes: {a.b: [], c.d: 3, e.f: [1, 1]}\nframes: 1000000000000\n"
    )
    with pytest.raises(InputError) as caught:
        read_sweep(path)
    told = [f"{p.place.line if p.place else 0} {p.message}" for p in caught.value.problems]
    assert told == [
        "1 'sweep': expected 1, the version of the format that this program reads, as in sweep: 1, got 2",
        "2 a sweep has no key 'axis'; did you mean 'axes'?",
        "3 'size': expected width and height in pixels, 1 to 16384, as in size: [1280, 720], got [48]",
        "4 'a.b': expected a list of values, or a range such as 8:64:8 or log:0.1:10:5, as in axes: {NODE.PARAM: [VALUE, VALUE], NODE.OTHER: 8:64:8}, got []",
        "4 'c.d': expected a list of values, or a range such as 8:64:8 or log:0.1:10:5, as in axes: {NODE.PARAM: [VALUE, VALUE], NODE.OTHER: 8:64:8}, got 3",
        "5 'frames': expected a whole number from 1 to 10000, got 1000000000000",
        "1 a sweep needs 'pipeline'; add pipeline: NAME",
        "4 axis 'e.f' has the value 1 twice",
    ]


def test_the_page_of_the_error_tells_the_truth(tmp_path: Path) -> None:
    import yaml

    from rendergraph.resources import folder

    page = yaml.safe_load((folder("rendergraph.errors") / "RG030-sweep-file.yaml").read_text())
    (tmp_path / "wrong.yaml").write_text(page["wrong"])
    (tmp_path / "right.yaml").write_text(page["right"])
    with pytest.raises(InputError) as caught:
        read_sweep(tmp_path / "wrong.yaml")
    (problem,) = caught.value.problems
    assert str(problem).splitlines()[0].removeprefix(f"{tmp_path / 'wrong.yaml'}:") == page["message"]
    assert read_sweep(tmp_path / "right.yaml").space.axes == (Axis("shadows.taps", ("1", "2")),)


def test_what_is_no_sweep_is_none(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("rendergraph: 1\n")
    (tmp_path / "bad.yaml").write_text("{")
    assert not any(is_sweep(tmp_path / name) for name in ("p.yaml", "bad.yaml", "missing.yaml"))


# --- ranges ----------------------------------------------------------------------------------------------------------

WHOLE = st.integers(-1000, 1000)


@settings(deadline=None)
@given(WHOLE, st.integers(1, 60), st.integers(1, 40), st.integers(0, 39))
def test_a_range_has_its_first_number_and_its_last_if_the_steps_reach_it(
    first: int, step: int, count: int, more: int
) -> None:
    more %= step
    last = first + step * (count - 1) + more
    for sign in (1, -1):
        found = parse_range(f"{sign * first}:{sign * last}:{sign * step}")
        expected = [sign * (first + number * step) for number in range(count)]
        assert found == tuple(map(str, expected))
        assert (int(expected[-1]) == sign * last) == (more == 0)


@settings(deadline=None)
@given(st.integers(-500, 500), st.integers(1, 300), st.integers(0, 50), st.integers(1, 4))
def test_steps_are_taken_in_decimals(first: int, step: int, count: int, places: int) -> None:
    def written(number: int) -> str:
        return f"{Fraction(number, 10**places).numerator / Fraction(number, 10**places).denominator:.{places}f}"

    found = parse_range(f"{written(first)}:{written(first + step * count)}:{written(step)}")
    assert isinstance(found, tuple)
    assert [float(value) for value in found] == [(first + n * step) / 10**places for n in range(count + 1)]


@settings(deadline=None)
@given(st.floats(1e-6, 1e6), st.floats(1.001, 1e6), st.integers(2, 50), st.booleans())
def test_a_logarithmic_range_has_equal_factors_and_both_ends(
    low: float, factor: float, count: int, falls: bool
) -> None:
    ends = [f"{low:.3e}", f"{low * factor:.3e}"][:: -1 if falls else 1]
    if ends[0] == ends[1]:
        return
    found = parse_range(f"log:{ends[0]}:{ends[1]}:{count}")
    assert isinstance(found, tuple)
    values = np.array(list(map(float, found)))
    np.testing.assert_allclose(values, np.geomspace(float(ends[0]), float(ends[1]), count), rtol=1e-5)
    assert (len(values), values[0], values[-1]) == (count, float(ends[0]), float(ends[1]))


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("8:64:8", "8 16 24 32 40 48 56 64"),
        ("8:63:8", "8 16 24 32 40 48 56"),
        ("3:1:-1", "3 2 1"),
        ("0:1:0.25", "0.0 0.25 0.5 0.75 1.0"),
        ("0:0.3:0.1", "0.0 0.1 0.2 0.3"),
        ("log:1:64:7", "1 2 4 8 16 32 64"),
        ("log:0.1:10:5", "0.1 0.316228 1 3.16228 10"),
        ("log:1.0:10:3", "1 3.16228 10"),
        ("5:5:1", "5"),
    ],
)
def test_ranges_by_example(text: str, values: str) -> None:
    assert parse_range(text) == tuple(values.split())
    assert parse_axis(f"a.b={text}").text == (text if " " in values else values)


@pytest.mark.parametrize("text", ["aces", "1", "-2.5e3", "[1, 2]", "'8:64:8'", "shadows.lookup", "null", "x:1:2"])
def test_what_is_no_range_is_a_value(text: str) -> None:
    assert parse_range(text) is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("8:64:0", "'8:64:0': steps of 0 do not lead from 8 to 64"),
        ("8:64:-8", "'8:64:-8': steps of -8 do not lead from 8 to 64"),
        ("8:64:8:8", "'8:64:8:8' is an invalid range; use FIRST:LAST:STEP, log:FIRST:LAST:COUNT, or"),
        ("8:x", "Quote values that contain a colon"),
        ("log:0.1", "is an invalid range"),
        ("log:0:10:5", "must lie above 0"),
        ("log:1:10:1", "the number of values, at least 2"),
        ("log:1:10:2.5", "the number of values, at least 2"),
        ("log:1:4:9", "has fewer than 9 whole numbers; for fractions write 1.0"),
        ("0:1000000:1", "makes 1000001 values, more than 10000"),
        ("0:1:1e-300", "more than 10000"),
        ("2:1", "the first number must be the lower one"),
        ("1:1e300", "numbers must not exceed 1e12"),
        ("1,2:4", "'2:4' is a continuous range, not one of several values"),
        ("1,1:3:1", "has the value 1 twice"),
    ],
)
def test_malformed_ranges_are_told(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=r"axis 'a\.b'") as caught:
        parse_axis(f"a.b={text}")
    assert message in str(caught.value)


@settings(deadline=None)
@given(st.text("0123456789:.-+eElog", max_size=12))
def test_whatever_is_written_is_read_or_refused(text: str) -> None:
    try:
        found = parse_range(text)
    except ValueError:
        return
    assert found is None or isinstance(found, Span) or len(set(found)) == len(found)


def test_ranges_stand_beside_values() -> None:
    assert parse_axis("ao.samples=4, 8:16:4,64") == Axis("ao.samples", ("4", "8", "12", "16", "64"))
    assert parse_axis("ao.radius=log:0.1:10").span == Span(0.1, 10, True, False, "log:0.1:10")
    assert parse_axis("ao.samples=8:64").span == Span(8, 64, False, True, "8:64")


# --- what goes together ----------------------------------------------------------------------------------------------


def test_one_value_and_one_axis_need_no_list() -> None:
    assert Space.of({"a.b": 3}).runs() == Space.of("a.b=3").runs() == [{"a.b": "3"}]


def test_zipped_axes_go_through_their_values_together() -> None:
    axes: dict[str, Any] = {"a": [1, 2], "b": ["x", "y", "z"], "c": "10:20:10"}
    assert Space.of(axes, zipped=[("c", "a")]).runs() == [
        {"a": a, "c": c, "b": b} for a, c in (("1", "10"), ("2", "20")) for b in "xyz"
    ]
    Space.of(axes, zipped=[("c", "a")]).check()


@pytest.mark.parametrize(
    ("zipped", "message"),
    [
        ([("a", "b")], "--zip a,b: RG524 zipped axes need the same number of values: 'a' has 2, 'b' has 3"),
        ([("a", "sun.resolutoin")], "unknown axis 'sun.resolutoin'; did you mean 'sun.resolution'?"),
        ([("a", "sun.resolution"), ("sun.resolution", "a")], "axis 'a' is zipped more than once"),
        ([("a", "span")], "'a' has 2, 'span' has a continuous range"),
    ],
)
def test_axes_that_cannot_go_together_are_told(zipped: list[tuple[str, ...]], message: str) -> None:
    axes = {"a": [1, 2], "b": [1, 2, 3], "sun.resolution": [64, 128], "span": "0.1:1"}
    with pytest.raises(InputError) as caught:
        Space.of(axes, zipped=zipped, samples=3).check()
    assert message in str(caught.value)


def test_a_span_wants_samples() -> None:
    axes = {"ao.radius": "log:0.1:1", "ao.samples": [8]}
    message = r"-x ao.radius=log:0.1:1: RG524 axis 'ao.radius' is a continuous range; add a step .log:0.1:1:COUNT. or use --samples"
    with pytest.raises(InputError, match=message):
        Space.of(axes).check()
    Space.of(axes, samples=3).check()


# --- samples ---------------------------------------------------------------------------------------------------------

SPANS = st.sampled_from(["0.1:2", "-3.5:4", "log:0.001:1000", "1000000.0:1000001", "log:0.5:0.501"])


def place(span: Span, value: float) -> Fraction:
    """Where a number lies, 0…1: the closed form that sampling inverts."""
    if span.log:
        return Fraction(math.log(value / span.low) / math.log(span.high / span.low))
    return (Fraction(value) - Fraction(span.low)) / (Fraction(span.high) - Fraction(span.low))


@settings(deadline=None, max_examples=60)
@given(SPANS, st.integers(1, 300), st.integers(0, 1 << 40))
def test_a_latin_hypercube_has_one_sample_in_each_part_of_every_axis(text: str, count: int, seed: int) -> None:
    space = Space.of({"a": text, "b": "log:1.0:50"}, samples=count, seed=seed)
    runs = space.runs()
    assert len(runs) == count
    for axis in space.axes:
        assert axis.span is not None
        places = [place(axis.span, float(run[axis.path])) for run in runs]
        assert sorted(math.floor(p * count) for p in places) == list(range(count))


@settings(deadline=None)
@given(st.integers(1, 12), st.integers(1, 5), st.integers(0, 1000))
def test_of_lists_and_whole_numbers_each_comes_equally_often(values: int, times: int, seed: int) -> None:
    axes = {"a": list(range(values)), "b": f"1:{values + 1}", "c": "0.0:1"}
    runs = Space.of(axes, samples=values * (values + 1) * times, seed=seed).runs()
    for path, different in (("a", values), ("b", values + 1)):
        counts = [sum(run[path] == value for run in runs) for value in {run[path] for run in runs}]
        assert counts == [len(runs) // different] * different


def test_whole_numbers_on_a_log_axis_have_the_width_of_their_logarithms() -> None:
    count = 5000
    runs = Space.of({"a": "log:1:8", "b": "0.0:1"}, samples=count).runs()
    for value in range(1, 9):
        share = math.log((value + 0.5) / (value - 0.5)) / math.log(8.5 / 0.5)
        assert sum(run["a"] == str(value) for run in runs) == pytest.approx(count * share, abs=2)  # a part at each end


def test_samples_are_those_of_their_seed_and_of_their_own_axis() -> None:
    axes = {"a": "0.1:2", "b": [1, 2, 3], "c": "log:1:100"}
    first = Space.of(axes, samples=16, seed=3).runs()
    assert Space.of(axes, samples=16, seed=3).runs() == first
    assert Space.of(axes, samples=16, seed=4).runs() != first
    fewer = Space.of({"a": "0.1:2", "d": "0.0:1"}, samples=16, seed=3).runs()
    assert [run["a"] for run in fewer] == [run["a"] for run in first]
    assert Space.of({"a": "0.1:2"}, samples=3).runs() == [{"a": "1.43"}, {"a": "0.31"}, {"a": "1.34"}]


def test_random_samples_are_uniform_and_zipped_ones_have_one_place() -> None:
    runs = Space.of({"a": "0.0:1", "b": "10.0:20"}, samples=4000, sampling="random", zipped=[("a", "b")]).runs()
    a, b = (np.array([float(run[path]) for run in runs]) for path in "ab")
    statistic = np.abs(np.sort(a) - (np.arange(len(a)) + 0.5) / len(a)).max()
    assert statistic < 1.63 / math.sqrt(len(a))  # Kolmogorov and Smirnov, 1 %
    np.testing.assert_allclose(b, 10 + 10 * a, atol=1e-4)


def test_equal_samples_are_one_run() -> None:
    assert len(Space.of({"a": [1, 2]}, samples=50).runs()) == 2
    with pytest.raises(InputError, match="make 20000 runs"):
        Space.of({"a": [1, 2]}, samples=20_000).check()


def test_long_names_do_not_depend_on_other_runs() -> None:
    long = {f"node{number}.parameter": "0.123456789" for number in range(9)}
    other = {**long, "node8.parameter": "0.2"}
    assert len(run_name(long)) == 120
    assert run_name(long) != run_name(other)


# --- the same in files -----------------------------------------------------------------------------------------------


def test_a_file_has_ranges_zips_and_samples(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(
        "sweep: 1\npipeline: forward\nsamples: 6\nsampling: random\nseed: 9\nzip: [[shadows.taps, sun.resolution]]\n"
        "axes: {shadows.taps: '1:3:1', sun.resolution: log:64:256:3, light.ambient: 0.0:1, display.curve: [aces, 1:2:3]}\n"
    )
    given = read_sweep(tmp_path / "s.yaml").space
    curves = Axis("display.curve", ("aces", "1:2:3"))  # of a list each is a value
    axes = [*map(parse_axis, ("shadows.taps=1,2,3", "sun.resolution=64,128,256", "light.ambient=0.0:1")), curves]
    zipped = [("shadows.taps", "sun.resolution")]
    assert given == Space.of(axes, zipped=zipped, samples=6, sampling="random", seed=9)
    assert len(given.runs()) == 6


def test_mistakes_in_a_file_are_told_at_their_place(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text("sweep: 1\npipeline: forward\naxes:\n  shadows.taps:  '1:4:0'\n  light.ambient: 0..1\n")
    with pytest.raises(InputError) as caught:
        read_sweep(path)
    told = [str(problem).splitlines()[0].removeprefix(f"{path}:") for problem in caught.value.problems]
    assert told == [
        "5:18: RG030 'light.ambient': expected a list of values, or a range such as 8:64:8 or log:0.1:10:5, as in "
        "axes: {NODE.PARAM: [VALUE, VALUE], NODE.OTHER: 8:64:8}, got '0..1'",
        "4:18: RG030 axis 'shadows.taps': '1:4:0': steps of 0 do not lead from 1 to 4",
    ]


def test_what_cannot_go_together_is_told_at_its_line(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text(
        "sweep: 1\npipeline: forward\naxes: {shadows.taps: [1, 2], light.ambient: 0.0:1}\n"
        "zip:\n  - [shadows.taps, light.ambient]\n"
    )
    file = read_sweep(path)
    with pytest.raises(InputError) as caught:
        file.space.check()
    told = [
        str(problem).splitlines()[0].removeprefix(f"{path}:") for problem in map(file.relocate, caught.value.problems)
    ]
    assert [line.partition(" RG524")[0] for line in told] == ["5:5:", "3:30:"]
