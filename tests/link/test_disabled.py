"""`enabled: false`: what is read instead of a node, and who cannot do without it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import rendergraph as rg
from rendergraph.catalog import Catalog
from rendergraph.declare import LightFacts
from rendergraph.errors import InputError
from rendergraph.link import Endpoint, Graph, endpoint, link
from rendergraph.read import read
from rendergraph.reference import error_page
from rendergraph.resolve import resolve
from rendergraph.resources import shipped_pipelines
from rendergraph.textures import TextureDesc

SUN = LightFacts("sun", "directional")
AROUND = TextureDesc("texture2d", "rgba16f", 8, 4)
CHAIN = """
nodes:
  sun: {type: shadow_map}
  shadows: {type: shadow_pcf, inputs: {shadow_map: sun.shadow_map}}
  lamp: {type: shadow_pcf, inputs: {shadow_map: sun.shadow_map}}
  light: {type: forward_lighting, inputs: {lookup: [shadows.lookup, lamp.lookup]}}
  sky: {type: sky, inputs: {radiance: light.radiance}}
  blur: {type: blur, inputs: {source: sky.radiance}}
  stable: {type: temporal, inputs: {last: stable.stable@previous, radiance: blur.blurred}}
  display: {type: tonemap, inputs: {radiance: stable.stable}}
outputs: {image: display.color, radiance: stable.stable}
"""
DEFERRED = """
nodes:
  gbuffer: {type: gbuffer}
  ao: {type: ssao, inputs: {depth: gbuffer.depth}}
  light: {type: deferred_lighting, inputs: {gbuffer: gbuffer, occlusion: ao.occlusion}}
  display: {type: tonemap, inputs: {radiance: light.radiance}}
outputs: {image: display.color}
"""
GLOW = """
inputs: {radiance: {semantic: radiance}, depth: {semantic: depth, optional: true}}
nodes:
  blur: {type: blur, inputs: {source: inputs.radiance}}
  fog: {type: fog, inputs: {radiance: blur.blurred}}
outputs: {radiance: fog.radiance, depth: fog.depth}
"""


def linked(text: str, catalog: Catalog, *sets: str) -> Graph:
    return link(resolve(read(None, text, keep_going=True), catalog=catalog, sets=sets), catalog, (SUN,))


def problems(text: str, catalog: Catalog, *sets: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        linked(text, catalog, *sets)
    return [str(problem) for problem in caught.value.problems]


def off(*nodes: str) -> list[str]:
    return [f"{node}.enabled=false" for node in nodes]


@pytest.mark.parametrize(
    ("nodes", "shown"),
    [
        (["stable"], "blur.blurred"),  # its input of the same meaning, of this frame before the last one's
        (["blur"], "stable.stable"),
        (["blur", "stable"], "sky.radiance"),  # like the input it is made of
        (["stable", "sky", "blur"], "light.radiance"),  # what it continues
    ],
)
def test_readers_read_what_went_into_it(nodes: Sequence[str], shown: str, toy_catalog: Catalog) -> None:
    graph = linked(CHAIN, toy_catalog, *off(*nodes))
    assert graph.disabled == tuple(node for node in ("sky", "blur", "stable") if node in nodes)
    assert not {*nodes} & {*graph.members}
    assert str(graph.outputs["radiance"]) == shown
    assert graph["display"].inputs["radiance"] == (graph.outputs["radiance"],)
    for node in nodes:  # a tap shows what stands in, too
        port = {"stable": "stable", "blur": "blurred", "sky": "radiance"}[node]
        assert endpoint(graph, f"{node}.{port}").node not in nodes


def test_last_frames_value_stays_last_frames(toy_catalog: Catalog) -> None:
    text = CHAIN.replace("radiance: blur.blurred}", "radiance: blur.blurred@previous}")
    graph = linked(text, toy_catalog, *off("blur"))
    assert graph["stable"].inputs["radiance"] == (Endpoint("sky", "radiance", previous=True),)


def test_lists_keep_the_others_and_optional_inputs_are_left_open(toy_catalog: Catalog) -> None:
    assert linked(CHAIN, toy_catalog, *off("lamp"))["light"].inputs == {"lookup": (Endpoint("shadows", "lookup"),)}
    assert not linked(CHAIN, toy_catalog, *off("lamp", "shadows"))["light"].inputs
    graph = linked(DEFERRED, toy_catalog, *off("ao"))
    assert "occlusion" not in graph["light"].inputs
    with pytest.raises(InputError, match="RG132 node 'ao' is disabled, and nothing replaces 'occlusion'"):
        endpoint(graph, "ao.occlusion")


def test_who_cannot_do_without_says_so_once_a_link(toy_catalog: Catalog) -> None:
    found = problems(DEFERRED, toy_catalog, *off("gbuffer"))
    ends = "but 'gbuffer' is disabled (--set gbuffer.enabled=false) and none of its inputs can replace its output"
    assert len(found) == 2
    assert found[0].startswith(f"<text>:4:36: RG132 'ao.depth' needs 'gbuffer.depth', {ends}")
    assert f"RG132 'light.albedo', 'light.normal', 'light.depth' need 'gbuffer', {ends}" in found[1]
    (shown,) = problems(CHAIN, toy_catalog, *off("display"))
    assert "<text>:11:18: RG132 output 'image' shows 'display.color', but 'display' is disabled" in shown
    text = CHAIN.replace("lookup: [shadows.lookup, lamp.lookup]", "visibility: shadows.visibility")
    text = text.replace("shadow_map: sun.shadow_map}}", "shadow_map: sun.shadow_map, depth: prepass}}", 1)
    text = text.replace("nodes:", "nodes:\n  prepass: {type: depth_prepass}")
    (needed,) = problems(text, toy_catalog, *off("prepass"))
    assert "RG132 'shadows.visibility' needs input 'depth' of 'shadows' (line 5), but 'prepass' is disabled" in needed


def test_nodes_that_read_each_other_are_no_way_out(toy_catalog: Catalog) -> None:
    text = """
