"""A graph as an SVG picture: cards with ports, and links coloured by semantic."""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.diagrams.markup import Card, Link, Socket, cards, element, links, svg_document, title
from rendergraph.link import Endpoint, Graph

ROW, HEAD, PAD, RADIUS = 20.0, 40.0, 12.0, 4.0
CHARACTER = 6.65  # width of a character of the 11-pixel monospace, with some margin
COLUMN_GAP = 60.0
SWEEPS = 8
GAP = 26.0  # between boxes of a column
LANE = 12.0  # height that a passing link takes within a column
TITLE_FONT = "system-ui,'DejaVu Sans',sans-serif"
MARGIN = 24.0

# One colour per semantic, with a contrast of at least 3:1 against white and near-black, to be visible on any page.
COLORS = {
    **dict.fromkeys(("radiance", "display_color", "emissive", "luminance", "irradiance", "reflections"), "#c2701c"),
    **dict.fromkeys(("depth", "linear_depth", "shadow_map"), "#3b7dd8"),
    **dict.fromkeys(("normal", "albedo", "material", "reflectance"), "#8a63d2"),
    **dict.fromkeys(("visibility", "occlusion"), "#2c9163"),
    "shadow": "#c94f7c",
}
GREY = "#7d8590"

STYLE = "\n" + Path(__file__).with_suffix(".css").read_text(encoding="ascii")


class Mark(Struct, frozen=True):
    """The colour in which a node is highlighted, and lines beneath its ports."""

    color: str
    notes: tuple[str, ...] = ()


class Sheet(Struct, frozen=True):
    """The content of a picture: cards, links, and the ports that are the pipeline's outputs, by their names."""

    title: str
    cards: Sequence[Card]
    links: Sequence[Link]
    outputs: Mapping[str, Endpoint]


class Box(Struct, eq=False):
    """A card, or the place where a link passes through a column."""

    key: object  # the node's id, or anything unique for a passing link
    layer: int
    height: float
    y: float = 0.0  # top edge
    ties: list[tuple[Box, float, float]] = []  # linked boxes, with the heights of both ends of the link


class Trunk(Struct):
    """All links from one output: one line runs through the columns, and readers branch off."""

    links: list[Link]
    lanes: dict[int, Box]  # the places that it takes, by column


def sheet(graph: Graph) -> Sheet:
    return Sheet(graph.name, cards(graph), links(graph), graph.outputs)


def svg(graph: Graph) -> str:
    return draw(sheet(graph))


def draw(content: Sheet, marks: Mapping[str, Mark] = {}, highlights: Mapping[Link, str] = {}) -> str:
    """Return a stand-alone SVG document, left to right, for light and dark pages.

    Marks highlight nodes and highlights links, with a colour; a `-` before the colour means dashed.
    """
    return _Picture(content, marks, highlights).draw()


