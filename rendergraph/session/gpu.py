"""A GL context for one thread, and what stays on it."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rendergraph.errors import Problem, RenderError
from rendergraph.gl.device import Device, borrow_device, open_device
from rendergraph.session.gpu_cache import GpuCache
from rendergraph.settings import CacheLimits, nearest_settings

if TYPE_CHECKING:
    import moderngl


class Gpu:
    """Where pipelines are drawn; `Session` is one that takes them by name.

    Attributes:
        device: the GL device.
        cache: programs, the scene and compiled pipelines, kept from one drawing to the next.
    """

    def __init__(
        self,
        device: int | None = None,
        *,
        ctx: moderngl.Context | None = None,
        cache: CacheLimits | None = None,
    ) -> None:
        """Open a context.

        Args:
            device: EGL device number as `doctor` lists them.
            ctx: the caller's own current context, borrowed: drawn in whatever its state, given back as it was found.
            cache: how much is kept; by default what `rendergraph.toml` says in the current project.

        Raises:
            DeviceError: no GL device is usable.
            InputError: the settings file is malformed.
        """
        if cache is None:
            settings = nearest_settings(Path.cwd())
            cache = CacheLimits() if settings is None else settings.cache
        self._thread, self._process = threading.get_ident(), os.getpid()
        self.device: Device = open_device(device) if ctx is None else borrow_device(ctx)
        self.cache = GpuCache(self.device, cache)
        self._closed = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free everything; the context too, unless it was borrowed.

        Raises:
            RenderError: it is another thread's.
        """
        if self._closed:
            return
        if os.getpid() != self._process or self.device.gone:  # all of it is the other process's, or gone
            self._closed = True
            return
        if threading.get_ident() != self._thread:
            raise RenderError(
                Problem("RG615", "a session must be closed by the thread that made it; draw and close it there")
            )
        self._closed = True
        with self.device.current():
            self.device.raw.glUseProgram(0)  # one in use would outlive its deletion
            self.cache.release()
        self.device.release()

    @contextmanager
    def current(self) -> Iterator[None]:
        """Where everything is compiled and drawn.

        A context of our own is the thread's current one meanwhile; what was current before is again afterwards. A
        borrowed one, which its owner makes current, is given back as it was found.

        Raises:
            RenderError: it is closed, another thread's or process's, or its borrowed context has been released.
        """
        if self._closed:
            raise RenderError(
                Problem("RG615", "the session is closed; draw before its `with` block ends, or make another")
            )
        if os.getpid() != self._process:
            text = "a session stays in its process; fork before OpenGL is used, or start processes anew ('spawn')"
            raise RenderError(Problem("RG615", text))
        if threading.get_ident() != self._thread:
            raise RenderError(Problem("RG615", "a session must be used by the thread that made it; make one a thread"))
        if self.device.gone:
            text = "the session's context has been released; keep it until the session is closed, or make another"
            raise RenderError(Problem("RG615", text))
        with self.device.current():
            yield


@contextmanager
def opened(gpu: Gpu | None, device: int | None) -> Iterator[Gpu]:
    """The one that is given, or one of our own that ends with the block."""
    if gpu is not None:
        yield gpu
        return
    with Gpu(device) as own:
        yield own
