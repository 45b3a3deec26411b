"""What plugins add besides node types: semantics, choices, readers of meshes and images, metrics, keys of scenes."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Generic, Literal, TypeAlias, TypeVar, get_args, get_origin

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.declare.blame import describe_error, source_location
from rendergraph.errors import InputError, Place, Problem, is_interruption, shown_file
from rendergraph.facts import Extra
from rendergraph.glsl import about
from rendergraph.stamps import Stamps, replay_reads, track_reads
from rendergraph.textures import SEMANTICS, Semantic
from rendergraph.typecheck import MOST, Matching, Range, conversion_to, mistakes_of, test_of, words_for

if TYPE_CHECKING:
    import numpy.typing as npt

    from rendergraph.keys import Key

    Metric: TypeAlias = Callable[[npt.NDArray[Any], npt.NDArray[Any]], float]
    ImageLoader: TypeAlias = Callable[[bytes], npt.NDArray[Any]]
    MeshLoader: TypeAlias = "Callable[[Path], MeshData | Sequence[MeshData]]"
    SceneLoader: TypeAlias = Callable[[Path, Any], Any]
else:
    Metric = ImageLoader = MeshLoader = SceneLoader = Callable

T = TypeVar("T")
R = TypeVar("R")
Include: TypeAlias = Annotated[str | Path, "the name of an include"]
Word: TypeAlias = Annotated[
    str, Matching(r"[a-z][a-z0-9]*(_[a-z0-9]+)*\Z"), "a word of lower-case letters, digits and single '_'"
]
"""A part of a macro's name."""
Ending: TypeAlias = Annotated[
    str, Matching(r"\.[a-z0-9][a-z0-9_-]*\Z"), "a file's ending, a dot and lower-case letters as in '.stl'"
]


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


@dataclass(frozen=True, eq=False)  # not a Struct: help() would resolve its types and import NumPy
class MeshData:
    """Triangles of one material, as a mesh loader gives them: right-handed, +Y up, metres.

    Attributes:
        positions: (n, 3) finite numbers.
        indices: (m, 3) whole numbers below n, counter-clockwise seen from outside.
        normals: (n, 3); by default the mean over the adjacent faces, so that shared vertices are smooth.
        uv0, uv1: (n, 2) texture coordinates, origin at the image's top left.
        colors: (n, 3) or (n, 4), linear.
        name: of the object; the file's by default.
        base_color, metallic, roughness: the material, if the scene file names none.
    """

    positions: npt.ArrayLike
    indices: npt.ArrayLike
    normals: npt.ArrayLike | None = None
    uv0: npt.ArrayLike | None = None
    uv1: npt.ArrayLike | None = None
    colors: npt.ArrayLike | None = None
    name: str = ""
    base_color: tuple[float, float, float] = (0.8, 0.8, 0.8)
    metallic: float = 0.0
    roughness: float = 1.0


class Extension(Struct, frozen=True):
    """What a plugin adds besides node types, each by name; it is imported when the first name is requested.

    It is found by the entry point group `rendergraph.extensions`, or as `EXTENSION` in `extension.py` at the top of a
    plugin's folder.

    Attributes:
        semantics: meanings of ports.
        choices: parameter name to further choices, each with its include, relative to the folder of the extension's
            module. The parameter's node documents what the include must define. The include's opening comment is its
            documentation, and `#pragma needs(…)` names what it needs beyond other choices.
        meshes: a file's ending (`.stl`) to the function that reads such a file, as a scene and as an object's `file`.
        scenes: a file's ending to the function that reads a whole scene, with materials, lights and cameras: from the
            path and a `rendergraph.scene.reading.Reading`, which opens further files and images, to a
            `rendergraph.scene.model.Scene`.
        images: a file's ending to the function that decodes its bytes to (height, width) or (height, width, 1 to 4),
            top row first, in uint8 (sRGB if the slot is a colour) or floats (linear light).
        metrics: name to a function of a picture and its reference, (height, width, 3) in float64, sRGB-encoded from 0
            to 1 if they are display-referred, else linear; the result must grow with the error.
        scene_keys: section of scene files (`objects`, `materials`, `lights`, `cameras`) to further keys of its entries.
        textures: kinds of generated textures for the materials of scene files.
    """

    semantics: tuple[Semantic, ...] = ()
    choices: Mapping[str, Mapping[Word, Include]] = {}
    meshes: Mapping[Ending, MeshLoader] = {}
    scenes: Mapping[Ending, SceneLoader] = {}
    images: Mapping[Ending, ImageLoader] = {}
    metrics: Mapping[Word, Metric] = {}
    scene_keys: Mapping[Section, tuple[SceneKey, ...]] = {}
    textures: Mapping[Word, TextureKind] = {}


