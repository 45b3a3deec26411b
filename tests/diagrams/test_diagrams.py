"""Graphs and plans as text, DOT, Mermaid, SVG and JSON."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from rendergraph.allocate import ResourcePlan, allocate
from rendergraph.catalog import NodeType
from rendergraph.declare import Facts, Function, InOut, Input, LightFacts, Node, Output, TextureInfo, param
from rendergraph.diagrams import dot, graph_json, lifetimes_svg, mermaid, plan_json, plan_text, svg, text
from rendergraph.expand import Expansion
from rendergraph.link import Endpoint, Graph, GraphNode
from rendergraph.schedule import schedule
from rendergraph.steps import Read, Resource, Step, Write
from rendergraph.textures import Depth, DisplayColor, Radiance, ShadowLookup, ShadowMap, TextureDesc


class Sun(Node):
    """Depth from the light."""

    shadow_map = Output(ShadowMap, kind="texture2d_array", format="depth32f", doc="Depth.")


class Shadows(Node):
    """Shadow lookups."""

    shadow_map = Input(ShadowMap, kind="texture2d_array", size="any", doc="Depth.")
    lookup = Function(ShadowLookup, "shadow.glsl", reads=("shadow_map",), doc="Visibility.")


class Light(Node):
    """Lights the scene."""

    lookup = Input(ShadowLookup, kind="function", optional=True, many=True, doc="Shadows.")
    radiance = Output(Radiance, doc="Radiance.")
    depth = Output(Depth, format="depth32f", doc="Depth.")

    ambient: float = param(default=0.03, min=0, doc="Ambient light.")


class Sky(Node):
    """Draws where nothing is."""

    radiance = InOut(Radiance, doc="Radiance.")
    depth = Input(Depth, optional=True, doc="Depth.")


class Smooth(Node):
    """Blends with the last frame."""

    radiance = Input(Radiance, doc="Radiance.")
    past = Input(DisplayColor, optional=True, doc="Last frame's.")
    color = Output(DisplayColor, format="rgba8", doc="Picture.")


FULL = (320, 180)


def graph(sky: str = "sky") -> Graph:
    """sun → shadows → light → sky → display, and display's own picture of the last frame."""
    wiring: dict[str, tuple[Node, dict[str, tuple[Endpoint, ...]]]] = {
        "display": (
            Smooth(),
            {"radiance": (Endpoint(sky, "radiance"),), "past": (Endpoint("display", "color", True),)},
        ),
        "sun": (Sun(), {}),
        "shadows": (Shadows(), {"shadow_map": (Endpoint("sun", "shadow_map"),)}),
        "light": (Light(), {"lookup": (Endpoint("shadows", "lookup"),)}),
        sky: (Sky(), {"radiance": (Endpoint("light", "radiance"),), "depth": (Endpoint("light", "depth"),)}),
    }
    members = {}
    for id, (node, inputs) in wiring.items():
        kind = NodeType(type(node).__name__.lower(), "", type(node), Path("x.py"), Path())
        members[id] = GraphNode(id, kind, node, inputs)
    textures = {
        Endpoint("sun", "shadow_map"): TextureInfo(
            TextureDesc("texture2d_array", "depth32f", 1024, 1024, 2), ShadowMap, "sun.views", (0, 1)
        ),
        Endpoint("light", "radiance"): TextureInfo(TextureDesc("texture2d", "rgba16f", *FULL), Radiance, "camera"),
        Endpoint("light", "depth"): TextureInfo(TextureDesc("texture2d", "depth32f", *FULL), Depth, "camera"),
        Endpoint("display", "color"): TextureInfo(TextureDesc("texture2d", "rgba8", *FULL), DisplayColor),
    }
    lights = (LightFacts("sun", "directional"),)
    return Graph("demo", members, {"image": Endpoint("display", "color")}, Facts(FULL, lights), textures)


