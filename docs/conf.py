"""Sphinx settings: Markdown pages and the Furo theme. The reference is generated before every build."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.config import Config

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from _generate import generate  # noqa: E402  # found by the line above
from docutils import nodes  # type: ignore[import-untyped]  # noqa: E402  # it has no types

import rendergraph  # noqa: E402
from rendergraph.reference.python import public_names  # noqa: E402

project = "rendergraph"
author = "The rendergraph authors"
copyright = f"2026, {author}"
version = release = rendergraph.__version__

extensions = ["myst_parser", "sphinx-mathjax-offline"]
myst_enable_extensions = ["colon_fence", "deflist", "attrs_inline", "dollarmath"]
myst_heading_anchors = 3
exclude_patterns = [
    "_build",
    "_generate",
    "examples",
    "reference/generated/*-keys.md",
    "reference/generated/shipped-scenes.md",
    "reference/generated/limits.md",
    "reference/generated/semantics-table.md",
    "reference/generated/functions-table.md",
    "reference/generated/formats-table.md",
]
suppress_warnings = ["misc.highlighting_failure"]  # GLSL with our own directives, and wrong text on error pages

html_theme = "furo"
html_title = "rendergraph"
html_static_path = ["_static"]
html_css_files = ["rendergraph.css"]
html_show_sourcelink = False
html_copy_source = False
pygments_style = "tango"
pygments_dark_style = "github-dark"
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0b6a63", "color-brand-content": "#0b6a63"},
    "dark_css_variables": {"color-brand-primary": "#5cc9bd", "color-brand-content": "#5cc9bd"},
}


def _generate(app: Sphinx, config: Config) -> None:
    generate(HERE / "reference" / "generated", pictures=config.pictures)


# The reference is generated, so a forge has none of its pages: links there lead to what a page is generated from.
_GENERATED = (
    (r"rendergraph/errors/(RG\d+)-[\w-]+\.yaml", r"errors/\1.md"),
    (r"rendergraph/errors/", "errors/index.md"),
    (r"rendergraph/__init__\.py", "python.md"),
    (r"rendergraph/api/__init__\.py", "node-api.md"),
    (r"rendergraph/api/projection\.py", "views.md"),
    (r"rendergraph/cli/(\w+)\.py", r"cli.md#\1"),
    (r"shaders/include/", "includes.md"),
    (r"nodes/(?:\w+/)*_\w+\.py", "nodes/bases.md"),
    (r"nodes/(?:\w+/)*(\w+)\.py", r"nodes/\1.md"),
    (r"nodes/", "nodes/index.md"),
    (r"pipelines/", "pipelines.md"),
)


def _link_generated(app: Sphinx, docname: str, source: list[str]) -> None:
    """Lead links to the reference's pages, and put includes, which are comments on a forge, in their places."""
    home = "../" * docname.count("/") + "reference/generated/"

    def linked(found: re.Match[str]) -> str:
        for pattern, page in _GENERATED:
            if match := re.fullmatch(pattern, found[1]):
                return f"]({home}{match.expand(page)})"
        return found[0]

    include = "```{include} \\1\n```"
    text = re.sub(r"^<!-- \{include\} (\S+) -->$", include, source[0], flags=re.MULTILINE)
    text = re.sub(r"^\[[^\]]*\]\((\S+)\)<!-- \{include\} -->$", include, text, flags=re.MULTILINE)
    source[0] = re.sub(r"\]\((?:\.\./)+((?:rendergraph|nodes|pipelines|shaders/include)/[^)\s]*)\)", linked, text)


def _index_python(app: Sphinx, doctree: nodes.document) -> None:
    """Enter the headings of the Python reference into the inventory, so that other projects can link to them."""
    page = app.env.docname.rpartition("/")[2]
    if page not in ("python", "node-api"):
        return
    names, domain = public_names(), app.env.get_domain("py")
    for section in doctree.findall(nodes.section):
        title = section[0].astext()
        if title.partition(".")[0] in names and section["ids"]:
            own, member = names[title.partition(".")[0]], "." in title
            kind = "method" if member else "class" if isinstance(own, type) else "function"
            home = "rendergraph.api" if page == "node-api" else "rendergraph"
            domain.note_object(f"{home}.{title}", kind, section["ids"][0])  # type: ignore[attr-defined]


def setup(app: Sphinx) -> None:
    """Sphinx's hook."""
    app.add_config_value("pictures", True, "env", bool, "Draw the pictures of the reference, which takes minutes.")
    app.connect("config-inited", _generate)
    app.connect("source-read", _link_generated)
    app.connect("doctree-read", _index_python)
