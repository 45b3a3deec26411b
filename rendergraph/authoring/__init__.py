"""Tools for plugin authors: start a node from a template, and check a node in a separate process."""

from __future__ import annotations

from rendergraph.authoring.check_process import CheckLimits, check_node
from rendergraph.authoring.harness import Report
from rendergraph.authoring.scaffold import KINDS, NewNode, copy_shipped, new_node, new_project

__all__ = ["KINDS", "CheckLimits", "NewNode", "Report", "check_node", "copy_shipped", "new_node", "new_project"]
