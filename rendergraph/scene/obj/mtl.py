"""Materials of an OBJ's MTL files.

Classic materials keep Ka, Kd, Ks and Ns for the empirical models and get metallic and roughness from them; a material
with Pr or Pm is metallic-roughness from the start (design.md §8).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rendergraph.document import shown
from rendergraph.errors import InputError
from rendergraph.scene.model import Material, Texture, Vec3
from rendergraph.scene.obj.parser import text_of
from rendergraph.scene.phong import dielectric_f0, roughness_of
from rendergraph.scene.reading import Reading, printable

_MAPS = {
    b"map_kd": "base_color",
    b"map_ke": "emissive",
    b"norm": "normal",
    b"map_bump": "bump",
    b"bump": "bump",
    b"map_d": "alpha",
    b"map_ks": "specular_color",
    b"map_pr": "roughness",
    b"map_pm": "metallic",
}
_NUMBERS = {name.lower().encode(): name for name in ("Ns", "Ni", "d", "Tr", "illum", "Pr", "Pm", "aniso", "anisor")}
_COLORS = {name.lower().encode(): name for name in ("Ka", "Kd", "Ks", "Ke")}
_SILENT = (b"tf", b"ps", b"pc", b"pcr", b"sharpness", b"map_aat")
_OPTIONS = {
    **dict.fromkeys(
        (b"-bm", b"-blendu", b"-blendv", b"-boost", b"-cc", b"-clamp", b"-imfchan", b"-texres", b"-type"), 1
    ),
    b"-mm": 2,
    **dict.fromkeys((b"-o", b"-s", b"-t"), 3),
}
"""Options of maps with the number of their values."""
_SWITCHES = {b"on": 1.0, b"off": 0.0}


@dataclass
class _Entry:
    """A material being read: its numbers, colours and maps by their MTL names."""

    name: str
    values: dict[str, Any] = field(default_factory=dict)
    maps: dict[str, tuple[Texture, Path, float]] = field(default_factory=dict)


def read_mtl(path: Path, reading: Reading) -> dict[str, Material]:
    """The materials of one file by name; what cannot be read is left out with a warning.

    Raises:
        InputError: a map's path leaves the roots, or an image is beyond the limits.
    """
    entries: dict[str, _Entry] = {}
    entry: _Entry | None = None
    data = reading.read(path, "material library").removeprefix(b"\xef\xbb\xbf")
    data = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").replace(b"\r", b"\n")
    for number, line in enumerate(data.split(b"\n"), 1):
        words = line.split(None, 1)
        if not words or words[0].startswith(b"#"):
            continue
        key, rest = words[0].lower(), words[1].strip() if len(words) > 1 else b""
        if key == b"newmtl":
            name = printable(text_of(rest))
            entry = entries.setdefault(name, _Entry(name))
        elif entry is None:
            reading.warn("RG331", "early", "statements before the first 'newmtl' are left out", line=number, file=path)
        elif key in _COLORS or key in _NUMBERS:
            _value(entry, key, rest, number, path, reading)
        elif key in _MAPS:
            _map(entry, key, rest, number, path, reading)
        elif key not in _SILENT:
            word = shown(text_of(words[0]), 30)
            reading.warn("RG331", word, f"unknown statement '{word}' is left out", line=number, file=path)
    return {name: _material(found, path, reading) for name, found in entries.items()}


def _value(entry: _Entry, key: bytes, rest: bytes, line: int, path: Path, reading: Reading) -> None:
    """A number or a colour; one that cannot be read is left out."""
    words = rest.split(b"#")[0].split()
    if words and words[0] == b"-halo":
        words = words[1:]
    name = _COLORS.get(key) or _NUMBERS[key]
    try:
        numbers = [float(word) for word in words[: 3 if key in _COLORS else 1]]
    except ValueError:
        numbers = []
    if not numbers or not all(map(math.isfinite, numbers)):
        reading.warn("RG332", name, f"'{name}' has no value that can be read; it is left out", line=line, file=path)
        return
    if key in _NUMBERS:
        entry.values[name] = numbers[0]
        return
    color = (numbers * 3)[:3] if len(numbers) == 1 else [*numbers, numbers[-1]][:3]
    high = math.inf if name == "Ke" else 1.0
    if any(not 0 <= value <= high for value in color):
        reading.warn("RG332", f"range {name}", f"'{name}' outside 0 to 1 is clamped", line=line, file=path)
    entry.values[name] = tuple(min(max(value, 0.0), high) for value in color)


def _map(entry: _Entry, key: bytes, rest: bytes, line: int, path: Path, reading: Reading) -> None:
    """A texture with its options; a missing or broken one is left out."""
    options, name = _options(rest)
    slot = _MAPS[key]
    file = _follow(text_of(name), path, line, reading)
    if file is None:
        return
    try:
        image = reading.image(file, "map", line=line)
    except InputError as problem:
        if problem.problems[0].code in ("RG302", "RG353"):
            raise
        reading.warn("RG330", f"map {file}", f"{problem.problems[0].text}; it is left out", line=line, file=path)
        return
    if slot == "bump":
        if image.channels < 3:
            reading.warn(
                "RG333", "height map", "height maps are left out; only normal maps are read", line=line, file=path
            )
            return
        slot = "normal"
    s, o = options.get(b"-s", [1.0, 1.0]), options.get(b"-o", [0.0, 0.0])
    su, sv, ou, ov = s[0], s[1] if len(s) > 1 else 1.0, o[0], o[1] if len(o) > 1 else 0.0
    transform = None if (su, sv, ou, ov) == (1, 1, 0, 0) else (su, 0.0, ou, 0.0, sv, 1 - sv - ov)  # v is turned over
    wrap = "clamp" if options.get(b"-clamp") == [1.0] else "repeat"
    texture = Texture(image, slot in ("base_color", "emissive", "specular_color"), wrap, wrap, transform=transform)  # type: ignore[arg-type]  # one of two literals
    entry.maps[slot] = (texture, file, (options.get(b"-bm") or [1.0])[0])


def _options(rest: bytes) -> tuple[dict[bytes, list[float]], bytes]:
    """Options in front of a file name, with their numbers (`on` is 1)."""
    options: dict[bytes, list[float]] = {}
    while True:
        words = rest.split(None, 1)
        if len(words) < 2 or words[0].lower() not in _OPTIONS:
            return options, rest.strip()
        key, rest = words[0].lower(), words[1]
        values: list[float] = []
        while len(values) < _OPTIONS[key]:
            head = rest.split(None, 1)
            if len(head) < 2:
                break
            try:
                values.append(_SWITCHES[head[0].lower()] if head[0].lower() in _SWITCHES else float(head[0]))
            except ValueError:
                if values or _OPTIONS[key] > 1:
                    break
                values.append(0.0)  # a word such as `-imfchan r`
            rest = head[1]
        options[key] = values


def _follow(name: str, path: Path, line: int, reading: Reading) -> Path | None:
    """The file a map names; Windows' separators are understood; None with a warning where it does not exist."""
    for candidate in dict.fromkeys((name, name.replace("\\", "/"))):
        if (found := reading.find(candidate, line=line, file=path)) is not None:
            return found
    reading.warn("RG330", f"map {name}", f"map '{shown(name)}' cannot be read; it is left out", line=line, file=path)
    return None


