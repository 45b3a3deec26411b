"""Truths as references: drawn until exact enough, cached, and measured against; and twins that explain an error."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rendergraph.pipelines.references import reference_selection

import rendergraph as rg
from rendergraph.api import Depth as DepthTexel
from rendergraph.api import (
    DisplayColor,
    ExposureGain,
    History,
    InOut,
    Input,
    Luminance,
    Node,
    Occlusion,
    Output,
    Radiance,
    Steps,
    Visibility,
    define,
    param,
)
from rendergraph.catalog import Catalog
from rendergraph.compare import SweepOptions, compare, sweep
from rendergraph.compare.light import displayed, light_of
from rendergraph.compare.report import comparison_page, sweep_page
from rendergraph.compare.results import TwinError
from rendergraph.compare.sweepfile import read_sweep
from rendergraph.errors import InputError, UsageError
from rendergraph.metrics import measure, relative_mse, relative_noise, signed_difference
from rendergraph.session.selection import Selection

SIZE = (24, 12)
SPREAD = 0.125
"""Of the truth's noise in one frame: +SPREAD or -SPREAD, so its variance is SPREAD²."""


class Shade(Node):
    """A hard edge instead of the exact ramp."""

    twin = "exact_shade"
    visibility = Output(Visibility, format="r32f", doc="Visibility.")
    darkness: float = param(default=0.0, doc="Of the dark side; the twin has no such parameter.")


class ExactShade(Node):
    """The ramp."""

    visibility = Output(Visibility, format="r32f", doc="Visibility.")


class Crevice(Node):
    """No occlusion at all."""

    twin = "exact_crevice"
    occlusion = Output(Occlusion, format="r32f", doc="Occlusion.")


class ExactCrevice(Node):
    """A little occlusion, with noise that differs from frame to frame and has the mean 0, as of a traced twin."""

    occlusion = Output(Occlusion, format="r32f", doc="Occlusion.")


class Light(Node):
    """A light and ambient light."""

    visibility = Input(Visibility, doc="Of the light.")
    occlusion = Input(Occlusion, optional=True, doc="Of the ambient light.")
    radiance = Output(Radiance, format="rgba32f", doc="Both.")
    tint: float = param(default=1.0, doc="Factor of the light, which the truth has, too.")
    shade: int = define(default=1, max=2, doc="The truth's has another limit.")
    samples: int = define(default=1, doc="The truth's has another unit.")


class Glow(Node):
    """Stands for bloom: adds to the picture, not to the light."""

    radiance = InOut(Radiance, doc="Continued.")

    def record(self, steps: Steps) -> None:
        """One additive step."""
        from rendergraph.api import ADD, State

        steps.fullscreen("glow.frag", out=self.radiance, state=State(blend=ADD))


class Gain(Node):
    """Automatic exposure: what makes the light of one texel 0.5."""

    radiance = Input(Radiance, size="any", doc="Light.")
    gain = Output(ExposureGain, format="r32f", size=(1, 1), doc="Factor.")


class Show(Node):
    """The output transform: a factor and a clamp."""

    radiance = Input(Radiance, doc="Light.")
    gain = Input(ExposureGain, size="any", optional=True, doc="Factor.")
    color = Output(DisplayColor, format="rgba8", doc="Picture.")


class Sampled(Node):
    """The truth: the exact light with noise, averaged over frames."""

    radiance = Output(Radiance, format="rgba32f", doc="Mean of all frames so far.")
    variance = Output(Radiance, format="rgba32f", doc="Of this mean.")
    samples_taken = Output(Luminance, format="r32f", doc="16 in each frame.")
    tint: float = param(default=1.0, doc="Factor of the light.")
    shade: int = define(default=1, max=1, doc="No more than 1.")
    samples: int = define(default=1, unit="paths", doc="Not those of a raster.")
    mean = History(Radiance, format="rgba32f")

    def record(self, steps: Steps) -> None:
        """One step, which continues the mean of the frame before."""
        out = {name: getattr(self, name) for name in ("radiance", "variance", "samples_taken", "mean")}
        steps.fullscreen("sampled.frag", previous=self.mean.previous, out=out)


