"""The shared includes' page, from the files themselves: their comments, what they declare, and every function."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rendergraph.resources import folder
from rendergraph.textures import SIGNATURES

from .markdown import block, code, page, prose, table

_FUNCTION = re.compile(r"^(?!#|return\b|else\b)((?:\w+ )?\w+) (\w+)\(([^;{}()]*)\)(?: \{|;)", re.MULTILINE)
_STRUCT = re.compile(r"^(?:struct \w+|layout\([^)]*\) [\w ]+?) \{\n(?: .*\n|#.*\n)*?\};\n", re.MULTILINE)
_VARIABLE = re.compile(r"^(?:centroid |flat )*(?:uniform|in|out|const) \w+ (\w+).*;.*\n", re.MULTILINE)
_MACRO = re.compile(r"\b[A-Z][A-Z0-9]*(?:_[A-Z0-9]+)+\b")
_PROVIDED = re.compile(rf"\b(?:{'|'.join(one.name for one in SIGNATURES)})\(|\b\w+_views\b")
_FRAGMENT = re.compile(r"\b(?:dFdx|dFdy|fwidth|gl_Frag\w*|gl_SampleI\w*|gl_SampleMask|discard)\b")
GROUPS = {
    "Views, depth and motion": "view frame velocity fragment_velocity pass_view previous_pass_view depth_surface",
    "Surfaces and materials": (
        "surface fragment_surface gbuffer_surface material_surface materials base_color alpha_mask texture_coordinates "
        "per_sample"
    ),
    "Light and shading": (
        "shading lighting lights radiance air environment_lighting environment equirectangular cube brdf "
        "brdf_table anisotropic_ggx disc_form_factor"
    ),
    "The scene as data": "scene previous_scene trace ray_query trace_tree trace_triangle",
    "Vertex shaders": "transform geometry_vertex material_vertex mask_vertex",
    "Colour and numbers": (
        "srgb luminance color_temperature layer_colors math noise hammersley ray_directions downsample text"
    ),
}
"""Sections of the page; a file that none of them names is in the last."""


ARGUMENTS = {
    "s": "a `Surface`: position, directions and reflectance of a point that is shaded",
    "m": "a `MaterialData`: the values of a material without its textures",
    "v, view, previous_view": "a `View`; `previous_view` is the same in the frame before",
    "uv": "position in the window, 0 to 1 from the bottom left; of a texture, its coordinates",
    "depth, window_depth": "what a depth texture holds: 1 at the near plane, 0 at the far one or at infinity",
    "position": "in world space, in metres",
    "clip_position, previous_clip_position": "in clip space, before the division by w; in this frame and the last",
    "texel": "integer coordinates in a texture, from the bottom left",
    "sample_index": "number of a sample of its texel, or `TEXEL_CENTER`",
    "light_dir, half_vector, normal, direction": "unit vectors in world space; `light_dir` points to the light",
    "tangent, bitangent": "unit vectors in world space, along the rows of the normal map and up its columns",
    "NoL, NoV, NoH, VoH": "cosines between the normal (N), the light (L), the viewer (V) and the half vector (H)",
    "alpha": "of microfacets, the squared roughness, 0.001 to 1; of colours, opacity from 0 to 1",
    "roughness": "perceptual, from 0 to 1; its square is `alpha`",
    "xi": "a point in the unit square",
    "pixel": "integer coordinates in the picture, from the bottom left",
    "f0, f90": "specular reflectance at normal and at grazing incidence, linear RGB and one number",
    "material": "index of a material in `materials`",
    "light": "index of a light in `lights`, a `Light`, or a `ReflectedLight`: its diffuse and specular radiance",
    "instance, triangle, vertex": "numbers: of an object of the scene, a triangle of its mesh, a vertex of the scene",
    "barycentrics": "weights of the second and the third vertex of a triangle",
    "origin, nearest, farthest": "of a ray: where it begins, in world space; distances in lengths of its direction",
    "hit": "a `Hit`: what a ray has met",
    "wanted, rejected": "flags of instances, such as `SCENE_CASTS_SHADOW`: all must be set, or none",
}
"""What an argument of a name is in every shared include; other arguments are explained at their functions."""


@dataclass(frozen=True)
class Function:
    """One function of a shared include: its declaration in a line, and the comment above it."""

    name: str
    declaration: str
    arguments: tuple[str, ...]
    comment: str
    needs: str


def pages() -> Iterator[tuple[str, str]]:
    """One page."""
    files = {path.stem: path for path in sorted((folder("rendergraph.shaders") / "include").glob("*.glsl"))}
    named = " ".join(GROUPS.values()).split()
    parts = []
    for title, names in GROUPS.items():
        stems = [stem for stem in names.split() if stem in files]
        if title == [*GROUPS][-1]:
            stems += [stem for stem in files if stem not in named]
        parts += [f"## {title}", *(_file(files[stem]) for stem in stems)]
    about = (
        "Files that any shader includes with `#include <name.glsl>`, each compiled once a stage. `view.glsl` is there "
        "without being included. Lengths are in metres, angles in radians and radiance in scene-linear Rec. 709, where "
        "nothing else is said. [GLSL](../glsl.md) explains programs, names, macros and views."
    )
    parts += ["## Choices of a parameter", _choices()]
    rows = [(", ".join(map(code, names.split(", "))), prose(meaning)) for names, meaning in ARGUMENTS.items()]
    arguments = "Arguments of these names mean the same everywhere:\n\n" + table(("argument", "is"), rows)
    yield "includes.md", page("Shared includes", about, arguments, *parts)


def _choices() -> str:
    """The includes of which `#include <SHADING>` and `#include <CURVE>` take one."""
    files = sorted((folder("rendergraph.shaders") / "include").glob("*/*.glsl"))
    texts = {path: path.read_text(encoding="utf-8") for path in files}
    rows = [(code(f"{path.parent.name}/{path.name}"), prose(header(text))) for path, text in texts.items()]
    declared = dict.fromkeys(functions(text)[-1].declaration for text in texts.values())
    about = (
        "A node includes the file of the choice that its parameter has; each defines the function that the node calls"
    )
    return f"{about}: {' or '.join(map(code, declared))}.\n\n" + table(("file", ""), rows)


def _file(path: Path) -> str:
    text = path.read_text(encoding="utf-8")
    included = re.findall(r"^#include (\S+)", text, re.MULTILINE)
    facts = [f"Includes {', '.join(map(code, included))}."] if included else []
    if _FRAGMENT.search(text):
        facts.append("Fragment shaders only.")
    chunks = sorted([*_STRUCT.finditer(text), *_VARIABLE.finditer(text)], key=lambda found: found.start())
    declared = "".join(dict.fromkeys(found[0] for found in chunks))
    rows = [(code(one.declaration), prose(one.comment), prose(one.needs)) for one in functions(text)]
    return "\n\n".join(
        [
            f"### `<{path.name}>`",
            _paragraphs(header(text)),
            *([" ".join(facts)] if facts else []),
            *([block(declared, "glsl")] if declared else []),
            table(("function", "", "depends on"), rows),
        ]
    )


def header(text: str) -> str:
    """Return the comment that a file begins with."""
    found = re.match(r"(?:// ?.*\n)+", text)
    return re.sub(r"(?m)^// ?", "", found[0]) if found else ""


def _paragraphs(comment: str) -> str:
    """Return a comment as Markdown; its lines that are indented by four are code."""
    parts = re.split(r"((?:^ {4}.*\n|^\n(?= {4}))+)", comment, flags=re.MULTILINE)
    return "\n\n".join(
        block(re.sub(r"(?m)^ {4}", "", part).strip("\n"), "glsl")
        if part.startswith((" ", "\n "))
        else prose(part.strip())
        for part in parts
        if part.strip()
    )


def functions(text: str) -> list[Function]:
    """Return the functions of an include's text, in order; of one that differs with a macro, the first."""
    found: dict[str, Function] = {}
    own = {*re.findall(r"(?m)^#\s*define (\w+)", text), *re.findall(r"(?m)^const \w+ (\w+)", text)}
    names = [name for name in dict.fromkeys(_VARIABLE.findall(text)) if name not in own]
    for match in _FUNCTION.finditer(text):
        above = re.search(r"((?:^//.*\n)*)\Z", text[: match.start()], re.MULTILINE)
        comment = " ".join(line.lstrip("/ ") for line in (above[1] if above else "").splitlines())
        behind = re.match(r"[^\n]*?//\s*(.*)", text[match.end() :])
        if behind:
            comment = f"{comment} {behind[1]}".strip()
        arguments = tuple(word.split()[-1].partition("[")[0] for word in match[3].split(",") if word.strip())
        end = re.search(r"^\}", text[match.end() :], re.MULTILINE)
        body = text[match.end() : match.end() + (end.start() if end and match[0].endswith("{") else 0)]
        given = [*_PROVIDED.findall(body), *(name for name in names if re.search(rf"\b{name}\b", body))]
        given += [macro for macro in _MACRO.findall(body) if macro not in own]
        needed = [name.replace("(", "()") for name in dict.fromkeys(given)]
        declaration = f"{match[1]} {match[2]}({' '.join(match[3].split())})"
        found.setdefault(declaration, Function(match[2], declaration, arguments, comment, ", ".join(map(code, needed))))
    return [*found.values()]
