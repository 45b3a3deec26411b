"""Every key of a scene file with its type, unit and default, for checking, docs and `explain scene`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, get_args

from msgspec.structs import replace

from rendergraph.declare import Extensions, TextureKind
from rendergraph.declare.extensions import Section
from rendergraph.errors import InputError, Place, Problem, shown_file
from rendergraph.keys import Codes, Key, MapOf, Recursive, Table, schema
from rendergraph.keys.values import (
    FILE,
    TEXT,
    choice,
    color,
    listed,
    number,
    row,
    scale,
    shipped,
    vector,
    version,
    whole,
    word,
)
from rendergraph.pipelines.shapes import LENGTH, SHAPES
from rendergraph.pipelines.textures import TEXTURES as TEXTURE_KINDS
from rendergraph.resources import shipped_scenes
from rendergraph.typecheck import Brief, JsonSchema, Schema, is_numeric

_DIRECTION = "of any length"

NAME: Any = Annotated[TEXT, Brief("name")]
TIME: Any = word(
    re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(Z|[+-]\d\d:\d\d)?\Z"),
    "a date and time such as 2026-06-21T15:30+02:00",
    "time",
)

MOST_COPIES = 10_000_000
"""Limit of one number under `repeat`; limits of a scene are in `SceneLimits`."""
_COPIES: Any = whole(1, MOST_COPIES)


def _share(name: str, what: str) -> Key:
    return Key(name, number(0, 1), f"Maximum fraction by which {what} changes, up or down.", 0.0)


def _repeat(doc: str, vary: Iterable[Key], choose: Iterable[Key]) -> Key:
    """Return the key for copies of an entry; `vary` and `choose` may change these keys from copy to copy."""
    spread = "number, or one for each axis; each copy gets a random value from minus to plus this"
    at = Key("at", scale(), f"Random displacement: a {spread}.", (0.0, 0.0, 0.0), "m")
    turn = Key("rotate_degrees", scale(), f"Random rotation: a {spread}.", (0.0, 0.0, 0.0), "°")
    order = Key("order", choice("random", "turn"), "Pick at random, or one after the other (`turn`).", "random")
    table = Table(
        "repeat",
        (
            Key("grid", row(_COPIES, _COPIES, _COPIES), "Copies along x, y and z; the first is where the entry is."),
            Key("line", _COPIES, "Number of copies in a line; the first is where the entry is."),
            Key("ring", _COPIES, "Number of copies on a circle around the entry's position, in the plane of x and z."),
            Key("scatter", _COPIES, "Number of copies at random positions in a box around the entry's position."),
            Key("file", FILE, "A file with a row for each copy (.csv, .npz, .json); positions are added to `at`."),
            Key("vary", Table("vary", (at, turn, *vary)), "Random changes of each copy."),
            Key("choose", Table("choose", (order, *choose)), "Lists of values, of which each copy gets one."),
            Key("seed", whole(0, 2**32 - 1), "Seed of the random numbers.", 0),
        ),
        {
            "grid": (
                Key("step", vector(), "With `grid`: distances between neighbours.", (1.0, 1.0, 1.0), "m"),
                Key("centered", bool, "With `grid`: the entry's position is the middle of the grid.", False),
            ),
            "line": (Key("step", vector(), "With `line`: vector from one copy to the next.", (1.0, 0.0, 0.0), "m"),),
            "ring": (
                Key("radius", LENGTH, "With `ring`: radius of the circle.", 1.0, "m"),
                Key("start_degrees", number(), "With `ring`: angle of the first copy: 0 at +x, 90 at -z.", 0.0, "°"),
                Key("arc_degrees", number(-360, 360), "With `ring`: the arc, both ends included.", 360.0, "°"),
                Key("turned", bool, "With `ring`: copies turn with the circle, like spokes.", False),
            ),
            "scatter": (Key("size", vector(3, 0), "With `scatter`: edges of the box.", (1.0, 1.0, 1.0), "m"),),
            "file": (),
        },
    )
    return Key("repeat", table, doc)


_OVERRIDABLE = (
    Key("material", NAME, "A name under `materials`; without it, a file keeps its own materials."),
    Key("casts_shadow", bool, "Whether shadow techniques draw it.", True),
    Key("hidden", bool, "Not drawn at all.", False),
)
OVERRIDE = Table("override '{}'", _OVERRIDABLE)
_OVERRIDES = Key("overrides", MapOf(OVERRIDE), "For a file: node name to material, hidden, casts_shadow.")
ANIMATION = Table(
    "animation",
    (
        Key("clip", NAME, "Name of one of the file's clips, by default its first; `explain FILE` lists them."),
        Key("speed", number(), "Seconds of the clip for each second; less than 0 plays it backwards.", 1.0),
        Key("start", number(), "Time in the clip at frame 1.", 0.0, "s"),
    ),
)
_PLAYS = Key("animation", ANIMATION, "For a file: loops a clip; without it the file is at rest.")
_VARIANT = Key("variant", NAME, "For a file: one of its material variants.")
OBJECT = Table(
    "object '{}'",
    (
        Key("shape", choice(*SHAPES), "A generated shape; its own keys are under `shape: …`."),
        Key("file", FILE, "A mesh file (.obj, .gltf, .glb) instead of a shape, with its lights and cameras."),
        Key("at", vector(), "Position of its origin.", (0.0, 0.0, 0.0), "m"),
        Key("rotate_degrees", vector(), "Rotation about X, then Y, then Z.", (0.0, 0.0, 0.0), "°"),
        Key("scale", scale(), "One factor, or one for each axis; applied before the rotation.", (1.0, 1.0, 1.0)),
        *_OVERRIDABLE,
        _repeat(
            "Draws many copies, called `name.0`, `name.1` and so on.",
            [_share("scale", "the size")],
            [Key("material", listed(NAME, "names", 1), "Names under `materials`.")],
        ),
    ),
    {"shape": {name: shape.keys for name, shape in SHAPES.items()}, "file": (_OVERRIDES, _PLAYS, _VARIANT)},
)

TEXTURES = (
    ("base_color_texture", "Base colour (sRGB) with alpha."),
    ("metallic_roughness_texture", "Roughness in green, metallic in blue."),
    ("normal_texture", "Tangent-space normals."),
    ("occlusion_texture", "Occlusion in red."),
    ("emissive_texture", "Emitted colour (sRGB)."),
    ("anisotropy_texture", "Direction in red and green, strength in blue."),
    ("specular_texture", "Specular factor in alpha."),
    ("specular_color_texture", "Specular colour (sRGB)."),
    ("clearcoat_texture", "Coat factor in red."),
    ("clearcoat_roughness_texture", "Roughness of the coat in green."),
    ("clearcoat_normal_texture", "Tangent-space normals of the coat."),
    ("sheen_color_texture", "Sheen colour (sRGB)."),
    ("sheen_roughness_texture", "Roughness of the sheen in alpha."),
    ("iridescence_texture", "Iridescence factor in red."),
    ("iridescence_thickness_texture", "Interpolates between the film's two thicknesses, in green."),
    ("transmission_texture", "Transmission factor in red."),
    ("thickness_texture", "Thickness factor in green."),
)


_TEXTURE_KEYS = (
    Key("scale", LENGTH, "Width of one tile in texture coordinates: metres where a shape has `uv: metres`.", 1.0),
    Key("seed", whole(0, 65535), "Seed of the pattern.", 0),
    Key("resolution", whole(16, 4096), "Width and height of the images.", 512, "texels"),
)


def texture_keys(kinds: Mapping[str, TextureKind]) -> tuple[Key, ...]:
    """Return the keys of a material that take textures; `kinds` are those that can be generated."""
    table = Table(
        "texture",
        (Key("kind", choice(*kinds), "Pattern; each kind has keys of its own."), *_TEXTURE_KEYS),
        {"kind": {name: tuple(key.key for key in kind.keys) for name, kind in kinds.items()}},
    )
    doc = "A generated texture: base colour, normals, occlusion, roughness and metallic at once."
    image = Recursive(FILE, lambda: table, itself=False)
    return (Key("texture", table, doc), *(Key(name, image, about) for name, about in TEXTURES))


def _unit(name: str, doc: str, default: float) -> Key:
    return Key(name, number(0, 1), doc, default)


MATERIAL = Table(
    "material '{}'",
    (
        Key(
            "base_color",
            color(1, alpha=True),
            "Linear base colour: a grey, three numbers, or four with alpha.",
            (1.0, 1.0, 1.0, 1.0),
        ),
        _unit("metallic", "0 dielectric, 1 metal.", 0.0),
        _unit("roughness", "Perceptual roughness; α is its square.", 1.0),
        Key("emissive", color(), "Emitted radiance.", (0.0, 0.0, 0.0)),
        Key("emissive_strength", number(0), "Factor on `emissive`.", 1.0),
        _unit("occlusion_strength", "Strength of the occlusion texture.", 1.0),
        Key("normal_scale", number(), "Factor on the normal texture's slope.", 1.0),
        Key("alpha_mode", choice("opaque", "mask", "blend"), "How alpha is used.", "opaque"),
        _unit("alpha_cutoff", "With `mask`: surfaces with a smaller alpha are not drawn.", 0.5),
        Key("double_sided", bool, "Back faces are drawn too.", False),
        Key("unlit", bool, "Base colour without lighting.", False),
        Key("ior", number(1, 10), "Index of refraction, which gives the dielectric f0.", 1.5),
        _unit("specular", "Factor on the dielectric's reflection.", 1.0),
        Key("specular_color", color(), "Colour of the dielectric's f0.", (1.0, 1.0, 1.0)),
        _unit("anisotropy_strength", "0 is isotropic.", 0.0),
        Key("anisotropy_rotation", number(), "Counter-clockwise from the tangent.", 0.0, "rad"),
        _unit("clearcoat", "Factor of a clear coat over everything else.", 0.0),
        _unit("clearcoat_roughness", "Roughness of the coat.", 0.0),
        Key("clearcoat_normal_scale", number(), "Factor on the slope of the coat's normal texture.", 1.0),
        Key("sheen_color", color(1), "Colour of the light that cloth fibres scatter.", (0.0, 0.0, 0.0)),
        _unit("sheen_roughness", "Roughness of the sheen.", 0.0),
        _unit("iridescence", "Factor of thin-film interference.", 0.0),
        Key("iridescence_ior", number(1, 10), "Index of refraction of the film.", 1.3),
        Key("iridescence_thickness", vector(2, 0), "Thickness for texture values 0 and 1.", (100.0, 400.0), "nm"),
        _unit("transmission", "Fraction of the unreflected light that passes through, as in glass.", 0.0),
        Key("thickness", number(0), "Thickness of the volume behind the surface; 0 is a thin wall.", 0.0, "m"),
        Key("attenuation_distance", LENGTH, "Distance for `attenuation_color`; none by default.", None, "m"),
        Key("attenuation_color", color(1), "Colour of white light after `attenuation_distance`.", (1.0, 1.0, 1.0)),
        Key("dispersion", number(0), "20 / Abbe number: spread of refraction over colours.", 0.0),
        Key("shadow_catcher", bool, "Shows the background, darkened by shadows and occlusion.", False),
        Key("ambient", color(1), "ka of the empirical models; by default the base colour."),
        Key("diffuse", color(1), "kd of the empirical models; by default base (1 − metallic)."),
        Key("specular_phong", color(1), "ks of the empirical models; by default f0."),
        Key("shininess", number(0, 1_000_000), "Exponent n of `phong`; by default from the roughness."),
        *texture_keys(TEXTURE_KINDS),
    ),
)

_INTENSITIES = Key("intensity", listed(number(0), "numbers from 0 up", 1), "Intensities.")
LIGHT = Table(
    "light '{}'",
    (
        Key("type", choice("directional", "point", "spot"), "Kind of light.", required=True),
        Key("at", vector(), "Position (point, spot).", (0.0, 0.0, 0.0), "m"),
        Key("direction", vector(), f"Direction of its light (directional, spot), {_DIRECTION}.", (0.0, -1.0, 0.0)),
        Key("color", color(), "Linear colour.", (1.0, 1.0, 1.0)),
        Key("intensity", number(0), "Lux for directional, candela for point and spot.", 1.0, "lx, cd"),
        Key("range", LENGTH, "Distance at which its light fades to 0 (point, spot); none by default.", None, "m"),
        Key("inner_degrees", number(0, 90), "Half angle of the spot's cone of full brightness.", 0.0, "°"),
        Key("outer_degrees", number(0, 90, above=True), "Half angle of the spot's whole cone.", 45.0, "°"),
        Key("casts_shadow", bool, "Whether `shadow_map.light: auto` may choose it; rays find its shadows.", True),
        _repeat(
            "Adds many copies, called `name.0`, `name.1` and so on.",
            [_share("color", "each channel of the colour"), _share("intensity", "the intensity")],
            [Key("color", listed(color(), "colours", 1), "Linear colours."), _INTENSITIES],
        ),
    ),
)

CAMERA = Table(
    "camera '{}'",
    (
        Key("eye", vector(), "Position of the camera.", (0.0, 0.0, 5.0), "m"),
        Key("target", vector(), "Point that it looks at.", (0.0, 0.0, 0.0), "m"),
        Key("follow", NAME, "Name of an object to look at, even if it moves, instead of `target`."),
        Key("up", vector(), f"Direction that is up in the picture, {_DIRECTION}.", (0.0, 1.0, 0.0)),
        Key("fov_y_degrees", number(0.01, 179), "Vertical angle of a perspective camera.", 45.0, "°"),
        Key("height", LENGTH, "Height of the view; makes the camera orthographic.", None, "m"),
        Key("frustum", vector(4), "Left, right, bottom, top at the near plane; makes the view off-centre.", None, "m"),
        Key(
            "aspect",
            number(0.01, 100),
            "Width over height of the picture, if neither the pipeline nor the command line gives a size.",
        ),
        Key("near", LENGTH, "Near plane.", 0.05, "m"),
        Key("far", number(0, above=True, infinite=True), "Far plane; `.inf` for none.", 100.0, "m"),
        _unit("shutter", "Fraction of a frame's time for which it is open, for motion blur.", 0.0),
    ),
)

ENVIRONMENT = Table(
    "environment",
    (
        Key("file", FILE, "Equirectangular image (.hdr, .exr), or a shipped one, such as `sky`."),
        Key("intensity", number(0), "Factor on its radiance.", 1.0),
        Key("rotate_degrees", number(), "Rotation about +Y.", 0.0, "°"),
        Key(
            "sun",
            vector(),
            f"With a sky: direction of sunlight, {_DIRECTION}; by default that of the first directional light.",
        ),
        Key("elevation_degrees", number(-18, 90), "With a sky: height of the sun above the horizon.", unit="°"),
        Key(
            "azimuth_degrees", number(), "With a sky: the sun's direction; 0 is -z (north), 90 is +x (east).", unit="°"
        ),
        Key("place", row(number(-90, 90), number(-180, 180)), "With `time`: latitude and longitude.", unit="°"),
        Key("time", TIME, "With `place`: date and time for the sun, with its offset from UTC."),
        Key("turbidity", number(1, 10), "With a sky: haze, from 1 for clean air.", 1.8),
        Key("overcast", number(0, 1), "With a sky: cloud cover, which hides the sun at 1.", 0.0),
        Key("ground", bool, "Adds a ground below the objects that shows the image and receives shadows.", False),
        Key(
            "ground_height",
            LENGTH,
            "With `ground`: height at which the image was taken; by default chosen for the objects.",
            None,
            "m",
        ),
    ),
)
SKY_KEYS = ("sun", "elevation_degrees", "azimuth_degrees", "place", "time", "turbidity", "overcast")

ORBIT = Table(
    "orbit",
    (
        Key("camera", NAME, "Name of a camera; by default the default camera."),
        Key("degrees_per_second", number(), "Speed, counter-clockwise seen from above.", 30.0, "°/s"),
    ),
)

SECTIONS = {"objects": OBJECT, "materials": MATERIAL, "lights": LIGHT, "cameras": CAMERA, "environment": ENVIRONMENT}
"""The tables of the sections' entries, whose numbers, vectors and colours keyframes may change."""
_OF_ALTERNATIVES = {"overrides", "animation", "variant"} | {key.name for one in SHAPES.values() for key in one.keys}
NAMES = {section: {key.name for key in table.keys} for section, table in SECTIONS.items()}
"""The names of each section's own keys, without those of shapes and of plugins."""


