"""Scene files: objects placed from shapes and mesh files, with materials, lights, cameras, keyframes (design.md §5).

All mistakes of a file are gathered, each with line, column and the nearest valid name.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from rendergraph.declare import TextureKind
from rendergraph.declare.extensions import Section
from rendergraph.document import Source, Value, from_plain, load, merge_patch, shown
from rendergraph.errors import InputError, Option, Problem, suggestion
from rendergraph.facts import NO_EXTRA, Extra
from rendergraph.keys import Key, Table, Validator, plain
from rendergraph.keys.values import FILE
from rendergraph.pipelines.environments import SKIES, named
from rendergraph.pipelines.shapes import SHAPES, ShapePart, build
from rendergraph.pipelines.textures import TEXTURES as SHIPPED_TEXTURES
from rendergraph.resources import is_name, shipped_scenes
from rendergraph.scene import animate, model, scene_keys, scene_values
from rendergraph.scene.geometry import rigid
from rendergraph.scene.reading import MESHES, Reading, inside, read_mesh
from rendergraph.scene.repeat import Copies, copies, count_of, read_columns
from rendergraph.scene.rig import Curve, quaternion
from rendergraph.stamps import record_read

if TYPE_CHECKING:
    from rendergraph.scene.rig import Rig

_DEFAULT = model.Material("default", base_color=(0.8, 0.8, 0.8, 1.0))
SECTION_NAMES = ("objects", "materials", "lights", "cameras")
_WORDS = {"ease": scene_keys.EASE, "slerp": scene_keys.SLERP}
"""Keys among the times of keyframes."""
_GENERATED = ("base_color", "normal", "metallic_roughness", "occlusion")
_SRGB = ("base_color", "emissive", "specular_color", "sheen_color")


def read_scene(path: Path | None, reading: Reading, changes: Value | None = None) -> model.Scene:
    """Read a scene file, what it extends, and changes; raise all mistakes, but only the first of a mesh file."""
    validator = Validator(scene_keys.CODES)
    root = Value({}, Source("scene")) if path is None else _extended(path, reading, validator, ())
    if changes is not None:
        whole = merge_patch(root, changes)
        _check_names(root, changes, whole, validator)
        root = whole
        root = root.updated({"scene": Value(1, root.source)}) if "scene" not in root.mapping else root
    reader = _Reader(reading, Validator(scene_keys.CODES, validator.problems))
    scene = reader.read(root)
    if reader.validator.problems:
        raise InputError(sorted(reader.validator.problems, key=_by_place))
    return scene


def _extended(path: Path, reading: Reading, validator: Validator, before: tuple[Path, ...]) -> Value:
    """Return the values of a scene file, merged into those of the file that it extends."""
    if path.suffix.lower() in MESHES:
        source = Source(Option("scene"))
        return from_plain({"objects": {path.stem: {"file": path.resolve(), "animation": {}}}}, source)
    document = load(path, limits=reading.limits.yaml, keep_going=True)
    validator.problems += document.problems
    root, base = document.root, document.root.get("extends")
    if base is None or not isinstance(base.data, str):
        return root
    shipped = shipped_scenes()
    if is_name(base.data) and base.data not in shipped:
        text = f"there is no shipped scene '{base.data}'{suggestion(base.data, shipped, most=20)}"
        raise InputError([*validator.problems, base.problem("RG015", text)])
    found = shipped.get(base.data) or reading.resolve(base.data, line=base.line, file=path)
    reading.check_file(found, "scene file")
    if found in (path, *before):
        names = " → ".join(file.name for file in (*before, path, found))
        raise InputError([*validator.problems, base.problem("RG118", f"the file extends itself: {names}")])
    own = root.with_data({key: value for key, value in root.items() if key != "extends"})
    return merge_patch(_extended(found, reading, validator, (*before, path)), own)


def _check_names(root: Value, changes: Value, whole: Value, validator: Validator) -> None:
    """Report settings such as `scene.lights.sn.color` for entries that do not exist, and remove them."""
    for section in SECTION_NAMES:
        known = _entries(root, section)
        for name, entry in _entries(changes, section).items():
            option = entry.source.origin
            if name not in known and isinstance(option, Option) and option.path.count(".") > 2:
                hint = suggestion(str(name), known) or f"; -s 'scene.{section}.{name}={{…}}' adds one"
                text = f"there is no {section.removesuffix('s')} '{shown(name)}'{hint}"
                validator.report(entry, "RG322", text)
                del whole.mapping[section].mapping[name]


def _by_place(problem: Problem) -> tuple[bool, str, int, int]:
    place = problem.place
    return (False, place.file, place.line, place.column) if place else (True, "", 0, 0)


class _File(Struct):
    """A mesh file that has been read, with the indices of its meshes, materials and rig in the scene."""

    scene: model.Scene
    first_mesh: int
    first_material: int
    rig: int | None


class _Reader:
    """Reads the sections in the order of their references to each other."""

    def __init__(self, reading: Reading, validator: Validator) -> None:
        self.path, self.reading, self.validator = reading.path, reading, validator
        self.recipe: dict[tuple[str, str], dict[str, Any]] = {}
        self.objects: list[model.Object] = []
        self.meshes: list[model.Mesh] = []
        self.materials: list[model.Material] = []
        self.lights: list[model.Light] = []
        self.cameras: dict[str, model.Camera] = {}
        self.placements: dict[str, model.Placement] = {}
        self.copies: dict[tuple[str, str], Copies] = {}
        self.shapes: dict[tuple[Any, ...], tuple[int, list[ShapePart]]] = {}
        self.files: dict[tuple[Any, ...], _File] = {}
        self.mesh_files: dict[Path, model.Scene] = {}
        self.rigs: list[Rig] = []
        self.material_numbers: dict[str | None, int] = {}
        self.names: dict[str, tuple[str, ...]] = {}
        self.sections: Mapping[str, Table] = scene_keys.SECTIONS
        self.plugin_keys: dict[str, frozenset[str]] = {}
        self.kinds: Mapping[str, TextureKind] = SHIPPED_TEXTURES
        self.vertices = 0
        self.ground: float | None = None
        self.variants: dict[str, dict[int, int]] = {}

    def read(self, root: Value) -> model.Scene:
        """Return the scene, which may be used only if no problem was found."""
        self.names = {section: tuple(_entries(root, section)) for section in SECTION_NAMES}
        top = self.validator.file(root, self._table(root), "`scene: 1` and `objects`")
        if top is None:
            return model.Scene(self.path.stem)
        readers = {"materials": self._material, "lights": self._light, "cameras": self._camera, "objects": self._object}
        for section, read in readers.items():
            for name, entry in _entries(top, section).items():
                read(name, entry)
        environment = self._environment(top.get("environment"))
        scene = model.Scene(
            self.path.stem,
            self.path,
            tuple(self.objects),
            tuple(self.meshes),
            tuple(self.materials),
            tuple(self.lights),
            self.cameras,
            environment,
            self._keyframes(top),
            self._orbit(top.get("orbit")),
            recipe=self.recipe,
            placements=self.placements,
            copies=self.copies,
            plugin_keys=self.plugin_keys,
            rigs=tuple(self.rigs),
            ground=self.ground,
            variants=self.variants,
            follows=self._follows(top),
        )
        return animate.following(scene, {}) if scene.follows and not self.validator.problems else scene

    def _follows(self, top: Value) -> dict[str, tuple[int, ...]]:
        """Return by camera the objects that it follows: a name under `objects`, or that of a copy."""
        found = {}
        for name, entry in _entries(top, "cameras").items():
            self._check_name(entry.get("follow"), "objects", self.placements)
            placement = self.placements.get(str(self.recipe["cameras", name].get("follow")))
            if placement is not None:
                found[name] = tuple(index for index, _ in placement.objects)
        return found

    def _table(self, root: Value) -> Table:
        """Return the table of the file, with keys of plugins if it has keys that are not rendergraph's own."""
        asked = _unknown_keys(root)
        if has_unknown_kinds := not _kinds(root) <= self.kinds.keys():
            self.kinds = {**self.kinds, **self.reading.extensions.textures()}
        if not any(asked.values()) and not has_unknown_kinds:
            return scene_keys.SCENE
        self.sections = scene_keys.with_plugins(self.reading.extensions, asked, self.kinds)
        for section, own in scene_keys.SECTIONS.items():
            self.plugin_keys[section] = frozenset(key.name for key in self.sections[section].keys[len(own.keys) :])
        is_known = all(names <= self.plugin_keys[section] for section, names in asked.items())
        if not is_known or not _kinds(root) <= self.kinds.keys():
            self.validator.problems += self.reading.extensions.problems
        return scene_keys.scene_table(self.sections)

    def _plain(self, section: str, entry: Value) -> dict[str, Any]:
        """Return the values of an entry, with those of plugins' keys in its `extra`, where images are opened."""
        values: dict[str, Any] = plain(entry, self.sections[section])
        added = {key: values.pop(key) for key in self.plugin_keys.get(section, frozenset()) & values.keys()}
        for key in self.sections[section].keys if added else ():
            if key.name in added and key.type is FILE:
                del added[key.name]
                with self._reading_file(entry.mapping[key.name]):
                    added[key.name] = self._image(entry.mapping[key.name])
        return values | {"extra": Extra(added)} if added else values

    def _check_name(self, value: Value | None, section: str, known: Iterable[str] | None = None) -> None:
        """Report the name of an entry that a section does not have."""
        known = self.names[section] if known is None else known
        if value is not None and value.data is not None and str(value.data) not in known:
            hint = suggestion(str(value.data), known) or f"; there are no {section}"
            text = f"there is no {section.removesuffix('s')} '{shown(value.data)}'{hint}"
            self.validator.report(value, "RG322", text)

    @contextmanager
    def _reading_file(self, place: Value) -> Iterator[None]:
        """Collect the problems of the file named at a place; those without a place of their own get this one."""
        try:
            yield
        except InputError as error:
            for problem in error.problems:
                here = str(self.path), str(place.source.path)
                is_here = problem.place is None or problem.place.file in here
                self.validator.problems.append(place.relocate(problem) if is_here else problem)

    def _over(self, entry: Value, what: str, limit: str) -> InputError:
        return self.reading.over(what, limit).relocated(entry.relocate)

    def _material(self, name: str, entry: Value) -> None:
        values = self._plain("materials", entry)
        whole = values.pop("texture", {})
        textures = {slot: self._generated(slot, whole) for slot in _GENERATED if "kind" in whole}
        for key, _ in scene_keys.TEXTURES:
            if key in values:
                slot = key.removesuffix("_texture")
                place, file = entry.mapping[key], values.pop(key)
                if isinstance(file, dict):
                    textures |= {slot: self._generated(slot, file)} if "kind" in file else {}
                    continue
                with self._reading_file(place):
                    textures[slot] = model.Texture(self._image(place), slot in _SRGB)
        self.recipe["materials", name] = values
        self.material_numbers[name] = len(self.materials)
        self.materials.append(scene_values.material(name, values, textures))

    def _generated(self, slot: str, values: Mapping[str, Any]) -> model.Texture:
        """Return one slot's map of a generated texture."""
        kind = self.kinds[values["kind"]]
        given = {"seed": 0, "resolution": 512, **{key.name: key.default for key in kind.keys}, **values}
        rate = 1 / given.pop("scale", 1.0)
        name, size = given.pop("kind"), (given["resolution"],) * 2
        which: Any = "color" if slot in _SRGB else "normal" if slot.endswith("normal") else "surface"
        record_read(Path(kind.shader))
        made = model.GeneratedTexture(Path(kind.shader), tuple(given.items()), which)
        image = model.ImageSource(made.shader, None, f"texture {name}", None, size, 4, made)
        return model.Texture(image, slot in _SRGB, transform=None if rate == 1 else (rate, 0.0, 0.0, 0.0, rate, 0.0))

    def _light(self, name: str, entry: Value) -> None:
        self.recipe["lights", name] = values = self._plain("lights", entry)
        if "type" in values:
            try:
                light = scene_values.light(name, values)
            except ValueError as problem:
                self.validator.report(entry, "RG321", f"light '{shown(name)}': {problem}", key=True)
                return
            copied = self._copies("lights", name, entry, values)
            self.lights += [light] if copied is None else copied.lights(light)
            if len(self.lights) > self.reading.limits.lights:
                raise self._over(entry, f"{len(self.lights):,} lights", "lights")

    def _copies(self, section: str, name: str, entry: Value, values: dict[str, Any]) -> Copies | None:
        """Return the copies of an entry, zero if its `repeat` is wrong; None without `repeat`."""
        repeat = values.pop("repeat", None)
        if not repeat:
            return None
        place = entry.mapping["repeat"]
        for other in self.names[section]:
            if other.startswith(f"{name}.") and other.removeprefix(f"{name}.").isdigit():
                text = f"'{shown(other)}' is the name of a copy of '{shown(name)}'; rename one"
                self.validator.report(entry, "RG321", text, key=True)
        limit = "objects" if section == "objects" else "lights"
        most = getattr(self.reading.limits, limit)
        found = Copies(np.zeros((0, 3)))
        columns: dict[str, Any] = {}
        if "file" in repeat:
            with self._reading_file(place.mapping["file"]):
                columns = self._columns(section, place.mapping["file"], most)
        with self._reading_file(place):
            count = len(next(iter(columns.values()))) if columns else count_of(repeat)
            if count > most:
                raise self._over(place, f"{count:,} copies", limit)
            found = copies(repeat, columns) if count else found
        self.copies[section, name] = found
        return found

    def _columns(self, section: str, place: Value, most: int) -> dict[str, Any]:
        path = self._resolve(place)
        data = self.reading.read(path, "file of copies")
        try:
            return read_columns(data, path.suffix.lower(), section, most, self.reading.limits.memory_bytes)
        except ValueError as problem:
            raise InputError(place.problem("RG321", f"'{shown(place.data)}' {problem}")) from None

    def _camera(self, name: str, entry: Value) -> None:
        self.recipe["cameras", name] = values = self._plain("cameras", entry)
        eye = values.get("eye", (0.0, 0.0, 5.0))
        ahead: Any = tuple(np.add(eye, (0, 0, -1)).tolist()) if "follow" in values else None  # replaced later
        try:
            self.cameras[name] = scene_values.camera(name, values, ahead)
        except ValueError as problem:
            self.validator.report(entry, "RG321", f"camera '{shown(name)}': {problem}", key=True)
            self.cameras[name] = scene_values.camera(name, {})

    def _orbit(self, entry: Value | None) -> model.Orbit | None:
        if entry is None or entry.data is None:
            return None
        self._check_name(entry.get("camera"), "cameras", self.cameras)
        values = plain(entry, scene_keys.ORBIT)
        return model.Orbit(values.get("camera", ""), values.get("degrees_per_second", 30.0))

    def _environment(self, entry: Value | None) -> model.Environment | None:
        if entry is None:
            return None
        values = plain(entry, scene_keys.ENVIRONMENT)
        if values.get("ground"):
            self.ground = values.get("ground_height", 0.0)
        if "file" not in values:
            lone = [key for key in values if key not in ("ground", "ground_height")]
            if lone or not values.get("ground"):
                key = entry.get(lone[0]) if lone else None
                self.validator.report(key or entry, "RG321", "environment needs 'file', or `ground: true` alone")
            return None
        self.recipe["environment", ""] = values
        place, file = entry.mapping["file"], values["file"]
        if not self._check_sky(entry, file, values):
            return None
        with self._reading_file(place):
            environment = named(file, self.lights, values)
            if environment is None:
                image = self._image(place)
                environment = model.Environment(image, image.size)
            turn = math.radians(values.get("rotate_degrees", 0.0))
            return replace(environment, intensity=values.get("intensity", 1.0), rotate=turn)
        return None

    def _check_sky(self, entry: Value, file: str, values: Mapping[str, Any]) -> bool:
        """Report keys that need a sky, need each other, or contradict each other."""
        given = {key: value for key in scene_keys.SKY_KEYS if (value := entry.get(key)) and value.data is not None}
        wrong = {} if file in SKIES else {key: f"'{key}' requires a sky, such as `file: sky`" for key in given}
        for key, other in (("place", "time"), ("time", "place")):
            if key in given and other not in given:
                wrong.setdefault(key, f"'{key}' needs '{other}' beside it")
        if "time" in given:
            try:
                datetime.fromisoformat(values["time"])
            except ValueError as problem:
                wrong["time"] = f"'time' is not a date and time: {problem}"
        ways = [key for key in ("sun", "elevation_degrees", "time") if key in given]
        if len(ways) > 1:
            wrong.setdefault(ways[1], f"'{ways[0]}' and '{ways[1]}' both say where the sun is; keep one")
        for key, text in wrong.items():
            self.validator.report(given[key], "RG321", text, key=True)
        return not wrong

    def _object(self, name: str, entry: Value) -> None:
        self._check_name(entry.get("material"), "materials")
        values = self._plain("objects", entry)
        choices = entry.get("repeat", "choose", "material")
        for choice in choices.data if choices is not None and isinstance(choices.data, list) else ():
            self._check_name(choice, "materials")
        copied = self._copies("objects", name, entry, values)
        keys = ["extra", *(key.name for key in scene_keys.OBJECT.keys)]
        self.recipe["objects", name] = {key: values[key] for key in keys if key in values}
        world = scene_values.placed(values)
        placed = [(name, world)] if copied is None else copied.placed(name, world)
        chosen = copied.values.get("material") if copied is not None else None
        one = values.get("material")
        each = [(*copy, chosen[number] if chosen else one) for number, copy in enumerate(placed)]
        if "shape" in values:
            self._shape(name, entry, values, each)
        elif "file" in values:
            with self._reading_file(entry.mapping["file"]):
                file = self._read_file(name, values["file"], entry)
                overrides = self._overrides(_entries(entry, "overrides"), name, file.scene)
                self._check_count(entry, len(each) * len(file.scene.objects))
                for copy, matrix, material in each:
                    self._file(copy, matrix, file, values | {"material": material}, overrides)
                if file.rig is not None:
                    before = self.rigs[file.rig].placements
                    copied_to = tuple((copy, matrix) for copy, matrix, _ in each)
                    self.rigs[file.rig] = replace(self.rigs[file.rig], placements=(*before, *copied_to))

    def _check_count(self, entry: Value, more: int) -> None:
        if len(self.objects) + more > self.reading.limits.objects:
            raise self._over(entry, f"{len(self.objects) + more:,} objects", "objects")

    def _material_index(self, name: str | None) -> int:
        if name not in self.material_numbers:
            self.material_numbers[name] = len(self.materials)
            self.materials.append(_DEFAULT)
        return self.material_numbers[name]

    def _shape(
        self, name: str, entry: Value, values: dict[str, Any], placed: Sequence[tuple[str, model.Matrix, str | None]]
    ) -> None:
        """Add the copies of a shape, which share its mesh; copies with the same material also share its parts."""
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
        self._check_count(entry, len(placed) * len(parts))
        casts_shadow, hidden = values.get("casts_shadow", True), values.get("hidden", False)
        made: dict[tuple[int, str], int] = {}
        for copy, world, material_name in placed:
            base = self._material_index(material_name)
            first = len(self.objects)
            for part in parts:
                material = base
                if part.changes:
                    if (base, part.suffix) not in made:
                        made[base, part.suffix] = len(self.materials)
                        more: dict[str, Any] = dict(part.changes)
                        self.materials.append(replace(self.materials[base], name=name + part.suffix, **more))
                    material = made[base, part.suffix]
                transform = world @ part.local
                rest = casts_shadow, hidden, copy, values.get("extra", NO_EXTRA)
                self.objects.append(model.Object(copy + part.suffix, mesh, material, transform, *rest))
            self.placements[copy] = model.Placement(tuple((first + k, part.local) for k, part in enumerate(parts)))

    def _file(
        self, name: str, world: model.Matrix, file: _File, values: dict[str, Any], overrides: dict[str, dict[str, Any]]
    ) -> None:
        scene = file.scene
        objects, lights, cameras = [], [], []
        if values.get("variant") in scene.variants:
            scene = scene.with_variant(values["variant"])
        for number, part in enumerate(scene.objects):
            changes = values | overrides.get(part.name, overrides.get(part.node, {}))
            material = changes.get("material")
            for variant, materials in scene.variants.items() if material is None and "variant" not in values else ():
                if number in materials:
                    self.variants.setdefault(variant, {})[len(self.objects)] = materials[number] + file.first_material
            objects.append((len(self.objects), part.transform))
            self.objects.append(
                model.Object(
                    f"{name}/{part.name}",
                    part.mesh + file.first_mesh,
                    part.material + file.first_material if material is None else self._material_index(material),
                    world @ part.transform,
                    changes.get("casts_shadow", part.casts_shadow),
                    changes.get("hidden", part.hidden),
                    f"{name}/{part.node}",
                    Extra({**values.get("extra", NO_EXTRA), **changes["extra"]}) if "extra" in changes else NO_EXTRA,
                    part.pose,
                )
            )
        for number, light in enumerate(scene.lights):
            local = scene.placements[""].lights[number][1] if scene.rigs else scene_values.light_matrix(light)
            lights.append((len(self.lights), local))
            self.lights.append(scene_values.moved_light(replace(light, name=f"{name}/{light.name}"), world @ local))
        for number, camera in enumerate(scene.cameras.values()):
            camera_name = f"{name}/{camera.name}"
            cameras.append((camera_name, scene.placements[""].cameras[number][1] if scene.rigs else camera.transform))
            self.cameras[camera_name] = replace(camera, name=camera_name, transform=rigid(world @ camera.transform))
        self.placements[name] = model.Placement(tuple(objects), tuple(lights), tuple(cameras))

    def _resolve(self, place: Value) -> Path:
        """Return the path written at a place; the user's own may be anywhere."""
        source, file = place.source, str(place.data)
        if isinstance(source.origin, Option):
            return Path(file).resolve()
        if source.path is not None and source.path in shipped_scenes().values():
            return inside(source.path.parent)(source.path.parent / file, place.place)
        return self.reading.resolve(file, line=place.line, file=source.path or Path("x"))

    def _image(self, place: Value) -> model.ImageSource:
        return self.reading.image(self._resolve(place), "image", line=place.line)

    def _read_file(self, name: str, file: str, entry: Value) -> _File:
        path = self._resolve(entry.mapping["file"])
        if path not in self.mesh_files:
            if path.suffix.lower() in MESHES:
                self.reading.check_file(path, "file")
            inner = Reading(path, self.reading.check_path, self.reading.limits, self.reading.extensions)
            unknown = Problem("RG303", f"'{shown(file)}' is not a mesh file; a mesh ends in")
            self.mesh_files[path] = read_mesh(path, inner, unknown)
            self.reading.add_warnings(inner.warnings)
        scene = self.mesh_files[path]
        variant = entry.get("variant")
        if variant is not None and isinstance(variant.data, str) and (mistake := scene.variant_mistake(variant.data)):
            self.validator.report(variant, "RG322", f"object '{shown(name)}': its file {mistake}")
        playback = self._playback(name, entry, scene)
        key = path, *sorted((playback or {}).items()), playback is None
        if key not in self.files:
            if scene.rigs:
                scene = animate.at_rest(scene) if playback is None else animate.play(scene, **playback)
            rig = len(self.rigs) if scene.rigs else None
            self.files[key] = _File(scene, len(self.meshes), len(self.materials), rig)
            self.rigs += [replace(each, placements=()) for each in scene.rigs]
            self.meshes += scene.meshes
            self.materials += [replace(material, name=f"{name}/{material.name}") for material in scene.materials]
        return self.files[key]

    def _playback(self, name: str, entry: Value, scene: model.Scene) -> dict[str, Any] | None:
        """Return the clip that an object plays, and its speed and start; None at rest."""
        if (place := entry.get("animation")) is None or place.data is None:
            return None
        clips: Mapping[str, Any] = scene.rigs[0].clips if scene.rigs else {}
        values: dict[str, Any] = {"clip": next(iter(clips), None), **plain(place, scene_keys.ANIMATION)}
        if values["clip"] in clips:
            return values
        if not clips and not place.mapping:
            return None
        what = f"no clip '{shown(values['clip'])}'" if values["clip"] else "no clips"
        text = f"object '{shown(name)}': its file has {what}{suggestion(values['clip'] or '', clips)}"
        self.validator.report(place.get("clip") or place, "RG322", text)
        return None

    def _overrides(self, entries: Mapping[str, Value], name: str, scene: model.Scene) -> dict[str, dict[str, Any]]:
        """Return the changed values by name of node or part."""
        known = dict.fromkeys(word for part in scene.objects for word in (part.node, part.name))
        for node, entry in entries.items():
            if node not in known:
                text = f"object '{shown(name)}': its file has no node '{shown(node)}'{suggestion(node, known)}"
                self.validator.report(entry, "RG322", text, key=True)
            self._check_name(entry.get("material"), "materials")
        return {node: self._plain("objects", entry) for node, entry in entries.items()}

    def _keyframes(self, top: Value) -> dict[str, Curve]:
        result = {}
        for path, entry in _entries(top, "keyframes").items():
            key = self._named_key(str(path), entry)
            if key is None:
                continue
            what = f"keyframes of '{shown(path)}'"
            if not entry.mapping:
                kind = "empty" if entry.data == {} else entry.kind
                self.validator.report(entry, "RG321", f"{what} are {kind}, not a mapping of seconds to values")
                continue
            frames: list[tuple[float, Any]] = []
            words: dict[str, Any] = {}
            for time, value in entry.items():
                if time in _WORDS:
                    if (good := self.validator.value(value, _WORDS[time])) is not None:
                        words[time] = plain(good, _WORDS[time].type)
                elif isinstance(time, bool) or not isinstance(time, int | float) or not math.isfinite(time):
                    text = f"{what}: '{shown(time)}' is not a time in seconds, `ease` or `slerp`"
                    self.validator.report(value, "RG321", text, key=True)
                elif value.data is None:
                    self.validator.report(value, "RG321", f"keyframe {time:g} s of '{shown(path)}' has no value")
                elif (good := self.validator.value(value, key)) is not None:
                    frames.append((float(time), plain(good, key.type)))
            turns = words.get("slerp", False)
            if turns and not (path.startswith("objects.") and path.endswith(".rotate_degrees")):
                text = f"{what}: 'slerp' is for the 'rotate_degrees' of objects"
                self.validator.report(entry.mapping["slerp"], "RG321", text, key=True)
            elif len({np.shape(value) for _, value in frames}) > 1:
                self.validator.report(entry, "RG321", f"{what} are of different lengths")
            elif frames:
                times, values = zip(*sorted(frames, key=itemgetter(0)), strict=True)
                turned = np.array([quaternion(np.array(value)) for value in values] if turns else values, np.float64)
                result[path] = Curve(np.array(times), turned, words.get("ease", "linear"), turns, entry.key_place)
            elif entry.mapping.keys() <= _WORDS.keys():
                self.validator.report(entry, "RG321", f"{what} have no times")
        return result

    def _named_key(self, path: str, entry: Value) -> Key | None:
        """Return the key that a dotted path names; only numbers, vectors and colours can be animated."""
        section, _, rest = path.partition(".")
        name, key = ("", rest) if section == "environment" else rest.rpartition(".")[::2]
        if section == "nodes" and name and key:  # checked when the pipeline is known
            return scene_keys.NODE_VALUE
        known = self.names.get(section, ())
        moving: dict[str, Key] = {}
        if section == "nodes":
            text = f"keyframes: '{shown(path)}' names no parameter of a node; write nodes.ID.PARAM"
        elif section not in scene_keys.SECTIONS:
            hint = suggestion(section, (*scene_keys.SECTIONS, "nodes"))
            text = f"keyframes: there is no section '{shown(section)}'{hint}"
        elif section != "environment" and name not in known:
            hint = suggestion(name, known) or f"; there are no {section}"
            text = f"keyframes: there is no '{shown(name)}' under {section}{hint}"
        elif section == "cameras" and key == "target" and "follow" in self.recipe.get((section, name), {}):
            text = f"keyframes: camera '{shown(name)}' follows an object, so its target cannot move by itself"
        else:
            moving = scene_keys.moving(self.sections[section])
            text = f"keyframes: {section} have no moving key '{shown(key)}'{suggestion(key, moving)}"
        if key not in moving:
            self.validator.report(entry, "RG322", text, key=True)
        return moving.get(key)


def _unknown_keys(root: Value) -> dict[str, set[str]]:
    """Return by section the keys of entries, overrides and keyframes that are not rendergraph's own."""
    found: dict[str, set[str]] = {}
    own = {key.name for key in scene_keys.OVERRIDE.keys}
    for section in get_args(Section):
        names = found[section] = set()
        for entry in _entries(root, section).values():
            names |= entry.mapping.keys() - scene_keys.SECTIONS[section].keys_of(entry).keys()
            for override in _entries(entry, "overrides").values() if section == "objects" else ():
                names |= override.mapping.keys() - own
    for path in _entries(root, "keyframes"):
        section, key = str(path).partition(".")[0], str(path).rpartition(".")[2]
        if section in found and key not in scene_keys.NAMES[section]:
            found[section].add(key)
    return found


def _kinds(root: Value) -> set[str]:
    """Return the kinds of generated textures that a file uses."""
    values = [value for entry in _entries(root, "materials").values() for value in entry.mapping.values()]
    return {str(kind.data) for value in values if (kind := value.get("kind")) is not None}


def _entries(value: Value, section: str) -> dict[str, Value]:
    entries = value.get(section)
    return dict(entries.items()) if entries is not None else {}
