"""The GL device: opening a context, its identity, its limits and its free memory."""

from __future__ import annotations

import ctypes
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, cached_property
from typing import Any

import moderngl
from msgspec import Struct, field

from rendergraph import system
from rendergraph.errors import DeviceError, Problem, RenderError, UsageError
from rendergraph.gl.raw import RawGL
from rendergraph.system import EGL, GL

REQUIRED_VERSION = 450
TIME_ELAPSED = 0x88BF
MEMORY_LIMIT = "RENDERGRAPH_MEMORY_LIMIT"
SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swrast", "swiftshader")


class Device(Struct, eq=False, dict=True):
    """An OpenGL context with its raw functions.

    Attributes:
        owned: whether `release` ends the context; a borrowed one stays its owner's.
        mips: the program of `fill_mips`, once needed.
    """

    ctx: moderngl.Context
    raw: RawGL
    owned: bool = True
    limits: dict[str, int] = field(default_factory=dict)
    textures_made: int = 0
    mips: moderngl.ComputeShader | None = None
    _idle: moderngl.Framebuffer | None = None
    _sample_positions: dict[int, list[tuple[float, float]]] = field(default_factory=dict)

    def unbind(self) -> None:
        """Bind a framebuffer of the device's own: moderngl rebinds the last one, even if it has been freed."""
        if self._idle is None:
            self._idle = self.ctx.framebuffer([self.ctx.renderbuffer((1, 1))])
        self._idle.use()

    def sample_positions(self, count: int) -> list[tuple[float, float]]:
        """Return the position of each sample in its texel, from 0 to 1, from the bottom left."""
        if count not in self._sample_positions:
            texture = self.ctx.texture((1, 1), 4, samples=count)
            framebuffer = self.ctx.framebuffer([texture])
            framebuffer.use()
            position = (ctypes.c_float * 2)()
            positions = self._sample_positions[count] = []
            for number in range(count):
                self.raw.glGetMultisamplefv(0x8E50, number, ctypes.byref(position))
                positions.append((float(position[0]), float(position[1])))
            self.unbind()
            framebuffer.release()
            texture.release()
        return self._sample_positions[count]

    @contextmanager
    def current(self) -> Iterator[None]:
        """Return a context manager for everything that touches GL.

        It makes an owned context the thread's current one and restores the previous one afterwards. A borrowed one,
        which its owner makes current, is set to what drawing needs and given back as it was.
        """
        if self.owned:
            with previous_context(), self.ctx:
                yield
            return
        from rendergraph.gl.state import SavedState, settle  # only for borrowed contexts

        saved = SavedState(self.raw, self.ctx)
        try:
            settle(self.raw)
            yield
        finally:
            saved.restore()

    @property
    def is_released(self) -> bool:
        """Whether the context has been released, as its owner may do."""
        return not hasattr(self.ctx.mglo, "fbo")

    @property
    def can_time(self) -> bool:
        """Whether a time query can begin: the owner of a borrowed context may have one active."""
        return self.owned or not self.raw.current_query(TIME_ELAPSED)

    @property
    def renderer(self) -> str:
        return str(self.ctx.info["GL_RENDERER"])

    @property
    def software(self) -> bool:
        """Whether it is a rasteriser on the CPU, whose times do not transfer to GPUs."""
        return any(name in self.renderer.lower() for name in SOFTWARE_RENDERERS)

    @cached_property
    def stores_blocks(self) -> bool:
        """Whether a stage may use only few uniform blocks, as on zink over the lavapipe of Mesa before 24.

        To eliminate branches on uniforms, that driver records their offsets in a table with 4 entries per block, but
        indexes it with 32 per block. It numbers push constants 0 and uniforms without a block 1; entries of block 4
        lie beyond the table, and the next draw crashes.
        """
        version = re.search(r"Mesa (\d+)", str(self.ctx.info["GL_VERSION"]))
        return self.renderer.startswith("zink (llvmpipe") and version is not None and int(version[1]) < 24

    def bind_block(self, buffer: moderngl.Buffer, point: int) -> None:
        buffer.bind_to_uniform_block(point)
        if self.stores_blocks:
            buffer.bind_to_storage_buffer(point)

    def as_json(self) -> dict[str, object]:
        """Return the fields that pictures and reports contain."""
        return {
            "renderer": self.renderer,
            "vendor": str(self.ctx.info["GL_VENDOR"]),
            "version": str(self.ctx.info["GL_VERSION"]),
            "software": self.software,
        }

    def release(self) -> None:
        made: list[Any] = [self.mips, *(self._idle.color_attachments if self._idle is not None else ()), self._idle]
        if any(made):
            with self.current():  # otherwise names of another current context would be freed
                for each in filter(None, made):
                    each.release()
            self.mips = self._idle = None
        if self.owned:
            self._make_not_current()
            self.ctx.release()

    def _make_not_current(self) -> None:
        """Make no context current if this one is current, as `current` leaves it if there was none before.

        A driver may reuse the handle of a destroyed context. GLVND skips making a handle current that it considers
        current, and draws are then lost.
        """
        egl = _egl()
        if egl is None or not (before := egl.eglGetCurrentContext()):
            return
        with previous_context(), self.ctx:
            is_own = egl.eglGetCurrentContext() == before
        if is_own:
            egl.eglMakeCurrent(egl.eglGetCurrentDisplay(), None, None, None)


