"""The page: nothing to fetch, nothing that a name could break, and a viewer that works in a browser."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import msgspec
import pytest

import rendergraph as rg
from rendergraph.compare.engine import compare
from rendergraph.compare.report import comparison_page
from rendergraph.compare.report.scatter import scatter_svg
from rendergraph.compare.results import Comparison, Result
from rendergraph.compare.timing import Spread, Times
from rendergraph.diagrams import svg
from rendergraph.metrics import Metrics

VOID = {"meta", "link", "img", "input", "path", "rect", "circle", "br"}


@pytest.fixture(scope="module")
def comparison(gl: rg.Session) -> Comparison:
    base = rg.load("forward", size=(96, 54)).set("sun.resolution", 64)
    return compare([base, base.set("shadows.taps", 1), rg.load("forward-prepass", size=(96, 54))], frames=2, session=gl)


class Reader(HTMLParser):
    """Collects what a page refers to, and whether its tags close each other."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.refers: list[str] = []
        self.identities: list[str] = []
        self.scripts = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.refers += [found[key] or "" for key in ("src", "href", "data", "action") if key in found]
        self.identities += [found["id"] or ""] if "id" in found else []
        self.scripts += tag == "script"
        assert not any(name.startswith("on") for name in found)
        if tag == "img":
            assert "alt" in found
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert tag in VOID or self.open.pop() == tag


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    assert reader.open == []
    return reader


def test_the_page_holds_everything_it_shows(comparison: Comparison) -> None:
    page = comparison_page(comparison, "rendergraph compare a b")
    reader = read(page)
    assert all(reference.startswith(("data:", "#")) for reference in reader.refers)
    assert set(re.findall(r"https?://[^\"'\s)]+", page)) <= {"http://www.w3.org/2000/svg"}
    assert len(reader.identities) == len(set(reader.identities))
    for reference in reader.refers:
        if reference.startswith("#"):
            assert reference[1:] in reader.identities
    assert reader.scripts == 1
    for text in ("rendergraph compare a b", "light.radiance", "taps 3 → 1", "least peak", "FLIP against forward"):
        assert text in page


def test_maps_that_were_not_kept_are_not_said_to_be_there(comparison: Comparison) -> None:
    assert "Beneath each is FLIP" in comparison_page(comparison, "c")
    results = tuple(replace(result, flip_map=None) for result in comparison.results)
    assert "Beneath each" not in comparison_page(replace(comparison, results=results), "c")


def test_structure_is_said_in_lines_and_drawn_as_wide_as_the_page(comparison: Comparison) -> None:
    page = comparison_page(comparison, "")
    section = page[page.index('id="structure"') : page.index('id="memory"')]
    assert "<pre>~ shadows.taps: 3 → 1</pre>" in section
    for tag in re.findall(r"<svg [^>]*role=[^>]*>", section):
        width = float(re.search(r' width="(\d+)"', tag)[1])  # type: ignore[index]
        assert f"max-width:100%;min-width:{0.6 * width:.0f}px;height:auto" in tag


def test_software_times_say_so_wherever_they_stand(comparison: Comparison) -> None:
    soft = comparison_page(replace(comparison, device={"renderer": "x", "software": True}), "c")
    for identity in ("summary", "times"):
        part = soft.partition(f'<section id="{identity}"')[2].partition("</section>")[0]
        assert "software rasteriser: not comparable to a GPU" in part, identity
    hard = comparison_page(replace(comparison, device={"renderer": "x", "software": False}), "c")
    assert "rasteriser" not in hard


def test_the_author_names_it_and_says_something_about_it(comparison: Comparison) -> None:
    page = comparison_page(comparison, "c", title="Soft & hard", note="First <b>.\n\nSecond.")
    assert "<h1>Soft &amp; hard</h1>" in page
    assert '<p class="note">First &lt;b&gt;.</p>\n<p class="note">Second.</p>' in page


