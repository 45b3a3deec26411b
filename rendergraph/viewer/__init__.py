"""`rendergraph view`: a pipeline alive in a browser.

    page ⇄ server (`server`, `desk`) ⇄ render process (`child`, `painter`)

What somebody has changed is a value of the server's (`edits`), so it outlives a render process that a shader hangs or a
driver kills. The render process owns the GL context and answers one question after the other; the server asks the next
one when the last is answered, so the newest state wins and nothing queues up.
"""

from __future__ import annotations

from rendergraph.viewer.notebook import EXTRA, Viewer, view

__all__ = ["EXTRA", "Viewer", "view"]