@cache
def first_process() -> int:
    """Return the first process that called this; a fork inherits the answer."""
    return os.getpid()


def open_device(index: int | None = None) -> Device:
    """Open a headless context on the machine's GL device.

    Args:
        index: EGL device number as listed by `doctor`; None for RENDERGRAPH_DEVICE, or else the default.
    """
    if first_process() != os.getpid():
        text = "OpenGL was used before this process was forked, and drivers do not survive a fork; "
        text += "start new processes instead, as multiprocessing does with 'spawn'"
        raise DeviceError(Problem("RG611", text))
    if index is None:
        named = os.environ.get("RENDERGRAPH_DEVICE", "0")
        if not named.isdecimal():
            text = f"RENDERGRAPH_DEVICE is '{named}', not the number of a device as `rendergraph doctor` lists them"
            raise DeviceError(Problem("RG611", text))
        index = int(named)
    try:
        with previous_context():
            from glcontext import egl  # type: ignore[import-untyped]  # ships no types

            # Name the libraries, because glcontext's own search starts two processes.
            names = {
                "libgl": os.environ.get("GLCONTEXT_LINUX_LIBGL") or "libGL.so.1",
                "libegl": os.environ.get("GLCONTEXT_LINUX_LIBEGL") or EGL,
            }
            context = egl.create_context(mode="standalone", glversion=REQUIRED_VERSION, device_index=index, **names)
            ctx = moderngl.create_context(context=context)
            return _wrap(ctx, context.load, owned=True)
    except DeviceError:
        raise
    except Exception as error:  # glcontext raises plain Exception, with a different text for each cause
        text = f"no usable OpenGL 4.5 device: {error}; `rendergraph doctor` says what to install"
        raise DeviceError(Problem("RG611", text)) from error


def borrow_device(ctx: moderngl.Context) -> Device:
    """Return a device for the caller's current context; its state stays the caller's."""
    return _wrap(ctx, _system_loader(), owned=False)


@contextmanager
def previous_context() -> Iterator[None]:
    """Restore the current context afterwards: moderngl leaves its own with no context being current."""
    egl = _egl()
    if egl is None or not (before := egl.eglGetCurrentContext()):
        yield
        return
    display, draw, read = egl.eglGetCurrentDisplay(), egl.eglGetCurrentSurface(0x3059), egl.eglGetCurrentSurface(0x305A)
    try:
        yield
    finally:
        egl.eglMakeCurrent(display, draw, read, before)


@cache
def _egl() -> Any:
    """Return EGL's functions for current contexts; None without EGL."""
    try:
        egl = ctypes.CDLL(EGL)
    except OSError:
        return None
    handle = ctypes.c_void_p
    egl.eglGetCurrentContext.restype = egl.eglGetCurrentDisplay.restype = egl.eglGetCurrentSurface.restype = handle
    egl.eglMakeCurrent.argtypes = [handle] * 4
    return egl


