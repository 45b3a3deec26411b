"""Compare a plan and its programs with the limits of a device, or with those guaranteed by OpenGL 4.5. No GL."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from rendergraph.allocate import ResourcePlan
from rendergraph.catalog import NodeType
from rendergraph.errors import InputError, Problem, RenderError
from rendergraph.expand import ViewTable
from rendergraph.glsl.globals import declared_blocks, declared_samplers, globals_of
from rendergraph.glsl.names import compiled_text, reachable_names
from rendergraph.program.text import StepTexts, TextSources
from rendergraph.program.variants import FIXED_BLOCKS, variants
from rendergraph.scene.model import Scene
from rendergraph.scene.pack import VIEW, PackedScene
from rendergraph.steps import Read, Step, Write
from rendergraph.textures import FORMATS, TextureDesc

GUARANTEED = {
    "units": 80, "uniform_block": 16384, "uniform_bindings": 84, "texture_size": 16384, "layers": 2048, "depth": 2048,
    "samples": 1, "depth_samples": 1, "integer_samples": 1, "color_targets": 8, "images": 8, "storage_bindings": 8,
    "groups_x": 65535, "groups_y": 65535, "groups_z": 65535,
    "depth_bounds": 0,
}  # fmt: skip
"""The limits that every OpenGL 4.5 driver offers.

From the OpenGL 4.5 core profile specification, chapter 23, tables "Implementation Dependent Values", "Implementation
Dependent … Shader Limits" for each stage and in aggregate, and "Framebuffer Dependent Values".
"""
_STAGE_UNITS, _STAGE_BLOCKS, _VARYINGS = 16, 14, 60
_STAGE_STORAGE = {"vertex": 0, "geometry": 0, "fragment": 8, "compute": 8}
_WHO, _MINIMAL = "this device", "a minimal OpenGL 4.5 device"


def check_plan(limits: Mapping[str, int], plan: ResourcePlan, views: Mapping[str, ViewTable]) -> None:
    """Refuse everything that exceeds a device's limits, in one error."""
    if mistakes := list(dict.fromkeys(_samples(plan, limits))):
        raise InputError(mistakes)
    if problems := list(_excesses(limits, plan, views)):
        raise RenderError(problems)


def beyond_guaranteed(
    plan: ResourcePlan, views: Mapping[str, ViewTable], types: Mapping[str, NodeType], scene: Scene, packed: PackedScene
) -> list[Problem]:
    """Return everything in a plan and its programs that some OpenGL 4.5 driver may not support."""
    problems = [*_samples(plan, GUARANTEED, _MINIMAL), *_excesses(GUARANTEED, plan, views, _MINIMAL)]
    texts = StepTexts(TextSources(types, plan.resources, views))
    for step in plan.schedule.steps:
        for macros in variants(step, scene, packed, views, GUARANTEED["uniform_block"]) if step.shaders else ():
            stages = {stage: text.text for stage, text in texts.of(step, macros).items()}
            problems += [step.problem("RG435", text) for text in program_excesses(stages)]
    return list(dict.fromkeys(problems))


def program_excesses(stages: Mapping[str, str]) -> Iterator[str]:
    read: set[str] = set()  # inputs of later stages
    for stage, text in reversed(list(stages.items())):
        names, compiled = reachable_names(text), compiled_text(text)
        samplers = names & declared_samplers(compiled).keys()
        used = [storage for storage, _, members in declared_blocks(compiled) if not names.isdisjoint(members)]
        outs = [one for one in globals_of(compiled).declared if one.storage == "out" and one.name in read]
        for words, value, most in (
            ("samplers", len(samplers), _STAGE_UNITS),
            ("uniform blocks", used.count("uniform"), _STAGE_BLOCKS),
            ("storage blocks", used.count("buffer"), _STAGE_STORAGE[stage]),
            ("output components", sum(_components(one.type) for one in outs), _VARYINGS),
        ):
            if value > most:
                found = f"{value} {words.removesuffix('s') if value == 1 else words}"
                yield f"its {stage} shader has {found}, which is more than {_MINIMAL}'s {most}"
        read |= names