def test_a_difference_is_one_graph(comparison: Comparison) -> None:
    page = comparison_page(comparison, "c")
    section = page[page.index('id="structure"') : page.index('id="memory"')]
    pair = next(result for result in comparison.results if result.name == "forward-prepass")
    (difference,) = re.findall(r"<summary>forward → forward-prepass.*?</details>", section, re.DOTALL)
    assert pair.graph is not None
    assert difference.count('class="name"') == len(pair.graph.nodes)


HOSTILE = "</script><script>alert(1)</script>\"'&<b>"


def test_names_are_text_everywhere(comparison: Comparison) -> None:
    assert comparison.base is not None
    results = [replace(result, name=f"{HOSTILE}{number}") for number, result in enumerate(comparison.results)]
    graph = msgspec.structs.replace(comparison.base[1], name=HOSTILE)
    hostile = replace(
        comparison,
        results=tuple(results),
        base=(HOSTILE, graph),
        scene=HOSTILE,
        camera=HOSTILE,
        notes=(HOSTILE,),
        device={HOSTILE: HOSTILE},
        reference=replace(comparison.reference, name=HOSTILE, kind="file"),
    )
    page = comparison_page(hostile, HOSTILE)
    assert "alert(1)</script>" not in page
    assert "<b>" not in page
    assert read(page).scripts == 1


def measured(name: str, label: str, ms: float, low: float, high: float, error: float) -> Result:
    spread = Spread(ms, low, high, low, high)
    times = Times(1, None, spread, spread, ())
    return Result(name, "", None, "display", Metrics(0, None, 1, error), times, settings={"label": label})


def test_a_scatter_shows_all_points_inside_and_the_front() -> None:
    import xml.etree.ElementTree as ET

    results = [measured(f"n{i}", f"{i}", 1.0 + i, 0.9 + i, 1.2 + i, 0.3 / (1 + i)) for i in range(20)]
    unknown = measured("nan", "n", 1, 1, 1, float("nan"))
    best = {result.name for result in results[::2]}
    root = ET.fromstring(scatter_svg([*results, unknown], best, "time", "error"))
    dots = list(root.iter("{http://www.w3.org/2000/svg}circle"))
    assert len(dots) == 20
    assert all(0 < float(dot.attrib["cx"]) < 760 and 0 < float(dot.attrib["cy"]) < 380 for dot in dots)
    assert sum(dot.attrib["class"] == "best" for dot in dots) == 10
    ET.fromstring(scatter_svg([], (), "time", "error"))
    ET.fromstring(scatter_svg([measured("zero", "z", 0, 0, 0, 0)], ["zero"], "time", "error"))
    great = scatter_svg([measured("n", "n", 1700.0, 1600, 1900, 0.00016)], ["n"], "time", "error")
    assert ">2000</text>" in great
    assert ">0.0002</text>" in great
    assert "e+" not in great


def test_no_line_goes_through_a_label() -> None:
    import re

    results = [
        measured(f"n{i}", f"radius {i}", 100.0 + 20 * i, 99 + 20 * i, 118 + 20 * i, 0.5 / (1 + i)) for i in range(6)
    ]
    svg = scatter_svg(results, {result.name for result in results}, "time", "error")
    labels = [
        (float(x), float(y) - 4, 6.8 * len(text))
        for x, y, text in re.findall(r'<text class="ink" x="([\d.]+)" y="([\d.]+)">([^<]+)<', svg)
    ]
    assert len(labels) == 6
    lines = re.findall(r'<path d="M([\d.]+) ([\d.]+)H([\d.]+)"', svg)
    front = re.findall(r'class="front" d="M([\d.]+) ([\d.]+)((?:H[\d.]+V[\d.]+)+)"', svg)[0]
    x, y = map(float, front[:2])
    uprights = []
    for across, down in re.findall(r"H([\d.]+)V([\d.]+)", front[2]):
        lines.append((x, y, across))
        uprights.append((float(across), y, float(down)))
        x, y = float(across), float(down)
    for left, middle, width in labels:
        for start, height, end in lines:
            assert abs(float(height) - middle) > 5 or float(end) < left or float(start) > left + width
        for across, top, bottom in uprights:
            assert not left < across < left + width or middle < top - 4 or middle > bottom + 4


