"""Graphs and plans for people and programs: text, DOT, Mermaid, SVG, JSON. Nothing here prints."""

from __future__ import annotations

from rendergraph.diagrams.markup import Card as Card
from rendergraph.diagrams.markup import Link as Link
from rendergraph.diagrams.markup import dot as dot
from rendergraph.diagrams.markup import graph_json as graph_json
from rendergraph.diagrams.markup import mermaid as mermaid
from rendergraph.diagrams.markup import text as text
from rendergraph.diagrams.picture import Mark as Mark
from rendergraph.diagrams.picture import Sheet as Sheet
from rendergraph.diagrams.picture import draw as draw
from rendergraph.diagrams.picture import sheet as sheet
from rendergraph.diagrams.picture import svg as svg
from rendergraph.diagrams.plan import lifetimes_svg as lifetimes_svg
from rendergraph.diagrams.plan import plan_json as plan_json
from rendergraph.diagrams.plan import plan_text as plan_text
