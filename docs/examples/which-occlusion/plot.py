"""Error against time of the sweeps in this folder, as SVG and as a table: `python plot.py SWEEP [SWEEP] > plot.svg`.

A sweep is a folder that `rendergraph sweep arms-and-points.yaml -o SWEEP` wrote, here or in `which-light`. Milliseconds
are the least of the frames' for the pass that finds occlusion or light; the table goes to stderr.
"""

from __future__ import annotations

import json
import math
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

COLORS = {
    "ssao_hemisphere": "#b3541e",
    "ssao_disc": "#2b6cb0",
    "hbao": "#2c9163",
    "gtao": "#805ad5",
    "ssgi": "#d69e2e",
    "ssao_ssgi": "#c53030",
    "ssil": "#333",
}
LEFT, TOP, WIDE, TALL = 60, 40, 460, 270


def runs(folder: Path) -> list[tuple[str, int, float, float]]:
    """Technique, samples, milliseconds and error of each run."""
    found = []
    for file in sorted(folder.glob("*/run.json")):
        run: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        one = next(step for step in run["passes"] if step["node"] in ("ao", "gi"))
        samples = next(value for name, value in run["settings"].items() if name.endswith(".samples"))
        found.append((one["type"], samples, one["gpu_ms"]["min"], run["rmse"]))
    return sorted(found)


def main() -> None:
    """Write the plot to stdout and the table to stderr."""
    lines: dict[str, list[tuple[int, float, float]]] = defaultdict(list)
    for folder in sys.argv[1:]:
        for name, samples, ms, error in runs(Path(folder)):
            lines[name].append((samples, ms, error))
    times = [ms for points in lines.values() for _, ms, _ in points]
    low, high = math.log2(min(times)) - 0.2, math.log2(max(times)) + 0.2
    top = math.ceil(max(error for points in lines.values() for _, _, error in points) * 105) / 100

    def at(ms: float, error: float) -> tuple[float, float]:
        return LEFT + WIDE * (math.log2(ms) - low) / (high - low), TOP + TALL * (1 - error / top)

    out = [
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 640 370" font-family="sans-serif" font-size="12" '
        'fill="#333"><rect width="640" height="370" fill="white"/>',
        f'<text x="{LEFT}" y="24" font-weight="bold">RMSE against ray tracing over milliseconds</text>',
    ]
    step = 0.01 if top <= 0.05 else 0.02 if top <= 0.1 else 0.05
    for number in range(int(top / step + 1e-6) + 1):
        _, y = at(times[0], step * number)
        out.append(f'<path d="M{LEFT},{y:.1f}h{WIDE}" stroke="#ddd"/>')
        out.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{step * number:.2f}</text>')
    for power in range(math.ceil(low), math.floor(high) + 1):
        x, _ = at(2**power, 0)
        out.append(f'<text x="{x:.1f}" y="{TOP + TALL + 18}" text-anchor="middle">{2**power}</text>')
    for number, (name, color) in enumerate((name, COLORS[name]) for name in COLORS if name in lines):
        places = [at(ms, error) for _, ms, error in sorted(lines[name])]
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        out.append(f'<polyline points="{line}" fill="none" stroke="{color}" stroke-width="2"/>')
        out += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{color}"/>' for x, y in places]
        out.append(f'<text x="{LEFT + WIDE + 12}" y="{TOP + 20 + 20 * number}" fill="{color}">{name}</text>')
    print("\n".join([*out, "</svg>"]))
    heads = "| technique | " + " | ".join(str(samples) for samples in (8, 16, 32, 64, 128)) + " |"
    print(heads, "|---" * heads.count("|"), sep="\n", file=sys.stderr)
    for name in (name for name in COLORS if name in lines):
        cells = [f"{error:.3f}, {ms:.0f} ms" for _, ms, error in sorted(lines[name])]
        print(f"| `{name}` | " + " | ".join(cells) + " |", file=sys.stderr)


if __name__ == "__main__":
    main()