def _system_loader() -> Callable[[str], int]:
    for library, name in ((EGL, "eglGetProcAddress"), (GL, "glXGetProcAddressARB")):
        try:
            function = getattr(ctypes.CDLL(library), name)
        except (OSError, AttributeError):
            continue
        function.argtypes, function.restype = [ctypes.c_char_p], ctypes.c_void_p
        return lambda symbol: function(symbol.encode()) or 0
    text = f"neither {EGL} nor {GL} can be loaded; `rendergraph doctor` says more"
    raise DeviceError(Problem("RG611", text))


def _wrap(ctx: moderngl.Context, load: Any, *, owned: bool) -> Device:
    """Return a device for a context, after checking its version."""
    if ctx.version_code < REQUIRED_VERSION:
        text = f"{ctx.info['GL_RENDERER']} offers OpenGL {ctx.version_code / 100:.1f}; rendergraph needs 4.5"
        raise DeviceError(Problem("RG611", text))
    raw = RawGL(load)
    limits = {
        "units": raw.integer(0x8B4D),  # MAX_COMBINED_TEXTURE_IMAGE_UNITS
        "uniform_block": raw.integer(0x8A30),  # MAX_UNIFORM_BLOCK_SIZE
        "uniform_bindings": raw.integer(0x8A2F),
        "texture_size": raw.integer(0x0D33),
        "layers": raw.integer(0x88FF),
        "depth": raw.integer(0x8073),
        "samples": raw.integer(0x910E),  # of colour textures
        "depth_samples": raw.integer(0x910F),
        "integer_samples": raw.integer(0x9110),
        "anisotropy": raw.integer(0x84FF),  # 0 if the driver does not support it
        "color_targets": min(raw.integer(0x8CDF), raw.integer(0x8824)),  # attachments, draw buffers
        "images": raw.integer(0x8F38),
        "storage_bindings": raw.integer(0x90DD),
        "storage_block": raw.integer(0x90DE),
        "texture_buffer": raw.integer(0x8C2B),  # texels
        "vertex_storage": raw.integer(0x90D6),  # blocks
        "geometry_storage": raw.integer(0x90D7),
        "fragment_storage": raw.integer(0x90DA),
        "compute_storage": raw.integer(0x90DB),
        **{f"groups_{axis}": raw.integer(0x91BE, number) for number, axis in enumerate("xyz")},
    }
    limits["depth_bounds"] = int("GL_EXT_depth_bounds_test" in ctx.extensions)
    limits["counted_draws"] = int("GL_ARB_indirect_parameters" in ctx.extensions)
    raw.error()  # from limits that this driver does not know
    return Device(ctx, raw, owned, limits)


def check_memory(device: Device, needed: int, allowed: int | None = None) -> None:
    """Refuse a plan before allocating it: some drivers end the process where others return an error.

    Args:
        needed: bytes.
        allowed: MiB; by default RENDERGRAPH_MEMORY_LIMIT, else three quarters of the device's free memory.
    """
    named = os.environ.get(MEMORY_LIMIT, "")
    if allowed is None and named:
        if not named.isdecimal():
            raise UsageError(Problem("RG500", f"{MEMORY_LIMIT} is '{named}', not a number of MiB, as in 4096"))
        allowed = int(named)
    if allowed is not None:
        limit, of = allowed << 20, ""
    elif (free := free_on_device(device) or system.free_memory()) is not None:
        limit, of = free * 3 // 4, f", three quarters of the {free / 2**20:.0f} MiB that are free"
    else:
        return
    if needed > limit:
        text = f"the plan needs {needed / 2**20:.0f} MiB of textures, {limit / 2**20:.0f} MiB may be used{of}; "
        text += f"a smaller --size helps, --limit plan-memory=MiB allows more, as does {MEMORY_LIMIT}"
        raise RenderError(Problem("RG616", text))


def free_on_device(device: Device) -> int | None:
    """Return the bytes that the driver reports as free for textures, None if it does not or the device is the CPU."""
    if device.software:
        return None
    for extension, parameter in (("GL_NVX_gpu_memory_info", 0x9049), ("GL_ATI_meminfo", 0x87FC)):
        if extension in device.ctx.extensions:
            kibibytes = (ctypes.c_int * 4)()  # the second query returns four numbers, the total first
            device.raw.glGetIntegerv(parameter, ctypes.byref(kibibytes))
            if kibibytes[0] > 0:
                return kibibytes[0] * 1024
    return None
