"""What a linked program looks at, held against what its step gives it; said at the shader's own line."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from rendergraph.errors import InputError, Problem, suggestion
from rendergraph.gl.programs import Program
from rendergraph.program import StageText, declared_at
from rendergraph.steps import Read, Step, Write

_FORMAT = re.compile(r"(?P<count>\d*)(?P<kind>[fiux])(?P<bytes>[1248]?)(?P<step>(?:/[vi])?)\Z")

Texts = Callable[[], Mapping[str, StageText]]
"""The program's texts, put together again where something has to be said."""


def check_uniforms(
    step: Step, program: Program, uniforms: Mapping[str, Any], sampled: set[str], geometry: bool, texts: Texts
) -> None:
    """A sampler that nothing is bound to would silently read another pass's texture, an unset uniform is 0.

    Raises:
        InputError: the program looks at something that the step does not give (RG430, RG434).
    """
    uses: tuple[Read | Write, ...] = (*step.reads, *step.writes)
    images = {use.name for use in uses if use.use == "image"}
    files = ", ".join(file for _, file in step.shaders)
    problems = []
    for name, uniform in program.uniforms.items():
        known = name in sampled or name in images or name in uniforms or (geometry and name.endswith("_texture"))
        if not uniform.opaque and name not in uniforms:
            hint = suggestion(name, [known for known, _ in step.uniforms])
            text = f"{files} looks at uniform '{name}', which nothing sets{hint}"
            problems.append(_placed(step.problem("RG434", text), name, texts))
        elif uniform.opaque and not known:
            text = (f"{files} samples '{name}', but the step reads no texture of that name; "
                    f"it reads {', '.join(sorted(sampled)) or 'none'}")  # fmt: skip
            problems.append(_placed(step.problem("RG430", text), name, texts))
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
    for text in texts().values():
        found = declared_at(text.source, [name])
        if found is not None:
            return replace(problem, place=found[0], line_text=found[1])
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
    formats = [word for word in words if _FORMAT.match(word)]
    names = words[len(formats) :]
    wanted = set(attributes_of(program))
    kept: list[str] = []
    waiting = iter(names)
    for number, word in enumerate(formats):
        match = _FORMAT.match(word)
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
    """The attributes of a buffer's layout with their formats."""
    words = layout.split()
    formats = [word for word in words if _FORMAT.match(word)]
    return dict(zip(words[len(formats) :], [word for word in formats if "x" not in word], strict=True))
