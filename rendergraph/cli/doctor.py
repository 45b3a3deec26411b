"""`rendergraph doctor`: can this machine render, and what is missing?"""

from __future__ import annotations

import json
import platform
import re
import sys
from typing import Any

from rendergraph.cli import options
from rendergraph.cli.output import emit, emit_json, table
from rendergraph.cli.words import click
from rendergraph.installed import version, versions

_OPTIONAL_FEATURES = ("memory objects", "depth bounds")
_SECONDS = 60
NO_DEVICE = 5


@click.command("doctor")
@options.json_option
def command(as_json: bool) -> None:
    """Check devices, drivers and versions.

    Shows each GL device and what it can, and says what to install where something is missing. Exits 5 where no
    device can be used.

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
    """Everything there is to say, as plain JSON values; nothing here fails."""
    asked = _probe()
    devices = [device | _probe(str(device["number"])) for device in asked.get("devices", [])]
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
        "libraries": asked.get("libraries", {}),
        "problem": asked.get("problem"),
        "devices": devices,
        "install": _advice(asked, devices, packages),
    }


def _probe(*arguments: str) -> dict[str, Any]:
    """What `probe` says, or what became of it."""
    import subprocess  # this module is loaded for `--help`, too

    words = [sys.executable, "-m", "rendergraph.cli.probe", *arguments]
    try:
        done = subprocess.run(words, capture_output=True, text=True, errors="replace", timeout=_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return {"problem": f"the driver did not answer within {_SECONDS} s"}
    except (OSError, ValueError) as error:
        return {"problem": f"the probe cannot be started: {error}"}
    try:
        found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
        return found
    except (ValueError, IndexError):
        pass
    if done.returncode < 0:
        return {"problem": f"the driver crashed (signal {-done.returncode})"}
    last = done.stderr.strip().splitlines()[-1:] or ["no answer"]
    return {"problem": f"the probe failed: {last[0]}"}


def _packages() -> dict[str, str | None]:
    """What rendergraph requires, and the versions installed."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        needed = requires("rendergraph") or []
    except PackageNotFoundError:
        needed = []
    names = [re.split(r"[^A-Za-z0-9._-]", line, maxsplit=1)[0] for line in needed if "extra ==" not in line]
    return versions(names)


def _advice(asked: dict[str, Any], devices: list[dict[str, Any]], packages: dict[str, str | None]) -> list[str]:
    """What to do, one sentence each; package names are Debian's and Ubuntu's."""
    advice = []
    missing = [name for name, version in packages.items() if version is None]
    if missing:
        advice.append(f"pip install {' '.join(missing)}")
    libraries = asked.get("libraries", {})
    apt = [p for library, p in (("libEGL.so.1", "libegl1"), ("libGL.so.1", "libgl1")) if libraries.get(library)]
    if not any(device["usable"] for device in devices):
        apt.append("libgl1-mesa-dri")
    if apt:
        advice.append(f"apt install {' '.join(apt)}   (software rendering; or your GPU vendor's driver)")
    broken = [device for device in devices if not device["usable"] and not device.get("software")]
    if broken:
        advice.append("update the driver of the device that cannot be used: OpenGL 4.5 is needed")
    if any(_overruns(device) for device in devices):
        advice.append(
            "unset GALLIUM_DRIVER, or use Mesa 23 or newer: zink over lavapipe of Mesa 22 crashes on some programs"
        )
    return advice


def _overruns(device: dict[str, Any]) -> bool:
    """Whether the device is zink over Mesa 22's lavapipe.

    That looks for uniforms to inline behind every branch, and notes those of the block it numbers 4 behind the end of
    its table, so that the next draw reads through a wild pointer. Which block has that number the driver decides.
    """
    version = re.search(r"Mesa (\d+)", device.get("version", ""))
    return device.get("renderer", "").startswith("zink (llvmpipe") and version is not None and int(version[1]) <= 22


def _text(report: dict[str, Any]) -> str:
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
        words += ["software: its times say nothing about GPUs"] if device["software"] else []
        words += [f"lacks {', '.join(lacking)}"] if lacking else []
        words += [device[key] for key in ("render_node", "drm") if device.get(key)][:1]
        rows.append((device["number"], "yes", device["renderer"], ", ".join(words)))
    lines.append(table(rows, ("device", "usable", "renderer", "what it is")) if rows else "no GL devices")
    lines.append("")
    lines.append("ready to render" if report["ok"] else "cannot render here yet")
    lines += [f"  {line}" for line in report["install"]]
    return "\n".join(lines)
