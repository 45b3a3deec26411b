"""Making pipelines comparable, and finding what they are compared to."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rendergraph.compare.values import Pixels
from rendergraph.errors import InputError, Place, Problem
from rendergraph.metrics import Encoding, check_sizes

if TYPE_CHECKING:
    from rendergraph.session import Pipeline
    from rendergraph.session.values import Linked

PICTURES = frozenset({".png", ".jpg", ".jpeg", ".exr", ".hdr", ".bmp", ".tga"})
"""Extensions that make a reference a picture rather than a pipeline."""


def is_picture(name: str | Path) -> bool:
    """Whether a reference's name is a picture's."""
    return Path(name).suffix.lower() in PICTURES


def read_picture(path: Path, size: tuple[int, int], name: str) -> tuple[Pixels, Encoding]:
    """A reference picture and what its values are: floats are linear light, whole numbers are display-referred.

    Args:
        path: the file.
        size: width and height it must have.
        name: what is compared with it, for the message.

    Raises:
        InputError: it cannot be read, has layers, or another size.
    """
    from rendergraph.images import read  # a sweep is checked without OpenImageIO

    pixels = read(path)
    if pixels.ndim != 3:
        text = "the image has layers; a reference is one picture of R, G, B or Y"
        raise InputError(Problem("RG354", text, Place(str(path))))
    check_sizes(np.empty((size[1], size[0])), pixels, (name, str(path)))
    return pixels, "linear" if np.issubdtype(pixels.dtype, np.floating) else "display"


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
    found: list[str] = []
    for name in names:
        number, unique = 1, name
        while unique in found or (number > 1 and unique in names):
            number += 1
            unique = f"{name}-{number}"
        found.append(unique)
    return found


def compared_output(pipelines: Sequence[Pipeline], encoding: Encoding | None) -> tuple[str, Encoding]:
    """The output that all pipelines have and that fits the reference, with the encoding of its values.

    Args:
        pipelines: what is compared.
        encoding: the reference's where that is a picture.

    Raises:
        InputError: one of them lacks it.
    """
    wanted = {"display": ["image"], "linear": ["radiance"]}.get(encoding or "", ["image", "radiance"])
    for output in wanted:
        if all(output in pipeline.link().graph.outputs for pipeline in pipelines):
            return output, "display" if output == "image" else "linear"
    lacking = next(graph for p in pipelines if wanted[0] not in (graph := p.link().graph).outputs)
    known = ", ".join(lacking.outputs)
    text = f"pipeline '{lacking.name}' has no output '{wanted[0]}' to compare; there is {known}"
    raise InputError(Problem("RG522", text))
