"""`repeat:` of scene files: where copies are, what varies, files of copies, motion, limits and mistakes."""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import random
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rendergraph.cli import main
from rendergraph.errors import InputError
from rendergraph.keys import file_schema
from rendergraph.scene import animate, pack
from rendergraph.scene.geometry import euler_matrix
from rendergraph.scene.load import load
from rendergraph.scene.model import Scene, SceneLimits
from rendergraph.scene.repeat import _random, read_columns
from rendergraph.scene.scene_keys import SCENE


def read(tmp_path: Path, text: str, **options: Any) -> Scene:
    path = tmp_path / "a.yaml"
    path.write_text(f"scene: 1\n{text}\n")
    return load(path, **options)


def lamps(tmp_path: Path, repeat: str, more: str = "") -> Scene:
    return read(tmp_path, f"lights: {{lamp: {{type: point, repeat: {{{repeat}}}{more}}}}}")


def boxes(tmp_path: Path, repeat: str, more: str = "") -> list[Any]:
    scene = read(tmp_path, f"objects: {{box: {{shape: box, repeat: {{{repeat}}}{more}}}}}")
    return [entry.transform for entry in scene.objects]


def positions(scene: Scene) -> list[Any]:
    return [*np.round([light.position for light in scene.lights], 9).tolist()]


def test_a_grid_starts_at_the_entry_and_counts_along_x_then_y_then_z(tmp_path: Path) -> None:
    scene = lamps(tmp_path, "grid: [2, 3, 2], step: [1, 10, 100]", ", at: [5, 0, 0]")
    expected = [[5 + x, 10 * y, 100 * z] for z, y, x in itertools.product(range(2), range(3), range(2))]
    assert positions(scene) == expected
    assert [light.name for light in scene.lights][:2] == ["lamp.0", "lamp.1"]


def test_a_centered_grid_has_its_middle_at_the_entry(tmp_path: Path) -> None:
    scene = lamps(tmp_path, "grid: [3, 1, 2], step: [2, 1, 1], centered: true", ", at: [0, 1, 0]")
    assert np.mean(positions(scene), axis=0).tolist() == [0, 1, 0]
    assert positions(scene)[0] == [-2, 1, -0.5]


def test_a_line_starts_at_the_entry(tmp_path: Path) -> None:
    assert positions(lamps(tmp_path, "line: 3, step: [0, 0, -6]")) == [[0, 0, 0], [0, 0, -6], [0, 0, -12]]


def test_a_ring_runs_counter_clockwise_seen_from_above(tmp_path: Path) -> None:
    assert positions(lamps(tmp_path, "ring: 4, radius: 2")) == [[2, 0, 0], [0, 0, -2], [-2, 0, 0], [0, 0, 2]]
    arc = positions(lamps(tmp_path, "ring: 3, start_degrees: 90, arc_degrees: -90"))
    assert arc[0] == [0, 0, -1]
    assert arc[2] == [1, 0, 0]


def test_copies_of_a_turned_ring_point_outwards(tmp_path: Path) -> None:
    for matrix in boxes(tmp_path, "ring: 7, radius: 3, turned: true", ", at: [1, 2, 3], scale: [2, 1, 1]"):
        outward = matrix[:3, 3] - (1, 2, 3)
        np.testing.assert_allclose(matrix[:3, 0], 2 * outward / 3, atol=1e-12)


def test_light_turns_with_a_ring(tmp_path: Path) -> None:
    text = "lights: {l: {type: spot, direction: [1, -1, 0], repeat: {ring: 4, radius: 2, turned: true}}}"
    for light in read(tmp_path, text).lights:
        outward = np.array(light.position) / 2
        np.testing.assert_allclose(light.direction, (outward - (0, 1, 0)) / math.sqrt(2), atol=1e-12)


def test_scattered_copies_fill_their_box_evenly(tmp_path: Path) -> None:
    found = np.array(positions(lamps(tmp_path, "scatter: 4000, size: [10, 0, 4]", ", at: [1, 2, 3]"))) - (1, 2, 3)
    low, high = found.min(axis=0), found.max(axis=0)
    np.testing.assert_allclose(low, (-5, 0, -2), atol=0.02)
    np.testing.assert_allclose(high, (5, 0, 2), atol=0.02)
    np.testing.assert_allclose(found.var(axis=0), (100 / 12, 0, 16 / 12), rtol=0.05)


