"""Whether what the viewer needs is installed."""

from __future__ import annotations

from importlib.util import find_spec

from rendergraph.errors import Problem, UsageError


def need() -> None:
    """Make sure of it.

    Raises:
        UsageError: a package is missing; how to get it.
    """
    missing = [name for name in ("starlette", "uvicorn", "websockets") if find_spec(name) is None]
    if missing:
        text = f"the viewer needs {', '.join(missing)}; pip install 'rendergraph[view]'"
        raise UsageError(Problem("RG500", text))