class Twist(Node):
    """Names a twin that does not fit: it has no such output."""

    twin = "show"
    visibility = Output(Visibility, format="r32f", doc="Visibility.")
    depth = Input(DepthTexel, optional=True, doc="Depth.")


CLASSES = (Shade, ExactShade, Crevice, ExactCrevice, Light, Glow, Gain, Show, Sampled, Twist)
_HEAD = "in vec2 v_uv;\n"
_NOISE = (
    "float sign_of(vec2 at, float n) {\n"
    "    uvec3 v = uvec3(uint(at.x), uint(at.y), uint(n)) * uvec3(1664525u, 22695477u, 69069u) + 1013904223u;\n"
    "    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y; v ^= v >> 16u;\n"
    "    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;\n"
    "    return (v.z >> 13u & 1u) == 1u ? 1.0 : -1.0;\n}\n"
)
_EXACT = "vec3 exact(vec2 uv) { return vec3(1.5, 1.0, 0.25) * uv.x + 0.2 * (0.9 + 0.1 * uv.y); }\n"
SHADERS = {
    "shade.frag": _HEAD + "uniform float darkness; out float visibility;\n"
    "void main() { visibility = v_uv.x > 0.5 ? 1.0 : darkness; }",
    "exact_shade.frag": _HEAD + "out float visibility; void main() { visibility = v_uv.x; }",
    "twist.frag": _HEAD + "out float visibility; void main() { visibility = v_uv.x; }",
    "crevice.frag": "out float occlusion; void main() { occlusion = 1.0; }",
    "exact_crevice.frag": "#include <frame.glsl>\n" + _HEAD + _NOISE + "out float occlusion;\n"
    "void main() { occlusion = 0.9 + 0.1 * v_uv.y + 0.8 * sign_of(gl_FragCoord.xy, float(frame_index)); }",
    "light.frag": "uniform sampler2D visibility; uniform float tint;\n#ifdef HAS_OCCLUSION\nuniform sampler2D occlusion;\n#endif\n"
    "out vec4 radiance; void main() { ivec2 at = ivec2(gl_FragCoord.xy); float open = 1.0;\n"
    "#ifdef HAS_OCCLUSION\nopen = texelFetch(occlusion, at, 0).x;\n#endif\n"
    "radiance = vec4(tint * (vec3(1.5, 1.0, 0.25) * texelFetch(visibility, at, 0).x + 0.2 * open), 1.0); }",
    "glow.frag": "out vec4 radiance; void main() { radiance = vec4(0.5); }",
    "gain.frag": "uniform sampler2D radiance; out float gain;\n"
    "void main() { gain = 0.5 / texelFetch(radiance, textureSize(radiance, 0) - 1, 0).y; }",
    "show.frag": "uniform sampler2D radiance;\n#ifdef HAS_GAIN\nuniform sampler2D gain;\n#endif\nout vec4 color;\n"
    "void main() { float factor = 0.25;\n#ifdef HAS_GAIN\nfactor = texelFetch(gain, ivec2(0), 0).x;\n#endif\n"
    "color = clamp(factor * texelFetch(radiance, ivec2(gl_FragCoord.xy), 0), 0.0, 1.0); }",
    "sampled.frag": "#include <frame.glsl>\n"
    + _HEAD
    + _NOISE
    + _EXACT
    + "uniform sampler2D previous; uniform float tint;\n"
    "out vec4 radiance; out vec4 variance; out float samples_taken; out vec4 mean;\n"
    f"void main() {{ vec4 old = texelFetch(previous, ivec2(gl_FragCoord.xy), 0); float n = old.w + 1.0;\n"
    f"vec3 drawn = tint * exact(v_uv) + time + {SPREAD} * sign_of(gl_FragCoord.xy, n);\n"
    "mean = vec4(mix(old.rgb, drawn, 1.0 / n), n); radiance = vec4(mean.rgb, 1.0);\n"
    f"variance = vec4(vec3({SPREAD * SPREAD} / n), 1.0); samples_taken = 16.0 * n; }}",
}
NODES: dict[str, Any] = {
    "shadows": {"type": "shade"},
    "ao": {"type": "crevice"},
    "light": {"type": "light", "inputs": {"visibility": "shadows.visibility", "occlusion": "ao.occlusion"}},
    "exposure": {"type": "gain", "inputs": {"radiance": "light.radiance"}},
    "bloom": {"type": "glow", "inputs": {"radiance": "light.radiance"}},
    "display": {"type": "show", "inputs": {"radiance": "bloom.radiance", "gain": "exposure.gain"}},
}
TRUTH = {
    "nodes": {"light": {"type": "sampled"}},
    "outputs": {f"{name}": f"light.{name}" for name in ("radiance", "variance", "samples_taken")},
}


