"""Shader nodes drawn: pictures against closed forms in NumPy, and what drivers say of wrong ones."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.errors import InputError

SIZE = (37, 23)
SOURCE = """
out vec4 gradient;
void main() { gradient = vec4(gl_FragCoord.xy, gl_FragCoord.x + gl_FragCoord.y, 64.0) / 64.0; }
"""
HEADER = """/*---
doc: Darken towards the corners.
inputs:
  color: {doc: What is darkened.}
outputs:
  darkened: {format: rgba32f, doc: The same with dark corners.}
params:
  strength: {default: 0.75, min: 0, max: 1, doc: How dark the corners are.}
  power: {default: 3, min: 1, max: 8, role: define, doc: Power of the distance.}
---*/
"""
BODY = """
uniform sampler2D color;
uniform float strength = 0.5;
out vec4 darkened;

void main() {
    vec2 offset = 2.0 * gl_FragCoord.xy / vec2(textureSize(color, 0)) - 1.0;
    float corner = pow(length(offset) / sqrt(2.0), float(POWER));
    vec4 seen = texelFetch(color, ivec2(gl_FragCoord.xy), 0);
    darkened = vec4(seen.rgb * (1.0 - strength * corner), seen.a);
}
"""
PLAIN = "#version 330\nconst int POWER = 3;\n" + BODY.replace("0.5", "0.75").replace("darkened", "fragColor")


def drawn(gl: rg.Session, folder: Path, files: Mapping[str, str], output: str = "image") -> npt.NDArray[np.float32]:
    """The picture with the top row last, as GLSL counts."""
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    frame = rg.load(folder / "p.yaml", size=SIZE).render(session=gl)
    return np.asarray(frame.arrays[output], np.float32)[::-1]


def pipeline(effect: str, port: str, more: str = "") -> str:
    return f"""
nodes:
  source: {{type: ./source.frag}}
  effect: {{type: ./{effect}, inputs: {{color: source.gradient}}{more}}}
