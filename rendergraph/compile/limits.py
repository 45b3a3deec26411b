"""What a driver offers at most, held against a plan before the driver is asked: it would answer with a bare number."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from rendergraph.allocate import ResourcePlan
from rendergraph.errors import InputError, Problem, RenderError
from rendergraph.expand import ViewTable
from rendergraph.gl.device import Device
from rendergraph.scene.pack import VIEW
from rendergraph.steps import Read, Step, Write
from rendergraph.textures import FORMATS, TextureDesc


def check_plan(device: Device, plan: ResourcePlan, views: Mapping[str, ViewTable], fixed_blocks: int) -> None:
    """Refuse what this device cannot hold, all of it at once."""
    if mistakes := list(dict.fromkeys(_samples(plan, device.limits))):
        raise InputError(mistakes)
    if problems := list(_excesses(device, plan, views, fixed_blocks)):
        raise RenderError(problems)


def _samples(plan: ResourcePlan, limits: Mapping[str, int]) -> Iterator[Problem]:
    """Unlike the other limits it is met by what people type: a parameter, at the node that has it."""
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
                yield Problem("RG435", f"{text}, which is more than this device's {most}", step.where.place)


def _excesses(
    device: Device, plan: ResourcePlan, views: Mapping[str, ViewTable], fixed_blocks: int
) -> Iterator[Problem]:
    limits = device.limits
    for name, resource in plan.resources.items():
        if isinstance(desc := resource.desc, TextureDesc):
            is_3d = desc.kind == "texture3d"
            for words, value, limit in (
                (f"is {desc.width}×{desc.height}", max(desc.size), "depth" if is_3d else "texture_size"),
                (f"has {desc.layers} layers", desc.layers, "depth" if is_3d else "layers"),
            ):
                if value > limits[limit]:
                    yield Problem("RG435", f"'{name}' {words}, which is more than this device's {limits[limit]}")
    most = limits["uniform_block"] // VIEW.itemsize
    for name, table in views.items():
        if table.count > most:
            text = f"view table '{name}' has {table.count} views; a uniform block of this device holds {most}"
            yield Problem("RG435", text)
    bindings = limits["uniform_bindings"] - fixed_blocks
    if len(views) > bindings:
        yield Problem("RG435", f"there are {len(views)} view tables; this device binds {bindings} at once")
    for step in plan.schedule.steps:
        uses: tuple[Read | Write, ...] = (*step.reads, *step.writes)
        buffers = {use.name for use in (*step.all_reads, *uses) if use.use == "buffer"}
        images = sum(use.use == "image" for use in uses) if step.shaders else 0
        for words, value, most in (
            ("colour targets", sum(write.use == "color" for write in step.writes), limits["color_targets"]),
            ("buffers", len(buffers), limits["storage_bindings"] - fixed_blocks),
            ("images", images, limits["images"]),
        ):
            if value > most:
                yield step.problem("RG435", f"it has {value} {words}; this device supports {most}")
        if step.state.depth_bounds is not None and not device.has_depth_bounds:
            text = "its `State` has depth bounds, which this device lacks; `rendergraph doctor` says more"
            yield step.problem("RG435", text)


def groups_of(step: Step, local: tuple[int, int, int], limits: Mapping[str, int]) -> tuple[int, int, int]:
    groups = step.groups
    assert isinstance(groups, tuple)
    if step.invocations is not None:
        x, y, z = (-(-count // size) for count, size in zip(step.invocations, local, strict=True))
        groups = x, y, z
    most = limits["groups_x"], limits["groups_y"], limits["groups_z"]
    if any(count > limit for count, limit in zip(groups, most, strict=True)):
        text = (
            f"it has {' × '.join(map(str, groups))} work groups; this device supports {' × '.join(map(str, most))}, "
            "larger groups (`layout(local_size_x = …)`) make fewer of them"
        )
        raise RenderError(step.problem("RG435", text))
    return groups
