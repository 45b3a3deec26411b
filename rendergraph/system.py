"""Everything that depends on the operating system: Linux fully, other POSIX systems as far as possible.

A port to another system needs to replace only this module.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing import IO

EGL, GL = "libEGL.so.1", "libGL.so.1"
"""The libraries that open contexts."""
STDIN = "/dev/stdin"
_PR_SET_PDEATHSIG = 1
_CONTROL_GROUP = "/sys/fs/cgroup"
_PACKAGES = {  # by ID or ID_LIKE of os-release: the installer, and the packages of EGL, GL and a software renderer
    "debian": ("apt install", {EGL: "libegl1", GL: "libgl1", "driver": "libgl1-mesa-dri"}),
    "fedora": ("dnf install", {EGL: "libglvnd-egl", GL: "libglvnd-glx", "driver": "mesa-dri-drivers"}),
    "rhel": ("dnf install", {EGL: "libglvnd-egl", GL: "libglvnd-glx", "driver": "mesa-dri-drivers"}),
    "arch": ("pacman -S", {EGL: "libglvnd", GL: "libglvnd", "driver": "mesa"}),
    "suse": ("zypper install", {EGL: "libglvnd", GL: "libglvnd", "driver": "Mesa-dri"}),
    "opensuse": ("zypper install", {EGL: "libglvnd", GL: "libglvnd", "driver": "Mesa-dri"}),
}


def end_with_parent(parent: int) -> None:
    """Let the system end this process when its parent ends for any reason."""
    if sys.platform == "linux":
        import ctypes  # takes 2 ms

        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def kill_session(process: int) -> None:
    """End a process that leads a session, and all processes in it."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process, signal.SIGKILL)


def set_alarm(seconds: float) -> None:
    """Let SIGALRM end this process after some seconds; 0 cancels that."""
    signal.setitimer(signal.ITIMER_REAL, seconds)


def limit_memory(private: int) -> None:
    """Limit the private memory of this process in bytes, and disable core files.

    The address space is not limited, because drivers reserve much more than they use.
    """
    import resource  # not on every system

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_DATA, (private, private))


def lock(file: IO[bytes]) -> bool:
    """Lock an open file for this process until it is closed; return whether no other process holds the lock."""
    import fcntl  # not on every system

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


@contextmanager
def memory_file() -> Iterator[tuple[str, IO[bytes]]]:
    """Yield a path for libraries to write to, and the opened file; nothing is left if the process is killed."""
    if not hasattr(os, "memfd_create"):
        import tempfile  # takes 7 ms

        with tempfile.NamedTemporaryFile() as named:
            yield named.name, named.file
        return
    with open(os.memfd_create("picture"), "rb") as file:
        yield f"/proc/self/fd/{file.fileno()}", file


def processor() -> str:
    """Return the processor's name and its number of cores."""
    import platform  # only for reports

    try:
        lines = _text("/proc/cpuinfo").splitlines()
    except OSError:
        return platform.processor()
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{models[0]}, {len(models)} logical cores" if models else platform.processor()


def free_memory() -> int | None:
    """Return the bytes available to a process: reclaimable file cache counts, and so does a container's limit."""
    return min((bytes for bytes in (_free_in_system(), _free_in_group()) if bytes is not None), default=None)


def _free_in_system() -> int | None:
    try:
        for line in _text("/proc/meminfo").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError):
        return None


def _free_in_group() -> int | None:
    """Return the remaining memory of the control group (version 2); None if it has no limit."""
    try:
        bound, used, counts = (_text(f"{_CONTROL_GROUP}/memory.{name}").strip() for name in ("max", "current", "stat"))
        cached = dict(line.split() for line in counts.splitlines())
        return None if bound == "max" else max(0, int(bound) - int(used) + int(cached.get("inactive_file", 0)))
    except (ValueError, OSError):
        return None


def _text(file: str) -> str:
    with open(file, encoding="utf-8") as lines:
        return lines.read()


def install_advice(missing: list[str]) -> str:
    """Return how to install the `missing` ones of `EGL`, `GL` and `driver` (a software renderer) on this system."""
    if sys.platform == "darwin":
        return "macOS ends at OpenGL 4.1; use a container or a virtual machine with Linux (docs/guide/other-systems.md)"
    if sys.platform == "win32":
        return "use the Windows Subsystem for Linux: wsl --install (docs/guide/other-systems.md)"
    import platform  # only for `doctor`

    try:
        release = platform.freedesktop_os_release()
    except OSError:
        release = {}
    family = [release.get("ID", ""), *release.get("ID_LIKE", "").split()]
    installer, packages = next((_PACKAGES[name] for name in family if name in _PACKAGES), _PACKAGES["debian"])
    words = dict.fromkeys(packages[part] for part in missing)
    return f"{installer} {' '.join(words)}   (software rendering; or your GPU vendor's driver)"
