"""What a class may not declare: each mistake is said at its line, before anything is recorded."""

from __future__ import annotations

from typing import Any

import pytest

COLOR = 'color = Output(Radiance, doc="Colour.")\n'

DECLARATIONS = {
    # names
    'uniform = Output(Radiance, doc="D.")  # here': "'uniform' is reserved by GLSL or by the node's base class; choose another name",
    'camera = Input(AnyTexel, doc="D.")  # here': "'camera' is reserved by GLSL or by the node's base class; choose another name",
    'Color = Output(Radiance, doc="D.")  # here': "'Color' is not a lower-case GLSL identifier",
    'gl_color = Output(Radiance, doc="D.")  # here': "'gl_color' is not a lower-case GLSL identifier",
    'two__lines = Output(Radiance, doc="D.")  # here': "'two__lines' is not a lower-case GLSL identifier",
    'depth = Input(Depth, doc="D.")\ndepth_views: float = param(default=1.0, doc="D.")  # here': "'depth_views' is what shaders are given for the views of port 'depth'; rename one",
    'depth = Input(Depth, doc="D.")  # here\nhas_depth: bool = define(default=True, doc="D.")': "input 'depth' and define 'has_depth' would define the same macro, HAS_DEPTH; rename one",
    'curve: Literal["a", "b"] = define(default="a", doc="D.")  # here\ncurve_a: bool = define(default=True, doc="D.")': "choice 'a' of 'curve' and define 'curve_a' would define the same macro, CURVE_A; rename one",
    'light_count: int = define(default=1, doc="D.")  # here': "define 'light_count' would define the macro LIGHT_COUNT, which is rendergraph's own; choose another name",
    'albedo = Input(Albedo, group="albedo", doc="D.")  # here': "group 'albedo' has the name of a port or parameter",
    # docs
    "more = Output(Radiance)  # here": "port 'more' has no doc",
    'gain: float = param(default=1.0, doc="")  # here': "parameter 'gain' has no doc",
    "gain: float = 1.0  # here": "parameter 'gain' is a plain value; declare it with param(…), define(…) or structural(…)",
    # ports
    'more = Output("radiance", doc="D.")  # here': "port 'more': semantic is 'radiance', not a Semantic such as Radiance or None",
    'more = Input("radiance", doc="D.")  # here': "port 'more': semantic is 'radiance', not a Semantic such as Radiance or a Signature such as ShadowLookup",
    'more = Input(Radiance, kind="function", doc="D.")  # here': "port 'more': semantic is the Semantic 'radiance', not a Signature such as ShadowLookup",
    'more = Input(Air, kind="function", many=True, doc="D.")  # here': "port 'more' takes a list, but air_at() of several nodes cannot be joined",
    'more = Output(doc="D.")  # here': "port 'more' has neither a semantic nor `like`",
    'more = Input(Radiance, kind="texture", doc="D.")  # here': "port 'more': kind is 'texture'; did you mean 'texture3d'?",
    'more = Input(Radiance, filter="bilinear", doc="D.")  # here': "port 'more': filter is 'bilinear'; did you mean 'linear'?",
    'more = Input(Radiance, wrap="clamp_to_edge", doc="D.")  # here': "port 'more': wrap is 'clamp_to_edge'; available: border, clamp, mirror, repeat",
    'more = Input(Radiance, size="half", doc="D.")  # here': "port 'more': size is 'half'; available: any, same",
    'more = Input(Radiance, samples=4, doc="D.")  # here': "port 'more': samples is 4; available: any, multi, single",
    'more = Input(Radiance, use="load", doc="D.")  # here': "port 'more': use is 'load'; available: depth_test, image, sample",
    'more = Input(Radiance, anisotropy=0, doc="D.")  # here': "port 'more': anisotropy is 0, not a whole number from 1 up",
    'more = Output(Radiance, kept=2, doc="D.")  # here': "port 'more': kept is 2, not True or False",
    'more = Input(Radiance, optional="yes", doc="D.")  # here': "port 'more': optional is 'yes', not True or False",
    'more = Output(Radiance, format="rgb16f", doc="D.")  # here': "port 'more': format is 'rgb16f'; did you mean 'rgba16f'?",
    'more = Output(Radiance, format=16, doc="D.")  # here': "port 'more': format is 16, not a format such as 'rgba16f', a function of node and facts or None",
    'more = Output(Radiance, kind="textur3d", doc="D.")  # here': "port 'more': kind is 'textur3d'; did you mean 'texture3d'?",
    'more = Output(Radiance, mips=-1, doc="D.")  # here': "port 'more': mips is -1, not a whole number from 0 up or a function of node and facts",
    'more = Output(Radiance, layers=1.5, doc="D.")  # here': "port 'more': layers is 1.5, not a whole number from 0 up, a function of node and facts or None; divide with //",
    'more = Output(Radiance, size=0, doc="D.")  # here': "port 'more': size is 0, not a factor of the viewport above 0, width and height from 1 up, an input's name, that with a factor, a function or None",
    'more = Output(Radiance, size=(64, 0.5), doc="D.")  # here': "port 'more': size is (64, 0.5), not a factor of the viewport above 0, width and height from 1 up, an input's name, that with a factor, a function or None",
    'more = Output(Radiance, size="color", doc="D.")  # here': "port 'more': size: 'color' is not an input",
    'more = Output(Radiance, size=("color", 0), doc="D.")  # here': "port 'more': size is ('color', 0), not a factor of the viewport above 0, width and height from 1 up, an input's name, that with a factor, a function or None",
    'more = Output(Radiance, clear="black", doc="D.")  # here': "port 'more': clear is 'black', not a number, up to four of them, None or a function of node and facts",
    'more = Output(Radiance, clear=(0, 0, 0, 0, 0), doc="D.")  # here': "port 'more': clear is (0, 0, 0, 0, 0), not a number, up to four of them, None or a function of node and facts",
    'more = Output(Radiance, kind="buffer", doc="D.")  # here': "port 'more' is a buffer without bytes; add bytes=…, from 1 up, or element=… and count=…",
    'more = Output(Radiance, kind="buffer", bytes=8, clear=1.0, doc="D.")  # here': "port 'more' is a buffer, which can only be cleared to 0, not to 1.0",
    'more = History(kind="buffer", bytes=8, first=1.0)  # here': "port 'more' is a buffer, which holds 0 before the first frame, not 1.0",
    'more = History(Radiance, first="white")  # here': "port 'more': first is 'white', not a number or None",
    'more = Views(count=-1, doc="D.")  # here': "port 'more': count is -1, not a whole number from 0 up, a function of node and facts or None",
    'more = Views(lights=(0,), doc="D.")  # here': "port 'more': lights is (0,), not a function of node and facts or None",
    'more = Function("shadow", "a.glsl", doc="D.")  # here': "port 'more': signature is 'shadow', not a Signature such as ShadowLookup",
    'more = Function(ShadowLookup, None, doc="D.")  # here': "port 'more': shader is None, not the name of a file",
    # rules that name ports
    'more = Output(like="sauce", doc="D.")  # here\nsource = Input(Radiance, optional=True, doc="D.")': "port 'more': like: there is no port 'sauce'; did you mean 'source'?",
    'more = Output(like="color", doc="D.")  # here': "port 'more': like: 'color' is not an input",
    'more = Output(Radiance, view="color", doc="D.")  # here': "port 'more': view: 'color' is not an input or a Views port",
    'more = Output(Radiance, lights="sun", doc="D.")  # here': "port 'more': lights: there is no port 'sun'",
    'more = Output(Radiance, needs=("depth",), doc="D.")  # here': "port 'more': needs: there is no port 'depth'",
    'more = Output(Radiance, needs=("color",), doc="D.")  # here': "port 'more': needs: 'color' is not an input",
    'more = Function(ShadowLookup, "a.glsl", reads=("map",), doc="D.")  # here': "port 'more': reads: there is no port 'map'",
    # parameters
    'gain: float = param(default="1.0", doc="D.")  # here': "the default of 'gain', '1.0', is wrong: expected a number",
    'gain: float = param(default=3.0, max=2, doc="D.")  # here': "the default of 'gain', 3.0, is wrong: must be at most 2",
    'gain: int = param(default=1.5, doc="D.")  # here': "the default of 'gain', 1.5, is wrong: expected a whole number",
    'gain: float = param(default=float("nan"), doc="D.")  # here': "the default of 'gain', nan, is wrong: must be finite",
    'gain: float = param(default={1}, doc="D.")  # here': "the default of 'gain', {1}, is wrong: Object of type set is not JSON serializable",
    'gain: float = param(default=1.0, min=2, max=1, doc="D.")  # here': "parameter 'gain' has an empty range: min 2 > max 1",
    'gain: float = param(default=1.0, min="0", doc="D.")  # here': "parameter 'gain': min is '0', not a number or None",
    'gain: float = param(default=1.0, unless="light", doc="D.")  # here': "parameter 'gain': unless: there is no input 'light'",
    'gain: float = param(default=1.0, glsl="half", doc="D.")  # here': "parameter 'gain': glsl: 'half' is not the GLSL type of a parameter",
    'name: str = param(default="a", doc="D.")  # here': "parameter 'name' is a param, so its type is a number, a switch or a tuple of them; make text a define with its choices as Literal[…]",
    'mode: Literal["a", "b"] = param(default="a", doc="D.")  # here': "parameter 'mode' is a param, so its type is a number, a switch or a tuple of them; make text a define with its choices as Literal[…]",
    'gain: float | None = param(default=None, doc="D.")  # here': "parameter 'gain' is a param, so its type is a number, a switch or a tuple of them; make text a define with its choices as Literal[…]",
    'gains: list[float] = param(default=[1.0], doc="D.")  # here': "parameter 'gains' is a param, so its type is a number, a switch or a tuple of them; make text a define with its choices as Literal[…]",
    'gains: dict[str, float] = param(default={}, doc="D.")  # here': "parameter 'gains' is a param, so its type is a number, a switch or a tuple of them; make text a define with its choices as Literal[…]",
    'name: str = define(default="a", doc="D.")  # here': "parameter 'name' is a define, so its type is one number, a switch, or Literal[…] with words of letters, digits, '_' and '-'",
    'taps: list[float] = define(default=[1.0], doc="D.")  # here': "parameter 'taps' is a define, so its type is one number, a switch, or Literal[…] with words of letters, digits, '_' and '-'",
    'taps: tuple[float, float] = define(default=(1.0, 1.0), doc="D.")  # here': "parameter 'taps' is a define, so its type is one number, a switch, or Literal[…] with words of letters, digits, '_' and '-'",
    'mode: Literal["four by four"] = define(default="four by four", doc="D.")  # here': "parameter 'mode' is a define, so its type is one number, a switch, or Literal[…] with words of letters, digits, '_' and '-'",
    'gain = param(default=1.0, doc="D.")  # here': "parameter 'gain' has no type; write it as in `gain: float = param(…)`",
    "gain: float  # here": "parameter 'gain' is a plain value; declare it with param(…), define(…) or structural(…)",
    'gain: flaot = param(default=1.0, doc="D.")  # here': "the types of its parameters cannot be resolved: NameError: name 'flaot' is not defined",
    # the class
    'twin = "traced shadows"  # here': "`twin` is 'traced shadows'; it is the name of a node type, such as 'traced_shadows'",
    "twin = 3  # here": "`twin` is 3; it is the name of a node type, such as 'traced_shadows'",
    'shader = "wrong.vert"  # here': "`shader` is 'wrong.vert'; it is a file that ends in .frag or .comp",
}


