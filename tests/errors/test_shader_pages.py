"""The pages of codes about shaders: their wrong text gets exactly their message, their right text gets none."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import pytest
import yaml

from rendergraph.errors import InputError
from rendergraph.resources import folder

if TYPE_CHECKING:
    import rendergraph as rg

COLOR = 'color = Output(Radiance, doc="Colour.")\n'
GAIN = 'gain: float = param(default=1.0, doc="Gain.")\n'
DRAWN = 'def record(self, steps):\n    steps.geometry("wrong.frag", vertex="wires.vert")\n'
SAMPLED = 'depth = Input(AnyTexel, doc="Depth.")\n'
SCRATCH = """scratch = Internal()
def record(self, steps):
    steps.clear(self.scratch)
    steps.fullscreen("wrong.frag", scratch=self.scratch, out=self.color)
"""
STORE = "void main() { imageStore(color, ivec2(gl_GlobalInvocationID.xy), vec4(1.0)); }\n"
POSITION = "void main() {{ gl_Position = vec4({}, 1.0); }}\n"
OUT = "out vec4 color; void main() {{ color = {}; }}"
CASES = {
    # code: body, file, what stands behind the page's text in its wrong and right form
    "RG410": (COLOR, "wrong.frag", "", ""),
    "RG411": (COLOR, "wrong.frag", "", ""),
    "RG427": ('shader = "wrong.comp"\n' + COLOR, "wrong.comp", STORE, STORE),
    "RG428": (COLOR + DRAWN, "wires.vert", POSITION.format("in_positon"), POSITION.format("in_position")),
    "RG430": (COLOR, "wrong.frag", "out vec4 color; void main() { color = texelFetch(depht, ivec2(0), 0); }", None),
    "RG447": (COLOR + SCRATCH, "wrong.frag", OUT.format("vec4(textureSize(scratch, 0).x)"), OUT.format("vec4(1.0)")),
    "RG436": (COLOR + GAIN, "wrong.frag", OUT.format("gain.xyzx"), OUT.format("vec4(gain)")),
    "RG434": (
        COLOR + GAIN,
        "wrong.frag",
        "out vec4 color; void main() { color = vec4(gian); }",
        "out vec4 color; void main() { color = vec4(gain); }",
    ),
}
LAST = "nodes:\n  a: {type: wrong, inputs: {depth: a.color@previous}}\noutputs: {image: a.color}\n"


@pytest.mark.parametrize("code", CASES)
def test_a_page_tells_the_truth(author: Any, gl: rg.Session, code: str) -> None:
    if code in ("RG410", "RG411") and not gl.device.software:
        pytest.skip("drivers have words of their own")
    (file,) = folder("rendergraph.errors").glob(f"{code}-*.yaml")
    page: dict[str, Any] = yaml.safe_load(file.read_text())
    body, name, wrong, right = CASES[code]
    author.node(body)
    shader = author.plugins / name
    shader.write_text(page["wrong"] + wrong)
    with pytest.raises(InputError, match=code):
        gl.render(author.pipeline(scene="objects: {box: {shape: box}}\n"))
    said = author.said(lambda: gl.render(author.pipeline(scene="objects: {box: {shape: box}}\n")))[0]
    said = re.sub(r"wrong\.py:\d+", "blur.py:2", said.removeprefix(f"{name}:"))
    assert (said.replace("(wrong)", "(wires)") if code == "RG428" else said) == page["message"]
    text = author.pipeline(scene="objects: {box: {shape: box}}\n")
    if right is None:
        author.node(SAMPLED + body)
        right = wrong.replace("depht", "depth")
        text = author.pipeline(LAST)
    shader.write_text(page["right"] + right)
    gl.render(text)
