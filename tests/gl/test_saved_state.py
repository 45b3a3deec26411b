"""A context that is borrowed: its owner's state changes no picture, and is found again afterwards."""

from __future__ import annotations

import ctypes
import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest

import rendergraph as rg
from rendergraph.api import Any as AnyTexel
from rendergraph.api import Blend, Depth, Internal, Node, Output, State, Stencil, StencilFace, Steps
from rendergraph.catalog import Catalog
from rendergraph.errors import RenderError
from rendergraph.gl.raw import RawGL
from rendergraph.images import write

U, I, F, P = ctypes.c_uint, ctypes.c_int, ctypes.c_float, ctypes.c_void_p  # noqa: E741  # GL's own letters

# The lists below are written from the state tables of the OpenGL 4.5 specification (chapter 23), not from the module
# that is tested, so that what that module forgets is seen.
CAPABILITIES = {
    "CLIP_DISTANCE0": 0x3000,
    "CLIP_DISTANCE1": 0x3001,
    "CLIP_DISTANCE5": 0x3005,
    "CLIP_DISTANCE7": 0x3007,
    "COLOR_LOGIC_OP": 0x0BF2,
    "CULL_FACE": 0x0B44,
    "DEPTH_CLAMP": 0x864F,
    "DEPTH_TEST": 0x0B71,
    "DITHER": 0x0BD0,
    "FRAMEBUFFER_SRGB": 0x8DB9,
    "LINE_SMOOTH": 0x0B20,
    "MULTISAMPLE": 0x809D,
    "POLYGON_OFFSET_FILL": 0x8037,
    "POLYGON_OFFSET_LINE": 0x2A02,
    "POLYGON_OFFSET_POINT": 0x2A01,
    "POLYGON_SMOOTH": 0x0B41,
    "PRIMITIVE_RESTART": 0x8F9D,
    "PRIMITIVE_RESTART_FIXED_INDEX": 0x8D69,
    "PROGRAM_POINT_SIZE": 0x8642,
    "RASTERIZER_DISCARD": 0x8C89,
    "SAMPLE_ALPHA_TO_COVERAGE": 0x809E,
    "SAMPLE_ALPHA_TO_ONE": 0x809F,
    "SAMPLE_COVERAGE": 0x80A0,
    "SAMPLE_MASK": 0x8E51,
    "SAMPLE_SHADING": 0x8C36,
    "STENCIL_TEST": 0x0B90,
    "TEXTURE_CUBE_MAP_SEAMLESS": 0x884F,
}
NUMBERS = {  # parameter, how many values
    "ACTIVE_TEXTURE": (0x84E0, 1),
    "ARRAY_BUFFER": (0x8894, 1),
    "ATOMIC_COUNTER_BUFFER": (0x92C1, 1),
    "BLEND_COLOR": (0x8005, 4),
    "CLIP_DEPTH_MODE": (0x935D, 1),
    "CLIP_ORIGIN": (0x935C, 1),
    "COLOR_CLEAR_VALUE": (0x0C22, 4),
    "COPY_READ_BUFFER": (0x8F36, 1),
    "COPY_WRITE_BUFFER": (0x8F37, 1),
    "CULL_FACE_MODE": (0x0B45, 1),
    "CURRENT_PROGRAM": (0x8B8D, 1),
    "DEPTH_CLEAR_VALUE": (0x0B73, 1),
    "DEPTH_FUNC": (0x0B74, 1),
    "DEPTH_WRITEMASK": (0x0B72, 1),
    "DISPATCH_INDIRECT_BUFFER": (0x90EF, 1),
    "DRAW_FRAMEBUFFER": (0x8CA6, 1),
    "DRAW_INDIRECT_BUFFER": (0x8F43, 1),
    "FRAGMENT_DERIVATIVE_HINT": (0x8B8B, 1),
    "FRONT_FACE": (0x0B46, 1),
    "LINE_WIDTH": (0x0B21, 1),
    "LOGIC_OP_MODE": (0x0BF0, 1),
    "MIN_SAMPLE_SHADING": (0x8C37, 1),
    "PACK_ALIGNMENT": (0x0D05, 1),
    "PACK_IMAGE_HEIGHT": (0x806C, 1),
    "PACK_LSB_FIRST": (0x0D01, 1),
    "PACK_ROW_LENGTH": (0x0D02, 1),
    "PACK_SKIP_IMAGES": (0x806B, 1),
    "PACK_SKIP_PIXELS": (0x0D04, 1),
    "PACK_SKIP_ROWS": (0x0D03, 1),
    "PACK_SWAP_BYTES": (0x0D00, 1),
    "PATCH_VERTICES": (0x8E72, 1),
    "PIXEL_PACK_BUFFER": (0x88ED, 1),
    "PIXEL_UNPACK_BUFFER": (0x88EF, 1),
    "POINT_SIZE": (0x0B11, 1),
    "POINT_SPRITE_COORD_ORIGIN": (0x8CA0, 1),
    "POLYGON_MODE": (0x0B40, 2),
    "POLYGON_OFFSET_FACTOR": (0x8038, 1),
    "POLYGON_OFFSET_UNITS": (0x2A00, 1),
    "PRIMITIVE_RESTART_INDEX": (0x8F9E, 1),
    "PROGRAM_PIPELINE": (0x825A, 1),
    "PROVOKING_VERTEX": (0x8E4F, 1),
    "QUERY_BUFFER": (0x9193, 1),
    "READ_FRAMEBUFFER": (0x8CAA, 1),
    "RENDERBUFFER": (0x8CA7, 1),
    "SAMPLE_COVERAGE_INVERT": (0x80AB, 1),
    "SAMPLE_COVERAGE_VALUE": (0x80AA, 1),
    "SHADER_STORAGE_BUFFER": (0x90D3, 1),
    "STENCIL_BACK_FAIL": (0x8801, 1),
    "STENCIL_BACK_FUNC": (0x8800, 1),
    "STENCIL_BACK_PASS": (0x8803, 1),
    "STENCIL_BACK_REF": (0x8CA3, 1),
    "STENCIL_BACK_VALUE_MASK": (0x8CA4, 1),
    "STENCIL_BACK_WRITEMASK": (0x8CA5, 1),
    "STENCIL_BACK_ZFAIL": (0x8802, 1),
    "STENCIL_CLEAR_VALUE": (0x0B91, 1),
    "STENCIL_FAIL": (0x0B94, 1),
    "STENCIL_FUNC": (0x0B92, 1),
    "STENCIL_PASS": (0x0B96, 1),
    "STENCIL_REF": (0x0B97, 1),
    "STENCIL_VALUE_MASK": (0x0B93, 1),
    "STENCIL_WRITEMASK": (0x0B98, 1),
    "STENCIL_ZFAIL": (0x0B95, 1),
    "TEXTURE_BUFFER": (0x8C2A, 1),
    "TRANSFORM_FEEDBACK": (0x8E25, 1),
    "TRANSFORM_FEEDBACK_ACTIVE": (0x8E24, 1),
    "TRANSFORM_FEEDBACK_PAUSED": (0x8E23, 1),
    "UNIFORM_BUFFER": (0x8A28, 1),
    "UNPACK_ALIGNMENT": (0x0CF5, 1),
    "UNPACK_IMAGE_HEIGHT": (0x806E, 1),
    "UNPACK_LSB_FIRST": (0x0CF1, 1),
    "UNPACK_ROW_LENGTH": (0x0CF2, 1),
    "UNPACK_SKIP_IMAGES": (0x806D, 1),
    "UNPACK_SKIP_PIXELS": (0x0CF4, 1),
    "UNPACK_SKIP_ROWS": (0x0CF3, 1),
    "UNPACK_SWAP_BYTES": (0x0CF0, 1),
    "VERTEX_ARRAY": (0x85B5, 1),
}
INDEXED = {  # parameter, values, indices
    "BLEND_DST_ALPHA": (0x80CA, 1, 8),
    "BLEND_DST_RGB": (0x80C8, 1, 8),
    "BLEND_EQUATION_ALPHA": (0x883D, 1, 8),
    "BLEND_EQUATION_RGB": (0x8009, 1, 8),
    "BLEND_SRC_ALPHA": (0x80CB, 1, 8),
    "BLEND_SRC_RGB": (0x80C9, 1, 8),
    "COLOR_WRITEMASK": (0x0C23, 4, 8),
    "DEPTH_RANGE": (0x0B70, 2, 16),
    "IMAGE_ACCESS": (0x8F3E, 1, 8),
    "IMAGE_FORMAT": (0x906E, 1, 8),
    "IMAGE_LAYER": (0x8F3D, 1, 8),
    "IMAGE_LAYERED": (0x8F3C, 1, 8),
    "IMAGE_LEVEL": (0x8F3B, 1, 8),
    "IMAGE_NAME": (0x8F3A, 1, 8),
    "SAMPLE_MASK_VALUE": (0x8E52, 1, 1),
    "SCISSOR_BOX": (0x0C10, 4, 16),
    "SHADER_STORAGE_BINDING": (0x90D3, 1, 16),
    "SHADER_STORAGE_SIZE": (0x90D5, 1, 16),
    "SHADER_STORAGE_START": (0x90D4, 1, 16),
    "UNIFORM_BINDING": (0x8A28, 1, 36),
    "UNIFORM_SIZE": (0x8A2A, 1, 36),
    "UNIFORM_START": (0x8A29, 1, 36),
    "VIEWPORT": (0x0BA2, 4, 16),
}
TARGETS = {0x0DE0: 0x8068, 0x0DE1: 0x8069, 0x806F: 0x806A, 0x8C1A: 0x8C1D, 0x8513: 0x8514, 0x9009: 0x900A}
UNITS = (0, 1, 2, 3, 7, 40, 100)


