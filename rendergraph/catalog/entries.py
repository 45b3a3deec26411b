"""Ports and parameters of a shader file: what its text declares, with what its header says of it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from rendergraph.catalog.header import Header
from rendergraph.catalog.parameter import HeaderParameter
from rendergraph.catalog.rules import number_rule, size_rule, word_rule
from rendergraph.declare import Extensions, Input, Node, Output, Parameter, Port, WrittenPort
from rendergraph.document import Value
from rendergraph.errors import Place, Problem, suggestion
from rendergraph.glsl import SourceText, strip_comments
from rendergraph.glsl.globals import Global, globals_of
from rendergraph.textures import FORMATS, SEMANTICS, SIGNATURES, Semantic, Signature
from rendergraph.textures import Any as AnyTexture

_SAMPLER = re.compile(r"[iu]?sampler(2D|2DArray|Cube|2DMS|2DMSArray)(Shadow)?\Z")
_IMAGE = re.compile(r"[iu]?image(2D|2DArray)\Z")
_SCALAR: dict[str, type] = {"float": float, "int": int, "uint": int, "bool": bool}
_VECTOR = re.compile(r"([iu]?)vec([234])\Z")
_KINDS: dict[str, str] = {
    "2D": "texture2d",
    "2DArray": "texture2d_array",
    "Cube": "texture_cube",
    "2DMS": "texture2d",
    "2DMSArray": "texture2d_array",
}
_INTEGER_FORMATS = {"uint": "r32ui", "uvec2": "rg32ui", "uvec3": "rgba32ui", "uvec4": "rgba32ui", "int": "r32i"}
_GIVEN = ("v_uv",)
"""Varyings of the full-screen vertex shader."""
MOST_NAMES = 256
"""Ports and parameters of a shader file."""


class Entries:
    """Collects the ports and parameters of one file, and what is wrong with them.

    Attributes:
        file: the shader.
        header: its header.
        globals: what its text declares.
        ports: by name, those of the header first.
        parameters: parameters by name.
        problems: everything that is wrong.
    """

    def __init__(
        self, file: Path, shown: str, raw: str, header: Header, source: SourceText, extensions: Extensions
    ) -> None:
        self.file = file
        self.shown = shown
        self.rows = raw.split("\n")
        self.header = header
        self.source = source
        self.extensions = extensions
        # What the framework's own includes declare is the framework's affair.
        self.text = "\n".join(
            "" if origin.shared else line for line, origin in zip(source.lines, source.origins, strict=True)
        )
        self.globals = globals_of(self.text)
        self.declared = {found.name: found for found in self.globals.declared}
        self.ports: dict[str, Port] = {}
        self.parameters: dict[str, Parameter] = {}
        self.problems: list[Problem] = list(header.problems)
        self._without_range: list[str] = []
        self._outs = [found for found in self.globals.declared if found.storage == "out"]
        self._renamed: dict[str, str] = {}

    # Places ----------------------------------------------------------------------------------------------------------

    def place(self, at: int) -> tuple[Place | None, str]:
        """The place in the author's file of a character of the text, and its line."""
        number = self.text.count("\n", 0, at)
        column = at - (self.text.rfind("\n", 0, at) + 1) + 1
        origin = self.source.origins[number]
        return origin.place(column), self.source.lines[number]

    def say(self, code: str, text: str, found: Global | None) -> None:
        """Note a mistake at a declaration, or in the file as a whole."""
        if found is None:
            self.problems.append(Problem(code, text, Place(self.shown, 1, 1), self.rows[0]))
        else:
            self.problems.append(Problem(code, text, *self.place(found.at)))

    def place_of(self, name: str) -> Place:
        """Where a name is declared, in the text or else in the header."""
        if name in self.declared and (place := self.place(self.declared[name].at)[0]):
            return place
        return self.header.names[name].key_place if name in self.header.names else Place(self.shown)

    # Everything ------------------------------------------------------------------------------------------------------

    def collect(self) -> None:
        """Fill `ports` and `parameters`."""
        count = len(self.declared.keys() | self.header.names.keys())
        if count > MOST_NAMES:
            text = f"the shader has {count:,} ports and parameters, {MOST_NAMES} are the limit; a texture holds tables"
            self.say("RG441", text, None)
            return
        if self.header.threads is not None and self.file.suffix != ".comp":
            text = "'threads' is a compute shader's; a full-screen pass runs once a texel of what it makes"
            self.problems.append(self.header.threads.problem("RG443", text, key=True))
        self._match_single_output()
        for name, entry in self.header.inputs.items():
            self._input(name, entry)
        for name, entry in self.header.outputs.items():
            self._output(name, entry)
        for name, entry in self.header.params.items():
            self._add_parameter(name, entry)
        for found in self.globals.declared:
            self._undescribed(found)
        self._references()
        if not any(isinstance(port, WrittenPort) for port in self.ports.values()) and not self.problems:
            self.say("RG441", "the shader writes nothing; declare what it makes, as in out vec4 color;", None)

    def _undescribed(self, found: Global) -> None:
        """A declaration that the header says nothing of."""
        name = found.name
        if name in self.header.names or name in self._renamed or name.startswith("gl_") or self._is_of_many(name):
            return
        if found.storage == "in":
            if name not in _GIVEN:
                text = f"nothing writes the varying '{name}'; a full-screen pass has v_uv, from 0 to 1"
                self.say("RG441", text, found)
        elif found.storage == "out" or self._is_written(found):
            self._output(name, {})
        elif found.storage == "buffer" or _SAMPLER.match(found.type) or _IMAGE.match(found.type):
            self._input(name, {})
        else:
            self._add_parameter(name, {})

    def _is_of_many(self, name: str) -> bool:
        match = re.match(r"(\w+)_\d+\Z", name)
        return match is not None and "many" in self.header.inputs.get(match[1], {})

    def _is_written(self, found: Global) -> bool:
        """Whether a buffer or an image is an output: in a compute shader, unless it says `readonly`."""
        stored = found.storage == "buffer" or bool(_IMAGE.match(found.type))
        return stored and self.file.suffix == ".comp" and "readonly" not in found.qualifiers

    def _match_single_output(self) -> None:
        """A single `out` may have any name."""
        colors = [name for name, entry in self.header.outputs.items() if not _is_depth(entry)]
        if len(colors) != 1 or len(self._outs) != 1:
            return
        written = self._outs[0].name
        if written != colors[0] and written not in self.header.names:
            self._renamed[written] = colors[0]

    def in_locations(self) -> list[str]:
        """Outputs in the order of the locations the text gives them; empty where it gives none."""
        located: dict[int, str] = {}
        for found in self._outs:
            if "location" in found.layout:
                try:
                    number = self.globals.number(found.layout["location"])
                except ValueError as error:
                    self.say("RG441", f"the location of '{found.name}': {error}, or leave the layout out", found)
                    continue
                located[number] = self._renamed.get(found.name, found.name)
        if not located:
            return []
        if sorted(located) != list(range(len(self._outs))):
            text = "locations of outputs go from 0 without gaps, for all or for none; leave the layouts out"
            self.say("RG441", text, self._outs[0])
        depth = [name for name, entry in self.header.outputs.items() if _is_depth(entry)]
        return [*(located[number] for number in sorted(located)), *depth]

    # Inputs ----------------------------------------------------------------------------------------------------------

    def _input(self, name: str, entry: Mapping[str, Value]) -> None:
        many = bool("many" in entry and entry["many"].data)
        found = self.declared.get(name)
        if found is None and many:
            found = next((other for other in self.globals.declared if re.fullmatch(rf"{name}_\d+", other.name)), None)
        options: dict[str, Any] = {
            key: entry[key].data
            for key in ("doc", "optional", "many", "size", "filter", "wrap", "anisotropy", "group")
            if key in entry
        }
        if found is not None and "kind" in entry:
            kind, declared = entry["kind"].data, f"{found.storage} {found.type} {name}".replace("  ", " ")
            text = f"the header has '{name}' as a {kind}, but the shader declares '{declared}'; leave one of them out"
            self.problems.append(entry["kind"].problem("RG444", text))
            return
        if found is None:
            kind = self._without_declaration(name, entry)
            if kind is None:
                return
            options["kind"] = kind
        elif found.storage == "buffer":
            options["kind"] = "buffer"
        elif sampler := _SAMPLER.match(found.type):
            options |= {"kind": _KINDS[sampler[1]], "compare": sampler[2] is not None}
            options |= {"samples": "multi"} if "MS" in sampler[1] else {}
        elif image := _IMAGE.match(found.type):
            options |= {"kind": _KINDS[image[1]], "use": "image"}
            if self.file.suffix == ".frag" and "readonly" not in found.qualifiers:
                self.say("RG441", f"a full-screen pass stores no images; declare '{name}' readonly, or an out", found)
        else:
            text = f"the header has input '{name}', but the shader declares '{found.storage} {found.type} {name}'"
            self.problems.append(self.header.names[name].problem("RG444", text, key=True))
            return
        if found is not None and found.array:
            text = f"'{name}' is an array of samplers; declare the input `many` and {name}_0, {name}_1, …"
            self.say("RG441", text, found)
            return
        self.ports[name] = Input(self._semantic(entry, options["kind"]), **options)

    def _without_declaration(self, name: str, entry: Mapping[str, Value]) -> str | None:
        """The kind of an input that the text need not declare, None and a mistake where it must."""
        if "kind" in entry:
            return str(entry["kind"].data)
        semantic = str(entry["semantic"].data) if "semantic" in entry else ""
        if semantic in [signature.texture for signature in SIGNATURES]:
            return "texture2d_array"  # the function of that signature reads it
        samplers = [g.name for g in self.globals.declared if _SAMPLER.match(g.type) and g.name not in self.header.names]
        text = f"the header has input '{name}', but the shader declares no 'uniform sampler2D {name};'"
        text += suggestion(name, samplers)
        self.problems.append(self.header.names[name].problem("RG444", text, key=True))
        return None

    def _semantic(self, entry: Mapping[str, Value], kind: str) -> Semantic | Signature:
        value = entry.get("semantic")
        own = {known.name: known for known in SEMANTICS}
        if kind == "function":
            signatures = {signature.name: signature for signature in SIGNATURES}
            word = str(value.data) if value is not None else ""
            if word in signatures:
                return signatures[word]
            text = f"there is no function '{word}'{suggestion(word, signatures)}"
        elif value is None:
            return own["view"] if kind == "view" else AnyTexture
        else:
            word = str(value.data)
            found = own.get(word) or self.extensions.semantic(word)
            if found is not None:
                return found
            known = [*own, *(added.name for added in self.extensions.semantics())]
            text = f"there is no semantic '{word}'{suggestion(word, known, most=20)}"
            self.problems += self.extensions.problems
        where = value if value is not None else next(iter(entry.values()))
        self.problems.append(where.problem("RG440", text))
        return AnyTexture

    # Outputs ---------------------------------------------------------------------------------------------------------

    def _output(self, name: str, entry: Mapping[str, Value]) -> None:
        back = {new: old for old, new in self._renamed.items()}
        found = self.declared.get(back.get(name, name))
        options: dict[str, Any] = {key: entry[key].data for key in ("doc", "like", "first", "kept") if key in entry}
        if found is None and not (_is_depth(entry) and self.file.suffix == ".frag"):
            outs = [other.name for other in self._outs if other.name not in self.header.names]
            example = f"out vec4 {name};" if self.file.suffix == ".frag" else f"uniform writeonly image2D {name};"
            text = f"the header has output '{name}', but the shader declares no '{example}'{suggestion(name, outs)}"
            self.problems.append(self.header.names[name].problem("RG444", text, key=True))
            return
        if found is not None and not self._fits_output(name, found, entry, options):
            return
        if "like" not in entry or "semantic" in entry:
            semantic = self._semantic(entry, "texture2d")
            options["semantic"] = semantic
        for key in ("layers", "samples", "bytes"):
            if key in entry:
                options[key] = number_rule(entry[key])
        if "format" in entry:
            options["format"] = word_rule(entry["format"])
        if "mips" in entry:
            options["mips"] = 0 if entry["mips"].data == "all" else number_rule(entry["mips"])
        if "size" in entry:
            options["size"] = size_rule(entry["size"])
        if "clear" in entry:
            clear = entry["clear"].plain()
            options["clear"] = tuple(map(float, clear)) if isinstance(clear, list) else float(clear)
        if options.get("kind") == "buffer" and "bytes" not in options:
            text = f"how large is the buffer '{name}'? say outputs: {{{name}: {{bytes: N}}}} in the header"
            self.say("RG441", text, found)
            return
        self.ports[name] = Output(**options)

    def _fits_output(self, name: str, found: Global, entry: Mapping[str, Value], options: dict[str, Any]) -> bool:
        """Kind and format as the declaration has them; false and a mistake where it is no output."""
        if found.storage == "buffer":
            options["kind"] = "buffer"
        elif found.storage == "uniform" and (image := _IMAGE.match(found.type)) and self.file.suffix == ".comp":
            options["kind"] = _KINDS[image[1]]
            texel = next((word for word in found.layout if word in FORMATS), None)
            if texel and "like" not in entry:
                options["format"] = texel
            return self._holds(name, found, entry)
        elif found.storage == "out" and not found.array:
            integer = found.type.startswith(("i", "u"))
            if integer and "format" not in entry and "like" not in entry:
                options["format"] = _INTEGER_FORMATS.get(found.type)
                if options["format"] is None:
                    self.say("RG441", f"no format holds the {found.type} of output '{name}'; use uvec4 or int", found)
            elif not integer and found.type not in ("float", "vec2", "vec3", "vec4"):
                self.say("RG441", f"output '{name}' is a {found.type}; float, vec2 to vec4, uint and int can be", found)
            return self._holds(name, found, entry)
        else:
            text = f"the header has output '{name}', but the shader declares '{found.storage} {found.type} {name}'"
            if name in self.header.names:
                self.problems.append(self.header.names[name].problem("RG444", text, key=True))
            else:
                self.say("RG441", f"'{name}' is an array; declare one out a texture", found)
            return False
        return True

    def _holds(self, name: str, found: Global, entry: Mapping[str, Value]) -> bool:
        """Whether the format that the header says takes values of the declared type; false and a mistake where not."""
        known = FORMATS.get(str(entry["format"].data)) if "format" in entry else None
        if known is None:
            return True
        right = {"uint": "u", "int": "i"}.get(known.family, "")
        if known.is_depth:
            way = "leave that out, and write gl_FragDepth"
        elif right != (found.type[0] if found.type[0] in "iu" and not found.type.startswith("image") else ""):
            way = f"a {known.family} format takes {right}vec4" if right else "that format takes float to vec4"
        else:
            return True
        text = f"format {entry['format'].data} does not hold what '{found.storage} {found.type} {found.name}' is; {way}"
        self.problems.append(entry["format"].problem("RG444", text))
        return False

    def _add_parameter(self, name: str, entry: Mapping[str, Value]) -> None:
        plain = (found for found in self.globals.declared if found.type in _SCALAR or _VECTOR.match(found.type))
        known = [found.name for found in plain if found.storage == "uniform"]
        named, declared = self.header.names.get(name), self.declared.get(name)
        reader = HeaderParameter(name, entry, named, declared, self._words)
        made = reader.parameter([other for other in known if other not in self.header.names])
        self.problems += reader.problems
        for text in reader.said:
            self.say(text[0], text[1], declared)
        if made is not None:
            self.parameters[name] = made
            self._without_range += [name] if reader.lacks_range else []

    @cached_property
    def _words(self) -> frozenset[str]:
        """Words of the text, its includes, and of what is included by a parameter, as in `#include <CURVE>`."""
        own = strip_comments("\n".join(self.rows))
        return frozenset(re.findall(r"[A-Za-z_]\w*", "\n".join((*self.source.lines, own))))

    # What the header refers to ---------------------------------------------------------------------------------------

    def _references(self) -> None:
        """`like`, `size` and `$name` must lead somewhere."""
        found = [name for name, port in self.ports.items() if isinstance(port, Input)]
        inputs = list(dict.fromkeys([*found, *self.header.inputs]))  # one that is wrong has been said
        params = self.header.params.items()
        plan = [name for name, entry in params if "role" in entry and entry["role"].data == "structural"]
        values = [value for entry in self.header.outputs.values() for value in entry.values()]
        values += [self.header.threads] if self.header.threads is not None else []
        for value in values:
            for part in value.data if isinstance(value.data, list) else [value]:
                word = part.data
                if isinstance(word, str) and re.match(r"\$\w+\Z", word) and word[1:] not in plan:
                    text = f"there is no parameter '{word[1:]}' with role: structural{suggestion(word[1:], plan)}"
                    self.problems.append(part.problem("RG444", text))
        for entry in self.header.outputs.values():
            for key in ("like", "size"):
                given = entry.get(key)
                first = given.data[0] if given is not None and isinstance(given.data, list) else given
                if first is None or not isinstance(first.data, str) or first.data.startswith("$"):
                    continue
                if first.data not in inputs:
                    text = f"'{key}' names no input of this node: '{first.data}'{suggestion(first.data, inputs)}"
                    self.problems.append(first.problem("RG444", text))

    def warnings(self, cls: type[Node]) -> Iterator[Problem]:
        """What the class lacks that was made of these, in one line; and what only looks right."""
        ports = [name for name, port in self.ports.items() if not getattr(port, "doc", "")]
        undocumented = [*ports, *(name for name, parameter in cls.parameters().items() if not parameter.doc)]
        missing = [] if self.header.doc else ["doc of the node"]
        missing += [f"doc of {_listed(undocumented)}"] if undocumented else []
        missing += [f"min and max of {_listed(self._without_range)}"] if self._without_range else []
        if missing:
            text = f"shader node '{self.file.name}' lacks {'; '.join(missing)}; its header can say them"
            yield Problem("RG445", text, Place(self.shown, 1, 1), severity="warning")
        match = re.search(r"\bdiscard\b", self.text)
        outputs = [port for port in self.ports.values() if isinstance(port, WrittenPort)]
        if match and any(port.clear is None for port in outputs):
            text = "a discarded fragment leaves in the output what its memory held; give it `clear` in the header"
            place, line = self.place(match.start())
            yield Problem("RG446", text, place, line, "warning")


def _is_depth(entry: Mapping[str, Value]) -> bool:
    texel = FORMATS.get(str(entry["format"].data)) if "format" in entry else None
    return texel is not None and texel.is_depth


def _listed(names: list[str]) -> str:
    quoted = [f"'{name}'" for name in names]
    return quoted[0] if len(quoted) == 1 else f"{', '.join(quoted[:-1])} and {quoted[-1]}"
