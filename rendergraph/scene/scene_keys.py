"""Every key of a scene file: what it takes, its unit and its default. Checking, docs and `explain scene` read this."""

from __future__ import annotations

from rendergraph.scene.keys import Key, positive
from rendergraph.scene.shapes import SHAPES

_DIRECTION = "unit length is not needed"

TOP = (
    Key("scene", "choice", "Version of the format.", required=True, choices=("1",)),
    Key("description", "text", "What the scene shows."),
    Key("objects", "map", "Shapes and files, by name."),
    Key("materials", "map", "Surfaces, by name."),
    Key(
        "lights",
        "map",
        "Lights, by name; without any a directional key of 3 lux comes over the viewer's left shoulder.",
    ),
    Key("cameras", "map", "Cameras, by name, the first is the default; without any the scene is framed."),
    Key("environment", "map", "An equirectangular image around the scene."),
    Key("keyframes", "map", "Dotted path (`cameras.main.eye`) to seconds and values, linear between, held outside."),
    Key("orbit", "map", "A camera that turns about its target."),
)

OBJECT = (
    Key("shape", "choice", "A generated shape; its own keys are under `shape: …`.", choices=tuple(SHAPES)),
    Key("file", "file", "A mesh file (.obj, .gltf, .glb) instead of a shape; its lights and cameras come with it."),
    Key("at", "vector", "Where its origin stands.", (0.0, 0.0, 0.0), "m"),
    Key("rotate_degrees", "vector", "Turns about X, then Y, then Z.", (0.0, 0.0, 0.0), "°"),
    Key("scale", "scale", "One factor, or one for each axis; applied before turning.", (1.0, 1.0, 1.0)),
    Key(
        "material",
        "link",
        "A name under `materials`; a file keeps its own materials without it.",
        choices=("materials",),
    ),
    Key("casts_shadow", "flag", "Whether shadow techniques draw it.", True),
    Key("hidden", "flag", "Not drawn at all.", False),
)
OVERRIDES = Key("overrides", "map", "For a file: node name to material, hidden, casts_shadow.")
OVERRIDE = tuple(key for key in OBJECT if key.name in ("material", "hidden", "casts_shadow"))

TEXTURES = (
    ("base_color_texture", "Base colour (sRGB) with alpha."),
    ("metallic_roughness_texture", "Roughness in green, metallic in blue."),
    ("normal_texture", "Tangent-space normals."),
    ("occlusion_texture", "Occlusion in red."),
    ("emissive_texture", "Emitted colour (sRGB)."),
    ("anisotropy_texture", "Direction in red and green, strength in blue."),
    ("specular_texture", "Specular factor in alpha."),
    ("specular_color_texture", "Specular colour (sRGB)."),
)


def _unit(name: str, doc: str, default: float) -> Key:
    return Key(name, "number", doc, default, low=0, high=1)


MATERIAL = (
    Key(
        "base_color",
        "color",
        "Linear base colour, three numbers or four with alpha.",
        (1.0, 1.0, 1.0, 1.0),
        low=0,
        high=1,
        size=4,
    ),
    _unit("metallic", "0 dielectric, 1 metal.", 0.0),
    _unit("roughness", "Perceptual roughness; α is its square.", 1.0),
    Key("emissive", "color", "Emitted radiance.", (0.0, 0.0, 0.0), low=0),
    Key("emissive_strength", "number", "Factor on `emissive`.", 1.0, low=0),
    _unit("occlusion_strength", "How much of the occlusion texture counts.", 1.0),
    Key("normal_scale", "number", "Factor on the normal texture's slope.", 1.0),
    Key("alpha_mode", "choice", "How alpha is used.", "opaque", choices=("opaque", "mask", "blend")),
    _unit("alpha_cutoff", "With `mask`: less alpha than this is not drawn.", 0.5),
    Key("double_sided", "flag", "Back faces are drawn too.", False),
    Key("unlit", "flag", "Base colour without lighting.", False),
    Key("ior", "number", "Index of refraction, which gives the dielectric f0.", 1.5, low=1, high=10),
    _unit("specular", "Factor on the dielectric's reflection.", 1.0),
    Key("specular_color", "color", "Colour of the dielectric's f0.", (1.0, 1.0, 1.0), low=0),
    _unit("anisotropy_strength", "0 isotropic.", 0.0),
    Key("anisotropy_rotation", "number", "Counter-clockwise from the tangent.", 0.0, "rad"),
    Key("ambient", "color", "ka of the empirical models; the base colour by default.", low=0, high=1),
    Key("diffuse", "color", "kd of the empirical models; base (1 − metallic) by default.", low=0, high=1),
    Key("specular_phong", "color", "ks of the empirical models; f0 by default.", low=0, high=1),
    Key("shininess", "number", "Exponent n of `phong`; from the roughness by default.", low=0, high=1e6),
    *(Key(name, "file", doc) for name, doc in TEXTURES),
)

