"""The page in a real browser, used as a hand does; skipped where there is no Chromium."""

from __future__ import annotations

import io
import os
import re
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.scene.scene_values import keys_of
from rendergraph.viewer.view_state import CAMERA

pytestmark = pytest.mark.slow
SIZE = (64, 36)
VIEWPORT: Any = {"width": 1300, "height": 1000}
STILL = "#picture[data-still=true]"


class Hand:
    """A page with what it said; every test fails on an error of the page's scripts."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.wrong: list[str] = []
        page.set_default_timeout(60_000)
        self.listeners = {"pageerror": self.on_error, "console": self.on_console}
        for event, listener in self.listeners.items():
            page.on(event, listener)

    def close(self) -> None:
        for event, listener in self.listeners.items():
            self.page.remove_listener(event, listener)

    def on_error(self, error: Any) -> None:
        self.wrong.append(str(error))

    def on_console(self, message: Any) -> None:
        if self.is_wrong(message):
            self.wrong.append(message.text)

    @staticmethod
    def is_wrong(said: Any) -> bool:
        return said.type == "error" and "WebSocket connection" not in said.text  # the server may be gone first

    def open(self, url: str) -> None:
        self.page.goto(url)
        self.page.wait_for_selector(STILL)
        self.page.wait_for_selector("#graph svg .card")

    def pictures(self) -> int:
        return int(self.page.get_attribute("#picture", "data-count") or 0)

    def after(self, act: Any) -> None:
        """Do something, and wait for a picture of it that stands still."""
        before = self.pictures()
        act()
        end = time.monotonic() + 60
        while time.monotonic() < end:
            if self.pictures() > before and self.page.get_attribute("#picture", "data-still") == "true":
                return
            time.sleep(0.02)
        raise AssertionError("no picture came")

    def until(self, condition: str) -> None:
        """Wait for what a script says; the page's own policy lets nobody wait in it."""
        end = time.monotonic() + 60
        while not self.page.evaluate(condition):
            assert time.monotonic() < end, condition
            time.sleep(0.02)

    def choose(self, node: str) -> None:
        self.page.select_option("#node", node)

    def text(self, selector: str) -> str:
        return str(self.page.inner_text(selector))


@pytest.fixture(scope="module")
def tab(browser: Any) -> Iterator[Any]:
    """One page of the browser for all tests."""
    context = browser.new_context(viewport=VIEWPORT, reduced_motion="reduce")
    yield context.new_page()
    context.close()


@pytest.fixture
def hand(tab: Any) -> Iterator[Hand]:
    tab.set_viewport_size(VIEWPORT)
    found = Hand(tab)
    yield found
    found.close()
    tab.goto("about:blank")
    assert found.wrong == []


@pytest.fixture
def show(hand: Hand, served: Any) -> Callable[..., Hand]:
    """`show(source)`: the page of a pipeline, as if it had just been opened."""

    def open_page(source: object = "forward", size: tuple[int, int] | None = SIZE) -> Hand:
        served.reset(rg.Selection(str(source), size=size))
        hand.open(served.url)
        return hand

    return open_page


@pytest.fixture
def page(show: Callable[..., Hand]) -> Hand:
    return show()


def test_a_slider_changes_the_picture_and_undo_takes_all_of_its_way_back(page: Hand) -> None:
    page.choose("display")
    before = mean(page)
    slider = page.page.locator("[aria-label='display.exposure, slider']")
    box = slider.bounding_box()
    page.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.page.mouse.down()
    seen = []
    for step in range(1, 4):
        move = (box["x"] + box["width"] * (0.5 + step * 0.1), box["y"] + box["height"] / 2)
        count = page.pictures()
        page.page.mouse.move(*move)
        page.until(f"Number(document.getElementById('picture').dataset.count) > {count}")  # the hand waits for it
        seen.append(float(slider.input_value()))
    assert seen == sorted(set(seen)), "it followed all the way"
    page.after(page.page.mouse.up)
    assert mean(page) > before
    page.after(lambda: page.page.click("#undo"))
    assert mean(page) == before
    assert page.page.is_disabled("#undo")


@pytest.mark.nightly
def test_another_button_on_a_slider_holds_nothing(page: Hand) -> None:
    page.choose("display")
    page.page.hover("[aria-label='display.exposure, slider']")
    page.page.mouse.down(button="right")
    page.page.hover("#name")
    page.page.mouse.up(button="right")  # which the slider is not told of
    page.choose("light")
    page.page.wait_for_selector("[id='p-light.ambient']", timeout=10_000)


