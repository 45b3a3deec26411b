"""Compile each step of a plan into draws: program, units, blocks, framebuffer, state."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping
from contextlib import ExitStack
from functools import partial
from typing import Any

import moderngl
import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from rendergraph import activity
from rendergraph.allocate import ResourcePlan
from rendergraph.catalog import NodeType
from rendergraph.compile.bindings import Units, ViewBuffers
from rendergraph.compile.checks import ProgramChecks, attribute_formats, check_attributes, layout_for
from rendergraph.compile.executable import CompiledStep, Draw, Executable, SortedDraws, prefixed_reads, step_uniforms
from rendergraph.compile.geometry import GeometryCompiler, MultiDraw, MultiDrawKey
from rendergraph.compile.gpu_scene import PREVIOUS_ATTRIBUTES, SCENE_ATTRIBUTES, TEXELS, TREE, GpuScene
from rendergraph.compile.memory import Call, Memory, Region, TexturePool, clear_target
from rendergraph.compile.programs import ProgramCache
from rendergraph.compile.transfers import UploadedValues, clear_buffer, image_calls, transfer_calls
from rendergraph.errors import InputError, RenderError
from rendergraph.expand import ViewTable
from rendergraph.gl import state as gl_state
from rendergraph.gl.programs import Program
from rendergraph.gl.queries import OcclusionQuery, Timer
from rendergraph.gl.raw import RawGL
from rendergraph.gl.textures import Clear, poison_value
from rendergraph.glsl.globals import declared_blocks
from rendergraph.glsl.names import compiled_text
from rendergraph.program import StageText, StepTexts, TextSources, positions_macro
from rendergraph.program.checks import Texts, check_kept_text, check_scene_includes, missing
from rendergraph.program.limits import check_plan, groups_of
from rendergraph.program.variants import FIXED_BLOCKS, view_count
from rendergraph.schedule import step_names
from rendergraph.steps import Read, Step, Write
from rendergraph.textures import FORMATS, TextureDesc

_ALL_BARRIERS = 0xFFFFFFFF
_DRAW_INDIRECT_BUFFER, _PARAMETER_BUFFER, _UNSIGNED_INT = 0x8F3F, 0x80EE, 0x1405
_TREE_IMAGE = 0, 0, 0, 0x88B8, 0x8D82  # level, not layered; READ_ONLY, RGBA32I
_COMMAND_BYTES = 20  # of a draw command, with a last integer that is ignored without indices
_TEXTURE_2D, _DEPTH_BOUNDS_TEST, _CLIP_DISTANCE0 = 0x0DE1, 0x8890, 0x3000


def compile_plan(
    plan: ResourcePlan,
    types: Mapping[str, NodeType],
    views: Mapping[str, ViewTable],
    scene: GpuScene,
    programs: ProgramCache,
    pool: TexturePool,
    *,
    poison: bool = False,
) -> Executable:
    """Compile a plan, and allocate everything that it needs on the GPU.

    Args:
        poison: overwrite textures after their last use with a value that no picture should show.
    """
    device = programs.device
    check_plan(device.limits, plan, views)
    with ExitStack() as owned:
        memory = Memory(device, plan, scene.resource, pool)
        owned.callback(memory.release)
        buffers = ViewBuffers(device, views)
        owned.callback(buffers.release)
        owned.callback(programs.forget, id(memory))
        made = _Compiler(types, views, scene, programs, memory, buffers, poison, owned).executable()
        made.owned = owned.pop_all()
        return made


class CountedDraw(Struct, eq=False):
    """Draws a step's commands, whose count is in a buffer (`GL_ARB_indirect_parameters`)."""

    raw: RawGL
    program: int
    vertex_array: int
    commands: int
    count: int
    mode: int
    step: Step

    def __call__(self) -> None:
        raw, step, first = self.raw, self.step, _COMMAND_BYTES * self.step.command
        raw.glUseProgram(self.program)
        raw.glBindVertexArray(self.vertex_array)
        raw.glBindBuffer(_DRAW_INDIRECT_BUFFER, self.commands)
        raw.glBindBuffer(_PARAMETER_BUFFER, self.count)
        if step.indices:
            raw.glMultiDrawElementsIndirectCountARB(self.mode, _UNSIGNED_INT, first, 0, step.commands, _COMMAND_BYTES)
        else:
            raw.glMultiDrawArraysIndirectCountARB(self.mode, first, 0, step.commands, _COMMAND_BYTES)
        raw.glBindBuffer(_PARAMETER_BUFFER, 0)


