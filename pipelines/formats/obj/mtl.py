"""Materials of an OBJ's MTL files.

Classic materials keep Ka, Kd, Ks and Ns for the empirical models and get metallic and roughness from them; a material
with Pr or Pm is metallic-roughness from the start (design.md §8).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

from msgspec import Struct, field
from rendergraph.pipelines.formats.obj.parser import text_of

from rendergraph.document import shown
from rendergraph.errors import InputError
from rendergraph.scene.model import Material, Texture, Vec3
from rendergraph.scene.reading import Reading, printable
from rendergraph.scene.scene_values import dielectric_f0, roughness_of

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


class _Entry(Struct):
    """A material being read: its numbers, colours and maps by their MTL names; a map has its file and `-bm`."""

    name: str
    values: dict[str, Any] = field(default_factory=dict)
    maps: dict[str, tuple[Texture, Path, float]] = field(default_factory=dict)


def read_mtl(path: Path, reading: Reading) -> dict[str, Material]:
    """Read the materials of one file by name; what cannot be read is left out with a warning."""
    return _Reader(path, reading).read()


class _Reader:
    def __init__(self, path: Path, reading: Reading) -> None:
        self.path, self.reading, self.line = path, reading, 0

    def warn(self, code: str, kind: str, text: str) -> None:
        self.reading.warn(code, kind, text, line=self.line, file=self.path)

    def read(self) -> dict[str, Material]:
        entries: dict[str, _Entry] = {}
        entry: _Entry | None = None
        data = self.reading.read(self.path, "material library").removeprefix(b"\xef\xbb\xbf")
        data = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").replace(b"\r", b"\n")
        for self.line, line in enumerate(data.split(b"\n"), 1):
            words = line.split(None, 1)
            if not words or words[0].startswith(b"#"):
                continue
            key, rest = words[0].lower(), words[1].strip() if len(words) > 1 else b""
            if key == b"newmtl":
                name = printable(text_of(rest))
                entry = entries.setdefault(name, _Entry(name))
            elif entry is None:
                self.warn("RG331", "early", "statements before the first 'newmtl' are left out")
            elif key in _COLORS or key in _NUMBERS:
                self._value(entry, key, rest)
            elif key in _MAPS:
                self._map(entry, _MAPS[key], rest)
            elif key not in _SILENT:
                word = shown(text_of(words[0]), 30)
                self.warn("RG331", word, f"unknown statement '{word}' is left out")
        self.line = 0
        return {name: self._material(entry) for name, entry in entries.items()}

    def _value(self, entry: _Entry, key: bytes, rest: bytes) -> None:
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
            self.warn("RG332", name, f"'{name}' has no value that can be read; it is left out")
        elif key in _NUMBERS:
            entry.values[name] = numbers[0]
        else:
            color = (numbers * 3)[:3] if len(numbers) == 1 else [*numbers, numbers[-1]][:3]
            high = math.inf if name == "Ke" else 1.0
            if any(not 0 <= value <= high for value in color):
                self.warn("RG332", f"range {name}", f"'{name}' outside 0 to 1 is clamped")
            entry.values[name] = tuple(min(max(value, 0.0), high) for value in color)

    def _map(self, entry: _Entry, slot: str, rest: bytes) -> None:
        """A texture with its options; a missing or broken one is left out."""
        options, name = _options(rest)
        file = self._find(text_of(name))
        if file is None:
            return
        try:
            image = self.reading.image(file, "map", line=self.line)
        except InputError as error:
            if error.problems[0].code in ("RG302", "RG353"):
                raise
            self.warn("RG330", f"map {file}", f"{error.problems[0].text}; it is left out")
            return
        if slot == "bump":
            slot = "normal"
            if image.channels < 3:
                self.warn("RG333", "height map", "height maps are left out; only normal maps are read")
                return
        su, sv = (*options.get(b"-s", []), 1.0, 1.0)[:2]
        ou, ov = (*options.get(b"-o", []), 0.0, 0.0)[:2]
        transform = None if (su, sv, ou, ov) == (1, 1, 0, 0) else (su, 0.0, ou, 0.0, sv, 1 - sv - ov)  # v is flipped
        wrap: Literal["clamp", "repeat"] = "clamp" if options.get(b"-clamp") == [1.0] else "repeat"
        srgb = slot in ("base_color", "emissive", "specular_color")
        texture = Texture(image, srgb, wrap, wrap, transform=transform)
        entry.maps[slot] = (texture, file, (options.get(b"-bm") or [1.0])[0])

    def _find(self, name: str) -> Path | None:
        """The file of a map, also with Windows' separators; None with a warning if it does not exist."""
        for candidate in dict.fromkeys((name, name.replace("\\", "/"))):
            if (file := self.reading.find(candidate, line=self.line, file=self.path)) is not None:
                return file
        self.warn("RG330", f"map {name}", f"map '{shown(name)}' cannot be read; it is left out")
        return None

    def _material(self, entry: _Entry) -> Material:
        values, maps = entry.values, entry.maps
        files = {slot: file for slot, (_, file, _) in maps.items()}
        diffuse: Vec3 = values.get("Kd", (1.0, 1.0, 1.0) if "base_color" in maps else (0.8, 0.8, 0.8))
        alpha = min(max(values.get("d", 1.0 - values.get("Tr", 0.0)), 0.0), 1.0)
        slots = [slot for slot in ("base_color", "emissive", "normal", "specular_color") if slot in maps]
        textures: dict[str, Texture] = {slot: maps[slot][0] for slot in slots}
        mode = "blend" if alpha < 1 else "opaque"
        if "alpha" in files and files["alpha"] == files.get("base_color"):
            mode = "mask"  # the same image's alpha channel: leaves and fences
        elif "alpha" in files:
            self.warn("RG333", "map_d", "'map_d' of another image than 'map_Kd' is left out")
        # One image for both is read as glTF's: roughness in green, metallic in blue.
        if "roughness" in files and files["roughness"] == files.get("metallic"):
            textures["metallic_roughness"] = maps["roughness"][0]
        elif "roughness" in files or "metallic" in files:
            self.warn("RG333", "map_Pr", "'map_Pr' and 'map_Pm' are left out unless both name one image")
        common: dict[str, Any] = {
            "name": entry.name,
            "base_color": (*diffuse, alpha),
            "emissive": values.get("Ke", (1.0, 1.0, 1.0) if "emissive" in maps else (0.0, 0.0, 0.0)),
            "alpha_mode": mode,
            "normal_scale": maps["normal"][2] if "normal" in maps else 1.0,
            "textures": textures,
            "unlit": values.get("illum") == 0.0,
            "double_sided": mode == "mask",
        }
        if "Pr" in values or "Pm" in values or "metallic_roughness" in textures:
            textures.pop("specular_color", None)
            return Material(
                **common,
                metallic=_clamped(values.get("Pm", 1.0 if "metallic" in maps else 0.0)),
                roughness=_clamped(values.get("Pr", 1.0 if "roughness" in maps else 0.5)),
                ior=max(1.0, values.get("Ni", 1.5)),
                anisotropy_strength=_clamped(values.get("aniso", 0.0)),
                anisotropy_rotation=2 * math.pi * values.get("anisor", 0.0),
            )
        shiny = values.get("illum", 2.0) >= 2
        specular: Vec3 = values.get("Ks", (0.0, 0.0, 0.0)) if shiny else (0.0, 0.0, 0.0)
        n, f0 = max(0.0, values.get("Ns", 10.0)), dielectric_f0(1.5)
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


def _options(rest: bytes) -> tuple[dict[bytes, list[float]], bytes]:
    """Options in front of a file name, with their numbers (`on` is 1)."""
    options: dict[bytes, list[float]] = {}
    while True:
        words = rest.split(None, 1)
        if len(words) < 2 or words[0].lower() not in _OPTIONS:
            return options, rest.strip()
        key, rest = words[0].lower(), words[1]
        values = options[key] = []
        while len(values) < _OPTIONS[key]:
            head = rest.split(None, 1)
            if len(head) < 2:
                break
            word = head[0].lower()
            try:
                values.append(_SWITCHES[word] if word in _SWITCHES else float(word))
            except ValueError:
                if values or _OPTIONS[key] > 1:
                    break
                values.append(0.0)  # a word such as `-imfchan r`
            rest = head[1]


def _clamped(value: float) -> float:
    return min(max(value, 0.0), 1.0)