class Owner:
    """The owner of a context: sets what it likes, and looks at what is set."""

    def __init__(self, ctx: moderngl.Context, raw: RawGL) -> None:
        self.ctx, self.raw = ctx, raw
        self.textures = {target: raw.make("glCreateTextures", target) for target in TARGETS}
        raw.glTextureStorage2D(self.textures[0x0DE1], 2, 0x8058, 8, 8)
        self.buffers = [ctx.buffer(reserve=1024) for _ in range(4)]
        self.framebuffers = [ctx.simple_framebuffer((8, 8)) for _ in range(2)]
        self.sampler = raw.make("glCreateSamplers")
        self.program = ctx.program(
            vertex_shader="#version 450\nout float x; void main() { x = 1; gl_Position = vec4(0); }", varyings=("x",)
        )
        self.array = ctx.vertex_array(self.program, [])
        self.feedback = self.name("glCreateTransformFeedbacks")
        self.pipeline = self.name("glCreateProgramPipelines")

    def call(self, name: str, *arguments: Any) -> None:
        """Call a GL function; Python floats are floats, anything else a number of 32 bits."""
        types = [F if isinstance(a, float) else P if a is None or isinstance(a, ctypes.Array) else U for a in arguments]
        ctypes.CFUNCTYPE(None, *types)(self.raw._load(name))(*arguments)

    def name(self, function: str) -> int:
        made = (U * 1)()
        self.call(function, 1, made)
        return made[0]

    def state(self) -> dict[str, Any]:
        """Everything that the specification lets one ask for, near enough."""
        raw, found = self.raw, {}
        values = (ctypes.c_double * 4)()
        whole, wide = (ctypes.c_int * 4)(), (ctypes.c_int64 * 4)()
        for name, capability in CAPABILITIES.items():
            found[name] = raw.glIsEnabled(capability)
        for name, (parameter, count) in NUMBERS.items():
            raw.glGetDoublev(parameter, ctypes.byref(values))
            found[name] = tuple(values[:count])
        for name, (parameter, count, indices) in INDEXED.items():
            for index in range(indices):
                if name in ("DEPTH_RANGE", "VIEWPORT"):
                    raw.glGetDoublei_v(parameter, index, ctypes.byref(values))
                    found[f"{name} {index}"] = tuple(values[:count])
                elif name.endswith(("SIZE", "START")):
                    raw.glGetInteger64i_v(parameter, index, ctypes.byref(wide))
                    found[f"{name} {index}"] = tuple(wide[:count])
                else:
                    raw.glGetIntegeri_v(parameter, index, ctypes.byref(whole))
                    found[f"{name} {index}"] = tuple(whole[:count])
        for index in range(8):
            found[f"BLEND {index}"] = raw.glIsEnabledi(0x0BE2, index)
        for index in range(16):
            found[f"SCISSOR_TEST {index}"] = raw.glIsEnabledi(0x0C11, index)
        active = raw.integer(0x84E0)
        for unit in UNITS:
            raw.glActiveTexture(0x84C0 + unit)
            found[f"SAMPLER {unit}"] = raw.integer(0x8919)
            found |= {f"TEXTURE {target:#x} {unit}": raw.integer(parameter) for target, parameter in TARGETS.items()}
        raw.glActiveTexture(active)
        found["moderngl's framebuffer"] = id(self.ctx.fbo)
        assert raw.error() is None
        return found

    def disturb(self, seed: int) -> None:
        """Set all of it at random."""
        raw, rng = self.raw, random.Random(seed)
        compare = [0x200 + n for n in range(8)]
        operations = [0x1E00, 0x1E01, 0x1E02, 0x1E03, 0x150A, 0]
        factors = [0, 1, 0x300, 0x302, 0x303, 0x306]
        self.framebuffers[0].use()
        for capability in CAPABILITIES.values():
            (raw.glEnable if rng.random() < 0.6 else raw.glDisable)(capability)
        for index in range(8):
            (raw.glEnablei if rng.random() < 0.5 else raw.glDisablei)(0x0BE2, index)
            raw.glBlendFuncSeparatei(index, *(rng.choice(factors) for _ in range(4)))
            raw.glBlendEquationSeparatei(index, rng.choice((0x8006, 0x8007, 0x800A)), rng.choice((0x8006, 0x8008)))
            raw.glColorMaski(index, *(rng.randrange(2) for _ in range(4)))
        for index in range(16):
            (raw.glEnablei if rng.random() < 0.5 else raw.glDisablei)(0x0C11, index)
            raw.glScissorIndexed(index, *(rng.randrange(1, 9) for _ in range(4)))
            raw.glViewportIndexedf(index, *(float(rng.randrange(1, 9)) for _ in range(4)))
            raw.glDepthRangeIndexed(index, rng.choice((0.0, 0.25)), rng.choice((0.5, 1.0)))
        raw.glClipControl(rng.choice((0x8CA1, 0x8CA2)), rng.choice((0x935E, 0x935F)))
        raw.glProvokingVertex(rng.choice((0x8E4D, 0x8E4E)))
        raw.glPointParameteri(0x8CA0, rng.choice((0x8CA1, 0x8CA2)))
        raw.glHint(0x8B8B, rng.choice((0x1100, 0x1101, 0x1102)))
        raw.glLineWidth(rng.choice((1.0, 2.0)))
        raw.glDepthFunc(rng.choice(compare))
        raw.glDepthMask(rng.randrange(2))
        raw.glCullFace(rng.choice((0x404, 0x405, 0x408)))
        raw.glFrontFace(rng.choice((0x900, 0x901)))
        raw.glPolygonMode(0x408, rng.choice((0x1B00, 0x1B01, 0x1B02)))
        raw.glPolygonOffset(rng.random(), rng.random())
        for face in (0x404, 0x405):
            raw.glStencilFuncSeparate(face, rng.choice(compare), rng.randrange(9), rng.randrange(256))
            raw.glStencilOpSeparate(face, *(rng.choice(operations) for _ in range(3)))
            raw.glStencilMaskSeparate(face, rng.randrange(256))
        for parameter in (0x0D00, 0x0D01, 0x0CF0, 0x0CF1):  # swapped bytes, first bit
            raw.glPixelStorei(parameter, rng.randrange(2))
        for parameter in (0x0D02, 0x0D03, 0x0D04, 0x806B, 0x806C, 0x0CF2, 0x0CF3, 0x0CF4, 0x806D, 0x806E):
            raw.glPixelStorei(parameter, rng.choice((0, 3, 50)))
        for parameter in (0x0D05, 0x0CF5):  # alignment
            raw.glPixelStorei(parameter, rng.choice((1, 2, 4, 8)))
        self.call("glLogicOp", rng.choice((0x1500, 0x150A)))
        self.call("glSampleCoverage", rng.random(), rng.randrange(2))
        self.call("glSampleMaski", 0, rng.randrange(4))
        self.call("glMinSampleShading", rng.random())
        self.call("glPrimitiveRestartIndex", rng.choice((0, 1, 2)))
        self.call("glPatchParameteri", 0x8E72, rng.choice((3, 4)))
        self.call("glBlendColor", *(rng.random() for _ in range(4)))
        self.call("glClearColor", *(rng.random() for _ in range(4)))
        for target in (0x8892, 0x8F36, 0x8F37, 0x8F3F, 0x90EE, 0x8A11, 0x90D2, 0x88EB, 0x88EC, 0x9192, 0x8C2A):
            raw.glBindBuffer(target, rng.choice((0, *(buffer.glo for buffer in self.buffers))))
        for target in (0x8A11, 0x90D2):
            for index in range(12):
                buffer = rng.choice(self.buffers).glo
                if rng.random() < 0.5:
                    raw.glBindBufferBase(target, index, buffer)
                else:
                    raw.glBindBufferRange(target, index, buffer, 256, 512)
        for unit in UNITS:
            for target, texture in self.textures.items():
                raw.glActiveTexture(0x84C0 + unit)
                raw.glBindTexture(target, rng.choice((0, texture)))
            raw.glBindSampler(unit, rng.choice((0, self.sampler)))
        raw.glActiveTexture(0x84C0 + rng.choice(UNITS))
        for unit in range(8):
            if rng.random() < 0.5:
                level = rng.randrange(2)
                raw.glBindImageTexture(unit, self.textures[0x0DE1], level, 0, 0, rng.choice((0x88B8, 0x88BA)), 0x8058)
        raw.glBindFramebuffer(0x8CA8, self.framebuffers[1].glo)
        raw.glBindRenderbuffer(0x8D41, self.ctx.renderbuffer((4, 4)).glo)
        self.call("glBindProgramPipeline", rng.choice((0, self.pipeline)))
        raw.glUseProgram(self.program.glo)
        raw.glBindVertexArray(self.array.glo)
        raw.glBindTransformFeedback(0x8E22, self.feedback)
        raw.glBindBufferBase(0x8C8E, 0, self.buffers[3].glo)
        self.call("glBeginTransformFeedback", 0)  # POINTS
        if rng.random() < 0.5:
            raw.glPauseTransformFeedback()
        assert raw.error() is None

    def calm(self) -> None:
        """End what must not be under way when something else is set."""
        if self.raw.integer(0x8E23):
            self.raw.glResumeTransformFeedback()
        self.call("glEndTransformFeedback")


