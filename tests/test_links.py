"""Every link leads somewhere: in the Markdown as a forge shows it, and nightly in the pages that Sphinx builds."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from rendergraph.catalog import Catalog

ROOT = Path(__file__).parents[1]
LINK = re.compile(r"!?\[(?P<text>(?:[^\[\]]|\[[^\]]*\])*)\]\((?P<target>[^()\s]+)\)")


def in_repository() -> frozenset[str]:
    """The files that a forge has."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False).stdout.split(
        "\n"
    )
    return frozenset(filter(None, listed))


FILES = in_repository()
PAGES = sorted(path for path in FILES if path.endswith(".md"))
OVERVIEWS = ("index", "bibliography", "antialiasing", "occlusion", "which-shadow")


@cache
def prose(page: str) -> str:
    """A page without what stands in blocks of code."""
    lines, fence = [], ""
    for line in (ROOT / page).read_text(encoding="utf-8").splitlines():
        found = re.match(r" *(`{3,})", line)
        if found and (not fence or (line.strip() == fence)):
            fence = "" if fence else found[1]
            lines.append("")
        else:
            lines.append("" if fence else line)
    return "\n".join(lines)


@cache
def anchors(page: str) -> frozenset[str]:
    """The names of a page's headings, as forges and MyST make them, and explicit targets."""
    found = set(re.findall(r"^\(([\w-]+)\)=$", prose(page), re.M))
    for heading in re.findall(r"^#+ +(.*?) *$", prose(page), re.M):
        plain = re.sub(r"\]\([^)]*\)|[`*\[]", "", heading)
        found.add(re.sub(r"[^\w\- ]", "", plain.lower()).replace(" ", "-"))
    return frozenset(found)


def test_each_term_of_the_glossary_leads_to_a_page_that_uses_it() -> None:
    glossary = ROOT / "docs" / "reference" / "glossary.md"
    rows = re.findall(r"^\| ([A-Z].*?) \| .* \| \[.*\]\((.*)\) \|$", glossary.read_text(encoding="utf-8"), re.M)
    assert len(rows) >= 60
    for names, page in rows:
        text = " ".join((glossary.parent / page).read_text(encoding="utf-8").lower().split())
        assert any(name.removesuffix("s") in text for name in names.lower().split(", ")), (names, page)


def links(page: str) -> Iterator[tuple[int, str, str]]:
    """Line, text and target of each link and picture."""
    text = re.sub(r"(`+)[^`].*?\1", lambda found: "x" * len(found[0]), prose(page))
    for found in LINK.finditer(text):
        yield text.count("\n", 0, found.start()) + 1, found["text"], found["target"]


def mistakes(page: str) -> Iterator[str]:
    for line, text, target in links(page):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        where = (ROOT / page).parent / path if path else ROOT / page
        try:
            name = where.resolve().relative_to(ROOT).as_posix()
        except ValueError:
            yield f"{page}:{line}: '{target}' leads out of the repository"
            continue
        if not text:
            yield f"{page}:{line}: the link to '{target}' has no text, so a forge shows nothing"
        if name not in FILES and not any(file.startswith(f"{name}/") for file in FILES):
            yield f"{page}:{line}: there is no '{target}'"
        elif anchor and name.endswith(".md") and anchor not in anchors(name):
            yield f"{page}:{line}: '{name}' has no heading '{anchor}'"


@pytest.mark.parametrize("page", PAGES)
def test_links_of_a_page_lead_somewhere_on_a_forge(page: str) -> None:
    assert not list(mistakes(page))


@pytest.mark.parametrize("page", [page for page in PAGES if page != "docs/index.md"])
def test_a_forge_shows_what_a_page_holds(page: str) -> None:
    """Directives of Sphinx are empty blocks of code there; code that is quoted from a file is as it is there."""
    text = (ROOT / page).read_text(encoding="utf-8")
    assert set(re.findall(r"^ *(?:`{3,}|:{3,})\{(\w[\w-]*)\}", text, re.M)) <= {"toctree"}
    for file, code in re.findall(r"^<!-- (\S+) -->\n```\w+\n(.*?)^```$", text, re.M | re.S):
        assert code in ((ROOT / page).parent / file).read_text(encoding="utf-8"), file


@pytest.mark.parametrize(
    "page",
    sorted(
        {page for page in PAGES if page.startswith("docs/gallery/")} - {f"docs/gallery/{one}.md" for one in OVERVIEWS}
    ),
)
def test_a_technique_links_to_its_nodes_and_shaders(page: str) -> None:
    targets = [target for _, _, target in links(page)]
    assert any("/nodes/" in target for target in targets) or page == "docs/gallery/fxaa.md"  # a node without Python
    assert any("/shaders/" in target for target in targets)


class Targets(HTMLParser):
    """What a page links to and shows, and the names in it that links lead to."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.names: set[str] = set()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.links += [value for key in ("href", "src") if (value := found.get(key)) and tag != "base"]
        self.names |= {value for key in ("id", "name") if (value := found.get(key))}


@pytest.mark.nightly
def test_links_of_the_built_pages_lead_somewhere() -> None:
    home = ROOT / "docs" / "_build" / "html-nightly"
    if not home.is_dir():
        pytest.skip("`make nightly` builds the pages first")
    pages = {page: Targets(page) for page in home.rglob("*.html")}
    assert len(pages) > 300
    dead = []
    for page, found in pages.items():
        for link in found.links:
            url = urlsplit(link)
            if url.scheme or url.netloc:
                continue
            target = (page.parent / unquote(url.path)).resolve() if url.path else page
            known = pages.get(target)
            if not target.exists() or (url.fragment and known and unquote(url.fragment) not in known.names):
                dead.append(f"{page.relative_to(home)}: {link}")
    assert not dead


def test_the_page_of_proofs_has_every_node() -> None:
    """`make proofs` writes it; a new node is measured with the next run."""
    listed = set(
        re.findall(r"^\| \[`(\w+)`\]", (ROOT / "docs" / "proofs.md").read_text(encoding="utf-8"), re.MULTILINE)
    )
    assert set(Catalog.discover().names()) == listed
