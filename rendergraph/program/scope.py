"""Everything that a step's program may use, with its origin; and the program text annotated with its files."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from rendergraph.catalog import NodeType
from rendergraph.errors import shown_file
from rendergraph.glsl.globals import Global, globals_of
from rendergraph.glsl.names import declared, without_directives
from rendergraph.glsl.source import Origin, SourceText
from rendergraph.program.checks import sampler_of
from rendergraph.program.text import StageText, TextSources, prefix, read_defines, screen_reads, signatures_of
from rendergraph.resources import folder
from rendergraph.scene.pack import SLOTS
from rendergraph.steps import Read, Resource, Step
from rendergraph.textures import TextureDesc

_BLOCK = re.compile(r"\b(?:uniform|buffer)\s+(\w+)\s*\{([^{}]*)\}")

SECTIONS = ("textures", "uniforms", "blocks", "macros", "functions", "includes", "attributes", "varyings", "outputs")


@dataclass(frozen=True)
class InScope:
    """One name that a step's text may use.

    Attributes:
        section: one of `SECTIONS`.
        name: as in the text, such as `uniform sampler2D depth`; of an include its file.
        source: its origin, such as `input 'depth': gbuffer.depth`; of an include the names it declares.
    """

    section: str
    name: str
    source: str


def in_scope(
    step: Step, sources: TextSources, defines: Mapping[str, str], texts: Mapping[str, StageText]
) -> list[InScope]:
    """Return everything in scope in a step by section; `texts` is the result of `stage_texts`."""
    found = _Scope(step, sources.types, sources.resources, texts)
    rows = [*found.textures(), *found.uniforms(), *found.blocks(), *found.functions(), *found.includes()]
    rows += [*found.macros(read_defines(step.reads, sources), defines), *found.between(), *found.outputs()]
    return sorted(rows, key=lambda row: SECTIONS.index(row.section))


_OF_MATERIALS = frozenset(f"{slot}_texture" for slot in SLOTS)


@dataclass(frozen=True)
class _Scope:
    step: Step
    types: Mapping[str, NodeType]
    resources: Mapping[str, Resource]
    texts: Mapping[str, StageText]

    def textures(self) -> Iterator[InScope]:
        for before, read in self._reads():
            desc = self.resources[read.resource].desc
            if not isinstance(desc, TextureDesc) or read.use not in ("sample", "image"):
                continue
            kind = sampler_of(read, self.resources[read.resource])
            kind = kind.replace("sampler", "image") if read.use == "image" else kind
            yield InScope("textures", f"uniform {kind} {before}{read.name}", self._port(before, read))

    def uniforms(self) -> Iterator[InScope]:
        types = {one.name: one for text in self.texts.values() for one, _ in _globals(text.source, "uniform")}
        textures = {before + read.name for before, read in self._reads()} | {one.name for one in self.step.writes}
        values = [("", self.step.node, name, value) for name, value in self.step.uniforms]
        for one in self.step.functions:
            values += [(prefix(one.node), one.node, name, value) for name, value in one.uniforms]
        for before, node, name, value in values:
            declaration = types.pop(before + name, None)
            kind = _type(declaration) if declaration is not None else "…"  # not declared in the step's text
            whose = "" if node == self.step.node else f" of '{node}'"
            knob = name in self.types[node].cls.parameters()
            where = f"parameter '{name}'{whose}" if knob else f"the step{whose}"
            unused = "" if declaration is not None else ", not declared here"
            yield InScope("uniforms", f"uniform {kind} {before}{name}", f"{where}: {_value(value)}{unused}")
        inputs = self.types[self.step.node].cls.inputs()
        for name, declaration in types.items():
            if name not in textures:
                where = "the step's view" if name == "view_index" else "nothing in this step, which has no use for it"
                where = "the scene's materials, where they have one" if name in _OF_MATERIALS else where
                where = "the scene's textures" if name.startswith("scene_array_") else where
                where = f"input '{name}', not connected" if name in inputs else where
                section = "textures" if "sampler" in declaration.type or "image" in declaration.type else "uniforms"
                yield InScope(section, f"uniform {_type(declaration)} {name}", where)

    def blocks(self) -> Iterator[InScope]:
        seen = set()
        buffers = {before + read.name: (before, read) for before, read in self._reads() if read.use == "buffer"}
        for text in self.texts.values():
            for match in _BLOCK.finditer(without_directives(text.text)):
                name, members = match[1], " ".join(match[2].split())
                if name in seen:
                    continue
                seen.add(name)
                origin = text.source.origins[text.text.count("\n", 0, match.start())]
                where = self._port(*buffers[name]) if name in buffers else origin.purpose or _file(origin.file)
                yield InScope("blocks", f"{name} {{ {members} }}", where)
        for before, read in self._reads():
            resource, name = self.resources[read.resource], before + read.name
            if resource.view is not None and f"{name}_view_block" not in seen:
                yield InScope("blocks", f"{name}_views[]", f"the views of '{read.name}', where it is looked at")
            if resource.lights:
                yield InScope("blocks", f"{name}_lights[]", f"the scene's light of each layer of '{read.name}'")

    def macros(self, of_reads: Mapping[str, str], added: Mapping[str, str]) -> Iterator[InScope]:
        node = self.types[self.step.node].cls
        knobs = {name.upper(): name for name in node.parameters()}
        inputs = {name.upper(): name for name in node.inputs()}
        reads = {read.name.upper(): read.name for read in self.step.reads}
        for name, value in {**of_reads, **dict(self.step.defines), **added}.items():
            stem = name.removeprefix("HAS_")
            knob = next((knobs[k] for k in knobs if name == k or name.startswith(f"{k}_")), None)
            read = next((reads[r] for r in reads if name.startswith(f"{r}_")), None)
            if name in added:
                where = "the scene's lights" if name.startswith("LIGHT_") else "the scene and its materials"
                where = "the step's view" if name == "PASS_VIEW_COUNT" else where
            elif stem != name and stem in inputs | reads:
                where = f"input '{inputs[stem]}' is connected" if stem in inputs else f"the step reads '{reads[stem]}'"
            elif name in of_reads:
                where = f"texture '{read}'" if read is not None else "the inputs"
            elif name.startswith("NEEDS_"):
                where = "what the choice of a parameter needs"
            else:
                where = f"parameter '{knob}'" if knob is not None else "the step"
            yield InScope("macros", f"{name} {value}".rstrip(), where)

    def functions(self) -> Iterator[InScope]:
        for signature in signatures_of(self.step, self.types).values():
            by = [f"node '{one.node}'" for one in self.step.functions if one.signature == signature.name]
            by += [f"texture '{read.name}'" for read in screen_reads(signature, self.step, self.types[self.step.node])]
            without = f"it returns {signature.neutral}" if signature.combine else "it is not defined"
            given = " and ".join(by) or f"no node of this pipeline; {without}"
            yield from (InScope("functions", each.declaration, given) for each in signature.functions)

    def includes(self) -> Iterator[InScope]:
        """Yield the names of every file except the stages' own, under any condition."""
        lines: dict[tuple[Path, str], list[str]] = {}
        for text in self.texts.values():
            for line, origin in zip(text.source.lines, text.source.origins, strict=True):
                if origin.file is not None and (origin.by is not None or origin.shared or origin.prefix):
                    lines.setdefault((origin.file, origin.prefix), []).append(line)
        for (file, _), own in lines.items():
            body = "\n".join(own)
            names = sorted(name for name in declared(body) if not name.startswith("INCLUDED_"))
            called = [f"{name}()" for name in names if re.search(rf"\b{name}\s*\([^;{{}}]*\)\s*\{{", body)]
            others = [name for name in names if f"{name}()" not in called]
            if names:
                yield InScope("includes", _file(file), ", ".join([*called, *others]))

    def between(self) -> Iterator[InScope]:
        """Yield the inputs of the vertex shader, and the values between stages."""
        for stage, storage in (("vertex", "in"), ("vertex", "out"), ("geometry", "out")):
            section = "attributes" if storage == "in" else "varyings"
            for one, origin in _globals(self.texts[stage].source, storage) if stage in self.texts else ():
                name = " ".join([*sorted(one.qualifiers), _type(one), one.name])
                yield InScope(section, name, f"{stage} shader, {origin.purpose or _file(origin.file)}")

    def outputs(self) -> Iterator[InScope]:
        for write in self.step.writes:
            desc = self.resources[write.resource].desc
            what = desc.format if isinstance(desc, TextureDesc) else "a buffer"
            word = {"color": "out vec4 ", "image": "uniform image2D ", "buffer": "buffer ", "depth": "gl_FragDepth: "}
            yield InScope("outputs", f"{word[write.use]}{write.name}", f"{write.resource}, {what}")

    def _reads(self) -> Iterator[tuple[str, Read]]:
        """Yield every read of the step and its functions, with the prefix of its name."""
        yield from (("", read) for read in self.step.reads)
        yield from ((prefix(one.node), read) for one in self.step.functions for read in one.reads)

    def _port(self, before: str, read: Read) -> str:
        node, port = read.resource.rpartition(".")[::2]
        last = " of the last frame" if read.previous else ""
        if before:
            return f"{read.resource}{last}, for a function"
        inputs = self.types[self.step.node].cls.inputs()
        for name in (read.name, re.sub(r"_\d+\Z", "", read.name)):
            if name in inputs:
                return f"input '{name}': {read.resource}{last}"
        return f"its own '{port}'{last}" if node == self.step.node else f"{read.resource}{last}"


