"""What the later stages say: each page's message is the text that is really raised."""

from __future__ import annotations

import re
import threading
from pathlib import Path
from typing import Any

import pytest
import yaml

import rendergraph as rg
from rendergraph.api import Any as AnyTexel
from rendergraph.api import Frame, Input, Node, Output, Radiance, Steps, Views
from rendergraph.errors import RendergraphError
from rendergraph.resources import folder

PAGES = {path.stem.partition("-")[0]: path for path in sorted(folder("rendergraph.errors").glob("RG*.yaml"))}


def page(code: str) -> Any:
    return yaml.safe_load(PAGES[code].read_text())


def said(error: RendergraphError, place: str = "") -> str:
    """The first message without the file's name."""
    return re.sub(r"^\S+?\.yaml:(?=\d)", "", str(error).splitlines()[0])


class Broken(Node):
    """Misspells its port."""

    source = Input(AnyTexel, optional=True, doc="Source.")
    color = Output(Radiance, doc="Nothing.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("a.frag", source=self.sorce)  # type: ignore[attr-defined]


class Backwards(Node):
    """Writes its input."""

    source = Input(AnyTexel, optional=True, doc="Source.")
    color = Output(Radiance, doc="Nothing.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("a.frag", out=self.source)


class Feedback(Node):
    """Samples its target."""

    color = Output(Radiance, doc="Nothing.")

    def record(self, steps: Steps) -> None:
        steps.clear(self.color)
        steps.fullscreen("a.frag", source=self.color, out=self.color)


class Viewless(Node):
    """Sets no view."""

    views = Views(doc="One view.")
    color = Output(Radiance, doc="White.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("a.frag")

    def update(self, frame: Frame) -> None:
        frame.set_views(self.views, [])


@pytest.mark.parametrize(
    ("code", "node"), [("RG420", Broken), ("RG421", Backwards), ("RG422", Feedback), ("RG433", Viewless)]
)
def test_authors_mistakes(bench: Any, code: str, node: type[Node]) -> None:
    shaders = {"a.frag": "out vec4 color; void main() { color = vec4(1.0); }"}
    text = f"nodes:\n        a: {{type: {node.__name__.lower()}}}\noutputs: {{image: a.color}}"
    pipeline = bench.pipeline(text, node, shaders=shaders)
    file = bench.folder / "test.yaml"
    file.write_text(
        file.read_text().replace("rendergraph: 1\nsize: [16, 8]\n", "").replace("outputs", "rendergraph: 1\noutputs")
    )
    with pytest.raises(RendergraphError, match=code) as caught:
        bench.session.render(pipeline)
    expected = page(code)["message"]
    assert re.sub(r"failed while recording: \S+\.py:\d+: ", "failed while recording: ", said(caught.value)) == expected


def test_outputs_and_taps(gl: rg.Session, tmp_path: Path) -> None:
    forward = rg.load("forward", size=(16, 16))
    for code, options in (("RG205", {"outputs": ["imgae"]}), ("RG206", {"taps": ["light.radience"]})):
        with pytest.raises(RendergraphError, match=code) as caught:
            gl.render(forward, **options)  # type: ignore[arg-type]
        assert said(caught.value) == page(code)["message"]
    for key in ("wrong", "right"):
        (tmp_path / f"{key}.yaml").write_text(page("RG204")[key])
    with pytest.raises(RendergraphError, match="RG204") as caught:
        rg.load(tmp_path / "wrong.yaml").check()
    assert said(caught.value) == page("RG204")["message"]
    rg.load(tmp_path / "right.yaml").check()


def test_devices_memory_and_threads(gl: rg.Session, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RendergraphError, match="RG611"):
        rg.Session(device=7)
    monkeypatch.setenv("RENDERGRAPH_MEMORY_LIMIT", "1")
    with pytest.raises(RendergraphError, match=r"RG616 the plan needs 16 MiB of textures, 1 MiB may be used"):
        gl.render(rg.load("forward", size=(32, 32)))
    monkeypatch.delenv("RENDERGRAPH_MEMORY_LIMIT")
    errors: list[str] = []

    def work() -> None:
        try:
            gl.render(rg.load("forward", size=(32, 32)))
        except RendergraphError as error:
            errors.append(str(error))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert errors == [page("RG615")["message"]]


class Mixed(Node):
    """Draws to a texture and an array at once."""

    color = Output(AnyTexel, format="r32f", doc="One.")
    layers = Output(AnyTexel, kind="texture2d_array", layers=2, format="r32f", doc="Two.")


def test_targets_that_no_driver_draws_together(bench: Any) -> None:
    shaders = {"mixed.frag": "out float color; out float layers; void main() { color = layers = 1.0; }"}
    with pytest.raises(RendergraphError, match="RG617") as caught:
        bench.draw("nodes: {m: {type: mixed}}\noutputs: {image: m.color, two: m.layers}", Mixed, shaders=shaders)
    assert said(caught.value) == page("RG617")["message"]


def test_every_code_that_is_raised_has_one_page_and_every_page_a_code() -> None:
    sources = [*folder("rendergraph").rglob("*.py"), *folder("rendergraph.nodes").rglob("*.py")]
    raised = {code for file in sources for code in re.findall(r"\"(RG\d{3})\"", file.read_text())}
    assert raised == set(PAGES)
    assert len(PAGES) == len(list(folder("rendergraph.errors").glob("RG*.yaml")))
