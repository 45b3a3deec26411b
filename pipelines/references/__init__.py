"""Renderers of others, which `--reference NAME` measures against: each a folder with a plugin and its pipeline."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

if TYPE_CHECKING:
    from rendergraph.session import Selection

NAMES = ("mitsuba",)
"""For each, `installation` checks with `require()` what the renderer needs, and reports it with `examine()`."""


def _installation(name: str) -> Any:
    return import_module(f"{__name__}.{name}.installation")


def reference_selection(selection: Selection) -> Selection:
    """Return the selection of a reference, whose name may be followed by settings of its own, as of `-s`.

    They follow a colon, with commas between them: `path-traced:light.max_bounces=2,light.seed=1`. Those of a renderer,
    whose name no file has, may omit its node `light`: `mitsuba:max_bounces=2`. Other settings and patches do not apply.

    Raises:
        UsageError: the renderer, or what it needs, is not installed.
    """
    name, _, settings = selection.label.partition(":")
    sets = tuple(re.split(r",(?![^\[]*\])", settings)) if "=" in settings else ()
    if name not in NAMES:
        return replace(selection, source=name if sets else selection.source, sets=sets, patches=())
    _installation(name).require()
    sets = tuple(text if "." in text.partition("=")[0] else f"light.{text}" for text in sets)
    folder = Path(__file__).parent / name / "plugin"
    plugins = (*selection.plugins, folder)
    return replace(selection, source=str(folder / f"{name}.yaml"), sets=sets, patches=(), plugins=plugins)


def examine() -> dict[str, dict[str, Any]]:
    """Return by name what is installed of what each renderer needs, and as `install` how to install the rest."""
    return {name: _installation(name).examine() for name in NAMES}


def summary(found: dict[str, Any]) -> list[str]:
    """Return a line for each renderer, from a dictionary with what `examine` returned."""
    return [_installation(name).summary(found[name]) for name in NAMES]