outputs: {{image: effect.{port}}}
"""


def gradient() -> npt.NDArray[np.float64]:
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]] + 0.5
    return np.stack([x, y, x + y, np.full_like(x, 64)], axis=-1) / 64  # exact in rgba16f


def vignette(strength: float, power: float) -> npt.NDArray[np.float64]:
    """Closed form: 1 - strength (r / √2)^power, r the distance from the middle, 1 at the middle of a side."""
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]] + 0.5
    corner = (np.hypot(2 * x / SIZE[0] - 1, 2 * y / SIZE[1] - 1) / np.sqrt(2)) ** power
    seen = gradient()
    return np.concatenate([seen[..., :3] * (1 - strength * corner)[..., None], seen[..., 3:]], axis=-1)


@pytest.mark.parametrize(("strength", "power"), [(0.75, 3), (0.3, 1), (1.0, 6)])
def test_a_vignette_with_a_header_is_its_closed_form(
    gl: rg.Session, tmp_path: Path, strength: float, power: int
) -> None:
    more = f", params: {{strength: {strength}, power: {power}}}"
    files = {"source.frag": SOURCE, "v.frag": HEADER + BODY, "p.yaml": pipeline("v.frag", "darkened", more)}
    np.testing.assert_allclose(drawn(gl, tmp_path, files), vignette(strength, power), rtol=0, atol=2e-6)


def test_a_vignette_without_a_header_is_the_same(gl: rg.Session, tmp_path: Path) -> None:
    """Its output is rgba16f: a unit in the last of 11 bits, of values below 1; drivers may cut instead of round."""
    files = {"source.frag": SOURCE, "v.frag": PLAIN, "p.yaml": pipeline("v.frag", "fragColor")}
    np.testing.assert_allclose(drawn(gl, tmp_path, files), vignette(0.75, 3), rtol=0, atol=2**-11 + 2e-6)


def test_a_change_of_a_uniform_compiles_nothing(gl: rg.Session, tmp_path: Path) -> None:
    files = {"source.frag": SOURCE, "v.frag": PLAIN, "p.yaml": pipeline("v.frag", "fragColor")}
    drawn(gl, tmp_path, files)
    before = gl.cache.programs.compiled
    frame = rg.load(tmp_path / "p.yaml", size=SIZE).set("effect.strength", 0.1).render(session=gl)
    np.testing.assert_allclose(np.asarray(frame["image"])[::-1], vignette(0.1, 3), rtol=0, atol=2**-11 + 2e-6)
    assert gl.cache.programs.compiled == before


COMPUTE = """/*---
doc: The picture turned by half, at half the size.
inputs: {color: {size: any, doc: It.}}
outputs: {turned: {format: rgba32f, size: [color, 0.5], doc: The result.}}
---*/
layout(local_size_x = 8, local_size_y = 4) in;
uniform sampler2D color;
layout(rgba32f) uniform writeonly image2D turned;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(turned);
    if (all(lessThan(texel, size))) imageStore(turned, texel, texelFetch(color, size - 1 - texel, 0));
}
"""


def test_a_compute_shader_is_a_node(gl: rg.Session, tmp_path: Path) -> None:
    """Sides that are no multiple of the group's: every texel is written, none twice."""
    files = {"source.frag": SOURCE, "turn.comp": COMPUTE, "p.yaml": pipeline("turn.comp", "turned")}
    found = drawn(gl, tmp_path, files)
    half = gradient()[: (SIZE[1] + 1) // 2, : (SIZE[0] + 1) // 2]
    np.testing.assert_array_equal(found, half[::-1, ::-1].astype(np.float32))


COUNT = """/*---
doc: How many texels have red in each of 8 parts of 0 to 1.
inputs: {color: {doc: It.}}
outputs: {counts: {bytes: 32, clear: 0, doc: The numbers.}}
threads: color
---*/
layout(local_size_x = 16, local_size_y = 16) in;
uniform sampler2D color;
layout(std430) buffer counts { uint count[8]; };

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, textureSize(color, 0)))) return;
    atomicAdd(count[uint(texelFetch(color, texel, 0).r * 8.0)], 1u);
}
"""
SHOW = """/*---
inputs: {counts: {doc: The numbers.}}
outputs: {bars: {format: r32f}}
---*/
layout(std430) readonly buffer counts { uint count[8]; };
out float bars;
void main() { bars = float(count[int(gl_FragCoord.x) % 8]); }
"""


def test_buffers_pass_between_shader_nodes(gl: rg.Session, tmp_path: Path) -> None:
    text = pipeline("count.comp", "counts").replace(
        "outputs: {image: effect.counts}",
        "  show: {type: ./show.frag, inputs: {counts: effect.counts}}\noutputs: {image: show.bars}",
    )
    files = {"source.frag": SOURCE, "count.comp": COUNT, "show.frag": SHOW, "p.yaml": text}
    found = drawn(gl, tmp_path, files)
    red = gradient()[..., 0]
    wanted, _ = np.histogram(red, bins=8, range=(0, 1))
    np.testing.assert_array_equal(found.reshape(SIZE[1], SIZE[0])[0, :8], wanted)


TWO = """
uniform sampler2D color;
layout(location = 1) out vec4 second;
layout(location = 0) out vec4 first;
void main() {
    first = vec4(0.25);
    second = vec4(0.5);
#ifdef HAS_COLOR
    second += texelFetch(color, ivec2(0), 0) * 0.0;
#endif
}
"""


@pytest.mark.parametrize(("port", "value"), [("first", 0.25), ("second", 0.5)])
def test_locations_in_the_text_hold_where_one_output_is_used(
    gl: rg.Session, tmp_path: Path, port: str, value: float
) -> None:
    files = {"source.frag": SOURCE, "two.frag": TWO, "p.yaml": pipeline("two.frag", port)}
    np.testing.assert_array_equal(drawn(gl, tmp_path, files), np.float32(value))


def test_the_drivers_line_is_the_files(gl: rg.Session, tmp_path: Path) -> None:
    """With a `#version` and a header above it."""
    text = "#version 430\n" + HEADER + BODY.replace("float corner = pow(", "float corner = power(")
    files = {"source.frag": SOURCE, "v.frag": text, "p.yaml": pipeline("v.frag", "darkened")}
    with pytest.raises(InputError) as caught:
        drawn(gl, tmp_path, files)
    line = text.split("\n").index("    float corner = power(length(offset) / sqrt(2.0), float(POWER));") + 1
    places = {(problem.place.file, problem.place.line) for problem in caught.value.problems if problem.place}
    assert places == {(f"{tmp_path}/v.frag", line)}


def test_an_unconnected_optional_input_is_compiled_out(gl: rg.Session, tmp_path: Path) -> None:
    text = "/*---\ninputs: {color: {optional: true}}\n---*/\nuniform sampler2D color;\nout vec4 c;\n" + (
        "void main() {\n#ifdef HAS_COLOR\n    c = vec4(1.0);\n#else\n    c = vec4(0.5);\n#endif\n}\n"
    )
    files = {"source.frag": SOURCE, "o.frag": text, "p.yaml": "nodes: {o: {type: ./o.frag}}\noutputs: {image: o.c}\n"}
    np.testing.assert_array_equal(drawn(gl, tmp_path, files), np.float32(0.5))


def test_a_cleared_output_is_certain_where_fragments_are_discarded(gl: rg.Session, tmp_path: Path) -> None:
    text = "/*---\noutputs: {c: {clear: [0.25, 0, 0, 1]}}\n---*/\nout vec4 c;\n" + (
        "void main() {\n    if (gl_FragCoord.x < 10.0) discard;\n    c = vec4(1.0);\n}\n"
    )
    files = {"d.frag": text, "p.yaml": "nodes: {d: {type: ./d.frag}}\noutputs: {image: d.c}\n"}
    found = drawn(gl, tmp_path, files)
    np.testing.assert_array_equal(
        found[:, :10], np.broadcast_to(np.asarray([0.25, 0, 0, 1], np.float32), (SIZE[1], 10, 4))
    )
    np.testing.assert_array_equal(found[:, 10:], np.float32(1))


def test_the_pictures_metadata_draw_the_same_again(gl: rg.Session, tmp_path: Path) -> None:
    from rendergraph.images import read_metadata

    files = {"source.frag": SOURCE, "v.frag": HEADER + BODY, "p.yaml": pipeline("v.frag", "darkened")}
    found = drawn(gl, tmp_path, files)
    rg.load(tmp_path / "p.yaml", size=SIZE).render(session=gl).save(tmp_path / "a.png")
    again = drawn(gl, tmp_path, {"p.yaml": read_metadata(tmp_path / "a.png")["pipeline"]})
    np.testing.assert_array_equal(found, again)


KEPT = """/*---
doc: A table.
outputs:
  table: {format: r32f, size: [4, 4], kept: true, doc: Values.}
params:
  value: {default: 3, min: 0, max: 9, doc: What it holds.}
---*/
uniform float value;
out float table;
void main() { table = value; }
"""


def test_what_a_header_keeps_is_made_once(gl: rg.Session, tmp_path: Path) -> None:
    (tmp_path / "table.frag").write_text(KEPT)
    show = "/*---\ninputs: {table: {size: any}}\n---*/\nuniform sampler2D table;\nout vec4 shown;\nvoid main() { shown = texelFetch(table, ivec2(0), 0).rrrr; }\n"
    (tmp_path / "show.frag").write_text(show)
    text = "nodes: {t: {type: ./table.frag}, s: {type: ./show.frag, inputs: {table: t.table}}}\noutputs: {image: s.shown}\n"
    (tmp_path / "p.yaml").write_text(text)
    frame = rg.load(tmp_path / "p.yaml", size=SIZE).render(session=gl, timed=True)
    assert (frame["image"] == 3.0).all()
    assert [entry["node"] for entry in frame.passes] == ["s"]
    (tmp_path / "table.frag").write_text(KEPT.replace("= value", "= value * camera.eye.x"))
    with pytest.raises(InputError, match=r"table\.frag:10:\d+: RG439 .* 't.table', which is kept, but uses the camera"):
        rg.load(tmp_path / "p.yaml", size=SIZE).check()
