"""What a driver offers at most, held against a plan before the driver is asked: it would answer with a bare number."""

from __future__ import annotations

from collections.abc import Mapping

from rendergraph.allocate import ResourcePlan
from rendergraph.errors import InputError, Problem, RenderError
from rendergraph.expand import ViewTable
from rendergraph.gl.device import Device
from rendergraph.scene.pack import VIEW
from rendergraph.steps import Read, Step, Write
from rendergraph.textures import FORMATS, TextureDesc


def check_plan(device: Device, plan: ResourcePlan, views: Mapping[str, ViewTable], fixed_blocks: int) -> None:
    """Refuse what this device cannot hold, all of it at once."""
    limits = device.limits
    _check_samples(plan, limits)
    texts = [text for name, resource in plan.resources.items() for text in _texture(name, resource.desc, limits)]
    most = limits["uniform_block"] // VIEW.itemsize
    for name, table in views.items():
        if table.count > most:
            texts.append(f"view table '{name}' has {table.count} views; a uniform block of this device holds {most}")
    bindings = limits["uniform_bindings"]
    if fixed_blocks + len(views) > bindings:
        texts.append(f"there are {len(views)} view tables; this device binds {bindings - fixed_blocks} at once")
    problems = [Problem("RG435", text) for text in texts]
    problems += [problem for step in plan.schedule.steps for problem in _step(step, limits, fixed_blocks)]
    if not device.has_depth_bounds:
        problems += [
            step.problem(
                "RG435", "its `State` has depth bounds, which this device lacks; `rendergraph doctor` says more"
            )
            for step in plan.schedule.steps
            if step.state.depth_bounds is not None
        ]
    if problems:
        raise RenderError(problems)


def _check_samples(plan: ResourcePlan, limits: Mapping[str, int]) -> None:
    """Unlike the other limits it is met by what people type: a parameter, at the node that has it."""
    problems = []
    for step in plan.schedule.steps:
        for write in step.writes:
            desc = plan.resources[write.resource].desc
            if not isinstance(desc, TextureDesc) or desc.samples == 1:
                continue
            family = FORMATS[desc.format].family
            kind = "integer_" if family in ("int", "uint") else "depth_" if "depth" in family else ""
            most = limits[f"{kind}samples"]
            if desc.samples > most:
                text = f"'{write.resource}' has {desc.samples} samples a texel, which is more than this device's {most}"
                problems.append(Problem("RG435", text, step.where.place))
    if problems:
        raise InputError(list(dict.fromkeys(problems)))


def _texture(name: str, desc: object, limits: Mapping[str, int]) -> list[str]:
    if not isinstance(desc, TextureDesc):
        return []
    found = []
    for words, value, most in (
        (f"is {desc.width}×{desc.height}", max(desc.size), limits["texture_size"]),
        (f"has {desc.layers} layers", desc.layers, limits["layers"]),
    ):
        if value > most:
            found.append(f"'{name}' {words}, which is more than this device's {most}")
    return found


def _step(step: Step, limits: Mapping[str, int], fixed_blocks: int) -> list[Problem]:
    uses: tuple[Read | Write, ...] = (*step.reads, *step.writes)
    buffers = {use.name for use in (*step.all_reads, *uses) if use.use == "buffer"}
    found = []
    for words, value, most in (
        ("colour targets", sum(write.use == "color" for write in step.writes), limits["color_targets"]),
        ("buffers", len(buffers), limits["storage_bindings"] - fixed_blocks),
        ("images", sum(use.use == "image" for use in uses) if step.kind == "compute" else 0, limits["images"]),
    ):
        if value > most:
            found.append(step.problem("RG435", f"it has {value} {words}; this device takes {most}"))
    return found


def groups_of(step: Step, local: tuple[int, int, int], limits: Mapping[str, int]) -> tuple[int, int, int]:
    """How many work groups a compute step has."""
    groups = step.groups
    if step.invocations is not None:
        x, y, z = (-(-count // size) for count, size in zip(step.invocations, local, strict=True))
        groups = x, y, z
    most = limits["groups_x"], limits["groups_y"], limits["groups_z"]
    if any(count > limit for count, limit in zip(groups, most, strict=True)):
        text = (
            f"it has {' × '.join(map(str, groups))} work groups; this device takes {' × '.join(map(str, most))}, "
            "larger groups (`layout(local_size_x = …)`) make fewer of them"
        )
        raise RenderError(step.problem("RG435", text))
    return groups
