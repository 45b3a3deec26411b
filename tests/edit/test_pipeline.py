"""Pipeline files changed by `rendergraph edit`: the graph is the one that the same change gives elsewhere."""

from __future__ import annotations

import difflib
import json
import re
import stat
from pathlib import Path
from typing import Any

import pytest
import yaml

from rendergraph.catalog import Catalog
from rendergraph.cli.app import main
from rendergraph.document import parse
from rendergraph.edit import PipelineText
from rendergraph.errors import InputError
from rendergraph.read import read
from rendergraph.resolve import resolve
from rendergraph.resources import folder, shipped_pipelines

CATALOG = Catalog.discover()

WHOLE = """\
rendergraph: 1   # the version
# A renderer.
nodes:
  gbuffer: {type: gbuffer}
  sun: {type: shadow_map, params: {resolution: 512}}

  # Hard shadows.
  shadows:
    type: shadow_pcf
    inputs: {shadow_map: sun.shadow_map, depth: gbuffer.depth}  # screen space
    params:
      taps: 1
  light:
    type: deferred_lighting
    inputs: {gbuffer: gbuffer, visibility: [shadows.visibility]}
  display: {type: tonemap, inputs: {radiance: light}}
outputs: {image: display.color, radiance: light.radiance}
"""

VARIANT = """\
extends: forward
nodes:
  light: {params: {ambient: 0.2}}  # brighter
  glow: {type: bloom, inputs: {radiance: light.radiance}}
  display: {inputs: {radiance: glow.radiance}}
"""


def edited(text: str, operation: str, *words: Any) -> str:
    pipeline = PipelineText(text, Path("mine.yaml"), CATALOG)
    getattr(pipeline, operation)(*words)
    return pipeline.text


def resolved(text: str, *sets: str) -> Any:
    return resolve(read(Path("mine.yaml"), text), catalog=CATALOG, sets=sets).tree.plain()


def as_read(tree: Any) -> Any:
    """One link and a list of it are the same, and so are no params and empty ones."""
    return yaml.safe_load(re.sub(r'\[("[^"]*")\]', r"\1", json.dumps(tree)).replace(', "params": {}', ""))


