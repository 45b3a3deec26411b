"""What Mitsuba needs: its package, and LLVM as a shared library."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from typing import Any

from rendergraph.errors import Problem, UsageError
from rendergraph.installed import require as require_extra
from rendergraph.installed import version

_VARIABLE = "DRJIT_LIBLLVM_PATH"
_LEAST = 17
"""14, 15 and 16 abort inside Mitsuba."""
_LIBRARY = re.compile(r"^\s*libLLVM(?:-(\d+)\.so|\.so\.(\d+))\S* .*=> (\S+)$", re.MULTILINE)


def require() -> dict[str, str]:
    """Return the variable that tells Mitsuba which LLVM to use.

    Raises:
        UsageError: Mitsuba or a usable LLVM is not installed.
    """
    require_extra("Mitsuba as reference", "mitsuba", "mitsuba")
    _, path = find_llvm()
    if path:
        return {_VARIABLE: path}
    text = f"Mitsuba needs LLVM {_LEAST} or newer; apt install libllvm19, or name the library in {_VARIABLE}"
    raise UsageError(Problem("RG500", text))


def find_llvm() -> tuple[str, str]:
    """Return version and path of the newest LLVM, or of the one that a variable names; empty texts for none."""
    if path := os.environ.get(_VARIABLE):
        return path, path
    program = shutil.which("ldconfig") or "/sbin/ldconfig"
    try:
        listed = subprocess.run([program, "-p"], capture_output=True, text=True, timeout=10, check=False).stdout
    except (OSError, ValueError, subprocess.SubprocessError):
        listed = ""
    found = [(int(old or new), path) for old, new, path in _LIBRARY.findall(listed)]
    number, path = max(found, default=(0, ""))
    return (str(number), path) if number >= _LEAST else ("", "")


def examine() -> dict[str, Any]:
    """Return what Mitsuba needs that is installed, and how to install the rest, for `doctor`."""
    installed, (llvm, _) = version("mitsuba"), find_llvm()
    install = [] if installed else ["pip install 'rendergraph[mitsuba]'"]
    return {
        "mitsuba": installed,
        "llvm": llvm or None,
        "install": install + ([] if llvm else ["apt install libllvm19"]),
    }


def summary(found: dict[str, Any]) -> str:
    """Return in a line what `examine` found."""
    if found["install"]:
        return f"--reference mitsuba needs: {', '.join(found['install'])}"
    return f"--reference mitsuba: Mitsuba {found['mitsuba']}, LLVM {found['llvm']}"
