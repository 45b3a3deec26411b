"""Scene files: objects placed from shapes and mesh files, with materials, lights, cameras, keyframes (design.md §5).

All mistakes of a file are found before it stops, each with line, column and the nearest right name.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.document import Value, load, shown
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.keys import Key, Validator, plain
from rendergraph.scene import scene_keys, scene_values
from rendergraph.scene.environments import named
from rendergraph.scene.geometry import rigid
from rendergraph.scene.mesh_files import MESHES, read_mesh
from rendergraph.scene.model import Camera, Environment, Light, Material, Mesh, Object, Orbit, Placement, Scene, Texture
from rendergraph.scene.reading import Reading
from rendergraph.scene.shapes import SHAPES, ShapePart, build

_DEFAULT = Material("default", base_color=(0.8, 0.8, 0.8, 1.0))
_SRGB = ("base_color", "emissive", "specular_color")


def read_scene(path: Path, reading: Reading) -> Scene:
    """Read a scene file; the error has every mistake in it, or the first of a mesh file it names."""
    document = load(path, limits=reading.limits.yaml, keep_going=True)
    reader = _Reader(path, reading, Validator(scene_keys.CODES, document.problems))
    scene = reader.read(document.root)
    if reader.validator.problems:
        raise InputError(sorted(reader.validator.problems, key=_by_place))
    return scene


def _by_place(problem: Problem) -> tuple[bool, str, int, int]:
    place = problem.place
    return (False, place.file, place.line, place.column) if place else (True, "", 0, 0)


class _File(Struct):
    """A mesh file already read, with the places of its meshes and materials in the scene."""

    scene: Scene
    first_mesh: int
    first_material: int


class _Reader:
    """Reads the sections in the order of their references to each other."""

    def __init__(self, path: Path, reading: Reading, validator: Validator) -> None:
        self.path, self.reading, self.validator = path, reading, validator
        self.recipe: dict[tuple[str, str], dict[str, Any]] = {}
        self.objects: list[Object] = []
        self.meshes: list[Mesh] = []
        self.materials: list[Material] = []
        self.lights: list[Light] = []
        self.cameras: dict[str, Camera] = {}
        self.placements: dict[str, Placement] = {}
        self.shapes: dict[tuple[Any, ...], tuple[int, list[ShapePart]]] = {}
        self.files: dict[Path, _File] = {}
        self.material_numbers: dict[str | None, int] = {}
        self.vertices = 0

    def read(self, root: Value) -> Scene:
        """The scene; only to be used if no problem was found."""
        names = {section: tuple(_entries(root, section)) for section in ("objects", "materials", "lights", "cameras")}
        top = self.validator.file(root, scene_keys.SCENE, "`scene: 1` and `objects`")
        if top is None:
            return Scene(self.path.stem)
        for section, read in (("materials", self._material), ("lights", self._light), ("cameras", self._camera)):
            for name, entry in _entries(top, section).items():
                read(name, entry)
        for name, entry in _entries(top, "objects").items():
            self._object(name, entry, names["materials"])
            if len(self.objects) > self.reading.limits.objects:
                raise self._over(entry, f"{len(self.objects):,} objects", "objects")
        environment = self._environment(top.get("environment"))
        return Scene(
            self.path.stem,
            self.path,
            tuple(self.objects),
            tuple(self.meshes),
            tuple(self.materials),
            tuple(self.lights),
            self.cameras,
            environment,
            self._keyframes(top, names),
            self._orbit(top.get("orbit")),
            recipe=self.recipe,
            placements=self.placements,
        )

    def _check_name(self, entry: Value, key: str, known: Iterable[str], section: str) -> None:
        value = entry.get(key)
        if value is not None and value.data is not None and str(value.data) not in known:
            hint = suggestion(str(value.data), known) or f"; there are no {section}"
            self.validator.report(value, "RG322", f"there is no {key} '{shown(value.data)}'{hint}")

    @contextmanager
    def _reading_file(self, place: Value) -> Iterator[None]:
        """Collect the problems of the file named at a place; those without a place of their own get this one."""
        try:
            yield
        except InputError as error:
            for problem in error.problems:
                is_here = problem.place is None or problem.place.file == str(self.path)
                self.validator.problems.append(place.relocate(problem) if is_here else problem)

    def _over(self, entry: Value, what: str, limit: str) -> InputError:
        return self.reading.over(what, limit).relocated(entry.relocate)

    def _material(self, name: str, entry: Value) -> None:
        values = plain(entry, scene_keys.MATERIAL)
        textures = {}
        for key, _ in scene_keys.TEXTURES:
            if key in values:
                slot = key.removesuffix("_texture")
                place, file = _value(entry, key), values.pop(key)
                with self._reading_file(place):
                    image = self.reading.image(self.reading.resolve(file, line=place.line), "image", line=place.line)
                    textures[slot] = Texture(image, slot in _SRGB)
        self.recipe["materials", name] = values
        self.material_numbers[name] = len(self.materials)
        self.materials.append(scene_values.material(name, values, textures))

    def _light(self, name: str, entry: Value) -> None:
        self.recipe["lights", name] = values = plain(entry, scene_keys.LIGHT)
        if "type" in values:
            try:
                self.lights.append(scene_values.light(name, values))
            except ValueError as problem:
                self.validator.report(entry, "RG321", f"light '{shown(name)}': {problem}", key=True)

    def _camera(self, name: str, entry: Value) -> None:
        self.recipe["cameras", name] = values = plain(entry, scene_keys.CAMERA)
        try:
            self.cameras[name] = scene_values.camera(name, values)
        except ValueError as problem:
            self.validator.report(entry, "RG321", f"camera '{shown(name)}': {problem}", key=True)
            self.cameras[name] = scene_values.camera(name, {})

    def _orbit(self, entry: Value | None) -> Orbit | None:
        if entry is None or entry.data is None:
            return None
        self._check_name(entry, "camera", self.cameras, "cameras")
        values = plain(entry, scene_keys.ORBIT)
        return Orbit(values.get("camera", ""), values.get("degrees_per_second", 30.0))

    def _environment(self, entry: Value | None) -> Environment | None:
        values = plain(entry, scene_keys.ENVIRONMENT) if entry is not None else {}
        if entry is None or "file" not in values:
            return None
        self.recipe["environment", ""] = values
        place, file = _value(entry, "file"), values["file"]
        if file != "sky":
            for key in ("sun", "turbidity"):
                if (value := entry.get(key)) is not None and value.data is not None:
                    self.validator.report(value, "RG321", f"'{key}' goes with `file: sky`", key=True)
        with self._reading_file(place):
            environment = named(file, self.lights, values)
            if environment is None:
                image = self.reading.image(self.reading.resolve(file, line=place.line), "image", line=place.line)
                environment = Environment(image, image.size)
            turn = math.radians(values.get("rotate_degrees", 0.0))
            return replace(environment, intensity=values.get("intensity", 1.0), rotate=turn)
        return None

    def _object(self, name: str, entry: Value, materials: Sequence[str]) -> None:
        self._check_name(entry, "material", materials, "materials")
        values = plain(entry, scene_keys.OBJECT)
        keys = [key.name for key in scene_keys.OBJECT.keys]
        self.recipe["objects", name] = {key: values[key] for key in keys if key in values}
        if "shape" in values:
            self._shape(name, entry, values)
        elif "file" in values:
            place = _value(entry, "file")
            with self._reading_file(place):
                self._file(name, entry, self._read_file(name, values["file"], place), values, materials)

    def _material_index(self, name: str | None) -> int:
        if name not in self.material_numbers:
            self.material_numbers[name] = len(self.materials)
            self.materials.append(_DEFAULT)
        return self.material_numbers[name]

    def _shape(self, name: str, entry: Value, values: dict[str, Any]) -> None:
        shape = values["shape"]
        numbers = {key.name: values.get(key.name, key.default) for key in SHAPES[shape].keys}
        key = (shape, *sorted(numbers.items()))
        if key not in self.shapes:
            self.vertices += SHAPES[shape].vertices(numbers)
            if self.vertices > self.reading.limits.vertices:
                raise self._over(entry, f"shapes have {self.vertices:,} vertices", "vertices")
            self.shapes[key] = len(self.meshes), build(shape, **numbers)
            self.meshes.append(self.shapes[key][1][0].mesh)  # all parts of a shape share it
        mesh, parts = self.shapes[key]
        world, base = scene_values.placed(values), self._material_index(values.get("material"))
        casts_shadow, hidden = values.get("casts_shadow", True), values.get("hidden", False)
        first = len(self.objects)
        for part in parts:
            material, part_name = base, name + part.suffix
            if part.changes:
                material = len(self.materials)
                changes: dict[str, Any] = dict(part.changes)
                self.materials.append(replace(self.materials[base], name=part_name, **changes))
            transform = world @ part.local
            self.objects.append(Object(part_name, mesh, material, transform, casts_shadow, hidden, name))
        self.placements[name] = Placement(tuple((first + k, part.local) for k, part in enumerate(parts)))

    def _file(self, name: str, entry: Value, file: _File, values: dict[str, Any], materials: Sequence[str]) -> None:
        scene, world = file.scene, scene_values.placed(values)
        overrides = self._overrides(_entries(entry, "overrides"), name, scene, materials)
        objects, lights, cameras = [], [], []
        for part in scene.objects:
            changes = values | overrides.get(part.name, overrides.get(part.node, {}))
            material = changes.get("material")
            objects.append((len(self.objects), part.transform))
            self.objects.append(
                Object(
                    f"{name}/{part.name}",
                    part.mesh + file.first_mesh,
                    part.material + file.first_material if material is None else self._material_index(material),
                    world @ part.transform,
                    changes.get("casts_shadow", part.casts_shadow),
                    changes.get("hidden", part.hidden),
                    f"{name}/{part.node}",
                )
            )
        for light in scene.lights:
            local = scene_values.light_matrix(light)
            lights.append((len(self.lights), local))
            self.lights.append(scene_values.moved_light(replace(light, name=f"{name}/{light.name}"), world @ local))
        for camera in scene.cameras.values():
            camera_name = f"{name}/{camera.name}"
            cameras.append((camera_name, camera.transform))
            self.cameras[camera_name] = replace(camera, name=camera_name, transform=rigid(world @ camera.transform))
        self.placements[name] = Placement(tuple(objects), tuple(lights), tuple(cameras))

    def _read_file(self, name: str, file: str, place: Value) -> _File:
        path = self.reading.resolve(file, line=place.line)
        if path not in self.files:
            if path.suffix.lower() in MESHES:
                self.reading.check_file(path, "file")
            inner = Reading(path, self.reading.check_path, self.reading.limits, self.reading.extensions)
            unknown = Problem("RG303", f"'{shown(file)}' is not a mesh file; a mesh ends in")
            scene = read_mesh(path, inner, unknown)
            self.reading.add_warnings(inner.warnings)
            self.files[path] = _File(scene, len(self.meshes), len(self.materials))
            self.meshes += scene.meshes
            self.materials += [replace(material, name=f"{name}/{material.name}") for material in scene.materials]
        return self.files[path]

    def _overrides(
        self, entries: Mapping[str, Value], name: str, scene: Scene, materials: Sequence[str]
    ) -> dict[str, dict[str, Any]]:
        """Node or part name to its changed values."""
        known = dict.fromkeys(word for part in scene.objects for word in (part.node, part.name))
        for node, entry in entries.items():
            if node not in known:
                text = f"object '{shown(name)}': its file has no node '{shown(node)}'{suggestion(node, known)}"
                self.validator.report(entry, "RG322", text, key=True)
            self._check_name(entry, "material", materials, "materials")
        return {node: plain(entry, scene_keys.OVERRIDE) for node, entry in entries.items()}

    def _keyframes(self, top: Value, names: dict[str, tuple[str, ...]]) -> dict[str, tuple[tuple[float, Any], ...]]:
        result = {}
        for path, entry in _entries(top, "keyframes").items():
            key = self._named_key(str(path), entry, names)
            if key is None:
                continue
            if not isinstance(entry.data, dict) or not entry.data:
                what = "empty" if entry.data == {} else entry.kind
                text = f"keyframes of '{shown(path)}' are {what}, not a mapping of seconds to values"
                self.validator.report(entry, "RG321", text)
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
        """The key that a dotted path names; only numbers, vectors and colours can be animated."""
        section, _, rest = path.partition(".")
        name, key = ("", rest) if section == "environment" else rest.rpartition(".")[::2]
        known = names.get(section, ())
        moving: dict[str, Key] = {}
        if section not in scene_keys.ANIMATED:
            hint = suggestion(section, scene_keys.ANIMATED)
            text = f"keyframes: there is no section '{shown(section)}'{hint}"
        elif section != "environment" and name not in known:
            hint = suggestion(name, known) or f"; there are no {section}"
            text = f"keyframes: there is no '{shown(name)}' under {section}{hint}"
        else:
            moving = scene_keys.moving(section)
            text = f"keyframes: {section} have no moving key '{shown(key)}'{suggestion(key, moving)}"
        if key not in moving:
            self.validator.report(entry, "RG322", text, key=True)
        return moving.get(key)


def _entries(value: Value, section: str) -> dict[str, Value]:
    entries = value.get(section)
    return dict(entries.items()) if entries is not None else {}


def _value(entry: Value, key: str) -> Value:
    value = entry.get(key)
    assert value is not None  # the caller has read it
    return value
