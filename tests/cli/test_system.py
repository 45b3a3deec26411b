"""What `doctor` advises on each system."""

from __future__ import annotations

import platform
import sys

import pytest

from rendergraph import system


@pytest.mark.parametrize(
    ("release", "advice"),
    [
        ({"ID": "debian"}, "apt install libegl1 libgl1-mesa-dri "),
        ({"ID": "linuxmint", "ID_LIKE": "ubuntu debian"}, "apt install libegl1 libgl1-mesa-dri "),
        ({"ID": "fedora"}, "dnf install libglvnd-egl mesa-dri-drivers "),
        ({"ID": "endeavouros", "ID_LIKE": "arch"}, "pacman -S libglvnd mesa "),
        ({"ID": "unheard-of"}, "apt install "),
    ],
)
def test_linux_has_its_installers(monkeypatch: pytest.MonkeyPatch, release: dict[str, str], advice: str) -> None:
    monkeypatch.setattr(platform, "freedesktop_os_release", lambda: release)
    assert system.install_advice([system.EGL, "driver"]).startswith(advice)


@pytest.mark.parametrize(("name", "advice"), [("darwin", "container"), ("win32", "Subsystem for Linux")])
def test_other_systems_have_a_page(monkeypatch: pytest.MonkeyPatch, name: str, advice: str) -> None:
    monkeypatch.setattr(sys, "platform", name)
    assert advice in system.install_advice(["driver"])
    assert "docs/guide/other-systems.md" in system.install_advice(["driver"])
