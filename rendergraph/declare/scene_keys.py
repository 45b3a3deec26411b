"""Keys that plugins add to the objects, materials, lights and cameras of scene files."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, get_args, get_origin

from msgspec import Struct

from rendergraph.facts import Extra
from rendergraph.typecheck import MOST, Range, conversion_to, test_of

if TYPE_CHECKING:
    from rendergraph.keys import Key

Section: TypeAlias = Literal["objects", "materials", "lights", "cameras"]
"""A section of scene files to whose entries plugins may add keys."""
_MOST_NUMBERS = 16


class Image(Struct, frozen=True):
    """The type of a scene key that names an image file, relative to the scene file.

    Its value has a `size`, width and height, and `channels`; `FrameScene.pixels` decodes it.
    """


class SceneKey(Struct, frozen=True, dict=True):
    """A key that a plugin adds to objects, materials, lights or cameras of scene files: `Extension.scene_keys`.

    Attributes:
        name: a word of lower-case letters, digits and `_`.
        type: `float`, `int`, `bool`, `str`, a `Literal` of words, a tuple of 2 to 16 floats
            (`tuple[float, float, float]`), or `Image`. Keyframes can animate floats and tuples.
        doc: one line.
        default: the value of an entry that does not give the key.
        unit: the unit's symbol, empty for a pure number.
        min, max: smallest and largest legal number, inclusive.
    """

    name: str
    type: Any
    doc: str
    default: Any = None
    unit: str = ""
    min: float | None = None
    max: float | None = None

    def of(self, entry: Any) -> Any:
        """Return the value of an object, material, light or camera, or else the default.

        It accepts those of `facts` and those of a frame's scene.
        """
        extra: Extra = entry.extra
        return extra.get(self.name, self.default)

    @cached_property
    def key(self) -> Key:
        """The corresponding key of a table."""
        from rendergraph.keys import Key  # only for scene files with such keys

        return Key(self.name, self._annotation(), self.doc, self.default, self.unit)

    def mistake(self) -> str:
        """What is wrong with the declaration, as the end of a sentence; empty if nothing is."""
        numbers = get_args(self.type) if get_origin(self.type) is tuple else ()
        words = get_args(self.type) if get_origin(self.type) is Literal else ()
        is_row = 2 <= len(numbers) <= _MOST_NUMBERS and {*numbers} == {float}
        is_choice = bool(words) and all(isinstance(word, str) for word in words)
        if not (is_row or is_choice or self.type in (float, int, bool, str, Image)):
            kinds = "float, int, bool, str, a Literal of words, a tuple of 2 to 16 floats or Image"
            return f"has the type {self.type!r}; use {kinds}"
        has_numbers = is_row or self.type in (float, int)
        if (self.min is not None or self.max is not None) and not has_numbers:
            return "has limits, which are for numbers"
        if self.min is not None and self.max is not None and self.min > self.max:
            return f"has an empty range: min {self.min} > max {self.max}"
        if self.default is not None and self.type is Image:
            return "is an image, which has no default"
        annotation = self._annotation()
        if self.default is not None and not test_of(annotation)(conversion_to(annotation)(self.default)):
            return f"has the default {self.default!r}, which is not a legal value of it"
        return "" if self.doc.strip() else "has no documentation (doc)"

    def _annotation(self) -> Any:
        from rendergraph.keys.values import FILE, TEXT, number, vector  # as above

        low, high = -MOST if self.min is None else self.min, MOST if self.max is None else self.max
        if get_origin(self.type) is tuple:
            return vector(len(get_args(self.type)), low, high)
        simple = {float: number(low, high), int: Annotated[int, Range(low, high)], bool: bool, str: TEXT, Image: FILE}
        return simple.get(self.type, self.type)


class TextureKind(Struct, frozen=True):
    """A kind of generated texture for materials of scene files: `Extension.textures`.

    Attributes:
        doc: one line.
        shader: a GLSL file, relative to the extension's module, that includes `<texture_sample.glsl>` and defines
            `TextureSample texture_sample(vec2 uv)`.
        keys: further keys of `texture: {kind: …}`, each a uniform of that file: floats, ints, and tuples of 2 to 4
            floats.
    """

    doc: str
    shader: str | Path
    keys: tuple[SceneKey, ...] = ()

    def mistake(self) -> str:
        """What is wrong with the declaration, as the end of a sentence; empty if nothing is."""
        for key in self.keys:
            if wrong := key.mistake():
                return f"has the key '{key.name}', which {wrong}"
            if key.default is None or key.type in (str, Image) or get_origin(key.type) is Literal:
                return f"has the key '{key.name}', which is not a number or tuple with a default"
        return "" if self.doc.strip() else "has no documentation (doc)"
