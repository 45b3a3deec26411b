"""Scene files: objects placed from shapes and mesh files, with materials, lights, cameras, keyframes (design.md §5).

All mistakes of a file are found before it stops, each with line, column and the nearest right name.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rendergraph.document import Value, load, shown
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.scene import scene_build, scene_keys
from rendergraph.scene.files import Reading
from rendergraph.scene.geometry import rigid
from rendergraph.scene.keys import Key
from rendergraph.scene.meshes import MESHES, read_mesh
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
from rendergraph.scene.scene_check import Checker
from rendergraph.scene.shapes import SHAPES, Part, build

_DEFAULT = Material("default", base_color=(0.8, 0.8, 0.8, 1.0))
_SRGB = ("base_color", "emissive", "specular_color")


def read_scene(path: Path, reading: Reading) -> Scene:
    """The scene a scene file describes.

    Raises:
        InputError: with every mistake of the file, or the first of a mesh file it names.
    """
    document = load(path, keep_going=True)
    reader = _Reader(path, reading, list(document.problems))
    scene = reader.read(document.root)
    if reader.check.problems:
        raise InputError(sorted(reader.check.problems, key=lambda problem: (problem.place is None, problem.place)))
    return scene


@dataclass
class _File:
    """A mesh file already read: where its meshes and materials lie in the scene."""

    scene: Scene
    first_mesh: int
    first_material: int


@dataclass
class _Made:
    """What the objects have made so far."""

    objects: list[Object] = field(default_factory=list)
    meshes: list[Mesh] = field(default_factory=list)
    materials: list[Material] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    cameras: dict[str, Camera] = field(default_factory=dict)
    placements: dict[str, Placement] = field(default_factory=dict)
    shapes: dict[tuple[Any, ...], tuple[int, list[Part]]] = field(default_factory=dict)
    files: dict[Path, _File] = field(default_factory=dict)
    numbers: dict[str | None, int] = field(default_factory=dict)
    vertices: int = 0


class _Reader:
    """Reads the sections in the order they refer to each other."""

    def __init__(self, path: Path, reading: Reading, problems: list[Problem]) -> None:
        self.path, self.reading = path, reading
        self.check = Checker()
        self.check.problems = problems
        self.recipe: dict[tuple[str, str], dict[str, Any]] = {}
        self.made = _Made()

    def read(self, root: Value) -> Scene:
        """The scene; only to be used where no problem was found."""
        if not isinstance(root.data, dict):
            self.check.say(root, "RG321", f"a scene file is a mapping that starts with 'scene: 1', not {root.kind}")
            return Scene(self.path.stem)
        top = self.check.values(root, scene_keys.TOP, "the scene", {})
        sections = {
            name: self.check.mapping(top[name], name) if name in top else {}
            for name in ("objects", "materials", "lights", "cameras")
        }
        names = {name: tuple(entries) for name, entries in sections.items()}
        for name, entry in sections["materials"].items():
            self._material(name, entry)
        for name, entry in sections["lights"].items():
            self._light(name, entry)
        for name, entry in sections["cameras"].items():
            self._camera(name, entry)
        for name, entry in sections["objects"].items():
            self._object(name, entry, names)
        environment = self._environment(top["environment"]) if "environment" in top else None
        keyframes = self._keyframes(top["keyframes"], names) if "keyframes" in top else {}
        orbit = None
        if "orbit" in top:
            cameras = {"cameras": tuple(self.made.cameras)}
            found = self.check.values(top["orbit"], scene_keys.ORBIT, "orbit", cameras)
            orbit = Orbit(found.get("camera", ""), found.get("degrees_per_second", 30.0))
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

    # Surfaces, lights, cameras ----------------------------------------------------------------------------------------

    def _material(self, name: str, entry: Value) -> None:
        values = self.check.values(entry, scene_keys.MATERIAL, f"material '{shown(name)}'", {})
        textures = {}
        for key, _ in scene_keys.TEXTURES:
            if key in values:
                slot = key.removesuffix("_texture")
                image = self._image(entry, key, values.pop(key))
                if image is not None:
                    textures[slot] = Texture(image, slot in _SRGB)
        self.recipe["materials", name] = values
        self.made.numbers[name] = len(self.made.materials)
        self.made.materials.append(scene_build.material(name, values, textures))

    def _image(self, entry: Value, key: str, name: str) -> Any:
        place = entry.get(key)
        assert place is not None  # its value was just read
        try:
            return self.reading.image(self.reading.beside(name, line=place.line), "image", line=place.line)
        except InputError as problem:
            self._take(problem, place)
            return None

    def _take(self, problem: InputError, place: Value) -> None:
        """Keep problems of a named file; those without a place of their own get the name's."""
        for found in problem.problems:
            if found.place is None or found.place.file == str(self.path):
                found = place.problem(found.code, found.text)
            self.check.problems.append(found)

    def _light(self, name: str, entry: Value) -> None:
        values = self.check.values(entry, scene_keys.LIGHT, f"light '{shown(name)}'", {})
        self.recipe["lights", name] = values
        if "type" in values:
            try:
                self.made.lights.append(scene_build.light(name, values))
            except ValueError as problem:
                self.check.say(entry, "RG321", f"light '{shown(name)}': {problem}", key=True)

    def _camera(self, name: str, entry: Value) -> None:
        values = self.check.values(entry, scene_keys.CAMERA, f"camera '{shown(name)}'", {})
        self.recipe["cameras", name] = values
        try:
            self.made.cameras[name] = scene_build.camera(name, values)
        except ValueError as problem:
            self.check.say(entry, "RG321", f"camera '{shown(name)}': {problem}", key=True)
            self.made.cameras[name] = scene_build.camera(name, {})

    def _environment(self, entry: Value) -> Environment | None:
        values = self.check.values(entry, scene_keys.ENVIRONMENT, "environment", {})
        if "file" not in values:
            return None
        image = self._image(entry, "file", values["file"])
        self.recipe["environment", ""] = values
        if image is None:
            return None
        return Environment(image, values.get("intensity", 1.0), math.radians(values.get("rotate_degrees", 0.0)))

    # Objects ----------------------------------------------------------------------------------------------------------

    def _object(self, name: str, entry: Value, names: dict[str, tuple[str, ...]]) -> None:
        what = f"object '{shown(name)}'"
        shape, file = entry.get("shape"), entry.get("file")
        given = [value for value in (shape, file) if value is not None and value.data is not None]
        if (entry.data is None or isinstance(entry.data, dict)) and len(given) != 1:
            self.check.say(entry, "RG321", f"{what} needs either 'shape' or 'file'", key=True)
        own: tuple[Key, ...] = ()
        if shape is not None and shape.data in SHAPES:
            own = SHAPES[str(shape.data)].keys
        elif file is not None:
            own = (scene_keys.OVERRIDES,)
        elif shape is not None:  # the shape's own keys are not known: say no more than that
            own = tuple({key.name: key for kind in SHAPES.values() for key in kind.keys}.values())
        values = self.check.values(entry, (*scene_keys.OBJECT, *own), what, names)
        self.recipe["objects", name] = {key.name: values[key.name] for key in scene_keys.OBJECT if key.name in values}
        if len(given) == 1 and "shape" in values:
            numbers = {key.name: values.get(key.name, key.default) for key in own}
            self._shape(name, entry, numbers, values)
        elif len(given) == 1 and "file" in values:
            self._file(name, entry, values, names)

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
        world, base = scene_build.placed(values), self._material_index(values.get("material"))
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

    def _file(self, name: str, entry: Value, values: dict[str, Any], names: dict[str, tuple[str, ...]]) -> None:
        place = entry.get("file")
        assert place is not None  # its value was just read
        try:
            found = self._read_file(name, values["file"], place)
        except InputError as problem:
            self._take(problem, place)
            return
        made, scene, world = self.made, found.scene, scene_build.placed(values)
        overrides = self._overrides(values.get("overrides"), name, scene, names)
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
            local = scene_build.light_matrix(light)
            lights.append((len(made.lights), local))
            made.lights.append(scene_build.moved_light(replace(light, name=f"{name}/{light.name}"), world @ local))
        for camera in scene.cameras.values():
            word = f"{name}/{camera.name}"
            cameras.append((word, camera.transform))
            made.cameras[word] = replace(camera, name=word, transform=rigid(world @ camera.transform))
        made.placements[name] = Placement(tuple(objects), tuple(lights), tuple(cameras))
        self._count_objects(entry)

    def _read_file(self, name: str, file: str, place: Value) -> _File:
        path = self.reading.beside(file, line=place.line)
        if path in self.made.files:
            return self.made.files[path]
        if path.suffix.lower() in MESHES:
            self.reading.exists(path, "file")
        inner = Reading(path, self.reading.check_path, self.reading.limits, self.reading.extensions)
        unknown = Problem("RG303", f"'{shown(file)}' is no mesh file; a mesh ends in")
        scene = read_mesh(path, inner, unknown)
        self.reading.add_warnings(inner.warnings)
        made = self.made
        made.files[path] = _File(scene, len(made.meshes), len(made.materials))
        made.meshes += scene.meshes
        made.materials += [replace(material, name=f"{name}/{material.name}") for material in scene.materials]
        return made.files[path]

    def _overrides(
        self, value: Value | None, name: str, scene: Scene, names: dict[str, tuple[str, ...]]
    ) -> dict[str, dict[str, Any]]:
        """Node or part name to what is changed."""
        if value is None:
            return {}
        known = dict.fromkeys(word for part in scene.objects for word in (part.node, part.name))
        result = {}
        for node, entry in self.check.mapping(value, f"overrides of '{shown(name)}'").items():
            if node not in known:
                text = f"object '{shown(name)}': its file has no node '{shown(node)}'{suggestion(node, known)}"
                self.check.say(entry, "RG322", text, key=True)
            result[node] = self.check.values(entry, scene_keys.OVERRIDE, f"override '{shown(node)}'", names)
        return result

    def _count_objects(self, entry: Value) -> None:
        if len(self.made.objects) > self.reading.limits.objects:
            raise self._over(entry, f"{len(self.made.objects):,} objects", "objects")

    def _over(self, entry: Value, what: str, limit: str) -> InputError:
        return InputError(entry.problem("RG307", self.reading.over(what, limit).problems[0].text))

    # Keyframes --------------------------------------------------------------------------------------------------------

    def _keyframes(self, section: Value, names: dict[str, tuple[str, ...]]) -> dict[str, tuple[tuple[float, Any], ...]]:
        result = {}
        for path, entry in self.check.mapping(section, "keyframes").items():
            key = self._named_key(path, entry, names)
            if key is None:
                continue
            if not isinstance(entry.data, dict) or not entry.data:
                what = "empty" if entry.data == {} else entry.kind
                self.check.say(
                    entry, "RG321", f"keyframes of '{shown(path)}' are {what}, not a mapping of seconds to values"
                )
                continue
            frames = []
            for time, value in entry.items():
                if isinstance(time, bool) or not isinstance(time, int | float) or not math.isfinite(time):
                    self.check.say(
                        value, "RG321", f"keyframes of '{shown(path)}': '{shown(time)}' is no time in seconds", key=True
                    )
                    continue
                found = self.check.value(value, key, f"keyframe {time:g} s", names)
                if found is None and value.data is None:
                    self.check.say(value, "RG321", f"keyframe {time:g} s of '{shown(path)}' has no value")
                frames.append((float(time), found))
            result[path] = tuple(sorted(frames, key=lambda frame: frame[0]))
        return result

    def _named_key(self, path: str, entry: Value, names: dict[str, tuple[str, ...]]) -> Key | None:
        """The key a dotted path names; only numbers, vectors and colours move."""
        section, _, rest = path.partition(".")
        if section not in scene_keys.ANIMATED:
            hint = suggestion(section, scene_keys.ANIMATED)
            self.check.say(entry, "RG322", f"keyframes name no section '{shown(section)}'{hint}", key=True)
            return None
        name, word = ("", rest) if section == "environment" else rest.rpartition(".")[::2]
        known = names.get(section, ())
        if section != "environment" and name not in known:
            hint = suggestion(name, known) or f"; there are no {section}"
            self.check.say(entry, "RG322", f"keyframes: there is no '{shown(name)}' under {section}{hint}", key=True)
            return None
        moving = {
            key.name: key for key in scene_keys.ANIMATED[section] if key.kind in ("number", "vector", "color", "scale")
        }
        if word not in moving:
            text = f"keyframes: {section} have no moving key '{shown(word)}'{suggestion(word, moving)}"
            self.check.say(entry, "RG322", text, key=True)
            return None
        return moving[word]
