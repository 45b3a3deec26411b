"""Textures with immutable storage, texture views, transfers, clears and samplers.

Views need immutable storage. Samplers are separate objects, because readers of one texture may need different ones and
aliased textures would otherwise share filter state.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import Struct
from msgspec.structs import replace

from rendergraph.errors import Problem, RenderError
from rendergraph.gl.device import Device
from rendergraph.textures import FORMATS, Sampler, TextureDesc

ClearValue: TypeAlias = float | tuple[float, ...]

MOST_READ = 1 << 30  # bytes read back at once

_TARGETS = {"texture2d": 0x0DE1, "texture2d_array": 0x8C1A, "texture3d": 0x806F, "texture_cube": 0x8513}
_MULTISAMPLE_TARGETS = {"texture2d": 0x9100, "texture2d_array": 0x9102}
_CHANNELS = {1: 0x1903, 2: 0x8227, 3: 0x1907, 4: 0x1908}
_INTEGER_CHANNELS = {1: 0x8D94, 2: 0x8228, 4: 0x8D99}
_FLOAT, _UINT, _INT, _UBYTE = 0x1406, 0x1405, 0x1404, 0x1401
_DEPTH_COMPONENT, _DEPTH_STENCIL, _FLOAT_32_UNSIGNED_INT_24_8_REV = 0x1902, 0x84F9, 0x8DAD
_WRITE_ONLY, _FETCHED_OR_STORED = 0x88B9, 0x28


class GpuTexture(Struct, frozen=True):
    """A GL texture name with its description."""

    glo: int
    target: int
    desc: TextureDesc


def target_of(desc: TextureDesc) -> int:
    return _MULTISAMPLE_TARGETS[desc.kind] if desc.samples > 1 else _TARGETS[desc.kind]


def create(device: Device, desc: TextureDesc, label: str = "", *, memory: int | None = None) -> GpuTexture:
    """Allocate a texture, in its own memory or at the beginning of a memory object; `label` is its name in errors."""
    raw = device.raw
    raw.error()
    target, gl_format = target_of(desc), FORMATS[desc.format].gl
    glo = raw.make("glCreateTextures", target)
    layered = desc.kind in ("texture2d_array", "texture3d")
    size = (desc.width, desc.height, *((desc.layers,) if layered else ()))
    store = "glTextureStorage" + ("Mem" if memory is not None else "") + ("3D" if layered else "2D")
    at = (memory, 0) if memory is not None else ()
    if desc.samples > 1:
        store += "Multisample"
        arguments = (desc.samples, gl_format, *size, 1, *at)
    else:
        arguments = (desc.mips, gl_format, *size, *at)
    getattr(raw, store + ("EXT" if memory is not None else ""))(glo, *arguments)
    error = raw.error()
    if error:
        raw.delete("glDeleteTextures", glo)
        text = f"the driver could not allocate {label or 'a texture'}: {desc.width}x{desc.height} {desc.format}, "
        text += f"{desc.layers} layers, {desc.samples} samples, {desc.bytes / 2**20:.0f} MiB ({error})"
        raise RenderError(Problem("RG612", text))
    device.textures_made += 1
    return GpuTexture(glo, target, desc)


def view(
    device: Device, texture: GpuTexture, *, format: str | None = None, mip: int | None = None, layer: int | None = None
) -> GpuTexture:
    """Return a view of a texture in another format of its texel class, or of one mip or layer as a 2D texture."""
    desc = texture.desc
    kind, layers = (desc.kind, desc.mip_layers(mip or 0)) if layer is None else ("texture2d", 1)
    mips = desc.mips if mip is None else 1
    viewed = TextureDesc(kind, format or desc.format, *desc.mip_size(mip or 0), layers, mips, desc.samples)
    raw = device.raw
    glo = raw.make("glGenTextures")
    target = target_of(viewed)
    layers = 1 if viewed.kind == "texture3d" else max(1, viewed.layers)
    raw.glTextureView(glo, target, texture.glo, FORMATS[viewed.format].gl, mip or 0, viewed.mips, layer or 0, layers)
    error = raw.error()
    if error:
        raise RenderError(Problem("RG612", f"the driver refused a texture view of {desc} as {viewed} ({error})"))
    return GpuTexture(glo, target, viewed)


def delete(device: Device, texture: GpuTexture) -> None:
    """Free a texture; its storage lives until its last view is gone."""
    device.raw.delete("glDeleteTextures", texture.glo)


def copies(device: Device, source: GpuTexture, target: GpuTexture) -> list[Callable[[], object]]:
    """Return the calls that copy all texels of a texture to another with the same description."""
    return [
        partial(
            device.raw.glCopyImageSubData,
            *(source.glo, source.target, mip, 0, 0, 0),
            *(target.glo, target.target, mip, 0, 0, 0),
            *(*source.desc.mip_size(mip), source.desc.mip_layers(mip)),
        )
        for mip in range(source.desc.mips)
    ]


def transfer_format(format_name: str) -> tuple[int, int, Any, int]:
    """Return GL format, GL type, NumPy type and components for transfers."""
    fmt = FORMATS[format_name]
    if fmt.family == "depth":
        return _DEPTH_COMPONENT, _FLOAT, np.float32, 1
    if fmt.family == "depth_stencil":
        return _DEPTH_STENCIL, _FLOAT_32_UNSIGNED_INT_24_8_REV, np.float32, 2
    if fmt.family in ("uint", "int"):
        gl_type, integer = (_UINT, np.uint32) if fmt.family == "uint" else (_INT, np.int32)
        return _INTEGER_CHANNELS[fmt.components], gl_type, integer, fmt.components
    gl_type, number = (_UBYTE, np.uint8) if fmt.is_bytes else (_FLOAT, np.float32)
    return _CHANNELS[fmt.components], gl_type, number, fmt.components


def read(
    device: Device, texture: GpuTexture, *, mip: int = 0, layer: int | None = None, stencil: bool = False
) -> npt.NDArray[Any]:
    """Return texels as (layers, height, width, channels), top row first; `stencil` as 32-bit integers, not the depth.

    Samples are resolved: colours are averaged; depth, stencil and integers take one sample. `finish` comes first,
    because a software rasteriser has returned stale texels without it.
    """
    desc = texture.desc
    if desc.samples > 1:
        resolved = _resolved(device, texture)
        try:
            return read(device, resolved, layer=layer, stencil=stencil)
        finally:
            delete(device, resolved)
    first, layers = (0, desc.mip_layers(mip)) if layer is None else (layer, 1)
    width, height = desc.mip_size(mip)
    gl_format, gl_type, dtype, channels = transfer_format(desc.format)
    texels: npt.NDArray[Any] = np.empty((layers, height, width, channels), dtype)
    device.ctx.finish()
    device.raw.glPixelStorei(0x0D05, 1)
    for at, count, low, rows in _bands(layers, height, texels[0, 0].nbytes):
        into = texels[at : at + count, low : low + rows]
        box = (0, low, first + at, width, rows, count)
        device.raw.glGetTextureSubImage(texture.glo, mip, *box, gl_format, gl_type, into.nbytes, into.ctypes.data)
    error = device.raw.error()
    if error:
        raise RenderError(Problem("RG613", f"reading back a {desc.format} texture failed ({error})"))
    if FORMATS[desc.format].family == "depth_stencil":
        texels = texels[..., 1:].view(np.uint32) & 255 if stencil else texels[..., :1]
    if FORMATS[desc.format].srgb:  # drivers return the encoded bytes; the texels' values are linear
        code = np.arange(256) / 255
        linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4).astype(np.float32)
        colors, alpha = np.take(linear, texels[..., :3]), texels[..., 3:] / np.float32(255)
        texels = np.concatenate([colors, alpha], axis=-1)
    return texels[:, ::-1]


def _bands(layers: int, height: int, row: int) -> Iterator[tuple[int, int, int, int]]:
    """Yield first layer, layers, first row and rows of each read: OpenGL counts its bytes in 31 bits."""
    if layers * height * row <= MOST_READ:
        yield 0, layers, 0, height
        return
    rows = max(1, MOST_READ // row)
    for layer in range(layers):
        for low in range(0, height, rows):
            yield layer, 1, low, min(rows, height - low)


def attach(device: Device, framebuffer: int, point: int, texture: GpuTexture, mip: int, layer: int | None) -> None:
    """Attach one layer of a mip level to a framebuffer, or with None all of it."""
    if layer is None:
        device.raw.glNamedFramebufferTexture(framebuffer, point, texture.glo, mip)
    else:
        device.raw.glNamedFramebufferTextureLayer(framebuffer, point, texture.glo, mip, layer)


def _resolved(device: Device, texture: GpuTexture) -> GpuTexture:
    """Return a new texture with one sample per texel.

    The driver resolves it; for depth, stencil and integers it takes one sample of its choice.
    """
    raw, desc = device.raw, texture.desc
    made = create(device, replace(desc, samples=1), "a resolved texture")
    family, srgb = FORMATS[desc.format].family, FORMATS[desc.format].srgb
    point, mask = {"depth": (0x8D00, 0x100), "depth_stencil": (0x821A, 0x500)}.get(family, (0x8CE0, 0x4000))
    scissor, encoding = bool(raw.glIsEnabledi(0x0C11, 0)), bool(raw.glIsEnabled(0x8DB9))
    source, target = (raw.make("glCreateFramebuffers") for _ in range(2))
    try:
        raw.glDisablei(0x0C11, 0)
        (raw.glEnable if srgb else raw.glDisable)(0x8DB9)
        for layer in range(desc.layers):
            for framebuffer, attached in ((source, texture), (target, made)):
                attach(device, framebuffer, point, attached, 0, layer if desc.kind != "texture2d" else None)
            box = (0, 0, desc.width, desc.height)
            raw.glBlitNamedFramebuffer(source, target, *box, *box, mask, 0x2600)
    finally:
        (raw.glEnablei if scissor else raw.glDisablei)(0x0C11, 0)
        (raw.glEnable if encoding else raw.glDisable)(0x8DB9)
        raw.delete("glDeleteFramebuffers", source)
        raw.delete("glDeleteFramebuffers", target)
    return made


def upload(
    device: Device, texture: GpuTexture, texels: npt.NDArray[Any], *, mip: int = 0, layer: int | None = None
) -> None:
    """Write (layers, height, width, channels) or (height, width, channels) into one mip, rows in the order given."""
    desc = texture.desc
    width, height = desc.mip_size(mip)
    gl_format, gl_type, dtype, channels = transfer_format(desc.format)
    data = np.ascontiguousarray(texels, dtype)
    first, layers = (0, desc.mip_layers(mip)) if layer is None else (layer, 1)
    assert data.size == width * height * layers * channels, (data.shape, desc)
    device.raw.glPixelStorei(0x0CF5, 1)
    given = gl_format, gl_type, data.ctypes.data
    if desc.kind == "texture2d":
        device.raw.glTextureSubImage2D(texture.glo, mip, 0, 0, width, height, *given)
    else:
        device.raw.glTextureSubImage3D(texture.glo, mip, 0, 0, first, width, height, layers, *given)


def fill_mips(device: Device, texture: GpuTexture) -> None:
    """Fill the mip levels of a 2D float texture with exact means of the level above; uses texture and image unit 0.

    It uses a compute shader, because Mesa's software rasteriser recompiles its own program in each process, 0.1 to
    0.15 s per format, but caches programs of applications on disk. Byte textures are left to the driver, which is
    faster from a few million texels on.
    """
    if device.mips is None:
        device.mips = device.ctx.compute_shader(Path(__file__).with_name("fill_mips.comp").read_text(encoding="ascii"))
    desc, raw, program = texture.desc, device.raw, device.mips
    image_format = FORMATS[desc.format].gl
    raw.glBindTextureUnit(0, texture.glo)
    raw.glBindSampler(0, 0)
    for level in range(1, desc.mips):
        program["above"] = level - 1
        raw.glMemoryBarrier(_FETCHED_OR_STORED)
        raw.glBindImageTexture(0, texture.glo, level, 0, 0, _WRITE_ONLY, image_format)
        width, height = desc.mip_size(level)
        program.run((width + 7) // 8, (height + 7) // 8)
    raw.glMemoryBarrier(_FETCHED_OR_STORED)
    raw.glBindTextureUnit(0, 0)
    raw.glBindImageTexture(0, 0, 0, 0, 0, _WRITE_ONLY, image_format)


def texel(value: ClearValue, channels: int, dtype: Any) -> npt.NDArray[Any]:
    """Return a clear value for the channels of a format: one number fills them all, missing ones are 0."""
    given = np.atleast_1d(np.asarray(value, np.float64))[:channels]
    values = np.pad(given, (0, channels - len(given))) if len(given) > 1 else np.repeat(given, channels)
    if np.issubdtype(dtype, np.integer):
        limits = np.iinfo(dtype)
        values = np.clip(np.nan_to_num(values), limits.min, limits.max)
    return values.astype(dtype)


class Clear:
    """A clear of a texture, mip or layer, prepared once and called in every frame.

    The texture must not be a view in another format: Mesa stores wrong bits through some such views.
    """

    def __init__(
        self, device: Device, texture: GpuTexture, value: ClearValue, mip: int | None = None, layer: int | None = None
    ) -> None:
        desc = texture.desc
        gl_format, gl_type, dtype, channels = transfer_format(desc.format)
        if FORMATS[desc.format].srgb or (dtype is np.uint8):
            gl_type, dtype = _FLOAT, np.float32
        values = texel(value, channels, dtype)
        if FORMATS[desc.format].family == "depth_stencil":
            values[1:] = 0
        if FORMATS[desc.format].srgb:  # a clear stores its value unencoded, unlike a draw
            color = np.clip(values[:3], 0.0, 1.0)
            values[:3] = np.where(color <= 0.0031308, 12.92 * color, 1.055 * color ** (1 / 2.4) - 0.055)
        self._values = values  # kept alive: the calls below hold its address
        self._clear = device.raw.glClearTexSubImage
        self._calls = []
        for level in range(desc.mips) if mip is None else (mip,):
            first, count = (0, desc.mip_layers(level)) if layer is None else (layer, 1)
            box = (level, 0, 0, first, *desc.mip_size(level), count)
            self._calls.append((texture.glo, *box, gl_format, gl_type, values.ctypes.data))

    def __call__(self) -> None:
        for call in self._calls:
            self._clear(*call)


def poison_value(format_name: str) -> float:
    """Return a value that no picture should show: NaN, or the largest if the format has none."""
    family = FORMATS[format_name].family
    if family == "float" and format_name != "r11f_g11f_b10f":
        return float("nan")
    return {"uint": float(0x7FFFFFFF), "int": float(0x7FFFFFFF)}.get(family, 0.7319)


_FILTERS = {
    "nearest": 0x2600, "linear": 0x2601, "nearest_mipmap_nearest": 0x2700, "linear_mipmap_nearest": 0x2701,
    "nearest_mipmap_linear": 0x2702, "linear_mipmap_linear": 0x2703,
}  # fmt: skip
_WRAPS = {"clamp": 0x812F, "repeat": 0x2901, "mirror": 0x8370, "border": 0x812D}


def create_texel_buffer(device: Device, buffer: int, format: str) -> int:
    """Create a texture that fetches `rgba32f` or `rgba32i` from a buffer.

    Software rasterisers fetch texels in a third of the time of elements of a storage block.
    """
    texture = device.raw.make("glCreateTextures", 0x8C2A)
    device.raw.glTextureBuffer(texture, {"rgba32f": 0x8814, "rgba32i": 0x8D82}[format], buffer)
    return texture


def create_sampler(device: Device, sampler: Sampler) -> int:
    """Create a sampler; its border is by default 1 in every channel (lit), and 0 for comparisons."""
    filters = ("linear_mipmap_linear", "linear") if sampler.filter == "trilinear" else (sampler.filter, sampler.filter)
    glo = create_gl_sampler(device, *filters, sampler.wrap, sampler.wrap, sampler.anisotropy)
    border = float(not sampler.compare) if sampler.border is None else sampler.border
    device.raw.glSamplerParameterfv(glo, 0x1004, (ctypes.c_float * 4)(*texel(border, 4, np.float32)))
    if sampler.compare:
        device.raw.glSamplerParameteri(glo, 0x884C, 0x884E)  # COMPARE_MODE, COMPARE_REF_TO_TEXTURE
        device.raw.glSamplerParameteri(glo, 0x884D, 0x0206)  # COMPARE_FUNC, GEQUAL: 1 if not farther than the texel
    return glo


def create_gl_sampler(
    device: Device, min_filter: str, mag_filter: str, wrap_s: str, wrap_t: str, anisotropy: int = 1
) -> int:
    raw = device.raw
    glo = raw.make("glCreateSamplers")
    for parameter, kind in ((0x2801, min_filter), (0x2800, mag_filter)):
        raw.glSamplerParameteri(glo, parameter, _FILTERS[kind])
    for parameter, wrap in ((0x2802, wrap_s), (0x2803, wrap_t), (0x8072, wrap_t)):  # the last: depth of 3D textures
        raw.glSamplerParameteri(glo, parameter, _WRAPS[wrap])
    if anisotropy > 1:
        raw.glSamplerParameteri(glo, 0x84FE, anisotropy)
    return glo
