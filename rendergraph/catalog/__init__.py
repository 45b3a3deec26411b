"""Finding node types: the standard nodes and a stranger's plugin arrive by the same entry point.

Folders are listed, modules are not imported: a type's name is the stem of its module, and a run imports only the nodes
it uses.
"""

from __future__ import annotations

from rendergraph.catalog.catalog import GROUP, Catalog
from rendergraph.catalog.types import SHADERS, Listed, NodeType

__all__ = ["GROUP", "SHADERS", "Catalog", "Listed", "NodeType"]
