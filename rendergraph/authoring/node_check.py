"""Render a node in each variant and detect its mistakes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec import structs

from rendergraph.authoring.harness import FROM, HarnessGraph, NodeVariant
from rendergraph.catalog import NodeType
from rendergraph.compile.executable import CompiledStep, Draw
from rendergraph.declare import Node
from rendergraph.declare.blame import cause_chain, declaration_in, declaration_of, source_location
from rendergraph.errors import InputError, Place, Problem, RendergraphError, shown_file
from rendergraph.expand import Expansion
from rendergraph.gl.device import Device, open_device
from rendergraph.gl.programs import outputs_of
from rendergraph.gl.state import SavedState
from rendergraph.program import prefix
from rendergraph.program.text import VERSION
from rendergraph.scene.cameras import view_matrices
from rendergraph.session import RenderOptions, Selection, stages
from rendergraph.session.drawing import Drawing
from rendergraph.session.gpu import Gpu
from rendergraph.session.scenes import scene_of
from rendergraph.session.values import Expanded, Resolved
from rendergraph.steps import Step
from rendergraph.textures import FORMATS, BufferDesc

SCENE = str(Path(__file__).parent / "scene.yaml")
FRAMES = 2
_POISON = {  # by family, two values that texels hold before a pass; texels that differ afterwards were not written
    "float": (float("nan"), 0.7319),
    "unorm": (0.25, 0.75),
    "snorm": (-0.25, 0.75),
    "depth": (0.25, 0.75),
    "depth_stencil": (0.25, 0.75),
    "uint": (7.0, 2_000_000_011.0),
    "int": (-7.0, 2_000_000_011.0),
}
_MOST_NAMES = 8192
_MOST_BYTES = 64 << 20
_MOST_STEPS = 256


class NodeCheck:
    """One node type on one GL context, with a folder for the files of its harness and a scene for geometry nodes."""

    def __init__(self, node: NodeType, folder: Path, scene: str = SCENE) -> None:
        self.type, self.folder, self.scene = node, folder, scene
        self.tried: list[str] = []
        self.active: set[str] = set()
        self.keywords: dict[tuple[tuple[str, int], str], bool] = {}  # keywords of steps: whether a program uses them
        self.files: set[Path] = set()
        self._problems: dict[Problem, list[str]] = {}  # with the variants that cause them
        self._written: set[str] = set()  # outputs that exist in some variant
        self._avoided: set[str] = set()  # optional inputs of a base class with which the node fails
        self.device: Device = open_device()
        flush_deleted_programs(self.device)
        self._before = _count_objects(self.device)
        self.gpu = Gpu(ctx=self.device.ctx)
        cls = guard_state(node.cls, self.gpu.device, self._report_state)
        self.harness = HarnessGraph(structs.replace(node, cls=cls), folder)
        self._fed: dict[str, npt.NDArray[Any]] = {}
        self._fills_buffers = node.cls.update is not Node.update  # which may happen only once

    def run(self, variant: NodeVariant, renders: bool = True) -> None:
        """Link and compile a variant, render it twice if `renders`, and keep its problems."""
        self._variant = variant = variant.without(self.type.cls, self._avoided)
        self.tried.append(variant.name or "default")
        try:
            self._run(variant, renders)
        except RendergraphError as error:
            if any(isinstance(cause, MemoryError) for cause in cause_chain(error)):
                raise  # ends the check
            missing = {problem.subject for problem in error.problems if problem.code in ("RG604", "RG209")}
            rest = tuple(name for name in variant.outputs if f"{self.type.name}.{name}" not in missing)
            if len(rest) < len(variant.outputs) and not variant.is_range_end:  # outputs may depend on links and choices
                self.tried.pop()
                if rest:
                    self.run(replace(variant, outputs=rest), renders)
            elif variant.name and _exceeds_device(error):
                self.tried.pop()
            else:
                self._report_failure(variant, error)
        else:
            self._written |= set(variant.outputs)

    def _report_failure(self, variant: NodeVariant, error: RendergraphError) -> None:
        """Report the problems of a variant that fails; as warnings if it works without an inherited optional input.

        A plugin author's class need not work with every optional input of its base.
        """
        cls = self.type.cls
        own = {name for base in cls.__mro__ if base.__module__ == cls.__module__ for name in vars(base)}
        unused = variant.unconnected | own
        optional = [name for name, port in cls.inputs().items() if port.optional and name not in unused]
        unfit = next((name for name in optional if self._works(variant.without(cls, {name}))), None)
        if unfit is None:
            for problem in error.problems:
                self._report(self._at_author(problem, error))
        elif not variant.params or own & variant.params.keys():  # otherwise the whole combination is inherited
            self._avoided.add(unfit)
            for problem in error.problems:
                found = self._at_author(problem, error)
                hint = f"; tried without '{unfit}', which is inherited"
                self._report(found.relocate(found.place, found.line_text, hint=hint).as_warning())

    def _works(self, variant: NodeVariant) -> bool:
        """Return whether a variant renders, or would on a device with higher limits; its problems then count."""
        before = {problem: list(names) for problem, names in self._problems.items()}
        try:
            self._run(variant)
        except RendergraphError as error:
            self._problems = before
            return _exceeds_device(error)
        self._written |= set(variant.outputs)
        return True

    def check_scene(self) -> None:
        try:
            resolved = self._resolved(NodeVariant("", outputs=tuple(self.type.cls.outputs())))
            resolved.spec.check()  # only the scene's name comes from the user
            scene_of(resolved)
        except InputError as error:
            raise InputError([self._at_author(problem, None) for problem in error.problems]) from None

    def close(self) -> list[Problem]:
        """Free everything, and return all problems, with their variants unless all have it."""
        self.gpu.close()
        flush_deleted_programs(self.device)
        left = _count_objects(self.device) - self._before
        self.device.release()
        self._variant = NodeVariant("")
        if left and not self._has_errors():
            every = ", ".join(f"{count} {kind.lower()}{'s' if count > 1 else ''}" for kind, count in left.items())
            place = Place(shown_file(self.type.file))
            self._report(Problem("RG456", f"the node leaves GL objects behind: {every}", place), always=True)
        if self.tried and not self._has_errors():
            for name in self.type.cls.outputs().keys() - self._written:
                text = f"output '{name}' is written in no variant; write it in `record`, or remove it"
                self._report(Problem("RG454", text, self._declaration(name)), always=True)
        return [self._with_variants(problem, names) for problem, names in self._problems.items()]

    def _has_errors(self) -> bool:
        return any(problem.severity == "error" for problem in self._problems)

    def _report(self, problem: Problem, *, always: bool = False) -> None:
        names = self._problems.setdefault(problem, [])
        names += self.tried if always else [self._variant.name or "default"]

    def _declaration(self, name: str) -> Place:
        return declaration_of(self.type.cls, self.type.file, name)

    # --- rendering ---------------------------------------------------------------------------------------------------

    def _run(self, variant: NodeVariant, renders: bool = True) -> None:
        with self.gpu.current():
            if not self._fed and self.harness.fed:
                self._fed = self._draw(stages.compile(self._expanded(NodeVariant("")), self.gpu), 0)
            expanded = self._expanded(variant)  # afterwards, because both use the same file
            if variant.is_range_end and _is_large(expanded.expansion):
                self.tried.pop()
                return
            drawing = stages.compile(expanded, self.gpu)
            steps = [c for c in drawing.executable.steps[0] if self._is_own(c.step)]
            for compiled in steps:
                for draw in compiled.all_draws:
                    self._interface(compiled.step, draw)
                self._note_keywords(compiled)
                self._note_files(compiled.step)
            drawn = [self._draw(drawing, number) for number in (0, 1) if renders]
        if renders:
            self._compare(*drawn)

    def _resolved(self, variant: NodeVariant) -> Resolved:
        file = self.harness.write(variant, self.scene)
        selection = Selection(str(file), asset_roots=(Path(self.scene).parent,))
        return stages.resolve(selection, self.harness.catalog())

    def _expanded(self, variant: NodeVariant) -> Expanded:
        return stages.expand(stages.link(self._resolved(variant)), RenderOptions(alias=False, reuse=False))

    def _note_files(self, step: Step) -> None:
        names = [name for _, name in step.shaders if step.node == self.type.name]
        names += [function.shader for function in step.functions if function.node == self.type.name]
        self.files |= {self.type.shader_file(name)[0] for name in names}
        self.files |= {file for _, file in step.includes}

    def _note_keywords(self, compiled: CompiledStep) -> None:
        step, parameters = compiled.step, self.type.cls.parameters()
        caller = step.where.caller  # a base's keywords need not suit the shaders of subclasses
        if step.node != self.type.name or caller is None or Path(caller[0]).name != self.type.file.name:
            return
        for name, _ in step.uniforms if compiled.all_draws else ():
            if name not in parameters:
                key = caller, name
                used = any(name in draw.program.uniforms for draw in compiled.all_draws)
                self.keywords[key] = self.keywords.get(key, False) or used

    def _is_own(self, step: Step) -> bool:
        return step.node == self.type.name or any(f.node == self.type.name for f in step.functions)

    def _draw(self, drawing: Drawing, number: int) -> dict[str, npt.NDArray[Any]]:
        """Return all outputs, after every texture was filled with a poison value."""
        linked, runner, executable = drawing.expanded.linked, drawing.runner, drawing.executable
        plan, memory = executable.plan, executable.memory
        for name, resource in plan.resources.items():
            if name not in plan.placement or resource.role == "scene":
                continue
            if isinstance(resource.desc, BufferDesc):
                if not self._fills_buffers:
                    buffer = memory.buffer(name)
                    buffer.write(bytes([(0x5A, 0xA5)[number]]) * buffer.size)
            else:
                value = _POISON[FORMATS[resource.desc.format].family][number]
                for parity in range(memory.parities):
                    for call in memory.clear(name, parity, value):
                        call()
        executable.invalidate()  # persistent textures were filled, too
        runner.reset()
        scene = linked.scene
        camera = view_matrices(next(iter(scene.cameras.values())), linked.graph.size)
        for frame in range(1, FRAMES + 1):
            runner.run(frame, (frame - 1) / 30, 1 / 30, scene, camera)
        runner.check()
        pictures = {}
        for name, shown in plan.schedule.outputs.items():
            own = f"{self.type.name}.{name}"  # a buffer's own bytes instead of its reader's picture
            is_buffer = own in plan.placement and isinstance(plan.resources[own].desc, BufferDesc)
            pictures[name] = runner.read(own if is_buffer else shown)
        return pictures

    # --- comparing ---------------------------------------------------------------------------------------------------

    def _interface(self, step: Step, draw: Draw) -> None:
        """Record what a program uses; compiling refuses what it uses without a declaration."""
        program = draw.program
        self.active |= {name.removeprefix(prefix(self.type.name)) for name in (*program.uniforms, *program.storage)}
        for name in (*(read.name for read in step.reads), *(write.name for write in step.writes)):
            if name in program.storage or f"{name}_view_block" in program.block_names:
                self.active.add(name)
        colors = [write.name for write in step.writes if write.use == "color"]
        if step.node == self.type.name and colors and not outputs_of(program):
            place = declaration_in(self.type.shader_file(dict(step.shaders)["fragment"])[0], colors[0])
            self._report(Problem("RG454", f"the shader never writes '{colors[0]}', a target of its step", place))

    def _compare(self, one: Mapping[str, npt.NDArray[Any]], other: Mapping[str, npt.NDArray[Any]]) -> None:
        for name in one:
            if name.startswith(FROM):
                port = name.removeprefix(FROM)
                if not np.array_equal(self._fed[name], one[name]):
                    text = f"the node changes its input '{port}'; inputs are read-only, use an InOut port to write"
                    self._report(Problem("RG457", text, self._declaration(port)))
                continue
            is_float = one[name].dtype.kind == "f"
            differ = one[name] != other[name]
            if is_float:
                differ &= ~(np.isnan(one[name]) & np.isnan(other[name]))
            unwritten = _texels(differ, one[name])
            count, total = int(unwritten.sum()), unwritten.size
            if count and not any(problem.code == "RG454" for problem in self._problems):
                what, fix = "texels of '{}' are not written", "`clear=`"
                if one[name].ndim == 1:
                    what, fix = "bytes of '{}' are not written, or are added to without being cleared", "`clear=0`"
                text = f"{count} of {total} {what.format(name)}; write them all, or declare {fix}"
                self._report(Problem("RG454", text, self._declaration(name)))
            elif not count and is_float and not np.isfinite(one[name]).all():
                bad = int(_texels(~np.isfinite(one[name]), one[name]).sum())
                text = f"{bad} of {total} texels of '{name}' are not finite (NaN or infinite)"
                self._report(Problem("RG458", text, self._declaration(name), severity="warning"))

    def _report_state(self, method: str, text: str) -> None:
        self._report(Problem("RG456", f"'{method}' {text}", self._declaration(method)))

    def _at_author(self, problem: Problem, error: RendergraphError | None) -> Problem:
        if problem.place is not None and not Path(problem.place.file).resolve().is_relative_to(self.folder.resolve()):
            return problem
        place = None
        if error is not None:
            place = source_location(error, self.type.file) or self._declaration(problem.subject.rpartition(".")[2])
        return problem.at_cause(place)

    def _with_variants(self, problem: Problem, names: Iterable[str]) -> Problem:
        names = list(dict.fromkeys(names))
        if len(names) >= len(self.tried) or names[:1] == ["default"]:
            return problem
        more = f" and {len(names) - 3} more" if len(names) > 3 else ""
        word = "" if names[0].startswith("without ") else "with "
        hint = f" ({word}{', '.join(names[:3])}{more})"
        return problem.relocate(problem.place, problem.line_text, hint=hint)


def _exceeds_device(error: RendergraphError) -> bool:
    """Return whether a variant needs more than this device has, which is not a mistake of the node."""
    return all(problem.code == "RG435" for problem in error.problems)


def _is_large(expansion: Expansion) -> bool:
    return len(expansion.steps) > _MOST_STEPS or sum(one.bytes for one in expansion.resources.values()) > _MOST_BYTES


def _texels(flags: npt.NDArray[np.bool_], array: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    channels = array.shape[-1] if array.ndim > 1 else 1
    texels: npt.NDArray[np.bool_] = np.any(flags.reshape(array.size // channels, -1), axis=1)
    return texels


KINDS = ("Texture", "Buffer", "Framebuffer", "VertexArray", "Sampler", "Program", "Query", "Renderbuffer")
_STATE = {  # descriptions of the fields of `SavedState`
    "enabled": "enabled capabilities",
    "indexed": "blending or the scissor test",
    "units": "bound textures and samplers",
    "images": "bound images",
    "blocks": "bound buffers",
    "settings": "settings such as the depth function",
}


def _count_objects(device: Device) -> Counter[str]:
    return Counter(kind for kind in KINDS for name in range(1, _MOST_NAMES) if getattr(device.raw, f"glIs{kind}")(name))


def flush_deleted_programs(device: Device) -> None:
    """Make the driver free deleted programs: Mesa keeps the last one of a kind until the other kind has run.

    Mesa then keeps programs of this function, so call it before and after the code under test.
    """
    vertex, fragment = f"{VERSION}\nvoid main() {{ gl_Position = vec4(0.0); }}", f"{VERSION}\nvoid main() {{}}"
    geometry = f"{VERSION}\nlayout(points) in;\nlayout(points, max_vertices = 1) out;\nvoid main() {{}}"
    drawing = device.ctx.program(vertex_shader=vertex, fragment_shader=fragment)
    shaping = device.ctx.program(vertex_shader=vertex, geometry_shader=geometry, fragment_shader=fragment)
    computing = device.ctx.compute_shader(f"{VERSION}\nlayout(local_size_x = 1) in;\nvoid main() {{}}")
    for name in (shaping.glo, drawing.glo, computing.glo, drawing.glo, 0):
        device.raw.glUseProgram(name)
    for program in (shaping, drawing, computing):
        program.release()
    device.ctx.gc()


def guard_state(cls: type[Node], device: Device, report: Callable[[str, str], None]) -> type[Node]:
    """Return the class with a `record` and `update` that report each change of the GL state."""
    names = [name for name in ("record", "update") if getattr(cls, name) is not getattr(Node, name)]
    body = {"__module__": cls.__module__, "__doc__": cls.__doc__}
    body |= {name: _guarded(cls, name, device, report) for name in names}
    return type(cls.__name__, (cls,), body) if names else cls


def _guarded(cls: type[Node], name: str, device: Device, report: Callable[[str, str], None]) -> Any:
    method = getattr(cls, name)

    def call(self: Node, argument: Any) -> None:
        before = _state(device)
        method(self, argument)
        error = device.raw.error()
        after = _state(device)
        if error:
            report(name, f"leaves the GL error {error} behind")
        for key, words in _STATE.items():
            if before[key] != after[key]:
                report(name, f"changes OpenGL state: {words}")

    return call


def _state(device: Device) -> dict[str, Any]:
    """Return the state, without the buffer that is bound for uploads, which uploading itself changes."""
    state = vars(SavedState(device.raw, device.ctx))
    return state | {"settings": [setting for setting in state["settings"] if setting[0] is not device.raw.glBindBuffer]}
