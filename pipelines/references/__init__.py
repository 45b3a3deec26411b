"""Renderers of others, which `--reference NAME` measures against: each a folder with a plugin and its pipeline."""

from __future__ import annotations

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


def renderer_or_other(selection: Selection) -> Selection:
    """Return the selection of a renderer's pipeline for its name, which no file has; others as they are.

    Parameters of its node `light` may follow: `mitsuba:max_bounces=2,diffuse_lobe=fresnel`.

    Raises:
        UsageError: the renderer, or what it needs, is not installed.
    """
    name, colon, values = selection.label.partition(":")
    if name not in NAMES:
        return selection
    _installation(name).require()
    sets = tuple(f"light.{value}" for value in values.split(",")) if colon else ()
    folder = Path(__file__).parent / name / "plugin"
    plugins = (*selection.plugins, folder)
    return replace(selection, source=str(folder / f"{name}.yaml"), sets=sets, patches=(), plugins=plugins)


def examine() -> dict[str, dict[str, Any]]:
    """Return by name what is installed of what each renderer needs, and as `install` how to install the rest."""
    return {name: _installation(name).examine() for name in NAMES}


def summary(found: dict[str, Any]) -> list[str]:
    """Return a line for each renderer, from a dictionary with what `examine` returned."""
    return [_installation(name).summary(found[name]) for name in NAMES]