def test_random_changes_stay_within_their_limits_and_follow_the_seed(tmp_path: Path) -> None:
    varied = "line: 2000, step: [0, 0, 0], vary: {at: [1, 0, 2], color: 0.5, intensity: 0.25}"
    more = ", intensity: 8, color: [1, 0.5, 0]"
    first, again, other = (lamps(tmp_path, text, more) for text in (varied, varied, varied + ", seed: 1"))
    assert first.lights == again.lights
    assert first.lights[0].position != other.lights[0].position
    moved = np.array(positions(first))
    np.testing.assert_allclose(np.abs(moved).max(axis=0), (1, 0, 2), atol=0.01)
    factors = np.array([light.color[:2] for light in first.lights]) / (1, 0.5)
    np.testing.assert_allclose((factors.min(), factors.max(), factors.mean()), (0.5, 1.5, 1), atol=0.02)
    assert {light.color[2] for light in first.lights} == {0}
    intensities = np.array([light.intensity for light in first.lights])
    np.testing.assert_allclose((intensities.min(), intensities.max()), (6, 10), atol=0.02)


def test_one_more_change_leaves_the_others_as_they_are(tmp_path: Path) -> None:
    one = lamps(tmp_path, "line: 9, vary: {at: 1}")
    two = lamps(tmp_path, "line: 9, vary: {at: 1, intensity: 0.5}")
    assert positions(one) == positions(two)


def test_random_numbers_are_the_same_everywhere() -> None:
    np.testing.assert_array_equal(_random(0, "at", (3,)), [0.6369616873214543, 0.2697867137638703, 0.04097352393619469])


def test_copies_without_chance_draw_no_random_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their generator takes as long to import as half of the scene takes to read."""
    monkeypatch.setattr("rendergraph.scene.repeat._random", None)
    assert len(positions(lamps(tmp_path, "line: 3"))) == 3
    lamps(tmp_path, "line: 3, choose: {color: [[1, 0, 0], [0, 1, 0]], order: turn}")


def test_objects_vary_in_turn_and_size(tmp_path: Path) -> None:
    more = ", scale: [1, 2, 3], rotate_degrees: [0, 30, 0]"
    found = np.array(boxes(tmp_path, "line: 500, vary: {rotate_degrees: [0, 180, 0], scale: 0.5}", more))
    size = np.linalg.norm(found[:, :3, 1], axis=1) / 2
    np.testing.assert_allclose((size.min(), size.max()), (0.5, 1.5), atol=0.01)
    np.testing.assert_allclose(np.linalg.norm(found[:, :3, 2], axis=1), 3 * size)
    np.testing.assert_allclose(found[:, :3, 1], size[:, None] * np.array([[0, 2, 0]]), atol=1e-12)
    assert np.ptp(np.arctan2(found[:, 0, 0], found[:, 2, 0])) > 6


def test_a_turn_about_all_axes_is_that_of_rotate_degrees(tmp_path: Path) -> None:
    (tmp_path / "t.json").write_text(json.dumps({"rotate_degrees": [[10, 20, 30], [-40, 50, 170]]}))
    for matrix, angles in zip(boxes(tmp_path, "file: t.json"), ([10, 20, 30], [-40, 50, 170]), strict=True):
        np.testing.assert_allclose(matrix[:3, :3], euler_matrix(angles), atol=1e-15)


def test_copies_choose_materials_and_colours(tmp_path: Path) -> None:
    text = """
