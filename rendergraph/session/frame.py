"""A rendered frame: arrays by output name, times, memory, and the metadata of its pictures."""

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
    from rendergraph.images import Shown


class OutputInfo(Struct, frozen=True):
    """The meaning of an array's texels.

    Attributes:
        name: the output's name, or the tap: `node.port`, with its part.
        port: `node.port`.
        semantic: the semantic's name; `stencil` if that was tapped.
        format: the texture format.
        kind: a texture kind or `buffer`.
        encoding: `linear`, `display` or None.
        channels: channel names, as in an EXR file.
        transparent: whether alpha belongs to a display colour, which is multiplied by it.
    """

    name: str
    port: str
    semantic: str
    format: str
    kind: str
    encoding: str | None
    channels: tuple[str, ...]
    transparent: bool = False


def not_finite(pixels: npt.NDArray[Any], semantic: str) -> int:
    """Return how many of (…, channels) pixels hold NaN or infinity; a depth is infinite where there is no surface."""
    import numpy as np  # a session is imported without it

    if pixels.dtype.kind != "f":
        return 0
    sound = ~np.isnan(pixels) if semantic in ("depth", "linear_depth") else np.isfinite(pixels)
    return 0 if sound.all() else int((~sound).any(axis=-1).sum())


def drawn_as_nan(pixels: npt.NDArray[Any], semantic: str) -> int:
    """Return the number of 8-bit display colours that are magenta, as output transforms write NaN."""
    import numpy as np  # a session is imported without it

    if pixels.dtype != np.uint8 or semantic != "display_color" or pixels.shape[-1] != 4:
        return 0
    return int((pixels.view("<u4") == 0xFFFF00FF).sum())


def figures_of(arrays: Mapping[str, npt.NDArray[Any]]) -> dict[str, float | list[float]]:
    """Return the outputs of one texel, each as a number, or as a list of its channels."""
    found: dict[str, float | list[float]] = {}
    for name, array in arrays.items():
        if array.shape[:-1] == (1, 1):
            values = [value / 255 if array.dtype == "uint8" else value for value in array.ravel().tolist()]
            found[name] = values[0] if len(values) == 1 else values
    return found


_BLACK, _CLIPPED = 5, 254
"""Of 255: the highest mean of a picture that is almost black, and the lowest value of a clipped channel."""


@dataclass(frozen=True, eq=False)
class Frame(Mapping[str, npt.NDArray[Any]]):
    """A rendered frame; `frame["image"]` is an array with the top row first.

    Arrays are (height, width, channels), preceded by layers if the texture has several, and without the last axis if it
    has one channel: uint8 for 8-bit formats, float32 for all other colours and depth, 32-bit integers for integer
    formats.

    Attributes:
        number: frame number, from 1.
        pipeline: the pipeline's name.
        size: width and height.
        arrays: the same with all axes, also those of one layer or one channel.
        device: the GL device.
        types: the rendering nodes and their types, in order.
        memory: the plan's figures.
        culled: node to the reason why it did not run.
        metadata: of its picture files.
        times: of each frame so far, step by step if steps were timed.
        warnings: about images of the scene.
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
        array = self._array(name)
        if array.ndim == 4 and len(array) == 1:
            array = array[0]
        return array[..., 0] if array.ndim >= 3 and array.shape[-1] == 1 else array

    def _array(self, name: str) -> npt.NDArray[Any]:
        if name not in self.arrays:
            raise KeyError(f"no output '{name}'{suggestion(name, self.arrays)}; render(taps=['NODE.PORT']) adds ports")
        return self.arrays[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.arrays)

    def __len__(self) -> int:
        return len(self.arrays)

    def info(self, name: str) -> OutputInfo:
        """Return the meaning of an output's texels."""
        return self.infos[name]

    @property
    def figures(self) -> Mapping[str, float | list[float]]:
        """The outputs of one texel, each as a number, or as a list of its channels."""
        return figures_of(self.arrays)

    @cached_property
    def passes(self) -> tuple[Mapping[str, object], ...]:
        """Each executed pass, in order: `node`, `type`, `gpu_ms`, `cpu_ms`; the times may be None."""
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
        """Median, minimum and maximum over the frames so far."""
        from rendergraph.execute import summary

        return summary([time.frame_ms for time in self.times])

    @cached_property
    def unsound(self) -> Mapping[str, Problem]:
        """A warning for each output that holds NaN or infinity, or has 8 bits and shows the colour of NaN."""
        warnings = {}
        for name, array in self.arrays.items():
            semantic, port = self.infos[name].semantic, self.infos[name].port
            if count := not_finite(array, semantic) or drawn_as_nan(array, semantic):
                text = f"{count} of {array.size // array.shape[-1]} pixels of '{name}'"
                text += f"{'' if port == name else f' ({port})'} are NaN or infinite"
                text += " (drawn in magenta)" if array.dtype == "uint8" else ""
                warnings[name] = Problem("RG619", text, Place(self.pipeline), severity="warning")
        return warnings

    @cached_property
    def badly_exposed(self) -> Mapping[str, str]:
        """Pictures for the display that are almost black, or for the most part clipped: their names, and which."""
        found = {}
        for name, array in self.arrays.items():
            if self.infos[name].semantic != "display_color" or array.dtype != "uint8" or array.shape[-1] < 3:
                continue
            colors = array[array[..., 3] == 255, :3] if self.infos[name].transparent else array[..., :3]
            if not colors.size:
                continue
            if colors.mean() < _BLACK:
                found[name] = "almost black"
            elif (colors.max(axis=-1) >= _CLIPPED).mean() > 0.5:
                found[name] = "clipped in more than half of its pixels"
        return found

    def as_json(self) -> dict[str, object]:
        """Return the fields of `run --json`, without the paths."""
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
            UsageError: pictures cannot have that extension.
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

    def show(
        self,
        name: str,
        *,
        layer: int | None = None,
        channel: int | None = None,
        low: float | None = None,
        high: float | None = None,
    ) -> Shown:
        """Return a picture of a texture for notebooks: values in false colours, with their scale.

        Args:
            name: of an output or a tap: `render(taps=["sun.shadow_map"]).show("sun.shadow_map", layer=0)`.
            layer, channel: the part of the texture, where it has several.
            low, high: the values of the darkest and brightest colour; the least and the greatest by default.
        """
        from rendergraph.images import shown

        return shown(self._array(name), name, self.infos[name], layer, channel, low, high)

    def _repr_png_(self) -> bytes:
        from rendergraph.images import Saved, encoded, output_for

        path = Path("frame.png")
        name = output_for(path, self.arrays)
        return encoded(Saved(path, self.arrays[name], self.infos[name]), self.metadata)
