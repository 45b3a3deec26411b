"""The OpenGL functions moderngl does not offer, as a small table over the driver's own loader.

PyOpenGL would do the same at 0.13 s of import time; these prototypes take well under a millisecond.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

_U, _I, _F, _P, _S = ctypes.c_uint, ctypes.c_int, ctypes.c_float, ctypes.c_void_p, ctypes.c_ssize_t

PROTOTYPES: dict[str, tuple[Any, ...]] = {  # name: result, then arguments
    "glCreateTextures": (None, _U, _I, _P),
    "glGenTextures": (None, _I, _P),
    "glDeleteTextures": (None, _I, _P),
    "glTextureStorage2D": (None, _U, _I, _U, _I, _I),
    "glTextureStorage3D": (None, _U, _I, _U, _I, _I, _I),
    "glTextureStorage2DMultisample": (None, _U, _I, _U, _I, _I, ctypes.c_ubyte),
    "glTextureStorage3DMultisample": (None, _U, _I, _U, _I, _I, _I, ctypes.c_ubyte),
    "glCreateMemoryObjectsEXT": (None, _I, _P),
    "glDeleteMemoryObjectsEXT": (None, _I, _P),
    "glImportMemoryFdEXT": (None, _U, ctypes.c_uint64, _U, _I),
    "glTextureStorageMem2DEXT": (None, _U, _I, _U, _I, _I, _U, ctypes.c_uint64),
    "glTextureStorageMem3DEXT": (None, _U, _I, _U, _I, _I, _I, _U, ctypes.c_uint64),
    "glTextureStorageMem2DMultisampleEXT": (None, _U, _I, _U, _I, _I, ctypes.c_ubyte, _U, ctypes.c_uint64),
    "glTextureStorageMem3DMultisampleEXT": (None, _U, _I, _U, _I, _I, _I, ctypes.c_ubyte, _U, ctypes.c_uint64),
    "glGetUnsignedBytei_vEXT": (None, _U, _U, _P),
    "glTextureView": (None, _U, _U, _U, _U, _U, _U, _U, _U),
    "glTextureParameteri": (None, _U, _U, _I),
    "glTextureSubImage2D": (None, _U, _I, _I, _I, _I, _I, _U, _U, _P),
    "glTextureSubImage3D": (None, _U, _I, _I, _I, _I, _I, _I, _I, _U, _U, _P),
    "glGenerateTextureMipmap": (None, _U),
    "glGetTextureSubImage": (None, _U, _I, _I, _I, _I, _I, _I, _I, _U, _U, _I, _P),
    "glCopyImageSubData": (None, _U, _U, _I, _I, _I, _I, _U, _U, _I, _I, _I, _I, _I, _I, _I),
    "glClearTexSubImage": (None, _U, _I, _I, _I, _I, _I, _I, _I, _U, _U, _P),
    "glClearNamedBufferData": (None, _U, _U, _U, _U, _P),
    "glActiveTexture": (None, _U),
    "glBindTexture": (None, _U, _U),
    "glBindTextureUnit": (None, _U, _U),
    "glBindTextures": (None, _U, _I, _P),
    "glBindSamplers": (None, _U, _I, _P),
    "glBindSampler": (None, _U, _U),
    "glBindImageTexture": (None, _U, _U, _I, ctypes.c_ubyte, _I, _U, _U),
    "glCreateSamplers": (None, _I, _P),
    "glDeleteSamplers": (None, _I, _P),
    "glSamplerParameteri": (None, _U, _U, _I),
    "glSamplerParameterfv": (None, _U, _U, _P),
    "glCreateFramebuffers": (None, _I, _P),
    "glDeleteFramebuffers": (None, _I, _P),
    "glBlitNamedFramebuffer": (None, _U, _U, *[_I] * 8, _U, _U),
    "glNamedFramebufferTexture": (None, _U, _U, _U, _I),
    "glNamedFramebufferTextureLayer": (None, _U, _U, _U, _I, _I),
    "glCheckNamedFramebufferStatus": (_U, _U, _U),
    "glClearNamedFramebufferfv": (None, _U, _U, _I, _P),
    "glClearNamedFramebufferuiv": (None, _U, _U, _I, _P),
    "glClearNamedFramebufferiv": (None, _U, _U, _I, _P),
    "glGetProgramResourceiv": (None, _U, _U, _U, _I, _P, _I, _P, _P),
    "glProgramUniform1fv": (None, _U, _I, _I, _P),
    "glProgramUniform2fv": (None, _U, _I, _I, _P),
    "glProgramUniform3fv": (None, _U, _I, _I, _P),
    "glProgramUniform4fv": (None, _U, _I, _I, _P),
    "glProgramUniform1iv": (None, _U, _I, _I, _P),
    "glProgramUniform2iv": (None, _U, _I, _I, _P),
    "glProgramUniform3iv": (None, _U, _I, _I, _P),
    "glProgramUniform4iv": (None, _U, _I, _I, _P),
    "glProgramUniform1uiv": (None, _U, _I, _I, _P),
    "glProgramUniform2uiv": (None, _U, _I, _I, _P),
    "glProgramUniform3uiv": (None, _U, _I, _I, _P),
    "glProgramUniform4uiv": (None, _U, _I, _I, _P),
    "glProgramUniformMatrix2fv": (None, _U, _I, _I, ctypes.c_ubyte, _P),
    "glProgramUniformMatrix3fv": (None, _U, _I, _I, ctypes.c_ubyte, _P),
    "glProgramUniformMatrix4fv": (None, _U, _I, _I, ctypes.c_ubyte, _P),
    "glProgramUniform1i": (None, _U, _I, _I),
    "glGetProgramiv": (None, _U, _U, _P),
    "glGetProgramInterfaceiv": (None, _U, _U, _U, _P),
    "glGetProgramResourceName": (None, _U, _U, _U, _I, _P, _P),
    "glShaderStorageBlockBinding": (None, _U, _U, _U),
    "glUniformBlockBinding": (None, _U, _U, _U),
    "glEnable": (None, _U),
    "glDisable": (None, _U),
    "glEnablei": (None, _U, _U),
    "glDisablei": (None, _U, _U),
    "glBlendFuncSeparatei": (None, _U, _U, _U, _U, _U),
    "glIsEnabled": (ctypes.c_ubyte, _U),
    "glIsEnabledi": (ctypes.c_ubyte, _U, _U),
    "glBlendEquationi": (None, _U, _U),
    "glBlendEquationSeparatei": (None, _U, _U, _U),
    "glColorMaski": (None, _U, *[ctypes.c_ubyte] * 4),
    "glDepthMask": (None, ctypes.c_ubyte),
    "glDepthRangeIndexed": (None, _U, ctypes.c_double, ctypes.c_double),
    "glViewportIndexedf": (None, _U, _F, _F, _F, _F),
    "glScissorIndexed": (None, _U, _I, _I, _I, _I),
    "glClipControl": (None, _U, _U),
    "glProvokingVertex": (None, _U),
    "glPointParameteri": (None, _U, _I),
    "glHint": (None, _U, _U),
    "glLineWidth": (None, _F),
    "glDepthBoundsEXT": (None, ctypes.c_double, ctypes.c_double),
    "glDepthFunc": (None, _U),
    "glCullFace": (None, _U),
    "glFrontFace": (None, _U),
    "glPolygonMode": (None, _U, _U),
    "glPolygonOffset": (None, _F, _F),
    "glStencilFuncSeparate": (None, _U, _U, _I, _U),
    "glStencilOpSeparate": (None, _U, _U, _U, _U),
    "glStencilMaskSeparate": (None, _U, _U),
    "glUseProgram": (None, _U),
    "glBindVertexArray": (None, _U),
    "glBindFramebuffer": (None, _U, _U),
    "glBindRenderbuffer": (None, _U, _U),
    "glBindTransformFeedback": (None, _U, _U),
    "glPauseTransformFeedback": (None,),
    "glResumeTransformFeedback": (None,),
    "glBeginConditionalRender": (None, _U, _U),
    "glEndConditionalRender": (None,),
    "glMemoryBarrier": (None, _U),
    "glPixelStorei": (None, _U, _I),
    "glBindBuffer": (None, _U, _U),
    "glBindBufferBase": (None, _U, _U, _U),
    "glBindBufferRange": (None, _U, _U, _U, _S, _S),
    "glCreateQueries": (None, _U, _I, _P),
    "glDeleteQueries": (None, _I, _P),
    "glBeginQuery": (None, _U, _U),
    "glEndQuery": (None, _U),
    "glGetQueryObjectui64v": (None, _U, _U, _P),
    "glGetQueryiv": (None, _U, _U, _P),
    "glGetIntegerv": (None, _U, _P),
    "glGetIntegeri_v": (None, _U, _U, _P),
    "glGetInteger64i_v": (None, _U, _U, _P),
    "glGetDoublev": (None, _U, _P),
    "glGetDoublei_v": (None, _U, _U, _P),
    "glGetMultisamplefv": (None, _U, _U, _P),
    "glGetError": (_U,),
    "glIsTexture": (ctypes.c_ubyte, _U),
    "glIsBuffer": (ctypes.c_ubyte, _U),
    "glIsFramebuffer": (ctypes.c_ubyte, _U),
    "glIsVertexArray": (ctypes.c_ubyte, _U),
    "glIsSampler": (ctypes.c_ubyte, _U),
    "glIsProgram": (ctypes.c_ubyte, _U),
    "glIsShader": (ctypes.c_ubyte, _U),
    "glCreateProgram": (_U,),
    "glDeleteProgram": (None, _U),
    "glDeleteShader": (None, _U),
    "glIsQuery": (ctypes.c_ubyte, _U),
    "glIsRenderbuffer": (ctypes.c_ubyte, _U),
}


class RawGL:
    """Raw functions by name, without moderngl's checks: `raw.glDepthFunc(0x0203)`.

    A function the driver lacks is an AttributeError when it is first asked for.
    """

    def __init__(self, load: Callable[[str], int]) -> None:
        self._load = load

    def __getattr__(self, name: str) -> Any:
        if name not in PROTOTYPES:
            raise AttributeError(name)
        address = self._load(name)
        if not address:
            raise AttributeError(f"this driver has no {name}")
        result, *arguments = PROTOTYPES[name]
        function = ctypes.CFUNCTYPE(result, *arguments)(address)
        setattr(self, name, function)  # found once: the next look-up never comes here
        return function

    def make(self, function: str, *arguments: int) -> int:
        """The one name that a `glCreate…` or `glGen…` function returns."""
        name = _U()
        getattr(self, function)(*arguments, 1, ctypes.byref(name))
        return name.value

    def delete(self, function: str, name: int) -> None:
        """Delete one name."""
        getattr(self, function)(1, ctypes.byref(_U(name)))

    def integer(self, parameter: int) -> int:
        """`glGetIntegerv` of one value."""
        value = _I()
        self.glGetIntegerv(parameter, ctypes.byref(value))
        return value.value

    def integer_at(self, parameter: int, index: int) -> int:
        """`glGetIntegeri_v` of one value."""
        value = _I()
        self.glGetIntegeri_v(parameter, index, ctypes.byref(value))
        return value.value

    def current_query(self, target: int) -> int:
        """The query of a target that has begun, 0 where none has."""
        value = _I()
        self.glGetQueryiv(target, 0x8865, ctypes.byref(value))
        return value.value

    def error(self) -> str | None:
        """The first pending GL error's name, None where there is none; clears them all."""
        first: int = self.glGetError()
        code = first
        while code:
            code = self.glGetError()
        names = {
            0x500: "INVALID_ENUM",
            0x501: "INVALID_VALUE",
            0x502: "INVALID_OPERATION",
            0x503: "STACK_OVERFLOW",
            0x504: "STACK_UNDERFLOW",
            0x505: "OUT_OF_MEMORY",
            0x506: "INVALID_FRAMEBUFFER_OPERATION",
        }
        return names.get(first, hex(first)) if first else None
