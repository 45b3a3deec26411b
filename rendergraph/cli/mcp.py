"""`rendergraph mcp`: serve the verbs to a coding assistant over the Model Context Protocol, inside one folder.

An assistant is as untrusted as a file: every file that it names must be shipped or lie below the folder, with symbolic
links resolved, and nothing is written unless `--write` allows it.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import os
import re
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.cli.lazy_click import click
from rendergraph.cli.output import data_stream, emit_json
from rendergraph.errors import InputError, Problem, RendergraphError, UsageError
from rendergraph.installed import require
from rendergraph.resources import is_name

if TYPE_CHECKING:
    from mcp.server import MCPServer

    from rendergraph.session import Pipeline

MOST_SIDE = 1024  # pictures travel in messages, and a CPU may have to render them
_INSTRUCTIONS = """Renderers are YAML files, whose nodes are render passes. A `pipeline` is a shipped name (`forward`),
a YAML file, or YAML text, such as `extends: forward` with changes. `settings` are strings such as `shadows.taps=4` or
`scene.lights.key.intensity=2`. Start with `explain` for `pipeline`."""
_PATH_LIKE = re.compile(r"[^\s\[\]{}:,\"'=]+")


@click.command("mcp")
@click.option("--root", type=click.Path(file_okay=False, exists=True), default=".", help="The folder to work in.")
@click.option("--write", is_flag=True, help="Let the assistant write pictures and pipelines into the folder.")
@click.option("--json", "as_json", is_flag=True, help="Print the settings that an assistant needs, as JSON, and exit.")
def mcp(root: str, write: bool, as_json: bool) -> None:
    """Serve a coding assistant over standard input and output.

    Offers `nodes`, `explain`, `check`, `plan`, `run`, `compare` and `texture` over the Model Context Protocol, in one
    folder and without writing files. Requires `pip install 'rendergraph[mcp]'`.

    \b
    Examples:
      rendergraph mcp --root study --write
      rendergraph mcp --json
    """
    if as_json:
        words = ["mcp", "--root", str(Path(root).resolve()), *(["--write"] if write else [])]
        emit_json({"mcpServers": {"rendergraph": {"command": "rendergraph", "args": words}}})
        return
    require("mcp", "mcp", "mcp")
    os.chdir(root)
    with contextlib.ExitStack() as stack:
        if not write:  # nor any cached reference
            os.environ["RENDERGRAPH_CACHE"] = stack.enter_context(tempfile.TemporaryDirectory(prefix="rendergraph-"))
        stack.enter_context(contextlib.redirect_stdout(data_stream()))  # stdout carries the messages
        server(Path.cwd(), write=write).run()


def server(root: Path, *, write: bool = False) -> MCPServer:
    """Return a server for `root`, which must be the current folder."""
    from mcp.server import MCPServer
    from mcp.server.mcpserver import Image
    from mcp.server.mcpserver.exceptions import ToolError

    from rendergraph.version import __version__

    # A single thread renders, because an OpenGL context belongs to the thread that created it.
    worker = ThreadPoolExecutor(1, thread_name_prefix="rendergraph-mcp")
    made = MCPServer("rendergraph", instructions=_INSTRUCTIONS, version=__version__, log_level="ERROR")

    def tool(work: Callable[..., Any]) -> None:
        """Offer a function as a tool: it runs in the worker; its errors give the assistant every mistake's place."""

        @wraps(work)
        async def call(*arguments: Any, **keywords: Any) -> Any:
            try:
                return await asyncio.get_running_loop().run_in_executor(worker, partial(work, *arguments, **keywords))
            except (RendergraphError, KeyError) as error:
                raise ToolError(str(error)) from None

        made.tool(structured_output=False)(call)

    @tool
    def nodes() -> str:
        """List the node types by family, each with a summary."""
        return _verb("nodes")

    @tool
    def explain(topic: str) -> str:
        """Explain a node type, a pipeline, a scene, an error code, a kind of file (`pipeline`, `scene`) or `api`."""
        return _verb("explain", *_inside(root, topic))

    @tool
    def check(pipeline: str, settings: list[str] | None = None) -> str:
        """Find all mistakes in a pipeline without rendering it, each with its place and fix."""
        return _verb("check", *_words(root, pipeline, settings), text=pipeline)

    @tool
    def plan(pipeline: str, settings: list[str] | None = None) -> str:
        """Print the order of passes, and the memory of their textures."""
        return _verb("plan", *_words(root, pipeline, settings), text=pipeline)

    @tool
    def run(
        pipeline: str,
        settings: list[str] | None = None,
        size: tuple[int, int] = (480, 270),
        frame: int = 1,
        output: str | None = None,
    ) -> list[Any]:
        """Render a pipeline and return its picture; `output` writes it to a file, if the server may write."""
        if output is not None and not write:
            raise UsageError(Problem("RG500", "this server writes no files; start it with: rendergraph mcp --write"))
        target = None if output is None else _check(root, output)
        found = _pipeline(root, pipeline, settings, size).render(frames=range(frame, frame + 1))
        shown = [f"{one['node']} ({one['type']})" for one in found.passes]
        saved = f"; written to {found.save(target)}" if target is not None else ""
        return [f"{found!r}; passes: {', '.join(shown)}{saved}", Image(data=found._repr_png_(), format="png")]

    @tool
    def texture(
        pipeline: str,
        port: str,
        settings: list[str] | None = None,
        size: tuple[int, int] = (480, 270),
        layer: int | None = None,
        channel: int | None = None,
    ) -> list[Any]:
        """Return the texture of any port (`ao.occlusion`) as a picture in false colours, with its range and mean."""
        found = _pipeline(root, pipeline, settings, size).render(taps=[port])
        shown, values = found.show(port, layer=layer, channel=channel), found[port]
        text = f"{shown!r}; shape {values.shape}, {values.dtype}, least {values.min():g}, greatest {values.max():g}"
        return [f"{text}, mean {values.mean():g}", Image(data=shown.png, format="png")]

    @tool
    def compare(
        pipelines: list[str],
        settings: list[list[str]] | None = None,
        reference: str | None = None,
        size: tuple[int, int] = (320, 180),
    ) -> list[Any]:
        """Compare pictures, times and memory of pipelines; `settings` has a list for each. The reference is first."""
        from rendergraph.cli.compare import comparison_text
        from rendergraph.compare import compare
        from rendergraph.compare.report.html import eight_bit
        from rendergraph.images import Shown

        each = settings or [[] for _ in pipelines]
        if len(each) != len(pipelines):
            raise UsageError(Problem("RG500", f"expected settings for {len(pipelines)} pipelines, got {len(each)}"))
        given = [_pipeline(root, name, own, size) for name, own in zip(pipelines, each, strict=True)]
        against = None if reference is None else _pipeline(root, reference, (), size)
        found = compare(given, against, frames=3)
        pictures = [eight_bit(each.pixels, each.encoding) for each in found if each.pixels is not None]
        return [comparison_text(found), *(Image(data=Shown("", one).png, format="png") for one in pictures[:6])]

    def write_file(path: str, text: str) -> str:
        """Write a pipeline, a scene or a shader (.yaml, .frag, .comp, .glsl) into the folder."""
        target = _check(root, path)
        if target.suffix not in (".yaml", ".frag", ".comp", ".glsl"):
            raise UsageError(Problem("RG501", "expected a file that ends in .yaml, .frag, .comp or .glsl"))
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")
        return f"written to {target.relative_to(root)}"

    if write:
        tool(write_file)
    return made


