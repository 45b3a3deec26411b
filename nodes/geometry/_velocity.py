"""Screen-space motion, written by the nodes that draw geometry."""

from __future__ import annotations

from rendergraph.api import Output, Velocity

from ._samples import own_samples


def velocity_output() -> Output:
    """Return the port of a node that writes velocity; readers recognise the background by its depth."""
    doc = "Motion since the previous frame, of surfaces and camera, in widths and heights of the picture; 0 in frame 1."
    return Output(Velocity, format="rg16f", clear=0.0, samples=own_samples, doc=doc)
