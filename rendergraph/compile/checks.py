"""What a linked program looks at, held against what its step gives it; said at the shader's own line."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from itertools import product
from typing import Any

from rendergraph.declare import Node
from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.gl.programs import Program, Uniform, outputs_of
from rendergraph.program import Texts, named_reads, unfit_outputs, unfit_sampler
from rendergraph.steps import Read, Resource, Step, Write

# Text: it takes a millisecond to compile, and most pipelines declare no vertices of their own.
_FORMAT = r"(?P<count>\d*)(?P<kind>[fiux])(?P<bytes>[1248]?)(?P<step>(?:/[vi])?)\Z"


def check_uniforms(
    step: Step, program: Program, uniforms: Mapping[str, Any], sampled: Collection[str], texts: Texts
) -> None:
    """A sampler that nothing is bound to would silently read another pass's texture, an unset uniform is 0.

    Args:
        step: a step.
        program: its program.
        uniforms: what it sets.
        sampled: the names of the textures that it binds.
        texts: see `Texts`.

    Raises:
        InputError: the program looks at something that the step does not give (RG430, RG434), or takes other
            numbers than it is given (RG436).
    """
    uses: tuple[Read | Write, ...] = (*step.reads, *step.writes)
    images = {use.name for use in uses if use.use == "image"}
    files = ", ".join(file for _, file in step.shaders)
    problems = []
    for name, uniform in program.uniforms.items():
        if not uniform.is_opaque and name not in uniforms:
            hint = suggestion(name, [known for known, _ in step.uniforms])
            text = f"{files} looks at uniform '{name}', which nothing sets{hint}"
            problems.append(_placed(step.problem("RG434", text), name, texts))
        elif uniform.is_opaque and name not in images and name not in sampled:
            slot = name.endswith("_texture") and step.kind == "geometry"
            guard = f"; not every material has it, so it stands inside #ifdef HAS_{name.upper()}" if slot else ""
            text = (
                f"{files} samples '{name}', but the step reads no texture of that name; "
                f"it reads {', '.join(sorted(sampled)) or 'none'}{guard}"
            )
            problems.append(_placed(step.problem("RG430", text), name, texts))
        elif not uniform.is_opaque and (wrong := misfit(uniform, uniforms[name])) is not None:
            problems.append(_placed(step.problem("RG436", f"{files} {wrong}"), name, texts))
    if problems:
        raise InputError(problems)


def check_samplers(step: Step, program: Program, resources: Mapping[str, Resource], texts: Texts) -> None:
    """A sampler of another kind than its texture reads black, silently.

    Raises:
        InputError: there is such a sampler (RG447).
    """
    problems = []
    for name, read in named_reads(step):
        uniform = program.uniforms.get(name)
        if read.use == "sample" and uniform is not None:
            problem = unfit_sampler(step, uniform.glsl, read, resources)
            problems += [_placed(problem, name, texts)] if problem is not None else []
    if problems:
        raise InputError(problems)


def misfit(uniform: Uniform, value: Any) -> str | None:
    """What a uniform and the value that it is given disagree about: the driver would read beyond the numbers."""
    numbers = value if isinstance(value, tuple | list) else (value,)
    if len(numbers) % uniform.number_count or not 1 <= len(numbers) // uniform.number_count <= uniform.size:
        array = f"[{uniform.size}]" if uniform.size > 1 else ""
        count = f"{len(numbers)} number{'' if len(numbers) == 1 else 's'}"
        return f"declares '{uniform.name}' as {uniform.glsl}{array}, but it is given {count}"
    if uniform.is_integer and any(isinstance(number, float) for number in numbers):
        return f"declares '{uniform.name}' as {uniform.glsl}, but it is given floats, {numbers[0]!r}"
    return None


def check_blocks(step: Step, program: Program, given: Collection[str], texts: Texts) -> None:
    """A buffer that nothing is bound to would be written nowhere, or over another node's.

    Raises:
        InputError: the program has a block that the step does not give (RG430).
    """
    files = ", ".join(file for _, file in step.shaders)
    uses: tuple[Read | Write, ...] = (*step.all_reads, *step.writes)
    own = sorted({use.name for use in uses if use.use == "buffer"})
    problems = [
        _placed(
            step.problem(
                "RG430",
                f"{files} looks at block '{name}', but the step has no buffer of that name; it has "
                f"{', '.join(own) or 'none'}",
            ),
            name,
            texts,
        )
        for name in (*program.storage, *program.blocks)
        if name not in given
    ]
    if problems:
        raise InputError(problems)


def check_outputs(
    step: Step, program: Program, cls: type[Node], resources: Mapping[str, Resource], texts: Texts
) -> None:
    """Check that a program writes every target, and nothing else, in the kind of number that the target holds.

    Raises:
        InputError: it does not (RG437, RG447, RG448).
    """
    written = outputs_of(program)
    problems = [_placed(one, one.subject, texts) for one in unfit_outputs(step, written, cls, resources)]
    targets = [write.name for write in step.writes if write.use == "color"]
    shader = dict(step.shaders).get("fragment", "the step")
    for name in targets if len(targets) > 1 else ():  # a single one may have any name, or be discarded everywhere
        if name not in written:
            hint = suggestion(name, written.keys() - set(targets))
            problems.append(step.problem("RG437", f"{shader} writes no output '{name}'{hint}", name))
    if problems:
        raise InputError(problems)


def check_attributes(step: Step, program: Program, given: Mapping[str, str], texts: Texts) -> None:
    """A vertex attribute that no buffer holds would be (0, 0, 0, 1) at every vertex, or what another draw left.

    Args:
        step: a geometry or draw step.
        program: its program.
        given: attribute to its moderngl format, `3f` or `2i`.
        texts: see `Texts`.

    Raises:
        InputError: the vertex shader reads another one, or one of the wrong type (RG428).
    """
    problems = []
    vertex = dict(step.shaders).get("vertex", "")
    holder = "the scene" if step.kind == "geometry" else "no buffer of `attributes`"
    for name, shape in attributes_of(program).items():
        if name not in given:
            lacks = f"which {holder} does not have" if step.kind == "geometry" else f"which {holder} holds"
            text = f"{vertex} reads vertex attribute '{name}', {lacks}{suggestion(name, given)}"
        elif (shape == "f") != ("f" in given[name]) and shape != "f":
            text = f"{vertex} reads vertex attribute '{name}' as whole numbers, but it holds floats ({given[name]})"
        else:
            continue
        problems.append(_placed(step.problem("RG428", text), name, texts))
    if problems:
        raise InputError(problems)


def attributes_of(program: Program) -> dict[str, str]:
    """A program's vertex attributes with `f`, `i` or `d` for the kind of number."""
    members = program.object
    return {
        name: members[name].shape
        for name in members
        if type(members[name]).__name__ == "Attribute" and not name.startswith("gl_")
    }


