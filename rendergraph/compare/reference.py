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
    from rendergraph.images import read

    pixels = read(path)
    if pixels.ndim != 3:
        text = "the image has layers; a reference is one picture of R, G, B or Y"
        raise InputError(Problem("RG354", text, Place(str(path))))
    check_sizes(np.empty((size[1], size[0])), pixels, (name, str(path)))
    return pixels, "linear" if np.issubdtype(pixels.dtype, np.floating) else "display"


def on_one_stage(pipelines: Sequence[Pipeline]) -> tuple[list[Pipeline], list[str]]:
    """The pipelines on the first one's scene and at its size, and what had to be changed for that, in words."""
    first = pipelines[0]
    scenes = {pipeline.spec.scene for pipeline in pipelines}
    notes = []
    if len(scenes) > 1 and first.spec.scene is not None:
        others = [p for p in pipelines if p.spec.scene != first.spec.scene]
        notes += [f"'{p.name}' is drawn with the scene of '{first.name}': {first.spec.scene.stem}" for p in others]
        # All of them, the first one too: one scene named in one way is read once and stays on the GPU.
        pipelines = [pipeline.with_scene(first.spec.scene) for pipeline in pipelines]
    width, height = first.spec.size
    small = [p for p in pipelines if p.spec.size != (width, height)]
    notes += [f"'{p.name}' is drawn at the size of '{first.name}': {width}×{height}" for p in small]
    return [p.with_size((width, height)) if p in small else p for p in pipelines], notes


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
        if all(output in pipeline.graph.outputs for pipeline in pipelines):
            return output, "display" if output == "image" else "linear"
    lacking = next(p for p in pipelines if wanted[0] not in p.graph.outputs)
    known = ", ".join(lacking.graph.outputs)
    text = f"pipeline '{lacking.name}' has no output '{wanted[0]}' to compare; there is {known}"
    raise InputError(Problem("RG522", text))