class Maker:
    """Makes pipelines of the node types of this file."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.made = folder, 0
        for name, source in SHADERS.items():
            (folder / name).write_text(source)
        self.catalog = Catalog.of(*CLASSES, shaders=folder)

    def __call__(self, document: dict[str, Any], name: str = "") -> rg.Pipeline:
        self.made += 1
        path = self.folder / f"{name or f'v{self.made}'}.yaml"
        path.write_text(yaml.safe_dump({"rendergraph": 1, "size": list(SIZE), **document}, sort_keys=False))
        return replace(rg.load(path), catalog=self.catalog)

    def approximate(self, **nodes: Any) -> rg.Pipeline:
        outputs = {"image": "display.color", "radiance": "bloom.radiance"}
        return self({"nodes": {k: v for k, v in (NODES | nodes).items() if v}, "outputs": outputs}, "approximate")

    def truth(self) -> rg.Pipeline:
        return self(TRUTH, "truth")


@pytest.fixture
def make(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Maker:
    monkeypatch.setenv("RENDERGRAPH_CACHE", str(tmp_path / "cache"))
    folder = tmp_path / "pipelines"
    folder.mkdir()
    return Maker(folder)


def _uv() -> tuple[Any, Any]:
    width, height = SIZE
    x, y = (np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height
    return np.broadcast_to(x, (height, width)), np.broadcast_to(y[:, None], (height, width))


def _exact_light() -> Any:
    x, y = _uv()
    return np.array([1.5, 1.0, 0.25]) * x[..., None] + 0.2 * (0.9 + 0.1 * y[..., None])


def _approximate_light() -> Any:
    x, _ = _uv()
    return np.array([1.5, 1.0, 0.25]) * (x[..., None] > 0.5) + 0.2


def test_the_truth_is_drawn_until_its_noise_is_a_part_of_the_smallest_error(make: Maker, gl: rg.Session) -> None:
    found = compare(make.approximate(), make.truth(), frames=1, session=gl, reference_noise=0.02)
    reference, (result,) = found.reference, found.results
    assert reference.samples is not None
    assert reference.noise is not None
    assert result.relative_mse is not None
    frames = reference.samples / 16
    r = reference.light
    assert r is not None
    assert np.abs(r - _exact_light()).std() < 1.3 * SPREAD / math.sqrt(frames)  # it is the mean of that many frames
    assert reference.noise == pytest.approx(np.mean(SPREAD**2 / frames / (np.square(r.astype("f8")) + 0.01)), rel=1e-4)
    assert reference.noise <= 0.02 * result.relative_mse
    assert reference.noise > 0.005 * result.relative_mse  # and not much longer
    a = _approximate_light()
    assert result.relative_mse == pytest.approx(np.mean((a - r) ** 2 / (r.astype("f8") ** 2 + 0.01)), rel=1e-4)
    assert found.as_json()["reference_noise"] == reference.noise
    assert found.noise_share == pytest.approx(reference.noise / result.relative_mse)


def test_light_is_compared_before_bloom_and_pictures_with_the_exposure_of_the_first_pipeline(
    make: Maker, gl: rg.Session
) -> None:
    pipeline = make.approximate()
    found = compare(pipeline, make.truth(), frames=1, session=gl, reference_noise=0.01)
    (result,), light = found.results, found.reference.light
    assert light is not None
    assert result.radiance_rmse == pytest.approx(np.sqrt(np.mean((_approximate_light() - light) ** 2)), rel=1e-4)
    gain = 0.5 / 1.2  # that of the approximate light: the truth's own would be another
    expected = np.clip(gain * (light + 0.5), 0, 1)
    assert np.abs(found.reference.pixels[..., :3] / 255 - expected).max() < 1 / 255
    own = np.clip(gain * (_approximate_light() + 0.5), 0, 1)
    assert result.pixels is not None
    assert np.abs(result.pixels[..., :3] / 255 - own).max() < 1 / 255
    planned = pipeline.check()
    assert str(light_of(planned.linked.graph)) == "light.radiance"
    exact = displayed(gl, planned, light_of(planned.linked.graph), _exact_light(), "image", 1)
    noise = measure(exact, found.reference.pixels)[0].flip  # the real one; the estimate knows the variance alone
    assert found.reference.flip_noise == pytest.approx(noise, rel=0.25)
    shown = displayed(gl, planned, light_of(planned.linked.graph), _approximate_light(), "image", 1)
    assert np.array_equal(shown, result.pixels)  # its own light gives its own picture


def test_pipelines_without_a_picture_are_compared_by_their_light(make: Maker, gl: rg.Session) -> None:
    nodes = {"nodes": {**{name: NODES[name] for name in ("shadows", "light")}, "ao": NODES["ao"]}}
    found = compare(make(nodes | {"outputs": {"radiance": "light.radiance"}}), make.truth(), frames=1, session=gl)
    (result,) = found.results
    assert found.reference.output == "radiance"
    assert np.array_equal(found.reference.pixels, found.reference.light)  # type: ignore[arg-type]
    assert result.metrics.rmse == pytest.approx(result.radiance_rmse)
    assert result.metrics.rmse > 0.1


def test_the_twin_that_reduces_the_error_most_is_named(make: Maker, gl: rg.Session) -> None:
    pipeline = make.approximate().set("shadows.darkness", 0.1)  # which the twin lacks
    found = compare(pipeline, make.truth(), frames=1, session=gl, reference_noise=0.005)
    (result,) = found.results
    assert [one.node for one in result.error_by] == ["shadows", "ao"]
    shadows, ao = result.error_by
    r, (x, y) = found.reference.light, _uv()
    assert r is not None
    hard = np.where(x[..., None] > 0.5, 1.0, 0.1)
    ramp, open_ = x[..., None], 0.9 + 0.1 * y[..., None]
    color = np.array([1.5, 1.0, 0.25])
    assert shadows.relative_mse == pytest.approx(relative_mse(color * ramp + 0.2, r), rel=1e-3)
    exact = relative_mse(color * hard + 0.2 * open_, r)
    noise = np.mean((0.2 * 0.8) ** 2 / 16 / (np.square(r.astype("f8")) + 0.01))  # of the mean of 16 frames
    assert ao.relative_mse == pytest.approx(exact + noise, abs=float(0.5 * noise))
    assert shadows.relative_mse is not None
    assert shadows.reduction == pytest.approx(1 - shadows.relative_mse / relative_mse(color * hard + 0.2, r), rel=1e-3)
    document = found.as_json()["variants"][0]["error_by"]
    assert list(document) == ["shadows", "ao"]
    assert document["shadows"]["twin"] == "exact_shade"
    assert not found.notes


def test_errors_that_no_twin_reduces_have_other_causes(make: Maker, gl: rg.Session) -> None:
    light = {"type": "light", "inputs": {"visibility": "shadows.visibility"}}  # reads no occlusion, and lacks the ramp
    exact = {"shadows": {"type": "exact_shade"}, "light": light, "ao": None}
    found = compare(make.approximate(**exact), make.truth(), frames=1, session=gl, reference_samples=320)
    assert found.results[0].error_by == ()
    assert found.results[0].cause == ""
    result = replace(found.results[0], error_by=(TwinError("ao", "crevice", "exact_crevice", 0.5, -0.1),))
    assert result.cause == "no twin reduces its error, which has other causes than ao"


def test_twins_that_do_not_fit_are_said_and_leave_the_others(make: Maker, gl: rg.Session) -> None:
    found = compare(make.approximate(shadows={"type": "twist"}), make.truth(), frames=1, session=gl)
    assert [one.node for one in found.results[0].error_by] == ["ao"]
    assert any("'shadows' of 'approximate' cannot be replaced by its twin 'show'" in note for note in found.notes)


def test_limits_end_the_drawing_and_the_remaining_noise_is_said(
    make: Maker, gl: rg.Session, capsys: pytest.CaptureFixture[str]
) -> None:
    limits: Any = {"reference_noise": 1e-9, "reference_samples": 100}
    found = compare(make.approximate(), make.truth(), frames=1, session=gl, progress=True, **limits)
    shown = [text.strip() for text in capsys.readouterr().err.split("\r") if "of truth" in text]
    assert " 0 of 100 % of truth, 0 samples" in shown[0]
    assert "% of truth, 96 samples, noise " in shown[-1]
    parts = [int(text.split(" of 100 %")[0].split()[-1]) for text in shown]
    assert parts == sorted(parts)
    assert found.reference.samples == 112  # the first whole frame
    assert any("after 112 samples is" in note and "--reference-samples 100 ended it" in note for note in found.notes)


def test_the_truth_is_cached_and_drawn_again_only_if_it_must_be_more_exact(
    make: Maker, gl: rg.Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[int] = []
    from rendergraph.compare import truth as module

    original = module.draw_truth

    def counted(*given: Any) -> Any:
        drawn.append(1)
        return original(*given)

    monkeypatch.setattr(module, "draw_truth", counted)
    first = compare(make.approximate(), make.truth(), frames=1, session=gl)
    again = compare(make.approximate(ao={"type": "exact_crevice"}), make.truth(), frames=1, session=gl)
    assert len(drawn) == 1
    assert first.reference.light is not None
    assert again.reference.light is not None
    assert np.array_equal(first.reference.light, again.reference.light)
    sharper = compare(make.approximate(), make.truth(), frames=1, session=gl, reference_noise=0.01)
    assert len(drawn) == 2
    assert (sharper.reference.samples or 0) > (first.reference.samples or 0)
    (make.folder / "sampled.frag").write_text(SHADERS["sampled.frag"].replace("vec3(1.5", "vec3(1.4"))
    compare(make.approximate(), make.truth(), frames=1, session=gl, reference_noise=0.5)
    assert len(drawn) == 3  # it is another truth
    for file in (make.folder.parent / "cache").rglob("*.npz"):
        file.write_bytes(b"torn")
    compare(make.approximate(), make.truth(), frames=1, session=gl, reference_noise=0.5)
    assert len(drawn) == 4


def test_the_truth_takes_over_what_decides_the_light_of_the_node_in_its_place(make: Maker, gl: rg.Session) -> None:
    limits: Any = {"session": gl, "frames": 1, "reference_samples": 64}
    pipeline, truth = make.approximate(), make.truth()
    dark = pipeline.set("light.tint", 0.5).set("light.shade", 2).set("light.samples", 3)
    found = compare([dark, pipeline], truth, names=["dark", "bright"], **limits)
    assert found.notes[0] == "'truth' is drawn with light.tint=0.5, as 'dark' has it"
    assert found.notes[1] == "measured against the truth of 'dark', with another light.tint: bright"
    assert found.reference.light is not None
    assert np.abs(found.reference.light - 0.5 * _exact_light()).max() < 2 * SPREAD
    errors = [result.relative_mse or math.inf for result in found.results]
    assert errors[0] < errors[1]
    told = compare([dark], make(TRUTH | {"nodes": {"light": {"type": "sampled", "params": {"tint": 1}}}}), **limits)
    assert not any("light.tint" in note for note in told.notes)  # it says itself what it is
    assert told.reference.light is not None
    assert np.abs(told.reference.light - _exact_light()).max() < 2 * SPREAD
    swept = sweep(pipeline, {"light.tint": [0.5, 1]}, make.folder / "out", truth, **limits)
    assert swept.comparison.notes[1].endswith("with another light.tint: light.tint=1")


def test_settings_of_a_reference_follow_its_name() -> None:
    selection = reference_selection(
        Selection("path-traced:light.background=[0.5, 0, 0],light.max_bounces=2", sets=("a=1",))
    )
    assert selection == Selection("path-traced", sets=("light.background=[0.5, 0, 0]", "light.max_bounces=2"))
    assert reference_selection(Selection("C:/truth.yaml")).source == "C:/truth.yaml"


def test_sweeps_measure_against_the_truth_and_resume(make: Maker, gl: rg.Session, tmp_path: Path) -> None:
    axes = {"shadows.type": ["shade", "exact_shade"], "ao.type": ["crevice", "exact_crevice"]}
    options: Any = {"session": gl, "frames": 1, "reference_samples": 320}  # of an exact run the truth sees only noise
    found = sweep(make.approximate(), axes, tmp_path / "out", make.truth(), **options)
    errors = {result.name: result.relative_mse or 0.0 for result in found.comparison.results}
    assert min(errors, key=errors.__getitem__) == "shadows.type=exact_shade,ao.type=crevice"
    again = sweep(make.approximate(), axes, tmp_path / "out", make.truth(), **options, resume=True)
    assert again.resumed == 4
    assert {result.name: result.relative_mse for result in again.comparison.results} == errors
    assert again.as_json()["reference_noise"] == found.comparison.reference.noise
    lines = [json.loads(line) for line in (tmp_path / "out" / "results.jsonl").read_text().splitlines()]
    assert [line["relative_mse"] for line in lines] == list(errors.values())
    assert "Light against the truth" in sweep_page(found, "command")


def test_a_sweep_s_file_has_the_limits_of_its_truth(tmp_path: Path) -> None:
    limits = {"reference_noise": 0.02, "reference_samples": 64, "reference_seconds": 5}
    text = {"sweep": 1, "pipeline": "forward", "axes": {"shadows.taps": [1, 3]}, "reference": "./truth.yaml", **limits}
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(text, sort_keys=False))
    file = read_sweep(tmp_path / "study.yaml")
    assert {name: file.options[name] for name in limits} == limits
    assert SweepOptions(**file.options).limits.most_samples == 64
    assert file.reference == str(tmp_path / "truth.yaml")
    for given, read in {"path-traced:light.seed=1": "", "./truth.yaml:light.seed=1": f"{tmp_path}/"}.items():
        (tmp_path / "study.yaml").write_text(yaml.safe_dump(text | {"reference": given}, sort_keys=False))
        assert read_sweep(tmp_path / "study.yaml").reference == read + given.removeprefix("./")


def test_the_report_shows_where_light_is_wrong_and_why(make: Maker, gl: rg.Session) -> None:
    found = compare(make.approximate(), make.truth(), frames=1, session=gl)
    result = found.results[0]
    assert result.signed_map is not None
    expected = signed_difference(_approximate_light(), found.reference.light)  # type: ignore[arg-type]
    assert np.abs(result.signed_map - expected).max() < 1e-3
    page = comparison_page(found, "command")
    assert "Light against the truth" in page
    assert "too dark" in page
    assert "approximate: most of its error comes from shadows (shade)" in page
    assert "rel. MSE" in page


def test_scenes_that_move_stand_still_while_the_truth_is_drawn(gl: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text(
        "scene: 1\nobjects: {box: {shape: box}}\ncameras: {main: {eye: [2, 2, 2], target: [0, 0, 0]}}\n"
        "keyframes: {objects.box.at: {0: [0, 0, 0], 1: [2, 0, 0]}}\n"
    )
    pipeline = rg.load("forward", scene=tmp_path / "scene.yaml", size=(32, 18))
    fixed = pipeline.render(session=gl, frames=range(5, 6))
    held = list(pipeline.frames(session=gl, frames=range(5, 8), still=5))
    assert all(np.array_equal(frame["radiance"], fixed["radiance"]) for frame in held)
    assert not np.array_equal(pipeline.render(session=gl, frames=range(7, 8))["radiance"], fixed["radiance"])
    assert held[-1].number == 7


def test_the_truth_is_that_of_the_compared_frame(make: Maker, gl: rg.Session) -> None:
    """All of its frames have the time of that one, and none before it counts."""
    limits: Any = {"reference_noise": 1e-9, "reference_samples": 64}
    found = compare(make.approximate(), make.truth(), frames=1, session=gl, frame=31, **limits)
    assert found.reference.samples == 64
    assert found.reference.light is not None
    assert np.abs(found.reference.light - (_exact_light() + 1.0)).max() <= SPREAD + 1e-5


def test_limits_without_a_truth_and_pictures_without_one_light_are_refused(make: Maker, gl: rg.Session) -> None:
    with pytest.raises(UsageError, match="belong to a reference that accumulates"):
        compare(make.approximate(), make.approximate(), frames=1, session=gl, reference_samples=4)
    nodes = NODES | {"second": {"type": "light", "inputs": {"visibility": "shadows.visibility"}}}
    nodes["other"] = {"type": "show", "inputs": {"radiance": "second.radiance"}}
    nodes["last"] = {"type": "show", "inputs": {"radiance": "second.radiance", "gain": "display.color"}}
    nodes["last"] = {"type": "mixed", "inputs": {"a": "display.color", "b": "other.color"}}

    class Mixed(Node):
        """Two pictures."""

        a = Input(DisplayColor, doc="One.")
        b = Input(DisplayColor, doc="Two.")
        color = Output(DisplayColor, format="rgba8", doc="Both.")

    (make.folder / "mixed.frag").write_text(
        "uniform sampler2D a; uniform sampler2D b; out vec4 color;\n"
        "void main() { ivec2 at = ivec2(gl_FragCoord.xy); color = texelFetch(a, at, 0) + texelFetch(b, at, 0); }"
    )
    make.catalog = Catalog.of(*CLASSES, Mixed, shaders=make.folder)
    two = make({"nodes": nodes, "outputs": {"image": "last.color"}}, "two")
    with pytest.raises(InputError, match="'two' has no single texture of radiance"):
        compare(two, make.truth(), frames=1, session=gl)


def test_relative_errors_are_those_of_numpy_in_float64() -> None:
    rng = np.random.default_rng(1)
    a, r, v = (rng.random((5, 7, 3)).astype(np.float32) for _ in range(3))
    a64, r64, v64 = (each.astype(np.float64) for each in (a, r, v))
    assert relative_mse(a, r) == pytest.approx(np.mean((a64 - r64) ** 2 / (r64**2 + 0.01)), rel=1e-12)
    assert relative_noise(v, r) == pytest.approx(np.mean(v64 / (r64**2 + 0.01)), rel=1e-12)
    assert math.isnan(relative_mse(np.where(a > 0.5, np.inf, a), r))
    signed = signed_difference(np.zeros((2, 2, 3)), np.ones((2, 2, 3)))
    assert signed == pytest.approx(np.full((2, 2), -1 / 1.01))
    assert signed_difference(r, r) == pytest.approx(np.zeros((5, 7)))


@pytest.mark.slow
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("executor", ["serial", "processes:2"])
def test_traced_occlusion_explains_the_error_of_the_screen_s(
    gl: rg.Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, executor: str
) -> None:
    """Against the same pipeline with many rays, whose variance is taken for 0, in this process and in others."""
    monkeypatch.setenv("RENDERGRAPH_CACHE", str(tmp_path))
    (tmp_path / "none.frag").write_text("out vec4 color;\nvoid main() { color = vec4(0.0); }\n")
    (tmp_path / "truth.yaml").write_text(
        "rendergraph: 1\nextends: traced-occlusion\nnodes:\n  ao: {params: {samples: 128}}\n"
        "  none: {type: ./none.frag}\noutputs: {variance: none.color}\n"
    )
    options: Any = {"executor": executor} if executor != "serial" else {"session": gl}
    pipeline = rg.load("ssao-gtao", size=(48, 27))
    found = compare([pipeline, pipeline.set("ao.samples", 8)], str(tmp_path / "truth.yaml"), frames=1, **options)
    for result in found.results:
        (error,) = (one for one in result.error_by if one.node == "ao")
        assert error.twin == "traced_occlusion"
        assert error.reduction is not None
        assert error.reduction > 0.8
        assert result.cause.startswith("most of its error comes from ao")
        weak = replace(result, error_by=(replace(error, reduction=0.04),))
        assert weak.cause.startswith("the largest known part of its error comes from ao")
    assert found.reference.noise == 0
