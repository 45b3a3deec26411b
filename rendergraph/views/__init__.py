"""Graphs and plans for people and programs: text, DOT, Mermaid, SVG, JSON. Nothing here prints."""

from __future__ import annotations

from rendergraph.views.markup import dot, graph_json, mermaid, text
from rendergraph.views.matrix import lifetimes_svg
from rendergraph.views.picture import Mark, svg
from rendergraph.views.plan import plan_json, plan_text

__all__ = ["Mark", "dot", "graph_json", "lifetimes_svg", "mermaid", "plan_json", "plan_text", "svg", "text"]
