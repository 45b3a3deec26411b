"""Whatever is in a file: a scene, or an InputError; soon, and in little memory."""

from __future__ import annotations

import contextlib
import copy
import json
import resource
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rendergraph.errors import InputError, Problem
from rendergraph.scene import animate, pack
from rendergraph.scene.load import load
from rendergraph.scene.reading import Reading, inside

CALM = settings(
    max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)


def survives(path: Path) -> None:
    """Load, complete and pack; nothing but InputError may come out, and not late."""
    start = time.process_time()
    problems: tuple[Problem, ...] | None = None
    try:
        scene = animate.complete(load(path))
        animate.at(scene, 0.5)
        pack.pack(scene)
    except InputError as error:
        problems = error.problems
    assert problems != ()
    assert all("\n" not in problem.message for problem in problems or ())
    assert time.process_time() - start < 20  # an attack takes minutes; a slow machine does not


WORDS = st.sampled_from(
    [
        "v",
        "vn",
        "vt",
        "f",
        "o",
        "g",
        "s",
        "usemtl",
        "mtllib",
        "l",
        "p",
        "#",
        "\\",
        "/",
        "//",
        "1",
        "2",
        "-1",
        "0",
        "3/1",
        "1//1",
        "1/1/1",
        "nan",
        "1e999",
        "1e38",
        "-1e38",
        "off",
        "x",
        "é",
        "\0",
        "\r",
        "\n",
        "\n",
        "\n",
        " ",
        "\t",
        "..",
        "a.mtl",
    ]
)


@pytest.mark.slow
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("part", range(3))
@CALM
@given(words=st.lists(WORDS, max_size=60))
def test_any_obj_text(tmp_path: Path, part: int, words: list[str]) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n" + " ".join(words))
    survives(path)


@pytest.mark.slow
@CALM
@given(data=st.binary(max_size=200))
@pytest.mark.parametrize("part", range(3))
@pytest.mark.parametrize("name", ["a.obj", "a.gltf", "a.glb", "a.yaml"])
@pytest.mark.nightly(keep=4)
def test_any_bytes(tmp_path: Path, part: int, name: str, data: bytes) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    survives(path)


@CALM
@given(
    data=st.binary(max_size=120),
    head=st.sampled_from(
        [b"", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"BM", b"#?RADIANCE", b"\x76\x2f\x31\x01\x02\0\0\0"]
    ),
)
def test_any_image_header(tmp_path: Path, capfd: pytest.CaptureFixture[str], data: bytes, head: bytes) -> None:
    with contextlib.suppress(InputError):
        Reading(tmp_path / "a.glb", inside(tmp_path)).embedded_image(head + data, "image")
    assert capfd.readouterr().err == ""