def _components(type: str) -> int:
    """Return the number of components of a varying's type: `float`, `ivec3`, `mat4`, `mat3x2`."""
    sizes = [int(letter) for letter in type if letter.isdigit()] or [1]
    return sizes[0] * sizes[-1] if type.startswith("mat") else sizes[0]


def _samples(plan: ResourcePlan, limits: Mapping[str, int], who: str = _WHO) -> Iterator[Problem]:
    """Yield textures with too many samples, located at the node, because users set samples by a parameter."""
    for step in plan.schedule.steps:
        for write in step.writes:
            desc = plan.resources[write.resource].desc
            if not isinstance(desc, TextureDesc) or desc.samples == 1:
                continue
            family = FORMATS[desc.format].family
            kind = "integer_" if family in ("int", "uint") else "depth_" if "depth" in family else ""
            most = limits[f"{kind}samples"]
            if desc.samples > most:
                text = f"'{write.resource}' has {desc.samples} samples per texel"
                yield Problem("RG435", f"{text}, which is more than {who}'s {most}", step.where.place)


def _excesses(
    limits: Mapping[str, int], plan: ResourcePlan, views: Mapping[str, ViewTable], who: str = _WHO
) -> Iterator[Problem]:
    makers = {write.resource: step.where.place for step in plan.schedule.steps for write in step.writes}
    for name, resource in plan.resources.items():
        if isinstance(desc := resource.desc, TextureDesc):
            is_3d = desc.kind == "texture3d"
            for words, value, limit in (
                (f"is {desc.width}×{desc.height}", max(desc.size), "depth" if is_3d else "texture_size"),
                (f"has {desc.layers} layers", desc.layers, "depth" if is_3d else "layers"),
            ):
                if value > limits[limit]:
                    text = f"'{name}' {words}, which is more than {who}'s {limits[limit]}"
                    yield Problem("RG435", text, makers.get(name))
    most = limits["uniform_block"] // VIEW.itemsize
    for name, table in views.items():
        if table.count > most:
            text = f"view table '{name}' has {table.count} views; a uniform block of {who} holds {most}"
            yield Problem("RG435", text)
    bindings = limits["uniform_bindings"] - len(FIXED_BLOCKS)
    if len(views) > bindings:
        yield Problem("RG435", f"there are {len(views)} view tables; {who} binds {bindings} at once")
    for step in plan.schedule.steps:
        uses: tuple[Read | Write, ...] = (*step.reads, *step.writes)
        buffers = {use.name for use in (*step.all_reads, *uses) if use.use == "buffer"}
        images = sum(use.use == "image" for use in uses) if step.shaders else 0
        for words, value, most in (
            ("colour targets", sum(write.use == "color" for write in step.writes), limits["color_targets"]),
            ("buffers", len(buffers), limits["storage_bindings"] - len(FIXED_BLOCKS)),
            ("images", images, limits["images"]),
        ):
            if value > most:
                yield step.problem("RG435", f"it has {value} {words}; {who} supports {most}")
        if step.state.depth_bounds is not None and not limits["depth_bounds"]:
            text = f"its `State` has depth bounds, which {who} lacks; `rendergraph doctor` says more"
            yield step.problem("RG435", text)


def groups_of(step: Step, local: tuple[int, int, int], limits: Mapping[str, int]) -> tuple[int, int, int]:
    groups = step.groups
    assert isinstance(groups, tuple)
    if step.invocations is not None:
        x, y, z = (-(-count // size) for count, size in zip(step.invocations, local, strict=True))
        groups = x, y, z
    most = limits["groups_x"], limits["groups_y"], limits["groups_z"]
    if any(count > limit for count, limit in zip(groups, most, strict=True)):
        text = f"it has {' × '.join(map(str, groups))} work groups; this device supports {' × '.join(map(str, most))}"
        text += ", larger groups (`layout(local_size_x = …)`) make fewer of them"
        raise RenderError(step.problem("RG435", text))
    return groups
