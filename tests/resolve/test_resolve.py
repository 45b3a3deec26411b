"""`extends`, patches, settings, parameters, sub-pipelines and roots."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rendergraph as rg
from rendergraph.catalog import Catalog
from rendergraph.document import Source, Value, from_plain, parse
from rendergraph.errors import InputError, UsageError
from rendergraph.read import read
from rendergraph.resolve import PipelineSpec, diff, merge_patch, resolve

FORWARD = """\
rendergraph: 1
description: Forward
size: [64, 32]
parameters: {softness: {default: 2, min: 1, max: 8, doc: Taps}}
nodes:
  sun: {type: shadow_map}
  shadows: {type: shadow_pcf, inputs: {shadow_map: sun.shadow_map}, params: {taps: $softness, bias: 2}}
  light: {type: forward_lighting, inputs: {lookup: shadows.lookup}}
  display: {type: tonemap, inputs: {radiance: light.radiance}}
outputs: {image: display.color, radiance: light.radiance}
"""
PREPASS = """\
extends: ./forward.yaml
nodes:
  prepass: {type: depth_prepass}
  shadows: {inputs: {depth: prepass.depth}}
  light: {inputs: {lookup: null, visibility: shadows.visibility}}
"""
GLOW = """\
inputs: {radiance: {semantic: radiance}}
parameters: {radius: {default: 4, min: 1, max: 16}}
nodes:
  blur: {type: blur, inputs: {source: inputs.radiance}, params: {radius: $radius}}
  again: {type: blur, inputs: {source: blur.blurred}}
outputs: {radiance: again.blurred}
"""
GLOWING = """\
extends: ./forward.yaml
nodes:
  glow: {type: ./glow.yaml, inputs: {radiance: light.radiance}, params: {radius: 7}}
  display: {inputs: {radiance: glow.radiance}}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in (("forward", FORWARD), ("prepass", PREPASS), ("glow", GLOW), ("glowing", GLOWING)):
        (tmp_path / f"{name}.yaml").write_text(text)
    return tmp_path


def nodes_of(spec: PipelineSpec) -> dict[str, Any]:
    """Nodes as plain data."""
    return {
        node.id: {
            "type": node.type,
            "inputs": {name: value.plain() for name, value in node.inputs.items()},
            "params": {name: value.plain() for name, value in node.params.items()},
        }
        for node in spec.nodes.values()
    }


def codes(spec: PipelineSpec) -> list[str]:
    return [problem.code for problem in spec.problems]


# --- one file --------------------------------------------------------------------------------------------------------


def test_a_file_alone(folder: Path, toy_catalog: Catalog) -> None:
    spec = resolve(folder / "forward.yaml", catalog=toy_catalog)
    assert (spec.name, spec.size, spec.scene, spec.description) == ("forward", (64, 32), None, "Forward")
    assert list(spec.nodes) == ["sun", "shadows", "light", "display"]
    assert nodes_of(spec)["shadows"]["params"] == {"taps": 2, "bias": 2}
    assert spec.parameters["softness"].value == 2
    assert spec.problems == spec.notes == ()


def test_parameters_of_a_pipeline(toy_catalog: Catalog) -> None:
    text = """
parameters: {a: {default: 3}, c: {default: [1, 2]}, s: {default: neutral}, unused: {default: 1}}
nodes: {n: {type: ssao, params: {offset: [$a, 4], x: $c, y: $$a, z: {deep: [$s]}, w: $, v: cost $5}}}
outputs: {o: n.occlusion}
"""
    spec = resolve(read(None, text), catalog=toy_catalog, sets=["a=5"])
    params = nodes_of(spec)["n"]["params"]
    assert params == {"offset": [5, 4], "x": [1, 2], "y": "$a", "z": {"deep": ["neutral"]}, "w": "$", "v": "cost $5"}
    (note,) = spec.notes
    assert str(note).startswith("<text>:2:76: warning: RG151 the parameter 'unused' is used nowhere")


def test_null_is_the_default(toy_catalog: Catalog) -> None:
    text = "nodes: {n: {type: ssao, params: {samples: null, radius: 1}}}\noutputs: {o: n.occlusion}"
    assert nodes_of(resolve(read(None, text), catalog=toy_catalog))["n"]["params"] == {"radius": 1}


# --- extends and patches ---------------------------------------------------------------------------------------------


