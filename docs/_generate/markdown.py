"""Small pieces of Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; columns that are empty in every row are left out, and so is a table without rows."""
    cells = [[_cell(value) for value in row] for row in rows]
    if not cells:
        return ""
    used = [index for index in range(len(heads)) if any(row[index] for row in cells)]
    lines = [[heads[index] for index in used], ["---"] * len(used), *([row[index] for index in used] for row in cells)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def long_table(heads: Sequence[str], rows: Iterable[tuple[str, str]]) -> str:
    """A table of names and plain text as HTML: of some 20,000 rows in Markdown Sphinx takes a third of its time."""
    lines = [f"<tr><td><code>{escape(name)}</code></td><td>{_spans(text)}</td></tr>" for name, text in rows]
    head = "".join(f"<th>{escape(word)}</th>" for word in heads)
    body = "\n".join(["<tbody>", *lines, "</tbody>"])
    return (
        f'<div class="table-wrapper"><table class="docutils">\n<thead><tr>{head}</tr></thead>\n{body}\n</table></div>\n'
    )


def _spans(text: str) -> str:
    """Text in one line as HTML, with what stands between backticks as code."""
    parts = escape(" ".join(text.split())).split("`")
    return "".join(f"<code>{part}</code>" if index % 2 else part for index, part in enumerate(parts))


def _cell(value: object) -> str:
    return "" if value is None else " ".join(str(value).split()).replace("|", "\\|")


def code(value: object) -> str:
    """A code span; nothing for nothing."""
    return f"`{value}`" if value not in (None, "") else ""


def block(text: str, language: str = "") -> str:
    """A code block, fenced by more backticks than the text has in a row."""
    longest = max((len(run) for run in re.findall(r"`{3,}", text)), default=2)
    fence = "`" * (longest + 1)
    return f"{fence}{language}\n{text.rstrip()}\n{fence}"


def folded(title: str, body: str) -> str:
    """A part that is opened by a click."""
    return f"<details>\n<summary>{title}</summary>\n\n{body.strip()}\n\n</details>"


def prose(text: str) -> str:
    """A docstring's text as Markdown: what looks like markup outside code spans is shown as it is."""
    parts = re.split(r"(`[^`]+`)", text)
    return "".join(part if index % 2 else _plain(part) for index, part in enumerate(parts))


def _plain(text: str) -> str:
    return re.sub(r"([*\[\]{}$])", r"\\\1", text.replace("&", "&amp;").replace("<", "&lt;"))


def page(title: str, *parts: str) -> str:
    """A page of its title and its parts that are not empty."""
    return "\n\n".join([f"# {title}", *(part.strip("\n") for part in parts if part.strip())]) + "\n"


def listing(names: Iterable[str], *, hidden: bool = True, depth: int = 1) -> str:
    """A table of contents of pages."""
    options = [":hidden:"] if hidden else []
    return "\n".join(["```{toctree}", f":maxdepth: {depth}", *options, "", *names, "```"])
