"""Find node types: the standard nodes and third-party plugins use the same entry point.

Folders are listed without importing modules: a type's name is the stem of its module, and a run imports only the nodes
that it uses.
"""

from __future__ import annotations

from rendergraph.catalog.catalog import GROUP, Catalog
from rendergraph.catalog.types import SHADERS, Listed, NodeType

__all__ = ["GROUP", "SHADERS", "Catalog", "Listed", "NodeType"]