def test_extends_is_a_merge_patch(folder: Path, toy_catalog: Catalog) -> None:
    spec = resolve(folder / "prepass.yaml", catalog=toy_catalog)
    nodes = nodes_of(spec)
    assert list(nodes) == ["sun", "shadows", "light", "display", "prepass"]
    assert nodes["light"]["inputs"] == {"visibility": "shadows.visibility"}
    assert nodes["shadows"]["inputs"] == {"shadow_map": "sun.shadow_map", "depth": "prepass.depth"}
    assert spec.name == "prepass"


def test_every_value_knows_where_it_comes_from(folder: Path, toy_catalog: Catalog) -> None:
    spec = resolve(folder / "prepass.yaml", catalog=toy_catalog, sets=["shadows.bias=3"], patches=[{"size": [8, 8]}])
    inputs = spec.nodes["shadows"].inputs
    assert str(inputs["shadow_map"].place) == f"{folder}/forward.yaml:7:52"
    assert str(inputs["depth"].place) == f"{folder}/prepass.yaml:4:29"
    assert str(spec.nodes["shadows"].params["bias"].place) == "--set shadows.bias=3"
    lines = [" ".join(line.split()) for line in spec.to_yaml(origins=True).splitlines()]
    assert f"depth: prepass.depth # {folder}/prepass.yaml:4" in lines
    assert "bias: 3 # --set shadows.bias=3" in lines
    assert "size: [8, 8] # patch.size" in lines


def test_patches_come_in_order(folder: Path, toy_catalog: Catalog) -> None:
    (folder / "patch.yaml").write_text("nodes: {shadows: {params: {bias: 5}}, sun: {params: {resolution: 64}}}")
    patches: list[Path | dict[str, Any]] = [folder / "patch.yaml", {"nodes": {"shadows": {"params": {"bias": 6}}}}]
    spec = resolve(folder / "forward.yaml", catalog=toy_catalog, patches=patches)
    assert nodes_of(spec)["shadows"]["params"]["bias"] == 6
    assert nodes_of(spec)["sun"]["params"] == {"resolution": 64}


def test_a_wrong_patch_is_told_with_the_rest(folder: Path, toy_catalog: Catalog) -> None:
    spec = resolve(folder / "forward.yaml", catalog=toy_catalog, patches=[{"nods": {}}], sets=["nothing=1"])
    assert codes(spec) == ["RG101", "RG119"]
    with pytest.raises(InputError, match=r"patch\.nods: RG101 a pipeline has no key 'nods'"):
        spec.to_yaml()


def test_shipped_pipelines_by_name() -> None:
    catalog = Catalog.discover()
    spec = resolve("forward-prepass", catalog=catalog)
    assert list(spec.nodes)[:2] == ["sun", "shadows"]
    spec = resolve(parse("extends: forward\n"), catalog=catalog)
    assert "display" in spec.nodes


def test_unknown_shipped_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, toy_catalog: Catalog) -> None:
    with pytest.raises(InputError, match=r"RG015 there is no shipped pipeline 'forwrd'; did you mean 'forward'\?"):
        resolve("forwrd", catalog=toy_catalog)
    (tmp_path / "mine.yaml").write_text(FORWARD)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"RG015 .* 'mine'; the file is named 'mine.yaml'"):
        resolve("mine", catalog=toy_catalog)


# --- another type ----------------------------------------------------------------------------------------------------


def test_retyping_drops_what_the_new_type_lacks_and_says_so(folder: Path, toy_catalog: Catalog) -> None:
    spec = resolve(folder / "forward.yaml", catalog=toy_catalog, sets=["shadows.type=shadow_vsm"])
    assert nodes_of(spec)["shadows"] == {
        "type": "shadow_vsm",
        "inputs": {"shadow_map": "sun.shadow_map"},
        "params": {"bias": 2},
    }
    note, unused = spec.notes
    assert str(note) == (
        "--set shadows.type=shadow_vsm: warning: RG150 node 'shadows' is now 'shadow_vsm', which has no param 'taps' "
        "of 'shadow_pcf'; dropped"
    )
    assert unused.code == "RG151"


def test_null_beside_the_new_type_drops_without_a_word(folder: Path, toy_catalog: Catalog) -> None:
    patch = {"nodes": {"shadows": {"type": "shadow_vsm", "params": {"taps": None, "radius": 3}}}}
    spec = resolve(folder / "forward.yaml", catalog=toy_catalog, patches=[patch])
    assert nodes_of(spec)["shadows"]["params"] == {"bias": 2, "radius": 3}
    assert [note.code for note in spec.notes] == ["RG151"]


