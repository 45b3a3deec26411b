"""Image-based light against float64 integrals of the same pictures, which were not made with this code."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg

Floats = npt.NDArray[np.float64]
Asked = Callable[..., Floats]
NAMES = ["white", "synthetic", "real", "sunsky"]
CALLER = '''
from __future__ import annotations

from rendergraph.api import Any, EnvironmentLight, Input, Node, Output

class Asked(Node):
    """What the environment answers."""

    environment = Input(EnvironmentLight, kind="function", doc="Light.")
    answers = Output(Any, format="rgba32f", size=({count}, 1), doc="One texel a question.")
'''
PIPELINE = """rendergraph: 1
nodes:
  environment: {type: environment_light}
  asked: {type: asked, inputs: {environment: environment.light}}
outputs: {answers: asked.answers}
"""
PLAIN = """scene: 1
objects: {ball: {shape: sphere, radius: 1, segments: 64, rings: 32, material: metal}}
materials: {metal: {base_color: [1, 1, 1], metallic: %s, roughness: %s}}
cameras: {main: {eye: [0, 0, 4], target: [0, 0, 0], height: 2.2}}
"""


@pytest.fixture
def references(shared: Path) -> Path:
    return shared / "reference" / "b5_ibl"


@pytest.fixture
def asked(session: rg.Session, references: Path, tmp_path: Path) -> Asked:
    """`asked(environment, directions, lobes, *sets)`: what `light_from()` returns, (n, 3)."""

    def ask(name: str | Path, directions: Floats, lobes: Floats, *sets: str) -> Floats:
        rows = np.concatenate([directions, np.broadcast_to(lobes, len(directions))[:, None]], axis=1)
        table = ", ".join(f"vec4({', '.join(f'{value:.9f}' for value in row)})" for row in rows)
        (tmp_path / "asked.py").write_text(CALLER.replace("{count}", str(len(rows))))
        (tmp_path / "asked.frag").write_text(
            f"const vec4 questions[{len(rows)}] = vec4[]({table});\nout vec4 answers;\n"
            "void main() { vec4 asked = questions[int(gl_FragCoord.x)];\n"
            "answers = vec4(light_from(normalize(asked.xyz), asked.w), 1.0); }\n"
        )
        (tmp_path / "asked.yaml").write_text(PIPELINE)
        file = name if isinstance(name, Path) else references / f"env_{name}.exr"
        pipeline = rg.load(tmp_path / "asked.yaml", plugins=[tmp_path / "asked.py"], environment=file, sets=sets)
        return np.asarray(session.render(pipeline)["answers"][0, :, :3], np.float64)

    return ask


def oracles(folder: Path, name: str) -> tuple[dict[str, Floats], Floats]:
    """The integrals of an environment, and its mean radiance."""
    table = {key: np.asarray(value, np.float64) for key, value in np.load(folder / f"env_{name}_oracles.npz").items()}
    return table, table["sh"][0] / np.sqrt(4 * np.pi)


@pytest.mark.parametrize("name", NAMES)
def test_harmonics_are_the_integrals(session: rg.Session, references: Path, tmp_path: Path, name: str) -> None:
    """Within 1 % of the mean radiance, also around a sun of one texel."""
    table, mean = oracles(references, name)
    (tmp_path / "p.yaml").write_text(
        "rendergraph: 1\nnodes: {environment: {type: environment_light}}\noutputs: {cube: environment.specular}\n"
    )
    pipeline = rg.load(tmp_path / "p.yaml", environment=references / f"env_{name}.exr")
    frame = session.render(pipeline, outputs=[], taps=["environment.harmonics"])
    bands = np.asarray(frame["environment.harmonics"]).reshape(16, 4)[:9, :3]
    assert (np.abs(bands - table["sh"]) / mean).max() < 0.01


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("name", NAMES)
def test_irradiance_is_that_of_nine_harmonics(asked: Asked, references: Path, name: str) -> None:
    table, mean = oracles(references, name)
    found = np.pi * asked(name, table["normals"], np.array(2.0), "environment.window=false")
    expected = np.maximum(table["irradiance_sh"], 0)  # light is never less than none
    assert (np.abs(found - expected) / (np.pi * mean)).max() < 0.01


@pytest.mark.nightly
def test_the_window_keeps_light_from_ringing(session: rg.Session, asked: Asked, tmp_path: Path) -> None:
    """Nine harmonics of one small light fall below 0 behind it, and are cut there; damped they need not be."""
    from rendergraph.images import write

    sun = np.zeros((32, 64, 3), np.float32)
    sun[8, 20] = 1000
    write(tmp_path / "env_sun.exr", sun)
    directions = np.random.default_rng(3).normal(size=(400, 3))
    cut, damped = (
        asked(tmp_path / "env_sun.exr", directions, np.array(2.0), f"environment.window={word}")
        for word in ("false", "true")
    )
    assert (cut == 0).any(axis=1).mean() > 0.1
    assert (damped == 0).any(axis=1).mean() < 0.01
    # By a power of the degree: the second band is damped by the fourth power of what the first is.
    pipeline = rg.load("ibl", size=(8, 8), environment=tmp_path / "env_sun.exr")
    frame = session.render(pipeline, outputs=["radiance"], taps=["environment.harmonics"])
    texels = np.asarray(frame["environment.harmonics"], np.float64)[0]
    first, second = texels[9][0] / (0.488603 * texels[3][0]), texels[12][0] / (1.092548 * texels[4][0])
    assert first < 0.9 * 2 / 3
    assert second / 0.25 == pytest.approx((first / (2 / 3)) ** 4, rel=1e-3)
    # A light that is everywhere needs none of it.
    even = [asked("white", directions, np.array(2.0), f"environment.window={word}") for word in ("false", "true")]
    np.testing.assert_array_equal(even[0], even[1])


@pytest.mark.nightly(keep=2)
@pytest.mark.parametrize("name", NAMES)
def test_prefiltered_light_is_the_integral(asked: Asked, references: Path, name: str) -> None:
    """Within 2 % from roughness 0.3 on, at levels and between them, also around a sun of one texel."""
    table, mean = oracles(references, name)
    rough = table["pre_roughness"] > 0.29
    directions, lobes, expected = (table[key][rough] for key in ("pre_dir", "pre_roughness", "pre_nol"))
    found = asked(name, directions, lobes)
    off = (np.abs(found - expected) / np.maximum(expected, mean)).max(axis=1)
    assert off.max() < 0.02


def test_a_small_light_is_as_bright_between_levels_as_it_should_be(asked: Asked, tmp_path: Path) -> None:
    """Within 10 % of the peak from roughness 0.2 on; levels mixed evenly in roughness are 45 % too bright at 0.25."""
    from rendergraph.images import write

    picture = np.zeros((256, 512, 3), np.float32)
    picture[70, 200] = 20000
    write(tmp_path / "env.exr", picture)
    polar, azimuth = np.pi * 70.5 / 256, 2 * np.pi * 200.5 / 512
    sine = np.sin(polar)
    sun = np.array([-sine * np.cos(azimuth), np.cos(polar), -sine * np.sin(azimuth)])
    solid_angle = sine * (np.pi / 256) ** 2
    roughness, away = (grid.ravel() for grid in np.meshgrid(np.arange(0.2, 0.51, 0.025), np.arange(0, 4, 0.5)))
    across = np.cross(sun, [0, 1, 0])
    across /= np.linalg.norm(across)
    angle = away * roughness**2
    directions = np.cos(angle)[:, None] * sun + np.sin(angle)[:, None] * across

    def lobe(cosine: Floats, a2: Floats) -> Floats:
        return np.asarray(cosine / (0.5 * (1 + a2) - 0.5 * (1 - a2) * cosine) ** 2)

    theta = np.linspace(0, np.pi / 2, 20001)
    whole = 2 * np.pi * np.trapezoid(lobe(np.cos(theta), roughness[:, None] ** 4) * np.sin(theta), theta, axis=-1)
    expected = 20000 * solid_angle * lobe(np.cos(angle), roughness**4) / whole
    peak = 20000 * solid_angle * lobe(np.array(1.0), roughness**4) / whole
    found = asked(tmp_path / "env.exr", directions, roughness)[:, 0]
    assert (np.abs(found - expected) / peak).max() < 0.1


def test_sampled_lobes_are_the_integrated_ones(asked: Asked, tmp_path: Path) -> None:
    """Where light changes slowly, and a few directions find all of it."""
    from rendergraph.images import write

    up = np.cos((np.arange(32) + 0.5) / 32 * np.pi)
    write(tmp_path / "env.exr", np.broadcast_to(1 + 0.9 * up[:, None, None], (32, 64, 3)).astype(np.float32))
    directions = np.random.default_rng(5).normal(size=(30, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lobes = np.repeat([0.2, 0.6, 1.0], 10)
    whole = asked(tmp_path / "env.exr", directions, lobes)
    many = ("environment.samples=256", "environment.level_bias=-1")  # each direction stands for little
    sampled = asked(tmp_path / "env.exr", directions, lobes, "environment.integrated_from=2", *many)
    np.testing.assert_allclose(sampled, whole, atol=0.01)
    mixed = asked(tmp_path / "env.exr", directions, lobes, "environment.integrated_from=0.5")
    np.testing.assert_array_equal(mixed[10:], whole[10:])


@pytest.mark.parametrize("smith", ["exact", "fast"])
def test_the_table_of_what_is_mirrored(session: rg.Session, references: Path, smith: str) -> None:
    """Within 1e-3 at most places, and 2e-3 on the steepest slope, where the reference itself is 9e-4 off."""
    wanted = dict(np.load(references / "brdf_table.npz"))
    pipeline = rg.load("ibl", size=(8, 8), sets=[f"light.smith={smith}"])
    frame = session.render(pipeline, outputs=["radiance"], taps=["light.brdf_table"])
    table = np.asarray(frame["light.brdf_table"], np.float64)[::-1, :, :2]
    rows = np.clip(wanted["roughness"] * table.shape[0] - 0.5, 0, table.shape[0] - 1)
    columns = np.clip(np.sqrt(wanted["nov"]) * table.shape[1] - 0.5, 0, table.shape[1] - 1)
    y, x = np.meshgrid(rows, columns, indexing="ij")
    y0, x0 = np.minimum(y.astype(int), table.shape[0] - 2), np.minimum(x.astype(int), table.shape[1] - 2)
    fy, fx = (y - y0)[..., None], (x - x0)[..., None]
    low = table[y0, x0] * (1 - fx) + table[y0, x0 + 1] * fx
    found = low * (1 - fy) + (table[y0 + 1, x0] * (1 - fx) + table[y0 + 1, x0 + 1] * fx) * fy
    off = np.abs(found - np.stack([wanted[f"A_{smith}"], wanted[f"B_{smith}"]], axis=-1)).max(axis=-1)
    assert np.sort(off.ravel())[-4] < 1e-3
    assert off.max() < 2e-3


@pytest.mark.parametrize("roughness", [0.1, 0.5, 1.0])
def test_a_white_furnace(session: rg.Session, references: Path, tmp_path: Path, roughness: float) -> None:
    """In light of 1 from everywhere white metal is 1 if nothing is lost between its facets, and so is white paint."""
    for metallic, sets in ((1, ()), (0, ("light.environment_part=diffuse",))):
        (tmp_path / "s.yaml").write_text(PLAIN % (metallic, roughness))
        pipeline = rg.load("forward", scene=tmp_path / "s.yaml", environment=references / "env_white.exr", sets=sets)
        picture = session.render(pipeline.with_size((48, 48)), outputs=["radiance"])["radiance"]
        inside = picture[..., 3] == 1
        assert inside.mean() > 0.3
        np.testing.assert_allclose(picture[inside][:, :3], 1, atol=0.005)


def test_a_coloured_metal_in_even_light(session: rg.Session, references: Path, tmp_path: Path) -> None:
    """Each pixel of a ball is the table's of its angle, and with compensation as Turquin has it."""
    wanted = dict(np.load(references / "brdf_table.npz"))
    row = int(np.abs(wanted["roughness"] - 0.6).argmin())
    f0 = np.array([0.9, 0.5, 0.1])
    scene = PLAIN.replace("[1, 1, 1]", "[0.9, 0.5, 0.1]") % (1, float(wanted["roughness"][row]))
    (tmp_path / "s.yaml").write_text(scene)
    place = ((np.arange(48) + 0.5) / 48 - 0.5) * 2.2
    n_v = np.sqrt(np.clip(1 - place[:, None] ** 2 - place**2, 0, 1))
    inside = n_v > 0.3
    a, b = (np.interp(n_v, wanted["nov"], wanted[f"{name}_exact"][row])[..., None] for name in "AB")
    for word, factor in (("false", 1.0), ("true", 1 + f0 * (1 / (a + b) - 1))):
        pipeline = rg.load(
            "forward",
            scene=tmp_path / "s.yaml",
            environment=references / "env_white.exr",
            sets=[f"light.multiple_scattering={word}"],
            size=(48, 48),
        )
        picture = session.render(pipeline, outputs=["radiance"])["radiance"][..., :3]
        np.testing.assert_allclose(picture[inside], ((f0 * a + b) * factor)[inside], rtol=0.015)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("smith", ["exact", "fast"])