@pytest.mark.parametrize("body", DECLARATIONS)
def test_a_wrong_declaration(author: Any, body: str) -> None:
    author.node(COLOR + body)
    expected = DECLARATIONS[body]
    said = author.said(author.pipeline().check)
    texts = (expected,) if isinstance(expected, str) else expected
    assert [line.partition(" RG490 ")[2] for line in said] == [f"node type 'wrong': {text}" for text in texts]
    if "'" in texts[0] and "shader" not in body:
        assert said[0].startswith(f"wrong.py:{author.line()}:"), said[0]
    assert author.said(author.pipeline().check) == said  # to the next who asks, too


CLASSES = {
    # what Python says when the module is imported
    "import nonsense_module  # here": "RG491 node type 'wrong' cannot be imported: ModuleNotFoundError",
    "raise SystemExit  # here": "RG491 node type 'wrong' cannot be imported: SystemExit",
    'more = Output(Radiance, docs="D.")  # here': "RG491 node type 'wrong' cannot be imported: TypeError: Output\\(\\): Unexpected keyword argument 'docs'",
    'state = State(cull="both")  # here': "RG491 node type 'wrong' cannot be imported: Misuse: State: cull is 'both'; available:",
}


@pytest.mark.parametrize("body", CLASSES)
def test_a_class_that_python_refuses(author: Any, body: str) -> None:
    import re

    author.node(COLOR + body)
    (said,) = author.said(author.pipeline().check)
    assert said.startswith(("wrong.py:13:", f"wrong.py:{author.line()}:")), said  # the class, or the line inside
    assert re.search(CLASSES[body], said), said


def test_a_port_may_have_a_type(author: Any) -> None:
    author.node('color: Output = Output(Radiance, doc="Colour.")\ngain: float = param(default=1.0, doc="Gain.")')
    graph = author.pipeline().link().graph
    assert list(type(graph["a"].node).ports()) == ["color"]
    assert list(type(graph["a"].node).parameters()) == ["gain"]