@pytest.mark.nightly
def test_what_a_hand_reaches_for_stays_where_nothing_of_it_changes(page: Hand) -> None:
    """Pictures come whenever they are ready; an input made anew for each would be gone while it is clicked."""
    page.choose("display")
    field = page.page.locator("[id='p-display.exposure']")
    field.evaluate("(element) => { element.mine = true; }")
    page.after(lambda: page.page.focus("#stage") or page.page.keyboard.press("ArrowLeft"))
    page.page.wait_for_selector("#camera option:checked:has-text('moved by hand')", state="attached")
    assert field.evaluate("(element) => element.mine") is True


@pytest.mark.nightly
def test_a_slider_is_moved_by_keys_step_after_step(page: Hand) -> None:
    page.choose("display")
    slider = page.page.locator("[aria-label='display.exposure, slider']")
    slider.focus()
    step = float(slider.get_attribute("step") or 0)
    for count in (1, 2):
        page.after(lambda: page.page.keyboard.press("ArrowRight"))
        assert float(page.page.input_value("[id='p-display.exposure']")) == pytest.approx(count * step)


@pytest.mark.nightly
def test_a_row_is_marked_while_the_hand_is_in_the_next(page: Hand) -> None:
    page.choose("display")
    page.page.fill("[id='p-display.exposure']", "1")
    page.after(lambda: page.page.focus("[id='p-display.white']"))
    page.page.wait_for_selector(".parameter.set [aria-label='Revert display.exposure']")
    page.page.keyboard.type("1")
    assert page.page.evaluate("document.activeElement.id") == "p-display.white"


@pytest.mark.nightly
def test_what_was_chosen_stands_until_its_picture_comes_and_undo_is_seen_where_it_was_written(page: Hand) -> None:
    page.choose("display")
    # Everything that the list shows from the choice to its picture.
    page.page.evaluate(
        """() => { const seen = window.seen = new Set();
        new MutationObserver(() => seen.add(document.getElementById('p-display.curve').value))
          .observe(document.getElementById('parameters'), {childList: true}); }"""
    )
    page.after(lambda: page.page.select_option("[id='p-display.curve']", "aces"))
    assert page.page.evaluate("[...window.seen]") == ["aces"]
    field = page.page.locator("[id='p-display.exposure']")
    page.after(lambda: field.fill("2") or page.page.keyboard.press("Enter"))
    page.page.wait_for_selector("[aria-label='Revert display.exposure']")
    page.after(lambda: page.page.keyboard.press("Control+z"))
    page.page.wait_for_selector("[aria-label='Revert display.exposure']", state="detached")
    page.until("document.getElementById('p-display.exposure').value === '0'")
    page.after(lambda: page.page.keyboard.type("3") or page.page.keyboard.press("Enter"))  # the field is still at hand
    assert field.input_value() == "3"


@pytest.mark.nightly
def test_the_way_of_a_colour_is_one_step_and_its_numbers_follow(page: Hand) -> None:
    page.choose("light")
    wheel = page.page.locator("[id='p-light.ambient']")
    parts = [page.page.locator(f"[id='p-light.ambient-{name}']") for name in "RGB"]
    wheel.focus()
    for color in ("#ff0000", "#00ff00", "#0000ff"):  # as a colour's window tells of a hand in it
        wheel.evaluate(f"(e) => {{ e.value = '{color}'; e.dispatchEvent(new Event('input', {{bubbles: true}})); }}")
    assert [part.input_value() for part in parts] == ["0", "0", "1"]
    page.after(lambda: wheel.evaluate("(e) => e.dispatchEvent(new Event('change', {bubbles: true}))"))
    assert wheel.input_value() == "#0000ff"
    page.after(lambda: page.page.click("#undo"))
    assert page.page.is_disabled("#undo")
    assert [part.input_value() for part in parts] == ["0.03", "0.03", "0.03"]


def mean(hand: Hand) -> float:
    """The mean of the red channel, as the page says it."""
    found = re.search(r"R: .*mean ([\d.]+)", hand.text("#texture"))
    assert found
    return float(found[1])


@pytest.mark.nightly
def test_a_port_has_the_values_that_python_reads(page: Hand, gl: rg.Session) -> None:
    page.after(lambda: page.page.click("[aria-label='Show light.radiance']"))
    expected = gl.render(rg.load("forward", size=SIZE), outputs=(), taps=("light.radiance",))["light.radiance"]
    assert f"mean {expected[..., 0].mean():.4g}"[:9] in page.text("#texture")
    box = page.page.locator("#picture").bounding_box()
    page.page.mouse.move(box["x"] + box["width"] * (40.5 / 64), box["y"] + box["height"] * (30.5 / 36))
    page.page.wait_for_selector("#pixel:has-text('(40, 30)')")
    values = [float(word) for word in page.text("#pixel").split(")")[1].split()]
    assert values == pytest.approx(expected[30, 40].tolist(), rel=1e-4)
    page.page.select_option("#port", "sun.shadow_map")  # another picture, other values there
    page.until("!document.getElementById('pixel').textContent.startsWith('(40, 30)')")


