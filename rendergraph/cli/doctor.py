"""`rendergraph doctor`: check whether this machine can render, and what is missing.

A broken driver may crash its process. So child processes, which run this module, examine GL and answer with JSON on
stdout: without an argument they list the EGL devices, with a number they open that device.
"""

from __future__ import annotations

import json
import platform
import re
import sys
from typing import Any

from rendergraph import system
from rendergraph.cli import options
from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import emit, emit_json, table
from rendergraph.errors import RendergraphError
from rendergraph.installed import version, versions

_OPTIONAL_FEATURES = ("memory objects", "depth bounds")
_SECONDS = 60
_STORED_BLOCKS = "a crash of this driver is avoided: more than two uniform blocks a stage are storage blocks"
NO_DEVICE = 5


@click.command("doctor")
@options.json_option
def doctor(as_json: bool) -> None:
    """Check devices, drivers and versions.

    Lists each GL device with its features, and what to install if something is missing. Exits 5 if no device is usable.

    \b
    Examples:
      rendergraph doctor
      rendergraph doctor --json
    """
    report = examine()
    emit_json(report) if as_json else emit(_text(report))
    if not report["ok"]:
        raise click.exceptions.Exit(NO_DEVICE)


def examine() -> dict[str, Any]:
    from rendergraph.pipelines import references

    found = _probe()
    devices = [device | _probe(str(device["number"])) for device in found.get("devices", [])]
    for device in devices:
        device["usable"] = not device.get("problem")
    packages = _packages()
    usable = [device for device in devices if device["usable"]]
    return {
        "ok": bool(usable) and None not in packages.values(),
        "rendergraph": version("rendergraph"),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": packages,
        "libraries": found.get("libraries", {}),
        "problem": found.get("problem"),
        "devices": devices,
        **references.examine(),
        "install": _advice(found, devices, packages),
    }


def _probe(*arguments: str) -> dict[str, Any]:
    """Examine GL in a child process and return its answer, or the `problem`."""
    import subprocess

    command_line = [sys.executable, "-m", "rendergraph.cli.doctor", *arguments]
    try:
        done = subprocess.run(
            command_line, capture_output=True, text=True, errors="replace", timeout=_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        return {"problem": f"the driver did not answer within {_SECONDS} s"}
    except (OSError, ValueError) as error:
        return {"problem": f"the probe cannot be started: {error}"}
    try:
        answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
        return answer
    except (ValueError, IndexError):
        pass
    if done.returncode < 0:
        return {"problem": f"the driver crashed (signal {-done.returncode})"}
    last = done.stderr.strip().splitlines()[-1:] or ["no answer"]
    return {"problem": f"the probe failed: {last[0]}"}


def _packages() -> dict[str, str | None]:
    from importlib.metadata import PackageNotFoundError, requires

    try:
        needed = requires("rendergraph") or []
    except PackageNotFoundError:
        needed = []
    names = [re.split(r"[^A-Za-z0-9._-]", line, maxsplit=1)[0] for line in needed if "extra ==" not in line]
    return versions(names)


def _advice(found: dict[str, Any], devices: list[dict[str, Any]], packages: dict[str, str | None]) -> list[str]:
    """Return one sentence for each action to take."""
    advice = []
    missing = [name for name, version in packages.items() if version is None]
    if missing:
        advice.append(f"pip install {' '.join(missing)}")
    libraries = found.get("libraries", {})
    lacking = [library for library in (system.EGL, system.GL) if libraries.get(library)]
    if not any(device["usable"] for device in devices):
        lacking.append("driver")
    if lacking:
        advice.append(system.install_advice(lacking))
    broken = [device for device in devices if not device["usable"] and not device.get("software")]
    if broken:
        advice.append("update the driver of the device that cannot be used: OpenGL 4.5 is needed")
    return advice


def _text(report: dict[str, Any]) -> str:
    from rendergraph.pipelines import references

    lines = [f"rendergraph {report['rendergraph']}, Python {report['python']}, {report['platform']}"]
    lines.append(", ".join(f"{name} {version or 'MISSING'}" for name, version in report["packages"].items()))
    lines += [f"{name}: {problem}" for name, problem in report["libraries"].items() if problem]
    lines += [report["problem"]] if report["problem"] else []
    lines.append("")
    rows = []
    for device in report["devices"]:
        if not device["usable"]:
            rows.append((device["number"], "no", device.get("renderer") or device.get("vendor"), device["problem"]))
            continue
        lacking = [n for n, has in device["features"].items() if not has and n not in _OPTIONAL_FEATURES]
        words = [f"OpenGL {device['gl']}", device["version"].split(" ", 1)[-1]]
        words += ["software: not comparable to a GPU"] if device["software"] else []
        words += [f"lacks {', '.join(lacking)}"] if lacking else []
        words += device.get("workarounds", [])
        words += [device[key] for key in ("render_node", "drm") if device.get(key)][:1]
        rows.append((device["number"], "yes", device["renderer"], ", ".join(words)))
    lines.append(table(rows, ("device", "usable", "renderer", "properties")) if rows else "no GL devices")
    lines += ["", *references.summary(report), ""]
    lines.append("ready to render" if report["ok"] else "cannot render here yet")
    lines += [f"  {line}" for line in report["install"]]
    return "\n".join(lines)


# --- in the child process ---------------------------------------------------------------------------------------------


def _libraries() -> dict[str, str | None]:
    import ctypes  # only the child process needs it

    found: dict[str, str | None] = {}
    for name in (system.EGL, system.GL):
        try:
            ctypes.CDLL(name)
            found[name] = None
        except OSError as error:
            found[name] = str(error)
    return found


def _context(index: int) -> dict[str, Any]:
    from rendergraph.gl.device import open_device

    device = open_device(index)
    try:
        extensions, version = device.ctx.extensions, device.ctx.version_code
        return device.as_json() | {
            "gl": f"{version // 100}.{version // 10 % 10}",
            "features": {
                "OpenGL 4.5": version >= 450,
                "compute shaders": version >= 430 or "GL_ARB_compute_shader" in extensions,
                "texture views": version >= 430 or "GL_ARB_texture_view" in extensions,
                "indirect multi-draw": version >= 430 or "GL_ARB_multi_draw_indirect" in extensions,
                "depth bounds": bool(device.limits["depth_bounds"]),
                "memory objects": "GL_EXT_memory_object" in extensions,
            },
            "limits": dict(device.limits),
            "workarounds": [_STORED_BLOCKS] if device.stores_blocks else [],
        }
    finally:
        device.release()


def _main() -> None:
    from rendergraph.gl.egl import devices

    if len(sys.argv) > 1:
        try:
            print(json.dumps(_context(int(sys.argv[1]))))
        except RendergraphError as error:
            print(json.dumps({"problem": "; ".join(problem.message for problem in error.problems)}))
        except Exception as error:  # `doctor` reports any failure
            print(json.dumps({"problem": f"{type(error).__name__}: {error}"}))
        return
    try:
        print(json.dumps({"libraries": _libraries(), "devices": devices(), "problem": None}))
    except OSError as error:
        print(json.dumps({"libraries": _libraries(), "devices": [], "problem": str(error)}))


if __name__ == "__main__":
    _main()
