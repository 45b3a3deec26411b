"""Names that a driver does not take for a variable are refused where a port or parameter is declared."""

from __future__ import annotations

import moderngl

import rendergraph as rg
from rendergraph.declare import RESERVED_NAMES

WORDS = """
    active asm atomic_uint attribute binding bool break buffer bvec2 case cast centroid class coherent column_major common
    component const continue default demote discard dmat2 dmat2x2 dmat2x3 dmat2x4 dmat3 dmat3x2 dmat3x3 dmat3x4 dmat4
    dmat4x2 dmat4x3 dmat4x4 do double dvec2 dvec3 dvec4 else enum extern external false far filter fixed flat float for
    fvec2 fvec3 fvec4 goto half hvec2 hvec3 hvec4 if in index inline inout input int interface invariant ivec2 layout line
    lines location long lowp mat2 mat2x2 mat2x3 mat2x4 mat3 mat3x2 mat3x3 mat3x4 mat4 mat4x2 mat4x3 mat4x4 mediump
    namespace near noinline noperspective offset out output packed partition patch point points precise precision public
    readonly resource restrict return row_major sample shared short sizeof smooth static std140 std430 struct subroutine
    superp switch template texture this triangle triangles true typedef uint uniform union unsigned using uvec2 varying
    vec2 void volatile while writeonly
""".split()  # noqa: SIM905 - a list of so many words reads best as text
"""Words of GLSL of all versions that a name of a port, in lower case, could be."""


def test_what_the_driver_refuses_is_reserved(gl: rg.Session) -> None:
    refused = set()
    vertex = "#version 450 core\nvoid main() { gl_Position = vec4(0); }"
    with gl.device.current():
        for word in WORDS:
            text = f"#version 450 core\nuniform float {word}; out vec4 o; void main() {{ o = vec4({word}); }}"
            try:
                gl.device.ctx.program(vertex_shader=vertex, fragment_shader=text).release()
            except moderngl.Error:
                refused.add(word)
    assert "packed" in refused
    assert refused <= RESERVED_NAMES
