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
    "normal_views[0].eye": "wrong.frag:5:38: RG430 node 'a' (wrong): wrong.py:LINE: wrong.frag looks at the views of "
    "'normal', a port of the node that this step does not read; add normal=self.normal to the step, or leave it out by "
    "#ifdef HAS_NORMAL where it is not connected",
    "vec4(gian)": "wrong.frag:3:15: RG434 node 'a' (wrong): wrong.py:LINE: wrong.frag looks at uniform 'gian', which "
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
        "test.yaml:5:41: RG215 'b.radiance' reads no whole numbers, but 'a.color' (line 4) has the format rgba16ui"
    )