class _Picture:
    def __init__(self, content: Sheet, marks: Mapping[str, Mark], highlights: Mapping[Link, str]) -> None:
        self.title, self.marks, self.highlights = content.title, marks, highlights
        self.cards = {
            card.id: replace(card, notes=marks[card.id].notes) if card.id in marks else card for card in content.cards
        }
        self.links = list(content.links)
        layer_of = layers_of([card.id for card in content.cards], self.links)
        last = max(layer_of.values(), default=-1) + 1
        for name, end in content.outputs.items():
            source = next((socket for socket in self.cards[end.node].outputs if socket.name == end.port), None)
            socket = Socket(name, source.kind if source else "texture2d", source.semantic if source else "any")
            key = f"output {name}"
            self.cards[key] = Card(key, "", (socket,), ())
            self.links.append(Link(end.node, end.port, key, name))
            layer_of[key] = last
        self.boxes = {id: Box(id, layer_of[id], _height(card)) for id, card in self.cards.items()}
        columns: list[list[Box]] = [[] for _ in range(last + 1)]
        for box in self.boxes.values():
            columns[box.layer].append(box)
        self.trunks = self._make_trunks(columns)
        place(columns)
        self.widths = [
            max((_width(self.cards[str(box.key)]) for box in column if box.key in self.cards), default=0.0)
            for column in columns
        ]
        self.lefts = [MARGIN + sum(self.widths[:number]) + COLUMN_GAP * number for number in range(len(columns))]
        self.bottom = max((box.y + box.height for column in columns for box in column), default=0.0)

    def _make_trunks(self, columns: list[list[Box]]) -> list[Trunk]:
        """Assign lanes to the links of every output, and tie boxes and lanes together."""
        by_port: dict[tuple[str, str], list[Link]] = {}
        for link in self.links:
            if not (link.previous or link.back):
                by_port.setdefault((link.source, link.source_port), []).append(link)
        trunks = []
        for (source, port), members in by_port.items():
            start, start_height = self.boxes[source], _out_height(self.cards[source], port)
            trunk = Trunk(members, {})
            before, height = start, start_height
            for layer in range(start.layer + 1, max(self.boxes[link.target].layer for link in members)):
                lane = trunk.lanes[layer] = Box((source, port, layer), layer, LANE)
                columns[layer].append(lane)
                tie(before, lane, height, LANE / 2)
                before, height = lane, LANE / 2
            for link in members:
                end = self.boxes[link.target]
                stop = trunk.lanes.get(end.layer - 1, start)
                here = LANE / 2 if stop is not start else start_height
                tie(stop, end, here, _in_height(self.cards[link.target], link.target_port))
            trunks.append(trunk)
        return trunks

    def draw(self) -> str:
        returns = [link for link in self.links if link.previous or link.back]
        width = (self.lefts[-1] + self.widths[-1] if self.widths else 0.0) + MARGIN
        height = self.bottom + 2 * MARGIN + (14 * len(returns) + 10 if returns else 0)
        parts = [title(self.title), f"<style>{STYLE}</style>"]
        for trunk in self.trunks:
            parts += self._trunk(trunk)
        for number, link in enumerate(returns, start=1):
            parts.append(self._return(link, MARGIN + self.bottom + 14 * number))
        for id, card in self.cards.items():
            layer, y = self.boxes[id].layer, self.boxes[id].y + MARGIN
            if card.type:
                parts += _card(card, self.lefts[layer], y, self.widths[layer], self.marks.get(id))
            else:
                parts.append(_pill(card, self.lefts[layer], y))
        return svg_document(width, height, parts)

    def _source(self, link: Link) -> tuple[float, float]:
        box = self.boxes[link.source]
        right = self.lefts[box.layer] + self.widths[box.layer]
        return right, box.y + MARGIN + _out_height(self.cards[link.source], link.source_port)

    def _target(self, link: Link) -> tuple[float, float]:
        box = self.boxes[link.target]
        return self.lefts[box.layer], box.y + MARGIN + _in_height(self.cards[link.target], link.target_port)

    def _color(self, link: Link) -> str:
        return _color(next(s for s in self.cards[link.source].outputs if s.name == link.source_port))

    def _trunk(self, trunk: Trunk) -> Iterator[str]:
        first = trunk.links[0]
        ends = {self.boxes[first.source].layer: self._source(first)}
        path = ""
        for layer, lane in trunk.lanes.items():
            y = lane.y + MARGIN + LANE / 2
            right = self.lefts[layer] + self.widths[layer]
            path += _bend(ends[layer - 1], (self.lefts[layer], y), begin=not path) + f"H{right:.1f}"
            ends[layer] = (right, y)
        if path:
            yield _stroke(f"{first.source}.{first.source_port}", path, self._color(first))
        for link in trunk.links:
            start = ends[self.boxes[link.target].layer - 1]
            yield self._link(link, _bend(start, self._target(link), begin=True))

    def _return(self, link: Link, lane: float) -> str:
        """Return the path of a link to last frame's value, or of one that closes a cycle: back beneath all cards."""
        (x, y), (end_x, end_y) = self._source(link), self._target(link)
        out, back = x + COLUMN_GAP * 0.4, end_x - COLUMN_GAP * 0.4
        return self._link(
            link,
            f"M{x:.1f} {y:.1f}H{out - 8:.1f}"
            f"Q{out:.1f} {y:.1f} {out:.1f} {y + 8:.1f}V{lane - 8:.1f}Q{out:.1f} {lane:.1f} {out - 8:.1f} {lane:.1f}"
            f"H{back + 8:.1f}Q{back:.1f} {lane:.1f} {back:.1f} {lane - 8:.1f}V{end_y + 8:.1f}"
            f"Q{back:.1f} {end_y:.1f} {back + 8:.1f} {end_y:.1f}H{end_x:.1f}",
        )

    def _link(self, link: Link, path: str) -> str:
        previous = "@previous" if link.previous else ""
        text = f"{link.source}.{link.source_port}{previous} → {link.target}.{link.target_port}"
        if link not in self.highlights:
            return _stroke(text, path, self._color(link), stroke_dasharray="5 4" if link.previous else None)
        color = self.highlights[link].removeprefix("-")
        dashes = "3 5" if self.highlights[link] != color else None
        return _stroke(text, path, color, class_="pointed", stroke_dasharray=dashes)


