"""One step's program text: version, macros, declarations, the functions provided to it, then the author's file."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

from msgspec import Struct, field
from msgspec.structs import replace

from rendergraph.catalog import NodeType
from rendergraph.declare import Function, Input
from rendergraph.errors import InputError, Problem, node_named
from rendergraph.expand import ViewTable
from rendergraph.glsl.files import Links
from rendergraph.glsl.names import calls, declared, mentions, renamed
from rendergraph.glsl.source import Includes, Origin, SourceBlock, SourceText, find_old_names, generated
from rendergraph.resources import folder
from rendergraph.stamps import FileCache
from rendergraph.steps import FunctionBinding, Read, Resource, Step, Write
from rendergraph.textures import SIGNATURES, TEXTURE_KINDS, Signature, TextureDesc

VERSION = "#version 450 core"
_EXTENSION = re.compile(r"\s*#\s*extension\b")
_IMAGE_TYPE = re.compile(r"uniform\s[^;]*image")  # faster without a leading `\b`
_TEXTS: FileCache[dict[str, StageText]] = FileCache(96)
"""Maximum number of cached texts, about 100 KiB each."""
_MANY_LAYERS = 16  # with more layers than this, a loop replaces one test per layer


class StageText(Struct, frozen=True):
    """The final text of one stage, with the id of the step's node, and warnings about it."""

    stage: str
    source: SourceText
    node: str = ""
    warnings: tuple[Problem, ...] = ()

    @property
    def of_node(self) -> str:
        """The prefix of messages: `node 'blur': `."""
        return f"node '{self.node}': " if self.node else ""

    @property
    def who(self) -> str:
        return f"{self.of_node}{self.stage} shader"

    @property
    def text(self) -> str:
        return self.source.text


def prefix(node: str) -> str:
    """Return the prefix of every name in a function's text: the providing node's id and an underscore.

    Two ids never give the same prefix, and a prefixed name is unambiguous: characters other than letters and digits are
    escaped with `Z`.
    """
    escapes = {"Z": "ZZ", "_": "Zu", "-": "Zd", "/": "Zs"}
    plain = "".join(letter if letter.isalnum() and letter != "Z" else escapes[letter] for letter in node)
    return ("Z" if plain == "gl" or plain[0].isdigit() else "") + plain + "_"


class TextSources(Struct, frozen=True, eq=False):
    """What the program texts of a graph's steps are made from: node types by node id, resources and view tables."""

    types: Mapping[str, NodeType]
    resources: Mapping[str, Resource]
    views: Mapping[str, ViewTable]


def stage_texts(
    step: Step,
    sources: TextSources,
    *,
    defines: Mapping[str, str] | None = None,
    include_folder: Path | None = None,
    links: Links | None = None,
) -> dict[str, StageText]:
    """Return the text of every stage of a step, in the pipeline's order.

    Args:
        step: its `defines` already hold `HAS_*`, the node's define parameters and its own (from `expand`); likewise
            those of its functions.
        defines: macros the framework adds: lights, materials, batch, `PASS_VIEW_COUNT`.
        include_folder: where `#include <…>` looks; the shipped one by default.
    """
    includes = Includes(include_folder or folder("rendergraph.shaders") / "include", links)
    shaders = dict(step.shaders)
    if step.kind == "fullscreen":
        shaders.setdefault("vertex", "<fullscreen.vert>")
    macros = {**read_defines(step.reads, sources), **dict(step.defines), **(defines or {})}
    if step.kind != "compute":
        macros = {**_sample_macros("PASS", step.samples), **macros}
    program = _Program(step, sources, macros)
    texts: dict[str, StageText] = {}
    for stage in ("vertex", "geometry", "fragment", "compute"):
        if stage in shaders:
            try:
                texts[stage] = program.stage(stage, shaders[stage], includes.fresh())
            except InputError as error:  # a missing file is located at the call that names it
                raise InputError([p if p.place else step.relocate(p) for p in error.problems]) from error
    return texts


_IRRELEVANT: dict[str, Any] = {
    "node": "", "index": 0, "reads": (), "writes": (), "uniforms": (), "functions": (), "label": "", "if_drawn": None,
    "size": (0, 0), "groups": (0, 0, 0), "invocations": None,
}  # fmt: skip
"""Fields of a step that do not affect its texts, or only through `text_key`."""


