"""A log-log plot of the benchmark of lights as SVG, by hand: two panels, lines measured and lines predicted."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

COLORS = {
    "forward": "#b3541e",
    "forward-multipass": "#d99a2b",
    "deferred": "#2b6cb0",
    "deferred-stencil-lights": "#2f855a",
    "forward-msaa": "#8c3f8c",
    "deferred-msaa": "#6b7280",
}
FORMULAS = {
    "forward": "V + L·F",
    "forward-multipass": "L·(V + F)",
    "deferred": "V + L·F",
    "deferred-stencil-lights": "V + ΣF′",
    "forward-msaa": "V + L·F",
    "deferred-msaa": "V + L·(F + 3E)",
}
WIDTH, HEIGHT, LEFT, TOP, PANEL = 920, 450, 70, 50, 340


def plot(rows: Sequence[Mapping[str, Any]], device: str) -> str:
    """The picture.

    Args:
        rows: `pipeline`, `lights`, `ms`, `evaluations` and `predicted` of each measurement.
        device: named beneath, for its times are its own.
    """
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
        'font-size="12" fill="#333">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    panels = (
        ("CPU milliseconds a frame", "ms", None),
        ("light evaluations; dashed: the formula", "evaluations", "predicted"),
    )
    for number, (title, key, other) in enumerate(panels):
        out += _panel(rows, LEFT + number * (PANEL + 100), title, key, other)
    for number, (name, color) in enumerate(COLORS.items()):
        x, y = LEFT + number % 3 * 270, 395 + number // 3 * 18
        out.append(f'<line x1="{x}" y1="{y}" x2="{x + 22}" y2="{y}" stroke="{color}" stroke-width="2.5"/>')
        out.append(f'<text x="{x + 28}" y="{y + 4}">{name}: {FORMULAS[name]}</text>')
    out.append(f'<text x="{LEFT}" y="440" fill="#777">{device}: a software rasteriser; its times are no GPU’s.</text>')
    return "\n".join([*out, "</svg>"]) + "\n"


def _panel(rows: Sequence[Mapping[str, Any]], left: float, title: str, key: str, other: str | None) -> list[str]:
    values = [max(row[k], 1e-3) for row in rows for k in (key, other) if k]
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    most = max(row["lights"] for row in rows)
    bottom, height = 350.0, 350.0 - TOP

    def at(lights: float, value: float) -> str:
        x = left + PANEL * math.log(lights) / math.log(most)
        y = bottom - height * (math.log10(max(value, 1e-3)) - low) / (high - low)
        return f"{x:.1f},{y:.1f}"

    out = [f'<text x="{left}" y="{TOP - 14}" font-weight="bold">{title}</text>']
    for power in range(low, high + 1):
        y = bottom - height * (power - low) / (high - low)
        label = f"{10**power:,}" if power < 4 else f"10{''.join('⁰¹²³⁴⁵⁶⁷⁸⁹'[int(d)] for d in str(power))}"
        out.append(f'<path d="M{left},{y:.1f}h{PANEL}" stroke="#ddd"/>')
        out.append(f'<text x="{left - 8}" y="{y + 4:.1f}" text-anchor="end">{label}</text>')
    for lights in sorted({row["lights"] for row in rows}):
        x, _ = at(lights, 1).split(",")
        out.append(f'<text x="{x}" y="{bottom + 18}" text-anchor="middle">{lights}</text>')
    out.append(f'<text x="{left + PANEL / 2}" y="{bottom + 34}" text-anchor="middle">local lights</text>')
    for name, color in COLORS.items():
        mine = [row for row in rows if row["pipeline"] == name]
        line = " ".join(at(row["lights"], row[key]) for row in mine)
        out.append(f'<polyline points="{line}" fill="none" stroke="{color}" stroke-width="2.5" stroke-opacity="0.85"/>')
        if other:
            line = " ".join(at(row["lights"], row[other]) for row in mine)
            dashes = 'stroke-width="1.5" stroke-dasharray="4 4"'
            out.append(f'<polyline points="{line}" fill="none" stroke="{color}" {dashes}/>')
    return out
