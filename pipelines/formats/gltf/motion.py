"""Skins and animations of a glTF file."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from rendergraph.pipelines.formats.gltf.buffers import Buffers
from rendergraph.pipelines.formats.gltf.schema import Animation, Gltf, check_index

from rendergraph.projection import unit
from rendergraph.scene.reading import Reading, UniqueNames
from rendergraph.scene.rig import Clip, Skin, Track

_SHAPES = {"translation": ("VEC3", 3), "rotation": ("VEC4", 4), "scale": ("VEC3", 3), "weights": ("SCALAR", 1)}
_FLOATS, _NORMALIZED = (5126,), (5126, 5120, 5121, 5122, 5123)


def read_skins(gltf: Gltf, buffers: Buffers, reading: Reading) -> tuple[Skin, ...]:
    found = []
    for number, skin in enumerate(gltf.skins):
        where, count = f"skins[{number}]", len(skin.joints)
        check_index(reading, max(skin.joints), gltf.nodes, f"{where}.joints", "nodes")
        check_index(reading, skin.skeleton, gltf.nodes, f"{where}.skeleton", "nodes")
        inverses = np.tile(np.eye(4), (count, 1, 1))
        if skin.inverse_bind_matrices >= 0:
            use = f"{where}.inverseBindMatrices"
            accessor = buffers.check_use(skin.inverse_bind_matrices, use, ("MAT4",), _FLOATS)
            if accessor.count < count:
                raise reading.error("RG304", f"{use} are {accessor.count}, but the skin has {count} joints")
            columns = buffers.floats(skin.inverse_bind_matrices)[:count].astype(np.float64)
            inverses = columns.reshape(count, 4, 4).swapaxes(1, 2)
        found.append(Skin(np.array(skin.joints, np.int32), inverses))
    return tuple(found)


def read_clips(gltf: Gltf, buffers: Buffers, reading: Reading, target_counts: list[int]) -> dict[str, Clip]:
    """Return the animations by name; `target_counts` are the nodes' numbers of morph targets."""
    names, found = UniqueNames(), {}
    for number, animation in enumerate(gltf.animations):
        where = f"animations[{number}]"
        tracks = _tracks(animation, where, gltf, buffers, reading, target_counts)
        length = max((float(track.times[-1]) for track in tracks), default=0.0)
        name = names.unique(animation.name, f"animation_{number}")
        if not length:
            reading.warn("RG332", f"length {number}", f"{where} has no length: its clip '{name}' holds still")
        found[name] = Clip(name, length, tuple(tracks))
    return found


def _tracks(
    animation: Animation, where: str, gltf: Gltf, buffers: Buffers, reading: Reading, target_counts: list[int]
) -> list[Track]:
    """The channels of an animation; those of one property with the same key times are one track."""
    groups: dict[tuple[Any, ...], list[tuple[int, npt.NDArray[np.float64]]]] = {}
    animated: set[tuple[int, str]] = set()
    for at, sampler in enumerate(animation.samplers):
        for key, index in (("input", sampler.input), ("output", sampler.output)):
            buffers.accessor(index, f"{where}.samplers[{at}].{key}")
    for at, channel in enumerate(animation.channels):
        use, (node, path) = f"{where}.channels[{at}]", (channel.target.node, channel.target.path)
        check_index(reading, channel.sampler, animation.samplers, f"{use}.sampler", "samplers")
        check_index(reading, node, gltf.nodes, f"{use}.target.node", "nodes")
        if path not in _SHAPES or node < 0:
            reading.warn("RG333", f"animated {path}", f"{use}: animations of '{path}' are left out")
            continue
        if (node, path) in animated:
            raise reading.error("RG304", f"{use}: nodes[{node}].{path} is animated twice")
        animated.add((node, path))
        if gltf.nodes[node].matrix and path != "weights":
            raise reading.error("RG304", f"{use}: nodes[{node}] has a 'matrix', so its {path} cannot be animated")
        sampler, place = animation.samplers[channel.sampler], f"{where}.samplers[{channel.sampler}]"
        buffers.check_use(sampler.input, f"{place}.input", ("SCALAR",), _FLOATS)
        times = buffers.floats(sampler.input)[:, 0].astype(np.float64)
        if times[0] < 0 or (np.diff(times) <= 0).any():
            raise reading.error("RG304", f"{place}.input: key times do not increase from 0 s on")
        kind, width = _SHAPES[path]
        components = _FLOATS if path in ("translation", "scale") else _NORMALIZED
        accessor = buffers.check_use(sampler.output, f"{place}.output", (kind,), components, normalized=True)
        width *= target_counts[node] if path == "weights" else 1
        is_cubic = sampler.interpolation == "CUBICSPLINE"
        rows = len(times) * (3 if is_cubic else 1) * (target_counts[node] if path == "weights" else 1)
        if accessor.count != rows or not rows:
            raise reading.error("RG304", f"{place}.output has {accessor.count} values, but {use} needs {rows}")
        values = buffers.floats(sampler.output).astype(np.float64).reshape(len(times), -1, width)
        if path == "rotation" and (~values[:, len(values[0]) // 2].any(axis=1)).any():
            raise reading.error("RG304", f"{place}.output has a quaternion of length zero")
        groups.setdefault((path, sampler.interpolation, times.tobytes(), width), []).append((node, values))
    tracks = []
    for (path, interpolation, times, _), channels in groups.items():
        values = np.stack([values for _, values in channels], axis=2)  # (k, 1 or 3, c, w)
        slopes = np.moveaxis(values[:, ::2], 1, 0) if interpolation == "CUBICSPLINE" else None
        middle = values[:, values.shape[1] // 2]
        # Keys of a cubic spline are not made unit length: its slopes belong to them as they are.
        middle = unit(middle) if path == "rotation" and slopes is None else middle
        nodes = np.array([node for node, _ in channels], np.int32)
        tracks.append(Track(path, nodes, np.frombuffer(times), middle, interpolation, slopes))
    return tracks
