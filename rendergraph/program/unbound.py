"""Find names that a step's shaders use but nothing provides: samplers, views, images and uniforms. No GL.

This depends on the text only: code that a constant condition excludes is known only to the driver.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import partial

from rendergraph.declare import Node
from rendergraph.errors import Problem, nearest, suggestion
from rendergraph.glsl.globals import declared_blocks, declared_samplers
from rendergraph.glsl.reachable import compiled_text, reachable_names
from rendergraph.program.text import StageText, prefix
from rendergraph.steps import Read, Step, Write

_VIEWS = re.compile(r"\b([A-Za-z_]\w*)_views\b")
_UNIFORMS = re.compile(r"uniform[^;]*;")  # fast; each match starts one character early, for `\b`
_BUFFER = re.compile(r"\bbuffer\s+([A-Za-z_]\w*)\s*\{")
_UNIFORM = re.compile(
    r"\buniform\s+(?:(?:lowp|mediump|highp)\s+)?(?!\w*(?:sampler|image|only\b|coherent|volatile|restrict))\w+\s+([A-Za-z_][\w\s,]*)[;=\[]"
)
_TYPED = re.compile(
    r"\buniform\s+(?:(?:lowp|mediump|highp)\s+)?(float|int|uint|bool|[iu]?vec[234])\s+([A-Za-z_]\w*)\s*;"
)
_DECLARED = r"\buniform\b[^;{{}}]*\b{}\b"
_CONSTANT_IF = re.compile(r"\bif\s*\([A-Z0-9_\s!=<>&|()+-]*[A-Z][A-Z0-9_\s!=<>&|()+-]*\)")


def unbound_sampler(step: Step, name: str, sampled: Collection[str], cls: type[Node]) -> str:
    """Return the message for a sampler without a texture."""
    if name in cls.ports():
        return f"{_files(step)} samples {_left_out(step, name, cls)}"
    for function in step.functions:
        stem = name.removeprefix(prefix(function.node))
        if stem != name:
            text = f"{function.shader} of node '{function.node}' samples '{stem}'"
            return f"{text}, which is not among the `reads` of its Function; add it there"
    slot = name.endswith("_texture") and step.kind == "geometry"
    guard = f"; not every material has it, so put it inside #ifdef HAS_{name.upper()}" if slot else ""
    text = f"{_files(step)} samples '{name}', but the step reads no texture of that name"
    return f"{text}; it reads {', '.join(sorted(sampled)) or 'none'}{guard}"


def unbound_block(step: Step, name: str) -> str:
    """Return the message for a block without a buffer."""
    uses: tuple[Read | Write, ...] = (*step.all_reads, *step.writes)
    own = ", ".join(sorted({use.name for use in uses if use.use == "buffer"})) or "none"
    return f"{_files(step)} uses block '{name}', but the step has no buffer of that name; it has {own}"


def unset_uniform(step: Step, name: str) -> str:
    """Return the message for a uniform without a value."""
    hint = suggestion(name, [known for known, _ in step.uniforms])
    return f"{_files(step)} uses uniform '{name}', which nothing sets{hint}"


def unbound(step: Step, texts: Mapping[str, StageText], cls: type[Node]) -> Iterator[tuple[StageText, str, Problem]]:
    """Yield stage, name and problem of everything that authors' shaders use but the step does not provide as declared.

    Code that a constant condition might exclude gives warnings.
    """
    for text in texts.values():
        blocks = [block for block in text.source.blocks if block.origin.file is not None and not block.origin.shared]
        own = "\n".join("\n".join(block.lines) for block in blocks)
        found = list(_suspects(step, own, text.text, cls))
        if found:  # usually in a branch that the step's macros exclude
            macros = [line for block in text.source.blocks if block.origin.file is None for line in block.lines]
            quick = compiled_text("\n".join([*macros, own]), certain=True)
            found = [one for one in found if one[1] in quick and re.search(one[2], quick)]
        if not found:
            continue
        names, declared = reachable_names(text.text, certain=True), compiled_text(text.text, certain=True)
        has_blocks = any("buffer" in pattern for _, _, pattern, _ in found)
        members = {block: named for _, block, named in declared_blocks(declared)} if has_blocks else {}
        for code, name, pattern, describe in found:
            if not names.isdisjoint(members.get(name, {name})) and re.search(pattern, declared):
                problem = step.problem(code, describe())
                undeclared = name.endswith("_views")
                yield text, name, problem if undeclared or not _CONSTANT_IF.search(own) else problem.as_warning()


def uniform_kinds(step: Step) -> tuple[tuple[str, int, bool], ...]:
    """Return the uniforms of a step with their numbers of values, and whether the values are floats."""
    found = []
    for name, value in step.uniforms:
        numbers = value if isinstance(value, tuple | list) else (value,)
        found.append((name, len(numbers), any(isinstance(number, float) for number in numbers)))
    return tuple(found)


def _suspects(step: Step, own: str, whole: str, cls: type[Node]) -> Iterator[tuple[str, str, str, Callable[[], str]]]:
    """Yield code, name, a pattern of the line that matters if compiled, and a function that returns the message."""
    uses: tuple[Read | Write, ...] = (*step.reads, *step.writes)
    given = {use.name for use in uses}
    given |= {prefix(each.node) + read.name for each in step.functions for read in each.reads}
    kinds = {name: (count, floats) for name, count, floats in uniform_kinds(step)}
    set_names = {prefix(each.node) + name for each in step.functions for name, _ in each.uniforms}
    set_names |= {"view_index", *kinds, *given}
    uniforms = "".join(own[max(found.start() - 1, 0) : found.end()] for found in _UNIFORMS.finditer(own))
    for name in declared_samplers(uniforms).keys() - given:
        if not (name.endswith("_texture") and step.kind == "geometry"):
            yield "RG430", name, _DECLARED.format(name), partial(unbound_sampler, step, name, given, cls)
    for stem in {stem for line in own.split("\n") if "_views" in line for stem in _VIEWS.findall(line)}:
        port = stem.removeprefix("previous_")
        if port in cls.ports() and f"{stem}_view_block" not in whole:
            yield "RG430", f"{stem}_views", rf"\b{stem}_views\b", partial(_without_views, step, port, given, cls)
    for name in _BUFFER.findall(own) if "buffer" in own else ():
        if name not in given:
            yield "RG430", name, rf"\bbuffer\s+{name}\b", partial(unbound_block, step, name)
    for names in _UNIFORM.findall(uniforms):
        for name in re.findall(r"[A-Za-z_]\w*", names):
            if name not in set_names:
                yield "RG434", name, _DECLARED.format(name), partial(unset_uniform, step, name)
    for kind, name in _TYPED.findall(uniforms):
        count, floats = kinds.get(name, (0, False))
        if count and (count != (int(kind[-1]) if kind[-1].isdigit() else 1) or (floats and kind[0] in "iub")):
            yield "RG436", name, rf"\b{kind}\s+{name}\b", partial(_unfit_uniform, step, name, kind, count)


def _unfit_uniform(step: Step, name: str, kind: str, count: int) -> str:
    """Return how the declaration of a uniform and its value disagree."""
    size = int(kind[-1]) if kind[-1].isdigit() else 1
    value = dict(step.uniforms)[name]
    floats = f"floats, {(value[0] if isinstance(value, tuple | list) else value)!r}"
    what = floats if count == size else f"{count} number{'' if count == 1 else 's'}"
    return f"{_files(step)} declares '{name}' as {kind}, but it is given {what}"


def _without_views(step: Step, port: str, given: Collection[str], cls: type[Node]) -> str:
    if port in given:
        text = f"{_files(step)} uses the views of '{port}', but the texture linked there was not drawn with a view"
        return f"{text}; use `camera`, or give the linked output `view=`"
    return f"{_files(step)} uses the views of {_left_out(step, port, cls)}"


def _left_out(step: Step, name: str, cls: type[Node]) -> str:
    """Return why a step does not read a port of its node, and the fix."""
    optional = getattr(cls.ports()[name], "optional", False)
    guard = f"leave it out by #ifdef HAS_{name.upper()}"
    if step.where.caller is None:  # it reads all connected inputs
        return f"'{name}', which is not connected here; {guard}" if optional else f"'{name}', which it does not read"
    near = nearest(name, {use.name for use in step.reads} - cls.ports().keys())
    way = f"give it as {name}=…, not {near}=…" if near is not None else f"add {name}=self.{name} to the step"
    more = f", or {guard} where it is not connected" if optional else ""
    return f"'{name}', a port of the node that this step does not read; {way}{more}"


def _files(step: Step) -> str:
    return ", ".join(file for _, file in step.shaders)
