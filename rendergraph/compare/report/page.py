"""The page itself."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from html import escape

from rendergraph.compare.product import Sweep, pareto
from rendergraph.compare.report.parts import (
    Section,
    card,
    drawing,
    eight_bit,
    heat,
    img,
    milliseconds,
    number,
    png,
    section,
    software_note,
    table,
)
from rendergraph.compare.report.scatter import Point, scatter_svg
from rendergraph.compare.values import Comparison, Result, machine
from rendergraph.diff import diff, diff_svg, diff_text
from rendergraph.images import viewable
from rendergraph.metrics import description
from rendergraph.resources import folder
from rendergraph.schedule.reasons import mebibytes
from rendergraph.views import lifetimes_svg

MOST_COLUMNS = 8
"""Variants whose passes stand side by side; more are not read, and the quickest good ones stand for them."""
_QUALITY = "Error against time"


def comparison_page(comparison: Comparison, command: str) -> str:
    """The report of `compare`.

    Args:
        comparison: what it shows.
        command: how to get it again.
    """
    names = [result.name for result in comparison.results]
    title = f"{names[0]} against {', '.join(names[1:])}" if names[1:] else names[0]
    shown_results = comparison.results[:MOST_COLUMNS]
    return _page(
        title,
        comparison,
        [
            section("summary", "Summary", _summary(comparison, front=()), software_note(comparison.software)),
            section("pictures", "Pictures", _viewer(comparison), _sheet(comparison)),
            section("first", "Where they part", _first(comparison)),
            section("passes", "Time of each pass", _passes(shown_results), software_note(comparison.software)),
            section(
                "quality",
                "Quality against time",
                drawing(quality_svg(comparison), _QUALITY),
                software_note(comparison.software),
            ),
            section("structure", "Structure", _structure(comparison)),
            section("memory", "Memory", _memory(comparison.results)),
        ],
        command,
    )


def sweep_page(found: Sweep, command: str) -> str:
    """The report of `sweep`.

    Args:
        found: what it shows.
        command: how to get it again.
    """
    comparison = found.comparison
    front = pareto(comparison.results)
    best = front[:MOST_COLUMNS]
    axes = card((axis.path, ", ".join(axis.values)) for axis in found.axes)
    saved = (
        f"<p>{found.executed} passes were drawn for {len(comparison.results) - found.resumed} runs that one by one "
        f"would have taken {found.alone}: what is the same in several runs is drawn once. "
        f"A run's time is the sum of its passes'.</p>"
    )
    return _page(
        f"Sweep of {comparison.results[0].source}",
        comparison,
        [
            section("axes", "Axes", axes, saved),
            section(
                "quality",
                "Quality against time",
                drawing(quality_svg(comparison, front), _QUALITY),
                _front_words(front),
                software_note(comparison.software),
            ),
            section("summary", "Runs", _summary(comparison, front=front), software_note(comparison.software)),
            section("pictures", "Pictures", _viewer(comparison), _sheet(comparison)),
            section("passes", "Time of each pass", _passes(best), software_note(comparison.software)),
            section("memory", "Memory", _memory(best)),
        ],
        command,
    )


def _page(title: str, comparison: Comparison, sections: Sequence[Section], command: str) -> str:
    home = folder("rendergraph") / "compare" / "report"
    style, script = ((home / f"page.{kind}").read_text(encoding="utf-8") for kind in ("css", "js"))
    width, height = comparison.size
    device = comparison.device
    facts = [comparison.scene, f"{width}×{height}", str(device.get("renderer", ""))]
    facts[1:1] = [f"camera {comparison.camera}"] if comparison.camera else []
    closing = [
        section("machine", "Machine", _machine(comparison)),
        section("again", "The same again", f"<pre><code>{escape(command)}</code></pre>", _notes(comparison)),
    ]
    filled = [part for part in [*sections, *closing] if part.body]
    links = "".join(part.link for part in filled)
    # Nothing may be fetched: the page says so to the browser, which then holds it to that.
    policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<link rel="icon" href="data:,">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n<header>\n"
        f"<h1>{escape(title)}</h1>\n"
        f'<p class="lead">{escape(" · ".join(fact for fact in facts if fact))}</p>\n'
        f'<nav aria-label="Sections">{links}</nav>\n</header>\n'
        + "\n".join(part.html for part in filled)
        + f"\n</main>\n<script>\n{script}</script>\n</body>\n</html>\n"
    )


# --- tables ----------------------------------------------------------------------------------------------------------


def _summary(comparison: Comparison, front: Sequence[Result]) -> str:
    plugins = list(dict.fromkeys(name for result in comparison.results for name in result.metrics.plugins))
    heads = [
        "",
        "#FLIP",
        "#RMSE",
        "#PSNR dB",
        "#SSIM",
        *(f"#{name}" for name in plugins),
        "#light RMSE",
        "#GPU ms",
        "#CPU ms",
        "#frame ms",
        "#passes",
        "#textures",
        "",
    ]
    whole = any(result.times.frame_ms for result in comparison.results)
    heads = heads if whole else [head for head in heads if head != "#frame ms"]
    most = max(result.times.headline.median for result in comparison.results)
    names = {result.name for result in front}
    rows = []
    for place, result in enumerate(comparison.results):
        m, times = result.metrics, result.times
        kinds = []
        if comparison.reference.kind == "variant" and result.name == comparison.reference.name:
            kinds.append("reference")
        if result.name in names:
            kinds.append("best")
        last = "Pareto front" if result.name in names else ""
        last += f' <button type="button" data-compare="pic-{place}">view</button>'
        cells = [
            f'<th scope="row">{escape(result.name.replace(",", ", "))}</th>',
            *(f'<td class="num">{number(value)}</td>' for value in (m.flip, m.rmse)),
            f'<td class="num">{"∞" if m.psnr is None else number(m.psnr, 2)}</td>',
            f'<td class="num">{number(m.ssim)}</td>',
            *(f'<td class="num">{number(m.plugins.get(name))}</td>' for name in plugins),
            f'<td class="num">{number(result.radiance_rmse)}</td>',
            milliseconds(times.gpu_ms, most if times.gpu_ms else 0),
            milliseconds(times.cpu_ms),
            milliseconds(times.frame_ms) if whole else "",
            f'<td class="num">{result.pass_count}</td>',
            f'<td class="num">{mebibytes(int(str(result.memory["allocated_bytes"])))}</td>',
            f"<td>{last}</td>",
        ]
        rows.append(f'<tr class="{" ".join(kinds)}">{"".join(cells)}</tr>')
    reference = comparison.reference
    of = "display-referred" if reference.encoding == "display" else "scene-linear"
    words = (
        f"<p class=quiet>Errors of the {of} output <code>{reference.output}</code> of frame {comparison.frame} against "
        f"<code>{escape(reference.name)}</code>. Times are medians of {comparison.results[0].times.frames} frames, "
        f"with the tenth to ninetieth percentile beneath.</p>"
    )
    return table(heads, rows, "Errors, times and memory") + words


def _passes(results: Sequence[Result]) -> str:
    order: list[str] = []
    for result in results:  # each pipeline's own order, later ones fitted into the first's
        at = 0
        for entry in result.times.passes:
            if entry.node in order:
                at = order.index(entry.node) + 1
            else:
                order.insert(at, entry.node)
                at += 1
    timed = all(entry.gpu_ms for result in results for entry in result.times.passes)
    found = {(r.name, p.node): (p.gpu_ms if timed else p.cpu_ms) for r in results for p in r.times.passes}
    most = max((spread.median for spread in found.values() if spread), default=0.0)
    rows = []
    for node in order:
        cells = [milliseconds(found.get((result.name, node)), most) for result in results]
        rows.append(f'<tr><th scope="row">{escape(node)}</th>{"".join(cells)}</tr>')
    total = "".join(milliseconds(r.times.gpu_ms if timed else r.times.cpu_ms) for r in results)
    rows.append(f'<tr><th scope="row">all</th>{total}</tr>')
    kind = "GPU" if timed else "CPU"
    heads = [f"pass, {kind} ms", *("#" + result.name.replace(",", ", ") for result in results)]
    return table(heads, rows, f"{kind} milliseconds of each pass")


# --- pictures --------------------------------------------------------------------------------------------------------


def _pictures(comparison: Comparison) -> list[tuple[str, str]]:
    """Identity and label of every picture in the sheet, the reference's first where it is no variant."""
    own = [(f"pic-{place}", result.name) for place, result in enumerate(comparison.results)]
    return own if comparison.reference.kind == "variant" else [("pic-ref", comparison.reference.name), *own]