def text_key(step: Step, sources: TextSources) -> Hashable:
    """Return everything that a step's texts depend on except files: equal keys give equal texts, even in two graphs."""

    def seen(use: Read | Write) -> Hashable:
        resource = sources.resources[use.resource]
        count = resource.view and sources.views.get(resource.view, ViewTable()).count
        desc = resource.desc  # texts do not contain sizes, which `textureSize` and `imageSize` return
        what = (desc.kind, desc.format, desc.layers, desc.samples) if isinstance(desc, TextureDesc) else desc
        return replace(use, resource="", version=0, mip=None), what, resource.lights, count

    def made_of(node: str) -> Hashable:
        type = sources.types[node]
        return type.cls, type.file, type.shaders, type.inherited

    def provided(each: FunctionBinding) -> Hashable:
        names = tuple((name, 0) for name, _ in each.uniforms)
        return replace(each, reads=(), uniforms=names), made_of(each.node), tuple(map(seen, each.reads))

    uses: tuple[Read | Write, ...] = (*step.reads, *step.writes)
    functions = tuple(map(provided, step.functions))
    return made_of(step.node), replace(step, **_IRRELEVANT), functions, tuple(map(seen, uses))


class StepTexts(Struct, eq=False):
    """Program texts of many steps; steps with equal keys share one.

    They are cached across pipelines, as long as their files do not change.
    """

    sources: TextSources
    _links: Links = field(default_factory=Links)

    def of(self, step: Step, defines: Mapping[str, str]) -> dict[str, StageText]:
        key = text_key(step, self.sources), tuple(defines.items())
        texts = _TEXTS.get(key, lambda: stage_texts(step, self.sources, defines=defines, links=self._links))
        return {stage: replace(text, node=step.node) for stage, text in texts.items()}


