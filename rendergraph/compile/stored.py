"""Images and buffers of a step: what it only reads is declared so, and a buffer holds what its block takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rendergraph.errors import InputError, Place, Problem
from rendergraph.gl.programs import Program
from rendergraph.glsl.globals import globals_of
from rendergraph.glsl.source import SourceText
from rendergraph.program import Texts
from rendergraph.steps import Read, Resource, Step, Write
from rendergraph.textures import BufferDesc

_ROUNDED = 16  # bytes that some drivers round a block's size up to


def check_stored(
    step: Step, program: Program, named: Sequence[tuple[str, Read]], resources: Mapping[str, Resource], texts: Texts
) -> None:
    """Order rests on nobody writing what a step reads; and beyond a buffer's end a shader finds nothing.

    Args:
        step: a step.
        program: its program.
        named: what it and its functions read, each with what stands before its name in the text.
        resources: for the sizes of buffers.
        texts: the program's texts, put together only where something is stored.

    Raises:
        InputError: a block takes more than its buffer holds (RG438), or what is only read may be written (RG457).
    """
    written = {write.name for write in step.writes}
    only_read = {
        before + read.name: "image" if read.use == "image" else "buffer"
        for before, read in named
        if read.use in ("image", "buffer")
        and before + read.name not in written
        and before + read.name in (program.uniforms if read.use == "image" else program.storage)
    }
    uses: list[tuple[str, Read | Write]] = [*named, *(("", write) for write in step.writes)]
    short = {}
    for before, use in uses:
        desc, least = resources[use.resource].desc, program.storage_bytes.get(before + use.name, 0)
        if use.use == "buffer" and isinstance(desc, BufferDesc) and -(-desc.bytes // _ROUNDED) * _ROUNDED < least:
            short[before + use.name] = f"takes {least} bytes, but '{use.resource}' holds {desc.bytes}"
    if not only_read and not short:
        return
    problems: list[Problem] = []
    said: set[str] = set()
    for stage in texts().values():
        for found in globals_of(stage.source.text).declared:
            place, line, prefix = _at(stage.source, found.at)
            own = found.name.removeprefix(prefix)
            if found.name in short and found.storage == "buffer" and found.name not in said:
                text = f"block '{own}' {short[found.name]}"
                problems.append(_problem(step, "RG438", text, place, line))
                said.add(found.name)
            if only_read.get(found.name) and "readonly" not in found.qualifiers:
                word = only_read[found.name]
                right = f"uniform readonly {found.type} {own}" if found.type else f"readonly buffer {own}"
                text = f"{word} '{own}' is only read, so it is declared `{right}`; what a step writes stands in `out`"
                problems.append(_problem(step, "RG457", text, place, line))
    if problems:
        raise InputError(list(dict.fromkeys(problems)))


def _problem(step: Step, code: str, text: str, place: Place | None, line: str) -> Problem:
    problem = step.problem(code, text)
    return problem.relocate(place, line) if place is not None else problem


def _at(source: SourceText, at: int) -> tuple[Place | None, str, str]:
    """Place, line and prefix of a character of a text."""
    text = source.text
    number = text.count("\n", 0, at)
    origin = source.origins[number]
    column = at - (text.rfind("\n", 0, at) + 1) + 1
    line = source.lines[number]
    if origin.column:  # a layout was put into the author's line
        start = max(0, line.find("layout("))
        line = line[:start] + line[start + origin.column :]
    return origin.place(column), line, origin.prefix
