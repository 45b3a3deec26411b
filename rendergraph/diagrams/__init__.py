"""Graphs and plans for people and programs: text, DOT, Mermaid, SVG, JSON. Nothing here prints."""

from __future__ import annotations

from rendergraph.diagrams.markup import Card, Link, dot, graph_json, mermaid, text
from rendergraph.diagrams.picture import Mark, Sheet, draw, sheet, svg
from rendergraph.diagrams.plan import lifetimes_svg, plan_json, plan_text
