"""Hooks that fail: rules of ports, validators, `record`, `update`, and what one node forgets and another reads."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from rendergraph.errors import InputError

if TYPE_CHECKING:
    import rendergraph as rg

COLOR = 'color = Output(Radiance, doc="Colour.")\n'

RULES = {
    # what fails, by the rule's name
    'more = Output(Radiance, size=lambda node, facts: node.side(), doc="D.")  # here': "'a.more' (wrong): the rule for its size fails: wrong.py:{line}: AttributeError: 'Wrong' object has no attribute "
    "'side'; available: color, more",
    'more = Output(Radiance, size=lambda node, facts: "large", doc="D.")': "'a.more' (wrong): the rule for its size gives 'large', not width and height in whole texels",
    'more = Output(Radiance, size=lambda node, facts: 64, doc="D.")': "'a.more' (wrong): the rule for its size gives 64, not width and height in whole texels",
    'more = Output(Radiance, format=lambda node, facts: facts.input("nothing").desc.format, doc="D.")  # here': "'a.more' (wrong): the rule for its format fails: wrong.py:{line}: KeyError: 'nothing'",
    'more = Output(Radiance, format=lambda node, facts: ["rgba16f"], doc="D.")': "RG211 'a.more' (wrong): the rule for its format gives ['rgba16f'], not a format such as 'rgba16f' or None",
    'more = Output(Radiance, kind="texture2d_array", layers=lambda node, facts: 1 / 0, doc="D.")  # here': "'a.more' (wrong): the rule for its layers fails: wrong.py:{line}: ZeroDivisionError: division by zero",
    'more = Output(Radiance, mips=lambda node, facts: "all", doc="D.")': "'a.more' (wrong): the rule for its mips gives 'all', not a whole number from 0 up",
    'more = Output(Radiance, samples=lambda node, facts: [4], doc="D.")': "'a.more' (wrong): the rule for its samples gives [4], not one of 1, 2, 4, 8, 16 or None",
    'more = Output(Radiance, kind="buffer", bytes=lambda node, facts: 2.5, doc="D.")': "'a.more' (wrong): the rule for its bytes gives 2.5, not a whole number from 1 up",
    'more = Output(Radiance, size=lambda node, facts: ("64", "48"), doc="D.")': "'a.more' (wrong): the rule for its size gives ('64', '48'), not width and height in whole texels",
    'more = Output(Radiance, size=lambda node, facts: (64.7, 48.9), doc="D.")': "'a.more' (wrong): the rule for its size gives (64.7, 48.9), not width and height in whole texels",
    'more = Output(Radiance, mips=lambda node, facts: True, doc="D.")': "'a.more' (wrong): the rule for its mips gives True, not a whole number from 0 up",
    'more = Output(Radiance, layers=lambda node, facts: True, doc="D.")': "'a.more' (wrong): the rule for its layers gives True, not a whole number from 0 up or None",
    'more = Output(Radiance, samples=lambda node, facts: True, doc="D.")': "'a.more' (wrong): the rule for its samples gives True, not one of 1, 2, 4, 8, 16 or None",
    'more = Output(Radiance, samples=lambda node, facts: 4.0, doc="D.")': "'a.more' (wrong): the rule for its samples gives 4.0, not one of 1, 2, 4, 8, 16 or None",
    'more = Output(Radiance, kind="buffer", bytes=lambda node, facts: 0, doc="D.")': "'a.more' (wrong): the rule for its bytes gives 0, not a whole number from 1 up",
    'color = Output(Radiance, clear=lambda node, facts: node.dark, doc="D.")  # here': "'a.color' (wrong): the rule for its clear fails: wrong.py:{line}: AttributeError: 'Wrong' object has no "
    "attribute 'dark'; available: color",
    'color = Output(Radiance, clear=lambda node, facts: "black", doc="D.")': "'a.color' (wrong): the rule for its clear gives 'black', not a number, up to four of them or None",
    'more = Output(Radiance, lights=lambda node, facts: 3, doc="D.")': "'a.more' (wrong): the rule for its lights gives 3, not the indices of lights",
    'more = Views(count=lambda node, facts: "all", doc="D.")': "'a.more' (wrong): the rule for its count gives 'all', not a whole number from 0 up or None",
    'more = Views(count=lambda node, facts: facts.lamps, doc="D.")  # here': "'a.more' (wrong): the rule for its count fails: wrong.py:{line}: AttributeError: 'Facts' object has no "
    "attribute 'lamps'",
    'more = Views(lights=lambda node, facts: facts.lights[9], doc="D.")  # here': "'a.more' (wrong): the rule for its lights fails: wrong.py:{line}: IndexError: tuple index out of range",
    'last = Input(AnyTexel, filter=lambda node, facts: node.smooth, optional=True, doc="D.")  # here': "'a.last' (wrong): the rule for its filter fails: wrong.py:{line}: AttributeError: 'Wrong' object has no "
    "attribute 'smooth'; available: color, last",
    'last = Input(AnyTexel, filter=lambda node, facts: "bicubic", optional=True, doc="D.")': "'a.last' (wrong): the rule for its filter gives 'bicubic', not one of nearest, linear, trilinear",
    'more = Output(Radiance, size=lambda node, facts: int("x"), doc="D.")  # here': "'a.more' (wrong): the rule for its size fails: wrong.py:{line}: ValueError: invalid literal for int() with base "
    "10: 'x'",
    'more = Output(Radiance, size=lambda node, facts: node.refuse(), doc="D.")\n'
    'def refuse(self):\n    raise SceneError("it takes two lights")': "node 'a' (wrong): it takes two lights",
    'more = Output(Radiance, size=lambda node, facts: exit(), doc="D.")  # here': "'a.more' (wrong): the rule for its size fails: wrong.py:{line}: SystemExit: None",
}


@pytest.mark.parametrize("body", RULES)
def test_a_rule_that_fails(author: Any, body: str) -> None:
    author.node(body if body.startswith("color") else COLOR + body)
    last = "" if "last =" not in body else ", inputs: {last: a.color@previous}"
    text = f"nodes:\n  a: {{type: wrong{last}}}\noutputs: {{image: a.color}}\n"
    (said,) = author.said(author.pipeline(text).check)
    expected = RULES[body] if RULES[body].startswith("RG") else f"RG209 {RULES[body]}"
    line = author.line() if "{line}" in expected else 0
    assert said == f"test.yaml:4:3: {expected.replace('{line}', str(line))}"


CHECKS = {
    "raise KeyError(self.gain)  # here": "wrong.py:13:1: RG490 node type 'wrong': it cannot be instantiated with its defaults: KeyError: 1.0",
    "self.gain == 1.0 or 1 / 0  # here": "test.yaml:4:3: RG209 node 'a' (wrong): its own checks fail: wrong.py:{line}: ZeroDivisionError: division by zero",
    "if self.gain > 1:\n        raise ValueError('gain must be at most 1')": "test.yaml:4:46: RG104 node 'a' (wrong): gain must be at most 1",
    "if self.gain > self.bias:\n        raise ValueError('gain must be at most bias')": "test.yaml:4:3: RG104 node 'a' (wrong): gain must be at most bias",
}


@pytest.mark.parametrize("body", CHECKS)
def test_a_check_of_an_authors_own(author: Any, body: str) -> None:
    author.node(
        f'{COLOR}gain: float = param(default=1.0, doc="Gain.")\nbias: float = param(default=1.0, doc="Bias.")\n\n'
        f"def validate(self):\n    {body}"
    )
    text = "nodes:\n  a: {type: wrong, params: {bias: 0.5, gain: 2.0}}\noutputs: {image: a.color}\n"
    (said,) = author.said(author.pipeline(text).check)
    assert said == CHECKS[body].replace("{line}", str(author.line()) if "# here" in body else "")


HELPER = "def shade(steps, port):\n    steps.fullscreen('wrong.frag', source=port.x)  # deep\n"


def test_a_helper_beside_the_node_is_the_authors_own(author: Any) -> None:
    author.write(_shade__py=HELPER)
    author.node(
        COLOR + "def record(self, steps):\n    shade(steps, self.color)", before="from ._shade import shade\n\n\n"
    )
    (said,) = author.said(author.pipeline().check)
    where = f"_shade.py:{author.line('# deep', '_shade.py')}"
    assert said == f"test.yaml:4:3: RG420 node 'a' (wrong) failed while recording: {where}: " + (
        "AttributeError: 'Output' object has no attribute 'x'"
    )


@pytest.mark.parametrize(
    ("helper", "said_of"),
    [
        ("import math\nSIZE = 1 / 0\n", "_shade.py:2:1: RG491 node type 'wrong' cannot be imported: ZeroDivisionError"),
        ("import math\n\ndef shade(:\n", "_shade.py:3:1: RG491 node type 'wrong' cannot be imported: SyntaxError"),
        ("SIZE = 1\n", "wrong.py:13:1: RG491 node type 'wrong' cannot be imported: ImportError"),
    ],
)
def test_a_helper_that_cannot_be_imported(author: Any, helper: str, said_of: str) -> None:
    author.write(_shade__py=helper)
    author.node(COLOR, before="from ._shade import shade\n\n\n")
    (said,) = author.said(author.pipeline().check)
    assert said.startswith(said_of)


def test_what_numpy_raises_is_at_the_authors_line(author: Any) -> None:
    author.node(COLOR + "def record(self, steps):\n    numpy.linalg.inv(numpy.zeros((2, 2)))  # here")
    (said,) = author.said(author.pipeline().check)
    assert f"wrong.py:{author.line()}: LinAlgError: Singular matrix" in said


@pytest.mark.parametrize(
    ("head", "body", "kind"),
    [
        ("def", "yield steps.fullscreen('wrong.frag')", "generator"),
        ("async def", "steps.fullscreen('wrong.frag')", "coroutine"),
        ("def", "return steps", "Steps"),
    ],
)
def test_a_record_that_gives_something_back(author: Any, head: str, body: str, kind: str) -> None:
    author.node(f"{COLOR}{head} record(self, steps):\n    {body}")
    (said,) = author.said(author.pipeline().check)
    expected = f"wrong.py: `record` returned a {kind}; it must call steps.… and return nothing"
    assert said == f"test.yaml:4:3: RG423 node 'a' (wrong): {expected}"


def test_a_record_that_refuses_the_scene(author: Any) -> None:
    author.node(f"{COLOR}def record(self, steps):\n    steps.facts.casting('moon')")
    (said,) = author.said(author.pipeline(scene="objects: {box: {shape: box}}\nlights: {sun: {type: point}}\n").check)
    assert said.endswith("RG209 node 'a' (wrong): the scene has no light 'moon'; available: sun")


UPDATES = {
    "frame.set_views(self.views, [])": "'a.views' has 1 views, but update set 0",
    "frame.set_views(self.views, [None])": "set_views is given NoneType, not ViewMatrices",
    "frame.set_views(self.color, [frame.camera])": "set_views is given 'color', which is not a Views port",
    "frame.set_views('views', [])": "set_views is the text 'views'; give the port itself, self.views",
    "frame.write(self.color, numpy.zeros(4))": "write is the Output 'color', which is not a buffer",
    "frame.write(self.numbers, [None])": "write is given list of object, not an array of numbers",
    "frame.write(self.numbers, numpy.zeros(17, numpy.float32))": "RG432 it writes 68 bytes into 'numbers', which holds 64",
    "frame.connected('color')": "connected's argument is the text 'color'; give the port itself, self.color",
    "frame.scene.lights[3]": "IndexError: tuple index out of range",
    "numpy.linalg.inv(numpy.zeros((2, 2)))": "LinAlgError: Singular matrix",
    "raise SystemExit(3)": "SystemExit: 3",
}


@pytest.mark.parametrize("body", UPDATES)
def test_an_update_that_fails(author: Any, gl: rg.Session, body: str) -> None:
    author.node(
        f'{COLOR}views = Views(doc="Views.")\nnumbers = Internal(kind="buffer", bytes=64)\n\n'
        'def record(self, steps):\n    steps.compute("wrong.comp", over=1, out=self.numbers)\n'
        '    steps.fullscreen("wrong.frag", numbers=self.numbers, out=self.color)\n\n'
        f"def update(self, frame):\n    {body}  # here"
    )
    author.write(wrong__comp="layout(local_size_x = 1) in;\nvoid main() {}")
    (said,) = author.said(lambda: gl.render(author.pipeline()))
    with pytest.raises(InputError, match=r"RG43[23]"):  # the author's file is at fault: exit code 3
        gl.render(author.pipeline())
    where = f"wrong.py:{author.line()}"
    code = "RG432" if UPDATES[body].startswith("RG432") else "RG433"
    text = UPDATES[body].removeprefix("RG432 ")
    assert said == f"test.yaml:4:3: {code} node 'a' (wrong) failed in update: {where}: {text}"


@pytest.mark.parametrize(
    ("value", "said_of"),
    [
        ("1 / 0, 0.0", "wrong.py:{line}: ZeroDivisionError: division by zero"),
        ("2.0, 0.0", "what camera_jitter returns is (2.0, 0.0), not x and y in texels, from -1 to 1"),
        ("0.5", "what camera_jitter returns is 0.5, not x and y in texels, from -1 to 1"),
    ],
)
def test_a_jitter_that_fails(author: Any, gl: rg.Session, value: str, said_of: str) -> None:
    author.node(f"{COLOR}def camera_jitter(self, frame):\n    return {value}  # here")
    (said,) = author.said(lambda: gl.render(author.pipeline()))
    text = said_of.format(line=author.line())
    assert said.removeprefix("test.yaml:4:3: RG433 node 'a' (wrong) failed in camera_jitter: ").endswith(text)


SIGNATURES = {"record": "self, steps", "update": "self, frame"}


@pytest.mark.parametrize("hook", SIGNATURES)
def test_a_hook_that_takes_nothing(author: Any, gl: rg.Session, hook: str) -> None:
    author.node(f"{COLOR}def {hook}(self):  # here\n    pass")
    (said,) = author.said(lambda: gl.render(author.pipeline()))
    way = f"`{hook}` takes (self); declare it as {hook}({SIGNATURES[hook]})"
    assert said == f"wrong.py:{author.line()}:5: RG490 node type 'wrong': {way}"


def test_views_that_nobody_sets(author: Any, gl: rg.Session) -> None:
    author.node(
        f'{COLOR}views = Views(count=2, doc="Views.")\n\n'
        'def record(self, steps):\n    steps.geometry("wrong.frag", view=self.views)'
    )
    pipeline = author.pipeline(scene="objects: {box: {shape: box}}\n")
    with pytest.raises(InputError, match="RG433"):
        gl.render(pipeline)
    (said,) = author.said(lambda: gl.render(pipeline))
    way = "it draws with the views of 'views', which nothing sets; set them in `update`"
    assert said == f"test.yaml:5:3: RG433 node 'a' (wrong): wrong.py:{author.line('steps.geometry')}: {way}"


# --- what one node forgets and another reads -------------------------------------------------------------------------

READER = 'source = Input(AnyTexel, doc="Source.")\ncolor = Output(Radiance, doc="Colour.")'
TWO = "nodes:\n  a: {type: wrong}\n  b: {type: reader, inputs: {source: a.mask}}\noutputs: {image: b.color, own: a.color}\n"


def test_an_output_that_is_forgotten_names_its_node(author: Any) -> None:
    author.node(
        f'{COLOR}mask = Output(Radiance, doc="Mask.")\n\ndef record(self, steps):\n'
        '    steps.fullscreen("wrong.frag", out=self.color)'
    )
    author.node(READER, "reader")
    assert author.said(author.pipeline(TWO).check) == [
        "test.yaml:5:3: RG604 node 'b' reads 'a.mask', but no step of 'a' writes it; write it in its `record`"
    ]
    alone = TWO.replace("own: a.color", "own: a.mask")
    assert (
        "test.yaml:4:3: RG604 output 'own' shows 'a.mask', but no step writes it; write it in the node's `record`"
        in (author.said(author.pipeline(alone).check))
    )


def test_a_maker_that_does_nothing_is_said_to(author: Any) -> None:
    author.node(f'{COLOR}mask = Output(Radiance, doc="Mask.")\n\ndef record(self, steps):\n    pass')
    author.node(READER, "reader")
    text = TWO.replace(", own: a.color", "")
    assert author.said(author.pipeline(text).check) == [
        "test.yaml:5:3: RG607 node 'b' reads 'a.mask', but 'a' does nothing: it recorded no step"
    ]


def test_a_maker_that_has_nothing_to_read_is_said_to(author: Any) -> None:
    author.node(
        'layers = Output(Radiance, kind="texture2d_array", layers=lambda node, facts: 0, doc="No layers.")', "nolayers"
    )
    author.node('layers = Input(AnyTexel, kind="texture2d_array", doc="Layers.")\nmask = Output(Radiance, doc="Mask.")')
    author.node(READER, "reader")
    text = (
        "nodes:\n  n: {type: nolayers}\n  a: {type: wrong, inputs: {layers: n.layers}}\n"
        "  b: {type: reader, inputs: {source: a.mask}}\noutputs: {image: b.color}\n"
    )
    assert author.said(author.pipeline(text).check) == [
        "test.yaml:6:3: RG607 node 'b' reads 'a.mask', but 'a' does nothing: "
        "n.layers has no layers: there is nothing to read"
    ]


def test_a_node_that_nobody_wants_remembers_nothing(author: Any) -> None:
    """Whoever is not wanted does not keep alive what it would read of last frame."""
    author.node(
        f'{COLOR}spare = Output(Radiance, doc="Spare.")\n\ndef record(self, steps):\n'
        '    assert not steps.used(self.spare)\n    steps.fullscreen("wrong.frag", out=self.color)'
    )
    author.node(READER, "reader")
    text = (
        "nodes:\n  a: {type: wrong}\n  b: {type: reader, inputs: {source: a.spare@previous}}\n"
        "  c: {type: reader, inputs: {source: b.color@previous}}\noutputs: {image: a.color}\n"
    )
    expansion = author.pipeline(text).expand().expansion
    assert set(expansion.idle) == {"b", "c"}
    assert all(resource.role != "history" for resource in expansion.resources.values())


def test_a_missing_shader_names_the_call(author: Any, gl: rg.Session) -> None:
    author.node(COLOR + 'def record(self, steps):\n    steps.fullscreen("worng.frag")  # here')
    with pytest.raises(InputError, match="RG400"):
        gl.render(author.pipeline())
    (said,) = author.said(lambda: gl.render(author.pipeline()))
    where = f"node 'a' (wrong): wrong.py:{author.line()}"
    assert said == f"test.yaml:4:3: RG400 {where}: there is no shader 'worng.frag'; did you mean 'wrong.frag'?"
