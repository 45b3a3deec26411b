"""The old name of `rendergraph.api.projection`."""

from __future__ import annotations

import warnings

from rendergraph.projection import *  # noqa: F403 - all of it

warnings.warn("rendergraph.api.viewing is now rendergraph.api.projection", DeprecationWarning, stacklevel=2)