BASE: dict[str, Any] = {
    "asset": {"version": "2.0"},
    "buffers": [{"byteLength": 48, "uri": "a.bin"}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3},
        {"bufferView": 1, "componentType": 5125, "type": "SCALAR", "count": 3},
    ],
    "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1]}, "emissiveFactor": [0, 0, 0]}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0, "mode": 4}]}],
    "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
    "nodes": [{"mesh": 0, "children": [1], "scale": [1, 1, 1]}, {"camera": 0, "rotation": [0, 0, 0, 1]}],
    "scenes": [{"nodes": [0]}],
    "scene": 0,
    "extensionsUsed": ["KHR_lights_punctual"],
    "extensions": {"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {"innerConeAngle": 0.1}}]}},
}
VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 9),
    st.sampled_from([2**31, 2**63, 10**18, -(10**18), 5120, 5121, 5123]),
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from(["", "a.bin", "..", "VEC4", "MAT4", "\ud800", "x"]),
    st.just([]),
    st.just({}),
    st.just([0, 0, 0]),
    st.just([[0]]),
    st.just({"count": 1}),
)


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every place of a JSON value."""
    found = [path] if path else []
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, child in entries:
        found += places(child, (*path, key))
    return found


@pytest.mark.slow
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("part", range(3))
@CALM
@given(data=st.data())
def test_any_change_to_a_gltf(tmp_path: Path, part: int, data: st.DataObject) -> None:
    top = json.loads(json.dumps(BASE))
    for _ in range(data.draw(st.integers(1, 3))):
        path = data.draw(st.sampled_from(places(top)))
        holder = top
        for key in path[:-1]:
            holder = holder[key]
        if data.draw(st.booleans()) and isinstance(holder, dict):
            del holder[path[-1]]
        else:
            holder[path[-1]] = copy.deepcopy(data.draw(VALUES))
        if not places(top):
            break
    triangle = np.array([0, 0, 0, 1, 0, 0, 0, 1, 0], np.float32).tobytes()
    (tmp_path / "a.bin").write_bytes(triangle + np.array([0, 1, 2], np.uint32).tobytes())
    (tmp_path / "a.gltf").write_text(json.dumps(top))
    survives(tmp_path / "a.gltf")


SCENE_LINES = st.sampled_from(
    [
        "objects: {a: {shape: box}}",
        "objects: {a: {shape: sphere, radius: 1e12}}",
        "objects: {a: {shape: torus, at: [1e12, 0, 0]}}",
        "objects: {a: {shape: box, scale: 0}}",
        "objects: {a: {shape: box, scale: [1e12, -1e12, 1e-12]}}",
        "objects: {a: {file: b}}",
        "lights: {l: {type: spot, outer_degrees: 90}}",
        "lights: {l: {type: point, range: 1e-12}}",
        "cameras: {c: {}}",
        "cameras: {c: {eye: [1e-12, 0, 0], near: 1e-12}}",
        "cameras: {c: {fov_y_degrees: 0.01, far: .inf}}",
        "orbit: {}",
        "keyframes: {cameras.c.eye: {0: [0, 0, 1]}}",
        "keyframes: {objects.a.at: {-5: [0, 0, 1], 1e9: [1, 1, 1]}}",
        "materials: {m: {roughness: 0, ior: 1}}",
        "environment: {file: a.yaml}",
        "objects: 5",
        "x: &a [*a]",
        "lights: !!x {}",
    ]
)


@pytest.mark.slow
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("part", range(3))
@CALM
@given(lines=st.lists(SCENE_LINES, max_size=5, unique=True))
def test_any_scene_file(tmp_path: Path, part: int, lines: list[str]) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("\n".join(["scene: 1", *lines]))
    survives(path)


@pytest.mark.parametrize("depth", [10, 100, 1000, 100_000])
def test_json_of_any_depth(tmp_path: Path, depth: int) -> None:
    (tmp_path / "a.gltf").write_text('{"asset": ' + '{"a": ' * depth + "1" + "}" * (depth + 1))
    survives(tmp_path / "a.gltf")


@pytest.mark.slow
def test_a_long_chain_of_nodes_is_no_recursion(tmp_path: Path) -> None:
    top = {
        **BASE,
        "nodes": [{"children": [k + 1]} for k in range(20_000)] + [{"mesh": 0}],
        "cameras": [],
        "buffers": [],
        "bufferViews": [],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"componentType": 5126, "type": "VEC3", "count": 3}],
    }
    (tmp_path / "a.gltf").write_text(json.dumps(top))
    assert len(load(tmp_path / "a.gltf").objects) == 1


def directory(path: Path) -> None:
    path.mkdir()


def pipe(path: Path) -> None:
    import os

    os.mkfifo(path)


def loop(path: Path) -> None:
    path.symlink_to(path)


def device(path: Path) -> None:
    path.symlink_to("/dev/zero")


@pytest.mark.parametrize("make", [directory, pipe, loop, device])
@pytest.mark.parametrize("name", ["a.obj", "a.gltf", "a.yaml"])
def test_what_is_no_regular_file_is_not_opened(tmp_path: Path, make: Callable[[Path], None], name: str) -> None:
    make(tmp_path / name)
    with pytest.raises(InputError, match="RG30"):
        load(tmp_path / name)


@pytest.mark.parametrize("make", [directory, pipe, loop, device])
def test_nor_is_what_a_file_names(tmp_path: Path, make: Callable[[Path], None]) -> None:
    make(tmp_path / "a.bin")
    (tmp_path / "a.gltf").write_text(json.dumps(BASE))
    with pytest.raises(InputError, match="RG30"):
        load(tmp_path / "a.gltf")


@pytest.mark.parametrize(
    "name", ["../x", "a/../../x", "/etc/hostname", "https://a/b", "file:///etc/hostname", "a\0b", "~/x", "x" * 5000]
)
def test_no_name_leads_out(tmp_path: Path, name: str) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "x").write_text("secret")
    reading = Reading(inner / "a.gltf", inside(inner))
    with pytest.raises(InputError, match=r"RG30[12]"):
        reading.read(reading.resolve(name), "buffer")


def chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def big_png(width: int, height: int) -> bytes:
    head = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b"")


def compressed_bmp(width: int, height: int) -> bytes:
    """A BMP of runs, which OpenImageIO decodes while it opens it."""
    head = struct.pack("<IiiHHIIiiII", 40, width, height, 1, 8, 1, 0, 0, 0, 0, 0)
    return struct.pack("<2sIHHI", b"BM", 1080, 0, 0, 1078) + head + bytes(1024) + b"\0\1"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "RG352 image 'a.png' is broken: the file is empty"),
        (b"hello", "RG351 image 'a.png' has an unknown format; PNG, JPEG"),
        (b"GIF89a" + bytes(20), "RG351"),
        (big_png(4, 4)[:20], "RG352 .*is broken: Read error"),
        (big_png(20_000, 4), "RG353 .*20000×4 pixels, the limit is 16,384; --limit scene-image-side=N allows more"),
        (big_png(0, 4), "RG352 .*is broken"),
        (big_png(16_000, 16_000), "RG353 .*1,024,000,000 bytes"),
        (compressed_bmp(16_000, 16_000), "RG353 .*1,024,000,000 bytes"),
        (b"\xff\xd8\xff\xd9\0\0", "RG352 .*is broken: it has no JPEG frame header"),
        (b"#?RADIANCE\n\n-Y 5 -Y 5\n", "RG352 .*is broken"),
        (b"\x76\x2f\x31\x01\x02\0\0\0\0", "RG352 .*EXR"),
    ],
)
def test_images_are_checked_before_they_are_decoded(
    tmp_path: Path, data: bytes, message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.png").write_bytes(data)
    (tmp_path / "a.gltf").write_text(json.dumps({"asset": {"version": "2.0"}, "images": [{"uri": "a.png"}]}))
    with pytest.raises(InputError, match=message) as error:
        load(tmp_path / "a.gltf")
    assert "\n" not in error.value.problems[0].text
    assert capfd.readouterr().err == "", "libpng writes to stderr by itself"


def test_a_scene_with_images_needs_openimageio(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "OpenImageIO", None)
    (tmp_path / "a.png").write_bytes(big_png(4, 4))
    for images in ([], [{"uri": "a.png"}]):
        (tmp_path / "a.gltf").write_text(json.dumps({"asset": {"version": "2.0"}, "images": images}))
        with pytest.raises(InputError, match=r"RG350 .*OpenImageIO is not available") if images else nullcontext():
            load(tmp_path / "a.gltf")


def test_headers_of_real_images(shared: Path) -> None:
    assets = shared / "assets"
    reading = Reading(assets / "a.gltf", inside(assets))
    found = {
        path.suffix: reading.image(path, "image")
        for folder in ("hdri", "sponza/textures")
        for path in sorted((assets / folder).iterdir())
        if path.is_file()
    }
    assert {".hdr", ".exr", ".png", ".jpg"} <= set(found)
    assert (found[".exr"].size, found[".exr"].channels) == ((512, 256), 3)
    assert found[".hdr"].size == (1024, 512)
    assert all(image.size for image in found.values())


BALLOONS = {
    "accessor": {**BASE, "accessors": [{"componentType": 5126, "type": "MAT4", "count": 10**9}]},
    "accessors": {**BASE, "accessors": [{"componentType": 5126, "type": "MAT4", "count": 10**6}] * 50},
    "primitives": {
        **BASE,
        "accessors": [{"componentType": 5126, "type": "VEC3", "count": 999_999} for _ in range(20)],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": a, "NORMAL": b}} for a in range(20) for b in range(20)]}
        ],
    },
    "instances": {
        **BASE,
        "accessors": [*BASE["accessors"], {"componentType": 5126, "type": "VEC3", "count": 20 * 10**6}],
        "nodes": [{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}}}],
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("case", BALLOONS)
@pytest.mark.nightly(keep=2)
def test_a_small_file_does_not_balloon(tmp_path: Path, case: str) -> None:
    (tmp_path / "a.bin").write_bytes(bytes(48))
    (tmp_path / "a.gltf").write_text(json.dumps(BALLOONS[case]))
    script = (
        "import sys\nfrom pathlib import Path\nfrom rendergraph.errors import InputError\n"
        "from rendergraph.scene.load import load\n"
        "try:\n    load(Path(sys.argv[1]))\nexcept InputError as error:\n    print(error)\n    sys.exit(3)\n"
    )

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_DATA, (700 << 20, 700 << 20))

    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "a.gltf")],
        capture_output=True,
        text=True,
        preexec_fn=limited,
        timeout=30,
    )
    assert done.returncode == 3, done.stderr
    assert "RG307" in done.stdout
