"""A rendered frame: arrays by output name, times, memory, and what a picture's metadata says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy.typing as npt
from msgspec import Struct

from rendergraph.errors import InputError, Place, Problem, suggestion

if TYPE_CHECKING:
    from rendergraph.execute import FrameTimes


class OutputInfo(Struct, frozen=True):
    """What an array's texels are.

    Attributes:
        name: the output's name, or the tap: `node.port`, with its part.
        port: `node.port`.
        semantic: the semantic's name, `stencil` where that was tapped.
        format: the texture format.
        kind: `texture2d`, `texture2d_array`, `texture_cube` or `buffer`.
        encoding: `linear`, `display` or None.
        channels: channel names as an EXR has them.
    """

    name: str
    port: str
    semantic: str
    format: str
    kind: str
    encoding: str | None
    channels: tuple[str, ...]


def not_finite(pixels: npt.NDArray[Any], semantic: str) -> int:
    """How many pixels hold NaN or infinity; a depth may be infinite, where nothing is.

    Args:
        pixels: (…, channels), as it was read back; whole numbers are finite.
        semantic: what the texels mean.
    """
    import numpy as np  # a session is imported without it

    if pixels.dtype.kind != "f":
        return 0
    sound = ~np.isnan(pixels) if semantic in ("depth", "linear_depth") else np.isfinite(pixels)
    return 0 if sound.all() else int((~sound).any(axis=-1).sum())


def not_finite_warning(drawn: str, name: str, port: str, pixels: npt.NDArray[Any], semantic: str) -> Problem | None:
    """What is to be said of a picture that holds NaN or infinity, None of others.

    Args:
        drawn: the pipeline's name, or the variant's.
        name: the output's.
        port: the node and port it shows.
        pixels, semantic: as `not_finite` takes them.
    """
    count = not_finite(pixels, semantic)
    if not count:
        return None
    shown = f"'{name}'" + (f" ({port})" if port != name else "")
    of = pixels.size // pixels.shape[-1]
    text = f"{count} of {of} pixels of {shown} are NaN or infinite; run … --tap-all FOLDER shows where they begin"
    return Problem("RG619", text, Place(drawn), severity="warning")


def figures_of(arrays: Mapping[str, npt.NDArray[Any]]) -> dict[str, float | list[float]]:
    """Of a run's outputs those that are one texel, each as a number, or as one a channel."""
    found: dict[str, float | list[float]] = {}
    for name, array in arrays.items():
        if array.shape[:-1] == (1, 1):
            values = [value / 255 if array.dtype == "uint8" else value for value in array.ravel().tolist()]
            found[name] = values[0] if len(values) == 1 else values
    return found


@dataclass(frozen=True, eq=False)
class Frame(Mapping[str, npt.NDArray[Any]]):
    """What was drawn; `frame["image"]` is an array with the top row first.

    Arrays are (height, width, channels), with layers before where a texture has them: uint8 for 8-bit formats,
    float32 for all other colours and depth, 32-bit integers for integer formats.

    Attributes:
        number: frame number, from 1.
        pipeline: the pipeline's name.
        size: width and height.
        device: what drew it.
        types: the nodes that draw and their types, in order.
        memory: the plan's figures.
        culled: node to the reason why it did not run.
        metadata: what goes into a picture file.
        times: what each frame so far took, step by step where that was measured.
        warnings: what was replaced in the scene's images.
    """

    number: int
    pipeline: str
    size: tuple[int, int]
    arrays: Mapping[str, npt.NDArray[Any]]
    infos: Mapping[str, OutputInfo]
    device: Mapping[str, object]
    types: Mapping[str, str]
    memory: Mapping[str, object]
    culled: Mapping[str, str]
    metadata: Mapping[str, str] = field(default_factory=dict)
    times: tuple[FrameTimes, ...] = ()
    warnings: tuple[Problem, ...] = ()

    def __repr__(self) -> str:
        width, height = self.size
        return f"<Frame {self.number} of {self.pipeline}, {width}×{height}: {', '.join(self.arrays)}>"

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        if name not in self.arrays:
            raise KeyError(f"no output '{name}'{suggestion(name, self.arrays)}")
        return self.arrays[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.arrays)

    def __len__(self) -> int:
        return len(self.arrays)

    def info(self, name: str) -> OutputInfo:
        """What an output's texels are."""
        return self.infos[name]

    @property
    def figures(self) -> Mapping[str, float | list[float]]:
        """The outputs that are one texel, each as a number, or as one a channel."""
        return figures_of(self.arrays)

    @cached_property
    def passes(self) -> tuple[Mapping[str, object], ...]:
        """Per executed pass `node`, `type`, `gpu_ms`, `cpu_ms`, in order; without times where none were measured."""
        from rendergraph.execute import median_times

        medians = {time.node: time for time in median_times(self.times)}
        return tuple(
            {
                "node": node,
                "type": self.types[node],
                "gpu_ms": medians[node].gpu_ms if medians else None,
                "cpu_ms": medians[node].cpu_ms if medians else None,
            }
            for node in medians or dict.fromkeys(self.types)
        )

    @cached_property
    def frame_ms(self) -> Mapping[str, float]:
        """Median, least and most over the frames so far."""
        from rendergraph.execute import summary

        return summary([time.frame_ms for time in self.times])

    @cached_property
    def unsound(self) -> Mapping[str, Problem]:
        """Of each output that holds NaN or infinity, what is to be said."""
        return {
            name: problem
            for name, array in self.arrays.items()
            if (
                problem := not_finite_warning(
                    self.pipeline, name, self.infos[name].port, array, self.infos[name].semantic
                )
            )
        }

    def as_json(self) -> dict[str, object]:
        """The fields of `run --json`, without the paths."""
        return {
            "pipeline": self.pipeline,
            "device": dict(self.device),
            "size": list(self.size),
            "passes": [dict(entry) for entry in self.passes],
            "frame_ms": dict(self.frame_ms),
            "steps_run": [times.ran for times in self.times],
            "memory": dict(self.memory),
            "culled": dict(self.culled),
            "figures": dict(self.figures),
        }

    def save(self, path: str | Path, name: str | None = None) -> Path:
        """Write an output; the extension chooses the format and, without a name, the output.

        Raises:
            UsageError: pictures are not written with that extension.
            InputError: there is no such output, or the folder cannot be written to.
            RenderError: the file cannot be written, or its format cannot hold the texture.
        """
        from rendergraph.images import output_for, save_output

        path = Path(path)
        chosen = name or output_for(path, self.arrays)
        if chosen not in self.arrays:
            raise InputError(Problem("RG205", f"no output '{chosen}' to write{suggestion(chosen, self.arrays)}"))
        save_output(path, self.arrays[chosen], self.infos[chosen], self.metadata)
        return path

    def _repr_png_(self) -> bytes:
        import tempfile

        with tempfile.TemporaryDirectory() as folder:
            return self.save(Path(folder) / "frame.png").read_bytes()