nodes:
  a: {type: blur, inputs: {source: b.blurred}, enabled: false}
  b: {type: blur, inputs: {source: a.blurred}, enabled: false}
  display: {type: tonemap, inputs: {radiance: b.blurred}}
outputs: {image: display.color}
"""
    assert "'display.radiance' needs 'b.blurred', but 'b' is disabled (line 4)" in problems(text, toy_catalog)[0]


def test_its_own_links_may_lack_and_its_mistakes_are_mistakes(toy_catalog: Catalog) -> None:
    text = CHAIN.replace("nodes:", "nodes:\n  spare: {type: tonemap, enabled: false}")
    assert linked(text, toy_catalog).disabled == ("spare",)
    (unknown,) = problems(text.replace("type: tonemap,", "type: tonemap, params: {curv: aces},", 1), toy_catalog)
    assert "RG103" in unknown


def test_what_is_no_switch_is_said_at_its_place(toy_catalog: Catalog) -> None:
    (written,) = problems(CHAIN.replace("{type: shadow_map}", "{type: shadow_map, enabled: no}"), toy_catalog)
    assert written.startswith("<text>:3:36: RG106 'enabled': expected true or false, got 'no'")
    (typed,) = problems(CHAIN, toy_catalog, "sun.enabled=3")
    assert typed.startswith("--set sun.enabled=3: RG106 'sun.enabled': expected true or false, got a number")


def test_files_patches_and_settings_put_it_back(toy_catalog: Catalog, tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text(CHAIN)
    (tmp_path / "plain.yaml").write_text("extends: ./base.yaml\nnodes: {blur: {enabled: false}}")
    file = tmp_path / "plain.yaml"

    def disabled(**how: object) -> tuple[str, ...]:
        return link(resolve(file, catalog=toy_catalog, **how), toy_catalog, (SUN,)).disabled  # type: ignore[arg-type]

    assert disabled() == ("blur",)
    assert disabled(sets=["blur.enabled=true"]) == disabled(sets=["blur.enabled=null"]) == ()
    assert disabled(patches=[{"nodes": {"blur": {"enabled": True}, "sky": {"enabled": False}}}]) == ("sky",)
    assert disabled(sets={"stable.enabled": False}) == ("blur", "stable")
    text = resolve(file, catalog=toy_catalog).to_yaml(origins=True)
    assert any("enabled: false" in line and line.endswith("plain.yaml:2") for line in text.splitlines())


def test_sub_pipelines_go_with_all_that_is_in_them(toy_catalog: Catalog, tmp_path: Path) -> None:
    (tmp_path / "glow.yaml").write_text(GLOW.replace(", depth: fog.depth", ""))
    (tmp_path / "main.yaml").write_text(
        CHAIN.replace("outputs:", "  glow: {type: ./glow.yaml, inputs: {radiance: stable.stable}}\noutputs:").replace(
            "{radiance: stable.stable}}\n", "{radiance: glow.radiance}}\n", 1
        )
    )

    def graph(*sets: str) -> Graph:
        return link(resolve(tmp_path / "main.yaml", catalog=toy_catalog, sets=sets), toy_catalog, (SUN,))

    assert str(graph()["display"].inputs["radiance"][0]) == "glow/fog.radiance"
    assert str(graph("glow/fog.enabled=false")["display"].inputs["radiance"][0]) == "glow/blur.blurred"
    whole = graph("glow.enabled=false", "stable.enabled=false")
    assert whole.disabled == ("stable", "glow/blur", "glow/fog")
    assert str(whole["display"].inputs["radiance"][0]) == "blur.blurred"
    assert str(endpoint(whole, "glow.radiance")) == "blur.blurred"


def test_a_sub_pipeline_has_a_meaning_of_its_own(toy_catalog: Catalog, tmp_path: Path) -> None:
    inside = """