objects: {b: {shape: box, repeat: {line: 5, choose: {material: [red, blue], order: turn}}}}
materials: {red: {}, blue: {}}
lights: {l: {type: point, repeat: {line: 300, choose: {color: [[1, 0, 0], 0.5], intensity: [1, 2, 3]}}}}"""
    scene = read(tmp_path, text)
    names = [scene.materials[entry.material].name for entry in scene.objects]
    assert names == ["red", "blue", "red", "blue", "red"]
    colors = [light.color for light in scene.lights]
    assert {*colors} == {(1, 0, 0), (0.5, 0.5, 0.5)}
    assert 120 < colors.count((1, 0, 0)) < 180
    assert {light.intensity for light in scene.lights} == {1, 2, 3}


def test_copies_share_meshes_and_materials(tmp_path: Path) -> None:
    scene = read(tmp_path, "objects: {g: {shape: sphere_grid, columns: 2, rows: 1, repeat: {line: 3}}}")
    assert [entry.name for entry in scene.objects][:3] == ["g.0/0_0", "g.0/1_0", "g.1/0_0"]
    assert len(scene.meshes) == 1
    assert [entry.material for entry in scene.objects] == 3 * [1, 2]
    assert scene.objects[2].node == "g.1"


CSV = "x,y,z,r,g,b,intensity,range\n1,2,3,1,0.5,0,7,9\n4,5,6,0,0,1,8,10\n"


def as_npz(path: Path) -> None:
    columns = {"at": [[1, 2, 3], [4, 5, 6]], "color": [[1, 0.5, 0], [0, 0, 1]], "intensity": [7, 8], "range": [9, 10]}
    arrays: dict[str, Any] = {key: np.array(values) for key, values in columns.items()}
    np.savez(path, **arrays)


@pytest.mark.parametrize("ending", ["csv", "npz", "json"])
def test_a_file_gives_what_differs(tmp_path: Path, ending: str) -> None:
    file = tmp_path / f"lamps.{ending}"
    if ending == "csv":
        file.write_text(CSV)
    else:
        as_npz(tmp_path / "lamps.npz")
    if ending == "json":
        with np.load(tmp_path / "lamps.npz") as arrays:
            file.write_text(json.dumps({key: arrays[key].tolist() for key in arrays}))
    first, second = lamps(tmp_path, f"file: {file.name}", ", at: [0, 10, 0]").lights
    assert (first.name, first.position, first.color) == ("lamp.0", (1, 12, 3), (1, 0.5, 0))
    assert (second.intensity, second.range) == (8, 10)


def test_keyframes_move_all_copies(tmp_path: Path) -> None:
    text = """
