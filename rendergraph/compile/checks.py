"""Compare what a linked program uses with what its step provides; mistakes are located in the shader."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from itertools import product
from typing import Any

from msgspec import Struct

from rendergraph.declare import Node
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.gl.programs import Program, Uniform, member_offsets, outputs_of
from rendergraph.glsl.globals import globals_of
from rendergraph.program import checks
from rendergraph.program.checks import Texts, named_reads
from rendergraph.steps import Read, Resource, Step, Write
from rendergraph.textures import BufferDesc

# A string, because compiling it takes a millisecond, and most pipelines declare no vertices of their own.
_FORMAT = r"(?P<count>\d*)(?P<kind>[fiux])(?P<bytes>[1248]?)(?P<step>(?:/[vi])?)\Z"
_ROUNDED = 16  # bytes that some drivers round a block's size up to


class ProgramChecks(Struct, eq=False, dict=True):
    """Checks of a step's program; without them, drivers would read and write garbage silently.

    Attributes:
        uniforms: all uniforms that the step sets, name to value.
        blocks: names of the blocks that have a binding point.
        sampled: names of the textures that the step binds.
    """

    step: Step
    program: Program
    texts: Texts
    cls: type[Node]
    resources: Mapping[str, Resource]
    uniforms: Mapping[str, Any]
    blocks: Collection[str]
    sampled: Collection[str]

    def __post_init__(self) -> None:
        self._writes = {write.name: write for write in self.step.writes}
        self._uses: dict[str, Read | Write] = {**dict(named_reads(self.step)), **self._writes}

    def run(self) -> None:
        """Raise the mistakes of the first check that finds any."""
        for check in (self._uniforms, self._samplers, self._blocks, self._elements, self._outputs, self._stored):
            _raise_if_any(check())

    def _problem(self, code: str, text: str, name: str) -> Problem:
        return _placed(self.step.problem(code, text), name, self.texts)

    def _uniforms(self) -> Iterator[Problem]:
        """Find unbound samplers, which would silently read another pass's texture, and unset uniforms, which are 0."""
        step, uniforms = self.step, self.uniforms
        uses: tuple[Read | Write, ...] = (*step.reads, *step.writes)
        images = {use.name for use in uses if use.use == "image"}
        files = ", ".join(file for _, file in step.shaders)
        for name, uniform in self.program.uniforms.items():
            if uniform.is_opaque:
                if name not in images and name not in self.sampled:
                    yield self._problem("RG430", checks.unbound_sampler(step, name, self.sampled, self.cls), name)
            elif name not in uniforms:
                yield self._problem("RG434", checks.unset_uniform(step, name), name)
            elif (mismatch := uniform_mismatch(uniform, uniforms[name])) is not None:
                yield self._problem("RG436", f"{files} {mismatch}", name)

    def _samplers(self) -> Iterator[Problem]:
        """Find samplers of another kind than their texture, which would silently read black."""
        for name, read in named_reads(self.step):
            uniform = self.program.uniforms.get(name)
            if read.use == "sample" and uniform is not None:
                problem = checks.unfit_sampler(self.step, uniform.glsl, read, self.resources)
                if problem is not None:
                    yield _placed(problem, name, self.texts)

    def _blocks(self) -> Iterator[Problem]:
        """Find unbound buffers, writes to which would be lost or overwrite another node's buffer."""
        for name in self.program.block_names:
            if name not in self.blocks:
                yield self._problem("RG430", checks.unbound_block(self.step, name), name)

    def _elements(self) -> Iterator[Problem]:
        """Find blocks whose element layout differs from the declaration, and so from what NumPy wrote."""
        for name in self.program.storage.keys() & self._uses.keys():
            resource = self._uses[name].resource
            desc = self.resources[resource].desc
            if not isinstance(desc, BufferDesc) or desc.element is None:
                continue
            element = desc.element
            for member, at in member_offsets(self.program, name).items():
                field = member.rpartition(".")[2]
                if field not in element.fields or (at - element.dtype.fields[field][1]) % element.dtype.itemsize:
                    text = f"'{member}' of block '{name}' is at byte {at}, which does not fit the elements of "
                    text += f"'{resource}'; declare {element.name} values[]; in it: {element.glsl}"
                    yield self._problem("RG438", text, name)
                    break

    def _outputs(self) -> Iterator[Problem]:
        """Check that a program writes every target, and nothing else, with the numeric type of the target."""
        step, written = self.step, outputs_of(self.program)
        for problem in checks.unfit_outputs(step, written, self.cls, self.resources):
            yield _placed(problem, problem.subject, self.texts)
        targets = [write.name for write in step.writes if write.use == "color"]
        shader = dict(step.shaders).get("fragment", "the step")
        for name in targets if len(targets) > 1 else ():  # a single output may have any name, or always be discarded
            if name not in written:
                hint = suggestion(name, written.keys() - set(targets))
                yield step.problem("RG437", f"{shader} writes no output '{name}'{hint}", name)

    def _stored(self) -> Iterator[Problem]:
        """Find writes to inputs, which would invalidate the order of steps, and blocks larger than their buffer."""
        step, program, uses = self.step, self.program, self._uses
        stored = {name: use.use for name, use in uses.items() if use.use in ("image", "buffer")}
        only_read = [
            name for name in stored.keys() - self._writes if name in program.uniforms or name in program.storage
        ]
        short = {}
        for name in stored:
            desc, least = self.resources[uses[name].resource].desc, program.storage_bytes.get(name, 0)
            if isinstance(desc, BufferDesc) and -(-desc.bytes // _ROUNDED) * _ROUNDED < least:
                short[name] = f"takes {least} bytes, but '{uses[name].resource}' holds {desc.bytes}"
        for stage in self.texts().values() if only_read or short else ():
            for found in globals_of(stage.source.text).declared:
                own, problems = uses[found.name].name if found.name in uses else "", []
                if found.storage == "buffer" and found.name in short:
                    problems.append(step.problem("RG438", f"block '{own}' {short.pop(found.name)}"))
                if found.name in only_read and "readonly" not in found.qualifiers:
                    right = f"uniform readonly {found.type} {own}" if found.type else f"readonly buffer {own}"
                    text = f"'{own}' is only read, so declare it as `{right}`; a step writes only what is in `out`"
                    problems.append(step.problem("RG457", f"{stored[found.name]} {text}"))
                place, line = stage.source.place(found.at)
                yield from [problem.relocate(place, line) if place else problem for problem in problems]


def _raise_if_any(mistakes: Iterable[Problem]) -> None:
    if problems := list(dict.fromkeys(mistakes)):
        raise InputError(problems)


def uniform_mismatch(uniform: Uniform, value: Any) -> str | None:
    """Return how a uniform and its value disagree; the driver would read beyond the value."""
    numbers = value if isinstance(value, tuple | list) else (value,)
    if len(numbers) % uniform.number_count or not 1 <= len(numbers) // uniform.number_count <= uniform.size:
        array = f"[{uniform.size}]" if uniform.size > 1 else ""
        count = f"{len(numbers)} number{'' if len(numbers) == 1 else 's'}"
        return f"declares '{uniform.name}' as {uniform.glsl}{array}, but it is given {count}"
    if uniform.is_integer and any(isinstance(number, float) for number in numbers):
        return f"declares '{uniform.name}' as {uniform.glsl}, but it is given floats, {numbers[0]!r}"
    return None


def check_attributes(step: Step, program: Program, given: Mapping[str, str], texts: Texts) -> None:
    """Find vertex attributes without a buffer, which would be (0, 0, 0, 1) or another draw's values at every vertex.

    `given` are attributes with their moderngl formats, `3f` or `2i`.
    """
    lacks = "which the scene does not have" if step.kind == "geometry" else "which no buffer of `attributes` holds"
    mistakes = {}
    for name, shape in attributes_of(program).items():
        if name not in given:
            mistakes[name] = f", {lacks}{suggestion(name, given)}"
        elif shape != "f" and "f" in given[name]:
            mistakes[name] = f" as integers, but it holds floats ({given[name]})"
    reads = f"{dict(step.shaders).get('vertex', '')} reads vertex attribute"
    problems = {name: step.problem("RG428", f"{reads} '{name}'{text}") for name, text in mistakes.items()}
    _raise_if_any(_placed(problem, name, texts) for name, problem in problems.items())


def attributes_of(program: Program) -> dict[str, str]:
    """Return a program's vertex attributes with `f`, `i` or `d` for the numeric type."""
    members = {name: program.object[name] for name in program.object if not name.startswith("gl_")}
    return {name: member.shape for name, member in members.items() if type(member).__name__ == "Attribute"}


def _placed(problem: Problem, name: str, texts: Texts) -> Problem:
    """Move a problem to the line where the shader declares a name, if it is found."""
    from rendergraph.program.messages import declared_at  # only for mistakes

    for mentions, text in product((False, True), texts().values()):
        found = declared_at(text.source, [name], mentions=mentions)
        if found is not None:
            return problem.relocate(*found)
    return problem


def layout_for(layout: str, program: Program) -> tuple[str, list[str]]:
    """Return a buffer's layout for a program as moderngl's format, and the names that the program uses.

    Unused attributes become padding.
    """
    parts, used = _layout_parts(layout), attributes_of(program)
    formats = []
    for match, name in parts:
        size = int(match["count"] or 1) * int(match["bytes"] or 4)
        formats.append(f"{size}x{match['step']}" if name and name not in used else match[0])
    return " ".join(formats), [name for _, name in parts if name in used]


def attribute_formats(layout: str) -> dict[str, str]:
    return {name: match[0] for match, name in _layout_parts(layout) if name}


def _layout_parts(layout: str) -> list[tuple[re.Match[str], str]]:
    """Return the formats of a layout such as `3f 4x 2f in_position in_uv`, each with its name, empty for padding."""
    words = layout.split()
    formats = [match for word in words if (match := re.match(_FORMAT, word))]
    names = iter(words[len(formats) :])
    return [(match, "" if match["kind"] == "x" else next(names)) for match in formats]