def test_a_type_is_swapped_saved_as_a_file_and_that_is_the_same_picture(
    page: Hand, served: Any, gl: rg.Session
) -> None:
    page.choose("shadows")
    page.after(lambda: page.page.select_option("[id='p-shadows.type']", "shadow_vsm"))
    page.page.evaluate("Object.defineProperty(navigator, 'clipboard', {value: undefined})")  # as over HTTP
    page.page.click("#copy")
    assert page.text("#changes pre") == "-s shadows.type=shadow_vsm"
    page.page.click("#save")
    page.page.fill("#file", "soft.yaml")
    page.page.click("dialog button[value=save]")
    page.page.wait_for_selector("#link:has-text('saved soft.yaml')")
    (served.folder / "there.yaml").write_text("extends: forward\n")
    page.page.click("#save")
    page.page.fill("#file", "there.yaml")
    page.page.wait_for_selector("#draft:has-text('exists')")
    assert page.page.is_disabled("#saving-now"), "what is refused cannot be confirmed"
    page.page.keyboard.press("Escape")
    page.page.click("#save")
    page.page.fill("#file", "other.yaml")
    page.page.keyboard.press("Escape")
    saved = gl.render(rg.load(served.folder / "soft.yaml"), outputs=("image",))["image"]
    direct = gl.render(rg.load("forward", size=SIZE, sets=["shadows.type=shadow_vsm"]), outputs=("image",))["image"]
    assert (saved == direct).all()
    assert mean(page) == pytest.approx(direct[..., 0].mean(), rel=1e-3)
    page.after(lambda: page.page.click("#undo"))
    assert page.page.is_hidden("#problems"), "what was refused is past"
    assert not (served.folder / "other.yaml").exists()


@pytest.mark.nightly
def test_an_input_that_takes_many_takes_another_and_lets_go_of_one(show: Callable[..., Hand], tmp_path: Path) -> None:
    (tmp_path / "two.yaml").write_text(
        "extends: forward\nsize: [32, 24]\nnodes:\n  other: {type: shadow_pcf, inputs: {shadow_map: sun.shadow_map}}\n"
    )
    hand = show(tmp_path / "two.yaml", None)
    hand.choose("light")
    hand.after(lambda: hand.page.select_option("[id='p-light.lookup-1']", "other.lookup"))
    hand.page.wait_for_selector("[id='p-light.lookup-2']")
    hand.after(lambda: hand.page.select_option("[id='p-light.lookup']", ""))
    assert hand.page.input_value("[id='p-light.lookup']") == "other.lookup"


