"""The second opinion: Mitsuba 3 traces the scene, for comparisons with `--reference mitsuba`.

A pipeline of one node (`plugin/`) asks a `Tracer` for light. Its process turns the scene's arrays, which `convert`
prepares, into shapes with surfaces and lights of our own (`surfaces`, `lights`), and traces them (`render`). No other
process imports Mitsuba.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from rendergraph.lazy import lazy_exports

if TYPE_CHECKING:
    from rendergraph.mitsuba.installation import examine as examine
    from rendergraph.mitsuba.process import Tracer as Tracer
    from rendergraph.session import Selection

_FOLDER = Path(__file__).parent / "plugin"

__getattr__, __dir__ = lazy_exports(__name__, {"installation": ("examine",), "process": ("Tracer",)})


def mitsuba_or_other(selection: Selection) -> Selection:
    """Return the selection of Mitsuba's pipeline for `mitsuba`, which no file has; others as they are.

    Parameters of its node may follow: `mitsuba:max_bounces=2,diffuse_lobe=fresnel`.

    Raises:
        UsageError: Mitsuba, or what it needs, is not installed.
    """
    name, colon, values = selection.source.partition(":")
    if name != "mitsuba":
        return selection
    from rendergraph.mitsuba.installation import required_llvm  # other references need none

    required_llvm()
    sets = tuple(f"light.{value}" for value in values.split(",")) if colon else ()
    plugins = (*selection.plugins, _FOLDER)
    return replace(selection, source=str(_FOLDER / "mitsuba.yaml"), sets=sets, patches=(), plugins=plugins)