def test_what_is_written_beside_the_new_type_stays_to_be_refused(folder: Path, toy_catalog: Catalog) -> None:
    patch = {"nodes": {"shadows": {"type": "shadow_vsm", "params": {"taps": 3}}}}
    spec = resolve(folder / "forward.yaml", catalog=toy_catalog, patches=[patch])
    assert nodes_of(spec)["shadows"]["params"] == {"bias": 2, "taps": 3}


def test_types_are_set_first(folder: Path, toy_catalog: Catalog) -> None:
    sets = ["shadows.radius=5", "shadows.type=shadow_vsm"]
    spec = resolve(folder / "forward.yaml", catalog=toy_catalog, sets=sets)
    assert nodes_of(spec)["shadows"]["params"] == {"bias": 2, "radius": 5}


def test_the_same_type_again_drops_nothing(folder: Path, toy_catalog: Catalog) -> None:
    spec = resolve(folder / "forward.yaml", catalog=toy_catalog, sets=["shadows.type=shadow_pcf"])
    assert nodes_of(spec)["shadows"]["params"] == {"taps": 2, "bias": 2}


PLANAR = """from rendergraph.api import Depth, Input, Node, Output, ShadowMap, Visibility
class Planar(Node):
    \"\"\"Shadows in image space alone.\"\"\"
    shadow_map = Input(ShadowMap, kind="texture2d_array", size="any", optional=True, doc="Depth from lights.")
    depth = Input(Depth, doc="Depth.")
    visibility = Output(Visibility, kind="texture2d_array", layers=1, lights=lambda node, facts: (0,), doc="Lit.")
"""


def planar(tmp_path: Path, *sets: str, **options: Any) -> rg.Pipeline:
    (tmp_path / "planar.py").write_text(PLANAR)
    return rg.load("deferred", sets=["shadows.type=planar", *sets], plugins=[tmp_path / "planar.py"], **options)


def test_retyping_leaves_out_optional_links_that_the_new_type_cannot_feed(tmp_path: Path) -> None:
    pipeline = planar(tmp_path)
    light = nodes_of(pipeline.resolve().spec)["light"]["inputs"]
    assert "blended_lookup" not in light
    assert light["visibility"] == "shadows.visibility"
    assert (
        "warning: RG150 node 'shadows' is now 'planar', which has no output 'lookup' of 'shadow_pcf'; "
        "'light.blended_lookup' does without"
    ) in [str(note).partition(": ")[2] for note in pipeline.resolve().spec.notes]
    assert not pipeline.link().graph["light"].inputs.get("blended_lookup")


def test_a_link_that_is_written_beside_the_new_type_is_refused(tmp_path: Path) -> None:
    pipeline = planar(tmp_path, "light.blended_lookup=shadows.lookup")
    with pytest.raises(InputError, match=r"RG112 node 'shadows' .*\(planar\) has no output 'lookup'"):
        _ = pipeline.link().graph


def test_of_a_list_the_links_that_the_new_type_feeds_stay(tmp_path: Path) -> None:
    (tmp_path / "two.yaml").write_text(
        "extends: forward\nnodes:\n  more: {type: shadow_pcf, inputs: {shadow_map: sun.shadow_map}}\n"
        "  pre: {type: depth_prepass}\n  shadows: {inputs: {depth: pre.depth}}\n"
        "  light: {inputs: {lookup: [shadows.lookup, more.lookup]}}\n"
    )
    (tmp_path / "planar.py").write_text(PLANAR)
    plugins = [tmp_path / "planar.py"]
    spec = rg.load(tmp_path / "two.yaml", sets=["shadows.type=planar"], plugins=plugins).resolve().spec
    assert nodes_of(spec)["light"]["inputs"]["lookup"] == ["more.lookup"]


