"""Declarative real-time rendering: one YAML file is a renderer.

import rendergraph as rg
frame = rg.load("deferred.yaml").set("ao.radius", 0.8).render(size=(640, 360))
frame["image"]
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from rendergraph.lazy import lazy_exports
from rendergraph.version import __version__ as __version__

if TYPE_CHECKING:
    from rendergraph.compare import Comparison, Result, Sweep, compare, sweep
    from rendergraph.diff import diff
    from rendergraph.errors import RendergraphError
    from rendergraph.metrics import flip
    from rendergraph.session import Frame, Pipeline, RenderOptions, Selection, Session, load, loads
    from rendergraph.session.python_values import Mesh, Object, Scene
    from rendergraph.settings import CacheLimits
    from rendergraph.viewer import view

_around = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
if os.path.isfile(os.path.join(_around, "pyproject.toml")) and os.path.isdir(os.path.join(_around, "nodes")):
    __path__.append(_around)  # a checkout uses its own nodes, shaders and pipelines, even if another copy is installed

__all__ = [
    "CacheLimits",
    "Comparison",
    "Frame",
    "Mesh",
    "Object",
    "Pipeline",
    "RenderOptions",
    "RendergraphError",
    "Result",
    "Scene",
    "Selection",
    "Session",
    "Sweep",
    "compare",
    "diff",
    "flip",
    "load",
    "loads",
    "sweep",
    "view",
]

__getattr__, __dir__ = lazy_exports(
    __name__,
    {
        "compare": ("Comparison", "Result", "Sweep", "compare", "sweep"),
        "diff": ("diff",),
        "metrics": ("flip",),
        "errors": ("RendergraphError",),
        "session": ("Frame", "Pipeline", "RenderOptions", "Selection", "Session", "load", "loads"),
        "session.python_values": ("Mesh", "Object", "Scene"),
        "settings": ("CacheLimits",),
        "version": ("__version__",),
        "viewer": ("view",),
    },
)