def moving(table: Table) -> dict[str, Key]:
    """Return the keys of a section's table that keyframes may change."""
    return {key.name: key for key in table.keys if is_numeric(key.type)}


def with_plugins(
    extensions: Extensions, asked: Mapping[str, Iterable[str]] = {}, kinds: Mapping[str, TextureKind] = TEXTURE_KINDS
) -> dict[str, Table]:
    """Return `SECTIONS` with the keys that plugins add, and with these kinds of generated textures.

    Raises:
        InputError: a plugin's key has the name of one of rendergraph's own (RG495), or of another plugin's (RG496) if
            the name is one of those in use (`asked`, by section).
    """
    found = dict(SECTIONS)
    if kinds is not TEXTURE_KINDS:
        own = MATERIAL.keys[: -1 - len(TEXTURES)]
        found["materials"] = replace(MATERIAL, keys=(*own, *texture_keys(kinds)))
    for section in get_args(Section):
        added = {one.name: one for one in extensions.scene_keys(section)}
        for name in asked.get(section, ()):
            extensions.scene_key(section, name)
        taken = NAMES[section] | (_OF_ALTERNATIVES if section == "objects" else set())
        if wrong := next((one for one in added.values() if one.name in taken), None):
            text = f"plugin '{wrong.plugin}': scene_keys['{section}'] has '{wrong.name}', a key of rendergraph's own"
            raise InputError(Problem("RG495", text, Place(shown_file(wrong.file))))
        keys = tuple(replace(one.value.key, doc=f"{one.value.doc} (plugin '{one.plugin}')") for one in added.values())
        found[section] = replace(found[section], keys=(*found[section].keys, *keys))
        if keys and section == "objects":
            overrides = replace(_OVERRIDES, type=MapOf(replace(OVERRIDE, keys=(*OVERRIDE.keys, *keys))))
            alternatives = {**OBJECT.alternatives, "file": (overrides, _PLAYS, _VARIANT)}
            found[section] = replace(found[section], alternatives=alternatives)
    return found


