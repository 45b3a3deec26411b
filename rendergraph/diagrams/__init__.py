"""Graphs and plans for people and programs: text, DOT, Mermaid, SVG, JSON. Nothing here prints."""

from __future__ import annotations

from rendergraph.diagrams.cards import Card, Link
from rendergraph.diagrams.markup import dot, graph_json, mermaid, text
from rendergraph.diagrams.matrix import lifetimes_svg
from rendergraph.diagrams.picture import Mark, Sheet, draw, sheet, svg
from rendergraph.diagrams.plan import plan_json, plan_text

__all__ = [
    "Card",
    "Link",
    "Mark",
    "Sheet",
    "dot",
    "draw",
    "graph_json",
    "lifetimes_svg",
    "mermaid",
    "plan_json",
    "plan_text",
    "sheet",
    "svg",
    "text",
]
