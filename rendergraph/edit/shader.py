"""Replace old names of the shared includes in a shader's text."""

from __future__ import annotations

import re
from pathlib import Path

from rendergraph.glsl import Includes, strip_comments
from rendergraph.glsl.source import find_old_names, old_name_pattern, old_names
from rendergraph.resources import folder


def upgraded_shader(file: Path, text: str) -> str:
    """Return a shader's text with new names for those that RG449 warns about; comments stay."""
    shared = folder("rendergraph.shaders") / "include"
    includes = Includes(shared)
    source = includes.expand(shared / "view.glsl") + includes.expand(file, versions=True)
    said = {problem.message for problem in find_old_names(source, shared)[1]}
    for old, new in old_names(shared).items():
        if f"'{old}' is now called '{new}'" in said:
            written = {"<": f"<{new}>", ".": f".{new}"}.get(old[0], new)
            for found in reversed([*re.finditer(old_name_pattern(old), strip_comments(text))]):
                text = text[: found.start()] + written + text[found.end() :]
    return text