class _Program(Struct, frozen=True):
    """A step with everything that its program text depends on, as in `stage_texts`."""

    step: Step
    sources: TextSources
    macros: Mapping[str, str]

    def stage(self, stage: str, name: str, includes: Includes) -> StageText:
        include_folder = includes.include_folder
        view = includes.expand(include_folder / "view.glsl")
        view = SourceText(tuple(SourceBlock(block.lines, replace(block.origin, shared=True)) for block in view.blocks))
        step, node = self.step, self.sources.types[self.step.node]
        file, root = node.shader_file(name, include_folder)
        # The calls in the file decide which functions precede it, so it is expanded without them first.
        versions = node.is_shader and not name.startswith("<")

        def expanded(by: Includes) -> SourceText:
            plugged = dict(step.includes)
            return by.expand(file, root=root, plugged=plugged, versions=versions, inherited=node.inherited)

        source = expanded(includes.copy())
        functions = SourceText()
        for signature in signatures_of(step, self.sources.types).values():
            if any(calls(source.text, one.name) for one in signature.functions):
                functions += self._functions(stage, signature, includes)
            if mentions(source.text, f"{signature.name.upper()}_LIGHT_COUNT"):
                table = self._light_table(signature)
                functions += generated(table, f"the lights of {signature.name}()")
        if functions.blocks:  # these may have the same includes
            source = expanded(includes)
        uses: tuple[Read | Write, ...] = (*step.reads, *step.writes)
        if any(use.use == "image" for use in uses) or _IMAGE_TYPE.search(source.text):
            from rendergraph.program.images import with_formats  # many pipelines have no images

            source = with_formats(source, step, self.sources.resources, self.macros)
        extensions, source = _hoisted(source)
        body = functions.text + source.text
        declarations = self._elements(body) + _read_declarations(step.reads, self.sources.resources, "", body)
        text = view + declarations + functions + source
        aliases, warnings = find_old_names(text, include_folder)
        head = generated([VERSION, *extensions]) + _macro_text({**aliases, **_used_macros(self.macros, text.text)})
        return StageText(stage, head + text, step.node, tuple(warnings))

    def _elements(self, body: str) -> SourceText:
        """Return the element structs of the step's buffers that the text names."""
        uses: tuple[Read | Write, ...] = (*self.step.all_reads, *self.step.writes)
        found = [getattr(self.sources.resources[use.resource].desc, "element", None) for use in uses]
        structs = [each.glsl for each in dict.fromkeys(found) if each is not None and mentions(body, each.name)]
        return generated(structs, "the elements of the step's buffers") if structs else SourceText()

    def _functions(self, stage: str, signature: Signature, includes: Includes) -> SourceText:
        """Return the providers' texts with prefixed names, and the functions that combine them."""
        text = SourceText()
        nodes: list[str] = []
        for binding in self.step.functions:
            if binding.signature == signature.name:
                text += self._provider_text(binding, includes)
                nodes.append(binding.node)
        lines: list[str] = []
        if signature.combine == "":
            for each in signature.functions if nodes else ():
                call = f"{prefix(nodes[0])}{each.name}({', '.join(each.arguments)})"
                lines.append(f"{each.declaration} {{ return {call}; }}")
            return text + generated(lines, f"{signature.name}() of '{nodes[0]}'") if nodes else text
        arguments = ", ".join(signature.arguments)
        join = f"result = result {signature.combine}"
        factors = [f"{join} {prefix(node)}{signature.name}({arguments});" for node in nodes]
        if stage == "fragment":
            for read in screen_reads(signature, self.step, self.sources.types[self.step.node]):
                lines.append(f"uniform sampler2DArray {read.name};")
                factors += _screen_factors(read, self._lights(read), signature)
        kind = signature.declaration.split()[0]
        lines += [f"{signature.declaration} {{", f"    {kind} result = {signature.neutral};"]
        lines += [f"    {factor}" for factor in factors]
        return text + generated([*lines, "    return result;", "}"], f"{signature.name}() of all providers")

    def _light_table(self, signature: Signature) -> Iterator[str]:
        """Yield the lights that any provider or texture of the function knows, for shaders that need them."""
        reads = [read for one in self.step.functions if one.signature == signature.name for read in one.reads]
        reads += screen_reads(signature, self.step, self.sources.types[self.step.node])
        known = list(dict.fromkeys(light for read in reads for light in self._lights(read)))
        yield f"#define {signature.name.upper()}_LIGHT_COUNT {len(known)}"
        if known:
            yield f"const int {signature.name}_lights[{len(known)}] = int[]({', '.join(map(str, known))});"

    def _lights(self, read: Read) -> tuple[int, ...]:
        return self.sources.resources[read.resource].lights if read.resource in self.sources.resources else ()

    def _provider_text(self, binding: FunctionBinding, includes: Includes) -> SourceText:
        """Return one provider's text with a prefix on every name that it declares, its inputs and its parameters."""
        before, node = prefix(binding.node), self.sources.types[binding.node]
        file, root = node.shader_file(binding.shader)
        plugged = dict(binding.includes)
        source = includes.expand(file, root=root, prefix=before, plugged=plugged, inherited=node.inherited)
        own = SourceText(tuple(block for block in source.blocks if not block.origin.shared))
        names = declared(own.text)
        for each in _declared_signatures(node)[binding.signature].functions:
            if each.name not in names:
                text = f"{node_named(binding.node, node.name)}: '{binding.shader}' does not define '{each.declaration}'"
                raise InputError(Problem("RG408", text, Origin(file, 1).place()))
        macros = {**read_defines(binding.reads, self.sources), **dict(binding.defines)}
        names |= {*macros, *(name for name, _ in binding.uniforms), *node.cls.parameters()}
        endings = ("_LAYERS", "_SAMPLES", "_SAMPLE_POSITIONS", "_COUNT", "_VIEW_COUNT")
        for port in (*node.cls.ports(), *(read.name for read in binding.reads)):
            names |= {port, f"{port}_views", f"previous_{port}_views", f"{port}_lights", f"HAS_{port.upper()}"}
            names |= {port.upper() + ending for ending in endings}

        def rename(word: str) -> str:
            return before + word if word in names else word

        lines = iter(renamed(own.text, rename).split("\n"))
        blocks = (b if b.origin.shared else replace(b, lines=tuple(islice(lines, len(b.lines)))) for b in source.blocks)
        final = SourceText(tuple(blocks))
        head = _macro_text({before + key: renamed(value, rename) for key, value in macros.items()})
        return head + _read_declarations(binding.reads, self.sources.resources, before, final.text) + final


def _hoisted(source: SourceText) -> tuple[list[str], SourceText]:
    """Separate `#extension` lines, which must come before everything else, from the text."""
    is_extension = ["#" in line and _EXTENSION.match(line) is not None for line in source.lines]
    found = [line.strip() for line, yes in zip(source.lines, is_extension, strict=True) if yes]
    if not found:
        return [], source
    lines = ("" if yes else line for line, yes in zip(source.lines, is_extension, strict=True))
    return found, SourceText.of(zip(lines, source.origins, strict=True))


def _read_declarations(reads: Iterable[Read], resources: Mapping[str, Resource], before: str, body: str) -> SourceText:
    """Return the views and light tables of input textures that the text uses."""
    text = SourceText()
    for read in reads:
        resource = resources.get(read.resource)
        if resource is None or not isinstance(resource.desc, TextureDesc):
            continue
        name, count = before + read.name, f"{before}{read.name.upper()}_VIEW_COUNT"
        tables = {name: ""} if read.previous else {name: "", f"{before}previous_{read.name}": " in the previous frame"}
        for table, when in tables.items() if resource.view is not None else ():
            if mentions(body, f"{table}_views"):
                block = f"layout(std140) uniform {table}_view_block {{ View {table}_views[{count}]; }};"
                text += generated([block], f"the views of '{read.name}'{when}")
        if resource.lights and mentions(body, f"{name}_lights"):
            table = ", ".join(str(light) for light in resource.lights)
            line = f"const int {name}_lights[{len(resource.lights)}] = int[]({table});"
            text += generated([line], f"the lights of '{read.name}'")
    return text


