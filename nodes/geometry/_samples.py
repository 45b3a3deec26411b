"""Sample counts of the nodes that draw geometry."""

from __future__ import annotations

from typing import Any, Literal

from rendergraph.api import Facts

Samples = Literal[1, 2, 4, 8, 16]


def own_samples(node: Any, _facts: Facts) -> int:
    """Return the node's `samples`."""
    count: int = node.samples
    return count
