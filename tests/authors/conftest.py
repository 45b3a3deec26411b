"""Nodes as their authors write them: a module, its shaders and a pipeline in a folder of their own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import dedent, indent
from typing import Any

import pytest

import rendergraph as rg
from rendergraph.errors import RendergraphError

HEAD = '''"""A node of a stranger's."""

from __future__ import annotations

from typing import Literal

import numpy

from rendergraph.api import *
from rendergraph.api import Any as AnyTexel


'''
PIPELINE = "nodes:\n  a: {type: wrong}\noutputs: {image: a.color}\n"
WHITE = "out vec4 color;\nvoid main() { color = vec4(1.0); }\n"


class Author:
    """Writes plugins and uses them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.plugins = folder / "plugins"
        self.plugins.mkdir()

    def write(self, **files: str) -> None:
        """Files of the plugin; `__` stands for the dot."""
        for name, text in files.items():
            (self.plugins / name.replace("__", ".")).write_text(text)

    def node(self, body: str, name: str = "wrong", before: str = "") -> None:
        """A module with one node class of this body."""
        lines = indent(dedent(body).strip("\n"), "    ")
        text = f'{HEAD}{dedent(before)}class {name.title()}(Node):\n    """A node of a stranger\'s."""\n\n{lines}\n'
        self.write(**{f"{name}__py": text})

    def line(self, marker: str = "# here", file: str = "wrong.py") -> int:
        """The line of the plugin's file that holds a marker."""
        lines = (self.plugins / file).read_text().splitlines()
        return next(number for number, line in enumerate(lines, start=1) if marker in line)

    def pipeline(self, text: str = PIPELINE, *, scene: str | None = None, size: str = "[16, 8]") -> rg.Pipeline:
        """A pipeline that uses the plugin."""
        head = f"rendergraph: 1\nsize: {size}\n"
        if scene is not None:
            (self.folder / "scene.yaml").write_text("scene: 1\n" + scene)
            head += "scene: scene.yaml\n"
        (self.folder / "test.yaml").write_text(head + text)
        return rg.load(self.folder / "test.yaml", plugins=[self.plugins])

    def said(self, act: Any) -> list[str]:
        """What is said, without folders: places read `wrong.py:12`."""
        with pytest.raises(RendergraphError) as caught:
            act()
        return [
            str(problem).splitlines()[0].replace(f"{self.plugins}/", "").replace(f"{self.folder}/", "")
            for problem in caught.value.problems
        ]


@pytest.fixture
def author(tmp_path: Path) -> Author:
    made = Author(tmp_path)
    made.write(wrong__frag=WHITE)
    return made


Files = Mapping[str, str]