def test_the_whole_against_the_unsplit_integral(
    asked: Asked, references: Path, session: rg.Session, smith: str
) -> None:
    """Both factors together: the error of the split itself is what is left, and is the same for ours and an exact one."""
    table, mean = oracles(references, "synthetic")
    n, v, roughness, f0 = (table[f"spec_{key}"] for key in ("n", "v", "roughness", "f0"))
    n_v = (n * v).sum(axis=1)
    mirrored = 2 * n_v[:, None] * n - v
    light = asked("synthetic", mirrored, roughness)
    frame = session.render(
        rg.load("ibl", size=(8, 8), sets=[f"light.smith={smith}"]), outputs=["radiance"], taps=["light.brdf_table"]
    )
    brdf = np.asarray(frame["light.brdf_table"], np.float64)[::-1, :, :2]
    a, b = brdf[(roughness * 64).astype(int).clip(0, 63), (np.sqrt(n_v) * 64).astype(int).clip(0, 63)].T
    off = np.abs(light * (f0 * a[:, None] + b[:, None]) - table[f"spec_{smith}"]) / mean
    assert np.median(off) < 0.03
    assert off.max() < 0.35


def test_a_quarter_turn_turns_the_picture(session: rg.Session, references: Path, tmp_path: Path) -> None:
    """The environment and the eye turned by 90°: the picture of a ball is the same; and intensity is a factor."""
    text = PLAIN % (0.5, 0.3)
    pictures = []
    for turn, eye, factor in ((0, "[0, 0, 4]", 1), (90, "[4, 0, 0]", 1), (90, "[4, 0, 0]", 3)):
        around = f"environment: {{file: {references / 'env_sunsky.exr'}, rotate_degrees: {turn}, intensity: {factor}}}"
        (tmp_path / "s.yaml").write_text(text.replace("[0, 0, 4]", eye) + around + "\n")
        pipeline = rg.load("forward", scene=tmp_path / "s.yaml", asset_roots=[references], size=(48, 48))
        pictures.append(np.asarray(session.render(pipeline, outputs=["radiance"])["radiance"], np.float64)[..., :3])
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=5e-3, atol=1e-3)
    np.testing.assert_allclose(pictures[2], 3 * pictures[1], rtol=2e-3)


def test_it_is_made_once(session: rg.Session) -> None:
    """The second frame runs none of it."""
    pipeline = rg.load("ibl", size=(8, 8))
    *_, second = session.frames(pipeline, frames=range(1, 3), outputs=["radiance"], timed=True)
    assert "environment" not in {step.node for step in second.times[-1].steps}
    frame = session.render(pipeline, outputs=["radiance"], timed=True)
    assert [entry["node"] for entry in frame.passes] == ["light"]
