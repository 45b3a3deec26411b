"""Image error metrics: RMSE, PSNR, SSIM and FLIP.

| metric | on display-referred pictures | on scene-linear ones |
|---|---|---|
| RMSE | of the sRGB-encoded values 0…1, over pixels and channels | of the linear values |
| PSNR | −20 log10 RMSE in dB, peak 1; None if the pictures are equal | the same |
| SSIM | of the encoded values, the mean of R, G and B | of the values clipped to 0…1 and encoded |
| FLIP | LDR-FLIP, the mean over pixels | HDR-FLIP, exposures from the reference |

Light also has a relative mean square error (`relative_mse`), which weights differences in dark and bright parts of the
picture equally.

For other textures, such as occlusion or depth (`values`), RMSE applies to the values; the other metrics map the
reference's minimum and maximum to 0…1 if they lie outside.

Alpha is ignored. SSIM is Wang et al., "Image Quality Assessment", 2004: an 11×11 Gaussian window of standard
deviation 1.5, K1 = 0.01, K2 = 0.03. FLIP is Andersson et al., "FLIP: A Difference Evaluator for Alternating Images",
2020, and "Visualizing Errors in Rendered High Dynamic Range Images", 2021, as OpenImageIO computes them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from rendergraph.declare import Added
from rendergraph.declare.extensions import Metric
from rendergraph.errors import InputError, Place, Problem, shown_file
from rendergraph.images import from_srgb, to_srgb
from rendergraph.installed import version

Pixels: TypeAlias = npt.NDArray[Any]
Floats: TypeAlias = npt.NDArray[np.float64]
Encoding: TypeAlias = Literal["display", "linear", "values"]

PIXELS_PER_DEGREE = 67.0206
"""FLIP's default viewing conditions: 0.7 m from a screen 0.7 m wide with 3840 pixels."""
RELATIVE_EPSILON = 0.01
"""Added to the squared light in the denominator of the relative error, so that black pixels do not dominate."""
_WINDOW = 11
_SIGMA = 1.5


@dataclass(frozen=True)
class Metrics:
    """The four metrics of a pair; equal pictures have 0, None, 1 and 0. Plugins' metrics are by name."""

    rmse: float
    psnr: float | None
    ssim: float
    flip: float
    plugins: Mapping[str, float] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        plugins = {"plugin_metrics": dict(self.plugins)} if self.plugins else {}
        return {"rmse": self.rmse, "psnr": self.psnr, "ssim": self.ssim, "flip": self.flip, **plugins}


SAME = Metrics(0.0, None, 1.0, 0.0)
"""A picture against itself."""


def measure(
    image: Pixels,
    reference: Pixels,
    *,
    encoding: Encoding = "display",
    names: tuple[str, str] = ("the picture", "the reference"),
    plugins: Sequence[Added[Metric]] = (),
) -> tuple[Metrics, Pixels]:
    """Return the metrics of a picture against a reference, and FLIP at each pixel: (height, width), 0…1.

    The pictures are (height, width, channels): uint8 or 0…1 for `display`, linear light for `linear`, any values for
    `values`. The metrics are NaN if a picture contains NaN or infinity.

    Raises:
        InputError: the sizes differ, or a plugin's metric fails.
    """
    a, b = _values(image, reference) if encoding == "values" else (colors(image), colors(reference))
    check_sizes(a, b, names)
    more = {metric.name: _figure(metric, a, b, names) for metric in plugins}
    error = rmse(a, b)
    shown: tuple[Pixels, Pixels] = (_unit(a, b), _unit(b, b)) if encoding == "values" else (a, b)
    map_ = flip(*shown, encoding=encoding)
    if not math.isfinite(error):  # FLIP and SSIM clip their inputs, which would hide NaN and infinity
        return Metrics(math.nan, math.nan, math.nan, math.nan, more), map_
    if encoding == "linear":
        shown = (to_srgb(a), to_srgb(b))
    peaked = rmse(*shown) if encoding == "values" else error
    return Metrics(error, psnr(peaked), ssim(*shown), float(map_.mean(dtype=np.float64)), more), map_


def same(pixels: Pixels, plugins: Sequence[Added[Metric]] = ()) -> Metrics:
    """Return the metrics of a picture against itself; those of plugins are computed."""
    own = colors(pixels)
    return replace(SAME, plugins={one.name: _figure(one, own, own, ("a picture", "itself")) for one in plugins})


