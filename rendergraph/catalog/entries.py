"""Ports and parameters of a shader file: what its text declares, completed by its header."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from rendergraph import textures
from rendergraph.catalog.header import Header, ParameterReader, is_parameter
from rendergraph.declare import Extensions, Facts, Input, Node, Output, Parameter, Port, WrittenPort
from rendergraph.document import Value
from rendergraph.errors import Place, Problem, shown_file, suggestion
from rendergraph.glsl import SourceText, is_shadertoy, strip_comments
from rendergraph.glsl.globals import Global, globals_of
from rendergraph.ports import Ruled, SizeRule
from rendergraph.textures import FORMATS, GLSL_SHAPES, SEMANTICS, SIGNATURES, Semantic, Signature

_SAMPLER = re.compile(r"[iu]?sampler(2D|2DArray|3D|Cube|2DMS|2DMSArray)(Shadow)?\Z")
_IMAGE = re.compile(r"[iu]?image(2D|2DArray|3D)\Z")
_KINDS = {shape.replace("2D", "2DMS"): kind for kind, shape in GLSL_SHAPES.items()}
_KINDS |= {shape: kind for kind, shape in GLSL_SHAPES.items()}
_INTEGER_FORMATS = {"uint": "r32ui", "uvec2": "rg32ui", "uvec3": "rgba32ui", "uvec4": "rgba32ui"}
_INTEGER_FORMATS |= {"int": "r32i", "ivec2": "rg32i", "ivec3": "rgba32i", "ivec4": "rgba32i"}
_VARYINGS = ("v_uv",)
"""Varyings of the full-screen vertex shader."""
_CHANNEL = partial(Input, textures.Any, size="any", filter="linear", wrap="repeat")
_SHADERTOY_PORTS: dict[str, Port] = {
    "image": Output(textures.DisplayColor, format="rgba8", doc="The picture, as Shadertoy shows it."),
    "values": Output(
        textures.Any, format="rgba32f", doc="The same in float32 with alpha, as Shadertoy's buffers hold it."
    ),
    **{f"iChannel{number}": _CHANNEL(doc=f"What the program reads as iChannel{number}.") for number in range(4)},
}
MOST_NAMES = 256
"""Limit of ports and parameters of a shader file."""


class Entries:
    """Collects the ports and parameters of one file, and the mistakes in them."""

    def __init__(self, file: Path, raw: str, header: Header, source: SourceText, extensions: Extensions) -> None:
        self.file = file
        self.raw = raw
        self.header = header
        self.source = source
        self.extensions = extensions
        # Mistakes in the framework's own includes are not the author's.
        lines = zip(source.lines, source.origins, strict=True)
        self.text = "\n".join("" if origin.shared else line for line, origin in lines)
        self.globals = globals_of(self.text)
        self.declared = {found.name: found for found in self.globals.declared}
        self.ports: dict[str, Port] = {}
        self.parameters: dict[str, Parameter] = {}
        self.problems: list[Problem] = list(header.problems)
        self._without_range: list[str] = []
        self._outs = [found for found in self.globals.declared if found.storage == "out"]
        self._renamed: dict[str, str] = {}
        self._is_shadertoy = file.suffix == ".frag" and is_shadertoy(raw)

    def report(self, code: str, text: str, found: Global | None = None) -> None:
        """Note a mistake at a declaration, or in the file as a whole."""
        place = (self._start, self.raw.partition("\n")[0]) if found is None else self._place(found.at)
        self.problems.append(Problem(code, text, *place))

    def _report_name(self, name: str, text: str) -> None:
        self.problems.append(self.header.names[name].problem("RG444", text, key=True))

    @property
    def _start(self) -> Place:
        return Place(shown_file(self.file), 1, 1)

    def _place(self, at: int) -> tuple[Place | None, str]:
        """Return the place in the author's file of a character of the text, and its line."""
        number = self.text.count("\n", 0, at)
        return self.source.origins[number].place(at - self.text.rfind("\n", 0, at)), self.source.lines[number]

    def place_of(self, name: str) -> Place:
        """Return where a name is declared, in the text or else in the header."""
        if name in self.declared and (place := self._place(self.declared[name].at)[0]):
            return place
        return self.header.names[name].key_place if name in self.header.names else Place(shown_file(self.file))

    def collect(self) -> None:
        count = len(self.declared.keys() | self.header.names.keys())
        if count > MOST_NAMES:
            text = f"the shader has {count:,} ports and parameters, the limit is {MOST_NAMES}; use a texture for tables"
            self.report("RG441", text)
            return
        if self.header.threads is not None and self.file.suffix != ".comp":
            text = "'threads' is for compute shaders; a full-screen pass runs once for each texel of its target"
            self.problems.append(self.header.threads.problem("RG443", text, key=True))
        self._match_single_output()
        for name, entry in self.header.inputs.items():
            self._input(name, entry)
        for name, entry in self.header.outputs.items():
            self._output(name, entry)
        for name, entry in self.header.params.items():
            self._parameter(name, entry)
        for found in self.globals.declared:
            self._without_entry(found)
        self._check_references()
        if not any(isinstance(port, WrittenPort) for port in self.ports.values()) and not self.problems:
            self.report("RG441", "the shader writes nothing; declare an output, as in out vec4 color;")

    def _without_entry(self, found: Global) -> None:
        """Add a declaration that the header does not mention."""
        name = found.name
        many = re.match(r"(\w+)_\d+\Z", name)
        is_of_many = many is not None and "many" in self.header.inputs.get(many[1], {})
        if name in self.header.names or name in self._renamed or name.startswith("gl_") or is_of_many:
            return
        stored = found.storage == "buffer" or _IMAGE.match(found.type)
        if self._is_shadertoy and name in _SHADERTOY_PORTS:
            self.ports[name] = _SHADERTOY_PORTS[name]
        elif found.storage == "in":
            if name not in _VARYINGS:
                text = f"nothing writes the varying '{name}'; a full-screen pass has v_uv, from 0 to 1"
                self.report("RG441", text, found)
        elif found.storage == "out" or (stored and self.file.suffix == ".comp" and "readonly" not in found.qualifiers):
            self._output(name, {})
        elif stored or _SAMPLER.match(found.type):
            self._input(name, {})
        else:
            self._parameter(name, {})

    def _match_single_output(self) -> None:
        """Match the only `out` with the only output of the header: their names may differ."""
        colors = [name for name, entry in self.header.outputs.items() if not _is_depth(entry)]
        if len(colors) == len(self._outs) == 1:
            written = self._outs[0].name
            if written != colors[0] and written not in self.header.names:
                self._renamed[written] = colors[0]

    def outputs_by_location(self) -> list[str]:
        """Return outputs in the order of the text's locations; empty if it gives none."""
        located: dict[int, str] = {}
        for found in self._outs:
            if "location" in found.layout:
                try:
                    number = self.globals.number(found.layout["location"])
                except ValueError as error:
                    self.report("RG441", f"the location of '{found.name}': {error}, or leave the layout out", found)
                    continue
                located[number] = self._renamed.get(found.name, found.name)
        if not located:
            return []
        if sorted(located) != list(range(len(self._outs))):
            text = "locations of outputs start at 0 and have no gaps, for all outputs or none; leave the layouts out"
            self.report("RG441", text, self._outs[0])
        depth = [name for name, entry in self.header.outputs.items() if _is_depth(entry)]
        return [*(located[number] for number in sorted(located)), *depth]

    def _input(self, name: str, entry: Mapping[str, Value]) -> None:
        many = bool("many" in entry and entry["many"].data)
        found = self.declared.get(name)
        if found is None and many:
            found = next((other for other in self.globals.declared if re.fullmatch(rf"{name}_\d+", other.name)), None)
        keys = ("doc", "optional", "many", "size", "filter", "wrap", "anisotropy", "group", "rays")
        options: dict[str, Any] = {key: entry[key].data for key in keys if key in entry}
        options |= {"border": _texel(entry["border"])} if "border" in entry else {}
        if found is not None and "kind" in entry:
            kind, declared = entry["kind"].data, f"{found.storage} {found.type} {name}".replace("  ", " ")
            text = f"the header has '{name}' as a {kind}, but the shader declares '{declared}'; leave one of them out"
            self.problems.append(entry["kind"].problem("RG444", text))
            return
        if found is None:
            options["kind"] = self._undeclared_kind(name, entry)
            if not options["kind"]:
                return
        elif found.storage == "buffer":
            options["kind"] = "buffer"
        elif sampler := _SAMPLER.match(found.type):
            options |= {"kind": _KINDS[sampler[1]], "compare": sampler[2] is not None}
            options |= {"samples": "multi"} if "MS" in sampler[1] else {}
        elif image := _IMAGE.match(found.type):
            options |= {"kind": _KINDS[image[1]], "use": "image"}
            if self.file.suffix == ".frag" and "readonly" not in found.qualifiers:
                text = f"a .frag file alone stores no images; declare '{name}' readonly, or write the node in Python"
                self.report("RG441", text, found)
        else:
            text = f"the header has input '{name}', but the shader declares '{found.storage} {found.type} {name}'"
            self._report_name(name, text)
            return
        if found is not None and found.array:
            text = f"'{name}' is an array of samplers; declare the input `many` and {name}_0, {name}_1, …"
            self.report("RG441", text, found)
            return
        self.ports[name] = Input(self._semantic(entry, options["kind"]), **options)

    def _undeclared_kind(self, name: str, entry: Mapping[str, Value]) -> str:
        """Return the kind of an input that the text need not declare; report a mistake and return empty if it must."""
        if "kind" in entry:
            return str(entry["kind"].data)
        semantic = str(entry["semantic"].data) if "semantic" in entry else ""
        if semantic == textures.SceneData.name:
            return "scene"
        if semantic in [signature.texture for signature in SIGNATURES]:
            return "texture2d_array"  # read by the function of that signature
        samplers = [g.name for g in self.globals.declared if _SAMPLER.match(g.type) and g.name not in self.header.names]
        text = f"the header has input '{name}', but the shader declares no 'uniform sampler2D {name};'"
        self._report_name(name, text + suggestion(name, samplers))
        return ""

    def _semantic(self, entry: Mapping[str, Value], kind: str) -> Semantic | Signature:
        value = entry.get("semantic")
        word = str(value.data) if value is not None else ""
        names: list[str]
        if kind == "function":
            signatures = {signature.name: signature for signature in SIGNATURES}
            if word in signatures:
                return signatures[word]
            text = f"there is no function '{word}'{suggestion(word, signatures)}"
        else:
            found = self.extensions.semantic(word or ("view" if kind == "view" else "any"))
            if found is not None:
                return found
            names = [semantic.name for semantic in SEMANTICS] + [one.name for one in self.extensions.semantics()]
            text = f"there is no semantic '{word}'{suggestion(word, names, most=20)}"
            self.problems += self.extensions.problems
        where = value if value is not None else next(iter(entry.values()))
        self.problems.append(where.problem("RG440", text))
        return textures.Any

    def _output(self, name: str, entry: Mapping[str, Value]) -> None:
        original = {new: old for old, new in self._renamed.items()}.get(name, name)
        found = self.declared.get(original)
        options: dict[str, Any] = {key: entry[key].data for key in ("doc", "like", "first", "kept") if key in entry}
        if found is None and not (_is_depth(entry) and self.file.suffix == ".frag"):
            outs = [other.name for other in self._outs if other.name not in self.header.names]
            example = f"out vec4 {name};" if self.file.suffix == ".frag" else f"uniform writeonly image2D {name};"
            text = f"the header has output '{name}', but the shader declares no '{example}'{suggestion(name, outs)}"
            self._report_name(name, text)
            return
        if found is not None and not self._fits_output(name, found, entry, options):
            return
        if "like" not in entry or "semantic" in entry:
            options["semantic"] = self._semantic(entry, "texture2d")
        rules: dict[str, Callable[[Value], Any]] = {"format": _word_rule, "size": _size_rule, "clear": _texel}
        rules |= dict.fromkeys(("layers", "samples", "bytes", "mips"), number_rule)
        options |= {key: rule(entry[key]) for key, rule in rules.items() if key in entry}
        if options.get("kind") == "buffer" and "bytes" not in options:
            text = f"the buffer '{name}' has no size; add outputs: {{{name}: {{bytes: N}}}} to the header"
            self.report("RG441", text, found)
            return
        self.ports[name] = Output(**options)

    def _fits_output(self, name: str, found: Global, entry: Mapping[str, Value], options: dict[str, Any]) -> bool:
        """Take kind and format from the declaration; report a mistake and return False if it is not an output's."""
        if found.storage == "buffer":
            options["kind"] = "buffer"
            return True
        if found.storage == "uniform" and (image := _IMAGE.match(found.type)) and self.file.suffix == ".comp":
            options["kind"] = _KINDS[image[1]]
            texel = next((word for word in found.layout if word in FORMATS), None)
            if texel and "like" not in entry:
                options["format"] = texel
        elif found.storage == "out" and not found.array:
            integer = found.type in _INTEGER_FORMATS
            if integer and "format" not in entry and "like" not in entry:
                options["format"] = _INTEGER_FORMATS[found.type]
            elif not integer and found.type not in ("float", "vec2", "vec3", "vec4"):
                text = f"output '{name}': expected float, vec2 to vec4, uint or int, got {found.type}"
                self.report("RG441", text, found)
        else:
            if name in self.header.names:
                text = f"the header has output '{name}', but the shader declares '{found.storage} {found.type} {name}'"
                self._report_name(name, text)
            else:
                self.report("RG441", f"'{name}' is an array; declare one out for each texture", found)
            return False
        return self._fits_format(found, entry)

    def _fits_format(self, found: Global, entry: Mapping[str, Value]) -> bool:
        """Return whether the header's format holds values of the declared type; report a mistake if not."""
        texel = _format(entry)
        if texel is None:
            return True
        prefix = {"uint": "u", "int": "i"}.get(texel.family, "")
        if texel.is_depth:
            fix = "leave that out, and write gl_FragDepth"
        elif prefix != (found.type[0] if found.type[0] in "iu" and not found.type.startswith("image") else ""):
            fix = f"a {texel.family} format needs {prefix}vec4" if prefix else "that format needs float to vec4"
        else:
            return True
        text = f"format {texel.name} is incompatible with '{found.storage} {found.type} {found.name}'; {fix}"
        self.problems.append(entry["format"].problem("RG444", text))
        return False

    def _parameter(self, name: str, entry: Mapping[str, Value]) -> None:
        declared = self.declared.get(name)

        def report(code: str, text: str, value: Value | None) -> None:
            if value is None:
                self.report(code, text, declared)
            else:
                self.problems.append(value.problem(code, text, key=value is named))

        named = self.header.names.get(name)
        reader = ParameterReader(name, entry, named, declared, report)
        uniforms = [g.name for g in self.globals.declared if is_parameter(g) and g.name not in self.header.names]
        parameter = reader.parameter(uniforms, lambda: self._words)
        if parameter is not None:
            self.parameters[name] = parameter
            self._without_range += [name] if reader.lacks_range else []

    @cached_property
    def _words(self) -> frozenset[str]:
        """Words of the text, of its includes, and of files included by a parameter, as in `#include <CURVE>`."""
        return frozenset(re.findall(r"[A-Za-z_]\w*", "\n".join((*self.source.lines, strip_comments(self.raw)))))

    def _check_references(self) -> None:
        """Check that `like`, `size` and `$name` name inputs and structural parameters."""
        inputs = {name for name, port in self.ports.items() if isinstance(port, Input)}
        inputs |= self.header.inputs.keys()  # a wrong one has been reported
        params = self.header.params.items()
        structural = [name for name, entry in params if "role" in entry and entry["role"].data == "structural"]
        values = [value for entry in self.header.outputs.values() for value in entry.values()]
        values += [self.header.threads] if self.header.threads is not None else []
        for value in values:
            for part in value.data if isinstance(value.data, list) else [value]:
                word = part.data
                if isinstance(word, str) and re.match(r"\$\w+\Z", word) and word[1:] not in structural:
                    text = f"there is no parameter '{word[1:]}' with role: structural{suggestion(word[1:], structural)}"
                    self.problems.append(part.problem("RG444", text))
        for key, given in (pair for entry in self.header.outputs.values() for pair in entry.items()):
            first = given.data[0] if isinstance(given.data, list) else given
            is_name = key in ("like", "size") and isinstance(first.data, str) and not first.data.startswith("$")
            if is_name and first.data not in inputs:
                text = f"'{key}' names no input of this node: '{first.data}'{suggestion(str(first.data), inputs)}"
                self.problems.append(first.problem("RG444", text))

    def warnings(self, cls: type[Node]) -> Iterator[Problem]:
        """Yield one warning about everything that the class lacks, and warnings about likely mistakes."""
        ports = [name for name, port in self.ports.items() if not getattr(port, "doc", "")]
        undocumented = [*ports, *(name for name, parameter in cls.parameters().items() if not parameter.doc)]
        missing = [] if self.header.doc else ["doc of the node"]
        missing += [f"doc of {_listed(undocumented)}"] if undocumented else []
        missing += [f"min and max of {_listed(self._without_range)}"] if self._without_range else []
        if missing and not self._is_shadertoy:
            text = f"shader node '{self.file.name}' lacks {'; '.join(missing)}; add them to its header"
            yield Problem("RG445", text, self._start, severity="warning")
        match = re.search(r"\bdiscard\b", self.text)
        outputs = [port for port in self.ports.values() if isinstance(port, WrittenPort)]
        if match and any(port.clear is None for port in outputs):
            text = "discarded fragments leave the output undefined; set `clear` in the header"
            yield Problem("RG446", text, *self._place(match.start()), severity="warning")


