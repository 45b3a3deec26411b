"""Making pipelines comparable, and finding what they are compared to."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rendergraph.compare.values import Pixels
from rendergraph.errors import InputError, Option, Place, Problem
from rendergraph.metrics import Encoding, check_sizes
from rendergraph.session.made import is_picture
from rendergraph.session.pipeline import Pipeline, load
from rendergraph.textures import FORMATS

METRIC = "metric"
"""The output that stands for a port that is measured."""
WHOLE = frozenset(name for name, format in FORMATS.items() if format.family in ("int", "uint"))

if TYPE_CHECKING:
    from rendergraph.session.values import Linked


def named_reference(reference: Path | Pipeline | str | None) -> Path | Pipeline | None:
    """A reference, or the picture or pipeline of a name or a file."""
    if not isinstance(reference, str):
        return reference
    return Path(reference) if is_picture(reference) else load(reference)


def read_picture(path: Path, size: tuple[int, int] | None = None, name: str = "") -> tuple[Pixels, Encoding]:
    """A reference picture and what its values are: floats are linear light, whole numbers are display-referred.

    Args:
        path: the file.
        size: width and height it must have, where that is known.
        name: what is compared with it, for the message.

    Raises:
        InputError: it cannot be read, has layers, or another size.
    """
    from rendergraph.images import read  # a sweep is checked without OpenImageIO

    pixels = read(path)
    if pixels.ndim != 3:
        text = "the image has layers; a reference is one picture of R, G, B or Y"
        raise InputError(Problem("RG354", text, Place(str(path))))
    if size is not None:
        check_sizes(np.empty((size[1], size[0])), pixels, (name, str(path)))
    return pixels, "linear" if np.issubdtype(pixels.dtype, np.floating) else "display"


def measured_at(pipeline: Pipeline, metric: str | None) -> Pipeline:
    """The pipeline with one more output, the port that is measured in place of its picture.

    Raises:
        InputError: there is no such port, or it holds no picture.
    """
    if metric is None:
        return pipeline
    found, place = pipeline.patch({"outputs": {METRIC: metric}}), Place(Option("--metric", metric))
    try:
        graph = found.link().graph
    except InputError as error:
        name = found.selection.source
        raise error.relocated(
            lambda problem: (
                problem.relocate(place, context=f"in {name}")
                if problem.place and problem.place.option("patch")
                else problem
            )
        ) from None
    desc = graph.textures[graph.outputs[METRIC]].desc
    if desc is None or desc.kind != "texture2d" or desc.samples > 1 or desc.format in WHOLE:
        what = "a buffer" if desc is None else f"{desc.kind} {desc.format}"
        needed = "what is measured is a picture: one layer, one sample, no whole numbers"
        text = f"'{metric}' of pipeline '{graph.name}' is {what}; {needed}"
        raise InputError(Problem("RG523", text, place))
    return found


def on_one_stage(pipelines: Sequence[Pipeline]) -> tuple[list[Pipeline], list[str]]:
    """The pipelines on the first one's scene and at its size, and what had to be changed for that, in words."""
    specs = [pipeline.resolve().spec for pipeline in pipelines]
    first, notes = specs[0], []
    if first.scene is not None and any(spec.scene != first.scene for spec in specs):
        others = [spec.name for spec in specs if spec.scene != first.scene]
        notes += [f"'{name}' is drawn with the scene of '{first.name}': {first.scene.stem}" for name in others]
        # All of them, the first one too: one scene named in one way is read once and stays on the GPU.
        pipelines = [pipeline.with_scene(first.scene) for pipeline in pipelines]
    width, height = first.size
    others = [spec.name for spec in specs if spec.size != first.size]
    notes += [f"'{name}' is drawn at the size of '{first.name}': {width}×{height}" for name in others]
    return [
        pipeline.with_size(first.size) if spec.size != first.size else pipeline
        for pipeline, spec in zip(pipelines, specs, strict=True)
    ], notes


def scene_name(linked: Linked) -> str:
    """What a report calls the scene: as its file is named, else as itself."""
    return linked.spec.scene.stem if linked.spec.scene else linked.scene.name


def unique_names(names: Sequence[str]) -> list[str]:
    """The names, later ones of a kind with a number behind: `forward`, `forward-2`."""
    found: dict[str, None] = {}
    given = frozenset(names)
    for name in names:
        number, unique = 1, name
        while unique in found or (number > 1 and unique in given):
            number += 1
            unique = f"{name}-{number}"
        found[unique] = None
    return list(found)


def compared_output(
    pipelines: Sequence[Pipeline], encoding: Encoding | None, *, measured: bool = False
) -> tuple[str, Encoding]:
    """The output that all pipelines have and that fits the reference, with the encoding of its values.

    Args:
        pipelines: what is compared.
        encoding: the reference's where that is a picture.
        measured: they are `measured_at` a port.

    Raises:
        InputError: one of them lacks it.
    """
    if measured:
        first = pipelines[0].link().graph
        return METRIC, first.textures[first.outputs[METRIC]].semantic.encoding or "values"
    wanted = {"display": ["image"], "linear": ["radiance"]}.get(encoding or "", ["image", "radiance"])
    for output in wanted:
        if all(output in pipeline.link().graph.outputs for pipeline in pipelines):
            return output, "display" if output == "image" else "linear"
    lacking = next(graph for p in pipelines if wanted[0] not in (graph := p.link().graph).outputs)
    known = ", ".join(lacking.outputs)
    text = f"pipeline '{lacking.name}' has no output '{wanted[0]}' to compare; available: {known}"
    raise InputError(Problem("RG522", text))
