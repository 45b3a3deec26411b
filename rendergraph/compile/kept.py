"""What kept steps have made, for other pipelines that would make the same: a copy costs what filtering it does not.

Textures and buffers stay their executables' own, so nothing that one does is seen by another; what is passed on is
copied when another pipeline, or the same with other parameters, comes in place of the one that made it.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, TypeAlias

from msgspec import Struct, field

from rendergraph.compile.executable import step_uniforms
from rendergraph.expand import SCENE_DATA
from rendergraph.gl import textures
from rendergraph.gl.textures import GpuTexture
from rendergraph.schedule.dependencies import touched_ids

if TYPE_CHECKING:
    import moderngl

    from rendergraph.compile.executable import Executable
    from rendergraph.gl.device import Device

Content: TypeAlias = Hashable
"""All that decides what a kept resource holds: equal ones hold the same bits."""

_Held: TypeAlias = "GpuTexture | moderngl.Buffer"


class KeptValues(Struct, eq=False):
    """The last few values that were made, whichever pipeline, scene or parameters they are of.

    Attributes:
        limit: bytes of all copies together; the least recently used ones are freed first.
    """

    device: Device
    limit: int
    _copies: dict[Content, _Held] = field(default_factory=dict)

    def save(self, executable: Executable) -> None:
        """Copy what it has made since it was asked last."""
        if executable.due or not (executable.has_new_kept and executable.shares_kept):
            return
        executable.has_new_kept = False
        for id, content in contents(executable).items():
            held, made = self._copies.pop(content, None), _of(executable, id)
            if held is None:
                held = self._like(made)
                self._copy(made, held)
            self._copies[content] = held
        while sum(_bytes(held) for held in self._copies.values()) > self.limit:
            self._delete(self._copies.pop(next(iter(self._copies))))

    def restore(self, executable: Executable) -> None:
        """Copy what is there of what it is about to make; the steps that make it have not to run."""
        if not (executable.due and executable.shares_kept and self._copies):
            return
        there = {id: content for id, content in contents(executable).items() if content in self._copies}
        for id, content in there.items():
            held = self._copies[content] = self._copies.pop(content)
            self._copy(held, _of(executable, id))
        if there:
            executable.mark_restored(there)

    def release(self) -> None:
        for held in self._copies.values():
            self._delete(held)
        self._copies.clear()

    def _like(self, made: _Held) -> _Held:
        if isinstance(made, GpuTexture):
            return textures.create(self.device, made.desc, "a kept value")
        return self.device.ctx.buffer(reserve=made.size)

    def _copy(self, source: _Held, target: _Held) -> None:
        if isinstance(source, GpuTexture) or isinstance(target, GpuTexture):
            assert isinstance(source, GpuTexture)
            assert isinstance(target, GpuTexture)
            for copy in textures.copies(self.device, source, target):
                copy()
        else:
            self.device.ctx.copy_buffer(target, source)

    def _delete(self, held: _Held) -> None:
        if isinstance(held, GpuTexture):
            textures.delete(self.device, held)
        else:
            held.release()


def contents(executable: Executable) -> Mapping[str, Content]:
    """Of each kept resource all that it is made of: steps with their parameters and texts, and the environment.

    They look at nothing else: what a kept value may not depend on, `expand` and `check_kept_text` refuse.
    """
    resources = executable.plan.resources
    steps = {
        compiled.step.key: (
            compiled.step,
            repr(step_uniforms(compiled.step)),  # 0.0 and -0.0 are equal, and two values
            *(tuple(draw.program.texts.items()) for draw in compiled.draws),
        )
        for compiled in executable.steps[0]
        if compiled.step.key in executable.kept
    }
    touched = {key: touched_ids(step) for key, step in executable.kept.items()}
    made = {key: {write.resource for write in step.writes} for key, step in executable.kept.items()}
    found: dict[str, Content] = {}
    for id in {id: None for ids in made.values() for id in ids}:
        ids = {id}
        while True:
            makers = sorted(key for key in made if not made[key].isdisjoint(ids))
            more = ids.union(*(touched[key] for key in makers))
            if more == ids:
                break
            ids = more
        if any(executable.uploads[key].upload.sources for key in makers if key in executable.uploads):
            continue  # made of a scene that changes
        if SCENE_DATA.port in ids:
            continue  # likewise
        environment = any(resources[other].role == "scene" for other in ids)
        found[id] = (
            id,
            tuple(steps[key] for key in makers),
            tuple((other, resources[other].desc) for other in sorted(ids)),
            executable.scene.environment_content if environment else None,
        )
    return found


def _of(executable: Executable, id: str) -> _Held:
    place = executable.plan.placement[id][0]
    made = executable.memory.physicals[place]
    return executable.memory.texture(id) if isinstance(made, GpuTexture) else executable.memory.buffer(id)


def _bytes(held: _Held) -> int:
    return held.desc.bytes if isinstance(held, GpuTexture) else held.size