def _material(entry: _Entry, path: Path, reading: Reading) -> Material:
    values, maps = entry.values, entry.maps
    diffuse: Vec3 = values.get("Kd", (1.0, 1.0, 1.0) if "base_color" in maps else (0.8, 0.8, 0.8))
    alpha = min(max(values.get("d", 1.0 - values.get("Tr", 0.0)), 0.0), 1.0)
    textures: dict[str, Texture] = {
        slot: maps[slot][0] for slot in ("base_color", "emissive", "normal", "specular_color") if slot in maps
    }
    mode = "blend" if alpha < 1 else "opaque"
    if "alpha" in maps:
        if "base_color" in maps and maps["alpha"][1] == maps["base_color"][1]:
            mode = "mask"  # the same image's alpha channel: leaves and fences
        else:
            reading.warn("RG333", "map_d", "'map_d' of another image than 'map_Kd' is left out", file=path)
    _combined_map(maps, textures, path, reading)
    emissive: Vec3 = values.get("Ke", (1.0, 1.0, 1.0) if "emissive" in maps else (0.0, 0.0, 0.0))
    common: dict[str, Any] = {
        "name": entry.name,
        "base_color": (*diffuse, alpha),
        "emissive": emissive,
        "alpha_mode": mode,
        "normal_scale": maps["normal"][2] if "normal" in maps else 1.0,
        "textures": textures,
        "unlit": values.get("illum") == 0.0,
        "double_sided": mode == "mask",
    }
    index = values.get("Ni", 1.5)
    if "Pr" in values or "Pm" in values or "metallic_roughness" in textures:
        textures.pop("specular_color", None)
        return Material(
            **common,
            metallic=_unit(values.get("Pm", 1.0 if "metallic" in maps else 0.0)),
            roughness=_unit(values.get("Pr", 1.0 if "roughness" in maps else 0.5)),
            ior=max(1.0, index),
            anisotropy_strength=_unit(values.get("aniso", 0.0)),
            anisotropy_rotation=2 * math.pi * values.get("anisor", 0.0),
        )
    shiny = values.get("illum", 2.0) >= 2
    specular: Vec3 = values.get("Ks", (0.0, 0.0, 0.0)) if shiny else (0.0, 0.0, 0.0)
    n = max(0.0, values.get("Ns", 10.0))
    f0 = dielectric_f0(1.5)
    return Material(
        **common,
        roughness=roughness_of(n),
        specular=1.0 if max(specular) > 0 else 0.0,
        specular_color=(specular[0] / f0, specular[1] / f0, specular[2] / f0),
        ambient=values.get("Ka", diffuse),
        diffuse=diffuse,
        specular_phong=specular,
        shininess=n,
    )


def _combined_map(
    maps: dict[str, tuple[Texture, Path, float]], textures: dict[str, Texture], path: Path, reading: Reading
) -> None:
    """One image for both map_Pr and map_Pm is read as glTF's (roughness in green, metallic in blue); two are not."""
    rough, metal = maps.get("roughness"), maps.get("metallic")
    if rough and metal and rough[1] == metal[1]:
        textures["metallic_roughness"] = rough[0]
    elif rough or metal:
        reading.warn("RG333", "map_Pr", "'map_Pr' and 'map_Pm' are left out unless both name one image", file=path)


def _unit(value: float) -> float:
    return min(max(value, 0.0), 1.0)
