"""Images and buffers: what a step only reads is declared so, and a buffer holds what its block takes."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import yaml

from rendergraph.resources import folder

if TYPE_CHECKING:
    import rendergraph as rg

SOURCE = 'color = Output(Radiance, format="rgba16f", doc="White.")\nshader = "white.frag"\n'
LOADS = """
radiance = Input(Radiance, use="image", doc="What is loaded.")
color = Output(like="radiance", doc="The same.")
shader = "wrong.comp"
"""
COMP = """layout(local_size_x = 8) in;
uniform image2D radiance;
uniform writeonly image2D color;
void main() { ivec2 p = ivec2(gl_GlobalInvocationID.xy); imageStore(color, p, imageLoad(radiance, p)); }
"""
TEXT = "nodes:\n  w: {type: white}\n  a: {type: wrong, inputs: {radiance: w.color}}\noutputs: {image: a.color}\n"
NUMBERS = """
color = Output(Radiance, doc="Colour.")
numbers = Internal(kind="buffer", bytes=BYTES)

def record(self, steps):
    steps.compute("wrong.comp", over=16, out=self.numbers)
    steps.fullscreen("wrong.frag", numbers=self.numbers, out=self.color)
"""
NUMBERS_COMP = """layout(local_size_x = 16) in;
layout(std430) buffer numbers { float values[16]; };
void main() { values[gl_GlobalInvocationID.x] = 1.0; }
"""
NUMBERS_FRAG = """layout(std430) readonly buffer numbers { float values[]; };
out vec4 color;
void main() { color = vec4(values[3]); }
"""


def page(code: str) -> Any:
    (file,) = folder("rendergraph.errors").glob(f"{code}-*.yaml")
    return yaml.safe_load(file.read_text())


def test_an_image_that_is_only_read_is_declared_so(author: Any, gl: rg.Session) -> None:
    author.node(SOURCE, "white")
    author.node(LOADS)
    author.write(white__frag="out vec4 color;\nvoid main() { color = vec4(1.0); }\n", wrong__comp=COMP)
    (said,) = author.said(lambda: gl.render(author.pipeline(TEXT)))
    assert said.removeprefix("wrong.comp:") == page("RG457")["message"]
    wrong, right = (page("RG457")[which].partition(";")[0] for which in ("wrong", "right"))
    assert wrong in COMP
    author.write(wrong__comp=COMP.replace(wrong, right))
    assert (gl.render(author.pipeline(TEXT))["image"] == 1).all()


@pytest.mark.parametrize(
    "declared", ["buffer numbers { float values[]; };", "coherent buffer\n numbers { float values[]; };"]
)
def test_a_buffer_that_is_only_read_is_declared_so(author: Any, gl: rg.Session, declared: str) -> None:
    author.node(NUMBERS.replace("BYTES", "64"))
    right = "readonly buffer numbers { float values[]; };"
    author.write(wrong__comp=NUMBERS_COMP, wrong__frag=NUMBERS_FRAG.replace(right, declared))
    (said,) = author.said(lambda: gl.render(author.pipeline()))
    line, column = (2, 2) if "\n" in declared else (1, 23)
    expected = (
        f"wrong.frag:{line}:{column}: RG457 node 'a' (wrong): wrong.py:{author.line('steps.full')}: buffer 'numbers' "
    )
    assert said.startswith(expected + "is only read, so declare it as `readonly buffer numbers`")


def test_a_functions_buffer_that_is_only_read_is_declared_so(author: Any, gl: rg.Session) -> None:
    author.node(
        NUMBERS.replace("BYTES", "64")
        .replace('"wrong.frag"', '"wrong.frag", glow=self.glow')
        .replace(
            "\ndef",
            'glow = Function(Signature("glow", "vec4 glow()", (), "+", "vec4(0.0)", "Glow."), reads=("numbers",), '
            'shader="glow.glsl", doc="Glow.")\n\ndef',
            1,
        )
    )
    author.write(
        wrong__comp=NUMBERS_COMP,
        glow__glsl="layout(std430) buffer numbers { float values[]; };\nvec4 glow() { return vec4(values[3]); }\n",
        wrong__frag="out vec4 color;\nvoid main() { color = glow(); }\n",
    )
    (said,) = author.said(lambda: gl.render(author.pipeline()))
    assert re.match(r"glow\.glsl:1:23: RG457 .* buffer 'numbers' is only read", said), said


@pytest.mark.parametrize("bytes", [32, 48])
def test_a_buffer_holds_what_its_block_takes(author: Any, gl: rg.Session, bytes: int) -> None:
    author.node(NUMBERS.replace("BYTES", str(bytes)))
    author.write(wrong__comp=NUMBERS_COMP, wrong__frag=NUMBERS_FRAG)
    (said,) = author.said(lambda: gl.render(author.pipeline()))
    said = said.replace(f"wrong.py:{author.line('steps.compute')}", "blur.py:2").removeprefix("wrong.comp:")
    assert said == page("RG438")["message"].replace("holds 32", f"holds {bytes}")
    author.node(NUMBERS.replace("BYTES", "64"))
    np.testing.assert_array_equal(gl.render(author.pipeline())["image"], 1)
