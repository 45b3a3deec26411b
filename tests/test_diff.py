"""What differs between two graphs, against changes that were made on purpose."""

from __future__ import annotations

import json
import random
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

from rendergraph.catalog import Catalog
from rendergraph.declare import LightFacts
from rendergraph.diff import diff, diff_json, diff_svg, diff_text, figures
from rendergraph.link import Graph, link
from rendergraph.resolve import resolve

BASE: dict[str, Any] = {
    "prepass": {"type": "depth_prepass"},
    "sun": {"type": "shadow_map"},
    "shadows": {"type": "shadow_pcf", "inputs": {"shadow_map": "sun.shadow_map", "depth": "prepass.depth"}},
    "ao": {"type": "ssao", "inputs": {"depth": "prepass.depth"}, "params": {"samples": 8}},
    "light": {"type": "forward_lighting", "inputs": {"visibility": "shadows.visibility", "depth": "prepass.depth"}},
    "stable": {"type": "temporal", "inputs": {"radiance": "light.radiance", "last": "stable.stable@previous"}},
    "display": {"type": "tonemap", "inputs": {"radiance": "stable.stable"}},
}
OUTPUTS = {"image": "display.color", "occlusion": "ao.occlusion"}


class Maker:
    """Links pipelines written as Python values."""

    def __init__(self, folder: Path, catalog: Catalog) -> None:
        self.folder, self.catalog = folder, catalog

    def __call__(
        self, nodes: dict[str, Any], outputs: dict[str, str] | None = None, name: str = "p", sets: tuple[str, ...] = ()
    ) -> Graph:
        path = self.folder / f"{name}.yaml"
        path.write_text(json.dumps({"rendergraph": 1, "size": [64, 32], "nodes": nodes, "outputs": outputs or OUTPUTS}))
        lights = (LightFacts("key", "directional"),)
        return link(resolve(path, catalog=self.catalog, sets=sets), self.catalog, lights)


@pytest.fixture
def make(tmp_path: Path, toy_catalog: Catalog) -> Maker:
    return Maker(tmp_path, toy_catalog)


def renamed(value: Any, names: dict[str, str]) -> Any:
    """A pipeline's part with other node ids."""
    if isinstance(value, str) and "." in value:
        node, _, port = value.partition(".")
        return f"{names.get(node, node)}.{port}"
    if isinstance(value, dict):
        return {names.get(key, key): renamed(child, names) for key, child in value.items()}
    return value


def test_a_graph_does_not_differ_from_itself(make: Maker) -> None:
    found = diff(make(BASE), make(BASE, name="q"))
    assert not found
    assert "no difference" in diff_text(found)
    assert diff_json(found)["equal"] is True


def test_the_order_in_the_file_does_not_matter(make: Maker) -> None:
    assert not diff(make(BASE), make(dict(reversed(BASE.items()))))


def test_parameters_are_old_and_new(make: Maker) -> None:
    found = diff(make(BASE), make(BASE, sets=("ao.radius=0.75", "ao.offset=[1, 0]")))
    assert [(c.node, c.name, c.old, c.new) for c in found.parameters] == [
        ("ao", "radius", 0.5, 0.75),
        ("ao", "offset", (0.0, 0.0), (1.0, 0.0)),
    ]
    assert "  ~ ao.radius: 0.5 → 0.75\n  ~ ao.offset: [0, 0] → [1, 0]\n" in diff_text(found)


def test_a_written_default_is_no_difference(make: Maker) -> None:
    assert not diff(make(BASE), make(BASE, sets=("ao.radius=0.5", "ao.quality=low")))


def test_nodes_come_and_go_and_links_move(make: Maker) -> None:
    nodes = {key: value for key, value in BASE.items() if key != "stable"}
    nodes["display"] = {"type": "tonemap", "inputs": {"radiance": "fog.radiance"}}
    nodes["fog"] = {"type": "fog", "inputs": {"radiance": "light.radiance"}}
    found = diff(make(BASE), make(nodes))
    assert (found.added, found.removed, found.renamed) == (("fog",), ("stable",), {})
    assert [(c.node, c.port, c.old, c.new) for c in found.links] == [
        ("display", "radiance", ("stable.stable",), ("fog.radiance",))
    ]


def test_a_retyped_node_keeps_its_name_and_tells_what_was_set(make: Maker) -> None:
    found = diff(make(BASE, sets=("shadows.taps=2",)), make(BASE, sets=("shadows.type=shadow_vsm", "shadows.bias=2")))
    assert [(c.node, c.old, c.new) for c in found.retyped] == [("shadows", "shadow_pcf", "shadow_vsm")]
    assert [(c.name, c.old, c.new) for c in found.parameters] == [("taps", 2, None), ("bias", 1.0, 2.0)]
    assert (found.added, found.removed, found.links) == ((), (), ())