READ_IMAGES = (".png", ".jpg", ".jpeg", ".exr", ".hdr", ".bmp", ".tga")
"""Endings of image files that need no plugin."""
_READ_SCENES = (".yaml", ".yml", ".obj", ".gltf", ".glb", ".npz", ".usd", ".usda", ".usdc", ".usdz")
_TAKEN = {
    "meshes": _READ_SCENES,
    "scenes": _READ_SCENES,
    "images": READ_IMAGES,
    "metrics": ("flip", "rmse", "psnr", "ssim", "radiance_rmse"),
}
"""Names of rendergraph's own, by the field in which a plugin might use them."""


def extension_mistakes(extension: Extension, folder: Path) -> list[Problem]:
    """Return the mistakes in an extension whose includes are in a folder; the subjects are its fields."""
    if mistakes := list(mistakes_of(extension, "")):
        return mistakes
    return [Problem("RG495", text, subject=field) for field, text in _mistakes(extension, folder)]


def _mistakes(extension: Extension, folder: Path) -> Iterator[tuple[str, str]]:
    for parameter, choices in extension.choices.items():
        for name, include in choices.items():
            if not (folder / include).is_file():
                yield "choices", f"choices['{parameter}']['{name}']: there is no file '{include}' beside the extension"
    for field, taken in _TAKEN.items():
        for name in [name for name in getattr(extension, field) if name in taken]:
            own_metric = f"metric '{name}' is one of rendergraph's own; choose another name"
            yield field, own_metric if field == "metrics" else f"{field} has '{name}', which rendergraph reads itself"
    for name, kind in extension.textures.items():
        wrong = kind.mistake() or ("" if (folder / kind.shader).is_file() else f"has no file '{kind.shader}' beside it")
        if wrong:
            yield "textures", f"textures['{name}'] {wrong}"
    for section, keys in extension.scene_keys.items():
        named = [key.name for key in keys]
        for key in keys:
            wrong = "is listed twice" if named.count(key.name) > 1 else key.mistake()
            if not test_of(Word)(key.name):
                wrong = f"has a name that is not {words_for(Word)}"
            if wrong:
                yield "scene_keys", f"scene_keys['{section}']: the key '{key.name}' {wrong}"


class Added(Struct, Generic[T], frozen=True):
    """One thing that a plugin (a distribution, or a folder) adds; `file` is the module of the extension."""

    name: str
    value: T
    plugin: str
    file: Path

    def run(self: Added[Callable[..., R]], code: str, doing: str, *arguments: Any) -> R:
        """Call the function that was added; any exception becomes an `InputError` with the code, at the author's line.

        `doing` is what could not be done, as the beginning of a sentence.
        """
        try:
            return self.value(*arguments)
        except BaseException as error:
            if is_interruption(error) or isinstance(error, InputError):
                raise
            place = source_location(error, self.file.parent) or Place(shown_file(self.file))
            text = f"{doing}: {describe_error(error)} (plugin '{self.plugin}')"
            raise InputError(Problem(code, text, place)) from error


class Source(Struct, frozen=True):
    """One extension: `extension` is None where `problems` say why it cannot be used."""

    plugin: str
    file: Path
    extension: Extension | None
    problems: tuple[Problem, ...] = ()


_KINDS = {
    "meshes": "mesh loader",
    "scenes": "scene loader",
    "images": "image loader",
    "metrics": "metric",
    "textures": "kind of texture",
}