def _viewer(comparison: Comparison) -> str:
    pictures = _pictures(comparison)

    def options(chosen: int) -> str:
        return "".join(
            f'<option value="{identity}"{" selected" if place == chosen else ""}>{escape(label)}</option>'
            for place, (identity, label) in enumerate(pictures)
        )

    modes = [("slide", "Slide", "s"), ("a", "A", "a"), ("b", "B", "b"), ("difference", "Difference", "d")]
    buttons = "".join(
        f'<button type="button" data-mode="{mode}" aria-pressed="{"true" if mode == "slide" else "false"}" '
        f'aria-keyshortcuts="{key}" title="key {key}">{label}</button>'
        for mode, label, key in modes
    )
    gains = "".join(f"<option{' selected' if gain == 8 else ''}>{gain}</option>" for gain in (1, 2, 4, 8, 16, 32, 64))
    zooms = "".join(
        f'<option value="{value}">{label}</option>'
        for value, label in (("fit", "fit"), ("1", "1:1"), ("2", "2:1"), ("4", "4:1"), ("8", "8:1"))
    )
    return f"""<div class="viewer" role="group" aria-label="Two pictures against each other">
<div class="controls">
<label>A <select data-a aria-label="Picture A">{options(0)}</select></label>
<label>B <select data-b aria-label="Picture B">{options(min(1, len(pictures) - 1))}</select></label>
<span class="group" role="group" aria-label="What is shown">{buttons}</span>
<label>times <select data-gain>{gains}</select></label>
<label>zoom <select data-zoom>{zooms}</select></label>
</div>
<div class="stage" data-stage tabindex="0" hidden><div class="frame"><div class="pile" data-frame>
<img data-under alt=""><img class="over" data-over alt=""><canvas data-canvas class="over" hidden></canvas>
<span class="cut" data-cut></span><span class="tag left" data-left></span><span class="tag right" data-right></span>
</div>
<input class="slider" data-slider type="range" min="0" max="100" step="0.5" value="50"
 aria-label="Where A ends and B begins">
</div></div>
<div class="readout num" data-readout aria-hidden="true"></div>
</div>
<p class="quiet">Drag over the picture, or focus the slider and use the arrow keys. Keys: <kbd>s</kbd> slide,
<kbd>a</kbd> and <kbd>b</kbd> one of them, <kbd>x</kbd> the other one, <kbd>d</kbd> the difference.</p>"""


