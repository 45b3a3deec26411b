"""Drawing a node in one variant and looking at everything it does."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec import structs

from rendergraph.authoring.feed import Surrounded
from rendergraph.authoring.gl_watch import let_go, living, watched
from rendergraph.authoring.variants import Variant
from rendergraph.catalog import NodeType
from rendergraph.compile.executable import Draw
from rendergraph.declare import Node
from rendergraph.declare.blame import cause_chain, declaration_in, declaration_of, source_location
from rendergraph.errors import InputError, Place, Problem, RendergraphError, shown_file
from rendergraph.expand import Expansion
from rendergraph.gl.device import Device, open_device
from rendergraph.gl.programs import outputs_of
from rendergraph.program import prefix
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
_POISON = {  # by family, two values that a texel may hold before a pass; what differs afterwards was never written
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


@dataclass
class Trial:
    """One node type on one GL context.

    Attributes:
        type: what is checked.
        folder: for the files of the surroundings.
        scene: what geometry nodes draw.
        seen: names of uniforms that some program looked at.
        files: shader files that some step used.
        written: outputs that could be had in some variant.
        avoided: optional inputs of a base class that the node goes without: it fails with what they are fed.
    """

    type: NodeType
    folder: Path
    scene: str = SCENE
    seen: set[str] = field(default_factory=set)
    files: set[Path] = field(default_factory=set)
    written: set[str] = field(default_factory=set)
    avoided: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.problems: dict[Problem, list[str]] = {}
        self.tried: list[str] = []
        self.device: Device = open_device()
        let_go(self.device)
        self._before = living(self.device, _MOST_NAMES)
        self.gpu = Gpu(ctx=self.device.ctx)
        cls = watched(self.type.cls, self.gpu.device, self._state)
        self.around = Surrounded(structs.replace(self.type, cls=cls), self.folder)
        self._fed: dict[str, npt.NDArray[Any]] = {}
        self._fills_buffers = self.type.cls.update is not Node.update  # perhaps once and for all

    def run(self, variant: Variant) -> None:
        """Link, compile and draw a variant twice, and keep what is wrong with it."""
        self._variant = variant = variant.without(self.type.cls, self.avoided)
        self.tried.append(variant.name or "default")
        try:
            self._run(variant)
        except RendergraphError as error:
            if any(isinstance(cause, MemoryError) for cause in cause_chain(error)):
                raise  # that is the process's, and ends the check
            rest = tuple(name for name in variant.outputs if not self._is_missing(name, error))
            if len(rest) < len(variant.outputs) and not variant.end:  # one may depend on what is connected or chosen
                self.tried.pop()
                if rest:
                    self.run(replace(variant, outputs=rest))
                return
            if variant.name and _is_beyond(error):
                self.tried.pop()
                return
            own = self._own_names()
            ports = self.type.cls.inputs().items()
            optional = [n for n, port in ports if port.optional and n not in own and n not in variant.left_out]
            unfit = next((name for name in optional if self._goes(variant.without(self.type.cls, {name}))), None)
            if unfit is not None and variant.params and not own & variant.params.keys():
                return  # a parameter and an input of the base's: whether they go together is not the author's matter
            for problem in error.problems:
                here = self._own(problem, error)
                if unfit is not None:
                    hint = f"; tried without '{unfit}', which is inherited"
                    here = here.relocate(here.place, here.line_text, hint=hint).as_warning()
                self.say(here)
            self.avoided |= set() if unfit is None else {unfit}
        else:
            self.written |= set(variant.outputs)

    def _own_names(self) -> set[str]:
        """What the author's module declares; nobody promised to combine optional inputs of a base with that."""
        cls = self.type.cls
        return {name for base in cls.__mro__ if base.__module__ == cls.__module__ for name in vars(base)}

    def _goes(self, variant: Variant) -> bool:
        """Whether a variant draws, or would on a device that has more; what is found then counts."""
        said = {problem: list(names) for problem, names in self.problems.items()}
        try:
            self._run(variant)
        except RendergraphError as error:
            self.problems = said
            return _is_beyond(error)
        self.written |= set(variant.outputs)
        return True

    def _is_missing(self, output: str, error: RendergraphError) -> bool:
        """Whether an error says that the node did not write an output in this variant."""
        of = [problem.subject for problem in error.problems if problem.code == "RG604"]
        return f"{self.type.name}.{output}" in of

    def check_scene(self) -> None:
        """Read the scene, which is no matter of the node's.

        Raises:
            InputError: it is missing or wrong.
        """
        try:
            resolved = self._resolved(Variant("", outputs=tuple(self.type.cls.outputs())))
            resolved.spec.check()  # of a file that is ours but for the scene's name
            scene_of(resolved)
        except InputError as error:
            raise InputError([self._own(problem, None) for problem in error.problems]) from None

    def close(self) -> list[Problem]:
        """Free everything; what is left then is the node's.

        Returns:
            All problems, each once, with the variants it was met in where it was not met in all.
        """
        self.gpu.close()
        let_go(self.device)
        left = {
            kind: count - self._before[kind]
            for kind, count in living(self.device, _MOST_NAMES).items()
            if count > self._before[kind]
        }
        self.device.release()
        self._variant = Variant("")
        if left and not any(problem.severity == "error" for problem in self.problems):
            every = ", ".join(f"{count} {kind.lower()}{'s' if count > 1 else ''}" for kind, count in left.items())
            self.say(
                Problem("RG456", f"the node leaves GL objects behind: {every}", Place(shown_file(self.type.file))),
                always=True,
            )
        if self.tried and not any(problem.severity == "error" for problem in self.problems):
            for name in self.type.cls.outputs().keys() - self.written:
                text = f"output '{name}' is written in no variant; write it in `record`, or take it away"
                self.say(Problem("RG454", text, self.port_place(name)), always=True)
        return [self._with_variants(problem, names) for problem, names in self.problems.items()]

    def say(self, problem: Problem, *, always: bool = False) -> None:
        """Keep a problem of the variant that runs."""
        names = self.problems.setdefault(problem, [])
        names += self.tried if always else [self._variant.name or "default"]

    def port_place(self, name: str) -> Place:
        """Where a port or parameter is declared."""
        return declaration_of(self.type.cls, self.type.file, name)

    # Running ----------------------------------------------------------------------------------------------------------

    def _run(self, variant: Variant) -> None:
        with self.gpu.current():
            if not self._fed and self.around.fed:
                self._fed = self._draw(stages.compile(self._expanded(Variant("")), self.gpu), 0)
            expanded = self._expanded(variant)  # read only now: both are the same file
            if variant.end and _is_large(expanded.expansion):
                self.tried.pop()
                return
            drawing = stages.compile(expanded, self.gpu)
            steps = [c for c in drawing.executable.steps[0] if self._is_own(c.step)]
            for compiled in steps:
                for draw in compiled.all_draws:
                    self._interface(compiled.step, draw)
                self._note_files(compiled.step)
            drawn = [self._draw(drawing, number) for number in (0, 1)]
        self._compare(*drawn)

    def _resolved(self, variant: Variant) -> Resolved:
        file = self.around.write(variant, self.scene)
        selection = Selection(str(file), asset_roots=(Path(self.scene).parent,))
        return stages.resolve(selection, self.around.catalog())

    def _expanded(self, variant: Variant) -> Expanded:
        return stages.expand(stages.link(self._resolved(variant)), RenderOptions(alias=False, reuse=False))

    def _note_files(self, step: Step) -> None:
        names = [name for _, name in step.shaders] if step.node == self.type.name else []
        names += [function.shader for function in step.functions if function.node == self.type.name]
        self.files |= {self.type.shader_file(name)[0] for name in names}
        self.files |= {file for _, file in step.includes}

    def _is_own(self, step: Step) -> bool:
        return step.node == self.type.name or any(f.node == self.type.name for f in step.functions)

    def _draw(self, drawing: Drawing, number: int) -> dict[str, npt.NDArray[Any]]:
        """All outputs, after every texture was filled with a poison."""
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
        executable.renew()  # what is kept has been filled with a poison, too
        runner.reset()
        scene = linked.scene
        camera = view_matrices(next(iter(scene.cameras.values())), linked.graph.size)
        for frame in range(1, FRAMES + 1):
            runner.run(frame, (frame - 1) / 30, 1 / 30, scene, camera)
        runner.check()
        drawn = {}
        for name, shown in plan.schedule.wanted.items():
            own = f"{self.type.name}.{name}"  # the bytes themselves, instead of what shows some
            is_buffer = own in plan.placement and isinstance(plan.resources[own].desc, BufferDesc)
            drawn[name] = runner.read(own if is_buffer else shown)
        return drawn

    # Looking ----------------------------------------------------------------------------------------------------------

    def _interface(self, step: Step, draw: Draw) -> None:
        """Remember what a program looks at; what it looks at and was not declared is refused when it is compiled."""
        program = draw.program
        self.seen |= {name.removeprefix(prefix(self.type.name)) for name in (*program.uniforms, *program.storage)}
        names = [read.name for read in step.reads] + [write.name for write in step.writes]
        self.seen |= {name for name in names if name in program.storage or f"{name}_view_block" in program.blocks}

        colors = [write.name for write in step.writes if write.use == "color"]
        if step.node == self.type.name and colors and not outputs_of(program):
            place = declaration_in(self.type.shader_file(dict(step.shaders)["fragment"])[0], colors[0])
            self.say(Problem("RG454", f"the shader never writes '{colors[0]}', which its step draws to", place))

    def _compare(self, one: Mapping[str, npt.NDArray[Any]], other: Mapping[str, npt.NDArray[Any]]) -> None:
        for name in one:
            port = self.around.input_of(name)
            if port:
                if not np.array_equal(self._fed[name], one[name]):
                    text = f"the node changes its input '{port}'; an InOut port may be continued, inputs are only read"
                    self.say(Problem("RG457", text, self.port_place(port)))
                continue
            differ = one[name] != other[name]
            if one[name].dtype.kind == "f":
                differ &= ~(np.isnan(one[name]) & np.isnan(other[name]))
            count = int(_texels(differ, one[name]).sum())
            total = _texels(differ, one[name]).size
            if count and not any(problem.code == "RG454" for problem in self.problems):
                text = f"{count} of {total} texels of '{name}' are not written; write them all, or declare `clear=`"
                if one[name].ndim == 1:
                    text = f"{count} of {total} bytes of '{name}' are not written, or added to what nobody has cleared"
                    text += "; write them all, or declare `clear=0`"
                self.say(Problem("RG454", text, self.port_place(name)))
            elif not count and one[name].dtype.kind == "f" and not np.isfinite(one[name]).all():
                bad = int(_texels(~np.isfinite(one[name]), one[name]).sum())
                text = f"{bad} of {total} texels of '{name}' are not finite (NaN or infinite)"
                self.say(Problem("RG458", text, self.port_place(name), severity="warning"))

    def _state(self, method: str, does: str) -> None:
        self.say(Problem("RG456", f"'{method}' {does}", self.port_place(method)))

    def _own(self, problem: Problem, error: RendergraphError | None) -> Problem:
        """The same at a place in the author's files instead of one in the surroundings'."""
        if problem.place is not None and not Path(problem.place.file).resolve().is_relative_to(self.folder.resolve()):
            return problem
        place = None
        if error is not None:
            place = source_location(error, self.type.file) or self.port_place(problem.subject.rpartition(".")[2])
        return problem.at_cause(place)

    def _with_variants(self, problem: Problem, names: Iterable[str]) -> Problem:
        met = list(dict.fromkeys(names))
        if len(met) >= len(self.tried) or met[:1] == ["default"]:
            return problem
        more = f" and {len(met) - 3} more" if len(met) > 3 else ""
        word = "" if met[0].startswith("without ") else "with "
        hint = f" ({word}{', '.join(met[:3])}{more})"
        return problem.relocate(problem.place, problem.line_text, hint=hint)


def _is_beyond(error: RendergraphError) -> bool:
    """Whether a variant asks for more than this device has, which says nothing about the node."""
    return all(problem.code == "RG435" for problem in error.problems)


def _is_large(made: Expansion) -> bool:
    """Whether an end of a range makes more than a check should wait for."""
    return len(made.steps) > _MOST_STEPS or sum(one.bytes for one in made.resources.values()) > _MOST_BYTES


def _texels(flags: npt.NDArray[np.bool_], array: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    """Flags of bytes or channels to one flag a texel."""
    channels = array.shape[-1] if array.ndim > 1 else 1
    found: npt.NDArray[np.bool_] = np.any(flags.reshape(array.size // channels, -1), axis=1)
    return found
