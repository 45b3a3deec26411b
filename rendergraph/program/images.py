"""Image formats in shaders: they come from the port, and may be repeated in the shader.

`uniform writeonly image2D board;` gets the `layout(rgba16f)` of its port; a written layout must agree with it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping

from msgspec.structs import replace

from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.glsl.names import compiled_text
from rendergraph.glsl.source import SourceText
from rendergraph.steps import Read, Resource, Step, Write
from rendergraph.textures import FORMATS, GLSL_SHAPES, TextureDesc

_MEMORY = r"(?:(?:coherent|volatile|restrict|readonly|writeonly|highp|mediump|lowp)\s+)*"
_IMAGE = re.compile(
    rf"(?P<layout>layout\s*\((?P<inside>[^)]*)\)\s*)?(?P<rest>{_MEMORY}uniform\s+{_MEMORY}"
    rf"(?P<type>[iu]?image\w+)\s+(?P<name>[A-Za-z_]\w*))"
)
_OTHER_FORMATS = """rg16_snorm r16_snorm rgba8_snorm rg8_snorm r8_snorm rgba16i rgba8i rg16i rg8i r16i r8i
rgb10_a2ui"""
_LAYOUT_FORMATS = {*FORMATS, *_OTHER_FORMATS.split()}


def with_formats(
    source: SourceText, step: Step, resources: Mapping[str, Resource], macros: Mapping[str, str]
) -> SourceText:
    """Add the port's format to every image without one (RG427 if they disagree, RG430 if no port belongs to it)."""
    uses: tuple[Read | Write, ...] = (*step.reads, *step.writes)
    images = {
        use.name: (use, desc)
        for use in uses
        if use.use == "image" and isinstance(desc := getattr(resources.get(use.resource), "desc", None), TextureDesc)
    }
    lines, origins = list(source.lines), list(source.origins)
    problems: list[Problem] = []
    for number, line in enumerate(lines):
        match = _IMAGE.search(line)
        if match is None:
            continue
        if match["name"] not in images:
            if not origins[number].shared and _is_compiled(source, macros, match):  # `scene_tree` is shared
                place = origins[number].place(match.start("name") + 1)
                problems.append(step.problem("RG430", _unknown(step, match, images)).relocate(place, line))
            continue
        use, desc = images[match["name"]]
        text = _mismatch(match, use, desc)
        if text is not None:
            place = origins[number].place(match.start() + 1)
            problems.append(Problem("RG427", f"node '{step.node}': {text}", place, line))
        elif _stated(match) is None:
            more = f", {match['inside'].strip()}" if (match["inside"] or "").strip() else ""
            before = f"layout({desc.format}{more}) "
            lines[number] = line[: match.start()] + before + match["rest"] + line[match.end() :]
            origins[number] = replace(origins[number], column=len(before) - len(match["layout"] or ""))
    if problems:
        raise InputError(problems)
    return SourceText.of(zip(lines, origins, strict=True))


def _is_compiled(source: SourceText, macros: Mapping[str, str], match: re.Match[str]) -> bool:
    text = "".join(f"#define {name} {value}\n" for name, value in macros.items()) + source.text
    return match["rest"] in compiled_text(text, certain=True)


def _unknown(step: Step, match: re.Match[str], images: Collection[str]) -> str:
    """Explain a wrong image name, for which drivers only demand a format layout qualifier."""
    files = ", ".join(file for _, file in step.shaders)
    text = f"{files} declares the image '{match['name']}', but the step loads and stores no port of that name"
    hint = suggestion(match["name"], images) if images else ""
    return text + (hint or f"; give {match['name']}=PORT.stored(), or name it in `out`")


def _stated(match: re.Match[str]) -> str | None:
    words = [word.strip() for word in (match["inside"] or "").split(",")]
    return next((word for word in words if word in _LAYOUT_FORMATS), None)


def _mismatch(match: re.Match[str], use: Read | Write, desc: TextureDesc) -> str | None:
    letter = {"uint": "u", "int": "i"}.get(FORMATS[desc.format].family, "")
    wanted = f"{letter}image{'2D' if use.layer is not None else GLSL_SHAPES[desc.kind]}"
    name = match["name"]
    if match["type"] != wanted:
        return f"image '{name}' is an {match['type']}, but '{use.resource}' is {desc.format}, which needs {wanted}"
    stated = _stated(match)
    if stated is not None and stated != desc.format:
        return f"image '{name}' has layout({stated}), but '{use.resource}' is {desc.format}; leave the layout out"
    return None