_declared = lru_cache(8)(globals_of)  # called for a stage's uniforms, inputs and outputs


def _globals(source: SourceText, storage: str) -> Iterator[tuple[Global, Origin]]:
    text = source.text
    for one in _declared(text).declared:
        if one.storage == storage:
            yield one, source.origins[text.count("\n", 0, one.at)]


def _type(one: Global) -> str:
    return one.type + ("[]" if one.array else "")


def _value(value: object) -> str:
    if isinstance(value, Sequence):
        shown = ", ".join(f"{part:g}" for part in value[:4])
        return f"{len(value)} numbers" if len(value) > 4 else f"[{shown}]"
    return {True: "true", False: "false"}[value] if isinstance(value, bool) else f"{value:g}"


def _file(file: Path | None) -> str:
    """Return a file as an author names it: `<view.glsl>` for shared includes, else its path."""
    if file is None:
        return "rendergraph"
    shared = folder("rendergraph.shaders")
    return file.relative_to(shared).as_posix() if file.is_relative_to(shared) else shown_file(file)


def annotated(text: StageText) -> str:
    """Return a stage's text with a comment before each run of lines that names its file; it compiles as before."""
    found: list[str] = []
    last, gap = Origin(), True
    for line, origin in zip(text.source.lines, text.source.origins, strict=True):
        if not line.strip():
            gap = True
            continue
        purpose = "macros" if origin.purpose.startswith("the macro ") else origin.purpose
        if origin.file is None:
            follows, label = last.file is None and purpose == last.purpose, purpose or "rendergraph"
        else:
            follows = origin.file == last.file and origin.line == last.line + 1 and not gap
            label = f"{_file(origin.file)}:{origin.line}"
        if not follows:
            found += [""] * bool(found) + [f"// {label}"]
        found.append(line)
        last, gap = Origin(origin.file, origin.line, purpose=purpose), False
    return "\n".join(found) + "\n"
