"""What a step's shader uses and the step does not provide: `check` names the port, the step and the way out."""

from __future__ import annotations

from typing import Any

import pytest

import rendergraph as rg
from rendergraph.errors import InputError

BODY = """
depth = Input(Depth, doc="Depth.")
normal = Input(Normal, optional=True, doc="Normals.")
color = Output(Radiance, doc="Colour.")
counts = Internal(AnyTexel, format="r32ui", clear=0)
gain: float = param(default=1.0, min=0, max=2, doc="Factor.")

def record(self, steps):
    steps.fullscreen("wrong.frag", depth=self.depth, out=self.color, wind=1.0)  # here
"""
TEXT = """extends: deferred
nodes:
  a: {type: wrong, inputs: {depth: gbuffer.depth, normal: gbuffer.normal}}
outputs: {image: a.color}
"""
FRAG = "uniform sampler2D depth, normal;\nuniform float gain, wind;\nuniform float gian;\nout vec4 color;\n"
READ = "texelFetch({}, ivec2(0), 0)"


def main_of(text: str) -> str:
    return FRAG + f"void main() {{ color = gain * wind * ({text}); }}\n"


WRONG = {
    READ.format("normal"): "wrong.frag:1:26: RG430 node 'a' (wrong): wrong.py:LINE: wrong.frag samples 'normal', a "
    "port of the node that this step does not read; add normal=self.normal to the step, or leave it out by #ifdef "
    "HAS_NORMAL where it is not connected",
    "normal_views[0].eye": "wrong.frag:5:38: RG430 node 'a' (wrong): wrong.py:LINE: wrong.frag uses the views of "
    "'normal', a port of the node that this step does not read; add normal=self.normal to the step, or leave it out by "
    "#ifdef HAS_NORMAL where it is not connected",
    "vec4(gian)": "wrong.frag:3:15: RG434 node 'a' (wrong): wrong.py:LINE: wrong.frag uses uniform 'gian', which "
    "nothing sets; did you mean 'gain'?",
}


@pytest.mark.parametrize("used", WRONG)
def test_check_names_what_a_step_leaves_out(author: Any, gl: rg.Session, used: str) -> None:
    author.node(BODY)
    author.write(wrong__frag=main_of(used))
    wanted = WRONG[used].replace("LINE", str(author.line()))
    (said,) = author.said(author.pipeline(TEXT).check)
    assert said == wanted
    (drawn,) = author.said(lambda: gl.render(author.pipeline(TEXT)))
    assert drawn == wanted or "views" in used  # the driver stops at a name that is not declared


@pytest.mark.parametrize(
    "source",
    [
        main_of(READ.format("depth")),
        main_of("depth_views[0].eye"),
        # What is not used, or not compiled, is not asked for.
        FRAG + "vec4 unused() { return vec4(gian) + texelFetch(normal, ivec2(0), 0); }\n"
        "void main() { color = vec4(gain * wind) + texelFetch(depth, ivec2(0), 0); }\n",
        FRAG + "void main() {\n    color = vec4(gain * wind) + texelFetch(depth, ivec2(0), 0);\n"
        "#ifdef HAS_NORMAL\n    color += normal_views[0].eye + texelFetch(normal, ivec2(0), 0);\n#endif\n}\n",
        FRAG + "void main() {\n    color = vec4(gain * wind) + texelFetch(depth, ivec2(0), 0);\n"
        "#if DEPTH_LAYERS > 1\n    color += texelFetch(normal, ivec2(0), 0);\n#endif\n}\n",
    ],
)
def test_what_is_right_passes(author: Any, gl: rg.Session, source: str) -> None:
    author.node(BODY)
    author.write(wrong__frag=source)
    assert not author.pipeline(TEXT).check().warnings
    gl.render(author.pipeline(TEXT))


def test_what_a_constant_condition_may_exclude_is_a_warning(author: Any, gl: rg.Session) -> None:
    author.node(BODY)
    source = "void main() { color = vec4(gain * wind) * texelFetch(depth, ivec2(0), 0);\n"
    author.write(wrong__frag=FRAG + source + "if (DEPTH_LAYERS > 1) color += texelFetch(normal, ivec2(0), 0); }\n")
    (warning,) = author.pipeline(TEXT).check().warnings
    assert (warning.code, warning.severity) == ("RG430", "warning")
    gl.render(author.pipeline(TEXT))  # the driver leaves it out


