"""`rendergraph view`: a pipeline live in a browser.

    page ⇄ server (`server`, `view_state`) ⇄ render process (`render_process`, `render_service`)

Edits are kept in the server, so they survive if a shader hangs the render process or the driver crashes. The render
process owns the GL context and answers one request at a time. The server sends the next request after the last
response, so the newest state wins and nothing queues up.
"""

from __future__ import annotations

import atexit
from collections.abc import Callable
from html import escape
from pathlib import Path

from rendergraph.installed import require
from rendergraph.session.pipeline import Pipeline, as_pipeline
from rendergraph.viewer.render_process import RenderProcess
from rendergraph.viewer.view_state import ViewState

EXTRA = ("the viewer", "view", "starlette", "uvicorn", "websockets")
"""Arguments of `require`."""

__all__ = ["EXTRA", "Viewer", "view"]


class Viewer:
    """A page that is served until `close`, or until Python ends.

    In a notebook it is displayed; elsewhere open `url` in a browser. Anyone who has the address can use the page. It
    has its own render process, which shares nothing with a `Session` of this process. Unsaved changes on the page are
    written to `NAME-unsaved.yaml` at the end.
    """

    def __init__(self, url: str, stop: Callable[[], None], keep: Callable[[], Path | None], height: int) -> None:
        self.url = url
        self._stop: Callable[[], None] | None = stop
        self._keep = keep
        self._height = height
        atexit.register(keep)

    def close(self) -> Path | None:
        """End the server and its render process, and return the file of unsaved changes, if any."""
        if self._stop is None:
            return None
        self._stop()
        self._stop = None
        atexit.unregister(self._keep)
        return self._keep()

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
        pipeline: a pipeline, a shipped name, a file.
        against: the pipeline to compare with.
        port: port of the page's address; by default any free one.
        device: GL device number.
        height: height of the frame in a notebook, in pixels.

    Raises:
        UsageError: the extra `view` is not installed, or the port is in use.
    """
    require(*EXTRA)
    from rendergraph.viewer.server import Server  # needs the extra

    other = None if against is None else as_pipeline(against).selection
    compared = None if other is None else (Path(other.label).stem, other)
    state = ViewState(as_pipeline(pipeline).selection, Path.cwd(), against=compared)
    server = Server(state, RenderProcess(device), port=port)
    return Viewer(server.url, server.start(), state.keep, height)