NODE_VALUE = Key("value", number() | listed(number(), "numbers", 1), "Value of a node's parameter.")
EASE = Key("ease", choice("linear", "smooth", "step"), "Between two keys: `smooth` starts and ends at rest.", "linear")
SLERP = Key("slerp", bool, "Rotate along the shorter arc from key to key, about one axis (`rotate_degrees`).", False)


def _curve(type: Any) -> Schema:
    more = {key.name: {**schema(key.type), "description": key.doc} for key in (EASE, SLERP)}
    return {"type": "object", "minProperties": 1, "properties": more, "additionalProperties": schema(type)}


def _keyframes(sections: Mapping[str, Table]) -> Schema:
    found = {}
    for section, table in sections.items():
        name = "" if section == "environment" else r"\..+"
        for key in moving(table).values():
            found[rf"^{section}{name}\.{key.name}$"] = _curve(key.type) | {"description": key.doc}
    found[r"^nodes\..+\..+$"] = _curve(NODE_VALUE.type) | {"description": "A parameter of a node that is a uniform."}
    return {"type": "object", "patternProperties": found, "additionalProperties": False}


def scene_table(sections: Mapping[str, Table] = SECTIONS) -> Table:
    """Return the table of a scene file whose sections have these tables."""
    schema_of_keyframes = JsonSchema(lambda: _keyframes(sections))
    keyframes: Any = Annotated[dict[Any, Any], "a mapping of paths", Brief("mapping"), schema_of_keyframes]
    return Table(
        "a scene file",
        (
            Key("scene", version(1), "Version of the format.", required=True, example="scene: 1"),
            Key(
                "extends", shipped(shipped_scenes), "A shipped scene or a scene file; the rest is a merge patch on it."
            ),
            Key("description", TEXT, "What the scene shows."),
            Key("objects", MapOf(sections["objects"]), "Shapes and files, by name."),
            Key("materials", MapOf(sections["materials"]), "Surfaces, by name."),
            Key(
                "lights",
                MapOf(sections["lights"]),
                "Lights, by name; without lights and environment, a directional key light of 3 lux shines over the "
                "viewer's left shoulder, and the environment is `studio`.",
            ),
            Key(
                "cameras",
                MapOf(sections["cameras"]),
                "Cameras, by name; the first is the default. Without any, a camera frames the scene.",
            ),
            Key("environment", ENVIRONMENT, "Environment map that surrounds and lights the scene."),
            Key(
                "keyframes",
                keyframes,
                "Dotted path (`cameras.main.eye`, `nodes.bloom.intensity`) to seconds and values, held outside; also "
                "`ease: smooth` or `step`, and `slerp: true` for `rotate_degrees`.",
            ),
            Key("orbit", ORBIT, "A camera that orbits its target."),
        ),
    )


SCENE = scene_table()
CODES = Codes(unknown="RG320", wrong="RG321", name="RG321", file="RG321")
