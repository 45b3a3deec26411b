"""Running pieces of the shipped GLSL over arrays, so that they can be compared with NumPy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rendergraph.glsl import Includes
from rendergraph.resources import folder

Floats = npt.NDArray[np.float64]
Evaluate = Callable[..., Floats]
SHADING = {"UNLIT": 0, "PHONG": 1, "BLINN_PHONG": 2, "ANISOTROPIC": 3, "PBR": 4}


@pytest.fixture(scope="session")
def gl() -> Iterator[Any]:
    """A bare GL context; tests skip where there is none."""
    moderngl = pytest.importorskip("moderngl")
    try:
        context = moderngl.create_context(standalone=True, require=450, backend="egl")
    except Exception as error:
        pytest.skip(f"no OpenGL 4.5: {error}")
    yield context
    context.release()


@pytest.fixture
def evaluate(gl: Any) -> Evaluate:
    """Run statements once a row in a compute shader: `evaluate(includes, columns, statements, defines)`.

    Columns are arrays of shape (n,) or (n, k), k up to 4, named as the variables the statements read; the statements
    set `vec4 result`. Returns float64 of shape (n, 4).
    """

    def run(
        includes: str, columns: Mapping[str, Floats], statements: str, defines: Mapping[str, object] | None = None
    ) -> Floats:
        rows = len(next(iter(columns.values())))
        data = np.zeros((len(columns), rows, 4), np.float32)
        reads = []
        for number, (name, column) in enumerate(columns.items()):
            values = np.asarray(column, np.float64).reshape(rows, -1)
            width = values.shape[1]
            data[number, :, :width] = values
            kind, swizzle = ("float", "x") if width == 1 else (f"vec{width}", "xyzw"[:width])
            reads.append(f"{kind} {name} = given[{number * rows} + row].{swizzle};")
        folder_of_includes = folder("rendergraph.shaders") / "include"
        resolver = Includes(folder_of_includes)
        text = "".join(resolver.expand(folder_of_includes / name).text for name in includes.split())
        macros = "".join(f"#define {name} {value}\n" for name, value in (defines or {}).items())
        source = f"""#version 450 core
{macros}{text}
layout(local_size_x = 64) in;
layout(std430) buffer given_block {{ vec4 given[]; }};
layout(std430) buffer made_block {{ vec4 made[]; }};
void main() {{
    int row = int(gl_GlobalInvocationID.x);
    if (row >= {rows}) return;
    {" ".join(reads)}
    vec4 result = vec4(0.0);
    {statements}
    made[row] = result;
}}
"""
        with gl:  # a session may have made its own context current
            program = gl.compute_shader(source)
            given, made = gl.buffer(data.tobytes()), gl.buffer(reserve=rows * 16)
            program["given_block"].binding, program["made_block"].binding = 0, 1
            given.bind_to_storage_buffer(0)
            made.bind_to_storage_buffer(1)
            program.run((rows + 63) // 64)
            gl.finish()
            found = np.frombuffer(made.read(), np.float32).reshape(rows, 4).astype(np.float64)
            for thing in (program, given, made):
                thing.release()
            assert gl.error == "GL_NO_ERROR"
        return found

    return run


@pytest.fixture
def shading_defines() -> Callable[..., dict[str, object]]:
    """Macros of the lighting node for one shading model."""

    def make(shading: str, **more: object) -> dict[str, object]:
        table: dict[str, object] = {f"SHADING_{name}": number for name, number in SHADING.items()}
        return (
            table
            | {
                "SHADING": f"SHADING_{shading.upper()}",
                "SMITH_EXACT": 0,
                "SMITH_FAST": 1,
                "SMITH": 0,
                "MATERIAL_COUNT": 1,
            }
            | more
        )

    return make
