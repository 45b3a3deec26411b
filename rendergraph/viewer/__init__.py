"""`rendergraph view`: a pipeline live in a browser.

    page ⇄ server (`server`, `view_state`) ⇄ render process (`render_process`, `render_service`)

Edits are kept in the server, so they survive if a shader hangs the render process or the driver crashes. The render
process owns the GL context and answers one request at a time. The server sends the next request after the last
response, so the newest state wins and nothing queues up.
"""

from __future__ import annotations

from rendergraph.viewer.notebook import EXTRA, Viewer, view

__all__ = ["EXTRA", "Viewer", "view"]
