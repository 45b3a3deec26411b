"""The shipped shapes, stored beside the shipped scenes because they are content, like environments."""

from __future__ import annotations

from rendergraph.pipelines.shapes import LENGTH as LENGTH
from rendergraph.pipelines.shapes import SHAPES as SHAPES
from rendergraph.pipelines.shapes import ShapePart as ShapePart
from rendergraph.pipelines.shapes import build as build
from rendergraph.pipelines.shapes import mesh as mesh