class _Compiler(Struct, eq=False, dict=True):
    types: Mapping[str, NodeType]
    view_tables: Mapping[str, ViewTable]
    scene: GpuScene
    programs: ProgramCache
    memory: Memory
    views: ViewBuffers
    poison: bool
    owned: ExitStack

    def __post_init__(self) -> None:
        self.device, self.plan = self.memory.device, self.memory.plan
        self._texts = StepTexts(TextSources(self.types, self.plan.resources, self.view_tables)).of
        self.units = Units(self.device, self.memory.parities)
        self.geometry = GeometryCompiler(self.scene, self.owned)
        self._barrier = partial(self.device.raw.glMemoryBarrier, _ALL_BARRIERS)
        self._geometry_draws: dict[tuple[str, int, int], list[Draw] | SortedDraws] = {}
        steps = self.plan.schedule.steps
        self._names = step_names(steps)
        # A borrowed context may already have an active query, so there everything is drawn.
        asked = {(step.node, step.if_drawn) for step in steps} if self.device.owned else set()
        self._queries = {step.key: OcclusionQuery(self.device) for step in steps if step.key in asked}
        self.uses_previous = False
        self._uploads: dict[tuple[str, int], UploadedValues] = {}
        # When another texture takes over a memory block, the driver, unaware of sharing, must finish all earlier work.
        self._takeovers = {
            self.plan.lifetimes[id].first for block in self.plan.physicals if block.block for id in block.members
        }

    def executable(self) -> Executable:
        steps = [
            [self._step(step, position, parity) for position, step in enumerate(self.plan.schedule.steps)]
            for parity in range(self.memory.parities)
        ]
        self._keep_units(steps)
        binds: list[list[Call]] = [[*calls, self.views.bind, self.scene.bind] for calls in self.units.binds()]
        made = Executable(self.device, self.plan, self.memory, self.views, self.scene, binds, steps)
        made.cull_and_sort = partial(self.geometry.cull_and_sort, self.views)
        made.uploads = self._uploads
        made.uses_previous = self.uses_previous or self.views.uses_previous
        made.timers = [Timer(self.device) for _ in self.plan.schedule.steps]
        made.occlusion_queries = list(self._queries.values())
        for query in (*made.timers, *made.occlusion_queries):
            self.owned.callback(query.release)
        made.invalidate()
        self.scene.drop_unused_images()
        activity.note("preparing a frame")()
        return made

    def _step(self, step: Step, position: int, parity: int) -> CompiledStep:
        compiled = CompiledStep(step, name=self._names[step.key])
        activity.note(f"compiling step '{compiled.name}'")()
        if step.kind == "upload":
            values = self._uploads.setdefault(step.key, UploadedValues(lambda: compiled.step, self.scene, self.memory))
            compiled.before.append(partial(values.write, parity))
        elif not step.shaders:
            compiled.before += transfer_calls(self.memory, step, parity)
        else:
            drawing = {"fullscreen": self._fullscreen, "geometry": self._geometry, "draw": self._draw}
            drawing.get(step.kind, self._compute)(step, compiled, parity)
            calls, units = image_calls(self.memory, step, parity)
            if any(TREE in draw.program.uniforms for draw in compiled.all_draws):
                units[TREE] = unit = max(units.values(), default=-1) + 1
                if unit >= (most := self.device.limits["images"]):
                    what = f"it has {unit} images, and rays take one more; this device supports {most}"
                    raise RenderError(step.problem("RG435", what))
                calls.append(partial(self.device.raw.glBindImageTexture, unit, self.scene.tree_image, *_TREE_IMAGE))
            compiled.before[:0] = calls  # first, because clears may bind another framebuffer
            for draw in compiled.all_draws:
                draw.uniforms |= {name: unit for name, unit in units.items() if name in draw.program.uniforms}
        stored = [] if step.kind in ("clear", "upload") else [w for w in step.writes if w.use in ("buffer", "image")]
        for write in stored:
            if write.use == "buffer" and write.load == "clear":
                compiled.before.append(clear_buffer(self.memory, write, parity))
        self._watch(step, compiled)
        if stored and step.kind != "copy":  # OpenGL does not synchronise image and buffer stores
            compiled.before.insert(0, self._barrier)
            compiled.after.append(self._barrier)
        if self.poison:
            compiled.after += self._poison(position, parity)
        if position in self._takeovers:
            compiled.before.insert(0, self.device.ctx.finish)
        return compiled

    def _watch(self, step: Step, compiled: CompiledStep) -> None:
        """Add an occlusion query if another step depends on this one, and conditional rendering if this one depends."""
        condition = self._queries.get((step.node, step.if_drawn)) if step.if_drawn is not None else None
        if condition is not None:
            compiled.before.append(condition.begin_conditional)
            compiled.after.insert(0, condition.end_conditional)
        if (query := self._queries.get(step.key)) is not None:
            compiled.before.append(query.start)
            compiled.after.insert(0, query.stop)

    def _fullscreen(self, step: Step, compiled: CompiledStep, parity: int) -> None:
        program, binds, uniforms = self._program(step, parity, {})
        self._target(step, compiled, parity)
        vertex_array = self.programs.vertex_array(program, ("none",), [])
        call = partial(vertex_array.render, moderngl.TRIANGLES, 3, 0, 1)
        draw = Draw(program, uniforms, self._state(step, depth_default=False), call, binds)
        for read in step.reads:
            if read.use == "sample" and read.name in program.uniforms:
                part = self.memory.part(read.resource, parity, read)
                if part.target == _TEXTURE_2D:
                    draw.textures[read.name] = part.glo, self.memory.sampler(read.sampler)
        compiled.draws.append(draw)

    def _keep_units(self, steps: list[list[CompiledStep]]) -> None:
        """Give a sampler for which draws of one program bind different textures a unit of its own (see `Units`)."""
        users: defaultdict[tuple[int, str], list[Draw]] = defaultdict(list)
        for draw in (draw for compiled in steps for step in compiled for draw in step.all_draws):
            for name in draw.uniforms:
                users[draw.program.glo, name].append(draw)
        for (_, name), using in users.items():
            samplers = {draw.textures[name][1] for draw in using if name in draw.textures}
            alike = len(samplers) == 1 and all(name in draw.textures for draw in using)
            if not alike or len({draw.uniforms[name] for draw in using}) == 1:
                continue
            unit = self.units.changing(samplers.pop())
            if unit is None:
                return
            for draw in using:
                draw.uniforms[name] = unit
                draw.binds.append(self.units.bind(draw.textures[name][0], unit))

    def _draw(self, step: Step, compiled: CompiledStep, parity: int) -> None:
        program, binds, uniforms = self._program(step, parity, {"PASS_VIEW_COUNT": view_count(step, self.view_tables)})
        self._target(step, compiled, parity)
        content: list[tuple[Any, ...]] = []
        names: list[int] = []
        held: dict[str, str] = {}
        for layout, resource in step.attributes:
            held |= attribute_formats(layout)
            formats, wanted = layout_for(layout, program)
            buffer = self.memory.buffer(resource, parity)
            if wanted:
                content.append((buffer, formats, *wanted))
            names.append(buffer.glo)
        check_attributes(step, program, held, partial(self._texts, step, {}))
        index = self.memory.buffer(step.indices, parity) if step.indices else None
        key = (id(self.memory), "draw", index and index.glo, *names, *(layout for layout, _ in step.attributes))
        vertex_array = self.programs.vertex_array(program, key, content, index)
        mode: int = getattr(moderngl, step.topology.upper())
        if isinstance(step.vertices, str):
            source = self.memory.buffer(step.vertices, parity)
            call: Call = partial(vertex_array.render_indirect, source, mode, step.commands, first=step.command)
            if step.count and self.device.limits["counted_draws"]:
                count = self.memory.buffer(step.count, parity)
                call = CountedDraw(self.device.raw, program.glo, vertex_array.glo, source.glo, count.glo, mode, step)
        elif isinstance(step.instances, str):
            command = self.device.ctx.buffer(np.array([step.vertices, 1, 0, 0, 0], np.uint32).tobytes())
            self.owned.callback(command.release)
            number = self.memory.buffer(step.instances, parity)
            compiled.before.append(partial(self.device.ctx.copy_buffer, command, number, 4, write_offset=4))
            call = partial(vertex_array.render_indirect, command, mode, 1)
        else:
            call = partial(vertex_array.render, mode, step.vertices, 0, step.instances)
        compiled.draws.append(Draw(program, uniforms, self._state(step, depth_default=True), call, binds))

    def _geometry(self, step: Step, compiled: CompiledStep, parity: int) -> None:
        self._target(step, compiled, parity)
        defines = {"PASS_VIEW_COUNT": view_count(step, self.view_tables), **self.scene.defines}

        def make(multi_draw: MultiDraw) -> Draw:
            macros = defines | dict(multi_draw.key.defines)
            program, binds, uniforms = self._program(step, parity, macros, materials=multi_draw.textures)
            check_attributes(step, program, SCENE_ATTRIBUTES, partial(self._texts, step, macros))
            for slot, (texture, sampler) in multi_draw.textures.items():
                uniforms[slot] = self.units.unit((texture,), sampler, binds)
            vertex_array = self.scene.vertex_array(self.programs, program, step.topology)
            self.uses_previous |= any(name in program.object for name in PREVIOUS_ATTRIBUTES)
            state = self._state(step, depth_default=True, key=multi_draw.key)
            return Draw(program, uniforms, state, partial(multi_draw.draw, vertex_array), binds, vertex_array)

        uses: tuple[Read | Write, ...] = (*step.all_reads, *step.writes)
        turns = any(use.use == "buffer" and len(self.plan.placement[use.resource]) == 2 for use in uses)
        key = (*step.key, parity if turns else 0)
        if key not in self._geometry_draws:  # one set of command buffers for both parities, unless buffers differ
            if step.object_commands:
                buffer = self.memory.buffer(step.object_commands, parity)
                self._geometry_draws[key] = self.geometry.by_commands(step, buffer, make)
            else:
                self._geometry_draws[key] = self.geometry.draws(step, make)
        made = self._geometry_draws[key]
        if isinstance(made, SortedDraws):
            compiled.sorted = made
        else:
            compiled.draws += made

    def _compute(self, step: Step, compiled: CompiledStep, parity: int) -> None:
        program, binds, uniforms = self._program(step, parity, {})
        if isinstance(step.groups, str):
            groups = self.memory.buffer(step.groups, parity)
            call: Call = partial(program.object.run_indirect, groups, 12 * step.command)
        else:
            call = partial(program.object.run, *groups_of(step, program.local_size, self.device.limits))
        compiled.draws.append(Draw(program, uniforms, None, call, binds))

    def _program(
        self, step: Step, parity: int, defines: Mapping[str, str], *, materials: Collection[str] = ()
    ) -> tuple[Program, list[Call], dict[str, Any]]:
        """Return the program of a step, its bindings and its uniforms, with blocks bound and units assigned."""
        outputs = [write.name for write in step.writes if write.use == "color"]
        blocks = dict(FIXED_BLOCKS)
        before_views: dict[str, str] = {}
        if step.view is not None:
            blocks["pass_view_block"] = self.views.binding(step.view)
            before_views["previous_pass_view_block"] = step.view
        reads = prefixed_reads(step)
        storage = self.views.first_storage_binding
        binds: list[Call] = []
        touched: list[tuple[str, Read | Write]] = [*reads, *(("", write) for write in step.writes)]
        for before, use in touched:
            view = self.plan.resources[use.resource].view
            if use.use == "buffer" and before + use.name not in blocks:
                blocks[before + use.name] = storage
                previous = isinstance(use, Read) and use.previous
                buffer = self.memory.buffer(use.resource, parity, previous=previous)
                binds.append(partial(buffer.bind_to_storage_buffer, storage))
                storage += 1
            elif view is not None and isinstance(use, Read):
                if use.previous:  # last frame's texture was drawn with last frame's view
                    before_views[f"{before}{use.name}_view_block"] = view
                else:
                    blocks[f"{before}{use.name}_view_block"] = self.views.binding(view)
                    before_views[f"{before}previous_{use.name}_view_block"] = view
        blocks |= {name: self.views.previous_binding(table) for name, table in before_views.items()}
        macros = {**self.scene.light_defines, **self._sample_positions(step), **defines}
        if step.reads_scene:
            macros |= self.scene.data_defines
        texts: Texts = partial(self._texts, step, macros)
        if step.reads_scene:
            used = {name for text in texts().values() for _, name, _ in declared_blocks(text.text)}
            held = dict(self.scene.data.buffers)
            if "scene_previous_block" in used:
                held["scene_previous_block"] = self.scene.previous()
                held["scene_previous_position_block"] = self.scene.previous_positions()
                self.uses_previous = True
            self._check_stages(step, texts())
            for block in sorted(used & held.keys()):
                blocks[block] = storage
                binds.append(partial(held[block].bind_to_storage_buffer, storage))
                storage += 1
        try:
            program = self.programs.get(texts(), blocks, outputs)
        except InputError as error:  # the driver only reports undeclared names
            check_scene_includes(step, texts(), self.types)
            raise InputError(missing(step, texts(), self.types[step.node].cls) or error.problems) from error
        for name in before_views.keys() & program.block_names:
            self.views.keep_previous(before_views[name])
        uniforms = step_uniforms(step)
        sampled: set[str] = set()
        for before, read in reads:
            if read.use != "sample":
                continue
            sampled.add(before + read.name)
            if before + read.name in program.uniforms:
                names = tuple(self.memory.part(read.resource, p, read).glo for p in range(self.memory.parities))
                uniforms[before + read.name] = self.units.unit(names, self.memory.sampler(read.sampler), binds)
        for name, texture in self.scene.data.textures.items() if step.reads_scene else ():
            sampled.add(name)
            if name in program.uniforms:
                uniforms[name] = self.units.unit((texture.glo,), self.scene.data.sampler, binds)
        for name in sorted(TEXELS & program.uniforms.keys()):
            check_scene_includes(step, texts(), self.types)
            sampled.add(name)
            if name != TREE:  # that is an image: see `_step`
                uniforms[name] = self.units.unit((self.scene.data.texels[name],), 0, binds)
        cls, resources, sampled = self.types[step.node].cls, self.plan.resources, {*sampled, *materials}
        check_kept_text(step, texts, cls, resources)
        ProgramChecks(step, program, texts, cls, resources, uniforms, blocks, sampled).run()
        return program, binds, uniforms

    def _check_stages(self, step: Step, texts: Mapping[str, StageText]) -> None:
        """Refuse more storage blocks than a stage of this device supports; vertex shaders may support none."""
        for stage, text in texts.items():
            count = sum(storage == "buffer" for storage, _, _ in declared_blocks(compiled_text(text.text)))
            if count > (most := self.device.limits[f"{stage}_storage"]):
                what = f"its {stage} shader has {count} storage blocks with those of the scene"
                what += f", this device supports {most} there; fragment and compute shaders have at least 8"
                raise RenderError(step.problem("RG435", what))

    def _sample_positions(self, step: Step) -> dict[str, str]:
        """Return macros with the device's sample positions in the step's targets and inputs."""
        descs = [self.plan.resources[read.resource].desc for read in step.all_reads]
        counts = {step.samples, *(desc.samples for desc in descs if isinstance(desc, TextureDesc))} - {1}
        texts = {count: [f"vec2({x}, {y})" for x, y in self.device.sample_positions(count)] for count in sorted(counts)}
        return {positions_macro(count): f"vec2[]({', '.join(text)})" for count, text in texts.items()}

    def _target(self, step: Step, compiled: CompiledStep, parity: int) -> None:
        """Bind the framebuffer, after the step's clears."""
        colors = [write for write in step.writes if write.use == "color"]
        depth_write = next((write for write in step.writes if write.use == "depth"), None)
        depth: Write | Read | None = depth_write or next((r for r in step.reads if r.use == "depth_test"), None)
        attachments = [self.memory.attachment(write, parity) for write in colors]
        at_depth = self.memory.attachment(depth, parity) if depth is not None else None
        state, within = step.state, None
        if state.depth_write is None:
            state = replace(state, depth_write=depth_write is not None)
        if step.region is not None:
            within = self.memory.regions.setdefault((step.node, step.region), Region())
        whole = self.memory.framebuffer(attachments, at_depth, step.size)
        drawn = self.memory.framebuffer(attachments, at_depth, step.size, state, within)
        numbered: list[tuple[int | None, Write]] = [*enumerate(colors), *([(None, depth_write)] if depth_write else [])]
        clears = [self._clear(whole, number, write, parity) for number, write in numbered if write.load == "clear"]
        if clears:
            compiled.before += [whole.use, *clears]
        if within is not None:
            compiled.before.append(partial(within.use, drawn))
        elif not clears or drawn is not whole:
            compiled.before.append(drawn.use)
        bounds: Call | None = None
        if state.depth_bounds is not None:
            bounds = partial(self.device.raw.glDepthBoundsEXT, *state.depth_bounds)
        elif within is not None and depth is not None and self.device.limits["depth_bounds"]:
            bounds = partial(within.bound_depth, self.device.raw)
        if bounds is not None:
            compiled.before += [partial(self.device.raw.glEnable, _DEPTH_BOUNDS_TEST), bounds]
            compiled.after.append(partial(self.device.raw.glDisable, _DEPTH_BOUNDS_TEST))
        for plane in range(_CLIP_DISTANCE0, _CLIP_DISTANCE0 + state.clip_distances):
            compiled.before.append(partial(self.device.raw.glEnable, plane))
            compiled.after.append(partial(self.device.raw.glDisable, plane))

    def _clear(self, target: moderngl.Framebuffer, number: int | None, write: Write, parity: int) -> Call:
        texture = self.memory.texture(write.resource, parity)
        if FORMATS[texture.desc.format].family == "depth_stencil":
            # A framebuffer clear would use the stencil write mask of an earlier step.
            return Clear(self.device, texture, write.clear, mip=write.mip or 0, layer=write.layer)
        return clear_target(self.device, target, number, texture.desc.format, write.clear)

    def _state(self, step: Step, *, depth_default: bool, key: MultiDrawKey | None = None) -> gl_state.Pieces:
        state = step.state
        writes_depth = any(write.use == "depth" for write in step.writes)
        has_depth = writes_depth or any(read.use == "depth_test" for read in step.reads)
        depth_test = has_depth and depth_default if state.depth_test is None else state.depth_test
        if not depth_test and writes_depth and state.depth_write is not False:
            # OpenGL writes no depth if the depth test is off.
            depth_test, state = True, replace(state, depth_func="always")
        cull = key.cull if key else "none" if state.cull in ("material", "solid") else state.cull
        clockwise = key.clockwise if key else state.front == "clockwise"
        targets = sum(write.use == "color" for write in step.writes)
        return gl_state.pieces(
            self.device.raw, state, depth_test=depth_test, cull=cull, clockwise=clockwise, targets=targets
        )

    def _poison(self, position: int, parity: int) -> list[Call]:
        calls: list[Call] = []
        for name in self.plan.released.get(position, ()):
            resource = self.plan.resources[name]
            if resource.role in ("transient", "internal") and isinstance(resource.desc, TextureDesc):
                calls += self.memory.clear(name, parity, poison_value(resource.desc.format))
        return calls
