"""The shipped pipelines and scenes: a picture, what the file says, and the file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import rendergraph as rg

from .markdown import block, folded, page
from .pictures import Studio, shipped


def pages(studio: Studio) -> Iterator[tuple[str, str]]:
    """One page of pipelines, and a part of a page of scenes."""
    yield (
        "pipelines.md",
        page(
            "Pipelines",
            "Every pipeline that comes with rendergraph, as `rendergraph run NAME` draws it. Each file holds what "
            "differs from the one it extends; ids of nodes are the same everywhere, so settings carry over.",
            *(
                _entry(file, f"rendergraph run {file.stem}", rg.load(file.stem), studio, graph=True)
                for file in shipped()
            ),
        ),
    )
    scenes = [
        _entry(
            file,
            f"rendergraph run forward --scene {file.stem}",
            rg.load("forward").with_scene(file.stem),
            studio,
            graph=False,
        )
        for file in shipped(scenes=True)
    ]
    yield "shipped-scenes.md", "\n\n".join(scenes) + "\n"


def _entry(file: Path, command: str, pipeline: rg.Pipeline, studio: Studio, *, graph: bool) -> str:
    text = file.read_text(encoding="utf-8")
    parts = [f"## {file.stem}", _comment(text)]
    name = f"pictures/{'pipeline' if graph else 'scene'}-{file.stem}.png"
    base = re.search(r"^extends: ([\w-]+)$", text, re.MULTILINE)
    picture = studio.draw_difference(rg.load(base[1]), pipeline, name) if base else None
    if base and picture:
        command = f"`rendergraph run {base[1]}` and `{command}`, where they differ most"
    else:
        picture, command = studio.draw(pipeline, name), f"`{command}`"
    if picture:
        parts.append(f"```{{figure}} /reference/generated/{picture}\n:alt: {file.stem}\n\n{command}\n```")
    parts.append(folded(f"<code>{file.name}</code>", block(text, "yaml")))
    if graph:
        parts.append(folded("graph", f'<div class="graph">\n{_svg(pipeline)}\n</div>\n'))
    return "\n\n".join(parts)


def _svg(pipeline: rg.Pipeline) -> str:
    from rendergraph.diagrams import svg

    # A blank line would end the block of raw HTML.
    return re.sub(r"\n\s*\n", "\n", svg(pipeline.link().graph).strip())


def _comment(text: str) -> str:
    """The comment a file begins with."""
    lines = re.match(r"(?:#.*\n)*", text)
    found = [
        line.lstrip("# ") for line in (lines[0] if lines else "").splitlines() if "yaml-language-server" not in line
    ]
    return " ".join(found)
