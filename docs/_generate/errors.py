"""A page for each error code, and their list by what they are about."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rendergraph.reference import error_codes, error_page

from .markdown import block, page, prose, table

GROUPS = {
    "RG0": "Text and files",
    "RG1": "Names, links and parameters",
    "RG2": "Types at ports, sizes and formats",
    "RG3": "Scenes, meshes and images",
    "RG4": "Nodes and shaders",
    "RG5": "The command line",
    "RG6": "Order, limits, memory and devices",
}
# The index lists them. Rows of a menu that every page repeats, they were most of the time of a build.
_NOT_IN_THE_TREE = "---\norphan: true\n---\n\n"
LANGUAGES = {"pipeline": "yaml", "scene": "yaml", "node": "python", "shader": "glsl", "compute": "glsl"}


def pages() -> Iterator[tuple[str, str]]:
    """The index and every page."""
    found = [error_page(code) for code in error_codes()]
    yield "errors/index.md", _index(found)
    for entry in found:
        yield f"errors/{entry['code']}.md", _page(entry)


def _index(found: list[dict[str, Any]]) -> str:
    parts = [
        "A message names the file, the line and the column, then its code, then what is wrong and the way out. "
        "`rendergraph explain CODE` prints these pages. Exit codes are on the page of the [command line](../cli.md)."
    ]
    for start, title in GROUPS.items():
        rows = [(f"[`{e['code']}`]({e['code']}.md)", prose(e["title"])) for e in found if e["code"].startswith(start)]
        if rows:
            parts.append(f"## {title}\n\n" + table(("code", "what is wrong"), rows))
    return page("Error codes", *parts)


def _page(entry: dict[str, Any]) -> str:
    language = LANGUAGES.get(str(entry.get("kind", "pipeline")), "text")
    return _NOT_IN_THE_TREE + page(
        f"{entry['code']}: {prose(entry['title'])}",
        prose(str(entry["about"])),
        f"## Wrong\n\n{block(str(entry['wrong']), language)}" if entry.get("wrong") else "",
        f"## The message\n\n{block(str(entry['message']), 'text')}" if entry.get("message") else "",
        f"## Right\n\n{block(str(entry['right']), language)}" if entry.get("right") else "",
    )
