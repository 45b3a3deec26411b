"""A graph as an SVG picture: cards with ports, links coloured by what they carry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape

from rendergraph.diagrams.cards import Card, Link, Socket, cards, generations, links
from rendergraph.diagrams.layout import LANE, Box, layers_of, place, tie
from rendergraph.link import Endpoint, Graph

ROW, HEAD, PAD, RADIUS = 20.0, 40.0, 12.0, 4.0
CHARACTER = 6.65  # width of a character of the 11-pixel monospace, with some air
COLUMN_GAP = 60.0
FONT = "ui-monospace,'DejaVu Sans Mono',Menlo,Consolas,monospace"
TITLE_FONT = "system-ui,'DejaVu Sans',sans-serif"
MARGIN = 24.0

# One hue a meaning, each at least 3:1 against white and against near-black, so that links show on any page.
HUES = {
    "radiance": "#c2701c",
    "display_color": "#c2701c",
    "emissive": "#c2701c",
    "luminance": "#c2701c",
    "depth": "#3b7dd8",
    "linear_depth": "#3b7dd8",
    "shadow_map": "#3b7dd8",
    "normal": "#8a63d2",
    "albedo": "#8a63d2",
    "material": "#8a63d2",
    "visibility": "#2c9163",
    "occlusion": "#2c9163",
    "shadow": "#c94f7c",
}
GREY = "#7d8590"

STYLE = """
.card{fill:#ffffff;stroke:#7d8590}.head{fill:#e6eaef}.name{fill:#1f2328;font-weight:600;font-size:13px}
.type{fill:#57606a}.port{fill:#1f2328}.fact{fill:#57606a}.unused{opacity:.5}
.mark{fill-opacity:.1;stroke-width:2.5}.note{font-weight:600}.pointed{stroke-width:3}
@media (prefers-color-scheme:dark){.card{fill:#1c2128}.head{fill:#2d333b}.name,.port{fill:#e6edf3}
.type,.fact{fill:#9aa4af}}
"""


@dataclass(frozen=True)
class Mark:
    """What a picture points out about a node.

    Attributes:
        hue: colour of its frame and notes.
        notes: lines beneath its ports.
    """

    hue: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Sheet:
    """What is drawn: cards, the links between them, and the ports that are the pipeline's outputs, by their names."""

    title: str
    cards: Sequence[Card]
    links: Sequence[Link]
    outputs: Mapping[str, Endpoint]


def sheet(graph: Graph) -> Sheet:
    """All of a graph."""
    return Sheet(graph.name, cards(graph), links(graph), graph.outputs)


def svg(graph: Graph) -> str:
    """The graph as a stand-alone SVG document, left to right, for light and dark pages."""
    return draw(sheet(graph))


def draw(shown: Sheet, marks: Mapping[str, Mark] = {}, pointed: Mapping[Link, str] = {}) -> str:
    """A sheet as a stand-alone SVG document, left to right, for light and dark pages.

    Args:
        shown: what is drawn.
        marks: nodes to point out.
        pointed: links to point out, in a colour; what begins with `-` is dashed.
    """
    table = {card.id: replace(card, notes=marks[card.id].notes) if card.id in marks else card for card in shown.cards}
    for name, end in shown.outputs.items():
        made = next((socket for socket in table[end.node].outputs if socket.name == end.port), None)
        socket = Socket(name, made.kind if made else "texture2d", made.semantic if made else "any")
        table[f"output {name}"] = Card(f"output {name}", "", (socket,), ())
    found = list(shown.links)
    layer_of = layers_of(generations([card.id for card in shown.cards], found), found)
    found += [Link(end.node, end.port, f"output {name}", name) for name, end in shown.outputs.items()]
    last = max(layer_of.values(), default=-1) + 1
    layer_of |= {f"output {name}": last for name in shown.outputs}

    boxes = {id: Box(id, layer_of[id], _height(card)) for id, card in table.items()}
    columns: list[list[Box]] = [[] for _ in range(last + 1)]
    for box in boxes.values():
        columns[box.layer].append(box)
    trunks = _trunks(found, boxes, table, columns)
    place(columns)

    widths = [
        max((_width(table[str(box.key)]) for box in column if box.key in table), default=0.0) for column in columns
    ]
    lefts = [MARGIN + sum(widths[:number]) + COLUMN_GAP * number for number in range(len(widths))]
    bottom = max((box.y + box.height for column in columns for box in column), default=0.0)
    returns = [link for link in found if link.previous]
    width = (lefts[-1] + widths[-1] if widths else 0.0) + MARGIN
    height = bottom + 2 * MARGIN + (14 * len(returns) + 10 if returns else 0)

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'height="{height:.0f}" font-family="{FONT}" font-size="11">',
        f"<title>{escape(shown.title)}</title>",
        f"<style>{STYLE}</style>",
    ]
    for trunk in trunks:
        parts += _strokes(trunk, boxes, table, lefts, widths, pointed)
    for number, link in enumerate(returns):
        parts.append(_return(link, boxes, table, lefts, widths, MARGIN + bottom + 14 * (number + 1), pointed))
    for id, card in table.items():
        box = boxes[id]
        parts.append(_card(card, lefts[box.layer], box.y + MARGIN, widths[box.layer], marks.get(id)))
    return "\n".join([*parts, "</svg>"]) + "\n"


# --- measures --------------------------------------------------------------------------------------------------------


def _height(card: Card) -> float:
    return HEAD + ROW * (len(card.inputs) + len(card.outputs) + len(card.notes)) + 6 if card.type else 26.0


def _width(card: Card) -> float:
    if not card.type:
        return CHARACTER * len(card.inputs[0].name) + 4 * PAD
    texts = [len(card.id) * 1.2, len(card.kind)]
    texts += [len(socket.name) + (len(socket.carries) + 2 if socket.carries else 0) for socket in card.outputs]
    texts += [len(text) for text in (*(socket.name for socket in card.inputs), *card.notes)]
    return max(110.0, CHARACTER * max(texts) + 2 * PAD)


def _out_height(card: Card, port: str) -> float:
    return HEAD + ROW * ([socket.name for socket in card.outputs].index(port) + 0.5)


def _in_height(card: Card, port: str) -> float:
    if not card.type:
        return 13.0
    return HEAD + ROW * (len(card.outputs) + [socket.name for socket in card.inputs].index(port) + 0.5)


@dataclass
class Trunk:
    """Everything that leads from one output: it runs once through the columns, and readers branch off.

    Attributes:
        links: what it serves.
        lanes: the places it takes in the columns it passes, by column.
    """

    links: list[Link]
    lanes: dict[int, Box]


def _trunks(found: list[Link], boxes: dict[str, Box], table: dict[str, Card], columns: list[list[Box]]) -> list[Trunk]:
    """Give the links of every output their lanes, and tie boxes and lanes together."""
    by_port: dict[tuple[str, str], list[Link]] = {}
    for link in found:
        if not link.previous:
            by_port.setdefault((link.source, link.source_port), []).append(link)
    trunks = []
    for (source, port), served in by_port.items():
        start = boxes[source]
        lanes: dict[int, Box] = {}
        before, height = start, _out_height(table[source], port)
        for layer in range(start.layer + 1, max(boxes[link.target].layer for link in served)):
            lanes[layer] = Box((source, port, layer), layer, LANE)
            columns[layer].append(lanes[layer])
            tie(before, lanes[layer], height, LANE / 2)
            before, height = lanes[layer], LANE / 2
        for link in served:
            end = boxes[link.target]
            stop = lanes.get(end.layer - 1, start)
            here = LANE / 2 if stop is not start else _out_height(table[source], port)
            tie(stop, end, here, _in_height(table[link.target], link.target_port))
        trunks.append(Trunk(served, lanes))
    return trunks


# --- strokes ---------------------------------------------------------------------------------------------------------


def _hue(socket: Socket) -> str:
    return HUES.get(socket.semantic, GREY)


def _source_socket(link: Link, table: dict[str, Card]) -> Socket:
    return next(socket for socket in table[link.source].outputs if socket.name == link.source_port)


def _strokes(
    trunk: Trunk,
    boxes: dict[str, Box],
    table: dict[str, Card],
    lefts: list[float],
    widths: list[float],
    pointed: Mapping[Link, str],
) -> list[str]:
    first = trunk.links[0]
    start, card = boxes[first.source], table[first.source]
    hue = _hue(_source_socket(first, table))
    ends = {
        start.layer: (lefts[start.layer] + widths[start.layer], start.y + MARGIN + _out_height(card, first.source_port))
    }
    path = ""
    for layer, lane in trunk.lanes.items():
        y = lane.y + MARGIN + LANE / 2
        path += _bend(*ends[layer - 1], lefts[layer], y, begin=not path) + f"H{lefts[layer] + widths[layer]:.1f}"
        ends[layer] = (lefts[layer] + widths[layer], y)
    strokes = [_stroke(f"{first.source}.{first.source_port}", path, hue, "")] if path else []
    for link in trunk.links:
        end = boxes[link.target]
        y = end.y + MARGIN + _in_height(table[link.target], link.target_port)
        own, extra = _pointed(link, hue, pointed)
        strokes.append(_stroke(_title(link), _bend(*ends[end.layer - 1], lefts[end.layer], y, begin=True), own, extra))
    return strokes


def _bend(x: float, y: float, end_x: float, end_y: float, *, begin: bool) -> str:
    middle = (x + end_x) / 2
    start = f"M{x:.1f} {y:.1f}" if begin else ""
    return f"{start}C{middle:.1f} {y:.1f} {middle:.1f} {end_y:.1f} {end_x:.1f} {end_y:.1f}"


def _pointed(link: Link, hue: str, pointed: Mapping[Link, str]) -> tuple[str, str]:
    """Colour and style of a link."""
    if link not in pointed:
        return hue, ' stroke-dasharray="5 4"' if link.previous else ""
    own = pointed[link].removeprefix("-")
    return own, ' class="pointed"' + (' stroke-dasharray="3 5"' if pointed[link] != own else "")


def _return(
    link: Link,
    boxes: dict[str, Box],
    table: dict[str, Card],
    lefts: list[float],
    widths: list[float],
    lane: float,
    pointed: Mapping[Link, str],
) -> str:
    """Last frame's value: out to the right, back beneath everything, in from the left."""
    source, target = boxes[link.source], boxes[link.target]
    x = lefts[source.layer] + widths[source.layer]
    y = source.y + MARGIN + _out_height(table[link.source], link.source_port)
    end_x, end_y = lefts[target.layer], target.y + MARGIN + _in_height(table[link.target], link.target_port)
    out, back = x + COLUMN_GAP * 0.4, end_x - COLUMN_GAP * 0.4
    path = (
        f"M{x:.1f} {y:.1f}H{out - 8:.1f}"
        f"Q{out:.1f} {y:.1f} {out:.1f} {y + 8:.1f}V{lane - 8:.1f}Q{out:.1f} {lane:.1f} {out - 8:.1f} {lane:.1f}"
        f"H{back + 8:.1f}Q{back:.1f} {lane:.1f} {back:.1f} {lane - 8:.1f}V{end_y + 8:.1f}"
        f"Q{back:.1f} {end_y:.1f} {back + 8:.1f} {end_y:.1f}H{end_x:.1f}"
    )
    return _stroke(_title(link), path, *_pointed(link, _hue(_source_socket(link, table)), pointed))


def _title(link: Link) -> str:
    previous = "@previous" if link.previous else ""
    return f"{link.source}.{link.source_port}{previous} → {link.target}.{link.target_port}"


def _stroke(title: str, path: str, hue: str, extra: str) -> str:
    return (
        f'<path d="{path}" fill="none" stroke="{hue}" stroke-width="1.6"{extra}><title>{escape(title)}</title></path>'
    )


def _card(card: Card, x: float, y: float, column: float, mark: Mark | None = None) -> str:
    if not card.type:
        width = _width(card)
        return (
            f'<rect class="card" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="26" rx="13"/>'
            + _dot(x, y + 13, card.inputs[0])
            + f'<text class="port" x="{x + 2 * PAD:.1f}" y="{y + 17:.1f}">{escape(card.inputs[0].name)}</text>'
        )
    width, height = column, _height(card)
    dashes = ' stroke-dasharray="6 4"' if card.unknown else ""
    parts = [
        f'<rect class="card" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="6"{dashes}/>',
        f'<path class="head" d="M{x + 0.5:.1f} {y + HEAD - 4:.1f}v-{HEAD - 10.5:.1f}q0-6 6-6h{width - 13:.1f}q6 0 6 6'
        f'v{HEAD - 10.5:.1f}z"/>',
        f'<text class="name" x="{x + PAD:.1f}" y="{y + 16:.1f}" font-family="{TITLE_FONT}">{escape(card.id)}</text>',
        f'<text class="type" x="{x + PAD:.1f}" y="{y + 30:.1f}">{escape(card.kind)}</text>',
    ]
    for socket in card.outputs:
        middle = y + _out_height(card, socket.name)
        faint = "" if socket.used else " unused"
        parts.append(_dot(x + width, middle, socket))
        parts.append(
            f'<text class="port{faint}" x="{x + width - PAD:.1f}" y="{middle + 4:.1f}" text-anchor="end">'
            f'<tspan class="fact">{escape(socket.carries)}</tspan>  {escape(socket.name)}</text>'
        )
    for socket in card.inputs:
        middle = y + _in_height(card, socket.name)
        parts.append(_dot(x, middle, socket))
        parts.append(f'<text class="port" x="{x + PAD:.1f}" y="{middle + 4:.1f}">{escape(socket.name)}</text>')
    if mark is not None:
        parts.append(
            f'<rect class="mark" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="6" '
            f'fill="{mark.hue}" stroke="{mark.hue}"/>'
        )
        top = y + HEAD + ROW * (len(card.outputs) + len(card.inputs))
        for number, note in enumerate(card.notes):
            row = top + ROW * (number + 0.5) + 4
            parts.append(f'<text class="note" x="{x + PAD:.1f}" y="{row:.1f}" fill="{mark.hue}">{escape(note)}</text>')
    return "\n".join(parts)


def _dot(x: float, y: float, socket: Socket) -> str:
    fill = _hue(socket) if socket.used else "none"
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{RADIUS}" fill="{fill}" stroke="{_hue(socket)}" stroke-width="1.5">'
        f"<title>{escape(socket.kind)} · {escape(socket.semantic)}</title></circle>"
    )
