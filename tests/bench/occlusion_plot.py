"""A plot of the benchmark of occlusion as SVG, by hand: milliseconds against samples, one line a technique."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

COLORS = {
    "ssao-hemisphere": "#b3541e",
    "ssao-disc": "#2b6cb0",
    "ssao-hbao": "#2c9163",
    "ssao-gtao": "#805ad5",
    "ssgi": "#d69e2e",
    "ssao-ssgi": "#c53030",
    "ssil": "#333",
}
WIDTH, HEIGHT, LEFT, TOP, WIDE, TALL = 620, 372, 70, 44, 400, 270


def plot(rows: Sequence[Mapping[str, Any]], device: str) -> str:
    """The picture.

    Args:
        rows: `pipeline`, `samples` and `ms` of each measurement.
        device: named beneath, for its times are its own.
    """
    slowest = max(row["ms"] for row in rows)
    power = 10 ** math.floor(math.log10(slowest))
    step = next(share * power for share in (0.2, 0.5, 1, 2) if slowest / (share * power) <= 5)
    lines = math.ceil(slowest / step)
    top = lines * step
    most = max(row["samples"] for row in rows)

    def at(samples: float, ms: float) -> tuple[float, float]:
        return LEFT + WIDE * samples / most, TOP + TALL * (1 - ms / top)

    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
        'font-size="12" fill="#333">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        f'<text x="{LEFT}" y="{TOP - 18}" font-weight="bold">CPU milliseconds of `ao` or `gi` against samples</text>',
    ]
    for number in range(lines + 1):
        _, y = at(0, step * number)
        out.append(f'<path d="M{LEFT},{y:.1f}h{WIDE}" stroke="#ddd"/>')
        out.append(f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{step * number:g}</text>')
    for samples in sorted({row["samples"] for row in rows}):
        x, y = at(samples, 0)
        out.append(f'<text x="{x:.1f}" y="{y + 18:.1f}" text-anchor="middle">{samples}</text>')
    for number, (name, color) in enumerate(COLORS.items()):
        line = " ".join(
            "{:.1f},{:.1f}".format(*at(row["samples"], row["ms"])) for row in rows if row["pipeline"] == name
        )
        out.append(f'<polyline points="{line}" fill="none" stroke="{color}" stroke-width="2.5"/>')
        x, y = LEFT + WIDE + 16, TOP + 14 + 22 * number
        out.append(f'<line x1="{x}" y1="{y}" x2="{x + 22}" y2="{y}" stroke="{color}" stroke-width="2.5"/>')
        out.append(f'<text x="{x + 28}" y="{y + 4}">{name}</text>')
    out.append(f'<text x="{LEFT}" y="358" fill="#777">{device}: a software rasteriser; its times are no GPU’s.</text>')
    return "\n".join([*out, "</svg>"]) + "\n"
