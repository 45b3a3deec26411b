"""A plot of the benchmark of environments as SVG, by hand: two panels, milliseconds against samples and triangles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

COLORS = {"sampled": "#2b6cb0", "integrated": "#b3541e", "unlit": "#2c9163", "pbr": "#805ad5"}
PANELS = (("filter", "filtering against samples a texel"), ("triangles", "a frame against triangles"))
WIDE, TALL, LEFT, TOP, APART = 250, 200, 60, 44, 350


def plot(rows: Sequence[Mapping[str, Any]], device: str) -> str:
    """The picture.

    Args:
        rows: `table`, `name`, `count` and `ms` of each measurement.
        device: named beneath, for its times are its own.
    """
    out = [
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 720 310" font-family="sans-serif" font-size="12" '
        'fill="#333"><rect width="720" height="310" fill="white"/>'
    ]
    for number, (table, title) in enumerate(PANELS):
        own = [row for row in rows if row["table"] == table]
        left, most = LEFT + APART * number, max(row["count"] for row in own)
        top = 1.1 * max(row["ms"] for row in own)
        out.append(f'<text x="{left}" y="{TOP - 18}" font-weight="bold">ms, {title}</text>')
        for part in range(5):
            y = TOP + TALL * (1 - part / 4)
            out.append(f'<path d="M{left},{y}h{WIDE}" stroke="#ddd"/>')
            out.append(f'<text x="{left - 6}" y="{y + 4}" text-anchor="end">{top * part / 4:.3g}</text>')
        for count in sorted({row["count"] for row in own})[-3:]:
            x = left + WIDE * count / most
            out.append(f'<text x="{x:.1f}" y="{TOP + TALL + 18}" text-anchor="middle">{count:,}</text>')
        for place, name in enumerate(dict.fromkeys(row["name"] for row in own)):
            points = [(row["count"], row["ms"]) for row in own if row["name"] == name]
            if len(points) == 1:  # it does not depend on it
                points = [(0, points[0][1]), (most, points[0][1])]
            line = " ".join(f"{left + WIDE * x / most:.1f},{TOP + TALL * (1 - y / top):.1f}" for x, y in points)
            out.append(f'<polyline points="{line}" fill="none" stroke="{COLORS[name]}" stroke-width="2.5"/>')
            out.append(f'<text x="{left + 8}" y="{TOP + 14 + 16 * place}" fill="{COLORS[name]}">{name}</text>')
    out.append(f'<text x="{LEFT}" y="298" fill="#777">{device}: a software rasteriser; its times are no GPU’s.</text>')
    return "\n".join([*out, "</svg>"]) + "\n"
