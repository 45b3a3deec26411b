"""Convert Python values to data that a file can hold: arrays, meshes, shader text and node classes to names.

A value that a file cannot hold is written to a `.npy`, `.npz` or shader file in a folder of this process, named by its
content. The rest of the code handles only plain data and paths, so that selections can be pickled, and caches and
fingerprints depend on the content.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rendergraph.declare import MeshData, Node, Output
from rendergraph.declare.node import type_name
from rendergraph.errors import InputError, Option, Place, Problem
from rendergraph.steps import Steps
from rendergraph.textures import Any as AnyTexels

if TYPE_CHECKING:
    import numpy.typing as npt

Mesh = MeshData
_FORMATS = {"u": ("r8", "rg8", "rgba8"), "f": ("r32f", "rg32f", "rgba32f")}


class Object(dict[str, Any]):
    """An object of a scene: a mesh with its material, and any key that scene files have under `objects`.

    `rg.Object(mesh, material={"base_color": [1, 0, 0]}, at=[0, 1, 0])` or `rg.Object(shape="sphere", radius=0.5)`.
    """

    def __init__(
        self,
        mesh: Mesh | str | os.PathLike[str] | None = None,
        material: Mapping[str, Any] | str | None = None,
        **keys: Any,
    ) -> None:
        """Make an object of a mesh.

        Args:
            mesh: arrays, or a mesh file; None where `keys` have a `shape`.
            material: a material's values, or the name of one of the scene's.
            keys: as in scene files: `at`, `rotate_degrees`, `scale`, `casts_shadow`, …
        """
        given = {"file": mesh, "material": material, **keys}
        super().__init__({key: value for key, value in given.items() if value is not None})


class Scene(dict[str, Any]):
    """A scene of Python values, with the keys of scene files: `rg.load("forward", scene=rg.Scene({"knot": mesh}))`."""

    def __init__(
        self,
        objects: Mapping[str, Any] = {},
        *,
        lights: Mapping[str, Any] | None = None,
        cameras: Mapping[str, Any] | None = None,
        materials: Mapping[str, Any] | None = None,
        environment: Any = None,
        **keys: Any,
    ) -> None:
        """Make a scene.

        Args:
            objects: by name: an `Object`, a `Mesh`, or a mapping with the keys of scene files.
            lights, cameras, materials: by name, with the keys of scene files.
            environment: a shipped name, a file, an array (height, width, 3), or a mapping with its keys.
            keys: further sections of scene files: `extends`, `keyframes`, `orbit`.
        """
        named, made = dict(materials or {}), {}
        for name, one in objects.items():
            one = Object(one) if isinstance(one, Mesh) else one
            if isinstance(one, Mapping) and isinstance(one.get("material"), Mapping):
                named[name] = one["material"]
                one = {**one, "material": name}
            made[name] = one
        around = environment if environment is None or isinstance(environment, Mapping) else {"file": environment}
        given = {"objects": made, "materials": named, "lights": lights, "cameras": cameras, "environment": around}
        super().__init__({"scene": 1, **{key: value for key, value in given.items() if value}, **keys})


class Values:
    """Converts Python values to plain data, one after the other."""

    def __init__(self) -> None:
        self.folders: set[Path] = set()  # of files that have been written
        self.shaders: dict[str, Path] = {}  # files of shader text, which are node types
        self.types: dict[str, type[Node]] = {}  # node classes by the names of their types
        self.nodes: dict[str, dict[str, str]] = {}  # further nodes of the pipeline, which hold arrays

    def plain(self, value: Any, *keys: str) -> Any:
        """Return a value, or what replaces it, at a path of keys as in a pipeline's file."""
        if isinstance(value, Mapping):
            return {str(key): self.plain(child, *keys, str(key)) for key, child in value.items()}
        if isinstance(value, list | tuple):
            return [self.plain(child, *keys, str(number)) for number, child in enumerate(value)]
        if isinstance(value, Mesh):
            return self._mesh(value, keys)
        if isinstance(value, type) and issubclass(value, Node):
            self.types[type_name(value)] = value
            return type_name(value)
        if isinstance(value, os.PathLike):
            return os.fspath(value)
        if isinstance(value, str) and keys[-1:] == ("type",) and "\n" in value:
            return self._shader(value, keys[-2] if len(keys) > 1 else "shader")
        return self._array(value, keys) if hasattr(value, "tolist") else value

    def _array(self, array: Any, keys: tuple[str, ...]) -> Any:
        if getattr(array, "ndim", 0) < 2 or "params" in keys:
            return array.tolist()
        return self._input(array) if "inputs" in keys else self._image(array, keys)

    def _file(self, content: bytes, name: str) -> Path:
        folder = _folder() / hashlib.sha256(content).hexdigest()[:16]
        self.folders.add(_folder())
        if not folder.exists():
            folder.mkdir()
            (folder / name).write_bytes(content)
        return folder / name

    def _shader(self, text: str, node: str) -> str:
        name = f"{re.sub(r'[^A-Za-z0-9_]', '_', node)}_{hashlib.sha256(text.encode()).hexdigest()[:6]}"
        ending = "comp" if "local_size_x" in text else "frag"
        self.shaders[name] = self._file(text.encode(), f"{name}.{ending}")
        return name

    def _image(self, array: npt.NDArray[Any], keys: tuple[str, ...]) -> str:
        import numpy as np  # for arrays alone

        if array.ndim > 3 or (array.ndim == 3 and array.shape[2] > 4) or not array.size:
            text = f"an image is an array (height, width) or (height, width, 1 to 4), not {array.shape}"
            raise InputError(Problem("RG106", text, _place(keys)))
        if array.dtype != np.uint8:
            array = array.astype(np.float32)
        return str(self._file(_npy(array), "array.npy"))

    def _mesh(self, mesh: Mesh, keys: tuple[str, ...]) -> str:
        import io

        import numpy as np  # for arrays alone

        from rendergraph.scene.reading import check_mesh  # likewise

        try:
            check_mesh(mesh)
        except (ValueError, TypeError, OverflowError) as error:
            raise InputError(Problem("RG498", f"this is not a mesh: its {error}", _place(keys))) from None
        given = {one.name: getattr(mesh, one.name) for one in fields(mesh)[:6]}
        arrays: dict[str, Any] = {key: np.asarray(value) for key, value in given.items() if value is not None}
        file = io.BytesIO()
        np.savez(file, allow_pickle=False, **arrays)
        return str(self._file(file.getvalue(), "mesh.npz"))

    def _input(self, array: npt.NDArray[Any]) -> str:
        name = f"array_{hashlib.sha256(_npy(array)).hexdigest()[:10]}"
        self.types.setdefault(name, array_type(array))
        self.nodes[name] = {"type": name}
        return f"{name}.values"


