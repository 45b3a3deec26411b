"""What a plugin adds beside node types: meanings, choices, readers of meshes and images, metrics."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from msgspec import Struct

from rendergraph.errors import Problem
from rendergraph.textures import Semantic
from rendergraph.typecheck import Matching, mistakes_of

if TYPE_CHECKING:
    import numpy.typing as npt

    Metric: TypeAlias = Callable[[npt.NDArray[Any], npt.NDArray[Any]], float]
    ImageLoader: TypeAlias = Callable[[bytes], npt.NDArray[Any]]
    MeshLoader: TypeAlias = "Callable[[Path], MeshData | Sequence[MeshData]]"
else:
    Metric = ImageLoader = MeshLoader = Callable

Include: TypeAlias = Annotated[str | Path, "the name of an include"]
Word: TypeAlias = Annotated[
    str, Matching(r"[a-z][a-z0-9]*(_[a-z0-9]+)*\Z"), "a word of small letters, digits and single '_'"
]
"""What becomes part of a macro."""
Ending: TypeAlias = Annotated[
    str, Matching(r"\.[a-z0-9][a-z0-9_-]*\Z"), "a file's ending, a dot and small letters as in '.stl'"
]


@dataclass(frozen=True, eq=False)  # no struct: help() would work out its types, and so import NumPy's
class MeshData:
    """Triangles of one material, as a mesh loader gives them: right-handed, +Y up, metres.

    Attributes:
        positions: (n, 3) finite numbers.
        indices: (m, 3) whole numbers below n, counter-clockwise seen from outside.
        normals: (n, 3); the mean of the adjacent faces' by default, so that shared vertices are smooth.
        uv0, uv1: (n, 2) texture coordinates, origin at the image's top left.
        colors: (n, 3) or (n, 4), linear.
        name: of the object; the file's by default.
        base_color, metallic, roughness: the material, where the scene file names none.
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
    """What a plugin adds beside node types, each by name; nothing of it is imported before a name is asked for.

    It is found by the entry point group `rendergraph.extensions`, or as `EXTENSION` in `extension.py` at the top of a
    plugin's folder.

    Attributes:
        semantics: meanings of ports.
        choices: parameter name to further choices of it, each with the include that the node's shader takes in for it,
            relative to the folder of the extension's module. What it defines, the parameter's node says; its opening
            comment is its documentation, and `#pragma needs(…)` says what it looks at and other choices do not.
        meshes: a file's ending (`.stl`) to the function that reads such a file, as a scene and as an object's `file`.
        images: a file's ending to the function that decodes its bytes: (height, width), or with 1 to 4 channels behind,
            the top row first, uint8 (sRGB where the slot is a colour) or floats (linear light).
        metrics: name to a function of two pictures, (height, width, 3) in float64, sRGB-encoded from 0 to 1 where they
            are display-referred and linear otherwise, the second the reference; the result grows with the error.
    """

    semantics: tuple[Semantic, ...] = ()
    choices: Mapping[str, Mapping[Word, Include]] = {}
    meshes: Mapping[Ending, MeshLoader] = {}
    images: Mapping[Ending, ImageLoader] = {}
    metrics: Mapping[Word, Metric] = {}


_READ_MESHES = (".yaml", ".yml", ".obj", ".gltf", ".glb")
READ_IMAGES = (".png", ".jpg", ".jpeg", ".exr", ".hdr", ".bmp", ".tga")
"""Endings of image files that need no plugin."""
_OWN_METRICS = ("flip", "rmse", "psnr", "ssim", "radiance_rmse")


def extension_mistakes(extension: Extension, folder: Path) -> list[Problem]:
    """What is wrong with an extension; each mistake's subject is a field of it.

    Args:
        extension: as the plugin wrote it.
        folder: where the files it names are.
    """
    if mistakes := list(mistakes_of(extension, "")):
        return mistakes
    for parameter, choices in extension.choices.items():
        for name, include in choices.items():
            if not (folder / include).is_file():
                text = f"choices['{parameter}']['{name}']: there is no file '{include}' beside the extension"
                mistakes.append(Problem("RG495", text, subject="choices"))
    for kind, loaders, own in (("meshes", extension.meshes, _READ_MESHES), ("images", extension.images, READ_IMAGES)):
        taken = [ending for ending in loaders if ending in own]
        texts = [f"{kind} has '{ending}', which rendergraph reads itself" for ending in taken]
        mistakes += [Problem("RG495", text, subject=kind) for text in texts]
    for name in extension.metrics:
        if name in _OWN_METRICS:
            text = f"metric '{name}' is one of rendergraph's own; choose another name"
            mistakes.append(Problem("RG495", text, subject="metrics"))
    return mistakes
