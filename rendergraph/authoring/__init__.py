"""For people who write nodes: starting one from a template, and checking one in a process of its own."""

from __future__ import annotations

from rendergraph.authoring.new import KINDS, NewNode, new_node
from rendergraph.authoring.report import Report
from rendergraph.authoring.supervise import CheckLimits, check_node

__all__ = ["KINDS", "CheckLimits", "NewNode", "Report", "check_node", "new_node"]
