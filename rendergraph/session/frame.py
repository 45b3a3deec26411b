"""A rendered frame: arrays by output name, times, memory, and what a picture's metadata says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from rendergraph.errors import InputError, Problem, suggestion

if TYPE_CHECKING:
    from rendergraph.execute import FrameTimes


@dataclass(frozen=True)
class OutputInfo:
    """What an array's texels are.

    Attributes:
        name: the output's name, or the tap: `node.port`, with its part.
        semantic: the semantic's name, `stencil` where that was tapped.
        format: the texture format.
        kind: `texture2d`, `texture2d_array`, `texture_cube` or `buffer`.
        encoding: `linear`, `display` or None.
        channels: channel names as an EXR has them.
    """

    name: str
    semantic: str
    format: str
    kind: str
    encoding: str | None
    channels: tuple[str, ...]


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
        passes: per executed pass `node`, `type`, `gpu_ms`, `cpu_ms`, in order.
        frame_ms: median, min and max over the frames so far.
        memory: the plan's figures.
        culled: node to the reason why it did not run.
        metadata: what goes into a picture file.
        times: what each frame so far took, step by step.
        warnings: what was replaced in the scene's images.
    """

    number: int
    pipeline: str
    size: tuple[int, int]
    arrays: Mapping[str, npt.NDArray[Any]]
    infos: Mapping[str, OutputInfo]
    device: Mapping[str, object]
    passes: tuple[Mapping[str, object], ...]
    frame_ms: Mapping[str, float]
    memory: Mapping[str, object]
    culled: Mapping[str, str]
    metadata: Mapping[str, str] = field(default_factory=dict)
    times: tuple[FrameTimes, ...] = ()
    warnings: tuple[Problem, ...] = ()

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

    def as_json(self) -> dict[str, object]:
        """The fields of `run --json`, without the paths."""
        return {
            "pipeline": self.pipeline,
            "device": dict(self.device),
            "size": list(self.size),
            "passes": [dict(entry) for entry in self.passes],
            "frame_ms": dict(self.frame_ms),
            "memory": dict(self.memory),
            "culled": dict(self.culled),
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