def _figure(metric: Added[Metric], a: Floats, b: Floats, names: tuple[str, str]) -> float:
    """Return a plugin's metric; it gets copies, so that it cannot change the pictures."""
    what = f"metric '{metric.name}' of '{names[0]}' against '{names[1]}'"
    value = metric.run("RG497", f"{what} cannot be computed", a.copy(), b.copy())
    try:
        return float(value)
    except (TypeError, ValueError):
        text = f"{what} cannot be computed: plugin '{metric.plugin}' returned {type(value).__name__}, not a number"
        raise InputError(Problem("RG498", text, Place(shown_file(metric.file)))) from None


def check_sizes(a: Pixels, b: Pixels, names: tuple[str, str]) -> None:
    if a.shape[:2] != b.shape[:2]:
        sizes = [f"'{name}' has {p.shape[1]}×{p.shape[0]} pixels" for name, p in zip(names, (a, b), strict=True)]
        text = f"{sizes[0]}, but {sizes[1]}; render both at one size: --size {b.shape[1]}x{b.shape[0]}"
        raise InputError(Problem("RG520", text))


def colors(pixels: Pixels) -> Floats:
    """Return R, G and B as floats, 8-bit and 16-bit integers as 0…1; grey becomes three equal channels."""
    shaped = pixels[..., np.newaxis] if pixels.ndim == 2 else pixels
    shaped = shaped[..., :3] if shaped.shape[-1] >= 3 else np.repeat(shaped[..., :1], 3, axis=-1)
    scale = np.iinfo(shaped.dtype).max if np.issubdtype(shaped.dtype, np.unsignedinteger) else 1
    return shaped.astype(np.float64) / scale


def _values(*pixels: Pixels) -> tuple[Floats, ...]:
    """Return the channels that all pictures have, without alpha, as floats; 8-bit and 16-bit integers as 0…1."""
    shaped = [each[..., np.newaxis] if each.ndim == 2 else each for each in pixels]
    count = min(3, *(each.shape[-1] for each in shaped))
    scales = [np.iinfo(each.dtype).max if each.dtype in (np.uint8, np.uint16) else 1 for each in shaped]
    return tuple(each[..., :count].astype(np.float64) / scale for each, scale in zip(shaped, scales, strict=True))