# --- layout: the column of every node, the order within columns, then the heights ------------------------------------


def layers_of(nodes: Sequence[str], links: Sequence[Link]) -> dict[str, int]:
    """Return the column of every node: as early as possible, but nodes without inputs next to their first reader."""
    import networkx as nx  # takes longer than checking a pipeline

    links = [link for link in links if not (link.previous or link.back)]
    dag: nx.DiGraph[str] = nx.DiGraph()
    dag.add_nodes_from(nodes)
    dag.add_edges_from((link.source, link.target) for link in links)
    layer = {id: place for place, members in enumerate(nx.topological_generations(dag)) for id in members}
    targets: dict[str, list[int]] = {}
    for link in links:
        targets.setdefault(link.source, []).append(layer[link.target])
    fed = {link.target for link in links}
    return {id: min(targets[id]) - 1 if id not in fed and id in targets else place for id, place in layer.items()}


def tie(one: Box, other: Box, here: float, there: float) -> None:
    """Connect two boxes at the given heights from their tops."""
    one.ties.append((other, here, there))
    other.ties.append((one, there, here))


def place(columns: list[list[Box]]) -> None:
    """Order the boxes of each column so that few links cross, then set heights close to those of linked boxes."""
    best, fewest = [list(column) for column in columns], _crossings(columns)
    for sweep in range(SWEEPS):
        for column in columns:
            _number(column)
        side = -1 if sweep % 2 == 0 else 1
        for column in columns[::-side]:
            rank = {id(box): _middle(box, side) for box in column}
            column.sort(key=lambda box: (rank[id(box)], box.y))
            _number(column)
        crossings = _crossings(columns)
        if crossings < fewest:
            best, fewest = [list(column) for column in columns], crossings
    for column, order in zip(columns, best, strict=True):
        column[:] = order
        y = 0.0
        for box in column:
            box.y = y
            y += box.height + GAP
    for sweep in range(SWEEPS):
        for column in columns if sweep % 2 == 0 else reversed(columns):
            _settle(column)
    top = min((box.y for column in columns for box in column), default=0.0)
    for column in columns:
        for box in column:
            box.y -= top


def _number(column: Sequence[Box]) -> None:
    for number, box in enumerate(column):
        box.y = float(number)


def _middle(box: Box, side: int) -> float:
    """Return the mean position of the linked boxes on one side, with fractions for ports; its own if there are none."""
    ends = [other.y + there / (other.height + 1) for other, _, there in box.ties if other.layer == box.layer + side]
    return sum(ends) / len(ends) if ends else box.y


def _crossings(columns: Sequence[Sequence[Box]]) -> int:
    place_of = {id(box): number for column in columns for number, box in enumerate(column)}
    total = 0
    for column in columns:
        ends = sorted(
            ((number, here), (place_of[id(other)], there))
            for number, box in enumerate(column)
            for other, here, there in box.ties
            if other.layer == box.layer + 1
        )
        open_ends: list[tuple[int, float]] = []
        for _, end in ends:
            total += len(open_ends) - bisect_right(open_ends, end)
            insort(open_ends, end)
    return total


