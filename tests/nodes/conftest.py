"""Running pieces of the shipped GLSL over arrays, so that they can be compared with NumPy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rendergraph as rg
from rendergraph.glsl import Includes
from rendergraph.glsl.source import needs
from rendergraph.resources import folder

Floats = npt.NDArray[np.float64]
Evaluate = Callable[..., Floats]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Count what renders a technique, or compiles its shaders, as slow."""
    for item in items:
        if Path(__file__).parent in item.path.parents and {"gl", "session"} & set(getattr(item, "fixturenames", ())):
            item.add_marker("slow")


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


@pytest.fixture(scope="session")
def session(gl: Any) -> Iterator[rg.Session]:
    """The session that pictures of nodes are drawn in; `gl` is a bare context here."""
    with rg.Session() as made:
        yield made


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
        defines = dict(defines or {})
        plugged = {name: value for name, value in defines.items() if isinstance(value, Path)}
        text = "".join(resolver.expand(folder_of_includes / name, plugged=plugged).text for name in includes.split())
        macros = "".join(f"#define {name} {value}\n" for name, value in defines.items() if name not in plugged)
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
    """Macros of the lighting node for one shading model, and the include that it is."""

    def make(shading: str, **more: object) -> dict[str, object]:
        model = folder("rendergraph.shaders") / "include" / "shading" / f"{shading}.glsl"
        said = {f"NEEDS_{need}".upper(): 1 for need in needs(model)}
        return {"SHADING": model, **said, "SMITH_EXACT": 0, "SMITH_FAST": 1, "SMITH": 0, "MATERIAL_COUNT": 1} | more

    return make
