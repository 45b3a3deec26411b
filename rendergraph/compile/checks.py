"""Compare what a linked program uses with what its step provides; mistakes are located in the shader."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from itertools import product
from typing import Any

from rendergraph.declare import Node
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.gl.programs import Program, Uniform, member_offsets, outputs_of
from rendergraph.glsl.globals import globals_of
from rendergraph.program.checks import (
    Texts,
    named_reads,
    unbound_block,
    unbound_sampler,
    unfit_outputs,
    unfit_sampler,
    unset_uniform,
)
from rendergraph.steps import Read, Resource, Step, Write
from rendergraph.textures import BufferDesc

# A string, because compiling it takes a millisecond, and most pipelines declare no vertices of their own.
_FORMAT = r"(?P<count>\d*)(?P<kind>[fiux])(?P<bytes>[1248]?)(?P<step>(?:/[vi])?)\Z"
_ROUNDED = 16  # bytes that some drivers round a block's size up to


def check_program(
    step: Step,
    program: Program,
    texts: Texts,
    resources: Mapping[str, Resource],
    uniforms: Mapping[str, Any],
    blocks: Collection[str],
    sampled: Collection[str],
    cls: type[Node],
) -> None:
    """Raise the mistakes of the first check that finds any; drivers would read and write garbage silently.

    Args:
        uniforms: all uniforms that the step sets, name to value.
        blocks: names of the blocks that have a binding point.
        sampled: names of the textures that the step binds.
    """
    for mistakes in (
        _uniforms(step, program, uniforms, sampled, texts, cls),
        _samplers(step, program, resources, texts),
        _blocks(step, program, blocks, texts),
        _elements(step, program, resources, texts),
        _outputs(step, program, cls, resources, texts),
        _stored(step, program, resources, texts),
    ):
        _raise_if_any(mistakes)


def _raise_if_any(mistakes: Iterator[Problem]) -> None:
    if problems := list(dict.fromkeys(mistakes)):
        raise InputError(problems)


def _uniforms(
    step: Step,
    program: Program,
    uniforms: Mapping[str, Any],
    sampled: Collection[str],
    texts: Texts,
    cls: type[Node],
) -> Iterator[Problem]:
    """Find unbound samplers, which would silently read another pass's texture, and unset uniforms, which are 0."""
    uses: tuple[Read | Write, ...] = (*step.reads, *step.writes)
    images = {use.name for use in uses if use.use == "image"}
    files = ", ".join(file for _, file in step.shaders)
    for name, uniform in program.uniforms.items():
        if not uniform.is_opaque and name not in uniforms:
            code, text = "RG434", unset_uniform(step, name)
        elif uniform.is_opaque and name not in images and name not in sampled:
            code, text = "RG430", unbound_sampler(step, name, sampled, cls)
        elif not uniform.is_opaque and (mismatch := uniform_mismatch(uniform, uniforms[name])) is not None:
            code, text = "RG436", f"{files} {mismatch}"
        else:
            continue
        yield _placed(step.problem(code, text), name, texts)


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


def _samplers(step: Step, program: Program, resources: Mapping[str, Resource], texts: Texts) -> Iterator[Problem]:
    """Find samplers of another kind than their texture, which would silently read black."""
    for name, read in named_reads(step):
        uniform = program.uniforms.get(name)
        if read.use == "sample" and uniform is not None:
            problem = unfit_sampler(step, uniform.glsl, read, resources)
            yield from [_placed(problem, name, texts)] if problem is not None else []


def _blocks(step: Step, program: Program, given: Collection[str], texts: Texts) -> Iterator[Problem]:
    """Find unbound buffers, writes to which would be lost or overwrite another node's buffer."""
    for name in program.block_names:
        if name not in given:
            yield _placed(step.problem("RG430", unbound_block(step, name)), name, texts)