def _sheet(comparison: Comparison) -> str:
    figures = []
    reference = comparison.reference
    if reference.kind != "variant":
        source = png(eight_bit(reference.pixels, reference.encoding))
        figures.append(_figure("pic-ref", source, f"{reference.name}, the reference"))
    for place, result in enumerate(comparison.results):
        figures.append(_figure(f"pic-{place}", png(eight_bit(result.pixels, result.encoding)), result.name))
    maps = [
        _figure("", png(heat(result.flip_map)), f"FLIP of {result.name}: {number(result.metrics.flip)}")
        for result in comparison.results
        if result.flip_map is not None and len(comparison.results) <= MOST_COLUMNS
    ]
    sheet = f'<h3>As drawn</h3><div class="sheet">{"".join(figures)}</div>'
    if maps:
        sheet += (
            f'<h3>FLIP, dark where equal, against {escape(reference.name)}</h3><div class="sheet">{"".join(maps)}</div>'
        )
    return sheet


def _figure(identity: str, source: str, caption: str) -> str:
    return f"<figure>{img(identity, source, caption)}<figcaption>{escape(caption)}</figcaption></figure>"


def _first(comparison: Comparison) -> str:
    parts = []
    base = comparison.base[0] if comparison.base else ""
    for result in comparison.results:
        if result.difference is None or result.name == base:
            continue
        first = result.first
        head = f"<h3>{escape(result.name)}</h3>"
        if first is None:
            parts.append(f"{head}<p>Every pass draws what it draws in <code>{escape(base)}</code>, bit by bit.</p>")
            continue
        name = f"<code>{escape(first.node)}.{escape(first.port)}</code>"
        was = f" (there <code>{escape(first.base_node)}</code>)" if first.base_node != first.node else ""
        was += escape(first.after)
        amount = (
            "in size"
            if first.most is None
            else f"in {100 * first.share:.3g} % of its texels, by up to {first.most:.4g}"
        )
        causes = ", ".join(f"<code>{escape(cause)}</code>" for cause in first.causes)
        why = f" What differs in structure up to there: {causes}." if causes else ""
        pair = "".join(
            _figure("", png(viewable(pixels, first.semantic)), f"{first.node}.{first.port} of {whose}")
            for pixels, whose in zip(first.pixels, (base, result.name), strict=True)
        )
        parts.append(
            f"{head}<p>The first pass that differs from <code>{escape(base)}</code> is {name}{was}: "
            f"{amount}.{why}</p>"
            f'<div class="pair">{pair}</div>'
        )
    return "\n".join(parts)