def _format(entry: Mapping[str, Value]) -> textures.Format | None:
    return FORMATS.get(str(entry["format"].data)) if "format" in entry else None


def _is_depth(entry: Mapping[str, Value]) -> bool:
    texel = _format(entry)
    return texel is not None and texel.is_depth


def _listed(names: list[str]) -> str:
    quoted = [f"'{name}'" for name in names]
    return quoted[0] if len(quoted) == 1 else f"{', '.join(quoted[:-1])} and {quoted[-1]}"


def number_rule(value: Value) -> Ruled[int]:
    """Return a whole number, 0 for `all` (mips), or a rule that reads a structural parameter."""
    data = value.data
    if not isinstance(data, str):
        return int(data)  # type: ignore[arg-type]  # the header's reader saw a number
    return 0 if data == "all" else lambda node, facts: int(getattr(node, data[1:]))


def _word_rule(value: Value) -> Any:
    word = str(value.data)
    return (lambda node, facts: str(getattr(node, word[1:]))) if word.startswith("$") else word


def _size_rule(value: Value) -> SizeRule:
    """Return a factor of the picture, an input, (input, factor) or (width, height); factors may be parameters."""
    data = value.plain()
    first, factor = data if isinstance(data, list) else (None, data)
    if not isinstance(factor, str):
        if first is None:
            return float(factor)
        return (first, float(factor)) if isinstance(first, str) else (int(first), int(factor))
    if not factor.startswith("$"):
        return factor

    def rule(node: Any, facts: Facts) -> tuple[int, int]:
        desc = facts.input(first).desc if first is not None and facts.connected(first) else None
        scale = float(getattr(node, factor[1:]))
        width, height = desc.size if desc is not None else facts.viewport
        return max(1, math.ceil(width * scale - 1e-9)), max(1, math.ceil(height * scale - 1e-9))

    return rule


def _texel(value: Value) -> float | tuple[float, ...]:
    plain = value.plain()
    return tuple(map(float, plain)) if isinstance(plain, list) else float(plain)
