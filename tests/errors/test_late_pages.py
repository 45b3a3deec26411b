"""What the later stages say: each page's message is the text that is really raised."""

from __future__ import annotations

import re
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
import yaml

import rendergraph as rg
from rendergraph.api import ADD, Depth, Frame, Input, Internal, Node, Output, Radiance, State, Steps, Views
from rendergraph.api import Any as AnyTexel
from rendergraph.errors import InputError, RendergraphError
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


class Quoted(Node):
    """Names a port in quotes."""

    source = Input(AnyTexel, optional=True, doc="Source.")
    color = Output(Radiance, doc="Nothing.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("a.frag", source="source")  # type: ignore[arg-type]


class Gbuffer(Node):
    """Another node."""

    normal = Output(Radiance, doc="Nothing.")


class Borrower(Node):
    """Reads what another class declares."""

    source = Input(AnyTexel, optional=True, doc="Source.")
    color = Output(Radiance, doc="Nothing.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("a.frag", source=Gbuffer.normal)


class Both(Node):
    """Two sizes at once."""

    large = Output(Radiance, doc="Whole.")
    small = Output(Radiance, size=0.5, doc="Half.")
    color = Output(Radiance, doc="Whole.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("a.frag", out={"color": self.color, "large": self.large})
        steps.fullscreen("a.frag", out={"color": self.large, "small": self.small})


class Stores(Node):
    """Stores into depth."""

    depth = Output(Depth, format="depth32f", doc="Depth.")
    color = Output(Radiance, doc="Nothing.")

    def record(self, steps: Steps) -> None:
        steps.compute("a.comp", groups=(1, 1, 1), out=self.depth)
        steps.fullscreen("a.frag", depth=self.depth, out=self.color)


class Adds(Node):
    """Adds to nothing."""

    color = Output(Radiance, doc="Nothing.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("a.frag", out=self.color, state=State(blend=ADD))


class Keeps(Node):
    """Keeps what comes from what it does not keep."""

    scratch = Internal(Radiance)
    color = Output(Radiance, kept=True, doc="Table.")

    def record(self, steps: Steps) -> None:
        steps.clear(self.scratch)
        steps.fullscreen("a.frag", source=self.scratch, out=self.color)


class Early(Node):
    """Reads before it writes."""

    raw = Internal(Radiance)
    color = Output(Radiance, doc="Nothing.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("a.frag", source=self.raw, out=self.color)
        steps.fullscreen("a.frag", out=self.raw)


class Unfilled(Node):
    """Makes mips of nothing."""

    bright = Internal(Radiance, mips=0)
    color = Output(Radiance, doc="Nothing.")

    def record(self, steps: Steps) -> None:
        steps.mipmaps(self.bright)
        steps.fullscreen("a.frag", source=self.bright, out=self.color)


@pytest.mark.parametrize(
    ("code", "node"),
    [
        ("RG420", Broken),
        ("RG421", Backwards),
        ("RG422", Feedback),
        ("RG423", Quoted),
        ("RG424", Borrower),
        ("RG425", Both),
        ("RG426", Stores),
        ("RG429", Adds),
        ("RG433", Viewless),
        ("RG439", Keeps),
        ("RG601", Early),
        ("RG603", Unfilled),
    ],
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
    assert re.sub(r"\S+\.py:\d+", "blur.py:2", said(caught.value)) == page(code)["message"]
    here = re.search(r"(\S+\.py):(\d+)", said(caught.value))
    assert here is not None
    assert Path(here[1]).name == Path(__file__).name
    assert any(word in Path(__file__).read_text().splitlines()[int(here[2]) - 1] for word in ("steps.", "frame."))


class Twice(Node):
    """Declares one of two."""

    color = Output(Radiance, doc="The picture.")

    def record(self, steps: Steps) -> None:
        steps.fullscreen("twice.frag", out=self.color)


def test_an_out_that_nobody_declares(bench: Any) -> None:
    def drawn(shader: str) -> rg.Pipeline:
        shaders = {"twice.frag": f"{shader} void main() {{ color = vec4(1.0); }}"}
        made: rg.Pipeline = bench.pipeline(
            "nodes: {a: {type: twice}}\noutputs: {radiance: a.color}", Twice, shaders=shaders
        )
        return made

    with pytest.raises(RendergraphError, match="RG448") as caught:
        drawn("out vec4 color; out vec4 mask;").check()
    told = re.sub(r"\S+\.py:\d+", "blur.py:2", said(caught.value))
    assert re.sub(r"^\S+twice\.frag:(?=\d)", "", told) == page("RG448")["message"]
    drawn("out vec4 color;\n#ifdef HAS_MASK\nout vec4 mask;\n#endif\n").check()
    drawn("out vec4 color;").check()


class Endless(Node):
    """Never has enough."""

    color = Output(Radiance, doc="Nothing.")

    def record(self, steps: Steps) -> None:
        while True:
            steps.clear(self.color)


@pytest.mark.slow
def test_a_node_that_records_without_end_is_told(bench: Any) -> None:
    pipeline = bench.pipeline("nodes: {a: {type: endless}}\noutputs: {radiance: a.color}", Endless)
    with pytest.raises(RendergraphError, match=r"RG606 node 'a' .*records more than 100000 steps"):
        bench.session.render(pipeline)


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
    monkeypatch.setenv("RENDERGRAPH_DEVICE", "gpu0")
    with pytest.raises(RendergraphError, match="RG611 RENDERGRAPH_DEVICE is 'gpu0', not the number of a device"):
        rg.Session()
    monkeypatch.delenv("RENDERGRAPH_DEVICE")
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "glcontext.egl", None)
        without.delattr("glcontext.egl", raising=False)
        with pytest.raises(RendergraphError, match=r"RG611 no usable OpenGL 4\.5 device"):
            rg.Session()
    with monkeypatch.context() as elsewhere:
        elsewhere.setenv("GLCONTEXT_LINUX_LIBEGL", "libnowhere.so")
        with pytest.raises(RendergraphError, match=r"RG611 no usable OpenGL 4\.5 device: libnowhere\.so not loaded"):
            rg.Session()
        elsewhere.setenv("GLCONTEXT_LINUX_LIBEGL", "")
        with rg.Session():
            pass
    monkeypatch.setenv("RENDERGRAPH_MEMORY_LIMIT", "1")
    with pytest.raises(RendergraphError, match="RG616") as caught:
        gl.render(rg.load("forward", size=(32, 32), scene="cornell_box"))
    assert said(caught.value) == page("RG616")["message"].replace("4352", "16").replace("1024", "1")
    monkeypatch.delenv("RENDERGRAPH_MEMORY_LIMIT")
    errors: list[str] = []

    def work() -> None:
        try:
            gl.render(rg.load("forward", size=(32, 32), scene="cornell_box"))
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
    text = "nodes: {m: {type: mixed}}\noutputs: {image: m.color, two: m.layers}"
    with pytest.raises(
        InputError, match=r"RG425 .*'m.color' is a plain 2D target, but 'm.layers' is 2 layers; all tar"
    ):
        bench.pipeline(text, Mixed, shaders=shaders).check()


class Signed(Node):
    """A format that some drivers do not draw to."""

    color = Output(AnyTexel, format="rgba16_snorm", doc="From -1 to 1.")


def test_targets_that_the_driver_does_not_take(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    raw = bench.session.device.raw
    assert raw.glCheckNamedFramebufferStatus  # asked for once, so that the patch has something to put back
    monkeypatch.setattr(raw, "glCheckNamedFramebufferStatus", lambda *_: 0x8CDD)
    shaders = {"signed.frag": "out vec4 color; void main() { color = vec4(1.0); }"}
    with pytest.raises(RendergraphError, match="RG617") as caught:
        bench.draw("nodes: {s: {type: signed}}\noutputs: {image: s.color}", Signed, shaders=shaders)
    assert said(caught.value) == page("RG617")["message"]


def test_a_device_without_memory_objects(gl: rg.Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(type(gl.device.ctx), "extensions", property(lambda _: set()))
    with pytest.raises(RendergraphError, match="RG621") as caught:
        gl.render(rg.load("forward", size=(16, 9), sets=("sun.resolution=16",)), heap=True, warm_up=False)
    assert said(caught.value) == page("RG621")["message"].replace(
        "llvmpipe (LLVM 15.0.6, 256 bits)", gl.device.renderer
    )


def test_every_code_that_is_raised_has_one_page_and_every_page_a_code() -> None:
    packages = map(folder, ("rendergraph", "rendergraph.nodes", "rendergraph.pipelines"))
    sources = [file for package in packages for file in package.rglob("*.py")]
    raised = {code for file in sources for code in re.findall(r"\"(RG\d{3})\"", file.read_text())}
    assert raised == set(PAGES)
    assert len(PAGES) == len(list(folder("rendergraph.errors").glob("RG*.yaml")))