# --- drawings --------------------------------------------------------------------------------------------------------


def quality_svg(comparison: Comparison, front: Sequence[Result] = ()) -> str:
    """Error against time, a point a result, as an SVG document; the front is found where none is given."""
    results = comparison.results
    best = {result.name for result in (front or pareto(results))}
    points = []
    for result in results:
        time = result.times.headline
        points.append(
            Point(
                result.name,
                " · ".join(result.settings.values()) or result.name,
                time.median,
                time.p10,
                time.p90,
                result.metrics.flip,
                result.name in best,
            )
        )
    kind = "GPU" if results[0].times.gpu_ms else "frame"
    note = ", software rasteriser" if comparison.software else ""
    return scatter_svg(points, f"{kind} time, ms{note}", f"FLIP against {comparison.reference.name}")


def _front_words(front: Sequence[Result]) -> str:
    names = ", ".join(f"<code>{escape(result.name)}</code>" for result in front)
    return f"<p>No run is both quicker and nearer to the reference than these: {names}.</p>"


def _structure(comparison: Comparison) -> str:
    if comparison.base is None:
        return ""
    name, graph = comparison.base
    parts = []
    for result in comparison.results:
        if result.graph is None or result.name == name:
            continue
        difference = diff(graph, result.graph)
        title = f"{name} → {result.name}"
        if not difference:
            parts.append(f"<h3>{escape(title)}</h3><p>No difference.</p>")
        else:
            said = "\n".join(line.removeprefix("  ") for line in diff_text(difference).splitlines()[1:])
            picture = drawing(diff_svg(graph, result.graph, difference), title)
            parts.append(f"<h3>{escape(title)}</h3><pre>{escape(said)}</pre>{picture}")
    return "\n".join(parts)


def _memory(results: Sequence[Result]) -> str:
    parts = []
    for place, result in enumerate(result for result in results if result.plan is not None):
        assert result.plan is not None
        allocated = mebibytes(int(str(result.memory["allocated_bytes"])))
        svg = drawing(lifetimes_svg(result.plan), f"Lifetimes of the textures of {result.name}")
        state = " open" if place == 0 else ""
        parts.append(f"<details{state}><summary>{escape(result.name)}, {allocated}</summary>{svg}</details>")
    return "\n".join(parts)


def _machine(comparison: Comparison) -> str:
    device = comparison.device
    entries: list[tuple[str, object]] = [(key, value) for key, value in device.items() if not isinstance(value, dict)]
    entries += list(machine().items())
    told = description()
    entries.append(("FLIP", f"{told['flip']['library']}, {told['flip']['pixels_per_degree']} pixels per degree"))
    entries.append(("SSIM", f"{told['ssim']['window']}×{told['ssim']['window']} Gaussian, σ {told['ssim']['sigma']}"))
    entries.append(("made", datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")))
    return software_note(comparison.software) + card(entries)


def _notes(comparison: Comparison) -> str:
    return "".join(f"<p class=quiet>{escape(note)}.</p>" for note in comparison.notes)