def plan() -> ResourcePlan:
    """Five steps, two of them sharing a texture, one culled, one history."""
    half, small = TextureDesc("texture2d", "rgba16f", 256, 256), TextureDesc("texture2d", "rgba8", 256, 256)
    resources = {
        id: Resource(id, desc, role)  # type: ignore[arg-type]
        for id, desc, role in (
            ("a.x", half, "transient"),
            ("b.x", small, "transient"),
            ("c.x", half, "internal"),
            ("d.x", small, "output"),
            ("d.past", small, "history"),
            ("lost.x", half, "transient"),
        )
    }
    steps = (
        Step("a", 0, "geometry", writes=(Write("x", "a.x", 1),)),
        Step("b", 0, "fullscreen", reads=(Read("s", "a.x", 1),), writes=(Write("x", "b.x", 1),)),
        Step("lost", 0, "fullscreen", reads=(Read("s", "a.x", 1),), writes=(Write("x", "lost.x", 1),)),
        Step("c", 0, "fullscreen", reads=(Read("s", "b.x", 1),), writes=(Write("x", "c.x", 1),)),
        Step(
            "d",
            0,
            "fullscreen",
            reads=(Read("s", "c.x", 1), Read("p", "d.past", 1, previous=True)),
            writes=(Write("x", "d.x", 1),),
        ),
        Step(
            "d",
            1,
            "fullscreen",
            reads=(Read("s", "c.x", 1), Read("p", "d.past", 1, previous=True)),
            writes=(Write("past", "d.past", 1),),
        ),
    )
    return allocate(schedule(Expansion(steps, resources, {"image": "d.x"})))


def test_text_lists_what_each_node_takes_and_makes() -> None:
    assert text(graph()) == (
        "demo              320×180\n"
        "\n"
        "  sun             sun\n"
        "    → shadow_map  depth32f 1024×1024 2 layers\n"
        "\n"
        "  shadows         shadows\n"
        "    ← shadow_map  sun.shadow_map\n"
        "    → lookup      function shadow\n"
        "\n"
        "  light           light\n"
        "    ← lookup      shadows.lookup\n"
        "    → radiance    rgba16f 320×180\n"
        "    → depth       depth32f 320×180\n"
        "\n"
        "  sky             sky\n"
        "    ← radiance    light.radiance\n"
        "    ← depth       light.depth\n"
        "    → radiance    rgba16f 320×180\n"
        "\n"
        "  display         smooth\n"
        "    ← radiance    sky.radiance\n"
        "    ← past        display.color@previous\n"
        "    → color       rgba8 320×180\n"
        "\n"
        "  outputs\n"
        "    image         display.color\n"
    )


def test_dot_has_every_link_with_its_ports() -> None:
    found = dot(graph())
    assert '"light":"out radiance":e -> "sky":"in radiance":w;' in found
    assert (
        '"display":"out color":e -> "display":"in past":w [style=dashed, constraint=false, label="previous"];' in found
    )
    assert '"display":"out color":e -> "output image";' in found


def test_mermaid_joins_links_of_the_same_nodes() -> None:
    assert mermaid(graph()).splitlines() == [
        "flowchart LR",
        '  n0["<b>display</b><br/>smooth"]',
        '  n1["<b>sun</b><br/>sun"]',
        '  n2["<b>shadows</b><br/>shadows"]',
        '  n3["<b>light</b><br/>light"]',
        '  n4["<b>sky</b><br/>sky"]',
        '  o0(["image"])',
        '  n0 -->|"color"| o0',
        '  n0 -.->|"color → past"| n0',
        '  n1 -->|"shadow_map"| n2',
        '  n2 -->|"lookup"| n3',
        '  n3 -->|"radiance<br/>depth"| n4',
        '  n4 -->|"radiance"| n0',
    ]


HOSTILE = """a"b<c>&'d]|\\ end"""


def test_names_are_escaped() -> None:
    hostile = graph(HOSTILE)
    ET.fromstring(svg(hostile))
    assert HOSTILE in svg(hostile).replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", '"').replace(
        "&#x27;", "'"
    ).replace("&amp;", "&")
    assert '"a\\"b<c>&\'d]|\\\\ end"' in dot(hostile)
    assert "<b>a&quot;b&lt;c&gt;&amp;" in dot(hostile)
    assert "<b>a#34;b#60;c#62;#38;#39;d#93;#124;#92; end</b>" in mermaid(hostile)
    json.dumps(graph_json(hostile))


