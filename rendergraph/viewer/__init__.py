"""`rendergraph view`: a pipeline live in a browser.

    page ⇄ server (`server`, `view_state`) ⇄ render process (`render_process`, `render_service`)

Edits live in the server, so they outlive a render process that a shader hangs or a driver kills. The render process
owns the GL context and answers one request after the other. The server sends the next request when the last is
answered, so the newest state wins and nothing queues up.
"""

from __future__ import annotations

from rendergraph.viewer.notebook import EXTRA, Viewer, view

__all__ = ["EXTRA", "Viewer", "view"]