@pytest.mark.parametrize("stored", [True, False])
def test_a_misspelt_image_is_no_matter_of_format_qualifiers(author: Any, gl: rg.Session, stored: bool) -> None:
    out = '{"color": self.color, "counts": self.counts.stored()}' if stored else "self.color"
    author.node(BODY.replace("out=self.color", f"out={out}"))
    text = "uniform uimage2D couns;\n" + main_of(READ.format("depth"))
    author.write(wrong__frag=text.replace("color = ", "imageAtomicAdd(couns, ivec2(0), 1u); color = "))
    line = author.line()
    way = "; did you mean 'counts'?" if stored else "; give couns=PORT.stored(), or name it in `out`"
    what = "wrong.frag declares the image 'couns', but the step loads and stores no port of that name"
    for act in (author.pipeline(TEXT).check, lambda: gl.render(author.pipeline(TEXT))):
        said = author.said(act)
        assert said == [f"wrong.frag:1:18: RG430 node 'a' (wrong): wrong.py:{line}: {what}{way}"]


def test_a_texture_without_a_view_has_no_views(author: Any) -> None:
    author.node(BODY.replace('Input(Depth, doc="Depth.")', 'Input(AnyTexel, doc="Depth.", size="any")'))
    author.write(wrong__frag=main_of("depth_views[0].eye"))
    text = TEXT.replace("depth: gbuffer.depth", "depth: environment.specular")
    (said,) = author.said(author.pipeline(text.replace("environment.specular", "display.color")).check)
    assert "was not drawn with a view" in said


def test_the_wrong_shape_of_an_upload_is_at_its_function(author: Any, gl: rg.Session) -> None:
    author.node("""
color = Output(Radiance, format="r32f", size=(4, 1), doc="Numbers.")

def record(self, steps):
    steps.upload(self.color, self.numbers)

def numbers(self, scene):  # here
    return numpy.zeros(5)
""")
    text = "nodes:\n  a: {type: wrong}\noutputs: {image: a.color}\n"
    with pytest.raises(InputError) as caught:
        gl.render(author.pipeline(text))
    assert f"wrong.py:{author.line()}: " in str(caught.value)
    assert "'color' takes 1 × 1 × 4 × 1 numbers" in str(caught.value)


def test_a_port_under_another_name_is_named(author: Any, gl: rg.Session) -> None:
    author.node(BODY.replace("depth=self.depth", "dpeth=self.depth"))
    author.write(wrong__frag=main_of("depth_views[0].eye"))
    for act in (author.pipeline(TEXT).check, lambda: gl.render(author.pipeline(TEXT))):
        (said,) = author.said(act)
        assert said.endswith(
            "'depth', a port of the node that this step does not read; give it as depth=…, not dpeth=…"
        )


def test_an_unconnected_input_without_a_guard(author: Any, gl: rg.Session) -> None:
    author.node(BODY.partition("\ndef record")[0])
    author.write(wrong__frag=main_of(READ.format("normal")).replace(", wind", "").replace("wind *", ""))
    pipeline = author.pipeline(TEXT.replace(", normal: gbuffer.normal", ""))
    for act in (pipeline.check, lambda: gl.render(pipeline)):
        (said,) = author.said(act)
        assert said.endswith("samples 'normal', which is not connected here; leave it out by #ifdef HAS_NORMAL")


@pytest.mark.parametrize(
    ("declared", "message"),
    [("int gain", "as int, but it is given floats, 1.0"), ("vec3 wind", "as vec3, but it is given 1 number")],
)
def test_a_uniform_of_another_type(author: Any, gl: rg.Session, declared: str, message: str) -> None:
    author.node(BODY)
    name = declared.split()[1]
    source = main_of(READ.format("depth")).replace(
        "uniform float gain, wind;", "uniform float gain;\nuniform float wind;"
    )
    source = source.replace(f"uniform float {name}", f"uniform {declared}").replace("wind * (", "vec4(wind.x) * (")
    author.write(wrong__frag=source.replace("wind.x", "wind.x" if name == "wind" else "wind"))
    for act in (author.pipeline(TEXT).check, lambda: gl.render(author.pipeline(TEXT))):
        (said,) = author.said(act)
        assert said.startswith("wrong.frag:")
        assert "RG436" in said
        assert said.endswith(f"declares '{name}' {message}")


def test_whole_numbers_at_a_shipped_node_are_named_at_the_link(author: Any) -> None:
    author.node('color = Output(Radiance, format="rgba16ui", doc="Colour.")')
    author.write(wrong__frag="out uvec4 color;\nvoid main() { color = uvec4(1u); }\n")
    text = "nodes:\n  a: {type: wrong}\n  b: {type: tonemap, inputs: {radiance: a.color}}\noutputs: {image: b.color}\n"
    (said,) = author.said(author.pipeline(text).check)
    assert said == (
        "test.yaml:5:41: RG215 'b.radiance' does not read integers, but 'a.color' (line 4) has the format rgba16ui"
    )


