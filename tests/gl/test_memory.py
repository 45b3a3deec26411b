"""How much memory a plan may take: what is asked, in which order, and what is said."""

from __future__ import annotations

import ctypes
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import rendergraph as rg
from rendergraph import system
from rendergraph.errors import RenderError, UsageError
from rendergraph.gl.device import check_memory, free_on_device

MIB = 1 << 20


def device(extensions: set[str] = frozenset(), answers: dict[int, int] | None = None, *, software: bool = False) -> Any:  # type: ignore[assignment]  # an empty set
    """What is asked of a device, with a driver that gives these answers in KiB."""

    def get(parameter: int, address: Any) -> None:
        ctypes.cast(address, ctypes.POINTER(ctypes.c_int))[0] = (answers or {})[parameter]

    return SimpleNamespace(
        software=software, ctx=SimpleNamespace(extensions=extensions), raw=SimpleNamespace(glGetIntegerv=get)
    )


def test_the_driver_says_what_is_free_where_it_can() -> None:
    nvidia, amd = {"GL_NVX_gpu_memory_info"}, {"GL_ATI_meminfo"}
    assert free_on_device(device(nvidia, {0x9049: 2048})) == 2 * MIB
    assert free_on_device(device(amd, {0x87FC: 4096})) == 4 * MIB
    assert free_on_device(device(nvidia, {0x9049: 0})) is None  # a driver that has the extension and knows nothing
    assert free_on_device(device()) is None
    assert (
        free_on_device(device(nvidia, {0x9049: 2048}, software=True)) is None
    )  # its textures are in the machine's RAM


def test_what_the_device_has_counts_before_what_the_machine_has(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RENDERGRAPH_MEMORY_LIMIT", raising=False)
    monkeypatch.setattr(system, "free_memory", lambda: 100 * MIB)
    small = device({"GL_NVX_gpu_memory_info"}, {0x9049: 8 * 1024})
    check_memory(small, 6 * MIB)
    with pytest.raises(RenderError, match=r"needs 7 MiB of textures, 6 MiB may be used, three quarters of the 8 MiB"):
        check_memory(small, 7 * MIB)
    check_memory(device(), 75 * MIB)
    with pytest.raises(RenderError, match=r"three quarters of the 100 MiB that are free; .* --limit plan-memory=MiB"):
        check_memory(device(), 76 * MIB)


def test_an_option_counts_before_the_variable_and_both_before_what_is_free(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(system, "free_memory", lambda: 1 * MIB)
    check_memory(device(), 50 * MIB, allowed=50)
    monkeypatch.setenv("RENDERGRAPH_MEMORY_LIMIT", "40")
    check_memory(device(), 40 * MIB)
    check_memory(device(), 50 * MIB, allowed=50)
    with pytest.raises(RenderError, match="41 MiB of textures, 40 MiB may be used"):
        check_memory(device(), 41 * MIB)
    monkeypatch.setenv("RENDERGRAPH_MEMORY_LIMIT", "4GB")
    with pytest.raises(UsageError, match="RENDERGRAPH_MEMORY_LIMIT is '4GB', not a number of MiB"):
        check_memory(device(), 1)


def test_a_containers_bound_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(system, "_CONTROL_GROUP", tmp_path)
    unbound = system.free_memory()
    assert unbound is not None
    (tmp_path / "memory.max").write_text("3000000\n")
    (tmp_path / "memory.current").write_text("1000000\n")
    (tmp_path / "memory.stat").write_text("anon 700000\ninactive_file 200000\n")
    assert system.free_memory() == 2_200_000
    (tmp_path / "memory.max").write_text("max\n")
    assert system.free_memory() != 2_200_000


def test_the_limit_of_a_pipeline(gl: rg.Session) -> None:
    with pytest.raises(RenderError, match="RG616"):
        gl.render(rg.load("forward", size=(32, 32), limits={"plan-memory": 1}))
    gl.render(rg.load("forward", size=(32, 32), limits={"plan-memory": 32}))