def _elements(step: Step, program: Program, resources: Mapping[str, Resource], texts: Texts) -> Iterator[Problem]:
    """Find blocks whose element layout differs from the declaration, and so from what NumPy wrote."""
    uses: dict[str, Read | Write] = {**dict(named_reads(step)), **{write.name: write for write in step.writes}}
    for name in program.storage.keys() & uses.keys():
        desc = resources[uses[name].resource].desc
        if not isinstance(desc, BufferDesc) or desc.element is None:
            continue
        element = desc.element
        for member, at in member_offsets(program, name).items():
            field = member.rpartition(".")[2]
            if field not in element.fields or (at - element.dtype.fields[field][1]) % element.dtype.itemsize:
                text = f"'{member}' of block '{name}' is at byte {at}, which does not fit the elements of "
                text += f"'{uses[name].resource}'; declare {element.name} values[]; in it: {element.glsl}"
                yield _placed(step.problem("RG438", text), name, texts)
                break


def _outputs(
    step: Step, program: Program, cls: type[Node], resources: Mapping[str, Resource], texts: Texts
) -> Iterator[Problem]:
    """Check that a program writes every target, and nothing else, with the numeric type of the target."""
    written = outputs_of(program)
    yield from (_placed(one, one.subject, texts) for one in unfit_outputs(step, written, cls, resources))
    targets = [write.name for write in step.writes if write.use == "color"]
    shader = dict(step.shaders).get("fragment", "the step")
    for name in targets if len(targets) > 1 else ():  # a single output may have any name, or always be discarded
        if name not in written:
            hint = suggestion(name, written.keys() - set(targets))
            yield step.problem("RG437", f"{shader} writes no output '{name}'{hint}", name)


def _stored(step: Step, program: Program, resources: Mapping[str, Resource], texts: Texts) -> Iterator[Problem]:
    """Find writes to inputs, which would invalidate the order of steps, and blocks larger than their buffer."""
    writes = {write.name: write for write in step.writes}
    uses: dict[str, Read | Write] = {**dict(named_reads(step)), **writes}
    stored = {name: use.use for name, use in uses.items() if use.use in ("image", "buffer")}
    only_read = [name for name in stored.keys() - writes.keys() if name in program.uniforms or name in program.storage]
    short = {}
    for name in stored:
        desc, least = resources[uses[name].resource].desc, program.storage_bytes.get(name, 0)
        if isinstance(desc, BufferDesc) and -(-desc.bytes // _ROUNDED) * _ROUNDED < least:
            short[name] = f"takes {least} bytes, but '{uses[name].resource}' holds {desc.bytes}"
    for stage in texts().values() if only_read or short else ():
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


def check_attributes(step: Step, program: Program, given: Mapping[str, str], texts: Texts) -> None:
    """Find vertex attributes without a buffer, which would be (0, 0, 0, 1) or another draw's values at every vertex.

    `given` are attributes with their moderngl formats, `3f` or `2i`.
    """
    _raise_if_any(_attributes(step, program, given, texts))


def _attributes(step: Step, program: Program, given: Mapping[str, str], texts: Texts) -> Iterator[Problem]:
    vertex = dict(step.shaders).get("vertex", "")
    is_of_scene = step.kind == "geometry"
    lacks = "which the scene does not have" if is_of_scene else "which no buffer of `attributes` holds"
    for name, shape in attributes_of(program).items():
        text = f"{vertex} reads vertex attribute '{name}'"
        if name not in given:
            text += f", {lacks}{suggestion(name, given)}"
        elif (shape == "f") != ("f" in given[name]) and shape != "f":
            text += f" as integers, but it holds floats ({given[name]})"
        else:
            continue
        yield _placed(step.problem("RG428", text), name, texts)


def attributes_of(program: Program) -> dict[str, str]:
    """Return a program's vertex attributes with `f`, `i` or `d` for the numeric type."""
    members = program.object
    return {
        name: members[name].shape
        for name in members
        if type(members[name]).__name__ == "Attribute" and not name.startswith("gl_")
    }


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
