"""Spatiotemporal variance-guided filtering."""

from __future__ import annotations

from typing import Any

from rendergraph.api import (
    Albedo,
    Depth,
    History,
    Input,
    Internal,
    Luminance,
    Node,
    Normal,
    Output,
    Radiance,
    Steps,
    Velocity,
    param,
    structural,
)
from rendergraph.api import Any as AnyTexel


class SVGF(Node):
    """Denoise a path-traced picture with few samples, guided by its own variance.

    Spatiotemporal variance-guided filtering (Schied et al. 2017). The light is divided by the albedo, so that textures
    stay sharp. Each pixel continues the mean of the previous frame's texels that showed the same surface, and the first
    two moments of its luminance, which give its variance; in the first frames, neighbours contribute to the variance.
    Then an à-trous filter averages texels of the same surface whose luminance differs by no more than the noise
    explains.

    The variance is that of the mean, so the filter fades as the noise does: a still picture converges to the mean of
    its samples. The original feeds the first pass of the filter back into the mean, which is smoother in motion, but
    would leave a bias in still pictures. With `samples_taken` the source may itself be a mean that continues while
    nothing changes, such as that of `path_traced`; the samples of each frame are recovered from it.
    """

    radiance = Input(Radiance, doc="The noisy picture; alpha is coverage.")
    samples_taken = Input(
        Luminance, optional=True, doc="Samples in each pixel of `radiance`. Unconnected: its frames are independent."
    )
    albedo = Input(Albedo, doc="Base colour of the surfaces.")
    depth = Input(Depth, doc="Window depth; positions come from it and its view.")
    normal = Input(Normal, doc="Unit normal, world space.")
    velocity = Input(Velocity, optional=True, doc="Motion vectors. Unconnected: only the camera moves.")
    instance = Input(
        AnyTexel, optional=True, doc="Number of the object in each pixel, which keeps objects in one plane apart."
    )
    denoised = Output(Radiance, format="rgba16f", size="radiance", doc="The smooth picture; the source for background.")
    variance = Output(
        Luminance, format="r32f", size="radiance", doc="Variance of the luminance over albedo before the filter."
    )
    mean = History(format="rgba32f", doc="Mean light over albedo, and the number of the object.")
    moments = History(format="rg32f", doc="Means of its luminance and squared luminance.")
    surfaces = History(format="rgba32f", doc="Normal times the number of frames; distance.")
    source = History(format="rgba32f", doc="The source, and its number of samples.")
    view_surfaces = Internal(format="rgba32f", size="depth", view="depth")
    odd = Internal(format="rgba16f", size="depth")
    even = Internal(format="rgba16f", size="depth")

    frames: int = param(default=16, min=1, max=256, doc="Frames that are averaged while anything moves.")
    frames_at_rest: int = param(default=4096, min=1, max=65536, doc="Frames that are averaged while nothing moves.")
    tolerance: float = param(
        default=0.02, min=1e-6, max=1, doc="How far from its plane a surface may lie, relative to its distance."
    )
    facing: float = param(default=0.9, min=-1, max=1, doc="Least cosine between a surface's normals in both frames.")
    luminance_tolerance: float = param(
        default=4.0, min=0, max=100, doc="Difference of luminance, in standard deviations, that has a weight of 1/e."
    )
    passes: int = structural(
        default=5,
        min=1,
        max=8,
        doc="Passes of the filter. The first reaches two texels, each further one twice as far.",
    )

    def record(self, steps: Steps) -> None:
        """Record the temporal mean, the variance and the filter."""
        reads: dict[str, Any] = {port.name: port for port in self.inputs().values() if steps.connected(port)}
        before: dict[str, Any] = {
            f"previous_{port.name}": port.previous for port in (self.mean, self.moments, self.surfaces, self.source)
        }
        after: dict[str, Any] = {port.name: port for port in (self.mean, self.moments, self.surfaces, self.source)}
        steps.fullscreen("svgf_mean.frag", out=after, label="mean", **reads, **before)
        size = steps.desc(self.view_surfaces).size
        steps.fullscreen(
            "surfaces.frag",
            out={"surfaces": self.view_surfaces},
            depth=self.depth,
            normal=self.normal,
            reduced_size=size,
        )
        shape: dict[str, Any] = {"surfaces": self.view_surfaces, "screen_size": size, "tolerance": self.tolerance}
        out: dict[str, Any] = {"filtered": self.even}
        if steps.used(self.variance):
            out["variance"] = self.variance
        steps.fullscreen(
            "svgf_variance.frag",
            out=out,
            mean=self.mean,
            moments=self.moments,
            counts=self.surfaces,
            label="variance",
            **shape,
        )
        source, other = self.even, self.odd
        for number in range(self.passes):
            is_last = number == self.passes - 1
            last: dict[str, Any] = {"albedo": self.albedo, "radiance": self.radiance} if is_last else {}
            steps.fullscreen(
                "svgf_atrous.frag",
                out={"denoised": self.denoised} if is_last else {"filtered": other},
                source=source,
                stride=1 << number,
                defines={"FINAL": 1} if is_last else {},
                **shape,
                **last,
            )
            source, other = other, source
