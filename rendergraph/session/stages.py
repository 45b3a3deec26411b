"""The way from what is asked for to pictures: each stage once, in this order.

    Selection ──resolve──▶ Resolved ──link──▶ Linked ──expand──▶ Expanded ──plan──▶ Planned ──draw──▶ Frames

Every verb, Python's `render` and all comparisons go this way, and stop where they have enough. Nothing here is kept but
scenes in use (`scenes`) and, from `draw` on, what a `Gpu` keeps. GL is imported when something is drawn.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

import rendergraph.allocate
import rendergraph.expand
import rendergraph.link
import rendergraph.resolve
import rendergraph.schedule
from rendergraph.catalog import Catalog
from rendergraph.document import Document, YamlLimits
from rendergraph.errors import InputError, Option, Place, Problem
from rendergraph.scene.animate import complete
from rendergraph.scene.facts import environment_facts, light_facts, object_facts
from rendergraph.scene.model import Scene
from rendergraph.session.made import Made, is_picture, made
from rendergraph.session.scenes import scene_of
from rendergraph.session.selection import RenderOptions, Selection
from rendergraph.session.values import Expanded, Linked, Planned, Resolved
from rendergraph.session.wanted import wanted_ports
from rendergraph.settings import Roots

if TYPE_CHECKING:
    from rendergraph.session.drawing import Drawing
    from rendergraph.session.frame import Frame
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.progress import Progress


def resolve(selection: Selection, catalog: Catalog | None = None) -> Resolved:
    """Read the file and all it refers to, and apply what was said about it; of a picture, the file it was made with.

    Args:
        selection: what was asked for.
        catalog: the node types that can be used; by default those that are installed and those of plugins.

    Raises:
        InputError: a file is missing, is no YAML, or leads back to itself. What else is wrong `link` raises.
    """
    for folder in selection.asset_roots:
        if not folder.is_dir():
            text = (
                f"'{folder}' is a file; a folder is expected" if folder.exists() else f"there is no folder '{folder}'"
            )
            raise InputError(Problem("RG011", text, Place(Option("--asset-root"))))
    catalog = catalog or Catalog.discover(selection.plugins)
    limits = YamlLimits(**selection.allowed("yaml"))
    source: str | Document = selection.source
    frames, fps = range(1, 2), 30.0
    if is_picture(selection.source):
        picture = made(Path(selection.source), limits)
        source, frames, fps = picture.document, range(picture.frame, picture.frame + 1), picture.fps
        selection = replace(
            selection,
            camera=selection.camera or picture.camera,
            environment=selection.environment or _environment(selection, picture),
        )
    spec = rendergraph.resolve.resolve(
        source,
        patches=selection.patches,
        sets=selection.sets,
        scene=selection.scene,
        size=selection.size,
        asset_roots=selection.asset_roots,
        limits=limits,
        catalog=catalog,
    )
    if spec.tree.get("rendergraph") is None:
        text = "missing format version: add `rendergraph: 1` as the first line"
        note = spec.tree.problem("RG016", text).as_warning()
        spec = replace(spec, notes=(*spec.notes, note))
    return Resolved(selection=selection, catalog=catalog, spec=spec, frames=frames, fps=fps)


def _environment(selection: Selection, picture: Made) -> Path | None:
    """The environment that a picture names: whoever draws it again has not typed that."""
    path = picture.environment
    if path is not None:
        Roots.of_file(Path("x"), selection.asset_roots).check(path, Place(str(selection.source)))
    return path


def link(resolved: Resolved) -> Linked:
    """Read the scene and make the checked graph.

    Raises:
        InputError: with all mistakes of the file.
    """
    spec, catalog = resolved.spec, resolved.catalog
    try:
        scene = scene_of(resolved)
    except InputError as error:  # the file's own mistakes may be why, such as a plugin that is not installed
        raise InputError([*spec.problems, *error.problems]) from None
    around = environment_facts(scene)
    graph = rendergraph.link.link(spec, catalog, light_facts(scene), object_facts(scene), around)
    return resolved.linked(scene, graph)


def sketch(resolved: Resolved) -> Linked:
    """The graph to look at, where node types may be missing: they are in it as far as known, and in `missing`.

    Raises:
        InputError: something else is wrong; with all mistakes of the file.
    """
    spec, catalog = resolved.spec, resolved.catalog
    try:
        return link(resolved)
    except InputError as error:
        unread: tuple[Problem, ...] = ()
        try:
            scene = scene_of(resolved)
        except InputError as lacking:  # a mesh that a missing plugin would read
            if not spec.missing or any(problem.code != "RG303" for problem in lacking.problems):
                raise error from None
            scene, unread = complete(Scene("missing")), lacking.problems
        graph, missing = rendergraph.link.sketch(spec, catalog, light_facts(scene), environment_facts(scene))
        return resolved.linked(scene, graph, (*missing, *unread))


def expand(linked: Linked, options: RenderOptions = RenderOptions()) -> Expanded:
    """Record the steps of everything that is wanted.

    Raises:
        InputError: an output or port that there is not, or a node recorded what its declaration does not allow.
    """
    wanted = wanted_ports(linked.graph, options)
    ends = {name: port.end for name, port in wanted.items()}
    return Expanded(linked, options, wanted, rendergraph.expand.expand(linked.graph, ends))


def plan(expanded: Expanded) -> Planned:
    """Order the steps and give their textures memory.

    Raises:
        InputError: the steps have no legal order.
    """
    linked, options, wanted, expansion = expanded.linked, expanded.options, expanded.wanted, expanded.expansion
    schedule = rendergraph.schedule.schedule(expansion, shuffle=options.shuffle)
    allocated = rendergraph.allocate.allocate(schedule, alias=options.alias, heap=options.heap)
    return Planned(linked, options, wanted, expansion, allocated)


def check(linked: Linked) -> Planned:
    """Find everything that can be wrong before GL is used, for all of the file's outputs.

    Raises:
        InputError: with all mistakes found.
    """
    from rendergraph.program import check_texts

    planned = plan(expand(linked))
    types = {node.id: node.type for node in linked.graph.nodes}
    check_texts(planned.plan.schedule.steps, types, planned.plan.resources, planned.expansion.views)
    return planned


def compile(expanded: Expanded, gpu: Gpu) -> Drawing:
    """Make everything a frame needs; what the `gpu` has kept is taken again where only uniforms differ.

    To be called inside `with gpu.current()`, where the drawing is used too, before anything else is drawn.

    Raises:
        InputError: a mistake in a shader, or the steps have no legal order.
        RenderError: the device cannot hold it.
    """
    from rendergraph.session.drawing import Drawing

    scene = gpu.cache.upload(expanded.linked)
    key, executable = gpu.cache.take(expanded)
    if executable is None:
        planned = expanded if isinstance(expanded, Planned) else plan(expanded)
        executable = gpu.cache.make(key, planned, scene)
    if executable is not gpu.cache.active:
        executable.take_over()
    drawing = Drawing(expanded, executable, scene, gpu)
    gpu.cache.active, gpu.cache.drawing = executable, drawing
    return drawing


def draw(expanded: Expanded, gpu: Gpu, lead: int | None = None) -> Iterator[Frame]:
    """Draw frame after frame; each is there to look at before the next one is drawn.

    Between two frames the device is as it was before, so that a borrowed one may be used; nothing else can be drawn
    with this `gpu` meanwhile.

    Args:
        expanded: what.
        gpu: where.
        lead: how many frames are drawn before the first, where something is remembered from frame to frame; all by
            default.

    Raises:
        InputError: a mistake in a shader.
        RenderError: it failed while drawing.
    """
    with gpu.current():
        drawing = _begun(expanded, gpu)
        if lead is not None:
            drawing.begin_at(expanded.options.frames[0] - lead)
    for number in expanded.options.frames:
        with gpu.current():
            drawing.draw(number)
            frame = drawing.read()
        yield frame


def draw_last(expanded: Expanded, gpu: Gpu, progress: Progress | None = None) -> Frame:
    """Draw all frames, and look at the last one only; `progress` is told of each.

    Raises:
        InputError: a mistake in a shader.
        RenderError: it failed while drawing.
    """
    with gpu.current():
        drawing = _begun(expanded, gpu)
        for done, number in enumerate(expanded.options.frames, start=1):
            drawing.draw(number)
            if progress is not None:
                progress(done, len(expanded.options.frames))
        return drawing.read()


def _begun(expanded: Expanded, gpu: Gpu) -> Drawing:
    drawing = compile(expanded, gpu)
    drawing.begin()
    return drawing