def test_shaders_are_their_text_wherever_they_lie(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    effect = '#include "part.glsl"\nuniform sampler2D seen;\nout vec4 made;\nvoid main() { made = part(seen); }\n'
    part = "vec4 part(sampler2D seen) { return texelFetch(seen, ivec2(0), 0); }\n"
    graphs = []
    for name, main, included in (
        ("a", effect, part),
        ("b", f"// so\n{effect}", f"{part}\n"),
        ("c", effect, "//" + part),
    ):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "fx.frag").write_text(main)
        (folder / "part.glsl").write_text(included)
        node = {"type": "./fx.frag", "inputs": {"seen": "p.made@previous"}}
        file = {"nodes": {"p": node}, "outputs": {"image": "p.made"}}
        (folder / "p.yaml").write_text(json.dumps(file))
        catalog = Catalog.discover()
        graphs.append(link(resolve(folder / "p.yaml", catalog=catalog), catalog, ()))
    monkeypatch.chdir(tmp_path)
    assert not diff(graphs[0], graphs[1])
    assert diff_text(diff(graphs[0], graphs[2])).splitlines()[1:] == [
        "  ~ p: the shader's text differs (a/fx.frag, c/fx.frag)"
    ]
    assert "another text" in diff_svg(graphs[0], graphs[2], diff(graphs[0], graphs[2]))


def test_outputs_and_sizes(make: Maker) -> None:
    shown = {"image": "display.color", "depth": "prepass.depth"}
    found = diff(make(BASE), make(BASE, shown))
    assert [(c.name, c.old, c.new) for c in found.outputs] == [
        ("occlusion", "ao.occlusion", None),
        ("depth", None, "prepass.depth"),
    ]


@pytest.mark.parametrize("seed", range(20))
def test_renamed_but_equal_nodes_are_recognised(make: Maker, seed: int) -> None:
    chooser = random.Random(seed)
    names = {name: f"{name}_{chooser.randrange(99)}" for name in chooser.sample(list(BASE), chooser.randint(1, 7))}
    found = diff(make(BASE), make(renamed(BASE, names), renamed(OUTPUTS, names)))
    assert dict(found.renamed) == names
    assert (found.added, found.removed, found.links, found.parameters, found.retyped, found.outputs) == ((),) * 6


def test_names_that_changed_places_are_renames(make: Maker) -> None:
    names = {"ao": "display", "display": "ao"}
    found = diff(make(BASE), make(renamed(BASE, names), renamed(OUTPUTS, names)))
    assert dict(found.renamed) == names
    assert not found.retyped


def test_of_equal_candidates_the_one_with_the_same_readers_is_taken(make: Maker) -> None:
    blur = {"type": "blur", "inputs": {"source": "light.radiance"}}
    nodes = BASE | {"one": blur, "two": blur}
    shown = OUTPUTS | {"first": "one.blurred", "second": "two.blurred"}
    other = {"one": "uno", "two": "due"}
    found = diff(
        make(nodes, shown),
        make(renamed(nodes, {"one": "due", "two": "uno"}), shown | {"first": "uno.blurred", "second": "due.blurred"}),
    )
    assert dict(found.renamed) == other
    assert not found.outputs


def test_the_plan_is_compared(make: Maker) -> None:
    from rendergraph.allocate import allocate
    from rendergraph.expand import expand
    from rendergraph.schedule import schedule

    def plan(graph: Graph) -> Any:
        return figures(allocate(schedule(expand(graph))))

    shown = {"image": "display.color"}
    nodes = {key: dict(BASE[key]) for key in ("light", "display")}
    nodes["light"] = {"type": "forward_lighting"}
    nodes["display"] = {"type": "tonemap", "inputs": {"radiance": "light.radiance"}}
    longer = nodes | {
        "blur": {"type": "half", "inputs": {"source": "light.radiance"}},
        "up": {"type": "upsample", "inputs": {"source": "blur.radiance"}},
        "display": {"type": "tonemap", "inputs": {"radiance": "up.radiance"}},
    }
    a, b = make(nodes, shown), make(longer, shown)
    plans = plan(a), plan(b)
    assert (plans[0].passes, plans[1].passes) == (2, 4)
    text = diff_text(diff(a, b), plans)
    assert "passes" in text
    assert "+2" in text
    assert diff_json(diff(a, b), plans)["plan"]["b"]["passes"] == 4


def test_the_picture_is_well_formed_and_says_what_changed(make: Maker) -> None:
    nodes = {key: value for key, value in BASE.items() if key != "stable"}
    nodes["display"] = {"type": "tonemap", "inputs": {"radiance": "light.radiance"}}
    a, b = make(BASE), make(nodes, sets=("ao.radius=0.75",), name="q")
    picture = diff_svg(a, b, diff(a, b))
    ET.fromstring(picture)
    for text in (
        "radius 0.5 → 0.75",
        "− removed",
        "light.radiance → display.radiance",
        "stable.stable → display.radiance",
        "stroke-dasharray",
    ):
        assert text in picture


def test_a_disabled_node_is_said_to_be(make: Maker) -> None:
    base, without = make(BASE), make(BASE, name="without", sets=("stable.enabled=false",))
    there, back = diff(base, without), diff(without, base)
    assert there.removed == back.added == there.disabled == back.disabled == ("stable",)
    assert "  - stable (disabled in without)\n" in diff_text(there)
    assert "  + stable (disabled in without)\n" in diff_text(back)
    assert "  ~ display.radiance: stable.stable → light.radiance\n" in diff_text(there)
    assert diff_json(there)["disabled"] == ["stable"]
    assert "− disabled" in diff_svg(base, without, there)
