"""A GL context for one thread, and its caches."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Self

from rendergraph.errors import Problem, RenderError
from rendergraph.gl.device import Device, borrow_device, open_device
from rendergraph.session.gpu_cache import GpuCache
from rendergraph.settings import CacheLimits, nearest_settings

if TYPE_CHECKING:
    import moderngl


class Gpu:
    """Where pipelines are rendered; its `cache` has programs, the scene and compiled pipelines."""

    def __init__(
        self, device: int | None = None, *, ctx: moderngl.Context | None = None, cache: CacheLimits | None = None
    ) -> None:
        """Open a context.

        Args:
            device: EGL device number, as `doctor` lists it.
            ctx: the caller's own current context, to borrow; its state is restored after use.
            cache: limits of the caches; by default those of `rendergraph.toml` in the current project.

        Raises:
            DeviceError: there is no usable GL device.
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

    def __exit__(self, *error: object) -> None:
        self.close()

    @property
    def is_usable(self) -> bool:
        """Whether this process may render with it."""
        return not (self._closed or os.getpid() != self._process or self.device.is_released)

    def close(self) -> None:
        """Free everything, the context too unless it was borrowed; only the thread that created it may do so."""
        if not self.is_usable:  # everything belongs to another process, or is gone
            self._closed = True
            return
        if threading.get_ident() != self._thread:
            text = "a session must be closed by the thread that created it; render and close it there"
            raise RenderError(Problem("RG615", text))
        self._closed = True
        with self.device.current():
            self.device.raw.glUseProgram(0)  # one in use would outlive its deletion
            self.cache.release()
        self.device.release()

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make the context current, in which everything is compiled and rendered, and restore the previous one."""
        text = ""
        if self._closed:
            text = "the session is closed; render before its `with` block ends, or create another"
        elif os.getpid() != self._process:
            text = "a session cannot be used after a fork; fork before OpenGL is used, or start new processes ('spawn')"
        elif threading.get_ident() != self._thread:
            text = "a session must be used by the thread that created it; create one per thread"
        elif self.device.is_released:
            text = "the session's context has been released; keep it until the session is closed, or create another"
        if text:
            raise RenderError(Problem("RG615", text))
        with self.device.current():
            yield


class _Contexts(dict[int | None, Gpu]):
    """The contexts of one thread's calls without a session, by device."""

    def __del__(self) -> None:  # the thread ends, and no other may free its objects
        for gpu in self.values():
            with contextlib.suppress(Exception):
                gpu.close()


_LOCAL = threading.local()


def shared(device: int | None) -> Gpu:
    """Return this thread's `Gpu` for calls without a session; it is closed when the thread ends."""
    contexts: _Contexts = vars(_LOCAL).setdefault("contexts", _Contexts())
    gpu = contexts.get(device)
    if gpu is None or not gpu.is_usable:
        gpu = contexts[device] = Gpu(device)
    return gpu


def opened(gpu: Gpu | None, device: int | None) -> AbstractContextManager[Gpu]:
    """Return a context manager for the given `Gpu`, or for one that is closed with the block."""
    return Gpu(device) if gpu is None else contextlib.nullcontext(gpu)
