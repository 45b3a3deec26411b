"""What is kept from frame to frame may depend on nothing that a frame changes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rendergraph.errors import InputError
from rendergraph.steps import Resource, Step


def check_kept(steps: Sequence[Step], resources: Mapping[str, Resource]) -> None:
    """Hold the steps that make kept textures and buffers against what may go into those.

    What their shaders look at beside that is seen where program text is put together.

    Raises:
        InputError: one of them depends on what is not kept, or writes that as well (RG439).
    """
    problems = [
        step.problem("RG439", text)
        for step in steps
        for made in [[write.resource for write in step.writes if resources[write.resource].role == "kept"]]
        if made
        for text in _dependencies(step, made, resources)
    ]
    if problems:
        raise InputError(list(dict.fromkeys(problems)))


def _dependencies(step: Step, made: Sequence[str], resources: Mapping[str, Resource]) -> Iterator[str]:
    """What a step that makes kept resources depends on, one sentence each."""
    kept = made[0]
    maker = kept.rpartition(".")[0]
    if maker != step.node:
        yield f"it goes on with '{kept}', which is kept from frame to frame; draw into a texture that is not"
        return
    others = [write.resource for write in step.writes if write.resource not in made]
    if others:
        yield f"it makes '{kept}', which is kept, and '{others[0]}', which is not; make them in two steps"
    if step.kind == "geometry":
        yield f"it makes '{kept}', which is kept, from the scene's objects, which may move"
    if step.region is not None:
        yield f"it makes '{kept}', which is kept, in a region that `update` sets in each frame"
    for read in step.all_reads:
        if read.previous:
            yield f"it makes '{kept}', which is kept, from last frame's '{read.resource}', another in each frame"
        elif read.resource not in resources or resources[read.resource].role not in ("kept", "scene"):
            yield f"it makes '{kept}', which is kept, from '{read.resource}', which is not; keep that too: `kept=True`"