def boxes(document: str) -> list[tuple[float, float, float, float]]:
    root = ET.fromstring(document)
    cards = [e for e in root.iter("{http://www.w3.org/2000/svg}rect") if e.get("class") == "card"]
    return [tuple(float(e.attrib[key]) for key in ("x", "y", "width", "height")) for e in cards]  # type: ignore[misc]


def test_svg_draws_cards_that_do_not_overlap_inside_the_page() -> None:
    document = svg(graph())
    found = boxes(document)
    assert len(found) == 6
    width, height = (float(ET.fromstring(document).attrib[key]) for key in ("width", "height"))
    for number, (x, y, w, h) in enumerate(found):
        assert 0 <= x <= x + w <= width
        assert 0 <= y <= y + h <= height
        for other_x, other_y, other_w, other_h in found[:number]:
            assert x >= other_x + other_w or other_x >= x + w or y >= other_y + other_h or other_y >= y + h
    assert document.count("<path") == 7 + 5  # links with the output's, and a head each card


def test_graph_json_is_the_whole_graph() -> None:
    found = json.loads(json.dumps(graph_json(graph())))
    assert found["outputs"] == {"image": "display.color"}
    assert found["size"] == [320, 180]
    light = next(node for node in found["nodes"] if node["id"] == "light")
    assert light["parameters"] == {"ambient": 0.03}
    assert light["inputs"] == {"lookup": ["shadows.lookup"]}
    assert light["outputs"]["radiance"]["format"] == "rgba16f"
    assert {
        "source": "display",
        "source_port": "color",
        "target": "display",
        "target_port": "past",
        "previous": True,
    } in found["links"]


def test_plan_text_has_all_of_it() -> None:
    found = plan_text(plan())
    assert re.search(r"^ +2  b +a\.x +b\.x +\d", found, re.M)
    assert re.search(r"^  a\.x +WR··· +texture 0 +512\.0 KiB +rgba16f 256×256$", found, re.M)
    assert re.search(r"^  c\.x +··WRR +texture 0", found, re.M)
    assert re.search(r"^  d\.past +───PB +texture 2\+3", found, re.M)
    assert re.search(r"^  lost +nothing reads lost\.x$", found, re.M)
    assert re.search(r"^  lower bound +\S+ KiB|MiB +of the peak of live bytes: no order needs less$", found, re.M)
    assert found.isprintable() or all(line.isprintable() for line in found.split("\n"))


def test_plan_json_has_the_words_of_the_command_line() -> None:
    found = json.loads(json.dumps(plan_json(plan())))
    assert [(entry["node"], entry["step"]) for entry in found["order"]] == [
        ("a", 0),
        ("b", 0),
        ("c", 0),
        ("d", 0),
        ("d", 1),
    ]
    assert found["memory"] == plan().memory.as_json()
    assert found["culled"] == {"lost": "nothing reads lost.x"}
    by_id = {resource["id"]: resource for resource in found["resources"]}
    assert by_id["a.x"]["size"] == [256, 256]
    assert (by_id["c.x"]["first"], by_id["c.x"]["last"]) == (2, 4)
    assert by_id["a.x"]["physical"] == by_id["c.x"]["physical"]
    assert max(entry["live_bytes"] for entry in found["order"]) == plan().schedule.peak_bytes


def test_lifetimes_svg_is_well_formed_and_says_the_peak() -> None:
    document = lifetimes_svg(plan())
    ET.fromstring(document)
    assert "least peak" in document
    assert ">lost<" in document


@pytest.mark.parametrize("view", [plan_text, plan_json, lifetimes_svg])
def test_an_empty_plan_has_views(view: object) -> None:
    assert callable(view)
    assert view(allocate(schedule(Expansion((), {}, {}))))


def test_an_empty_graph_has_views() -> None:
    empty = Graph("empty", {}, {}, Facts(FULL))
    assert text(empty) == "empty  320×180\n"
    ET.fromstring(svg(empty))
    assert mermaid(empty) == "flowchart LR\n"
    assert dot(empty).startswith('digraph "empty" {')