def test_retyping_to_a_sub_pipeline(folder: Path, toy_catalog: Catalog) -> None:
    text = GLOWING.replace("./glow.yaml", "blur").replace("radiance: light.radiance}", "source: light.radiance}")
    (folder / "blurred.yaml").write_text(text.replace("glow.radiance", "glow.blurred"))
    (folder / "again.yaml").write_text(
        "extends: ./blurred.yaml\nnodes: {glow: {type: ./glow.yaml, inputs: {radiance: light.radiance}}, "
        "display: {inputs: {radiance: glow.radiance}}}"
    )
    spec = resolve(folder / "again.yaml", catalog=toy_catalog)
    assert nodes_of(spec)["glow/blur"]["params"] == {"radius": 7}
    (note,) = spec.notes
    assert "has no input 'source' of 'blur'; dropped" in note.message


def test_null_disconnects_one_member_of_a_group(toy_catalog: Catalog) -> None:
    base = "nodes: {g: {type: gbuffer}, l: {type: deferred_lighting, inputs: {gbuffer: g}}}\noutputs: {o: l.radiance}"
    patch = {"nodes": {"l": {"inputs": {"albedo": None, "occlusion": None}}}}
    spec = resolve(read(None, base), catalog=toy_catalog, patches=[patch])
    assert nodes_of(spec)["l"]["inputs"] == {"gbuffer": "g", "albedo": None}
    spec = resolve(read(None, base), catalog=toy_catalog, sets=["l.albedo=null"])
    assert nodes_of(spec)["l"]["inputs"] == {"gbuffer": "g", "albedo": None}


# --- settings --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("light.ambient=0.1", 0.1),
        ("light.ambient=1e-3", 0.001),
        ("light.ambient=[0.1, 0.2, 0.3]", [0.1, 0.2, 0.3]),
        ("light.ambient=$softness", 2),
        ("light.ambient=no", "no"),
        ("light.ambient='1'", "1"),
        ("light.ambient=#ff0000", "#ff0000"),
        ("light.ambient=a=b", "a=b"),
        (" light.ambient = 5", 5),
        ("light.ambient={a: 1}", {"a": 1}),
    ],
)
def test_values_are_yaml(folder: Path, toy_catalog: Catalog, text: str, value: object) -> None:
    spec = resolve(folder / "forward.yaml", catalog=toy_catalog, sets=[text])
    assert nodes_of(spec)["light"]["params"] == {"ambient": value}


def test_settings_rewire_and_the_last_wins(folder: Path, toy_catalog: Catalog) -> None:
    sets = ["light.lookup=null", "shadows.bias=1", "shadows.bias=9", "display.radiance=light"]
    nodes = nodes_of(resolve(folder / "forward.yaml", catalog=toy_catalog, sets=sets))
    assert nodes["light"]["inputs"] == {}
    assert nodes["shadows"]["params"]["bias"] == 9
    assert nodes["display"]["inputs"] == {"radiance": "light"}
    nodes = nodes_of(resolve(folder / "forward.yaml", catalog=toy_catalog, sets=["light.lookup=[a.b, c.d]"]))
    assert nodes["light"]["inputs"] == {"lookup": ["a.b", "c.d"]}
    nodes = nodes_of(resolve(folder / "forward.yaml", catalog=toy_catalog, sets=["shadows.bias=null"]))
    assert nodes["shadows"]["params"] == {"taps": 2}


def test_settings_from_python(folder: Path, toy_catalog: Catalog) -> None:
    import numpy as np

    sets = {"light.ambient": (1, 0.5, 0), "softness": np.int64(4), "shadows.bias": 1.5}
    spec = resolve(folder / "forward.yaml", catalog=toy_catalog, sets=sets)
    assert nodes_of(spec)["light"]["params"] == {"ambient": [1, 0.5, 0]}
    assert nodes_of(spec)["shadows"]["params"] == {"taps": 4, "bias": 1.5}
    with pytest.raises(UsageError, match="RG120"):
        resolve(folder / "forward.yaml", catalog=toy_catalog, sets={"light.ambient": object()})


def test_malformed_settings_are_mistakes_of_the_command_line(folder: Path, toy_catalog: Catalog) -> None:
    with pytest.raises(UsageError) as caught:
        resolve(folder / "forward.yaml", catalog=toy_catalog, sets=["light", "a.b.c=1", "a.b=[", "glow/blur=1", "=1"])
    assert [problem.code for problem in caught.value.problems] == ["RG120"] * 5


