"""What plugins add besides node types: semantics, choices, readers of meshes and images, metrics, keys of scenes."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Generic, TypeAlias, TypeVar, get_args

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.declare.blame import describe_error, source_location
from rendergraph.declare.scene_keys import SceneKey, Section, TextureKind
from rendergraph.errors import InputError, Place, Problem, is_interruption, shown_file
from rendergraph.glsl import about
from rendergraph.stamps import Stamps, replay_reads, track_reads
from rendergraph.textures import SEMANTICS, Semantic
from rendergraph.typecheck import Matching, mistakes_of, test_of, words_for

if TYPE_CHECKING:
    import numpy.typing as npt

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
    "meshes": (_READ_SCENES, "meshes has '{}', which rendergraph reads itself"),
    "scenes": (_READ_SCENES, "scenes has '{}', which rendergraph reads itself"),
    "images": (READ_IMAGES, "images has '{}', which rendergraph reads itself"),
    "metrics": (
        ("flip", "rmse", "psnr", "ssim", "radiance_rmse"),
        "metric '{}' is one of rendergraph's own; choose another name",
    ),
}


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
    for field, (taken, text) in _TAKEN.items():
        yield from ((field, text.format(name)) for name in getattr(extension, field) if name in taken)
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
        found = self.added("metrics")
        for metric in found:
            _one("metric", metric.name, found)
        return found

    def scene_keys(self, section: Section) -> list[Added[SceneKey]]:
        """Return the keys of the entries in a section of scene files."""
        keys = [(key, source) for source, one in self._usable() for key in one.scene_keys.get(section, ())]
        return [Added(key.name, key, source.plugin, source.file) for key, source in keys]

    def textures(self) -> dict[str, TextureKind]:
        """Return the kinds of generated textures with absolute shader paths; two with the same name are an error."""
        added = self.added("textures")
        return {
            one.name: replace(one.value, shader=one.file.parent / one.value.shader)
            for one in added
            if _one("kind of texture", one.name, added)
        }

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
