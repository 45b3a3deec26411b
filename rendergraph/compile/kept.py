"""Cache the results of kept steps for other pipelines that would compute the same, such as filtered environment maps.

Executables own their textures and buffers, so none affects another. Results are copied when another pipeline, or the
same one with other parameters, replaces the one that computed them.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TypeAlias

import moderngl
from msgspec import Struct, field

from rendergraph.compile.executable import Executable, step_uniforms
from rendergraph.expand import SCENE_DATA
from rendergraph.gl import textures
from rendergraph.gl.device import Device
from rendergraph.gl.textures import GpuTexture
from rendergraph.schedule.dependencies import touched_ids
from rendergraph.textures import BufferDesc

Content: TypeAlias = Hashable
"""Everything that determines the contents of a kept resource: if equal, all bits are equal."""

_Held: TypeAlias = GpuTexture | moderngl.Buffer


class KeptValues(Struct, eq=False):
    """The latest values of all pipelines, scenes and parameters.

    Attributes:
        limit: total bytes of all copies; the least recently used are freed first.
    """

    device: Device
    limit: int
    _copies: dict[Content, _Held] = field(default_factory=dict)

    def save(self, executable: Executable) -> None:
        """Copy the values that an executable has computed since the last call."""
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
        """Copy cached values into an executable, which skips the steps that would compute them."""
        if not (executable.due and executable.shares_kept and self._copies):
            return
        known = {id: content for id, content in contents(executable).items() if content in self._copies}
        for id, content in known.items():
            held = self._copies[content] = self._copies.pop(content)
            self._copy(held, _of(executable, id))
        if known:
            executable.mark_restored(known)

    def release(self) -> None:
        while self._copies:
            self._delete(self._copies.popitem()[1])

    def _like(self, made: _Held) -> _Held:
        if isinstance(made, GpuTexture):
            return textures.create(self.device, made.desc, "a kept value")
        return self.device.ctx.buffer(reserve=made.size)

    def _copy(self, source: _Held, target: _Held) -> None:
        match source, target:
            case GpuTexture(), GpuTexture():
                for copy in textures.copies(self.device, source, target):
                    copy()
            case moderngl.Buffer(), moderngl.Buffer():
                self.device.ctx.copy_buffer(target, source)

    def _delete(self, held: _Held) -> None:
        if isinstance(held, GpuTexture):
            textures.delete(self.device, held)
        else:
            held.release()


def contents(executable: Executable) -> Mapping[str, Content]:
    """Return everything that determines each kept resource: steps with parameters and texts, and the environment.

    They depend on nothing else: `expand` and `check_kept_text` refuse other dependencies.
    """
    resources = executable.plan.resources
    steps = {
        compiled.step.key: (
            compiled.step,
            repr(step_uniforms(compiled.step)),  # as text, because 0.0 equals -0.0
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
        changes = any(executable.uploads[key].upload.sources for key in makers if key in executable.uploads)
        if changes or SCENE_DATA.port in ids:
            continue  # computed from a scene that changes
        environment = any(resources[other].role == "scene" for other in ids)
        found[id] = (
            id,
            tuple(steps[key] for key in makers),
            tuple((other, resources[other].desc) for other in sorted(ids)),
            executable.scene.environment_content if environment else None,
        )
    return found


def _of(executable: Executable, id: str) -> _Held:
    is_buffer = isinstance(executable.plan.resources[id].desc, BufferDesc)
    return executable.memory.buffer(id) if is_buffer else executable.memory.texture(id)


def _bytes(held: _Held) -> int:
    return held.desc.bytes if isinstance(held, GpuTexture) else held.size
