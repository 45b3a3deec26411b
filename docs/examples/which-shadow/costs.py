"""What shadows cost, over lights, texels and triangles: `python costs.py measure OUT [FURTHER-SCENE]`, then `plot OUT`.

`measure` runs the sweeps of this folder, those of triangles on scenes that it writes (sixteen balls of more and more
faces) and on a further one if that is given. `plot` writes an SVG to stdout and tables to stderr. Milliseconds are the
least of the frames' for what makes the shadow alone, its maps included; MiB are all textures of the pipeline.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
SWEEPS = {"texels": ("resolution", "maps"), "lights": ("lights", "lights-without-maps")}
OVER_SCENES = ("triangles", "triangles-maps", "triangles-without-maps")
SEGMENTS = (16, 48, 144)
COLORS = {
    "shadow_pcf": "#2b6cb0",
    "shadow_pcss": "#63b3ed",
    "shadow_vsm": "#2c9163",
    "shadow_msm": "#9ac53a",
    "shadow_esm": "#b3541e",
    "shadow_convolution": "#e0a030",
    "shadow_volumes": "#805ad5",
    "shadow_planar": "#d53f8c",
    "shadow_cascaded": "#333333",
    "shadow_trapezoidal": "#999999",
}
WIDE, TALL, LEFT, TOP = 210, 170, 56, 40
Points = dict[str, list[tuple[float, float, float]]]


def balls(segments: int) -> tuple[str, int]:
    """A scene of sixteen balls on a floor under a sun, and its triangles."""
    rings = segments // 2
    rows = [
        f"  ball_{n}: {{shape: sphere, radius: 0.6, segments: {segments}, rings: {rings}, at: [{x}, 0.6, {z}]}}"
        for n, (x, z) in enumerate((x, z) for x in (-3, -1, 1, 3) for z in (-3, -1, 1, 3))
    ]
    text = "scene: 1\nobjects:\n  floor: {shape: plane, size: [12, 12], casts_shadow: false}\n" + "\n".join(rows)
    text += "\nlights: {sun: {type: directional, direction: [0.7, -1.2, -0.5], intensity: 3}}\n"
    text += "cameras: {main: {eye: [5, 5, 7.5], target: [0, 0.5, 0], fov_y_degrees: 40, near: 0.1, far: 60}}\n"
    return text, 16 * 2 * segments * (rings - 1)


def sweep(name: str, out: Path, *options: str) -> None:
    """Run one of the sweeps."""
    subprocess.run(["rendergraph", "sweep", str(HERE / f"{name}.yaml"), "-o", str(out), "-q", *options], check=True)


def measure(out: Path, further: str | None) -> None:
    """Run all of them."""
    out.mkdir(parents=True, exist_ok=True)
    for name in (name for names in SWEEPS.values() for name in names):
        sweep(name, out / name)
    for segments in SEGMENTS:
        text, triangles = balls(segments)
        scene = out / f"balls-{segments}.yaml"
        scene.write_text(text, encoding="utf-8")
        for name in OVER_SCENES:
            sweep(name, out / f"{name}-{triangles}", "--scene", str(scene))
    for name in OVER_SCENES[:2] if further else ():
        sweep(name, out / f"{name}-further", "--scene", str(further))


def cost(file: Path) -> tuple[str, float, float, dict[str, Any]]:
    """Technique, milliseconds, MiB and settings of a run."""
    run = json.loads(file.read_text(encoding="utf-8"))
    passes = [one for one in run["passes"] if one["node"] in ("sun", "shadows")]
    name = run["settings"].get("sun.type") or run["settings"]["shadows.type"]
    ms = sum(one["gpu_ms"]["min"] for one in passes)
    return name, ms, run["memory"]["allocated_bytes"] / 2**20, run["settings"]


def points(out: Path) -> dict[str, Points]:
    """For each of what is counted the lines of all techniques: how many, milliseconds, MiB."""
    found: dict[str, Points] = {what: defaultdict(list) for what in ("lights", "texels", "triangles", "further")}
    for folder in sorted(path for path in out.iterdir() if path.is_dir()):
        start, _, end = folder.name.rpartition("-")
        for file in sorted(folder.glob("*/run.json")):
            name, ms, size, settings = cost(file)
            lights = next((value for path, value in settings.items() if path.endswith(".light")), None)
            if start in OVER_SCENES:
                what, count = ("further", 0) if end == "further" else ("triangles", int(end))
            elif lights is not None:
                what, count = "lights", 8 if lights == "all" else len(lights)
            else:
                what, count = "texels", settings["sun.resolution"]
            if name != "shadow_map":  # which is what pcf stands on
                found[what][name].append((count, ms, size))
    return {what: {name: sorted(line) for name, line in lines.items()} for what, lines in found.items()}


def _ticks(low: float, high: float, base: int) -> list[float]:
    """The powers of a base from low to high."""
    return [base**power for power in range(-8, 32) if low <= base**power <= high]


def panel(lines: Points, which: int, left: float, top: float, title: str) -> list[str]:
    """One plot with logarithmic axes: milliseconds by powers of ten, everything else by powers of two."""
    from math import ceil, floor, log2

    xs = sorted({count for line in lines.values() for count, *_ in line})
    values = [point[which] for line in lines.values() for point in line]
    low, high = floor(log2(min(values))), ceil(log2(max(values)))

    def at(count: float, value: float) -> tuple[float, float]:
        across = (log2(count) - log2(xs[0])) / (log2(xs[-1]) - log2(xs[0]))
        return left + 8 + (WIDE - 16) * across, top + TALL * (high - log2(value)) / (high - low)

    out = [f'<text x="{left}" y="{top - 10}" font-weight="bold">{title}</text>']
    for value in _ticks(2.0**low, 2.0**high, 10 if title.startswith("ms") else 2):
        y = at(xs[0], value)[1]
        out.append(f'<path d="M{left},{y:.1f}h{WIDE}" stroke="#ddd"/>')
        out.append(f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    for count in xs if xs[-1] < 4000 else _ticks(xs[0], xs[-1], 10):
        label = f"{count / 1000:.0f}k" if count >= 4000 else f"{count}"
        out.append(f'<text x="{at(count, 1)[0]:.1f}" y="{top + TALL + 16}" text-anchor="middle">{label}</text>')
    for name, color in COLORS.items():
        places = [at(point[0], point[which]) for point in lines.get(name, ())]
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        out.append(f'<polyline points="{line}" fill="none" stroke="{color}" stroke-width="2"/>')
        out += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5" fill="{color}"/>' for x, y in places]
    return out


def plot(out: Path) -> None:
    """The picture to stdout, the tables to stderr."""
    found = points(out)
    width, height = LEFT + 3 * (WIDE + 60) + 140, TOP + 2 * (TALL + 60)
    drawn = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" '
        f'font-size="11" fill="#333"><rect width="{width}" height="{height}" fill="white"/>'
    ]
    names = {"lights": "lights", "texels": "texels a side", "triangles": "triangles"}
    for row, unit in enumerate(("ms", "MiB")):
        for column, (what, title) in enumerate(names.items()):
            left, top = LEFT + column * (WIDE + 60), TOP + row * (TALL + 60)
            drawn += panel(found[what], row + 1, left, top, f"{unit} over {title}")
    for number, (name, color) in enumerate(COLORS.items()):
        drawn.append(f'<text x="{width - 150}" y="{TOP + 10 + 18 * number}" fill="{color}">{name}</text>')
    print("\n".join([*drawn, "</svg>"]))
    for what, lines in found.items():
        counts = sorted({count for line in lines.values() for count, *_ in line})
        print(f"\n| {what} | " + " | ".join(f"{count:,}" for count in counts) + " |", file=sys.stderr)
        print("| --- |" + " --- |" * len(counts), file=sys.stderr)
        for name in (name for name in COLORS if name in lines):
            cells = [f"{ms:.0f} ms, {size:.0f} MiB" for _, ms, size in lines[name]]
            print(f"| `{name}` | " + " | ".join(cells) + " |", file=sys.stderr)


if __name__ == "__main__":
    if sys.argv[1] == "measure":
        measure(Path(sys.argv[2]), next(iter(sys.argv[3:]), None))
    else:
        plot(Path(sys.argv[2]))
