"""A static site of pipelines: an index with their pictures, and the page of each."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from rendergraph.viewer.export import Exported

_STYLE = """:root { color-scheme: light dark; --page: #ffffff; --ink: #1f2328; --quiet: #57606a; --line: #d5dae0; }
@media (prefers-color-scheme: dark) { :root { --page: #12161b; --ink: #e6edf3; --quiet: #9aa4af; --line: #333b45; } }
body { margin: 0 auto; max-width: 1200px; padding: 16px; background: var(--page); color: var(--ink);
  font: 15px/1.5 system-ui, "DejaVu Sans", sans-serif; }
ul { list-style: none; padding: 0; display: grid; gap: 20px;
  grid-template-columns: repeat(auto-fill, minmax(min(340px, 100%), 1fr)); }
li { border: 1px solid var(--line); border-radius: 8px; overflow: hidden; }
img { display: block; width: 100%; height: auto; } a { color: inherit; text-decoration: none; }
h1 { font-size: 22px; } h2 { font-size: 17px; margin: 10px 12px 2px; } p { margin: 0 12px 10px; }
.quiet { color: var(--quiet); font-size: 13px; }
"""


def index(title: str, pages: Mapping[str, Exported], times: Mapping[str, float]) -> str:
    """Return the index of a site as HTML; each page has its files under its name, as `NAME.html` and `NAME.png`.

    `times` has the milliseconds of a frame, by the name of the page.
    """
    cards = "\n".join(_card(name, page, times[name]) for name, page in pages.items())
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{escape(title)}</title>\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<style>\n{_STYLE}</style>\n</head>\n'
        f"<body>\n<h1>{escape(title)}</h1>\n<ul>\n{cards}\n</ul>\n</body>\n</html>\n"
    )


def _card(name: str, page: Exported, frame_ms: float) -> str:
    pipeline, facts, name = page.pipeline, page.facts, escape(name)
    width, height = facts["size"]
    memory = pipeline["plan"]["memory"]["allocated_bytes"] / 2**20
    passes = len({step["node"] for step in pipeline["plan"]["order"]})
    cost = f"{passes} passes, {frame_ms:.1f} ms, {memory:.1f} MiB at {width}×{height}"
    software = " (software rasteriser)" if facts["device"]["software"] else ""
    return (
        f'<li><a href="{name}.html"><img src="{name}.png" width="{width}" height="{height}" '
        f'alt="Picture of {name}">\n<h2>{name}</h2>\n'
        f'<p>{escape(str(pipeline["description"]))}</p>\n<p class="quiet">{cost}{software}</p></a></li>'
    )