def _settle(column: list[Box]) -> None:
    """Move each box as close to its linked boxes as the order allows: least squares without overlap.

    After subtracting the heights of preceding boxes, offsets must not decrease: pool adjacent violators (Barlow,
    Bartholomew, Bremner and Brunk 1972).
    """
    offset = 0.0
    pools: list[tuple[float, float, int]] = []  # mean, weight, boxes
    for box in column:
        wishes = [other.y + there - here for other, here, there in box.ties]
        wish = (sum(wishes) / len(wishes) if wishes else box.y) - offset
        pools.append((wish, max(1.0, float(len(wishes))), 1))
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            (a, wa, na), (b, wb, nb) = pools[-2:]
            pools[-2:] = [((a * wa + b * wb) / (wa + wb), wa + wb, na + nb)]
        offset += box.height + GAP
    offset = 0.0
    means = [mean for mean, _, number in pools for _ in range(number)]
    for box, mean in zip(column, means, strict=True):
        box.y = mean + offset
        offset += box.height + GAP


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


# --- shapes ----------------------------------------------------------------------------------------------------------


def _color(socket: Socket) -> str:
    return COLORS.get(socket.semantic, GREY)


def _bend(start: tuple[float, float], end: tuple[float, float], *, begin: bool) -> str:
    (x, y), (end_x, end_y) = start, end
    middle = (x + end_x) / 2
    move = f"M{x:.1f} {y:.1f}" if begin else ""
    return f"{move}C{middle:.1f} {y:.1f} {middle:.1f} {end_y:.1f} {end_x:.1f} {end_y:.1f}"


def _stroke(text: str, path: str, color: str, **attributes: str | None) -> str:
    return element("path", title(text), d=path, fill="none", stroke=color, stroke_width=1.6, **attributes)


def _pill(card: Card, x: float, y: float) -> str:
    socket = card.inputs[0]
    frame = element("rect", class_="card", x=x, y=y, width=_width(card), height=26, rx=13)
    return (
        frame + _dot(x, y + 13, socket) + element("text", escape(socket.name), class_="port", x=x + 2 * PAD, y=y + 17)
    )


def _card(card: Card, x: float, y: float, width: float, mark: Mark | None) -> Iterator[str]:
    frame = {"x": x, "y": y, "width": width, "height": _height(card), "rx": 6}
    left, side = x + PAD, HEAD - 10.5
    yield element("rect", class_="card", **frame, stroke_dasharray="6 4" if card.unknown else None)
    head = f"M{x + 0.5:.1f} {y + HEAD - 4:.1f}v-{side:.1f}q0-6 6-6h{width - 13:.1f}q6 0 6 6v{side:.1f}z"
    yield element("path", class_="head", d=head)
    yield element("text", escape(card.id), class_="name", x=left, y=y + 16, font_family=TITLE_FONT)
    yield element("text", escape(card.kind), class_="type", x=left, y=y + 30)
    for socket in card.outputs:
        middle = y + _out_height(card, socket.name)
        yield _dot(x + width, middle, socket)
        text = f"{element('tspan', escape(socket.carries), class_='fact')}  {escape(socket.name)}"
        kind = "port" if socket.used else "port unused"
        yield element("text", text, class_=kind, x=x + width - PAD, y=middle + 4, text_anchor="end")
    for socket in card.inputs:
        middle = y + _in_height(card, socket.name)
        yield _dot(x, middle, socket)
        yield element("text", escape(socket.name), class_="port", x=left, y=middle + 4)
    if mark is not None:
        yield element("rect", class_="mark", **frame, fill=mark.color, stroke=mark.color)
        top = y + HEAD + ROW * (len(card.outputs) + len(card.inputs))
        for number, note in enumerate(card.notes):
            row = top + ROW * (number + 0.5) + 4
            yield element("text", escape(note), class_="note", x=left, y=row, fill=mark.color)


def _dot(x: float, y: float, socket: Socket) -> str:
    color, text = _color(socket), title(f"{socket.kind} · {socket.semantic}")
    fill = color if socket.used else "none"
    return element("circle", text, cx=x, cy=y, r=RADIUS, fill=fill, stroke=color, stroke_width=1.5)
