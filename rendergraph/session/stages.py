"""The stages from a selection to pictures, each called once, in this order.

    Selection ──resolve──▶ Resolved ──link──▶ Linked ──expand──▶ Expanded ──plan──▶ Planned ──draw──▶ Frames

Every verb, Python's `render` and all comparisons use them, and stop at the stage that they need. Each raises an
`InputError` with all mistakes that it finds, and from `compile` on a `RenderError` if the device or the driver fails.
Nothing is cached here but scenes in use (`scenes`) and, from `compile` on, what a `Gpu` caches. GL is imported when
something is rendered.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec.structs import asdict, replace

import rendergraph.allocate
import rendergraph.expand
import rendergraph.link
import rendergraph.resolve
import rendergraph.schedule
from rendergraph.catalog import Catalog
from rendergraph.document import Document, YamlLimits
from rendergraph.errors import InputError, Option, Place, Problem, RendergraphError, UsageError, suggestion
from rendergraph.read import entries, read
from rendergraph.resolve import PipelineSpec
from rendergraph.scene.animate import complete, on_turntable
from rendergraph.scene.facts import camera_facts, environment_facts, light_facts, material_facts, object_facts
from rendergraph.scene.model import Scene
from rendergraph.scene.scene_data import scene_data_facts
from rendergraph.session.picture_metadata import ENVIRONMENT_NAMES, is_picture, read_picture_metadata
from rendergraph.session.scenes import check_keyframes, scene_of
from rendergraph.session.selection import RenderOptions, Selection
from rendergraph.session.values import Expanded, Linked, Planned, Resolved, every_port, requested_outputs
from rendergraph.settings import Roots

if TYPE_CHECKING:
    from rendergraph.scene.model import Camera
    from rendergraph.session.drawing import Drawing
    from rendergraph.session.frame import Frame
    from rendergraph.session.gpu import Gpu
    from rendergraph.session.progress import Progress


def resolve(selection: Selection, catalog: Catalog | None = None) -> Resolved:
    """Read the file and everything it refers to, and apply the selection; of a picture, the pipeline in its metadata.

    Only a file that is missing, not YAML, or extends itself is an error here; `link` reports all other mistakes. By
    default, the catalog has the installed node types and those of plugins.
    """
    for folder in selection.asset_roots:
        if not folder.is_dir():
            text = f"'{folder}' is a file; expected a folder" if folder.exists() else f"there is no folder '{folder}'"
            raise InputError(Problem("RG011", text, Place(Option("--asset-root"))))
    catalog = catalog or Catalog.discover(selection.plugins)
    limits = YamlLimits(**selection.allowed("yaml"))
    source: str | Document | Mapping[str, Any] = selection.source
    if selection.text is not None:
        source = read(Path(str(source)), selection.text, limits, keep_going=True)
    frames, fps, subframes = range(1, 2), 30.0, 1
    if is_picture(selection.source):
        picture = read_picture_metadata(Path(str(selection.source)), limits)
        source, frames, fps = picture.document, range(picture.frame, picture.frame + 1), picture.fps
        subframes = picture.subframes
        view = {name: value for name, value in picture.view.items() if name not in selection.view_fields}
        if (file := view.get("environment")) is not None and str(file) not in ENVIRONMENT_NAMES:
            # It must lie below an asset root, because the user has not typed it.
            Roots.of_file(Path("x"), selection.asset_roots).check(file, Place(str(selection.source)))
        selection = replace(selection, **view)
    resolve_with = partial(
        rendergraph.resolve.resolve,
        source,
        patches=selection.patches,
        scene=selection.scene,
        size=selection.size,
        asset_roots=selection.asset_roots,
        limits=limits,
        catalog=catalog,
    )
    spec = resolve_with(sets=selection.sets)
    if selection.view is not None:
        chosen = view_of(spec, selection.view)
        frames = range(frame, frame + 1) if (frame := chosen.pop("frame", None)) else frames
        selection = replace(selection, **{k: v for k, v in chosen.items() if k not in selection.view_fields})
    if selection.transparent:
        spec = resolve_with(sets=(*selection.sets, *_transparent(spec)))
    if spec.tree.get("rendergraph") is None:
        text = "missing format version: add `rendergraph: 1` as the first line"
        note = spec.tree.problem("RG016", text).as_warning()
        spec = replace(spec, notes=(*spec.notes, note))
    return Resolved(selection=selection, catalog=catalog, spec=spec, frames=frames, fps=fps, subframes=subframes)


def view_of(spec: PipelineSpec, name: str) -> dict[str, Any]:
    """Return the fields of `Selection`, and the frame, that a named view of the file has."""
    views = entries(spec.tree, "views")
    if name not in views:
        known = suggestion(name, views) if views else "; the file has no views"
        raise UsageError(Problem("RG500", f"there is no view '{name}'{known}"))
    found: dict[str, Any] = views[name].plain() or {}
    if (environment := views[name].get("environment")) is not None:
        file = Path(str(environment.data))
        if environment.data not in ENVIRONMENT_NAMES:
            roots = spec.source_roots.get(environment.source, spec.roots)
            file = roots.check((environment.source.path or Path("x")).parent / file, environment.place)
        found["environment"] = file
    return found


def _transparent(spec: PipelineSpec) -> list[str]:
    """Return the settings that let nodes keep alpha."""
    catalog = spec.catalog
    assert catalog is not None  # `resolve` was given one
    nodes = [node for node in spec.nodes.values() if node.type in catalog]
    found = [
        f"{node.id}.transparent=true" for node in nodes if "transparent" in catalog.get(node.type).cls.parameters()
    ]
    if not found:
        raise UsageError(Problem("RG500", "--transparent: no node of the pipeline has a parameter 'transparent'"))
    return found


def link(resolved: Resolved) -> Linked:
    """Read the scene and return the checked graph."""
    spec, catalog = resolved.spec, resolved.catalog
    try:
        scene = scene_of(resolved)
    except InputError as error:  # the file's own mistakes, such as a missing plugin, may be the cause
        raise InputError([*spec.problems, *error.problems]) from None
    size = spec.tree.get("size")
    if (size is None or size.data is None) and scene.camera is not None and (aspect := scene.camera.aspect) is not None:
        spec = replace(spec, size=(max(1, round(spec.size[1] * aspect)), spec.size[1]))
        resolved = replace(resolved, spec=spec)
    facts = light_facts(scene), object_facts(scene), environment_facts(scene), partial(scene_data_facts, scene)
    graph = rendergraph.link.link(spec, catalog, *facts, material_facts(scene), camera_facts(scene))
    if scene.node_curves:
        graph = replace(graph, warnings=(*graph.warnings, *check_keyframes(graph, scene)))
    return Linked(**asdict(resolved), scene=scene, graph=graph)


def sketch(resolved: Resolved) -> Linked:
    """Return a graph for display, in which node types may be missing; its field `missing` has the problems."""
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
        return Linked(**asdict(resolved), scene=scene, graph=graph, missing=(*missing, *unread))


def fitting_links(resolved: Resolved) -> dict[str, dict[str, list[str]]]:
    """Return the links that fit each input, see `link.fitting`, although the file or its scene may be wrong."""
    try:
        scene = scene_of(resolved)
    except InputError:
        scene = complete(Scene("missing"))
    facts = light_facts(scene), object_facts(scene), environment_facts(scene)
    return rendergraph.link.fitting(resolved.spec, resolved.catalog, *facts)


def expand(linked: Linked, options: RenderOptions = RenderOptions()) -> Expanded:
    """Record the steps of all requested outputs."""
    if options.subframes > 1:  # subframes blur motion, so nodes must not imitate the shutter
        facts = linked.graph.facts
        facts = replace(facts, camera=replace(facts.camera, shutter=0.0))
        linked = replace(linked, graph=replace(linked.graph, facts=facts))
    if options.turntable:
        width, height = linked.graph.size
        turned = on_turntable(linked.scene, options.fps, options.turntable, width / height)
        linked = replace(linked, scene=turned)
    requests = requested_outputs(linked.graph, options)
    ends = {name: port.end for name, port in requests.items()}
    return Expanded(linked, options, requests, rendergraph.expand.expand(linked.graph, ends))


def plan(expanded: Expanded) -> Planned:
    """Order the steps and assign memory to their textures."""
    linked, options, requests, expansion = expanded.linked, expanded.options, expanded.requests, expanded.expansion
    schedule = rendergraph.schedule.schedule(expansion, shuffle=options.shuffle)
    allocated = rendergraph.allocate.allocate(schedule, alias=options.alias, heap=options.heap)
    return Planned(linked, options, requests, expansion, allocated)


def check(linked: Linked) -> Planned:
    """Find every mistake that can be found without GL, for all outputs of the file."""
    from rendergraph.program import TextSources, check_texts, ray_warnings

    planned = plan(expand(linked))
    steps, types = planned.plan.schedule.steps, linked.node_types
    warnings = check_texts(steps, TextSources(types, planned.plan.resources, planned.expansion.views))
    return replace(planned, warnings=(*warnings, *ray_warnings(steps, types)))


def check_profile(planned: Planned) -> None:
    """Refuse what needs more than every OpenGL 4.5 driver offers (RG435)."""
    from rendergraph.program.limits import beyond_guaranteed
    from rendergraph.scene.pack import pack

    views, types, scene = planned.expansion.views, planned.linked.node_types, planned.linked.scene
    if problems := beyond_guaranteed(planned.plan, views, types, scene, pack(scene)):
        raise InputError(problems)


def compile(expanded: Expanded, gpu: Gpu) -> Drawing:
    """Compile everything that a frame needs; a cached executable is used again if only uniforms differ.

    Call it, and use the drawing, inside `with gpu.current()`, before anything else is rendered there.
    """
    from rendergraph.session.drawing import Drawing

    scene = gpu.cache.upload(expanded.linked)
    key, executable = gpu.cache.find(expanded)
    if executable is None:
        planned = expanded if isinstance(expanded, Planned) else plan(expanded)
        executable = gpu.cache.compile(key, planned, scene)
    if executable is not gpu.cache.active:
        executable.mark_stale()
    drawing = Drawing(expanded, executable, scene, gpu)
    gpu.cache.active, gpu.cache.drawing = executable, drawing
    return drawing


def draw(expanded: Expanded, gpu: Gpu, lead: int | None = None) -> Iterator[Frame]:
    """Render frame after frame, and yield each before the next one is rendered.

    Between two frames the device is in its previous state, so a borrowed one can be used; this `gpu` itself can render
    nothing else meanwhile. If frames depend on earlier ones, `lead` are rendered before the first, by default all.
    """
    with gpu.current():
        drawing = compile(expanded, gpu)
        drawing.begin(lead)
    for number in expanded.options.frames:
        with gpu.current():
            drawing.draw(number)
            frame = drawing.read()
        yield frame


def exposure_warnings(frame: Frame, linked: Linked) -> list[Problem]:
    """Return warnings about pictures that are almost black or mostly clipped, with what would help."""
    if not frame.badly_exposed:
        return []
    stops = [
        f"{node.id}.{name}"
        for node in linked.graph.nodes
        for name, parameter in node.type.cls.parameters().items()
        if parameter.unit == "EV" and (parameter.limits.low or 0) < 0
    ]
    setting = f"`-s {stops[0]}={{}}`" if stops else "another exposure"
    found = []
    for name, state in frame.badly_exposed.items():
        help = setting.format("+3" if "black" in state else "-3")
        if "black" in state and linked.scene.environment is None:
            help += " or `--environment studio`"
        text = f"the picture '{name}' is {state}; try {help}"
        found.append(Problem("RG624", text, Place(frame.pipeline), severity="warning"))
    return found


def not_finite_warnings(frame: Frame, expanded: Expanded, gpu: Gpu, camera: Camera | None = None) -> list[Problem]:
    """Return warnings about NaN and infinity in a frame's outputs, which name the port that held them first.

    A suspect frame is rendered again with all ports tapped, so call this when no other frame is needed.
    """
    from rendergraph.session.frame import not_finite

    if not frame.unsound:
        return []
    options = replace(expanded.options, warm_up=False, timed=False)
    taps = every_port(plan(expand(expanded.linked, options)))
    held: list[str] = []
    with contextlib.suppress(RendergraphError), gpu.current():  # the taps may need more memory than there is
        drawing = compile(expand(expanded.linked, replace(options, taps=taps)), gpu)
        drawing.begin()
        drawing.draw(frame.number, camera)
        tapped = drawing.read()
        held = [tap for tap in taps if not_finite(tapped[tap], tapped.infos[tap].semantic)]
        held = [tap for tap in held if (tapped[tap] != tapped[tap]).any()] or held  # NaN before infinity
    way = "run … --tap-all FOLDER shows"
    hint = f"; the first texture with such texels is '{held[0]}'; {way} all" if held else f"; {way} where they begin"
    return [
        problem.relocate(problem.place, hint=hint)
        for name, problem in frame.unsound.items()
        if held or frame.arrays[name].dtype != "uint8"  # else it is a color like any other
    ]


def draw_last(expanded: Expanded, gpu: Gpu, progress: Progress | None = None) -> Frame:
    """Render all frames and return the last one; `progress` is called after each."""
    with gpu.current():
        drawing = compile(expanded, gpu)
        drawing.begin()
        for done, number in enumerate(expanded.options.frames, start=1):
            drawing.draw(number)
            if progress is not None:
                progress(done, len(expanded.options.frames))
        return drawing.read()
