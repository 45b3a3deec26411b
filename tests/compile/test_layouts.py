"""Elements of buffers: the same fields in GLSL and in NumPy, verified against the driver."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from rendergraph.api import Any as AnyTexel
from rendergraph.api import Frame, Input, Internal, Layout, Node, Output, Radiance, Steps
from rendergraph.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    import rendergraph as rg

    Draw = Callable[..., rg.Frame]

SPARK = Layout(
    "Spark",
    {
        "age": "float",
        "position": "vec3",
        "life": "float",
        "pair": "uvec2",
        "turn": "mat4",
        "number": "int",
        "size": "vec2",
        "tint": "vec4",
    },
)
OFFSETS = {"age": 0, "position": 16, "life": 28, "pair": 32, "turn": 48, "number": 112, "size": 120, "tint": 128}


def sparks() -> Any:
    """Two elements with another value in every field."""
    values = np.zeros(2, SPARK.dtype)
    for number, element in enumerate(values):
        for at, name in enumerate(SPARK.fields):
            shape = np.shape(element[name])
            element[name] = 100 * number + 10 * at + np.arange(max(1, int(np.prod(shape)))).reshape(shape)
    return values


class Source(Node):
    """Elements that `update` writes or that a step uploads; a dispatch copies them."""

    copied = Output(AnyTexel, kind="buffer", element=SPARK, count=2, doc="Sparks.")
    written = Internal(kind="buffer", element=SPARK, count=2)
    uploaded = Internal(kind="buffer", element=SPARK, count=2, kept=True)

    def record(self, steps: Steps) -> None:
        steps.upload(self.uploaded, sparks())
        steps.compute("copy.comp", over=1, written=self.written, uploaded=self.uploaded, out=self.copied)

    def update(self, frame: Frame) -> None:
        frame.write(self.written, sparks())


class Reader(Node):
    """Some fields of the second element."""

    sparks = Input(AnyTexel, kind="buffer", element=SPARK, doc="Sparks.")
    color = Output(Radiance, format="rgba32f", doc="Fields.")


SHADERS = {
    "copy.comp": """layout(local_size_x = 1) in;
        layout(std430) readonly buffer written { Spark one[]; };
        layout(std430) readonly buffer uploaded { Spark other[]; };
        layout(std430) buffer copied { Spark all[]; };
        void main() { all[0] = one[0]; all[1] = other[1]; }""",
    "reader.frag": """layout(std430) readonly buffer sparks { Spark all[]; };
        out vec4 color;
        void main() {
            color = vec4(all[1].position.z, float(all[1].pair.y), all[1].turn[2].y, float(all[0].number) + all[1].size.x);
        }""",
}
TEXT = "nodes: {s: {type: source}, r: {type: reader, inputs: {sparks: s.copied}}}\noutputs: {image: r.color}"


def test_fields_lie_where_std430_has_them() -> None:
    fields = SPARK.dtype.fields
    assert {name: fields[name][1] for name in SPARK.fields} == OFFSETS
    assert SPARK.dtype.itemsize == 144
    assert Layout("Small", {"a": "float", "b": "uint", "c": "int"}).dtype.itemsize == 12
    assert Layout("Two", {"a": "float", "b": "vec3"}) != Layout("Two", {"b": "vec3", "a": "float"})
    with pytest.raises(TypeError, match=r"Layout 'Bad' cannot hold \['double a'\]; available: float, vec2"):
        Layout("Bad", {"a": "double"})
    for name, fields in (("Bad", {}), ("a b", {"a": "int"}), (5, {"a": "int"}), ("Bad", ["a"]), ("Bad", {"2a": "int"})):
        with pytest.raises(TypeError, match=r"Layout\(.*\) is not like Layout\('Spark', \{'age': 'float'\}\)"):
            Layout(name, fields)  # type: ignore[arg-type]


def test_numpy_and_shaders_see_the_same_fields(draw: Draw) -> None:
    frame = draw(TEXT, Source, Reader, shaders=SHADERS, taps=["s.copied"])
    values, copied = sparks(), frame["s.copied"].view(SPARK.dtype)
    for name in SPARK.fields:
        np.testing.assert_array_equal(copied[name], values[name])
    second = values[1]
    expected = [second["position"][2], second["pair"][1], second["turn"][2, 1], values[0]["number"] + second["size"][0]]
    np.testing.assert_array_equal(frame["image"][0, 0], expected)


@pytest.mark.parametrize(
    ("shader", "said"),
    [
        (
            "struct Other { vec4 position; float age; }; SSBO { Other all[]; }; MAIN(all[0].position.x)",
            r"'all\[0\]\.position'",
        ),
        ("SSBO { float first; Spark all[]; }; MAIN(first + all[0].age)", r"'all\[0\]\.age'|'first'"),
    ],
)
def test_other_elements_than_declared_are_refused(bench: Any, shader: str, said: str) -> None:
    shader = shader.replace("SSBO", "layout(std430) readonly buffer sparks")
    shader = f"out vec4 color; {shader}".replace("MAIN(", "void main() { color = vec4(") + "; }"
    with pytest.raises(InputError, match=rf"RG438 .*({said}) of block 'sparks' is at byte .*declare Spark values"):
        bench.draw(TEXT, Source, Reader, shaders=SHADERS | {"reader.frag": shader})


class Misled(Reader):
    """Expects other elements."""

    sparks = Input(AnyTexel, kind="buffer", element=Layout("Spark", {"age": "float"}), doc="Sparks.")


def test_a_link_between_different_elements_is_a_mistake(bench: Any) -> None:
    said = r"RG215 'r.sparks' expects elements struct Spark \{ float age; \};, but 's.copied' .* has struct Spark \{ float age; vec3"
    with pytest.raises(InputError, match=said):
        bench.draw(TEXT.replace("reader", "misled"), Source, Misled, shaders=SHADERS)
