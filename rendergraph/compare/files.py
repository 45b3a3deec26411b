"""Picture files against each other, and the pipelines they were made with: nothing is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rendergraph import metrics
from rendergraph.catalog import Catalog
from rendergraph.compare.reference import read_picture, unique_names
from rendergraph.compare.timing import NO_TIMES
from rendergraph.compare.values import Comparison, Pixels, Reference, Result
from rendergraph.diff import diff
from rendergraph.errors import InputError, Problem
from rendergraph.metrics import Encoding
from rendergraph.session.pipeline import load

if TYPE_CHECKING:
    from rendergraph.link import Graph
    from rendergraph.session import Pipeline


def compare_pictures(
    pictures: Sequence[str | Path], reference: str | Path | None = None, *, plugins: Sequence[Path] = ()
) -> Comparison:
    """Compare pictures pixel by pixel; where they say how they were made, their graphs too.

    Args:
        pictures: files.
        reference: what they are measured against; the first of them by default.
        plugins: files or folders that may add metrics, and types of the nodes that made the pictures.

    Raises:
        InputError: a picture cannot be read, is of another size than others, or holds light where they hold none.
    """
    paths = [Path(picture) for picture in pictures]
    names = unique_names([path.stem for path in paths])
    against = Path(reference) if reference else paths[0]
    added = Catalog.discover(tuple(plugins)).extensions
    pixels, encoding = read_picture(against)
    shown = [_like(path, pixels, encoding, str(against)) for path in paths]
    graphs = [_graph(load(path, plugins=plugins)) for path in paths]
    output = "image" if encoding == "display" else "radiance"
    results = []
    for number, (name, own, graph) in enumerate(zip(names, shown, graphs, strict=True)):
        if reference is None and number == 0:
            found, map_ = metrics.same(own, added.metrics()), None
        else:
            told = (str(paths[number]), str(against))
            found, map_ = metrics.measure(own, pixels, encoding=encoding, names=told, plugins=added.metrics())
        results.append(
            Result(
                name=name,
                source=str(paths[number]),
                pixels=own,
                encoding=encoding,
                metrics=found,
                times=NO_TIMES,
                memory={},
                pass_count=0,
                flip_map=map_,
                graph=graph,
                difference=diff(graphs[0], graph) if graphs[0] and graph else None,
            )
        )
    kept = (
        Reference(str(reference), "file", pixels, encoding, output)
        if reference
        else Reference(names[0], "variant", shown[0], encoding, output)
    )
    return Comparison(
        results=tuple(results),
        reference=kept,
        base=(names[0], graphs[0]) if graphs[0] else None,
        scene="",
        camera=None,
        size=(pixels.shape[1], pixels.shape[0]),
        frame=1,
        device={},
        warnings=tuple(added.warnings),
    )


def _like(path: Path, reference: Pixels, encoding: Encoding, name: str) -> Pixels:
    """A picture that can be compared with the reference."""
    pixels, own = read_picture(path)
    metrics.check_sizes(pixels, reference, (str(path), name))
    if own != encoding:
        words = {"display": "display values", "linear": "light"}
        text = f"'{path}' holds {words[own]}, but '{name}' {words[encoding]}; write both as PNG, or both as EXR"
        raise InputError(Problem("RG521", text))
    return pixels


def _graph(picture: Pipeline) -> Graph | None:
    """What a picture was made with, None where it does not say or that is here no longer."""
    try:
        return picture.link().graph
    except InputError:
        return None
