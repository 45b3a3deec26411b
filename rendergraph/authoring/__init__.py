"""For people who write nodes: starting one from a template, and checking one in a process of its own."""

from __future__ import annotations

from rendergraph.authoring.new import KINDS, NewNode, new_node

__all__ = ["KINDS", "NewNode", "new_node"]
