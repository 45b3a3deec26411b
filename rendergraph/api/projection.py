"""Projections, frusta and fitted views; a module of its own, because it imports NumPy."""

from __future__ import annotations

from rendergraph.projection import *  # noqa: F403 - all of it
