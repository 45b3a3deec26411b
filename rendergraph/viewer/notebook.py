"""The page from Python, and in a notebook."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from pathlib import Path

from rendergraph.installed import require
from rendergraph.session.pipeline import Pipeline, loaded
from rendergraph.viewer.child import Child
from rendergraph.viewer.desk import Desk

EXTRA = ("the viewer", "view", "starlette", "uvicorn", "websockets")
"""Arguments of `require`."""


class Viewer:
    """A page that is served until `close`, or until Python ends.

    In a notebook it shows itself; elsewhere `url` is what a browser opens. It has a render process of its own, so any
    `Session` of this process stays as it is.

    Attributes:
        url: of the page; whoever has it may use the page.
    """

    def __init__(self, url: str, stop: Callable[[], None], height: int) -> None:
        self.url = url
        self._stop: Callable[[], None] | None = stop
        self._height = height

    def close(self) -> None:
        """End the server and its render process."""
        if self._stop is not None:
            self._stop()
            self._stop = None

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *problem: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Viewer at {self.url}>" if self._stop is not None else "<Viewer, closed>"

    def _repr_html_(self) -> str:
        style = "width:100%;border:1px solid #7d8590;border-radius:6px"
        return f'<iframe src="{escape(self.url)}" height="{self._height}" style="{style}"></iframe>'


def view(
    pipeline: Pipeline | str | Path,
    *,
    against: Pipeline | str | Path | None = None,
    port: int = 0,
    device: int | None = None,
    height: int = 720,
) -> Viewer:
    """Serve a pipeline to a browser on this machine.

    Args:
        pipeline: what to show: a pipeline, a shipped name, a file.
        against: what it is compared with.
        port: of the page's address; any that is free by default.
        device: GL device number.
        height: of the frame in a notebook, in pixels.

    Raises:
        UsageError: the extra `view` is not installed, or the port is taken.
    """
    require(*EXTRA)
    from rendergraph.viewer.serve import serving  # an extra: whoever only draws has not installed it

    found = loaded(pipeline)
    other = None
    if against is not None:
        compared = loaded(against)
        other = Path(compared.selection.source).stem, compared.selection
    made = serving(Desk(found.selection, Path.cwd(), against=other), Child(device), port=port)
    return Viewer(made.url, made.start(), height)
