"""`rendergraph mcp`, asked by the SDK's own client: what the verbs say, pictures, and the folder that nothing leaves."""

from __future__ import annotations

import asyncio
import base64
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mcp")

from mcp import Client, StdioServerParameters  # it is an extra

from rendergraph.cli.mcp import server  # as above

TEXT = "rendergraph: 1\nextends: forward\n"


def ask(made: Any, *calls: tuple[str, dict[str, Any]]) -> list[Any]:
    async def asked() -> list[Any]:
        async with Client(made) as client:
            tools = {tool.name for tool in (await client.list_tools()).tools}
            assert {"nodes", "explain", "check", "plan", "run", "compare", "texture"} <= tools
            return [await client.call_tool(name, arguments) for name, arguments in calls]

    with ThreadPoolExecutor(1) as thread:  # a browser that other tests have opened runs a loop in this one
        return thread.submit(asyncio.run, asked()).result()


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "work"
    folder.mkdir()
    (tmp_path / "outside.yaml").write_text(TEXT)
    (folder / "link.yaml").symlink_to(tmp_path / "outside.yaml")
    (folder / "own.yaml").write_text(TEXT)
    monkeypatch.chdir(folder)
    return folder


def test_an_assistant_gets_what_the_verbs_print_and_pictures(root: Path) -> None:
    small = {"size": (32, 18)}
    nodes, explained, good, bad, planned, drawn, tapped, compared = ask(
        server(root),
        ("nodes", {}),
        ("explain", {"topic": "tonemap"}),
        ("check", {"pipeline": "own.yaml", "settings": ["shadows.taps=2"]}),
        ("check", {"pipeline": f"{TEXT}nodes: {{light: {{params: {{ambiant: 1}}}}}}\n"}),
        ("plan", {"pipeline": TEXT}),
        ("run", {"pipeline": f"{TEXT}scene: cornell_box\n", **small}),
        ("texture", {"pipeline": "forward", "port": "sun.shadow_map", **small}),
        ("compare", {"pipelines": ["forward", "forward"], "settings": [[], ["light.shading=phong"]], **small}),
    )
    assert "tonemap" in nodes.content[0].text
    assert "tone curve" in explained.content[0].text
    assert not good.is_error
    assert bad.is_error
    assert "RG103" in bad.content[0].text
    assert "did you mean 'ambient'" in bad.content[0].text
    assert "lower bound" in planned.content[0].text
    assert base64.b64decode(drawn.content[1].data).startswith(b"\x89PNG")
    assert "mean" in tapped.content[0].text
    assert "FLIP" in compared.content[0].text
    assert [part.type for part in compared.content] == ["text", "image", "image"]


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("run", {"pipeline": "../outside.yaml"}),
        ("run", {"pipeline": "link.yaml"}),
        ("run", {"pipeline": "/etc/passwd"}),
        ("check", {"pipeline": "forward", "settings": ["scene=../outside.yaml"]}),
        ("check", {"pipeline": "forward", "settings": ["scene.environment={file: /etc/hosts}"]}),
        ("check", {"pipeline": "forward", "settings": ["light.type=~/x.frag"]}),
        ("check", {"pipeline": "rendergraph: 1\nextends: ../outside.yaml\n"}),
        ("check", {"pipeline": "rendergraph: 1\nextends: forward\nscene: {environment: {file: /etc/hosts}}\n"}),
        ("explain", {"topic": "../outside.yaml"}),
    ],
)
def test_nothing_leaves_the_folder(root: Path, name: str, arguments: dict[str, Any]) -> None:
    (answer,) = ask(server(root), (name, arguments))
    assert answer.is_error
    assert "outside" in answer.content[0].text


def test_files_are_written_only_with_leave(root: Path) -> None:
    picture = ("run", {"pipeline": "forward", "size": (16, 9), "output": "a.png"})
    (refused,) = ask(server(root), picture)
    assert refused.is_error
    assert "rendergraph mcp --write" in refused.content[0].text
    assert not (root / "a.png").exists()
    text = ("write_file", {"path": "new.yaml", "text": TEXT})
    drawn, written, outside, code = ask(
        server(root, write=True),
        picture,
        text,
        ("write_file", {"path": "../new.yaml", "text": TEXT}),
        ("write_file", {"path": "new.py", "text": ""}),
    )
    assert not drawn.is_error
    assert not written.is_error
    assert (root / "a.png").exists()
    assert (root / "new.yaml").read_text() == TEXT
    assert outside.is_error
    assert code.is_error


@pytest.mark.slow
def test_the_verb_serves_over_standard_input_and_output(root: Path) -> None:
    parameters = StdioServerParameters(command=sys.executable, args=["-m", "rendergraph", "mcp"], cwd=str(root))
    explained, drawn = ask(
        parameters, ("explain", {"topic": "RG103"}), ("run", {"pipeline": "own.yaml", "size": (16, 9)})
    )
    assert "RG103" in explained.content[0].text
    assert drawn.content[1].mime_type == "image/png"
    assert sorted(path.name for path in root.iterdir()) == ["link.yaml", "own.yaml"]