def array_type(array: npt.NDArray[Any]) -> type[Node]:
    """Return a node type whose output `values` holds an array, top row first as a frame has it.

    Args:
        array: (height, width), (height, width, channels) or (layers, height, width, channels), of at most 4 channels;
            bytes are from 0 to 255 for values from 0 to 1, and everything else becomes 32-bit floats.
    """
    import numpy as np  # for arrays alone

    texels = array if array.dtype == np.uint8 else array.astype(np.float32)
    texels = texels[..., None] if texels.ndim == 2 else texels
    if not 3 <= texels.ndim <= 4 or not 1 <= texels.shape[-1] <= 4 or not texels.size:
        shape = "(height, width), optionally with 1 to 4 channels after them and layers before them"
        raise InputError(Problem("RG106", f"an input is an array of shape {shape}, not {array.shape}"))
    if texels.shape[-1] == 3:
        one = np.full((*texels.shape[:-1], 1), 255 if texels.dtype == np.uint8 else 1, texels.dtype)
        texels = np.concatenate([texels, one], axis=-1)
    texels = np.ascontiguousarray(texels[..., ::-1, :, :])  # a texture's first row is the lowest
    height, width, channels = texels.shape[-3:]
    options: dict[str, Any] = {"layers": len(texels), "kind": "texture2d_array"} if texels.ndim == 4 else {}
    format = _FORMATS[texels.dtype.kind][channels // 2]
    doc = "The array."
    output = Output(AnyTexels, format=format, size=(width, height), kept=True, doc=doc, **options)

    def record(self: Any, steps: Steps) -> None:
        steps.upload(self.values, texels)

    return type("Array", (Node,), {"__module__": __name__, "__doc__": doc, "values": output, "record": record})


def _npy(array: npt.NDArray[Any]) -> bytes:
    import io

    import numpy as np  # for arrays alone

    file = io.BytesIO()
    np.save(file, np.ascontiguousarray(array), allow_pickle=False)
    return file.getvalue()


def _place(keys: tuple[str, ...]) -> Place:
    return Place(Option("pipeline", ".".join(keys)))


@cache
def _folder() -> Path:
    folder, process = Path(tempfile.mkdtemp(prefix="rendergraph-")).resolve(), os.getpid()

    def remove() -> None:
        if os.getpid() == process:  # a forked process must not remove it
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    return folder