def _unit(values: Floats, reference: Floats) -> Floats:
    """Return values as a picture of 0…1; if the reference's exceed that, map its minimum and maximum to 0…1."""
    known = reference[np.isfinite(reference)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    if low < 0 or high > 1:
        values = (values - low) / max(high - low, 1e-12)
    more = [(0, 0), (0, 0), (0, 3 - values.shape[-1])]
    return np.pad(np.clip(values, 0.0, 1.0), more, mode="edge" if values.shape[-1] == 1 else "constant")


def rmse(a: Pixels, b: Pixels) -> float:
    """Return the root mean square difference over pixels and channels; NaN if a value is NaN or infinite."""
    with np.errstate(invalid="ignore"):  # infinity against infinity
        error = float(np.mean(np.square(a.astype(np.float64) - b)))
    return math.sqrt(error) if math.isfinite(error) else math.nan


def relative_mse(light: Pixels, reference: Pixels) -> float:
    """Return the mean over pixels and channels of (a − r)² / (r² + 0.01); NaN if a value is NaN or infinite.

    Rousselle et al., "Adaptive Sampling and Reconstruction using Greedy Error Minimization", 2011.

    Args:
        light: a, scene-linear light, (height, width, channels).
        reference: r, of the same size.
    """
    a, r = colors(light), colors(reference)
    return relative_noise(np.square(a - r), r)


def relative_noise(variance: Pixels, reference: Pixels) -> float:
    """Return the relative mean square error of light due to its own variance: the mean of v / (r² + 0.01).

    Args:
        variance: v, variance of the mean in each pixel, (height, width, channels); one channel applies to all.
        reference: r, the light.
    """
    with np.errstate(invalid="ignore", over="ignore"):  # infinity against infinity
        error = float(np.mean(colors(variance) / (np.square(colors(reference)) + RELATIVE_EPSILON)))
    return error if math.isfinite(error) else math.nan


def signed_difference(light: Pixels, reference: Pixels) -> Floats:
    """Return how much too bright each pixel is, (height, width): 0 is equal, −1 black instead of light.

    It is the difference of luminances (Rec. 709) divided by the greater one plus a hundredth of the reference's mean
    luminance, so that the darkest parts do not show only noise.
    """
    a, r = (colors(each) @ (0.2126, 0.7152, 0.0722) for each in (light, reference))
    known = r[np.isfinite(r)]
    floor = 0.01 * float(known.mean()) if known.size else 0.0
    with np.errstate(invalid="ignore"):
        return np.asarray((a - r) / (np.maximum(a, r) + max(floor, 1e-9)))


def psnr(error: float) -> float | None:
    """Return the peak signal-to-noise ratio in dB of an RMSE whose peak is 1; None for an RMSE of 0."""
    return -20.0 * math.log10(error) if error > 0 else None


def ssim(a: Pixels, b: Pixels) -> float:
    """Return the mean structural similarity of two pictures of values 0…1, in windows inside the picture.

    Pictures with a side under 11 pixels are padded by reflection.
    """
    if min(a.shape[:2]) < _WINDOW:
        padding = [(_WINDOW // 2,) * 2] * 2 + [(0, 0)]
        a, b = (np.pad(x, padding, mode="symmetric") for x in (a, b))
    return float(np.mean([_ssim(a[..., channel], b[..., channel]) for channel in range(a.shape[-1])]))


def _ssim(a: Floats, b: Floats) -> float:
    mean_a, mean_b = _windowed(a), _windowed(b)
    var_a, var_b = _windowed(a * a) - mean_a**2, _windowed(b * b) - mean_b**2
    covariance = _windowed(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    likeness = (2 * mean_a * mean_b + c1) * (2 * covariance + c2)
    return float(np.mean(likeness / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2))))


def _windowed(x: Floats) -> Floats:
    weights = np.exp(-0.5 * np.square((np.arange(_WINDOW) - _WINDOW // 2) / _SIGMA))
    for axis in (0, 1):
        parts = np.lib.stride_tricks.sliding_window_view(x, _WINDOW, axis)
        x = parts @ (weights / weights.sum())
    return x


def flip(a: Pixels, b: Pixels, *, encoding: Encoding = "display") -> npt.NDArray[np.float32]:
    """Return FLIP at each pixel, 0…1; `b` is the reference.

    OpenImageIO expects linear light for both variants, so display values are decoded first. HDR-FLIP chooses exposures
    from the reference only; `maxluminance` 0 computes the same as the authors' program. A reference without light gives
    no exposures; light is then clipped to 0…1, as a display without exposure would show it.
    """
    import OpenImageIO as oiio  # only for this metric

    hdr = encoding == "linear" and bool(np.any(np.nan_to_num(b) > 0))
    if np.array_equal(a, b) and np.isfinite(a).all():
        return np.zeros(a.shape[:2], np.float32)
    if encoding != "linear":
        a, b = from_srgb(a), from_srgb(b)
    elif not hdr:
        a, b = np.clip(a, 0, 1), np.clip(b, 0, 1)
    single = (np.ascontiguousarray(x, np.float32) for x in (a, b))
    test, reference = (oiio.ImageBuf(np.nan_to_num(x, nan=0.0, posinf=65504.0, neginf=0.0)) for x in single)
    most = 0.0 if hdr else 2.0
    result = oiio.ImageBufAlgo.FLIP_diff(reference, test, hdr=int(hdr), maxluminance=most, ppd=PIXELS_PER_DEGREE)
    if result.has_error:
        raise RuntimeError(f"FLIP cannot be computed: {result.geterror()}")
    return np.asarray(result.get_pixels(oiio.FLOAT), np.float32)[..., 0]


def description() -> dict[str, Any]:
    """Return versions and parameters of the metrics, for results that outlive the program."""
    return {
        "rmse": {"on": "sRGB-encoded R, G, B, 0…1; linear values for scene-linear references"},
        "psnr": {"peak": 1.0},
        "relative_mse": {"on": "linear R, G, B of the light", "epsilon": RELATIVE_EPSILON},
        "ssim": {"window": _WINDOW, "sigma": _SIGMA, "k1": 0.01, "k2": 0.03, "channels": "mean of R, G, B"},
        "flip": {
            "library": f"OpenImageIO {version('OpenImageIO')}",
            "pixels_per_degree": PIXELS_PER_DEGREE,
            "hdr_max_luminance": 0.0,
            "mean": "over pixels",
        },
    }