def _verb(*words: str, text: str = "") -> str:
    """Run a verb with `text` on its standard input, and return what it prints."""
    from mcp.server.mcpserver.exceptions import ToolError

    from rendergraph.cli.app import main

    out, stdin = io.StringIO(), sys.stdin
    try:
        sys.stdin = io.TextIOWrapper(io.BytesIO(text.encode()))
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            code = main(list(words))
    finally:
        sys.stdin = stdin
    printed = out.getvalue().rstrip("\n")
    if code:
        raise ToolError(printed)
    return printed


def _words(root: Path, pipeline: str, settings: Sequence[str] | None) -> list[str]:
    checked = _inside(root, *(settings or ()))
    name = "-" if "\n" in pipeline else _inside(root, pipeline)[0]
    return [name, *(word for setting in checked for word in ("-s", setting))]


def _pipeline(root: Path, pipeline: str, settings: Sequence[str] | None, size: tuple[int, int]) -> Pipeline:
    from rendergraph.session import load

    if max(size) > MOST_SIDE:
        raise UsageError(Problem("RG500", f"a picture has at most {MOST_SIDE} pixels a side; got {size[0]}×{size[1]}"))
    name = pipeline if "\n" in pipeline else _inside(root, pipeline)[0]
    return load(name, size=(size[0], size[1]), sets=_inside(root, *(settings or ())))


def _inside(root: Path, *texts: str) -> list[str]:
    """Return the texts; raise InputError if anything in them that may be a path leads out of the folder."""
    for text in texts:
        for word in _PATH_LIKE.findall(text):
            if not is_name(word) and ("/" in word or ".." in word or "~" in word):
                _check(root, word)
        if Path(text).exists():
            _check(root, text)
    return list(texts)


def _check(root: Path, word: str) -> Path:
    path = (root / Path(word).expanduser()).resolve()
    if not path.is_relative_to(root.resolve()):
        raise InputError(Problem("RG012", f"'{word}' lies outside the folder of this server, '{root}'"))
    return path