@pytest.fixture
def borrowed() -> Iterator[tuple[rg.Session, Owner]]:
    ctx = moderngl.create_context(standalone=True, backend="egl", require=450)  # type: ignore[arg-type]  # its stub knows only dicts
    session = rg.Session(ctx=ctx)
    yield session, Owner(ctx, session.device.raw)
    session.close()
    ctx.release()


class Everything(Node):
    """Steps that state everything a step can state, and shaders that feel what none of them states."""

    color = Output(AnyTexel, format="rgba16f", clear=0.25, doc="What is drawn.")
    bytes8 = Output(AnyTexel, format="rgba8", doc="Bytes.")
    deep = Internal(Depth, format="depth24_stencil8", clear=0.0)

    def record(self, steps: Steps) -> None:
        targets = {"color": self.color, "deep": self.deep}
        mark = Stencil(StencilFace("always", 5, 0x7F, 0x3F, depth_pass="replace", depth_fail="invert"))
        steps.draw(
            "flat.frag",
            vertex="strip.vert",
            vertices=6,
            topology="triangle_strip",
            out=targets,
            state=State(stencil=mark, polygon_offset=(1.5, 2.0), cull="none"),
        )
        steps.draw(
            "point.frag",
            vertex="point.vert",
            vertices=3,
            topology="points",
            out=targets,
            state=State(blend=Blend("src_alpha", "dst_alpha", "one", "zero", op="reverse_subtract")),
        )
        steps.draw(
            "flat.frag",
            vertex="strip.vert",
            vertices=4,
            topology="line_strip",
            out=targets,
            state=State(wireframe=True, depth_clamp=True, depth_func="always"),
        )
        steps.fullscreen("where.frag", out=targets, state=State(stencil=Stencil(StencilFace("equal", 5, 0x3F))))
        steps.compute("store.comp", groups=(5, 3, 1), out=self.bytes8)


