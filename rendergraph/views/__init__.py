"""Graphs and plans for people and programs: text, DOT, Mermaid, SVG, JSON. Nothing here prints."""

from __future__ import annotations

from rendergraph.views.cards import Card, Link
from rendergraph.views.markup import dot, graph_json, mermaid, text
from rendergraph.views.matrix import lifetimes_svg
from rendergraph.views.picture import Mark, Sheet, draw, sheet, svg
from rendergraph.views.plan import plan_json, plan_text

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
