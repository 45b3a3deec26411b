"""What a session keeps, and that it keeps no more than its limits say."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import rendergraph as rg

GROWTH = """
import rendergraph as rg

def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096 / 2**20

base = rg.load("ssao-hemisphere", size=(64, 36))
with rg.Session() as session:
    session.render(base.set("ao.samples", 8))
    before = resident()
    for number in range(200):
        variant = base.set("ao.samples", 8 + number % 100).set("ao.contrast", number / 1000)
        session.render(variant)
    print(resident() - before)
"""


def variants(project: Path, *steps: int) -> list[rg.Pipeline]:
    pipeline = rg.load(project / "flat.yaml", plugins=[project / "fx"])
    return [pipeline.set("flat.steps", count) for count in steps]


def test_programs_stay_within_their_number_and_the_last_ones_are_not_compiled_again(project: Path) -> None:
    with rg.Session(cache=rg.CacheLimits(programs=8)) as session:
        pictures = {}
        for count, variant in enumerate(variants(project, *range(1, 21)), start=1):
            pictures[count] = session.render(variant).arrays["image"]
            assert len(session.cache.programs._programs) <= 8
        assert session.cache.programs.compiled == 21
        lately = range(14, 21)
        for _ in range(3):
            for count, variant in zip(lately, variants(project, *lately), strict=True):
                np.testing.assert_array_equal(session.render(variant).arrays["image"], pictures[count])
        assert session.cache.programs.compiled == 21
        np.testing.assert_array_equal(session.render(variants(project, 1)[0]).arrays["image"], pictures[1])
        assert session.cache.programs.compiled == 22


def test_variants_share_their_textures(project: Path) -> None:
    with rg.Session() as session:
        first, second = variants(project, 1, 2)
        before = session.render(first).arrays["image"]
        made = session.device.textures_made
        assert not np.array_equal(session.render(second).arrays["image"], before)
        np.testing.assert_array_equal(session.render(first).arrays["image"], before)
        assert session.device.textures_made == made
        assert len(session.cache.executables) == 2


def test_only_what_is_drawn_is_kept_beyond_the_limit_of_bytes(project: Path) -> None:
    with rg.Session(cache=rg.CacheLimits(mebibytes=0)) as session:
        for variant in variants(project, 1, 2, 3):
            session.render(variant)
            assert len(session.cache.executables) == 1


def test_a_projects_settings_limit_its_sessions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "rendergraph.toml").write_text("cache = {programs = 5, mebibytes = 7}\n")
    monkeypatch.chdir(tmp_path)
    with rg.Session() as session:
        assert session.cache.limits == rg.CacheLimits(5, 7)


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform != "linux", reason="the memory of a process is read from /proc")
def test_two_hundred_variants_take_less_than_60_megabytes() -> None:
    done = subprocess.run([sys.executable, "-c", GROWTH], capture_output=True, text=True, check=True, timeout=600)
    assert float(done.stdout) < 60