@pytest.mark.nightly
def test_a_broken_shader_is_said_on_its_node_and_mended(
    hand: Hand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shader = tmp_path / "grey.frag"
    right = (
        "/*---\ndoc: Grey.\noutputs:\n  color: {semantic: display_color, format: rgba8, doc: Grey.}\n---*/\n"
        "out vec4 color;\nvoid main() { color = vec4(0.5); }\n"
    )
    shader.write_text(right)
    (tmp_path / "mine.yaml").write_text("size: [16, 16]\nnodes: {g: {type: ./grey.frag}}\noutputs: {image: g.color}\n")
    shader.write_text(right.replace("void main", "void main("))
    with rg.view("mine.yaml") as viewer:
        hand.page.goto(viewer.url)
        hand.page.wait_for_selector("#problems:has-text('RG410')")
        assert "last good picture" not in hand.text("#problems"), "there is none yet"
        shader.write_text(right)
        hand.page.wait_for_selector(STILL)
        hand.page.wait_for_selector("#problems", state="hidden")
        shader.write_text(right.replace("0.5", "0.5 +"))
        hand.page.wait_for_selector("#problems:has-text('RG410')")
        hand.page.wait_for_selector("#graph .card.wrong[aria-label^='g:']")
        assert "grey.frag:7" in hand.text("#problems")
        assert "last good picture" in hand.text("#problems")
        hand.after(lambda: shader.write_text(right.replace("0.5", "0.25")))
        hand.page.wait_for_selector("#problems", state="hidden")
        assert mean(hand) == 64


def test_names_are_text(show: Callable[..., Hand], tmp_path: Path) -> None:
    """A file's words are shown, and never become elements of the page."""
    name = "<img src=x onerror=document.title=1>"
    (tmp_path / "mine.yaml").write_text(f'extends: forward\nsize: [16, 16]\ndescription: "{name}"\n')
    hand = show(tmp_path / "mine.yaml", None)
    assert hand.text("#about") == name
    assert hand.page.query_selector("img[src=x]") is None
    assert hand.page.title().startswith("mine")
    hand.page.wait_for_selector("#p-scene option[value=courtyard]", state="attached")
    hand.page.wait_for_selector("#p-environment option[value=dawn]", state="attached")


def test_the_keyboard_alone_is_enough(page: Hand) -> None:
    page.page.focus("#stage")
    page.after(lambda: page.page.keyboard.press("ArrowLeft"))
    page.page.wait_for_selector("#camera option:checked:has-text('moved by hand')", state="attached")
    page.page.focus("#graph [aria-label='Choose light']")
    page.page.keyboard.press("Enter")
    assert page.page.input_value("#node") == "light"
    page.page.focus("#tab-graph")
    page.page.keyboard.press("ArrowRight")
    assert page.page.is_visible("#memory table")
    page.page.focus("[id='p-light.terms']")
    page.after(lambda: page.page.keyboard.press("ArrowDown"))
    page.after(lambda: page.page.keyboard.press("Control+z"))


@pytest.mark.nightly
def test_a_window_that_becomes_small_holds_the_page(page: Hand) -> None:
    page.page.set_viewport_size({"width": 420, "height": 700})
    page.until("document.documentElement.scrollWidth <= 420")


@pytest.mark.nightly
def test_two_tabs_are_one_view(page: Hand) -> None:
    other = Hand(page.page.context.new_page())
    other.open(page.page.url)
    other.choose("display")
    page.choose("display")
    page.after(lambda: other.page.fill("[id='p-display.exposure']", "1") or other.page.keyboard.press("Enter"))
    assert page.page.input_value("[id='p-display.exposure']") == "1"
    assert page.page.locator("#exposure").is_hidden()  # it acts on light alone
    page.after(lambda: other.page.select_option("#port", "radiance"))
    other.page.locator("#exposure").fill("2")
    page.page.wait_for_selector("#exposure-value:has-text('2 EV')")
    assert page.page.input_value("#exposure") == "2"
    page.after(lambda: other.page.select_option("#port", ""))
    page.page.click("#tab-changes")
    field = page.page.locator("[id='p-display.exposure']")
    field.fill("9")
    page.after(lambda: other.page.fill("[id='p-display.exposure']", "2") or other.page.keyboard.press("Enter"))
    page.page.wait_for_selector("#changes td:text-is('2')")
    assert field.input_value() == "9", "somebody writes there"
    field.fill("1")  # what stood there before
    left = "document.activeElement.blur(), document.getElementById('p-display.exposure').value"
    assert page.page.evaluate(left) == "2"
    other.page.close()
    page.after(lambda: page.page.click("#undo"))
    assert other.wrong == []


def test_it_is_compared_under_a_slider(page: Hand) -> None:
    page.page.select_option("#other", "shading-phong")
    page.page.wait_for_selector("#slider:visible")
    page.page.wait_for_selector("#figures:has-text('FLIP')")
    page.page.locator("#slider input").fill("250")
    assert "25%" in page.page.locator("#slider .over").evaluate("(image) => image.style.clipPath")
    page.page.select_option("#map", "flip")
    page.page.wait_for_selector("#slider .tag.b:has-text('FLIP')")
    page.page.select_option("#other", "")
    page.page.wait_for_selector("#picture:visible")


@pytest.mark.nightly
def test_it_comes_back_after_a_lost_render_process(page: Hand, served: Any) -> None:
    os.kill(served.process.pid, signal.SIGKILL)
    page.page.wait_for_selector("#problems:has-text('RG630')")
    page.choose("display")
    page.after(lambda: page.page.fill("[id='p-display.exposure']", "1") or page.page.keyboard.press("Enter"))
    page.page.wait_for_selector("#problems", state="hidden")


def test_an_exported_page_is_whole_and_offline(hand: Hand, tmp_path: Path, gl: rg.Session) -> None:
    from rendergraph.viewer.export import export
    from rendergraph.viewer.view_state import ViewState

    file = tmp_path / "page.html"
    file.write_text(export(ViewState(rg.Selection("deferred", size=SIZE), tmp_path), gl).html, encoding="utf-8")
    asked: list[str] = []
    hand.page.on("request", lambda request: asked.append(request.url))
    hand.page.context.set_offline(True)
    hand.page.goto(file.as_uri())
    hand.page.wait_for_selector("#graph svg .card image")
    assert hand.page.evaluate("document.getElementById('picture').naturalWidth") == SIZE[0]
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
    hand.choose("light")
    assert hand.page.is_disabled("[id='p-light.terms']")
    hand.page.click("#tab-memory")
    assert "without reuse" in hand.text("#memory")
    hand.page.context.set_offline(False)


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.nightly
def test_text_can_be_read_in_both_schemes(tab: Any, served: Any, scheme: str) -> None:
    tab.emulate_media(color_scheme=scheme)
    tab.goto(served.url)
    tab.wait_for_selector(STILL)
    ink, ground = (
        [int(part) for part in re.findall(r"\d+", tab.locator("body").evaluate(f"(e) => getComputedStyle(e).{name}"))]
        for name in ("color", "backgroundColor")
    )
    assert abs(sum(ink[:3]) - sum(ground[:3])) > 450


@pytest.mark.nightly
def test_what_fits_an_input_is_offered_and_what_waits_for_the_node_is_not(show: Callable[..., Hand]) -> None:
    hand = show("deferred")
    hand.choose("shadows")
    offered = hand.page.locator("[id='p-shadows.depth'] option").all_inner_texts()
    assert offered[:2] == ["nothing", "gbuffer.depth"]
    assert not [end for end in offered if end.startswith(("light.", "shadows.", "display."))]
    hand.choose("light")
    assert "gbuffer.albedo" not in hand.page.locator("[id='p-light.normal'] option").all_inner_texts()


@pytest.mark.parametrize("count", [20, pytest.param(300, marks=pytest.mark.nightly)])
def test_many_nodes_are_drawn(show: Callable[..., Hand], tmp_path: Path, count: int) -> None:
    text = io.StringIO()
    text.write(
        "size: [8, 8]\nnodes:\n  light: {type: forward_lighting}\n  n0: {type: tonemap, inputs: {radiance: light.radiance}}\n"
    )
    for number in range(1, count):
        text.write(f"  n{number}: {{type: gaussian_blur, inputs: {{source: n{number - 1}.")
        text.write("color}}\n" if number == 1 else "blurred}}\n")
    text.write(f"outputs: {{image: n{count - 1}.blurred}}\nscene: cornell_box\n")
    (tmp_path / "many.yaml").write_text(text.getvalue())
    hand = show(tmp_path / "many.yaml", None)
    assert hand.page.locator("#graph .card").count() == count + 1
    hand.after(lambda: hand.page.focus("#stage") or hand.page.keyboard.press("ArrowLeft"))


def drag(hand: Hand, start: str, end: tuple[float, float] | str) -> None:
    """Drag the end of a link from a pin to the middle of an element, or to a point of the page."""
    hand.page.click("#zoom-fit")
    box = hand.page.locator(start).bounding_box()
    if isinstance(end, str):
        to = hand.page.locator(end).bounding_box()
        end = to["x"] + to["width"] / 2, to["y"] + to["height"] / 2
    hand.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    hand.page.mouse.down()
    hand.page.mouse.move(*end, steps=3)
    hand.page.mouse.up()


def pick(hand: Hand, words: str) -> None:
    """Choose the first of what the open list offers for these words."""
    hand.page.wait_for_selector("#palette .choice")
    hand.page.fill("#palette-search", words)
    hand.after(lambda: hand.page.keyboard.press("Enter"))


def choose_link(hand: Hand, words: str) -> None:
    x, y = hand.page.evaluate(
        """(words) => { const line = document.querySelector(`[data-link="${words}"]`);
        const point = line.getPointAtLength(line.getTotalLength() / 2).matrixTransform(line.getScreenCTM());
        return [point.x, point.y]; }""",
        words,
    )
    hand.page.mouse.click(x, y)


def test_the_graph_is_changed_by_hand_saved_in_place_and_undone_to_the_beginning(
    show: Callable[..., Hand], tmp_path: Path, gl: rg.Session
) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("rendergraph: 1\n# Mine.\nextends: forward\nsize: [64, 36]  # small\n")
    hand = show(file, None)
    before = mean(hand)
    choose_link(hand, "light.radiance → display.radiance")
    hand.page.click("#insert")
    pick(hand, "bloom")
    hand.page.wait_for_selector(".card.chosen[data-node=bloom]")
    assert hand.page.input_value("#node") == "bloom"
    hand.page.click("#duplicate")
    hand.page.wait_for_selector(".card.idle[data-node=bloom_2]")
    drag(hand, "[data-end='bloom_2.radiance'].output", "[data-node=display] .head")
    hand.page.wait_for_selector("[data-link='bloom_2.radiance → display.radiance']", state="attached")
    drag(hand, "[data-end='display.color'].output", (1200, 950))
    pick(hand, "fxaa")
    hand.page.wait_for_selector(".card.idle[data-node=fxaa]")
    hand.page.click("#rename")
    hand.page.fill("#new-name", "smooth")
    hand.page.keyboard.press("Enter")
    hand.page.wait_for_selector(".card.chosen[data-node=smooth]")
    hand.choose("bloom")
    hand.after(lambda: hand.page.click("#delete"))
    hand.page.wait_for_selector("[data-node=bloom]", state="detached")
    hand.page.click("#save")
    hand.page.wait_for_selector("#draft:has-text('+  bloom_2:')")
    assert hand.page.input_value("#file") == "mine.yaml"
    hand.page.click("dialog button[value=save]")
    hand.page.wait_for_selector("#link:has-text('saved mine.yaml')")
    text = file.read_text()
    assert text.startswith("rendergraph: 1\n# Mine.\nextends: forward\nsize: [64, 36]  # small\nnodes:\n")
    assert "smooth: {type: fxaa, inputs: {source: display.color}}" in text
    shown = gl.render(rg.load(file), outputs=("image",))["image"]
    assert mean(hand) == pytest.approx(shown[..., 0].mean(), rel=1e-3)
    while hand.page.is_enabled("#undo"):
        hand.page.click("#undo")
        hand.page.wait_for_timeout(50)
    hand.page.wait_for_selector("[data-node=bloom_2]", state="detached")
    hand.until(f"document.querySelectorAll('#canvas .card').length === {len(rg.load('forward').link().graph.nodes)}")
    assert mean(hand) == before


@pytest.mark.nightly
def test_what_does_not_fit_stands_back_and_a_mistake_is_said_at_its_node(show: Callable[..., Hand]) -> None:
    hand = show()
    hand.page.click("#zoom-fit")
    box = hand.page.locator("[data-end='light.radiance'].output").bounding_box()
    hand.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    hand.page.mouse.down()
    hand.page.mouse.move(box["x"] + 20, box["y"] + 20)
    apart = "[...document.querySelectorAll('.card.apart')].map((card) => card.dataset.node)"
    found = set(hand.page.evaluate(apart))
    assert not {"display", "light"} & found, "what fits, and where the link begins"
    assert {"sun", "shadows"} <= found
    card = hand.page.locator(".card[data-node=sun]").bounding_box()
    hand.page.mouse.move(card["x"] + card["width"] / 2, card["y"] + 10)
    hand.page.mouse.up()
    hand.page.wait_for_selector("#link:has-text('would form a cycle')")
    hand.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    hand.page.mouse.down()
    hand.page.mouse.move(box["x"] + 20, box["y"] + 20)
    hand.page.mouse.up()
    hand.page.wait_for_selector("#palette .choice")
    hand.page.keyboard.press("Escape")
    hand.choose("light")
    hand.page.click("#delete")  # nothing else makes radiance
    hand.page.wait_for_selector("#problems:has-text('display')")
    hand.page.wait_for_selector(".card[data-node=light]")
    hand.after(lambda: hand.page.click("#undo"))
    hand.page.wait_for_selector("#problems", state="hidden")


@pytest.mark.nightly
def test_small_things_answer(show: Callable[..., Hand]) -> None:
    hand = show()
    line = hand.page.locator("#split-below")
    box = line.bounding_box()
    hand.page.mouse.move(box["x"] + 100, box["y"] + 2)
    hand.page.mouse.down()
    hand.page.mouse.move(box["x"] + 100, box["y"] - 48, steps=4)
    hand.page.mouse.up()
    assert line.bounding_box()["y"] == pytest.approx(box["y"] - 50, abs=8), "the line follows the pointer"
    hand.page.keyboard.press("?")
    hand.page.wait_for_selector("#shortcuts[open]")
    hand.page.keyboard.press("Escape")
    hand.page.fill("#find", "disp")
    hand.page.keyboard.press("Enter")
    hand.page.wait_for_selector("[id='p-display.contrast']")
    hand.page.fill("[id='p-display.contrast']", "99")
    hand.page.keyboard.press("Tab")
    assert hand.page.input_value("[id='p-display.contrast']") == "1", "what is refused does not stay"
    pin = hand.page.locator("[data-end='light.lookup'].input").bounding_box()
    hand.page.mouse.move(pin["x"] + pin["width"] / 2, pin["y"] + pin["height"] / 2)
    hand.page.mouse.down()
    hand.page.mouse.move(pin["x"] - 25, pin["y"] + 90, steps=4)
    hand.page.mouse.up()
    hand.after(lambda: pick(hand, "Disconnect"))
    hand.page.wait_for_selector("[data-link='shadows.lookup → light.lookup']", state="detached")


@pytest.mark.nightly
def test_a_change_on_the_disk_is_said_beside_the_changes_of_the_page(show: Callable[..., Hand], tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("rendergraph: 1\nextends: forward\nsize: [64, 36]\n")
    hand = show(file, None)
    hand.page.click("#add")
    pick(hand, "bloom")
    hand.page.wait_for_selector("[data-node=bloom]")
    file.write_text("rendergraph: 1\nextends: forward\nsize: [32, 18]\n")
    hand.page.wait_for_selector("#problems:has-text('has changed on disk')")
    hand.page.click("#save")
    hand.page.wait_for_selector("#draft:has-text('-size: [32, 18]')")
    hand.page.keyboard.press("Escape")
    hand.after(lambda: hand.page.click("#problems button"))
    hand.page.wait_for_selector("#figures:has-text('32×18')")
    hand.page.wait_for_selector("[data-node=bloom]", state="detached")


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("tab_name", ["graph", "memory", "times", "changes"])
def test_axe_finds_nothing(page: Hand, tab_name: str) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    page.choose("light")
    page.after(lambda: page.page.fill("[id='p-light.ambient']", "0.1") or page.page.keyboard.press("Enter"))
    page.page.click(f"#tab-{tab_name}")
    page.choose("light" if tab_name == "graph" else "")
    found = axe.Axe().run(page.page).response["violations"]
    assert [(each["id"], [node["target"] for node in each["nodes"]][:3]) for each in found] == []


@pytest.mark.nightly
def test_axe_finds_nothing_in_the_dialogs(page: Hand) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    page.page.click("#add")
    page.page.wait_for_selector("#palette .choice")
    found = axe.Axe().run(page.page).response["violations"]
    page.page.keyboard.press("Escape")
    page.choose("light")
    page.after(lambda: page.page.click("#duplicate"))
    page.page.click("#save")
    page.page.wait_for_selector("#draft:has-text('light_2')")
    found += axe.Axe().run(page.page).response["violations"]
    assert [(each["id"], [node["target"] for node in each["nodes"]][:3]) for each in found] == []


@pytest.mark.nightly
def test_a_texture_is_shown_by_layer_channel_and_range(show: Callable[..., Hand]) -> None:
    hand = show()
    hand.after(lambda: hand.page.select_option("#port", "environment.specular"))
    hand.page.wait_for_selector("#layer option:has-text('+y')", state="attached")
    hand.after(lambda: hand.page.select_option("#layer", "2"))
    assert hand.page.input_value("#port") == "environment.specular"
    hand.after(lambda: hand.page.select_option("#scale", "log"))
    hand.after(lambda: hand.page.fill("#high", "0.5") or hand.page.keyboard.press("Enter"))
    hand.page.wait_for_selector("#mapping:has-text('to 0.5')")
    hand.after(lambda: hand.page.select_option("#channel", "G"))
    hand.page.wait_for_selector("#texture:has-text('R:')")
    hand.after(lambda: hand.page.select_option("#port", ""))
    hand.page.wait_for_selector("#layer", state="hidden")


@pytest.mark.nightly
def test_parts_of_the_page_are_resized_and_shown_alone(show: Callable[..., Hand]) -> None:
    hand = show()
    wide = "document.getElementById('left').clientWidth"
    before = hand.page.evaluate(wide)
    hand.page.focus("#split")
    for _ in range(5):
        hand.page.keyboard.press("ArrowRight")
    assert hand.page.evaluate(wide) == pytest.approx(before + 0.1 * VIEWPORT["width"], abs=3)
    hand.page.keyboard.press("g")
    assert hand.page.is_hidden("#picture")
    hand.page.keyboard.press("p")
    assert hand.page.is_hidden("#canvas")
    assert hand.page.is_visible("#picture")
    hand.page.keyboard.press("p")
    assert hand.page.is_visible("#canvas")
    hand.page.focus("[id='p-shadows.type']")
    assert hand.text("#help").startswith("Filter the results of depth tests")


@pytest.mark.nightly
def test_hundreds_of_changes_leave_nothing_behind(show: Callable[..., Hand]) -> None:
    """The page grows by nothing: elements, listeners of addresses and pictures."""
    hand = show()
    hand.choose("shadows")

    def swap(name: str) -> None:
        hand.after(lambda: hand.page.select_option("[id='p-shadows.type']", name))
        # A selector that is waited for would give a handle, which keeps its card.
        hand.page.locator(f"#canvas .card[data-node=shadows] text:text-is('{name}')").wait_for()

    def measure() -> tuple[int, int]:
        hand.page.request_gc()
        heap = "performance.memory.usedJSHeapSize"
        return hand.page.evaluate("document.querySelectorAll('*').length"), hand.page.evaluate(heap)

    for name in ("shadow_vsm", "shadow_pcss", "shadow_pcf") * 5:
        swap(name)
    elements, heap = measure()
    for name in ("shadow_vsm", "shadow_pcss", "shadow_pcf") * 95:
        swap(name)
    hand.page.evaluate("""async () => {  // 2,000 movements of a slider, 5 ms apart
        const exposure = document.querySelector("#exposure");
        for (let i = 1; i <= 2000; i++) {
            exposure.value = (i % 40) / 10 - 2;
            exposure.dispatchEvent(new Event("input"));
            await new Promise((resolve) => setTimeout(resolve, 5));
        }
    }""")
    hand.page.wait_for_function("document.querySelector('#picture').dataset.still === 'true'")
    hand.page.wait_for_timeout(1000)
    assert measure()[0] == elements
    assert measure()[1] < 1.3 * heap + 2e6


@pytest.mark.nightly
def test_a_sub_pipeline_is_one_card_until_it_is_opened(show: Callable[..., Hand]) -> None:
    hand = show("ssgi-hemicube")
    hand.page.wait_for_selector(".card[data-node=left]")
    assert hand.page.locator(".card[data-node^='left/']").count() == 0
    hand.page.focus("[aria-label='Open left']")
    hand.page.keyboard.press("Enter")
    hand.page.wait_for_selector(".card[data-node^='left/']")
    assert hand.page.locator(".card[data-node=left]").count() == 0
    hand.page.click("#fold")
    hand.page.wait_for_selector(".card[data-node=left]")
    assert hand.page.is_hidden("#fold")


@pytest.mark.nightly
def test_what_a_file_inherits_is_one_card_for_each_file(show: Callable[..., Hand]) -> None:
    hand = show("full")
    hand.page.wait_for_selector(".card[data-node=gbuffer]")
    hand.page.click("#inherited")
    hand.page.wait_for_selector(".card[data-node='from deferred']")
    assert hand.page.locator(".card[data-node=gbuffer], .card[data-node=sun]").count() == 0
    assert hand.page.locator(".card[data-node=light]").count() == 1  # which the file changes
    hand.page.focus("[aria-label='Open from forward']")
    hand.page.keyboard.press("Enter")
    hand.page.wait_for_selector(".card[data-node=sun]")
    assert hand.page.get_attribute("#inherited", "aria-pressed") == "false"


class Fingers:
    """Touches of a page on a phone, in CSS pixels."""

    def __init__(self, page: Any) -> None:
        self.page, self.device = page, page.context.new_cdp_session(page)

    def move(self, *ways: tuple[tuple[float, float], tuple[float, float]], steps: int = 8) -> None:
        """Put a finger down at the beginning of each way, move all together, and lift them."""
        for number in range(steps + 1):
            share = number / steps
            at = [
                {"x": a[0] + share * (b[0] - a[0]), "y": a[1] + share * (b[1] - a[1]), "id": n}
                for n, (a, b) in enumerate(ways)
            ]
            kind = "touchMove" if number else "touchStart"
            self.device.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": at})
            time.sleep(0.02)
        self.device.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})

    def middle(self, selector: str) -> tuple[float, float]:
        self.page.locator(selector).scroll_into_view_if_needed()
        box = self.page.locator(selector).bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