def test_a_setting_is_told_where_it_is_wrong(folder: Path, toy_catalog: Catalog) -> None:
    sets = ["lihgt.x=1", "light.x=1", "light.lookup=3", "light.type=3", "size=3", "light=2"]
    spec = resolve(folder / "forward.yaml", catalog=toy_catalog, sets=sets)
    texts = [str(problem) for problem in spec.problems]
    assert texts[0] == "--set lihgt.x=1: RG109 there is no node 'lihgt'; did you mean 'light'?"
    assert "--set size=3: RG119 the pipeline has no parameter 'size'; --size sets the size" in texts
    assert any("to set one of node 'light', write light.PARAM=VALUE" in text for text in texts)
    assert sorted(codes(spec)) == ["RG103", "RG106", "RG106", "RG109", "RG119", "RG119"]


# --- sub-pipelines ---------------------------------------------------------------------------------------------------


def test_a_file_as_a_node_type(folder: Path, toy_catalog: Catalog) -> None:
    spec = resolve(folder / "glowing.yaml", catalog=toy_catalog)
    nodes = nodes_of(spec)
    assert list(nodes) == ["sun", "shadows", "light", "display", "glow/blur", "glow/again"]
    assert nodes["glow/blur"]["params"] == {"radius": 7}
    assert nodes["glow/blur"]["inputs"] == {"source": "inputs.radiance"}
    assert list(spec.scopes) == ["glow/"]
    assert spec.nodes["glow/blur"].scope == "glow/"


def test_settings_inside(folder: Path, toy_catalog: Catalog) -> None:
    sets = ["glow/again.radius=9", "glow/blur.type=resolve", "glow.radius=5"]
    spec = resolve(folder / "glowing.yaml", catalog=toy_catalog, sets=sets)
    nodes = nodes_of(spec)
    assert nodes["glow/again"]["params"] == {"radius": 9}
    assert nodes["glow/blur"] == {"type": "resolve", "inputs": {"source": "inputs.radiance"}, "params": {}}
    assert codes(spec) == []
    assert "which has no param 'radius' of 'blur'" in spec.notes[0].message


def test_sub_pipelines_in_sub_pipelines(folder: Path, toy_catalog: Catalog) -> None:
    (folder / "twice.yaml").write_text(
        "inputs: {radiance: {semantic: radiance}}\nparameters: {r: {default: 3}}\n"
        "nodes:\n  a: {type: ./glow.yaml, inputs: {radiance: inputs.radiance}, params: {radius: $r}}\n"
        "  b: {type: ./glow.yaml, inputs: {radiance: a.radiance}}\noutputs: {radiance: b.radiance}\n"
    )
    (folder / "main.yaml").write_text(GLOWING.replace("./glow.yaml", "./twice.yaml").replace("radius: 7", "r: 2"))
    spec = resolve(folder / "main.yaml", catalog=toy_catalog, sets=["glow/a/again.radius=11", "glow/b.radius=6"])
    nodes = nodes_of(spec)
    assert nodes["glow/a/blur"]["params"] == {"radius": 2}
    assert nodes["glow/a/again"]["params"] == {"radius": 11}
    assert nodes["glow/b/blur"]["params"] == {"radius": 6}
    assert list(spec.scopes) == ["glow/", "glow/a/", "glow/b/"]


@pytest.mark.slow
def test_too_many_nodes_from_small_files(folder: Path, toy_catalog: Catalog) -> None:
    for level in range(1, 6):
        inner = f"./level{level - 1}.yaml" if level > 1 else "blur"
        nodes = "".join(f"  n{i}: {{type: {inner}}}\n" for i in range(10))
        (folder / f"level{level}.yaml").write_text(f"nodes:\n{nodes}outputs: {{}}\n")
    with pytest.raises(InputError, match="RG018 the pipeline has more than 10,000 nodes"):
        resolve(folder / "level5.yaml", catalog=toy_catalog)


# --- the resolved file -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["forward", "prepass", "glowing"])
@pytest.mark.parametrize("origins", [False, True])
def test_the_resolved_file_reads_back_to_the_same(folder: Path, toy_catalog: Catalog, name: str, origins: bool) -> None:
    sets = ["softness=5", "light.ambient=[0.1, 1e-7, 3]"] + (["glow/again.radius=9"] if name == "glowing" else [])
    spec = resolve(folder / f"{name}.yaml", catalog=toy_catalog, sets=sets, size=(20, 10))
    text = spec.to_yaml(origins)
    (folder / "glow.yaml").unlink()
    again = resolve(parse(text, path=folder / f"{name}.yaml"), catalog=toy_catalog)
    assert again.problems == ()
    assert nodes_of(again) == nodes_of(spec)
    assert again.plain() == spec.plain()
    assert (again.size, list(again.nodes), list(again.scopes)) == (spec.size, list(spec.nodes), list(spec.scopes))
    assert again.to_yaml() == spec.to_yaml()