inputs: {radiance: {semantic: radiance}}
nodes:
  counts: {type: histogram, inputs: {radiance: inputs.radiance}}
  light: {type: forward_lighting}
outputs: {radiance: light.radiance}
"""
    (tmp_path / "again.yaml").write_text(inside)
    (tmp_path / "main.yaml").write_text(
        "nodes:\n  light: {type: forward_lighting}\n"
        "  again: {type: ./again.yaml, inputs: {radiance: light.radiance}, enabled: false}\n"
        "outputs: {radiance: again.radiance}\n"
    )
    graph = link(resolve(tmp_path / "main.yaml", catalog=toy_catalog), toy_catalog, (SUN,))
    assert str(graph.outputs["radiance"]) == "light.radiance"


# --- shipped pipelines -----------------------------------------------------------------------------------------------


def test_without_its_bloom_a_pipeline_draws_as_if_there_were_none(gl: rg.Session) -> None:
    bloom = rg.load("bloom").with_size((64, 36))
    without = bloom.set("bloom.enabled", False).render(session=gl)
    plain = bloom.patch({"nodes": {"bloom": None, "display": {"inputs": {"radiance": "light.radiance"}}}})
    plain = plain.patch({"outputs": {"radiance": "light.radiance"}})
    assert np.array_equal(without["image"], plain.render(session=gl)["image"])
    assert not np.array_equal(without["image"], bloom.render(session=gl)["image"])


def test_who_types_what_an_environment_takes_the_place_of_is_told(tmp_path: Path) -> None:
    catalog, page = Catalog.discover(), error_page("RG155")

    def said(*sets: str, around: TextureDesc | None = AROUND) -> list[str]:
        spec = resolve("forward", catalog=catalog, sets=sets)
        return [str(warning) for warning in link(spec, catalog, (SUN,), environment=around).warnings]

    assert said("light.ambient=0.2") == [page["message"]]
    assert said("light.ambient=0.2", "light.environment=null") == []
    assert said("light.ambient=0.2", around=None) == []
    (tmp_path / "mine.yaml").write_text("extends: forward\nnodes: {light: {params: {ambient: 0.2}}}\n")
    written = resolve(tmp_path / "mine.yaml", catalog=catalog)  # it may be for scenes without
    assert link(written, catalog, (SUN,), environment=AROUND).warnings == ()


@pytest.mark.nightly(keep=8)
@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_pipelines())
def test_every_node_goes_or_is_named(name: str) -> None:
    catalog = Catalog.discover()
    nodes = resolve(name, catalog=catalog).nodes
    for node in nodes:
        spec = resolve(name, catalog=catalog, sets=[f"{node}.enabled=false"])
        try:
            graph = link(spec, catalog, (SUN,), environment=AROUND)
            rg.load(name).set(f"{node}.enabled", False).with_size((64, 36)).plan()
        except InputError as error:
            for problem in error.problems:
                if name == "terms" and problem.code == "RG209":  # one picture fewer than there are labels
                    continue
                assert problem.code == "RG132"
                assert f"'{node}' is disabled (--set {node}.enabled=false)" in problem.message
        else:
            assert graph.disabled == (node,)
            assert [*graph.members] == [other for other in nodes if other != node]
