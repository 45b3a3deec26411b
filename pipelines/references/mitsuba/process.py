"""Mitsuba in a process of its own, as its LLVM and that of a software rasteriser do not get on in one."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec import Struct
from rendergraph.pipelines.references.mitsuba.convert import camera_values, scene_values
from rendergraph.pipelines.references.mitsuba.installation import require

from rendergraph.errors import Problem, RenderError
from rendergraph.images import decode as decode_file
from rendergraph.images import decode_light, from_srgb
from rendergraph.scene.facts import Decode
from rendergraph.scene.model import ImageSource, MadeImage, Scene, SceneLimits
from rendergraph.steps import ViewMatrices


class Traced(Struct, frozen=True, eq=False):
    """A traced picture, top row first.

    Attributes:
        radiance: scene-linear, float32 (height, width, 3).
        variance: of `radiance`, which is a mean of samples, estimated from them; the same shape.
    """

    radiance: npt.NDArray[np.float32]
    variance: npt.NDArray[np.float32]


class Tracer:
    """Traces paths through a scene with Mitsuba, in a process that lives as long as this object.

    Args:
        bounces: 0 for light that reaches what the camera sees directly.
        shared: diffuse reflection is multiplied by 1 - F of the dielectric (glTF 2.0, appendix B).
        ambient: constant radiance from all sides that the camera does not see, for scenes without an environment.
        shadows: False lets punctual lights through everything.
        jitter: samples fill the pixel; False takes all in its middle.
        decode: of the scene's textures; it is needed where some are generated.

    Raises:
        UsageError: Mitsuba or a usable LLVM is not installed.
        InputError: an image of the scene cannot be read.
    """

    def __init__(
        self,
        scene: Scene,
        view: ViewMatrices,
        *,
        bounces: int = 4,
        seed: int = 0,
        shared: bool = False,
        ambient: Sequence[float] = (0.0, 0.0, 0.0),
        shadows: bool = True,
        jitter: bool = True,
        limits: SceneLimits = SceneLimits(),
        decode: Decode | None = None,
    ) -> None:
        llvm = require()

        def texels(image: ImageSource | MadeImage, srgb: bool) -> npt.NDArray[np.float16]:
            if scene.environment is not None and image is scene.environment.image:
                return linear(decode_light(image, limits=limits), False)
            assert isinstance(image, ImageSource)  # only environments are generated
            found = decode(image, srgb) if decode else decode_file(image, srgb=srgb, limits=limits)
            return linear(found, srgb)

        request, arrays = scene_values(scene, texels)
        request |= {"camera": camera_values(view), "bounces": bounces, "seed": seed}
        request |= {"shared": shared, "shadows": shadows, "jitter": jitter}
        request["ambient"] = list(ambient) if any(ambient) else None
        folder = tempfile.TemporaryDirectory(prefix="rendergraph-")
        self._folder = Path(folder.name)
        (self._folder / "request.json").write_text(json.dumps(request))
        np.savez(self._folder / "arrays.npz", allow_pickle=False, **arrays)
        with open(self._folder / "errors", "w") as errors:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "rendergraph.pipelines.references.mitsuba.render", folder.name],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                env=os.environ | llvm,
            )
        self.close = weakref.finalize(self, _close, self._process, folder)

    def trace(self, samples: int) -> Traced:
        """Return the picture when each pixel has this many samples in all; a second call continues the first.

        Raises:
            RenderError: Mitsuba failed.
        """
        ask, answer = self._process.stdin, self._process.stdout
        assert ask is not None
        assert answer is not None
        with contextlib.suppress(BrokenPipeError):  # the next line says why
            print(samples, file=ask, flush=True)
        if not answer.readline():
            raise RenderError([Problem("RG622", f"Mitsuba {self._end()}")])
        with np.load(self._folder / "result.npz") as result:
            return Traced(result["radiance"], result["variance"])

    def _end(self) -> str:
        status = self._process.wait()
        lines = (self._folder / "errors").read_text(errors="replace").strip().splitlines()
        last = lines[-1][:300] if lines else "it gave no reason"
        return f"crashed ({signal.Signals(-status).name}): {last}" if status < 0 else f"failed: {last}"


def _close(process: subprocess.Popen[str], folder: tempfile.TemporaryDirectory[str]) -> None:
    with process:
        process.kill()
    folder.cleanup()


def linear(pixels: npt.NDArray[Any], srgb: bool) -> npt.NDArray[np.float16]:
    """Return the values of decoded texels, which are bytes, encoded or not, or linear already."""
    if pixels.dtype != np.uint8:
        return pixels.astype(np.float16)
    values = pixels / np.float32(255)
    if srgb:
        values[..., :3] = from_srgb(pixels[..., :3])
    return values.astype(np.float16)
