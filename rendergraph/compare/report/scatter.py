"""Error against time as an SVG picture: a point for each variant, the Pareto front as a line."""

from __future__ import annotations

import itertools
import math
from collections.abc import Container, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from rendergraph.compare.results import Result

WIDTH, HEIGHT = 760.0, 380.0
LEFT, RIGHT, TOP, BOTTOM = 76.0, 36.0, 20.0, 52.0
MOST_LABELS = 24
_LINE = 13.0
"""Height of a label."""
_STYLE = "\n" + Path(__file__).with_suffix(".css").read_text(encoding="ascii")


def scatter_svg(results: Sequence[Result], best: Container[str], time: str, error: str) -> str:
    """Return results as a stand-alone SVG document for light and dark pages, with titles of the axes; without NaN.

    The `best`, by name, form the front.
    """
    shown = [r for r in results if math.isfinite(_ms(r)) and math.isfinite(r.metrics.flip)]
    right = _ceiling(max((r.times.headline.p90 for r in shown), default=1))
    up = _ceiling(max((r.metrics.flip for r in shown), default=1))

    def x(ms: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * min(ms, right) / right

    def y(value: float) -> float:
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * value / up

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" width="{WIDTH:.0f}" '
        f'height="{HEIGHT:.0f}" font-family="system-ui,\'DejaVu Sans\',sans-serif" font-size="12">',
        f"<title>{escape(error)} against {escape(time)}</title>",
        f"<style>{_STYLE}</style>",
    ]
    for part in range(6):
        parts.append(_tick(x(right * part / 5), HEIGHT - BOTTOM, _plain(right * part / 5), upright=True))
        parts.append(_tick(LEFT, y(up * part / 5), _plain(up * part / 5), upright=False))
    middle = (TOP + HEIGHT - BOTTOM) / 2
    for where, title in (
        (f'x="{(LEFT + WIDTH - RIGHT) / 2:.0f}" y="{HEIGHT - 10:.0f}"', time),
        (f'transform="translate(18 {middle:.0f}) rotate(-90)"', error),
    ):
        parts.append(f'<text class="fact" {where} text-anchor="middle">{escape(title)}</text>')
    front = sorted((r for r in shown if r.name in best), key=_ms)
    corners = [(x(_ms(r)), y(r.metrics.flip)) for r in front]
    if len(front) > 1:
        path = "M{:.1f} {:.1f}".format(*corners[0]) + "".join(f"H{left:.1f}V{top:.1f}" for left, top in corners[1:])
        parts.append(f'<path class="front" d="{path}" stroke-width="1.5" stroke-dasharray="5 4"/>')
    # Labels avoid points, lines and other labels; those of the front are placed first.
    spread = [(r, x(_ms(r)), x(r.times.headline.p10), x(r.times.headline.p90), y(r.metrics.flip)) for r in shown]
    taken = [_Spot(min(at - 7, low), max(at + 7, high), height) for _, at, low, high, height in spread]
    for (left, top), (across, down) in itertools.pairwise(corners):
        taken.append(_Spot(left, across, top))
        steps = math.ceil((down - top) / _LINE)
        taken += [_Spot(across - 1, across + 1, top + _LINE * step) for step in range(1, steps)]
    for result, at, low, high, height in sorted(spread, key=lambda one: (one[0].name not in best, _ms(one[0]))):
        ms = result.times.headline
        tooltip = f"{result.name}: {_plain(ms.median)} ms ({_plain(ms.p10)}–{_plain(ms.p90)}), "
        tooltip += _plain(result.metrics.flip)
        parts.append(
            f'<g><title>{escape(tooltip)}</title><path d="M{low:.1f} {height:.1f}H{high:.1f}" '
            f'stroke="#7d8590" stroke-opacity=".6"/>'
            f'<circle class="{"best" if result.name in best else "dot"}" cx="{at:.1f}" cy="{height:.1f}" r="5"/>'
        )
        if result.name in best or len(shown) <= MOST_LABELS:
            label = " · ".join(result.settings.values()) or result.name
            parts.append(_label(label, at, height, taken))
        parts.append("</g>")
    return "\n".join([*parts, "</svg>"]) + "\n"


def _ms(result: Result) -> float:
    return result.times.headline.median


@dataclass(frozen=True)
class _Spot:
    left: float
    right: float
    y: float

    def meets(self, other: _Spot) -> bool:
        return abs(self.y - other.y) < _LINE and self.left < other.right and other.left < self.right


def _label(text: str, x: float, y: float, taken: list[_Spot]) -> str:
    width = 6.8 * len(text)
    for shift in (0, -14, 14, -28, 28, -42, 42):
        for left in (x + 10, x - width - 10):
            spot = _Spot(left, left + width, y + shift)
            inside = left > LEFT and left + width < WIDTH and TOP < spot.y < HEIGHT - BOTTOM - 4
            if inside and not any(spot.meets(other) for other in taken):
                taken.append(spot)
                return f'<text class="ink" x="{left:.1f}" y="{spot.y + 4:.1f}">{escape(text)}</text>'
    return ""


def _tick(x: float, y: float, text: str, *, upright: bool) -> str:
    if upright:
        line = f'<path class="grid" d="M{x:.1f} {TOP:.0f}V{y:.1f}"/>'
        return line + f'<text class="fact" x="{x:.1f}" y="{y + 18:.1f}" text-anchor="middle">{text}</text>'
    line = f'<path class="grid" d="M{x:.1f} {y:.1f}H{WIDTH - RIGHT:.0f}"/>'
    return line + f'<text class="fact" x="{x - 8:.1f}" y="{y + 4:.1f}" text-anchor="end">{text}</text>'


def _plain(value: float) -> str:
    """Return three digits without an exponent: `1200`, `0.00015`."""
    return f"{float(f'{value:.3g}'):.12f}".rstrip("0").rstrip(".")


def _ceiling(value: float) -> float:
    if not value > 0 or not math.isfinite(value):
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1, 1.5, 2, 3, 4, 5, 7.5, 10) if step * power >= value * 0.999)
