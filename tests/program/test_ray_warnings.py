"""What rays miss of plugins is said by `check` and by `run`."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from rendergraph.cli.app import main
from rendergraph.resources import folder

SKETCH = Path(__file__).parents[2] / "docs" / "examples" / "rendergraph-sketch" / "rendergraph_sketch"
WAVY = '''"""Draws waves."""

from rendergraph.api import Depth, Node, Output, Radiance, Steps


class Wavy(Node):
    """Waves."""

    color = Output(Radiance, clear=0.0, doc="White.")
    depth = Output(Depth, clear=0.0, doc="Depth.")

    def record(self, steps: Steps) -> None:
        """Draw."""
        out = {"color": self.color, "depth": self.depth}
        steps.geometry("wavy.frag", vertex="wavy.vert", out=out, materials="none"PLACE)
'''
VERTEX = """#include <transform.glsl>
void main() { gl_Position = world_to_clip(object_to_world(in_position) + vec3(0.0, 0.1, 0.0)); }
"""


def text_of(code: str) -> str:
    """The message of a page without what is in front of it."""
    (file,) = folder("rendergraph.errors").glob(f"{code}-*.yaml")
    message: str = yaml.safe_load(file.read_text(encoding="utf-8"))["message"]
    return message.partition("): " if code == "RG625" else "warning: ")[2]


@pytest.mark.parametrize(
    ("base", "place", "warns"),
    [
        ("path-traced", "", True),
        ("traced-shadows", "", True),
        ("path-traced", ", in_place=True", False),
        ("forward", "", False),
    ],
)
def test_vertices_that_a_plugin_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], base: str, place: str, warns: bool
) -> None:
    (tmp_path / "wavy.py").write_text(WAVY.replace("PLACE", place))
    (tmp_path / "wavy.vert").write_text(VERTEX)
    (tmp_path / "wavy.frag").write_text("out vec4 color;\nvoid main() { color = vec4(1.0); }\n")
    file = tmp_path / "waves.yaml"
    waves = "nodes: {waves: {type: wavy}}\noutputs: {waves: waves.color}\n"
    file.write_text(f"rendergraph: 1\nextends: {base}\n{waves}")
    assert main(["check", str(file), "--plugin", str(tmp_path / "wavy.py")]) == 0
    said = capsys.readouterr().err
    assert ("warning: RG625 node 'waves' (wavy): " in said) == warns
    assert (text_of("RG625") in said) == (warns and base == "path-traced")


def test_shading_models_that_choose_no_directions(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words = ["path-traced", "--scene", "cornell_box", "--size", "8x8", "--plugin", str(SKETCH), "-s", "light.samples=4"]
    assert main(["run", *words, "-s", "light.shading=toon", "-o", str(tmp_path / "x.png")]) == 0
    assert text_of("RG626") in capsys.readouterr().err
    assert main(["check", *words, "-s", "light.shading=phong"]) == 0
    assert "RG626" not in capsys.readouterr().err
