"""Scene files: objects placed from shapes and mesh files, with materials, lights, cameras, keyframes (design.md §5).

All mistakes of a file are found before it stops, each with line, column and the nearest right name.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph.document import Value, load, shown
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.keys import Key, Validator, plain
from rendergraph.scene import scene_keys, scene_values
from rendergraph.scene.environments import named
from rendergraph.scene.geometry import rigid
from rendergraph.scene.load import MESHES, read_mesh
from rendergraph.scene.model import (
    Camera,
    Environment,
    Light,
    Material,
    Mesh,
    Object,
    Orbit,
    Placement,
    Scene,
    Texture,
)
from rendergraph.scene.reading import Reading
from rendergraph.scene.shapes import SHAPES, ShapePart, build

_DEFAULT = Material("default", base_color=(0.8, 0.8, 0.8, 1.0))
_SRGB = ("base_color", "emissive", "specular_color")


def read_scene(path: Path, reading: Reading) -> Scene:
    """The scene a scene file describes.

    Raises:
        InputError: with every mistake of the file, or the first of a mesh file it names.
    """
    document = load(path, keep_going=True)
    reader = _Reader(path, reading, Validator(scene_keys.CODES, document.problems))
    scene = reader.read(document.root)
    if reader.validator.problems:
        raise InputError(sorted(reader.validator.problems, key=_by_place))
    return scene


def _by_place(problem: Problem) -> tuple[bool, str, int, int]:
    place = problem.place
    return (False, place.file, place.line, place.column) if place else (True, "", 0, 0)


class _File(Struct):
    """A mesh file already read: where its meshes and materials lie in the scene."""

    scene: Scene
    first_mesh: int
    first_material: int


class _Made(Struct):
    """What the objects have made so far."""

    objects: list[Object] = field(default_factory=list)
    meshes: list[Mesh] = field(default_factory=list)
    materials: list[Material] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    cameras: dict[str, Camera] = field(default_factory=dict)
    placements: dict[str, Placement] = field(default_factory=dict)
    shapes: dict[tuple[Any, ...], tuple[int, list[ShapePart]]] = field(default_factory=dict)
    files: dict[Path, _File] = field(default_factory=dict)
    numbers: dict[str | None, int] = field(default_factory=dict)
    vertices: int = 0


class _Reader:
    """Reads the sections in the order they refer to each other."""

    def __init__(self, path: Path, reading: Reading, validator: Validator) -> None:
        self.path, self.reading, self.validator = path, reading, validator
        self.recipe: dict[tuple[str, str], dict[str, Any]] = {}
        self.made = _Made()

    def read(self, root: Value) -> Scene:
        """The scene; only to be used where no problem was found."""
        names = {section: tuple(_entries(root, section)) for section in ("objects", "materials", "lights", "cameras")}
        top = self.validator.file(root, scene_keys.SCENE, "`scene: 1` and `objects`")
        if top is None:
            return Scene(self.path.stem)
        for name, entry in _entries(top, "materials").items():
            self._material(name, entry)
        for name, entry in _entries(top, "lights").items():
            self._light(name, entry)
        for name, entry in _entries(top, "cameras").items():
            self._camera(name, entry)
        for name, entry in _entries(top, "objects").items():
            self._object(name, entry, names["materials"])
        environment = self._environment(top.get("environment"))
        keyframes = self._keyframes(top, names)
        orbit = self._orbit(top.get("orbit"))
        made = self.made
        return Scene(
            self.path.stem,
            self.path,
            tuple(made.objects),
            tuple(made.meshes),
            tuple(made.materials),
            tuple(made.lights),
            made.cameras,
            environment,
            keyframes,
            orbit,
            self.reading.warnings,
            self.recipe,
            made.placements,
        )

    def _is_named(self, entry: Value, key: str, known: Iterable[str], section: str) -> None:
        """Whether what a key names is there."""
        value = entry.get(key)
        if value is not None and value.data is not None and str(value.data) not in known:
            hint = suggestion(str(value.data), known) or f"; there are no {section}"
            self.validator.report(value, "RG322", f"there is no {key} '{shown(value.data)}'{hint}")

    # Surfaces, lights, cameras ----------------------------------------------------------------------------------------

    def _material(self, name: str, entry: Value) -> None:
        values = plain(entry, scene_keys.MATERIAL)
        textures = {}
        for key, _ in scene_keys.TEXTURES:
            if key in values:
                slot = key.removesuffix("_texture")
                image = self._image(entry, key, values.pop(key))
                if image is not None:
                    textures[slot] = Texture(image, slot in _SRGB)
        self.recipe["materials", name] = values
        self.made.numbers[name] = len(self.made.materials)
        self.made.materials.append(scene_values.material(name, values, textures))

    def _image(self, entry: Value, key: str, name: str) -> Any:
        place = entry.get(key)
        assert place is not None  # its value was just read
        try:
            return self.reading.image(self.reading.resolve(name, line=place.line), "image", line=place.line)
        except InputError as problem:
            self._take(problem, place)
            return None

    def _take(self, problem: InputError, place: Value) -> None:
        """Keep problems of a named file; those without a place of their own get the name's."""
        for found in problem.problems:
            if found.place is None or found.place.file == str(self.path):
                found = place.relocate(found)
            self.validator.problems.append(found)

    def _light(self, name: str, entry: Value) -> None:
        values = plain(entry, scene_keys.LIGHT)
        self.recipe["lights", name] = values
        if "type" in values:
            try:
                self.made.lights.append(scene_values.light(name, values))
            except ValueError as problem:
                self.validator.report(entry, "RG321", f"light '{shown(name)}': {problem}", key=True)

    def _camera(self, name: str, entry: Value) -> None:
        values = plain(entry, scene_keys.CAMERA)
        self.recipe["cameras", name] = values
        try:
            self.made.cameras[name] = scene_values.camera(name, values)
        except ValueError as problem:
            self.validator.report(entry, "RG321", f"camera '{shown(name)}': {problem}", key=True)
            self.made.cameras[name] = scene_values.camera(name, {})

    def _orbit(self, entry: Value | None) -> Orbit | None:
        if entry is None or entry.data is None:
            return None
        self._is_named(entry, "camera", self.made.cameras, "cameras")
        values = plain(entry, scene_keys.ORBIT)
        return Orbit(values.get("camera", ""), values.get("degrees_per_second", 30.0))

    def _environment(self, entry: Value | None) -> Environment | None:
        values = plain(entry, scene_keys.ENVIRONMENT) if entry is not None else {}
        if entry is None or "file" not in values:
            return None
        self.recipe["environment", ""] = values
        place = entry.get("file")
        assert place is not None  # its value was just read
        if values["file"] != "sky":
            for key in ("sun", "turbidity"):
                if (stated := entry.get(key)) is not None and stated.data is not None:
                    self.validator.report(stated, "RG321", f"'{key}' goes with `file: sky`", key=True)
        try:
            found = named(values["file"], self.made.lights, values)
            if found is None:
                path = self.reading.resolve(values["file"], line=place.line)
                image = self.reading.image(path, "image", line=place.line)
                found = Environment(image, image.size)
        except InputError as problem:
            self._take(problem, place)
            return None
        turn = math.radians(values.get("rotate_degrees", 0.0))
        return replace(found, intensity=values.get("intensity", 1.0), rotate=turn)

    # Objects ----------------------------------------------------------------------------------------------------------

    def _object(self, name: str, entry: Value, materials: Sequence[str]) -> None:
        self._is_named(entry, "material", materials, "materials")
        values = plain(entry, scene_keys.OBJECT)
        self.recipe["objects", name] = {
            key.name: values[key.name] for key in scene_keys.OBJECT.keys if key.name in values
        }
        if "shape" in values:
            numbers = {key.name: values.get(key.name, key.default) for key in SHAPES[values["shape"]].keys}
            self._shape(name, entry, numbers, values)
        elif "file" in values:
            self._file(name, entry, values, materials)

    def _material_index(self, name: str | None) -> int:
        made = self.made
        if name not in made.numbers:
            made.numbers[name] = len(made.materials)
            made.materials.append(_DEFAULT)
        return made.numbers[name]

    def _shape(self, name: str, entry: Value, numbers: dict[str, Any], values: dict[str, Any]) -> None:
        made, shape = self.made, values["shape"]
        key = (shape, *sorted(numbers.items()))
        if key not in made.shapes:
            made.vertices += SHAPES[shape].vertices(numbers)
            if made.vertices > self.reading.limits.vertices:
                raise self._over(entry, f"shapes have {made.vertices:,} vertices", "vertices")
            parts = build(shape, **numbers)
            made.shapes[key] = len(made.meshes), parts
            made.meshes.append(parts[0].mesh)  # all parts of a shape share it
        mesh, parts = made.shapes[key]
        world, base = scene_values.placed(values), self._material_index(values.get("material"))
        placed = []
        for part in parts:
            material = base
            if part.changes:
                material = len(made.materials)
                changes: dict[str, Any] = dict(part.changes)
                made.materials.append(replace(made.materials[base], name=f"{name}{part.suffix}", **changes))
            placed.append((len(made.objects), part.local))
            made.objects.append(
                Object(
                    name + part.suffix,
                    mesh,
                    material,
                    world @ part.local,
                    values.get("casts_shadow", True),
                    values.get("hidden", False),
                    name,
                )
            )
        made.placements[name] = Placement(tuple(placed))
        self._count_objects(entry)

    def _file(self, name: str, entry: Value, values: dict[str, Any], materials: Sequence[str]) -> None:
        place = entry.get("file")
        assert place is not None  # its value was just read
        try:
            found = self._read_file(name, values["file"], place)
        except InputError as problem:
            self._take(problem, place)
            return
        made, scene, world = self.made, found.scene, scene_values.placed(values)
        overrides = self._overrides(_entries(entry, "overrides"), name, scene, materials)
        objects, lights, cameras = [], [], []
        for part in scene.objects:
            changes = overrides.get(part.name, overrides.get(part.node, {}))
            word = changes.get("material", values.get("material"))
            objects.append((len(made.objects), part.transform))
            made.objects.append(
                Object(
                    f"{name}/{part.name}",
                    part.mesh + found.first_mesh,
                    part.material + found.first_material if word is None else self._material_index(word),
                    world @ part.transform,
                    changes.get("casts_shadow", values.get("casts_shadow", part.casts_shadow)),
                    changes.get("hidden", values.get("hidden", part.hidden)),
                    f"{name}/{part.node}",
                )
            )
        for light in scene.lights:
            local = scene_values.light_matrix(light)
            lights.append((len(made.lights), local))
            made.lights.append(scene_values.moved_light(replace(light, name=f"{name}/{light.name}"), world @ local))
        for camera in scene.cameras.values():
            word = f"{name}/{camera.name}"
            cameras.append((word, camera.transform))
            made.cameras[word] = replace(camera, name=word, transform=rigid(world @ camera.transform))
        made.placements[name] = Placement(tuple(objects), tuple(lights), tuple(cameras))
        self._count_objects(entry)

    def _read_file(self, name: str, file: str, place: Value) -> _File:
        path = self.reading.resolve(file, line=place.line)
        if path in self.made.files:
            return self.made.files[path]
        if path.suffix.lower() in MESHES:
            self.reading.check_file(path, "file")
        inner = Reading(path, self.reading.check_path, self.reading.limits, self.reading.extensions)
        unknown = Problem("RG303", f"'{shown(file)}' is not a mesh file; a mesh ends in")
        scene = read_mesh(path, inner, unknown)
        self.reading.add_warnings(inner.warnings)
        made = self.made
        made.files[path] = _File(scene, len(made.meshes), len(made.materials))
        made.meshes += scene.meshes
        made.materials += [replace(material, name=f"{name}/{material.name}") for material in scene.materials]
        return made.files[path]

    def _overrides(
        self, given: Mapping[str, Value], name: str, scene: Scene, materials: Sequence[str]
    ) -> dict[str, dict[str, Any]]:
        """Node or part name to what is changed."""
        known = dict.fromkeys(word for part in scene.objects for word in (part.node, part.name))
        result = {}
        for node, entry in given.items():
            if node not in known:
                text = f"object '{shown(name)}': its file has no node '{shown(node)}'{suggestion(node, known)}"
                self.validator.report(entry, "RG322", text, key=True)
            self._is_named(entry, "material", materials, "materials")
            result[node] = plain(entry, scene_keys.OVERRIDE)
        return result

    def _count_objects(self, entry: Value) -> None:
        if len(self.made.objects) > self.reading.limits.objects:
            raise self._over(entry, f"{len(self.made.objects):,} objects", "objects")

    def _over(self, entry: Value, what: str, limit: str) -> InputError:
        return self.reading.over(what, limit).relocated(entry.relocate)

    # Keyframes --------------------------------------------------------------------------------------------------------

    def _keyframes(self, top: Value, names: dict[str, tuple[str, ...]]) -> dict[str, tuple[tuple[float, Any], ...]]:
        result = {}
        for path, entry in _entries(top, "keyframes").items():
            key = self._named_key(str(path), entry, names)
            if key is None:
                continue
            if not isinstance(entry.data, dict) or not entry.data:
                what = "empty" if entry.data == {} else entry.kind
                self.validator.report(
                    entry, "RG321", f"keyframes of '{shown(path)}' are {what}, not a mapping of seconds to values"
                )
                continue
            frames = []
            for time, value in entry.items():
                if isinstance(time, bool) or not isinstance(time, int | float) or not math.isfinite(time):
                    text = f"keyframes of '{shown(path)}': '{shown(time)}' is not a time in seconds"
                    self.validator.report(value, "RG321", text, key=True)
                    continue
                if value.data is None:
                    self.validator.report(value, "RG321", f"keyframe {time:g} s of '{shown(path)}' has no value")
                elif (good := self.validator.value(value, key)) is not None:
                    frames.append((float(time), plain(good, key.type)))
            result[path] = tuple(sorted(frames, key=lambda frame: frame[0]))
        return result

    def _named_key(self, path: str, entry: Value, names: dict[str, tuple[str, ...]]) -> Key | None:
        """The key a dotted path names; only numbers, vectors and colours move."""
        section, _, rest = path.partition(".")
        if section not in scene_keys.ANIMATED:
            hint = suggestion(section, scene_keys.ANIMATED)
            self.validator.report(entry, "RG322", f"keyframes name no section '{shown(section)}'{hint}", key=True)
            return None
        name, word = ("", rest) if section == "environment" else rest.rpartition(".")[::2]
        known = names.get(section, ())
        if section != "environment" and name not in known:
            hint = suggestion(name, known) or f"; there are no {section}"
            text = f"keyframes: there is no '{shown(name)}' under {section}{hint}"
            self.validator.report(entry, "RG322", text, key=True)
            return None
        moving = scene_keys.moving(section)
        if word not in moving:
            text = f"keyframes: {section} have no moving key '{shown(word)}'{suggestion(word, moving)}"
            self.validator.report(entry, "RG322", text, key=True)
            return None
        return moving[word]


def _entries(value: Value, section: str) -> dict[str, Value]:
    """The entries of a section; none where it is not there."""
    found = value.get(section)
    return dict(found.items()) if found is not None else {}
