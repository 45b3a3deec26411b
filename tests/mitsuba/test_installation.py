"""What is said where Mitsuba or its LLVM is missing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from rendergraph.pipelines.references import reference_selection
from rendergraph.pipelines.references.mitsuba import installation

from rendergraph.compare import compare
from rendergraph.errors import UsageError
from rendergraph.session.selection import Selection

LISTED = """1000 libs found in cache `/etc/ld.so.cache'
\tlibLLVM.so.19.1 (libc6,x86-64) => /lib/x86_64-linux-gnu/libLLVM.so.19.1
\tlibLLVM-17.so.1 (libc6,x86-64) => /lib/x86_64-linux-gnu/libLLVM-17.so.1
\tlibLLVM-15.so (libc6,x86-64) => /lib/x86_64-linux-gnu/libLLVM-15.so
"""


@pytest.mark.parametrize(("lines", "found"), [(slice(4), "19"), (slice(2, 4), "17"), (slice(3, 4), ""), (slice(0), "")])
def test_the_newest_usable_llvm_is_taken(monkeypatch: pytest.MonkeyPatch, lines: slice, found: str) -> None:
    text = "\n".join(LISTED.splitlines()[lines])
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: SimpleNamespace(stdout=text))
    version, path = installation.find_llvm()
    assert version == found
    assert bool(path) == bool(found)


def test_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "version", lambda _: None)
    monkeypatch.setattr(installation, "find_llvm", lambda: ("", ""))
    assert installation.examine()["install"] == ["pip install 'rendergraph[mitsuba]'", "apt install libllvm19"]
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(UsageError, match=r"needs mitsuba; pip install 'rendergraph\[mitsuba\]'"):
        compare("forward", reference="mitsuba")
    monkeypatch.setattr("importlib.util.find_spec", lambda _: object())
    with pytest.raises(UsageError, match="apt install libllvm19"):
        compare("forward", reference="mitsuba:max_bounces=2")


def test_settings_of_its_node_need_no_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "require", lambda: None)
    found = reference_selection(Selection("mitsuba:max_bounces=2,light.samples=8", sets=("ao.samples=4",)))
    assert found.sets == ("light.max_bounces=2", "light.samples=8")
    assert Path(str(found.source)).name == "mitsuba.yaml"
