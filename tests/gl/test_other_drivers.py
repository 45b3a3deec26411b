"""Other drivers: OpenGL by way of Vulkan, a CPU that rounds differently, and memory full of zeros draw the same."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.gl import programs
from rendergraph.gl.device import Device
from rendergraph.resources import shipped_pipelines
from rendergraph.textures import TextureDesc
from tests.scenes import without_images

SIZE = (96, 54)
ROOT = Path(__file__).parents[2]
MOST_TEXELS = 9_000_000  # larger shadow maps take longer to compare than to draw
ICD = Path("/usr/share/vulkan/icd.d/lvp_icd.x86_64.json")
DRIVERS = {
    "zink": {"GALLIUM_DRIVER": "zink", "LIBGL_ALWAYS_SOFTWARE": "1"},
    "sse4.1": {"GALLIUM_OVERRIDE_CPU_CAPS": "sse4.1"},  # no fused multiply-add, vectors of half the width
    "zeros": {"glsl_zero_init": "true"},  # variables without a value are 0
    "bare": {"MESA_EXTENSION_OVERRIDE": "-GL_EXT_depth_bounds_test -GL_EXT_memory_object -GL_EXT_memory_object_fd"},
}
IDENTICAL = {"zeros", "bare"}
TIGHT, VISIBLE = 1e-4, 1.01 / 255
TOLERANCES = {
    "depth": (1e-6, 0.0),
    "shadow_map": (TIGHT, 0.0),
    "shading-pbr shadow_map": (TIGHT, 1e-4),  # a texel on an outline, without AVX
    "velocity": (1e-5, 0.0),
    "visibility": (VISIBLE, 0.005),  # a point on a shadow's edge may be on either side
    "occlusion": (VISIBLE, 0.005),
    "radiance": (0.02, 0.01),  # relative to the larger value; lit by the visibility above
    "display_color": (VISIBLE, 0.01),  # thresholds of antialiasing come after it
    "luminance": (2e-3, 0.0),
    "exposure_gain": (2e-3, 0.0),
    "shadow-volumes-zpass visibility": (VISIBLE, 0.0),  # sides of volumes have no offset there that could decide
}
"""How far the values of a port may differ on another device, by its semantic, and in what share of the texels by more."""
RELATIVE = {"radiance", "luminance", "exposure_gain"}


def semantics(pipeline: rg.Pipeline) -> dict[str, str]:
    """Return the semantic of every texture that a node reads or that is an output, by `node.port`."""
    graph = pipeline.link().graph
    ends = [end for node in graph.members.values() for many in node.inputs.values() for end in many]
    found = {}
    for end in (*ends, *graph.outputs.values()):
        info = graph.textures.get(end.now)
        desc = info.desc if info is not None else None
        if (
            isinstance(desc, TextureDesc)
            and "cube" not in desc.kind
            and 0 < desc.layers * desc.width * desc.height < MOST_TEXELS
        ):
            found[str(end.now)] = info.semantic.name if info is not None and info.semantic else "any"
    return found


def load(name: str, driver: str) -> rg.Pipeline:
    """A pipeline with its scene, without images where drivers filter them differently."""
    pipeline = rg.load(name, size=SIZE)
    return pipeline if driver in IDENTICAL else without_images(pipeline)


def draw(name: str, driver: str, session: rg.Session) -> dict[str, npt.NDArray[Any]]:
    """Return the second frame's values of every port, by `node.port`."""
    pipeline = load(name, driver)
    ports = tuple(semantics(pipeline))
    frame = list(session.frames(pipeline, outputs=(), taps=ports, frames=range(1, 3)))[-1]
    return {port: frame.arrays[port] for port in ports}


def cases() -> Iterator[object]:
    """All pipelines on all drivers at night, and one on the most different one otherwise."""
    for driver in DRIVERS:
        for name in sorted(shipped_pipelines()):
            fast = (driver, name) == ("zink", "forward")
            yield pytest.param(driver, name, marks=() if fast else pytest.mark.nightly)


@pytest.mark.slow
@pytest.mark.parametrize(("driver", "name"), list(cases()))
def test_ports_hold_the_same_values(gl: rg.Session, driver: str, name: str, tmp_path: Path) -> None:
    if driver == "zink" and not ICD.exists():
        pytest.skip("Mesa's Vulkan drivers are not installed")
    if not gl.device.renderer.startswith("llvmpipe"):
        pytest.skip("compares drivers with llvmpipe")
    (tmp_path / "run").mkdir(mode=0o700)
    cache = Path(os.environ.get("MESA_SHADER_CACHE_DIR", tmp_path)) / driver
    cache.mkdir(exist_ok=True)
    chosen = {**DRIVERS[driver], "XDG_RUNTIME_DIR": str(tmp_path / "run"), "MESA_SHADER_CACHE_DIR": str(cache)}
    words = [sys.executable, "-m", "tests.gl.test_other_drivers", name, driver, str(tmp_path / "other.npz")]
    done = subprocess.run(
        words, cwd=ROOT, env=os.environ | chosen, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    other = np.load(tmp_path / "other.npz")
    assert str(other["renderer"]).startswith("zink" if driver == "zink" else "llvmpipe")
    kinds = semantics(load(name, driver))
    wrong = []
    for port, ours in draw(name, driver, gl).items():
        theirs = other[port]
        if driver in IDENTICAL:
            wrong += [] if np.array_equal(ours, theirs, equal_nan=True) else [port]
            continue
        unit = 255.0 if ours.dtype == np.uint8 else 1.0
        a, b = ours.astype(np.float64) / unit, theirs.astype(np.float64) / unit
        assert np.array_equal(np.isfinite(a), np.isfinite(b)), port
        scale = np.maximum(np.maximum(abs(a), abs(b)), 0.01) if kinds[port] in RELATIVE else 1.0
        usual = TOLERANCES.get(kinds[port], (VISIBLE, 0.0))
        bound, share = TOLERANCES.get(f"{name} {kinds[port]}", usual)
        beyond = (np.nan_to_num(abs(a - b) / scale) > bound).any(axis=-1).mean()
        wrong += [f"{port} ({kinds[port]}): {beyond:.2%} differ by more than {bound:.2g}"] if beyond > share else []
    assert not wrong


def test_blocks_in_storage_hold_the_same_values(gl: rg.Session, monkeypatch: pytest.MonkeyPatch) -> None:
    """A device that may have few uniform blocks a stage, as zink over an old lavapipe is."""
    stored: set[str] = set()
    link = programs.link

    def noted(device: Device, texts: Any, outputs: Any, blocks: Any) -> programs.Program:
        stored.update(blocks)
        return link(device, texts, outputs, blocks)

    monkeypatch.setattr(programs, "link", noted)
    pipeline = rg.load("forward", scene="spheres", size=(32, 18))
    with rg.Session() as session:
        monkeypatch.setattr(session.device, "stores_blocks", True)
        frame = session.render(pipeline)
    assert {"light_block", "material_block"} <= stored
    np.testing.assert_array_equal(frame["radiance"], gl.render(pipeline)["radiance"])


if __name__ == "__main__":  # on the driver that the environment chooses: the pipeline, the name of the driver, the file
    with rg.Session() as session:
        np.savez(sys.argv[3], renderer=session.device.renderer, **draw(sys.argv[1], sys.argv[2], session))  # type: ignore[arg-type]
