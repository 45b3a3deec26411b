"""What a node asks of `steps` and cannot have: each is said at the author's own line, and nothing is a traceback."""

from __future__ import annotations

from typing import Any

import pytest

PORTS = """
source = Input(AnyTexel, optional=True, doc="Source.")
color = Output(Radiance, doc="Colour.")
small = Internal(Radiance, size=0.5)
chain = Internal(Radiance, mips=0)
nearest = Internal(Depth, format="depth32f")
numbers = Internal(kind="buffer", bytes=64)
last = History(kind="buffer", bytes=64)
bytes = Internal(format="r8", size=(2, 1))
stencil = Internal(Depth, format="depth32f_stencil8", size=(2, 1))
several = Internal(format="r8", size=(2, 1), samples=4)
given = Input(AnyTexel, kind="buffer", optional=True, doc="Numbers of another.")
views = Views(count=2, doc="Two views.")
gain: float = param(default=1.0, doc="Gain.")

def record(self, steps):
    {call}  # here
    steps.fullscreen("wrong.frag", out=self.color)
"""

CALLS = {
    # ports and parts of ports
    'steps.fullscreen("wrong.frag", source="source")': "RG423 source='source': expected a port, a number or a list of numbers; give the port itself",
    'steps.fullscreen("wrong.frag", source=self.views)': "RG423 source is the view table 'views'; give it as `view=` to a step that draws",
    'steps.fullscreen("wrong.frag", source=Internal(Radiance))': "RG424 source is an Internal created here; declare it as an attribute of the class",
    'steps.fullscreen("wrong.frag", out="color")': "RG423 out is the text 'color'; give the port itself, self.color",
    'steps.fullscreen("wrong.frag", out="colour")': "RG423 out is the text 'colour'; give the port itself; did you mean 'color'?",
    'steps.fullscreen("wrong.frag", out=7)': "RG423 out is 7, not a port",
    'steps.fullscreen("wrong.frag", out=[self.color])': "RG423 out is [Output('color')], not a port",
    'steps.fullscreen("wrong.frag", out={})': "RG423 out is empty; name what the step writes, or leave it out for every output that is used",
    'steps.fullscreen("wrong.frag", out={1: self.color})': "RG423 out has the key 1; the keys are the shader's names",
    'steps.fullscreen("wrong.frag", out={"color": "color"})': "RG423 out['color'] is the text 'color'; give the port itself, self.color",
    'steps.fullscreen("wrong.frag", out={"a": self.color, "b": self.color})': "RG423 out writes 'color' twice, as 'a' and as 'b'",
    'steps.fullscreen("wrong.frag", out=self.source)': "RG421 it writes its input 'source'; only outputs, internals and history can be written",
    'steps.fullscreen("wrong.frag", out=self.views)': "RG421 it writes its views 'views'; only outputs, internals and history can be written",
    'steps.fullscreen("wrong.frag", out=self.chain.mip(-1))': "RG423 a part of 'chain': mip is -1, not a whole number from 0 up or None",
    'steps.fullscreen("wrong.frag", out=self.chain.mip(5))': "RG423 'chain' has no mip 5; it has 0 to 4",
    'steps.fullscreen("wrong.frag", out=self.color.layer(1))': "RG423 'color' has no layer 1; it has only 0",
    'steps.fullscreen("wrong.frag", out=self.chain.mip(1.0))': "RG423 a part of 'chain': mip is 1.0, not a whole number from 0 up or None; divide with //",
    'steps.fullscreen("wrong.frag", source=self.chain.mip(9), out=self.color)': "RG423 'chain' has no mip 9; it has 0 to 4",
    'steps.fullscreen("wrong.frag", out=self.numbers.mip(0))': "RG423 'numbers' is a buffer, which has no mips and no layers",
    'steps.fullscreen("wrong.frag", out=self.color, if_drawn=1)': "RG423 if_drawn is 1, not text",
    'steps.fullscreen("wrong.frag", out=self.color, if_drawn="a")': "RG423 if_drawn is 'a', but no earlier step has that label",
    # numbers
    'steps.fullscreen("wrong.frag", axis=[])': "RG423 axis=[]: expected a port, a number or a list of numbers",
    'steps.fullscreen("wrong.frag", axis=(1, "0"))': "RG423 axis=(1, '0'): expected a port, a number or a list of numbers",
    'steps.fullscreen("wrong.frag", axis=object)': "RG423 axis=<class 'object'>: expected a port, a number or a list of numbers",
    'steps.fullscreen("wrong.frag", defines=["TAPS"])': "RG423 defines is ['TAPS'], not a mapping from macros to values or None",
    'steps.fullscreen("wrong.frag", defines={"TAPS": [1, 2]})': "RG423 defines['TAPS'] is [1, 2], not a number, True, False or text",
    'steps.fullscreen("wrong.frag", defines={"2X": 1})': "RG423 defines has the name '2X', which is not a valid macro name",
    'steps.fullscreen("wrong.frag", defines={"FAR": float("inf")})': "RG423 defines gives FAR the value inf, which GLSL cannot write",
    # shaders and state
    "steps.fullscreen(self.color)": "RG423 shader is the Output 'color', not the name of a file",
    'steps.fullscreen("")': "RG423 shader is '', not the name of a file",
    'steps.geometry("wrong.frag", vertex=b"a.vert")': "RG423 vertex is b'a.vert', not the name of a file",
    'steps.fullscreen("wrong.frag", state="additive")': "RG423 state is 'additive', not a State",
    'steps.fullscreen("wrong.frag", state=ADD)': "RG423 state is Blend(src='one', dst='one', src_alpha=None, dst_alpha=Non..., not a State",
    'steps.fullscreen("wrong.frag", state=State(depth_func="less_equal"))': "RG423 State: depth_func is 'less_equal'; did you mean 'lequal'?",
    'steps.fullscreen("wrong.frag", state=State(blend="add"))': "RG423 State: blend is 'add', not a Blend such as ADD, a tuple of them, or None",
    'steps.fullscreen("wrong.frag", state=State(color_mask=(True, True, True)))': "RG423 State: color_mask is (True, True, True), not four of True and False",
    'steps.fullscreen("wrong.frag", state=State(scissor=(0, 0, 0.5, 1)))': "RG423 State: scissor is (0, 0, 0.5, 1), not x, y, width and height in texels or None; divide with //",
    'steps.fullscreen("wrong.frag", state=State(stencil=Stencil(StencilFace(func="equals"))))': "RG423 StencilFace: func is 'equals'; did you mean 'equal'?",
    'steps.fullscreen("wrong.frag", state=State(blend=Blend("source_alpha")))': "RG423 Blend: src is 'source_alpha'; did you mean 'src_alpha'?",
    'steps.fullscreen("wrong.frag", state=State(culling="none"))': "RG420 TypeError: State(): Unexpected keyword argument 'culling'",
    # geometry
    'steps.geometry("wrong.frag", objects="transparnt")': "RG423 objects is 'transparnt'; did you mean 'transparent'? An object of this name is ['transparnt']",
    'steps.geometry("wrong.frag", objects=3)': "RG423 objects is 3, not all, opaque, transparent, casters or a list of objects' names",
    'steps.geometry("wrong.frag", materials="all")': "RG423 materials is 'all'; available: alpha, full, none",
    'steps.geometry("wrong.frag", order="back to front")': "RG423 order is 'back to front'; did you mean 'back_to_front'?",
    'steps.geometry("wrong.frag", per_light=-1)': "RG423 per_light is -1, not a whole number from 0 up or None",
    'steps.geometry("wrong.frag", view="camera")': "RG423 view is the text 'camera'; give the port itself; available: bytes, chain, color, given, last, nearest, numbers, several, small, source, stencil, views",
    'steps.geometry("wrong.frag", view=self.color)': "RG423 view is the Output 'color'; it is a Views port or an input that carries views",
    'steps.geometry("wrong.frag", view=self.views, view_index=2)': "RG423 view_index is 2, but 'views' has 2 views, counted from 0",
    'steps.geometry("wrong.frag", view_index="0")': "RG423 view_index is '0', not a whole number from 0 up or None",
    'steps.geometry("wrong.frag", per_light=7)': "RG423 per_light is 7, but the scene has 1 lights, counted from 0",
    'steps.fullscreen("wrong.frag", source=self.source.sampled("bilinear"))': "RG423 sampled: filter is 'bilinear'; did you mean 'linear'?",
    'steps.fullscreen("wrong.frag", source=self.source.sampled(wrap="edge"))': "RG423 sampled: wrap is 'edge'; available: border, clamp, mirror, repeat",
    "steps.upload(self.bytes, [[300, -1]])": "RG423 'bytes' takes bytes, or floats from 0 to 1, got int64 from -1 to 300",
    "steps.upload(self.stencil, [[0.5, 0.5]])": "RG423 'stencil' is depth32f_stencil8, which takes no upload; upload a texture without samples and stencil",
    "steps.upload(self.several, [[0.5, 0.5]])": "RG423 'several' has 4 samples per texel, which takes no upload; upload a texture without samples and stencil",
    'steps.draw("wrong.frag", vertex="wrong.vert", vertices=self.last.previous)': "RG423 vertices is a part of 'last'; give the port itself, only shaders read last frame's values",
    'steps.draw("wrong.frag", vertex="wrong.vert", vertices=3, indices=self.last.previous)': "RG423 indices is a part of 'last'; give the port itself, only shaders read last frame's values",
    'steps.draw("wrong.frag", vertex="wrong.vert", vertices=3, indices=5)': "RG423 indices is 5, not a port",
    'steps.draw("wrong.frag", vertex="wrong.vert", vertices=3, attributes={"4f in_a": self.last.previous})': "RG423 attributes['4f in_a'] is a part of 'last'; give the port itself, only shaders read last frame's values",
    'steps.draw("wrong.frag", vertex="wrong.vert", vertices=self.numbers, command=2, commands=2)': "RG423 vertices reads 76 bytes of 'numbers', which holds 64",
    'steps.compute("wrong.comp", groups=self.last.previous)': "RG423 groups is a part of 'last'; give the port itself, only shaders read last frame's values",
    'steps.compute("wrong.comp", groups=self.numbers, command=5)': "RG423 groups reads 72 bytes of 'numbers', which holds 64",
    'steps.draw("wrong.frag", vertex="a.vert", vertices=self.given)': "RG423 input 'given' is not connected; check `steps.connected` first",
    'steps.draw("wrong.frag", vertex="a.vert", vertices=3, attributes={"3f in_p": self.given})': "RG423 input 'given' is not connected; check `steps.connected` first",
    # draws
    'steps.draw("wrong.frag", vertex="a.vert", vertices=3, topology="triangle")': "RG423 topology is 'triangle'; did you mean 'triangles'?",
    'steps.draw("wrong.frag", vertex="a.vert", vertices=-3)': "RG423 vertices is -3, not a whole number from 0 up",
    'steps.draw("wrong.frag", vertex="a.vert", vertices=12 / 3)': "RG423 vertices is 4.0, not a whole number from 0 up; divide with //",
    'steps.draw("wrong.frag", vertex="a.vert", vertices=self.small)': "RG423 vertices is the Internal 'small', which is not a buffer",
    'steps.draw("wrong.frag", vertex="a.vert", vertices=3, instances=True)': "RG423 instances is True, not a whole number from 0 up",
    'steps.draw("wrong.frag", vertex="a.vert", vertices=3, attributes={"in_position": self.numbers})': "RG423 attributes has the layout 'in_position'; it reads like '3f 2f in_position in_uv'",
    'steps.draw("wrong.frag", vertex="a.vert", vertices=3, attributes={"3f 2f in_position": self.numbers})': "RG423 attributes has the layout '3f 2f in_position': 2 formats, 1 names; it reads like "
    "'3f 2f in_position in_uv'",
    'steps.draw("wrong.frag", vertex="a.vert", vertices=3, attributes={"vec3 in_position": self.numbers})': "RG423 attributes has the layout 'vec3 in_position'; it reads like '3f 2f in_position in_uv'",
    'steps.draw("wrong.frag", vertex="a.vert", vertices=3, attributes={"3f in_position": self.small})': "RG423 attributes['3f in_position'] is the Internal 'small', which is not a buffer",
    'steps.draw("wrong.frag", vertex="a.vert", vertices=3, attributes=[self.numbers])': "RG423 attributes is [Internal('numbers')], not a mapping from "
    "layouts to buffers or None",
    'steps.draw("wrong.frag", vertex="a.vert", vertices=3, count=self.numbers)': "RG423 count is given without commands; give vertices=BUFFER, or instances=BUFFER",
    'steps.draw("wrong.frag", vertex="a.vert", vertices=self.numbers, instances=self.numbers)': "RG423 both vertices and instances are buffers; a command holds its number of instances",
    'steps.draw("wrong.frag", vertex="a.vert", vertices=3, instances=self.small)': "RG423 instances is the Internal 'small', which is not a buffer",
    'steps.geometry("wrong.frag", commands=self.small)': "RG423 commands is the Internal 'small', which is not a buffer",
    'steps.geometry("wrong.frag", commands="numbers")': "RG423 commands is the text 'numbers'; give the port itself, self.numbers",
    'steps.geometry("wrong.frag", commands=self.numbers, topology="triangles_adjacency")': "RG423 both commands and topology='triangles_adjacency' are given; commands draw triangles in the scene's order",
    # compute
    'steps.compute("a.comp", groups=(1, 0, 1), out=self.small)': "RG423 groups is (1, 0, 1), not one to three whole numbers from 1 up",
    'steps.compute("a.comp", groups=(16 / 8, 1, 1), out=self.small)': "RG423 groups is (2.0, 1, 1), not one to three whole numbers from 1 up; divide with //",
    'steps.compute("a.comp", groups=(1, 1, 1, 1), out=self.small)': "RG423 groups is (1, 1, 1, 1), not one to three whole numbers from 1 up",
    'steps.compute("a.comp", groups="8", out=self.small)': "RG423 groups is '8', not one to three whole numbers from 1 up",
    'steps.compute("a.comp", groups=(1, 1, 1), over=self.small, out=self.small)': "RG423 both over and groups are given; over determines the number of groups",
    'steps.compute("a.comp", over="small", out=self.small)': "RG423 over is the text 'small'; give the port itself, self.small",
    'steps.compute("a.comp", over=self.numbers, out=self.numbers)': "RG423 over is the buffer 'numbers'; give the number of invocations, as in over=256",
    'steps.compute("a.comp", over=self.source, out=self.numbers)': "RG423 over is input 'source', which is not connected; check `steps.connected` first",
    'steps.compute("a.comp", over=-5, out=self.numbers)': "RG423 over is -5, not one to three whole numbers from 1 up",
    'steps.compute("a.comp", out=self.numbers)': "RG423 no texture determines the number of work groups; give over or groups",
    # clears and mips
    'steps.clear(self.color, "black")': "RG423 value='black': expected a port, a number or a list of numbers; give the port itself",
    "steps.clear(self.color, (0, 0, 0, 0, 0))": "RG423 value is (0, 0, 0, 0, 0), not a number, up to four of them",
    "steps.clear(self.numbers, 1.0)": "RG423 'numbers' is a buffer, which can only be cleared to 0",
    'steps.clear("color")': "RG423 out is the text 'color'; give the port itself, self.color",
    "steps.mipmaps(self.color)": "RG423 'color' has no mips to generate; declare it with mips=0 for the whole chain",
    "steps.mipmaps(self.chain.mip(0))": "RG423 out is a part of 'chain'; mips are generated for whole textures",
    # questions
    "steps.desc(self.source)": "RG423 input 'source' is not connected; check `steps.connected` first",
    "steps.desc(self.numbers)": "RG423 'numbers' holds no texture; its description has no size or format",
    'steps.desc("color")': "RG423 desc's argument is the text 'color'; give the port itself, self.color",
    'steps.connected("source")': "RG423 connected's argument is the text 'source'; give the port itself, self.source",
    'steps.used("color")': "RG423 used's argument is the text 'color'; give the port itself, self.color",
    # what no driver draws
    'steps.fullscreen("wrong.frag", out={"color": self.color, "small": self.small})': "RG425 'a.color' is 16×8, but 'a.small' is 8×4; all targets of a step must have the same size, samples and layers",
    'steps.fullscreen("wrong.frag", source=self.color, out=self.color)': "RG422 it samples 'a.color' in the step that writes it; blend, sample another mip or layer, or go through an "
    "`Internal`",
    'steps.fullscreen("wrong.frag", out=self.color, state=State(blend=(Blend("dst_color", "zero"),)))': "RG429 it blends onto 'a.color', whose contents are undefined; declare it with `clear=`",
    'steps.fullscreen("wrong.frag", out={"color": self.color, "nearest": self.nearest}, state=State(depth_test=True))': "RG429 it tests depth against 'a.nearest', whose contents are undefined; declare it with `clear=0.0`",
    # Python's own
    'steps.fulscreen("wrong.frag")': "RG420 AttributeError: 'Steps' object has no attribute 'fulscreen'; did "
    "you mean 'fullscreen'?",
    'steps.fullscreen("wrong.frag", source=self.sorce)': "RG420 AttributeError: 'Wrong' object has no attribute 'sorce'; did you mean 'source'?",
    "steps.fullscreen()": "RG420 TypeError: Steps.fullscreen() missing 1 required positional argument: 'shader'",
    "1 / 0": "RG420 ZeroDivisionError: division by zero",
    "exit(7)": "RG420 SystemExit: 7",
    "raise Exception": "RG420 Exception: ",
    "self.gain = 2.0": "RG423 'gain' cannot be set: a node holds its parameters, which never change, and nothing else",
}


@pytest.mark.parametrize("call", CALLS)
def test_a_wrong_call(author: Any, call: str) -> None:
    author.node(PORTS.replace("{call}", call))
    (said,) = author.said(author.pipeline().check)
    code, _, text = CALLS[call].partition(" ")
    doing = " failed while recording" if code == "RG420" else ""
    assert said.rstrip() == f"test.yaml:4:3: {code} node 'a' (wrong){doing}: wrong.py:{author.line()}: {text}".rstrip()
