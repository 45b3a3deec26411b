"""Generated textures: a compute shader evaluates a kind's GLSL file when a scene that uses it is loaded."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from msgspec import Struct, field

from rendergraph.compile.programs import ProgramCache
from rendergraph.gl import textures
from rendergraph.glsl import Includes
from rendergraph.glsl.source import generated
from rendergraph.images.cache import DiskCache
from rendergraph.program.text import VERSION, StageText
from rendergraph.resources import folder
from rendergraph.scene.model import GeneratedTexture, ImageSource
from rendergraph.textures import TextureDesc

Maps: TypeAlias = Mapping[str, npt.NDArray[np.uint8]]
_MOST_KEPT = 64 << 20
_CACHE = DiskCache("textures", 256 << 20)  # on a CPU a texture takes half a second
_POINTS = 2
"""Sample points along each side of a texel, which are averaged."""
_FORMATS = ("rgba8", "rgba32f", "rgba8", "rgba8")
_MAPS = {"color": 0, "normal": 2, "surface": 3}
_READ_WRITE, _ALL_BARRIERS = 0x88BA, 0xFFFFFFFF


class TextureGenerator(Struct, eq=False):
    """Evaluates generated textures, and caches the texels of the latest ones for later scenes."""

    programs: ProgramCache
    _kept: dict[Hashable, Maps] = field(default_factory=dict)

    def texels(self, source: ImageSource) -> npt.NDArray[np.uint8]:
        """Return one map of a generated texture, (height, width, 4), top row first."""
        assert source.generated is not None  # other images are decoded
        text = _text(source.generated.shader)
        key = text.text, source.generated.values
        if key not in self._kept:
            name = repr((*key, self.programs.device.renderer))
            if (maps := _CACHE.get(name)) is None:
                maps = self._evaluate(text, source.generated)
                _CACHE.put(name, maps)
            self._kept[key] = maps
            while len(self._kept) > 1 and sum(t.nbytes for m in self._kept.values() for t in m.values()) > _MOST_KEPT:
                self._kept.pop(next(iter(self._kept)))
        return self._kept[key][source.generated.map]

    def _evaluate(self, text: StageText, texture: GeneratedTexture) -> dict[str, npt.NDArray[Any]]:
        device, values = self.programs.device, dict(texture.values)
        side = values.pop("resolution")
        program = self.programs.get({"compute": text}, {}, ())
        images = []
        with ExitStack() as made:
            for unit, name in enumerate(_FORMATS):
                desc = TextureDesc("texture2d", name, side, side)
                images.append(textures.create(device, desc, "a generated texture"))
                made.callback(textures.delete, device, images[unit])
                texel_format = 0x8814 if name == "rgba32f" else 0x8058
                device.raw.glBindImageTexture(unit, images[unit].glo, 0, 0, 0, _READ_WRITE, texel_format)
            for phase in (0, 1):
                for name, value in {**values, "points": _POINTS, "phase": phase}.items():
                    if (write := program.writer(name, value)) is not None:
                        write()
                program.object.run(-(-side // 8), -(-side // 8))
                device.raw.glMemoryBarrier(_ALL_BARRIERS)
            return {name: np.ascontiguousarray(textures.read(device, images[n])[0][::-1]) for name, n in _MAPS.items()}


def _text(shader: Path) -> StageText:
    """Return the program text of a kind of texture."""
    include = folder("rendergraph.shaders") / "include"
    body = Includes(include).expand(include / "texture.comp", plugged={"TEXTURE": shader})
    return StageText("compute", generated([VERSION]) + body)