scalars = st.none() | st.booleans() | st.integers(-(2**62), 2**62) | st.floats(allow_nan=False) | st.text()
names = st.text(min_size=1, max_size=8)
values = st.recursive(scalars, lambda inner: st.lists(inner) | st.dictionaries(names, inner), max_leaves=8)


@pytest.mark.slow
@given(values)
@settings(max_examples=300, deadline=None)
def test_any_value_is_written_so_that_it_reads_back(value: Any) -> None:
    from rendergraph.resolve.spec import to_yaml

    tree = from_plain({"params": {"x": value}}, Source("here"))
    try:
        found = parse(to_yaml(tree, origins=True)).root.plain()["params"]["x"]
    except InputError as error:  # lone surrogates and the like cannot stand in YAML at all
        assert all(problem.code == "RG008" for problem in error.problems)  # noqa: PT017  # any other error fails here
    else:
        assert found == value
        assert math.copysign(1, found) == math.copysign(1, value) if isinstance(value, float) else True


# --- RFC 7386 --------------------------------------------------------------------------------------------------------

json_values: st.SearchStrategy[Any] = st.recursive(
    st.booleans() | st.integers(-5, 5) | st.text("ab", max_size=2),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from("abcd"), inner, max_size=4),
    max_leaves=12,
)
patches = st.recursive(
    st.none() | json_values,
    lambda inner: st.dictionaries(st.sampled_from("abcd"), inner, max_size=4),
    max_leaves=12,
)


def tree_of(data: Any) -> Value:
    return from_plain(data, Source("here"))


def rfc_7386(target: Any, patch: Any) -> Any:
    """The pseudo-code of the RFC, word for word."""
    if isinstance(patch, dict):
        if not isinstance(target, dict):
            target = {}
        target = dict(target)
        for name, value in patch.items():
            if value is None:
                target.pop(name, None)
            else:
                target[name] = rfc_7386(target.get(name), value)
        return target
    return patch


@pytest.mark.slow
@given(json_values, patches)
def test_merging_is_the_rfc(target: Any, patch: Any) -> None:
    assert merge_patch(tree_of(target), tree_of(patch)).plain() == rfc_7386(target, patch)


@pytest.mark.slow
@given(json_values, json_values)
def test_a_difference_applied_gives_the_new(old: Any, new: Any) -> None:
    assert merge_patch(tree_of(old), tree_of(diff(old, new))).plain() == new


# --- roots -----------------------------------------------------------------------------------------------------------


def scene_pipeline(folder: Path, scene: str) -> Path:
    file = folder / "with_scene.yaml"
    file.write_text(f"scene: {scene}\n{FORWARD}")
    return file


def test_a_scene_beside_the_file(tmp_path: Path, toy_catalog: Catalog) -> None:
    (tmp_path / "room.glb").touch()
    spec = resolve(scene_pipeline(tmp_path, "./room.glb"), catalog=toy_catalog)
    assert spec.scene == tmp_path / "room.glb"
    assert spec.roots.check(tmp_path / "room.glb") == (tmp_path / "room.glb").resolve()
    assert "scene: room.glb\n" in spec.to_yaml()
    with pytest.raises(InputError, match=r"RG012 .* lies outside .*--asset-root DIR"):
        spec.roots.check(tmp_path.parent / "other.png")


def test_a_link_that_leads_outside_is_refused(tmp_path: Path, toy_catalog: Catalog) -> None:
    inside, outside = tmp_path / "in", tmp_path / "out"
    inside.mkdir()
    outside.mkdir()
    (outside / "room.glb").touch()
    (inside / "link.glb").symlink_to(outside / "room.glb")
    (inside / "folder").symlink_to(outside)
    for scene in ("./link.glb", "./folder/room.glb", "../out/room.glb", str(outside / "room.glb")):
        assert codes(resolve(scene_pipeline(inside, scene), catalog=toy_catalog)) == ["RG012"]
        spec = resolve(scene_pipeline(inside, scene), catalog=toy_catalog, asset_roots=[outside])
        assert codes(spec) == []