LIGHT = (
    Key("type", "choice", "Kind of light.", required=True, choices=("directional", "point", "spot")),
    Key("at", "vector", "Where it is (point, spot).", (0.0, 0.0, 0.0), "m"),
    Key("direction", "vector", f"Where its light goes (directional, spot); {_DIRECTION}.", (0.0, -1.0, 0.0)),
    Key("color", "color", "Linear colour.", (1.0, 1.0, 1.0), low=0),
    Key("intensity", "number", "Lux for directional, candela for point and spot.", 1.0, "lx, cd", low=0),
    Key(
        "range", "number", "Where its light is faded out (point, spot); none by default.", None, "m", low=0, above=True
    ),
    Key("inner_degrees", "number", "Half angle of the spot's full brightness.", 0.0, "°", low=0, high=90),
    Key("outer_degrees", "number", "Half angle where the spot ends.", 45.0, "°", low=0, high=90, above=True),
    Key("casts_shadow", "flag", "Whether `shadow_map.light: auto` may choose it.", True),
)

CAMERA = (
    Key("eye", "vector", "Where it is.", (0.0, 0.0, 5.0), "m"),
    Key("target", "vector", "What it looks at.", (0.0, 0.0, 0.0), "m"),
    Key("up", "vector", f"What is up in the picture; {_DIRECTION}.", (0.0, 1.0, 0.0)),
    Key("fov_y_degrees", "number", "Vertical angle of a perspective camera.", 45.0, "°", low=0.01, high=179.0),
    Key(
        "height",
        "number",
        "Height of what an orthographic camera sees; makes it orthographic.",
        None,
        "m",
        low=0,
        above=True,
    ),
    Key("frustum", "vector", "Left, right, bottom, top at the near plane; makes it off-centre.", None, "m", size=4),
    positive("near", "Near plane.", 0.05),
    Key("far", "number", "Far plane; `.inf` for none.", 100.0, "m", low=0, above=True, infinite=True),
)

ENVIRONMENT = (
    Key("file", "file", "Equirectangular image (.hdr, .exr).", required=True),
    Key("intensity", "number", "Factor on its radiance.", 1.0, low=0),
    Key("rotate_degrees", "number", "Turns it about +Y.", 0.0, "°"),
)

ORBIT = (
    Key("camera", "link", "Which camera; the default one where it is not given.", choices=("cameras",)),
    Key("degrees_per_second", "number", "Speed, counter-clockwise seen from above.", 30.0, "°/s"),
)


def keys() -> dict[str, tuple[Key, ...]]:
    """Every section of a scene file with its keys, for `explain scene` and the docs."""
    return {
        "": TOP,
        "objects": (*OBJECT, OVERRIDES),
        **{f"objects (shape: {name})": shape.keys for name, shape in SHAPES.items()},
        "objects (overrides)": OVERRIDE,
        "materials": MATERIAL,
        "lights": LIGHT,
        "cameras": CAMERA,
        "environment": ENVIRONMENT,
        "orbit": ORBIT,
    }


ANIMATED = {"objects": OBJECT, "materials": MATERIAL, "lights": LIGHT, "cameras": CAMERA, "environment": ENVIRONMENT}
"""Sections whose numbers, vectors and colours keyframes may change."""