# --- in a browser ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_phone_shows_reports_and_graphs_in_its_width(comparison: Comparison, browser: Any, tmp_path: Path) -> None:
    assert comparison.base is not None
    (tmp_path / "report.html").write_text(comparison_page(comparison, "rendergraph compare a b"), encoding="utf-8")
    (tmp_path / "graph.svg").write_text(svg(comparison.base[1]), encoding="utf-8")
    page = browser.new_page(viewport={"width": 390, "height": 800})
    for name in ("report.html", "graph.svg"):
        page.goto((tmp_path / name).as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") == 390, name
    page.close()


@pytest.mark.slow
def test_paper_has_every_column_and_everything_open(comparison: Comparison, browser: Any, tmp_path: Path) -> None:
    file = tmp_path / "report.html"
    file.write_text(comparison_page(comparison, "rendergraph compare a b"), encoding="utf-8")
    page = browser.new_page(viewport={"width": 703, "height": 1000})  # A4 within its margins
    page.goto(file.as_uri())
    on_screen = page.evaluate("document.documentElement.scrollHeight")
    page.emulate_media(media="print")
    assert page.evaluate("document.documentElement.scrollWidth") == 703
    assert all(
        page.evaluate("[...document.querySelectorAll('table')].map(t => t.getBoundingClientRect().right <= 703)")
    )
    assert page.evaluate(
        "[...document.querySelectorAll('details pre')].every(p => p.getBoundingClientRect().height > 0)"
    )
    assert not page.locator(".viewer").is_visible()
    assert page.evaluate("document.documentElement.scrollHeight") > on_screen
    page.close()


@pytest.mark.slow
def test_the_viewer_works_offline(comparison: Comparison, browser: Any, tmp_path: Path) -> None:
    file = tmp_path / "report.html"
    file.write_text(comparison_page(comparison, "rendergraph compare a b"), encoding="utf-8")
    context = browser.new_context(offline=True, viewport={"width": 1200, "height": 900})
    page = context.new_page()
    said: list[str] = []
    asked: list[str] = []
    page.on("console", lambda message: said.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(file.as_uri())
    over = page.locator("[data-over]")
    slider = page.get_by_role("slider", name="Where A ends and B begins")
    page.wait_for_function("document.querySelector('[data-over]').style.clipPath !== ''")
    assert "50%" in over.evaluate("image => image.style.clipPath")
    slider.focus()
    for _ in range(20):
        page.keyboard.press("ArrowRight")
    assert slider.input_value() == "60"
    assert "40%" in over.evaluate("image => image.style.clipPath")
    assert slider.get_attribute("aria-valuetext") == "60 % A"
    pile = page.locator("[data-frame]").bounding_box()
    page.mouse.click(pile["x"] + pile["width"] * 0.25, pile["y"] + pile["height"] * 0.5)
    assert float(slider.input_value()) == pytest.approx(25, abs=1)
    page.get_by_role("button", name="Difference").click()
    pixels = "c => [...c.getContext('2d').getImageData(0, 0, c.width, c.height).data].filter((v, i) => i % 4 < 3 && v)"
    canvas = page.locator("[data-canvas]")
    assert canvas.is_visible()
    assert slider.is_disabled()
    assert len(canvas.evaluate(pixels)) > 0
    page.get_by_label("Picture B").select_option("pic-0")
    assert len(canvas.evaluate(pixels)) == 0
    page.locator("body").press("b")
    assert not over.is_visible()
    page.locator("body").press("s")
    assert over.is_visible()
    assert page.locator(".drawing").first.evaluate("box => box.shadowRoot.querySelector('svg') !== null")
    width = page.evaluate("document.documentElement.scrollWidth")
    assert width <= 1200
    assert said == []
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []
    context.close()
