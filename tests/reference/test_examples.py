"""Every node type has a pipeline that shows it at work; it runs as it stands, and the node takes part in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import rendergraph as rg
from rendergraph.api import Depth, DisplayColor, InOut, Input, Luminance, Node, Occlusion, Output, Radiance
from rendergraph.catalog import Catalog
from rendergraph.reference import example_file

TYPES = Catalog.discover().names()


def shown(name: str, catalog: Catalog) -> str:
    text = example_file(catalog.get(name), catalog)
    assert text is not None, name
    return text


def example(name: str, folder: Path) -> rg.Pipeline:
    file = folder / "example.yaml"
    file.write_text(shown(name, Catalog.discover()), encoding="utf-8")
    return rg.load(file, scene="glass", size=(48, 27), shutter=0.5)  # it has surfaces of every kind


@pytest.mark.parametrize("name", TYPES)
def test_an_example_is_valid_and_uses_the_node(tmp_path: Path, name: str) -> None:
    pipeline = example(name, tmp_path)
    culled = pipeline.plan().schedule.culled
    assert [node.id for node in pipeline.link().graph.nodes if node.type.name == name and node.id not in culled]


@pytest.mark.nightly(keep=1)
@pytest.mark.slow
@pytest.mark.parametrize("name", TYPES)
def test_an_example_runs(gl: Any, tmp_path: Path, name: str) -> None:
    frame = gl.render(example(name, tmp_path), warm_up=False)
    assert any(picture.any() for picture in frame.values())


# --- types that no shipped pipeline uses -----------------------------------------------------------------------------


class Fog(Node):
    """An effect on the picture."""

    depth = Input(Depth, doc="How far.")
    radiance = Input(Radiance, doc="Clear.")
    foggy = Output(like="radiance", doc="Foggy.")


class Edges(Node):
    """Nothing reads what it makes."""

    depth = Input(Depth, doc="How far.")
    edges = Output(Luminance, format="r8", doc="Edges.")


class Outlined(Node):
    """Needs what no standard node makes."""

    edges = Input(Luminance, kind="texture_cube", doc="Edges.")
    color = Output(Radiance, doc="Outlined.")


class Film(Node):
    """An effect on what is shown."""

    color = Input(DisplayColor, doc="The picture.")
    filmed = Output(like="color", doc="With grain.")
    grain = Output(Luminance, format="r8", doc="The grain alone.")


class Gap(Node):
    """How open it is, without inputs."""

    occlusion = Output(Occlusion, format="r8", doc="Openness.")


class Veil(Node):
    """An effect with a choice of inputs."""

    veil = Input(Radiance, optional=True, doc="What lies over it.")
    radiance = InOut(Radiance, doc="What it goes on.")


CATALOG = Catalog.discover()


@pytest.mark.parametrize(
    ("cls", "text"),
    [
        (
            Fog,
            """\
extends: forward
nodes:
  fog: {type: fog, inputs: {depth: light.surface_depth, radiance: light.radiance}}
  display: {inputs: {radiance: fog.foggy}}
outputs: {radiance: fog.foggy}
""",
        ),
        (
            Edges,
            """\
extends: forward
nodes:
  edges: {type: edges, inputs: {depth: light.surface_depth}}
outputs: {edges: edges.edges}
""",
        ),
        (
            Film,
            """\
extends: forward
nodes:
  film: {type: film, inputs: {color: display.color}}
outputs: {image: film.filmed, grain: film.grain}
""",
        ),
        (
            Gap,
            """\
extends: forward
nodes:
  gap: {type: gap}
  light: {inputs: {occlusion: gap.occlusion}}
""",
        ),
        (
            Veil,
            """\
extends: forward
nodes:
  veil: {type: veil, inputs: {radiance: light.radiance}}
  display: {inputs: {radiance: veil.radiance}}
outputs: {radiance: veil.radiance}
""",
        ),
        (Outlined, None),
    ],
)
def test_a_patch_is_put_together(cls: type[Node], text: str | None) -> None:
    standard: Any = {name: CATALOG.get(name).cls for name in TYPES}
    catalog = Catalog.of(cls, **standard)
    assert example_file(catalog.get(cls.__name__.lower()), catalog) == text