@pytest.mark.nightly
def test_a_phone_turns_pinches_slides_and_taps(browser: Any, served: Any) -> None:
    served.reset(rg.Selection("forward", size=SIZE))
    context = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    try:
        page = context.new_page()
        hand, fingers = Hand(page), Fingers(page)
        hand.open(served.url)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390

        def camera() -> tuple[Any, float]:
            """The direction from what the camera turns around to the eye, and the distance."""
            keys = keys_of(served.state.edits.current[CAMERA])
            away = np.subtract(keys["eye"], keys["target"])
            return away / np.linalg.norm(away), float(np.linalg.norm(away))

        x, y = fingers.middle("#stage")
        hand.after(lambda: fingers.move(((x, y), (x + 20, y))))
        before, distance = camera()
        assert distance > 3
        hand.after(lambda: fingers.move(((x - 30, y), (x + 30, y))))
        turned, same = camera()
        assert np.degrees(np.arccos(before @ turned)) > 5
        assert same == pytest.approx(distance)
        hand.after(lambda: fingers.move(((x - 30, y), (x - 60, y)), ((x + 30, y), (x + 60, y))))
        pinched, near = camera()
        assert near == pytest.approx(distance / 2, rel=0.05)
        assert turned @ pinched == pytest.approx(1, abs=1e-4)  # it does not turn meanwhile

        page.tap("#graph .card[aria-label^='display:']", position={"x": 30, "y": 14})
        hand.until("document.getElementById('node').value === 'display'")
        slider = "[aria-label='display.exposure, slider']"
        at = fingers.middle(slider)
        hand.after(lambda: fingers.move((at, (at[0] + 30, at[1]))))
        assert float(page.input_value("[id='p-display.exposure']")) > 0
        hand.after(lambda: page.tap("#undo"))
        assert float(page.input_value("[id='p-display.exposure']")) == 0
        hand.close()
        assert hand.wrong == []
    finally:
        context.close()