SHADERS = {
    "strip.vert": """flat out vec4 tint;
        void main() {
            tint = vec4(gl_VertexID, gl_VertexID * gl_VertexID, 1, 8) / 8.0;
            gl_Position = vec4(gl_VertexID / 3.0 - 0.8, (gl_VertexID & 1) * 1.2 - 0.7, gl_VertexID * 0.3 - 0.5, 1);
        }""",
    "point.vert": """void main() {
            gl_PointSize = 9.0;
            gl_Position = vec4(gl_VertexID * 0.5 - 0.5, 0.3, 0.1, 1);
        }""",
    "flat.frag": "flat in vec4 tint; out vec4 color; void main() { color = tint * gl_FragCoord.z; }",
    "point.frag": "out vec4 color; void main() { color = vec4(gl_PointCoord, 0.5, 0.75); }",
    "where.frag": "out vec4 color; void main() { color = vec4(gl_FragCoord.xy * 0.03, 1, 1); }",
    "store.comp": """layout(local_size_x = 8, local_size_y = 8) in;
        layout(rgba8) uniform writeonly image2D bytes8;
        void main() { imageStore(bytes8, ivec2(gl_GlobalInvocationID.xy), vec4(gl_GlobalInvocationID.xyz, 9) / 40.0); }
        """,
}
SCENE = """scene: 1
objects: {floor: {shape: plane, size: [4, 4], material: checked}}
materials: {checked: {base_color_texture: checked.png}}
"""


