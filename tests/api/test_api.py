"""What node authors import: everything by its name, and old names with a warning."""

from __future__ import annotations

import pytest

from rendergraph import projection
from rendergraph.api import projection as exported


def test_projection_is_part_of_the_node_api() -> None:
    assert exported.look_at is projection.look_at


def test_the_old_name_of_projection_warns() -> None:
    with pytest.warns(DeprecationWarning, match=r"rendergraph\.api\.viewing is now rendergraph\.api\.projection"):
        from rendergraph.api import viewing
    assert viewing.look_at is projection.look_at