def _placed(problem: Problem, name: str, texts: Texts) -> Problem:
    """The problem at the line where the shader declares a name, if it is found."""
    from rendergraph.program.messages import declared_at  # where something is wrong alone

    for mentions, text in product((False, True), texts().values()):
        found = declared_at(text.source, [name], mentions=mentions)
        if found is not None:
            return problem.relocate(*found)
    return problem


def layout_for(layout: str, program: Program) -> tuple[str, list[str]]:
    """A buffer's layout for a program that looks at some of it: what it does not look at becomes padding.

    Args:
        layout: formats, then names, as `steps.draw` takes it.
        program: the program.

    Returns:
        moderngl's format and the names in it, which may be none.
    """
    words = layout.split()
    formats = [word for word in words if re.match(_FORMAT, word)]
    names = words[len(formats) :]
    wanted = set(attributes_of(program))
    kept: list[str] = []
    waiting = iter(names)
    for number, word in enumerate(formats):
        match = re.match(_FORMAT, word)
        assert match is not None  # it did a moment ago
        if match["kind"] == "x":
            continue
        name = next(waiting)
        if name in wanted:
            kept.append(name)
        else:
            size = int(match["count"] or 1) * int(match["bytes"] or 4)
            formats[number] = f"{size}x{match['step']}"
    return " ".join(formats), kept


def attribute_formats(layout: str) -> dict[str, str]:
    words = layout.split()
    formats = [word for word in words if re.match(_FORMAT, word)]
    return dict(zip(words[len(formats) :], [word for word in formats if "x" not in word], strict=True))