@pytest.fixture
def pictures(tmp_path: Path) -> dict[str, rg.Pipeline]:
    """Pipelines that together use everything a session does to a context."""
    for name, text in SHADERS.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "scene.yaml").write_text(SCENE)
    write(tmp_path / "checked.png", np.random.default_rng(1).integers(0, 256, (6, 6, 3), np.uint8))
    (tmp_path / "all.yaml").write_text(
        "rendergraph: 1\nsize: [40, 24]\nnodes: {all: {type: everything}}\n"
        "outputs: {image: all.color, bytes8: all.bytes8}"
    )
    everything = replace(rg.load(tmp_path / "all.yaml"), catalog=Catalog.of(Everything, shaders=tmp_path))
    return {"all": everything, "deferred": rg.load("deferred", size=(40, 24), scene=tmp_path / "scene.yaml")}


FORWARD = rg.load("forward", size=(40, 24))


@pytest.mark.slow
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("seed", range(8))
def test_the_owners_state_changes_no_picture_and_is_found_again(
    seed: int, gl: rg.Session, borrowed: tuple[rg.Session, Owner], pictures: dict[str, rg.Pipeline]
) -> None:
    session, owner = borrowed
    for name, pipeline in pictures.items():
        expected = gl.render(pipeline)
        owner.disturb(seed)
        before = owner.state()
        frame = session.render(pipeline)
        assert owner.state() == before
        for output, pixels in frame.arrays.items():
            np.testing.assert_array_equal(pixels, expected[output], err_msg=f"{name}: {output}")
        owner.calm()
    owner.disturb(seed + 100)
    before = owner.state()
    session.close()
    assert owner.state() == before
    owner.calm()


