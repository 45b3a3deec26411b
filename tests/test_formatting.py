"""Values as JSON holds them, at any depth."""

from __future__ import annotations

import json
import math

from rendergraph.formatting import jsonable


def test_what_json_has_not_is_null_at_any_depth() -> None:
    found = jsonable({"a": (1, math.inf, [math.nan, {"b": -math.inf}]), 2: "x", "c": 0.5, "d": None, "e": True})
    assert found == {"a": [1, None, [None, {"b": None}]], "2": "x", "c": 0.5, "d": None, "e": True}
    assert json.loads(json.dumps(found, allow_nan=False)) == found
