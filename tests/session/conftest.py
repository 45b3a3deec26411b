"""A small plugin: a node with a helper, a shader that includes a file which includes another."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

MODULE = """
from rendergraph.api import Any, Node, Output, define, param
from ._values import GAIN


class Flat(Node):
    \"\"\"One value.\"\"\"

    color = Output(Any, format="r32f", doc="One value.")
    gain: float = param(default=GAIN, doc="Factor.")
    steps: int = define(default=1, doc="How often.")
"""
SHADER = """
#include "outer.glsl"
uniform float gain;
out float color;
void main() { color = value() * gain * float(STEPS); }
"""
PIPELINE = """
rendergraph: 1
size: [4, 4]
nodes:
  flat: {type: flat, params: {steps: 1}}
  other: {type: other}
outputs: {image: flat.color, other: other.color}
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A folder with `flat.yaml` and the plugin folder `fx`; the value is 0.5."""
    files = {
        "flat.yaml": PIPELINE,
        "fx/flat.py": MODULE,
        "fx/_values.py": "GAIN = 1.0\n",
        "fx/flat.frag": SHADER,
        "fx/outer.glsl": '#include "inner.glsl"\nfloat value() { return VALUE; }\n',
        "fx/inner.glsl": "#define VALUE 0.5\n",
        "fx/other.py": MODULE.replace("Flat", "Other").replace("    steps: int", "    _: int").partition("    _:")[0],
        "fx/other.frag": "uniform float gain; out float color; void main() { color = 0.25 * gain; }",
    }
    (tmp_path / "fx").mkdir()
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    return tmp_path


Edit = Callable[[str, str, str], None]


@pytest.fixture
def edit(project: Path) -> Edit:
    """`edit(file, old, new)` replaces text in place."""

    def replace(name: str, old: str, new: str) -> None:
        text = (project / name).read_text()
        assert old in text
        (project / name).write_text(text.replace(old, new))

    return replace