def test_borrowing_changes_nothing() -> None:
    ctx = moderngl.create_context(standalone=True, backend="egl", require=450)  # type: ignore[arg-type]  # its stub knows only dicts
    first = rg.Session(ctx=ctx)
    owner = Owner(ctx, first.device.raw)
    before = owner.state()
    rg.Session(ctx=ctx)
    assert owner.state() == before
    ctx.release()


def test_the_owner_may_set_anything_between_frames(gl: rg.Session, borrowed: tuple[rg.Session, Owner]) -> None:
    session, owner = borrowed
    pipeline = FORWARD
    expected = gl.render(pipeline)
    seen = []
    for frame in session.frames(pipeline, frames=range(1, 4)):
        seen.append(frame["image"])
        for capability in (0x8C89, 0x0BF2, 0x80A0, 0x0B90):  # rasterizer discard, logic op, sample coverage, stencil
            owner.raw.glEnable(capability)
        owner.raw.glPixelStorei(0x0D02, 50)
    for image in seen:
        np.testing.assert_array_equal(image, expected["image"])


def test_the_owners_time_query_goes_on(borrowed: tuple[rg.Session, Owner]) -> None:
    session, owner = borrowed
    pipeline = FORWARD
    query = owner.raw.make("glCreateQueries", 0x88BF)
    owner.raw.glBeginQuery(0x88BF, query)
    frame = session.render(pipeline, timed=True)
    assert {entry["gpu_ms"] for entry in frame.passes} == {None}
    assert owner.raw.current_query(0x88BF) == query
    owner.raw.glEndQuery(0x88BF)
    assert owner.raw.error() is None
    assert None not in {entry["gpu_ms"] for entry in session.render(pipeline, timed=True).passes}


def test_conditional_rendering_is_refused_and_goes_on(borrowed: tuple[rg.Session, Owner]) -> None:
    session, owner = borrowed
    query = owner.raw.make("glCreateQueries", 0x8914)
    owner.raw.glBeginConditionalRender(query, 0x8E13)
    with pytest.raises(RenderError, match="RG618 conditional rendering is active"):
        session.render(FORWARD)
    owner.raw.glEndConditionalRender()
    assert owner.raw.error() is None  # ours would have ended it
    session.render(FORWARD)


def test_an_error_of_the_owners_is_not_taken_for_ours(borrowed: tuple[rg.Session, Owner]) -> None:
    session, owner = borrowed
    owner.raw.glEnable(0xFFFF)
    session.render(FORWARD)
