"""The report of a comparison or a sweep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from html import escape

from rendergraph.compare.engine import Sweep
from rendergraph.compare.report import html as blocks
from rendergraph.compare.report.html import card, drawing, milliseconds, number, section, software_note, table
from rendergraph.compare.report.scatter import scatter_svg
from rendergraph.compare.results import Comparison, Result, Search, machine, pareto
from rendergraph.compare.timing import Times
from rendergraph.diagrams import lifetimes_svg
from rendergraph.diff import diff, diff_svg, diff_text
from rendergraph.formatting import format_bytes
from rendergraph.metrics import description

MOST_COLUMNS = 8
"""Maximum number of variants whose passes are compared side by side; of more, those on the front."""
_MOST_NOTEBOOK_PICTURES = 6
_NOTEBOOK_STYLE = """
.rendergraph .sheet{display:flex;flex-wrap:wrap;gap:12px}.rendergraph figure{margin:0;max-width:320px}
.rendergraph img{width:100%;border:1px solid #7d8590}.rendergraph .spread{display:block;opacity:.7}
.rendergraph .bar{display:none}
"""


def comparison_page(comparison: Comparison, command: str, *, title: str = "", note: str = "") -> str:
    """Return the report of `compare`; `command` repeats it, `note` is a text whose empty lines separate paragraphs."""
    names = [result.name for result in comparison.results]
    title = title or (f"{names[0]} against {', '.join(names[1:])}" if names[1:] else names[0])
    measured = all(result.memory for result in comparison.results)
    times = _times(comparison, comparison.results[:MOST_COLUMNS], ()) if measured else ()
    structure = "Structure" if measured else "Pipelines in the pictures' metadata"
    sections = [
        section("summary", "Summary", _summary(comparison, front=()), software_note(comparison.software)),
        section("pictures", "Pictures", blocks.viewer(comparison), blocks.sheet(comparison, MOST_COLUMNS)),
        section("light", "Light against the truth", *_light(comparison)),
        section("first", "First difference", blocks.first_differences(comparison)),
        section("times", "Times", *times),
        section("structure", structure, _structure(comparison)),
        section("memory", "Memory", _memory(comparison.results)),
    ]
    return _page(title, note, comparison, sections, command)


def sweep_page(sweep: Sweep, command: str, *, title: str = "", note: str = "") -> str:
    """Return the report of `sweep`; the arguments are those of `comparison_page`."""
    comparison = sweep.comparison
    front = pareto(comparison.results)
    best = front[:MOST_COLUMNS]
    axes = card((axis.path, axis.text.replace(",", ", ")) for axis in sweep.space.axes)
    failed = card((f"{failure.name} failed", failure.text) for failure in sweep.failures)
    names = ", ".join(f"<code>{escape(result.name)}</code>" for result in front)
    best_words = f"<p>No run is both faster and nearer to the reference than these: {names}.</p>"
    saved = (
        f"<p>{sweep.executed} passes were executed for {len(comparison.results) - sweep.resumed} runs, which need "
        f"{sweep.alone} one by one: passes that several runs share are executed once. "
        f"A run's time is the sum of its passes'.</p>"
    )
    sections = [
        section("axes", "Axes", axes, saved),
        section("search", "Search", _search(sweep.search) if sweep.search else ""),
        section("summary", "Runs", _summary(comparison, front=front), failed, software_note(comparison.software)),
        section("pictures", "Pictures", blocks.viewer(comparison), blocks.sheet(comparison, MOST_COLUMNS)),
        section("light", "Light against the truth", *_light(comparison)),
        section("times", "Times", *_times(comparison, best, front), best_words),
        section("memory", "Memory", _memory(best)),
    ]
    return _page(title or f"Sweep of {comparison.results[0].source}", note, comparison, sections, command)


def notebook_html(comparison: Comparison) -> str:
    """Return the first pictures and the summary for a notebook, whose page has styles of its own."""
    results, (width, height) = comparison.results, comparison.size
    shown = [result for result in results if result.pixels is not None][:_MOST_NOTEBOOK_PICTURES]
    pictures = blocks.sheet(replace(comparison, results=tuple(shown)), _MOST_NOTEBOOK_PICTURES)
    plain = replace(comparison, results=tuple(replace(result, pixels=None) for result in results))  # without buttons
    about = ", ".join(filter(None, (comparison.scene, f"{width}×{height}")))
    summary = f"{_summary(plain, ())}<p>{escape(about)}</p>{software_note(comparison.software)}"
    return f'<div class="rendergraph"><style>{_NOTEBOOK_STYLE}</style>{pictures}{summary}</div>'


def _search(search: Search) -> str:
    rows = []
    for name in search.front:
        cells = "".join(_cell(_value(value)) for value in search.values[name])
        rows.append(f'<tr><th scope="row">{escape(name.replace(",", ", "))}</th>{cells}</tr>')
    what = " and ".join(f"<code>{escape(name)}</code>" for name in search.minimise)
    one = len(search.minimise) == 1
    words = f"{'The least' if one else 'The front of the least'} {what} of {len(search.order)} runs."
    steps = ", ".join(f"{_value(value)} after {place}" for place, value in search.improvements())
    words += f" The best <code>{escape(search.minimise[0])}</code> was {steps}." if steps else ""
    heads = ["", *(f"#{name}" for name in search.minimise)]
    return table(heads, rows, "Best runs of the search") + f"<p class=quiet>{words}</p>"


def _value(value: float) -> str:
    return f"{value:,.0f}" if value >= 1e4 else number(value)


def _times(comparison: Comparison, results: Sequence[Result], front: Sequence[Result]) -> tuple[str, str]:
    chart = drawing(quality_svg(comparison, front), "Error against time")
    return f'<div class="beside"><div>{_passes(results)}</div>{chart}</div>', software_note(comparison.software)


def _page(title: str, note: str, comparison: Comparison, sections: Sequence[tuple[str, str]], command: str) -> str:
    width, height = comparison.size
    device = comparison.device
    facts = [comparison.scene, f"{width}×{height}", str(device.get("renderer", ""))]
    facts[1:1] = [f"camera {comparison.camera}"] if comparison.camera else []
    quiet = "".join(f"<p class=quiet>{escape(note)}.</p>" for note in comparison.notes)
    repeat = f"<pre><code>{escape(command)}</code></pre>"
    closing = section("again", "Command", repeat, quiet, _folded("The machine", _machine(comparison)))
    links, bodies = (list(filter(None, column)) for column in zip(*sections, closing, strict=True))
    notes = [f'<p class="note">{escape(part.strip())}</p>\n' for part in note.split("\n\n") if part.strip()]
    # Nothing may be fetched: the page says so to the browser, which then holds it to that.
    return blocks.template(
        "page.html",
        title=escape(title),
        style=blocks.template("page.css"),
        lead=escape(" · ".join(fact for fact in facts if fact)),
        notes="".join(notes),
        links="".join(links),
        bodies="\n".join(bodies),
        script=blocks.template("page.js"),
    )


# --- tables ----------------------------------------------------------------------------------------------------------


def _summary(comparison: Comparison, front: Sequence[Result]) -> str:
    results, reference = comparison.results, comparison.reference
    measured = all(result.memory for result in results)
    again = measured and any(result.times.repeated for result in results)
    most = max(result.times.headline.median for result in results)
    columns: list[tuple[str, Callable[[Result], str]]] = [
        ("FLIP", lambda r: _cell(number(r.metrics.flip))),
        ("RMSE", lambda r: _cell(number(r.metrics.rmse))),
        ("PSNR dB", lambda r: _cell("∞" if r.metrics.psnr is None else number(r.metrics.psnr, 2))),
        ("SSIM", lambda r: _cell(number(r.metrics.ssim))),
    ]
    for name in dict.fromkeys(name for result in results for name in result.columns):
        columns.append((name, partial(lambda name, r: _cell(number(r.columns.get(name))), name)))
    if any(result.radiance_rmse is not None for result in results):
        columns.append(("light RMSE", lambda r: _cell(number(r.radiance_rmse))))
        columns.append(("rel. MSE", lambda r: _cell(number(r.relative_mse))))
    if measured:
        columns.append(("GPU ms", lambda r: milliseconds(r.times.gpu_ms, most)))
        if again:
            columns.append(("repeats", lambda r: _cell(_repeats(r.times))))
        columns.append(("CPU ms", lambda r: milliseconds(r.times.cpu_ms)))
        if any(result.times.frame_ms for result in results):
            columns.append(("frame ms", lambda r: milliseconds(r.times.frame_ms)))
        columns.append(("passes", lambda r: _cell(str(r.pass_count))))
        columns.append(("textures", lambda r: _cell(format_bytes(r.allocated_bytes))))
    names = {result.name for result in front}
    rows = []
    for place, result in enumerate(results):
        is_reference = reference.kind == "variant" and result.name == reference.name
        kinds = ["reference"] * is_reference + ["best"] * (result.name in names)
        last = "Pareto front" if result.name in names else ""
        if result.pixels is not None:
            last += f' <button type="button" data-compare="pic-{place}">view</button>'
        cells = f'<th scope="row">{escape(result.name.replace(",", ", "))}</th>'
        cells += "".join(cell(result) for _, cell in columns)
        rows.append(f'<tr class="{" ".join(kinds)}">{cells}<td>{last}</td></tr>')
    of = {"display": "display-referred ", "linear": "scene-linear "}.get(reference.encoding, "")
    kind, name = ("port", escape(comparison.metric)) if comparison.metric else ("output", reference.output)
    named = f"{kind} <code>{name}</code>"
    what = f"the {of}{named} of frame {comparison.frame}" if measured else f"{of}pictures"
    words = f"Errors of {what} against <code>{escape(reference.name)}</code>."
    if measured:
        frames = comparison.results[0].times.frames
        many = f"medians of {frames} frames, with the 10th to 90th percentile beneath"
        words += f" Times are {many if frames > 1 else 'of one frame'}."
        words += " Repeats are the least and greatest median of several measurements." if again else ""
    heads = ["", *(f"#{name}" for name, _ in columns), ""]
    return table(heads, rows, "Errors, times and memory") + f"<p class=quiet>{words}</p>"


def _repeats(times: Times) -> str:
    medians = times.repeated
    return f"{number(medians.min, 2)}–{number(medians.max, 2)} ({len(times.repeats)})" if medians else "–"


def _cell(text: str) -> str:
    return f'<td class="num">{text}</td>'


def _passes(results: Sequence[Result]) -> str:
    order: list[str] = []
    for result in results:  # each pipeline's own order, later ones fitted into the first's
        at = 0
        for entry in result.times.passes:
            if entry.node not in order:
                order.insert(at, entry.node)
            at = order.index(entry.node) + 1
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


# --- drawings --------------------------------------------------------------------------------------------------------


def quality_svg(comparison: Comparison, front: Sequence[Result] = ()) -> str:
    """Return error against time as an SVG document, with a point for each result; the front is computed if missing."""
    results = comparison.results
    best = {result.name for result in (front or pareto(results))}
    kind = "GPU" if results[0].times.gpu_ms else "frame"
    note = ", software rasteriser" if comparison.software else ""
    return scatter_svg(results, best, f"{kind} time, ms{note}", f"FLIP against {comparison.reference.name}")


def _light(comparison: Comparison) -> tuple[str, str, str]:
    """Return the noise of a truth, where light is too dark or too bright, and which techniques cause the error."""
    reference, share = comparison.reference, comparison.noise_share
    if reference.noise is None:
        return "", "", ""
    part = f", which is {number(100 * share, 2)} % of the smallest error" if share is not None else ""
    noise = (
        f"<p>Light is measured before bloom and display, against {reference.samples} samples of each pixel of "
        f"<code>{escape(reference.name)}</code>. Their own noise adds {number(reference.noise)} to each relative mean "
        f"square error{part}. As much noise again changes the picture by a FLIP of {number(reference.flip_noise)}.</p>"
    )
    return noise, blocks.signed_sheet(comparison, MOST_COLUMNS), _error_by(comparison)


def _error_by(comparison: Comparison) -> str:
    rows = []
    for result in comparison.results:
        most = result.relative_mse or 0.0
        for place, one in enumerate(result.error_by):
            left, cut = one.relative_mse, one.reduction
            bar = f'<span class="bar" style="width:{100 * min(1.0, left / most):.1f}%"></span>' if left and most else ""
            rows.append(
                f'<tr><th scope="row">{escape(result.name if place == 0 else "")}</th>'
                f"<td>{escape(one.node)}</td><td>{escape(one.type)}</td><td>{escape(one.twin)}</td>"
                f'<td class="num">{number(left)}{bar}</td>{_cell("–" if cut is None else f"{100 * cut:+.1f} %")}</tr>'
            )
    if not rows:
        return ""
    causes = "".join(f"<p>{escape(f'{r.name}: {r.cause}.')}</p>" for r in comparison.results if r.cause)
    words = f"<p>Each technique was replaced by its exact twin in turn.</p>{causes}"
    heads = ["", "technique", "type", "twin", "#rel. MSE with the twin", "#reduction"]
    return "<h3>Where the error comes from</h3>" + words + table(heads, rows, "Error with each technique's twin")


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
            parts.append(f"<p>{escape(title)}: no difference.</p>")
            continue
        lines = [line.removeprefix("  ") for line in diff_text(difference).splitlines()[1:]]
        changes = f"{len(lines)} change{'s' if len(lines) > 1 else ''}"
        picture = drawing(diff_svg(graph, result.graph, difference), title)
        parts.append(_folded(f"{title}: {changes}", f"<pre>{escape(chr(10).join(lines))}</pre>{picture}"))
    return "\n".join(parts)


def _memory(results: Sequence[Result]) -> str:
    parts = []
    for result in results:
        if result.plan is not None:
            svg = drawing(lifetimes_svg(result.plan), f"Lifetimes of the textures of {result.name}")
            parts.append(_folded(f"{result.name}, {format_bytes(result.allocated_bytes)}", svg))
    return "\n".join(parts)


def _machine(comparison: Comparison) -> str:
    device = {key: value for key, value in comparison.device.items() if not isinstance(value, dict)}
    flip, ssim = description()["flip"], description()["ssim"]
    made = {
        "FLIP": f"{flip['library']}, {flip['pixels_per_degree']} pixels per degree",
        "SSIM": f"{ssim['window']}×{ssim['window']} Gaussian, σ {ssim['sigma']}",
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    }
    return card([*device.items(), *machine().items(), *made.items()])


def _folded(title: str, body: str) -> str:
    return f"<details><summary>{escape(title)}</summary>{body}</details>"