def test_a_block_that_the_step_has_no_buffer_for(author: Any, gl: rg.Session) -> None:
    body = BODY.replace("depth=self.depth", "depth=self.depth, numbers=self.numbers")
    author.node(body.replace("\ndef record", 'numbers = Internal(kind="buffer", bytes=16)\n\ndef record') + UPDATE)
    text = "layout(std430) readonly buffer number { vec4 values[]; };\n" + main_of("values[0]")
    author.write(wrong__frag=text)
    for act in (author.pipeline(TEXT).check, lambda: gl.render(author.pipeline(TEXT))):
        (said,) = author.said(act)
        assert said.startswith("wrong.frag:1:32: RG430 ")
        assert said.endswith("uses block 'number', but the step has no buffer of that name; it has numbers")


UPDATE = """
def update(self, frame):
    frame.write(self.numbers, numpy.zeros(4, numpy.float32))
"""


def test_a_buffer_that_nothing_writes(author: Any, gl: rg.Session) -> None:
    body = BODY.replace("depth=self.depth", "depth=self.depth, numbers=self.numbers")
    body = body.replace("\ndef record", 'numbers = Internal(kind="buffer", bytes=16)\n\ndef record')
    author.write(wrong__frag="buffer numbers { vec4 values[]; };\n" + main_of("values[0]"))
    author.node(body)
    (said,) = author.said(author.pipeline(TEXT).check)
    assert said.endswith("it reads the buffer 'a.numbers', but no step writes it, and its node has no `update`")
    author.node(body + UPDATE)
    author.pipeline(TEXT).check()


@pytest.mark.parametrize(("method", "takes"), [("update", "frame"), ("record", "steps"), ("camera_jitter", "frame")])
def test_a_method_with_too_few_arguments(author: Any, method: str, takes: str) -> None:
    author.node(f'color = Output(Radiance, doc="Colour.")\n\ndef {method}(self):\n    pass\n')
    (said,) = author.said(author.pipeline().check)
    assert said.endswith(f"`{method}` takes (self); declare it as {method}(self, {takes})")


def test_views_that_nothing_sets(author: Any) -> None:
    author.node("""
color = Output(Radiance, doc="Colour.")
mine = Views(doc="Views.")

def record(self, steps):
    steps.geometry("wrong.frag", view=self.mine)
""")
    (said,) = author.said(author.pipeline().check)
    assert said.endswith("it draws with the views of 'mine', which nothing sets; set them in `update`")


def test_what_a_function_samples_is_among_its_reads(author: Any, gl: rg.Session) -> None:
    author.node("""
depth = Input(Depth, doc="Depth.")
look = Function(ShadowLookup, shader="look.glsl", reads=(), doc="Shadow.")
""")
    author.node(
        'look = Input(ShadowLookup, kind="function", doc="Shadow.")\ncolor = Output(Radiance, doc="All.")', "asks"
    )
    shadow = "float shadow(int light, vec3 position, vec3 normal) { return texelFetch(depth, ivec2(0), 0).r; }\n"
    author.write(look__glsl="uniform sampler2D depth;\n" + shadow)
    author.write(asks__frag="out vec4 color;\nvoid main() { color = vec4(shadow(0, vec3(0.0), vec3(0.0))); }\n")
    text = TEXT.replace(", normal: gbuffer.normal", "").replace("a.color", "b.color")
    text = text.replace("outputs:", "  b: {type: asks, inputs: {look: a.look}}\noutputs:")
    for act in (author.pipeline(text).check, lambda: gl.render(author.pipeline(text))):
        (said,) = author.said(act)
        assert said.startswith("look.glsl:1:19: RG430 node 'b' (asks): ")
        assert said.endswith(
            "look.glsl of node 'a' samples 'depth', which is not among the `reads` of its Function; add it there"
        )


@pytest.mark.parametrize(
    ("used", "said"),
    [
        ("PASS_VIEW.eye", "`PASS_VIEW' undeclared; #include <pass_view.glsl> declares it"),
        (
            "fragment_surface(camera).alpha",
            "no function with name 'fragment_surface'; #include <fragment_surface.glsl>",
        ),
    ],
)
def test_the_include_that_declares_a_name(author: Any, gl: rg.Session, used: str, said: str) -> None:
    author.node(BODY)
    author.write(wrong__frag=main_of(used))
    if "Mesa" not in str(gl.device.as_json()["version"]):
        pytest.skip("in Mesa's words")
    (message,) = author.said(lambda: gl.render(author.pipeline(TEXT)))
    assert said in message


def test_the_include_that_declares_a_type(author: Any, gl: rg.Session) -> None:
    author.node(BODY)
    author.write(wrong__frag="struct Own { Surface surface; };\n" + main_of("1.0"))
    if "Mesa" not in str(gl.device.as_json()["version"]):
        pytest.skip("in Mesa's words")
    (message,) = author.said(lambda: gl.render(author.pipeline(TEXT)))
    assert message.startswith("wrong.frag:1:14: RG410 ")
    assert message.endswith("NEW_IDENTIFIER: nothing declares 'Surface'; #include <surface.glsl> does")
