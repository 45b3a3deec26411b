"""Values as JSON holds them."""

from __future__ import annotations

import math
from typing import Any


def jsonable(value: Any) -> Any:
    """Mappings, lists and numbers as JSON has them: tuples are lists, and what is infinite or undefined is null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): jsonable(item) for key, item in value.items()}
    return [jsonable(item) for item in value] if isinstance(value, list | tuple) else value