objects: {b: {shape: box, repeat: {grid: [2, 1, 1], step: [3, 0, 0]}}, c: {shape: box}}
lights: {l: {type: point, repeat: {line: 2, vary: {intensity: 0.5}}}, m: {type: point}}
keyframes:
  objects.b.at: {0: [0, 0, 0], 1: [0, 4, 0]}
  lights.l.intensity: {0: 1, 1: 2}"""
    scene = read(tmp_path, text)
    later = animate.at(scene, 1.0)
    assert [entry.transform[:3, 3].tolist() for entry in later.objects] == [[0, 4, 0], [3, 4, 0], [0, 0, 0]]
    assert [light.name for light in later.lights] == ["l.0", "l.1", "m"]
    before, now = ([light.intensity for light in one.lights] for one in (scene, later))
    np.testing.assert_allclose(now, [2 * before[0], 2 * before[1], before[2]])


def test_files_with_lights_and_cameras_are_copied_whole(tmp_path: Path, shared: Path) -> None:
    source = shared / "reference/b2_shadows/spot_basic/scene.glb"
    (tmp_path / "s.glb").write_bytes(source.read_bytes())
    scene = read(tmp_path, "objects: {room: {file: s.glb, repeat: {line: 2, step: [0, 10, 0]}}}")
    assert [light.name for light in scene.lights] == ["room.0/spot", "room.1/spot"]
    assert [*scene.cameras] == ["room.0/camera", "room.1/camera"]
    assert np.allclose(np.subtract(scene.lights[1].position, scene.lights[0].position), (0, 10, 0))
    moved = animate.at(read(tmp_path, (tmp_path / "a.yaml").read_text().partition("\n")[2] + MOVED), 1.0)
    assert np.allclose(np.subtract(moved.lights[1].position, scene.lights[1].position), (1, 0, 0))


MOVED = "keyframes: {objects.room.at: {0: [0, 0, 0], 1: [1, 0, 0]}}"


def test_ten_thousand_lights_load_at_once(tmp_path: Path) -> None:
    start = time.perf_counter()
    scene = lamps(tmp_path, "grid: [100, 1, 100], centered: true, vary: {at: 0.3, color: 0.4}")
    table = pack.pack_lights(scene.lights)
    assert time.perf_counter() - start < 2  # a tenth of a second on an idle machine
    assert len(table) == 10_000
    assert len({light.position for light in scene.lights}) == 10_000


WRONG = {
    "lights: {l: {type: point, repeat: 5}}": "2:35: RG321 'repeat': expected a mapping, got 5",
    "lights: {l: {type: point, repeat: {}}}": "repeat needs either 'grid' or 'line' or 'ring' or 'scatter' or 'file'",
    "lights: {l: {type: point, repeat: {line: 2, ring: 2}}}": "2:27: RG321 repeat needs either 'grid'",
    "lights: {l: {type: point, repeat: {grd: [1, 1, 1]}}}": "2:36: RG320 repeat has no key 'grd'; did you mean 'grid'?",
    "lights: {l: {type: point, repeat: {grid: [1, 0, 1]}}}": "'grid': expected a list of 3 whole numbers from 1 to",
    "lights: {l: {type: point, repeat: {line: 2, radius: 1}}}": "2:45: RG320 repeat has no key 'radius'",
    "lights: {l: {type: point, repeat: {line: 2, vary: {scale: 1}}}}": "RG320 vary has no key 'scale'",
    "lights: {l: {type: point, repeat: {line: 2, vary: {color: 2}}}}": "'color': expected a number from 0 to 1, got 2",
    "lights: {l: {type: point, repeat: {line: 2, choose: {color: []}}}}": "'color': expected a list of colours, got []",
    "objects: {b: {shape: box, repeat: {line: 2, choose: {material: [m]}}}}": "2:65: RG322 there is no material 'm'",
    "lights: {l: {type: point, repeat: {grid: [1000, 1000, 1000]}}}": "2:35: RG307 1,000,000,000 copies, the limit is",
    "lights: {l: {type: point, repeat: {line: 2}}, l.1: {type: point}}": "'l.1' is the name of a copy of 'l'; rename",
    "lights: {l: {type: point, repeat: {file: ../a.csv}}}": "RG302",
    "lights: {l: {type: point, repeat: {file: a.csv}}}": "RG301 file of copies 'a.csv' does not exist",
    "lights: {l: {type: point, repeat: {file: a.yaml}}}": "2:42: RG321 'a.yaml' is not a table of copies; use a file",
    "lights: {l: {type: point, repeat: {line: 2}}}\nkeyframes: {lights.l.1.at: {0: 1}}": "there is no 'l.1' under lights",
}


@pytest.mark.parametrize("text", WRONG)
def test_mistakes_have_a_place(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError) as error:
        read(tmp_path, text)
    assert any(WRONG[text] in str(problem) for problem in error.value.problems)


def test_more_copies_than_the_limit(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="RG307 12 objects, the limit is 11; --limit scene-objects=N allows more"):
        read(tmp_path, "objects: {g: {shape: sphere_grid, columns: 2, rows: 2, repeat: {line: 3}}}", limits=_few())
    with pytest.raises(InputError, match="RG307 6 lights, the limit is 5; --limit scene-lights=N allows more"):
        read(
            tmp_path,
            "lights: {a: {type: point, repeat: {line: 3}}, b: {type: point, repeat: {line: 3}}}",
            limits=_few(),
        )


def _few() -> SceneLimits:
    return SceneLimits(objects=11, lights=5)


BROKEN = {
    "a,b\n1,2": "has a mistake in line 1: 'a' is not a column, or occurs twice; available: b, g, intensity",
    "x,y,x\n1,2,3": "has a mistake in line 1: 'x' is not a column, or occurs twice",
    "x,y,z\n1,2": "has a mistake in line 2: 2 values, not 3",
    "x,y,z\n1,2,up": "has a mistake in line 2: could not convert string to float: 'up'",
    "x,y,z\n\n1,2,nan": "has 'at' [1.0, 2.0, nan] in row 1; it must be finite",
    "x,y,z": "has no rows",
    "": "has no rows",
    "intensity\n-1": "has 'intensity' [-1.0] in row 1; it must be at least 0",
    "range\n0": "has 'range' [0.0] in row 1; it must be above 0",
    "x,scale\n1,2": "has a mistake in line 1: 'scale' is not a column",
    "x\n1\n2\n3\n4\n5\n6\n7": "has a mistake in line 7: too many rows",
}


@pytest.mark.parametrize("text", BROKEN)
def test_broken_tables(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError) as error:
        read(tmp_path, "lights: {l: {type: point, repeat: {file: a.csv}}}", limits=_few())
    (problem,) = error.value.problems
    assert f"2:42: RG321 'a.csv' {BROKEN[text]}" in str(problem)


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("a.json", b"[1]", "is not a mapping of keys to lists"),
        ("a.json", b"[" * 100_000, "is not a mapping of keys to lists"),
        ("a.json", b'{"at": [[1, 2, 3], [4]]}', "has 'at' that is not a list of numbers of equal length"),
        ("a.json", b'{"at": [1, 2, 3]}', "has 'at' of the shape (3,), not (n, 3)"),
        ("a.json", b'{"at": [[1, 2, 3]], "intensity": [1, 2]}', "has different numbers of rows: 1 for 'at', 2 for"),
        ("a.json", b'{"up": [1]}', "has 'up', which lights do not take"),
        ("a.npz", b"PK", "is not a file of NumPy arrays"),
        ("a.npz", None, "is not a file of NumPy arrays: Object arrays cannot be loaded"),
    ],
)
def test_broken_files_of_copies(tmp_path: Path, name: str, data: bytes | None, says: str) -> None:
    if data is None:
        np.savez(tmp_path / name, at=np.array([{}], object))
    else:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError) as error:
        read(tmp_path, f"lights: {{l: {{type: point, repeat: {{file: {name}}}}}}}")
    assert f"RG321 '{name}' {says}" in str(error.value)


def test_an_archive_that_unpacks_to_too_much(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", at=np.zeros((100_000, 3)))
    limits = SceneLimits(memory_bytes=1_000_000)
    with pytest.raises(InputError, match=r"'a\.npz' unpacks to 2,400,\d+ bytes, more than 1,000,000"):
        read(tmp_path, "lights: {l: {type: point, repeat: {file: a.npz}}}", limits=limits)


def test_mutilated_files_are_mistakes_and_nothing_worse(tmp_path: Path) -> None:
    as_npz(tmp_path / "a.npz")
    sources = {".npz": (tmp_path / "a.npz").read_bytes(), ".csv": CSV.encode(), ".json": b'{"at": [[1, 2, 3]]}'}
    choose = random.Random(3)
    for ending, source in 150 * [*sources.items()]:
        data = bytearray(source)
        for _ in range(choose.randint(1, 5)):
            at = choose.randrange(len(data) + 1)
            data[at : at + choose.choice((0, 1, 9))] = choose.randbytes(choose.choice((0, 1, 4)))
        with contextlib.suppress(ValueError):
            read_columns(bytes(data), ending, "lights", 1000, 1 << 20)


def test_explain_lists_the_first_of_many(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lamps(tmp_path, "line: 500")
    assert main(["explain", str(tmp_path / "a.yaml")]) == 0
    printed = capsys.readouterr().out
    assert "lamp.39 " in printed
    assert "lamp.40" not in printed
    assert "and 460 more" in printed


def test_the_schema_knows_each_way_to_repeat() -> None:
    fastjsonschema = pytest.importorskip("fastjsonschema")
    validate = fastjsonschema.compile(file_schema(SCENE))

    def is_valid(repeat: object) -> bool:
        try:
            validate({"scene": 1, "lights": {"l": {"type": "point", "repeat": repeat}}})
        except fastjsonschema.JsonSchemaException:
            return False
        return True

    for good in ({"grid": [2, 1, 2], "step": [1, 1, 1]}, {"ring": 4, "turned": True}, {"file": "a.csv"}, None):
        assert is_valid(good)
    for wrong in ({"grid": [2, 1]}, {"line": 2, "ring": 2}, {"line": 0}, {"line": 2, "radius": 1}, {}, 5):
        assert not is_valid(wrong)