def test_loops_of_links_and_odd_paths_are_refused(tmp_path: Path, toy_catalog: Catalog) -> None:
    (tmp_path / "a.glb").symlink_to(tmp_path / "b.glb")
    (tmp_path / "b.glb").symlink_to(tmp_path / "a.glb")
    for scene in ("./a.glb", '"./x\\0y.glb"', "./" + "x" * 300, "/dev/zero", "file:///etc/passwd"):
        assert codes(resolve(scene_pipeline(tmp_path, scene), catalog=toy_catalog))[0] in ("RG011", "RG012")


def test_the_project_is_a_root(tmp_path: Path, toy_catalog: Catalog, monkeypatch: pytest.MonkeyPatch) -> None:
    project, assets, elsewhere = tmp_path / "project", tmp_path / "assets", tmp_path / "elsewhere"
    pipelines = project / "pipelines"
    for made in (pipelines, assets, elsewhere):
        made.mkdir(parents=True)
    (project / "room.glb").touch()
    (assets / "room.glb").touch()
    assert codes(resolve(scene_pipeline(pipelines, "../room.glb"), catalog=toy_catalog)) == ["RG012"]
    (project / "rendergraph.toml").write_text('asset_roots = ["../assets"]\n')
    monkeypatch.chdir(elsewhere)
    assert codes(resolve(scene_pipeline(pipelines, "../room.glb"), catalog=toy_catalog)) == []
    # What a project adds counts for those who stand in it, not for those who only open a file of it.
    assert codes(resolve(scene_pipeline(pipelines, "../../assets/room.glb"), catalog=toy_catalog)) == ["RG012"]
    monkeypatch.chdir(pipelines)
    assert codes(resolve(scene_pipeline(pipelines, "../../assets/room.glb"), catalog=toy_catalog)) == []


def test_what_is_reached_through_extends_has_the_first_files_roots(tmp_path: Path, toy_catalog: Catalog) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "base.yaml").write_text("scene: ../room.glb\n" + FORWARD)
    (tmp_path / "room.glb").touch()
    (tmp_path / "main.yaml").write_text("extends: ./parts/base.yaml\n")
    spec = resolve(tmp_path / "main.yaml", catalog=toy_catalog)
    assert spec.problems == ()
    assert spec.scene == tmp_path / "room.glb"
    assert codes(resolve(tmp_path / "parts" / "base.yaml", catalog=toy_catalog)) == ["RG012"]


def test_a_typed_scene_is_the_users_own(tmp_path: Path, toy_catalog: Catalog) -> None:
    pipelines, scenes = tmp_path / "pipelines", tmp_path / "scenes"
    pipelines.mkdir()
    scenes.mkdir()
    (scenes / "room.glb").touch()
    file = pipelines / "forward.yaml"
    file.write_text(FORWARD)
    spec = resolve(file, catalog=toy_catalog, scene=str(scenes / "room.glb"))
    assert spec.scene == scenes / "room.glb"
    assert spec.roots.check(scenes / "room.glb")
    with pytest.raises(InputError, match="RG012"):
        spec.roots.check(file)
    assert codes(resolve(file, catalog=toy_catalog, scene=str(scenes / "none.glb"))) == ["RG011"]
    assert codes(resolve(file, catalog=toy_catalog, scene="nonesuch")) == ["RG015"]


def test_a_shipped_scene(tmp_path: Path, toy_catalog: Catalog) -> None:
    spec = resolve(scene_pipeline(tmp_path, "cornell_box"), catalog=toy_catalog)
    assert spec.scene is not None
    assert spec.scene.name == "cornell_box.yaml"
    assert "scene: cornell_box\n" in spec.to_yaml()
    assert resolve(parse(spec.to_yaml()), catalog=toy_catalog).scene == spec.scene


@pytest.mark.slow
@given(st.text(alphabet=st.sampled_from("ab1 .:-?,[]{}&*!|>'\"%@#<\n\\$~=/"), max_size=40))
@settings(max_examples=300, deadline=None)
def test_any_setting_is_applied_or_refused(toy_catalog: Catalog, text: str) -> None:
    for setting in (text, f"light.ambient={text}", f"light.lookup={text}", f"light.type={text}"):
        try:
            resolve(read(None, FORWARD), catalog=toy_catalog, sets=[setting])
        except (InputError, UsageError) as error:
            assert error.problems  # noqa: PT017  # any other error fails here