def signatures_of(step: Step, types: Mapping[str, NodeType]) -> dict[str, Signature]:
    """Return every function that the step's shader may call: provided, or declared as an input and then neutral."""
    found = {signature.name: signature for signature in SIGNATURES}
    for binding in step.functions:
        found |= _declared_signatures(types[binding.node])
    return found | _declared_signatures(types[step.node])


def _declared_signatures(node: NodeType) -> dict[str, Signature]:
    ports = node.cls.ports().values()
    signatures = [port.signature for port in ports if isinstance(port, Function)]
    signatures += [port.semantic for port in ports if isinstance(port, Input) and isinstance(port.semantic, Signature)]
    return {signature.name: signature for signature in signatures}


def screen_reads(signature: Signature, step: Step, node: NodeType) -> list[Read]:
    """Return the step's textures that hold the function's values in screen space."""
    names = [
        name
        for name, port in node.cls.inputs().items()
        if isinstance(port, Input) and port.kind in TEXTURE_KINDS and port.semantic.name == signature.texture
    ]
    wanted = re.compile(rf"(?:{'|'.join(names)})(?:_\d+)?\Z") if names else None
    return [read for read in step.reads if wanted and wanted.match(read.name) and read.use == "sample"]


def _screen_factors(read: Read, lights: tuple[int, ...], signature: Signature) -> list[str]:
    fetch = f"texelFetch({read.name}, ivec3(ivec2(gl_FragCoord.xy), {{}}), 0).r"
    light = signature.arguments[0]
    join = f"result = result {signature.combine} "
    if len(lights) <= _MANY_LAYERS:
        return [f"if ({light} == {index}) {join}{fetch.format(layer)};" for layer, index in enumerate(lights)]
    table = f"int[]({', '.join(str(index) for index in lights)})"
    return [
        f"const int {read.name}_table[{len(lights)}] = {table};",
        f"for (int layer = 0; layer < {len(lights)}; ++layer)",
        f"    if ({read.name}_table[layer] == {light}) {join}{fetch.format('layer')};",
    ]


def read_defines(reads: Iterable[Read], sources: TextSources) -> dict[str, str]:
    """Return `<X>_LAYERS`, `<X>_SAMPLES`, `<X>_VIEW_COUNT` of textures read, `<X>_COUNT` of lists of inputs."""
    macros: dict[str, str] = {}
    counts: dict[str, int] = {}
    for read in reads:
        resource = sources.resources.get(read.resource)
        if resource is None or not isinstance(resource.desc, TextureDesc) or read.use == "attach":
            continue
        name = read.name.upper()
        macros[f"{name}_LAYERS"] = str(resource.desc.layers)
        macros |= _sample_macros(name, resource.desc.samples)
        if resource.view is not None:
            macros[f"{name}_VIEW_COUNT"] = str(sources.views.get(resource.view, ViewTable()).count)
        if match := re.match(r"(.+)_(\d+)\Z", name):
            counts[match[1]] = max(counts.get(match[1], 0), int(match[2]) + 1)
    return {f"{name}_COUNT": str(count) for name, count in counts.items()} | macros


def _sample_macros(name: str, samples: int) -> dict[str, str]:
    """Return `<X>_SAMPLES`, and for several samples their positions in the texel."""
    positions = {f"{name}_SAMPLE_POSITIONS": positions_macro(samples)} if samples > 1 else {}
    return {f"{name}_SAMPLES": str(samples), **positions}


def positions_macro(samples: int) -> str:
    """Return the macro of the device's sample positions; its value is known only with GL."""
    return f"SAMPLE_POSITIONS_{samples}"


def _used_macros(macros: Mapping[str, str], text: str) -> dict[str, str]:
    """Return the macros whose names occur in a text or in the value of such a macro.

    Others would only make equal programs differ: a blur is the same for any number of lights.
    """
    found: dict[str, str] = {}
    texts = [text]
    while texts:
        new = {name: macros[name] for name in macros if name not in found and any(name in text for text in texts)}
        found |= new
        texts = list(new.values())
    return {name: macros[name] for name in macros if name in found}


def _macro_text(macros: Mapping[str, str]) -> SourceText:
    return SourceText.of(
        (f"#define {key} {value}".rstrip(), Origin(purpose=f"the macro {key}")) for key, value in macros.items()
    )