def changes(before: str, after: str) -> list[str]:
    """Lines that differ."""
    found = difflib.ndiff(before.splitlines(keepends=True), after.splitlines(keepends=True))
    return [line.rstrip("\n") for line in found if line[0] in "+-"]


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("text", [WHOLE, VARIANT], ids=["whole", "extends"])
@pytest.mark.parametrize(
    ("words", "same"),
    [
        (("set", "light.ambient", 0.5), "light.ambient=0.5"),
        (("set", "display.exposure", 2), "display.exposure=2"),
        (("connect", "display.radiance", ["light.radiance"]), "display.radiance=light.radiance"),
        (("connect", "light.visibility", ["shadows.visibility"]), "light.visibility=[shadows.visibility]"),
        (("retype", "shadows", "shadow_vsm"), "shadows.type=shadow_vsm"),
        (("disable", "shadows"), "shadows.enabled=false"),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_an_edit_is_the_setting_of_the_command_line(words: tuple[Any, ...], same: str, text: str, newline: str) -> None:
    after = edited(text.replace("\n", newline), *words)
    expected = resolved(text, same)
    assert as_read(resolved(after)) == as_read(expected)


def test_what_a_file_says_itself_is_changed_in_place() -> None:
    assert changes(WHOLE, edited(WHOLE, "set", "shadows.taps", 3)) == ["-       taps: 1", "+       taps: 3"]
    assert changes(WHOLE, edited(WHOLE, "disable", "shadows"))[-1] == "+     enabled: false"
    assert edited(edited(WHOLE, "disable", "shadows"), "enable", "shadows") == WHOLE
    assert edited(WHOLE, "enable", "shadows") == WHOLE
    added = edited(WHOLE, "add", "glow", "bloom", {"radiance": "light.radiance", "intensity": 0.5})
    assert changes(WHOLE, added) == [
        "+   glow: {type: bloom, inputs: {radiance: light.radiance}, params: {intensity: 0.5}}"
    ]
    assert edited(added, "delete", "glow") == WHOLE
    without = edited(WHOLE, "set", "shadows.taps", None)
    assert changes(WHOLE, without) == ["-     params:", "-       taps: 1"]  # what would be empty goes, too
    assert edited(WHOLE, "set", "size", [64, 32]) == WHOLE + "size: [64, 32]\n"


def test_a_renamed_node_is_renamed_in_all_links() -> None:
    after = edited(WHOLE, "rename", "light", "lit")
    assert after == WHOLE.replace("  light:", "  lit:").replace("light.radiance", "lit.radiance").replace(
        "radiance: light}", "radiance: lit}"
    )
    after = edited(WHOLE, "rename", "shadows", "shade")
    assert "[shade.visibility]" in after
    assert "# Hard shadows." in after
    assert len(changes(WHOLE, after)) == 4


def test_a_deleted_node_takes_its_links_along() -> None:
    pipeline = PipelineText(WHOLE, Path("mine.yaml"), CATALOG)
    pipeline.delete("shadows")
    assert "shadow_pcf" not in pipeline.text
    assert pipeline.notes == ["'light.visibility' no longer reads 'shadows'"]
    assert "# Hard shadows." in pipeline.text
    assert parse(pipeline.text).root.plain()["nodes"]["light"]["inputs"] == {"gbuffer": "gbuffer"}
    pipeline.delete("display")
    assert "outputs: {radiance: light.radiance}" in pipeline.text


def test_a_node_is_put_into_a_link_and_duplicated() -> None:
    after = edited(WHOLE, "insert", "glow", "bloom", "display.radiance")
    assert "  glow: {type: bloom, inputs: {radiance: light.radiance}}\n" in after
    assert "display: {type: tonemap, inputs: {radiance: glow.radiance}}" in after
    after = edited(after, "insert", "sharp", "fxaa", "outputs.image")
    assert "image: sharp.color" in after
    assert "sharp: {type: fxaa, inputs: {source: display.color}}" in after
    twice = resolved(edited(WHOLE, "duplicate", "shadows", "more"))["nodes"]
    assert twice["more"] == twice["shadows"]
    with pytest.raises(InputError, match="has no single link"):
        edited(WHOLE, "insert", "glow", "bloom", "light.occlusion")


def test_what_a_file_inherits_is_overridden() -> None:
    after = edited(VARIANT, "delete", "shadows")
    assert after == VARIANT.replace("ambient: 0.2}}", "ambient: 0.2}, inputs: {lookup: null}}") + "  shadows: null\n"
    assert "shadows" not in resolved(after)["nodes"]
    assert edited(VARIANT, "disconnect", "light.lookup") == VARIANT.replace(
        "ambient: 0.2}}", "ambient: 0.2}, inputs: {lookup: null}}"
    )
    assert edited(VARIANT, "set", "shadows.taps", 5) == VARIANT + "  shadows: {params: {taps: 5}}\n"
    assert edited(VARIANT, "disconnect", "outputs.radiance") == VARIANT + "outputs: {radiance: null}\n"
    with pytest.raises(InputError, match="comes from the file that this one extends"):
        edited(VARIANT, "rename", "shadows", "shade")


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("set", "lihgt.ambient", 1), "RG109", "did you mean 'light'"),
        (("set", "light.ambiant", 1), "RG103", "did you mean 'ambient'"),
        (("set", "light.visibility", 1), "RG106", "expected a link as in 'node.port'"),
        (("set", "samples", 1), "RG119", "did you mean 'gbuffer.samples'"),
        (("connect", "light.visibilty", ["a.b"]), "RG103", "did you mean 'visibility'"),
        (("connect", "light.ambient", ["a.b"]), "RG111", "set light.ambient VALUE"),
        (("connect", "size", ["a.b"]), "RG111", "set size VALUE"),
        (("connect", "light", ["a.b"]), "RG119", "write light.PARAM=VALUE"),
        (("add", "sun", "shadow_map"), "RG107", "there is a node 'sun' already"),
        (("add", "1st", "shadow_map"), "RG107", "cannot be called '1st'"),
        (("add", "moon", "shadow_mop"), "RG102", "did you mean 'shadow_map'"),
        (("add", "moon", "shadow_map", {"taps": 1}), "RG103", "has no param or input 'taps'"),
        (("disconnect", "light.occlusion"), "RG114", "is not connected"),
        (("rename", "sun", "light"), "RG107", "already"),
        (("insert", "x", "shadow_map", "display.radiance"), "RG112", "name both: INPUT OUTPUT"),
    ],
)
def test_mistakes_are_told(words: tuple[Any, ...], code: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        edited(WHOLE, *words)
    assert caught.value.problems[0].code == code
    assert message in caught.value.problems[0].message


def test_a_broken_file_can_be_mended_but_not_guessed_at() -> None:
    broken = WHOLE.replace("type: tonemap", "type: tonemop")
    with pytest.raises(InputError, match="retype display TYPE"):
        edited(broken, "set", "display.exposure", 1)
    assert edited(broken, "retype", "display", "tonemap") == WHOLE
    for words in (("upgrade",), ("delete", "display")):
        with pytest.raises(InputError, match="RG009"):
            edited("[a]: 1\n" + WHOLE.replace("rendergraph: 1", "size: [8, 8]"), *words)


@pytest.mark.parametrize("name", [*shipped_pipelines()][::6])
def test_shipped_files_lose_nothing(name: str) -> None:
    """A node is added, renamed and deleted: what is left is the file, byte for byte."""
    text = shipped_pipelines()[name].read_text(encoding="utf-8")
    added = edited(text, "add", "new_one", "bloom", {"radiance": "light.radiance"})
    assert [line for line in changes(text, added) if line[0] == "-"] in ([], [text.splitlines()[-1]])
    renamed = edited(added, "rename", "new_one", "newer")
    assert renamed == added.replace("new_one", "newer")
    assert parse(edited(renamed, "delete", "newer")).root.plain() in (
        parse(text).root.plain(),
        parse(text).root.plain() | {"nodes": {}},
    )


def test_what_an_anchor_shares_is_refused_and_an_alias_is_written_out() -> None:
    page = yaml.safe_load((folder("rendergraph.errors") / "RG019-edit.yaml").read_text(encoding="utf-8"))
    wrong: str = page["wrong"]
    operation, end, value = wrong.partition("\n")[0].split()[-3:]
    with pytest.raises(InputError) as caught:
        edited(wrong, operation, end, int(value))
    assert str(caught.value.problems[0]).splitlines()[0] == page["message"]
    assert "exposure: 2" in edited(page["right"], operation, end, int(value))
    for words in (("delete", "display"), ("set", "display.exposure", None)):
        with pytest.raises(InputError, match="RG019"):
            edited(wrong, *words)
    assert edited(wrong, "set", "other.curve", "aces") == wrong.replace("*curve", "{exposure: 1, curve: aces}")
    assert edited(wrong, "set", "other.exposure", None) == wrong.replace(", params: *curve", "")
    assert edited(wrong, "rename", "other", "third") == wrong.replace("other", "third").replace("image", "image")
    assert edited(wrong, "connect", "display.radiance", ["light.radiance"]) == wrong


# --- the command -----------------------------------------------------------------------------------------------------


def test_the_command_writes_shows_and_checks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "mine.yaml"
    raw = b"\xef\xbb\xbf" + WHOLE.replace("\n", "\r\n").rstrip().encode()
    file.write_bytes(raw)
    file.chmod(0o640)
    (tmp_path / "link.yaml").symlink_to(file)
    assert main(["edit", "mine.yaml", "set", "shadows.taps", "3", "--dry-run"]) == 0
    out, err = capsys.readouterr()
    assert "-      taps: 1" in out
    assert "+      taps: 3" in out
    assert err == "mine: 5 nodes, 14 links, 1280×720, outputs image, radiance\n"
    assert file.read_bytes() == raw
    assert main(["edit", "link.yaml", "set", "shadows.taps", "3"]) == 0
    assert file.read_bytes() == raw.replace(b"taps: 1", b"taps: 3")
    assert (stat.S_IMODE(file.stat().st_mode), (tmp_path / "link.yaml").is_symlink()) == (0o640, True)
    capsys.readouterr()
    assert main(["edit", "mine.yaml", "connect", "display.radiance", "gbuffer.normal"]) == 3
    assert "RG110 'display.radiance' expects radiance, but 'gbuffer.normal'" in capsys.readouterr().err
    assert b"gbuffer.normal}}" in file.read_bytes()
    assert main(["edit", "mine.yaml", "connect", "display.radiance", "light.radiance", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["written"], report["errors"]) == (True, [])
    assert main(["edit", "mine.yaml", "set", "display.exposure", "-0.5", "-q"]) == 0
    assert b"params: {exposure: -0.5}" in file.read_bytes()
    assert main(["edit", "mine.yaml", "set", "display.exposure", "1", "--dry-rum"]) == 2
    assert "did you mean '--dry-run'" in capsys.readouterr().err
    assert main(["edit", "mine.yaml", "add", "glow"]) == 2
    assert "expected `rendergraph edit FILE add ID TYPE [NAME=VALUE]...`" in capsys.readouterr().err
    assert main(["edit", "forward", "disable", "sun"]) == 3
    assert "'forward' is shipped; write a file with `extends: forward`" in capsys.readouterr().err


def test_old_files_are_upgraded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    old = WHOLE.replace("rendergraph: 1   # the version\n", "")
    (tmp_path / "old.yaml").write_text(old)
    assert main(["upgrade", "old.yaml"]) == 0
    assert (tmp_path / "old.yaml").read_text() == old.replace("nodes:\n", "rendergraph: 1\nnodes:\n", 1)
    capsys.readouterr()
    assert main(["upgrade", "old.yaml"]) == 0
    assert "nothing to upgrade" in capsys.readouterr().err
    page = yaml.safe_load((folder("rendergraph.errors") / "RG449-old-shader-name.yaml").read_text(encoding="utf-8"))
    shader = "// srgb() is old\n" + page["wrong"]
    (tmp_path / "old.frag").write_text(shader)
    assert main(["upgrade", "old.frag"]) == 0
    assert (tmp_path / "old.frag").read_text() == "// srgb() is old\n" + page["right"]