class Extensions:
    """What all plugins add. A look-up imports every extension, so look up only names that are unknown elsewhere.

    If two plugins add the same name, looking it up is an error (RG496).
    """

    def __init__(self, find: Callable[[], Iterable[Source]] = tuple) -> None:
        self._find = find

    @property
    def sources(self) -> tuple[Source, ...]:
        """Every extension."""
        found, stamps = self._sources
        replay_reads(stamps)
        return found

    @cached_property
    def _sources(self) -> tuple[tuple[Source, ...], Stamps]:
        with track_reads() as stamps:
            return tuple(self._find()), stamps

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Mistakes in extensions, reported together with an unknown name, because they may be the reason."""
        return tuple(problem for source in self.sources for problem in source.problems)

    @property
    def warnings(self) -> tuple[Problem, ...]:
        """The same as warnings, for lists of everything, which leave out broken extensions."""
        return tuple(problem.as_warning() for problem in self.problems)

    def semantic(self, name: str) -> Semantic | None:
        """Return a semantic by name, the framework's or a plugin's."""
        for semantic in SEMANTICS:
            if semantic.name == name:
                return semantic
        found = _one("semantic", name, self.semantics())
        return found.value if found is not None else None

    def choice(self, parameter: str, name: str) -> Added[Path] | None:
        """Return the include of a plugin's choice of a parameter."""
        return _one(f"choice of '{parameter}'", name, self.choices(parameter))

    def loader(self, field: str, ending: str) -> Added[Any] | None:
        """Return the reader of files with an ending: one of the `meshes`, `scenes` or `images`."""
        return _one(_KINDS[field], ending.lower(), self.added(field))

    def semantics(self) -> list[Added[Semantic]]:
        """Return the semantics of plugins; equal ones of several plugins are listed once."""
        found: list[Added[Semantic]] = []
        for source, extension in self._usable():
            for value in extension.semantics:
                if all(value != other.value for other in found):
                    found.append(Added(value.name, value, source.plugin, source.file))
        return found

    def choices(self, parameter: str) -> list[Added[Path]]:
        """Return the absolute includes of plugins' choices of a parameter."""
        return [added for name, added in self._choices() if name == parameter]

    def metrics(self) -> list[Added[Metric]]:
        """Return the metrics of pictures; two with the same name are an error."""
        return self._unambiguous("metrics")

    def scene_keys(self, section: Section) -> list[Added[SceneKey]]:
        """Return the keys of the entries in a section of scene files."""
        keys = [(key, source) for source, one in self._usable() for key in one.scene_keys.get(section, ())]
        return [Added(key.name, key, source.plugin, source.file) for key, source in keys]

    def textures(self) -> dict[str, TextureKind]:
        """Return the kinds of generated textures with absolute shader paths; two with the same name are an error."""
        added = self._unambiguous("textures")
        return {one.name: replace(one.value, shader=one.file.parent / one.value.shader) for one in added}

    def scene_key(self, section: Section, name: str) -> Added[SceneKey] | None:
        """Return a key by name; two plugins with the same name are an error."""
        return _one(f"key of {section}", name, self.scene_keys(section))

    def listed(self) -> list[dict[str, str]]:
        """Return everything that plugins add, as plain values: `kind`, `name`, `plugin`, `doc`."""
        rows: list[tuple[str, Added[Any]]] = [("semantic", added) for added in self.semantics()]
        rows += self._choices()
        for field, kind in _KINDS.items():
            rows += [(kind, added) for added in self.added(field)]
        for section in get_args(Section):
            rows += [(f"key of {section}", added) for added in self.scene_keys(section)]
        return [{"kind": kind, "name": one.name, "plugin": one.plugin, "doc": _doc(one.value)} for kind, one in rows]

    def added(self, field: str) -> list[Added[Any]]:
        """Return what plugins add in a field of `Extension` that maps names to values."""
        return [
            Added(name, value, source.plugin, source.file)
            for source, extension in self._usable()
            for name, value in getattr(extension, field).items()
        ]

    def _unambiguous(self, field: str) -> list[Added[Any]]:
        added = self.added(field)
        return [one for one in added if _one(_KINDS[field], one.name, added)]

    def _usable(self) -> Iterator[tuple[Source, Extension]]:
        return ((source, source.extension) for source in self.sources if source.extension is not None)

    def _choices(self) -> Iterator[tuple[str, Added[Path]]]:
        for source, extension in self._usable():
            for parameter, choices in extension.choices.items():
                for name, include in choices.items():
                    yield str(parameter), Added(name, source.file.parent / include, source.plugin, source.file)


def _one(what: str, name: str, added: Sequence[Added[T]]) -> Added[T] | None:
    found = [one for one in added if one.name == name]
    if len(found) > 1:
        plugins = " and ".join(f"'{one.plugin}' ({shown_file(one.file)})" for one in found)
        text = f"{what} '{name}' comes from {plugins}; rename one, or uninstall one plugin"
        raise InputError(Problem("RG496", text, Place(shown_file(found[0].file))))
    return found[0] if found else None


def _doc(value: object) -> str:
    """Return the first line of the documentation of something that a plugin adds."""
    if isinstance(value, Path):
        return about(value)
    doc = value.doc if isinstance(value, Semantic | SceneKey | TextureKind) else inspect.getdoc(value) or ""
    return doc.partition("\n")[0]


NO_EXTENSIONS = Extensions()
"""The extensions without any plugin."""
