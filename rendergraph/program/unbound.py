"""What a step's shaders use and nothing provides: samplers, views, images and uniforms. No GL.

As far as texts show it: a driver leaves out what a constant condition excludes, and only it knows.
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
_UNIFORM = re.compile(
    r"\buniform\s+(?:(?:lowp|mediump|highp)\s+)?(?!\w*(?:sampler|image))\w+\s+([A-Za-z_][\w\s,]*)[;=\[]"
)
_TYPED = re.compile(
    r"\buniform\s+(?:(?:lowp|mediump|highp)\s+)?(float|int|uint|bool|[iu]?vec[234])\s+([A-Za-z_]\w*)\s*;"
)
_CONSTANT_IF = re.compile(r"\bif\s*\([A-Z0-9_\s!=<>&|()+-]*[A-Z][A-Z0-9_\s!=<>&|()+-]*\)")


def unbound_sampler(step: Step, name: str, sampled: Collection[str], cls: type[Node]) -> str:
    """Return what is wrong with a sampler that the step binds no texture to."""
    if name in cls.ports():
        return f"{_files(step)} samples {_left_out(step, name, cls)}"
    for function in step.functions:
        stem = name.removeprefix(prefix(function.node))
        if stem != name:
            text = f"{function.shader} of node '{function.node}' samples '{stem}'"
            return f"{text}, which is not among the `reads` of its Function; add it there"
    slot = name.endswith("_texture") and step.kind == "geometry"
    guard = f"; not every material has it, so it stands inside #ifdef HAS_{name.upper()}" if slot else ""
    text = f"{_files(step)} samples '{name}', but the step reads no texture of that name"
    return f"{text}; it reads {', '.join(sorted(sampled)) or 'none'}{guard}"


def unbound_block(step: Step, name: str) -> str:
    """Return what is wrong with a block that the step binds no buffer to."""
    uses: tuple[Read | Write, ...] = (*step.all_reads, *step.writes)
    own = ", ".join(sorted({use.name for use in uses if use.use == "buffer"})) or "none"
    return f"{_files(step)} looks at block '{name}', but the step has no buffer of that name; it has {own}"


def unset_uniform(step: Step, name: str) -> str:
    """Return what is wrong with a uniform that the step gives no value."""
    hint = suggestion(name, [known for known, _ in step.uniforms])
    return f"{_files(step)} looks at uniform '{name}', which nothing sets{hint}"


def unbound(step: Step, texts: Mapping[str, StageText], cls: type[Node]) -> Iterator[tuple[StageText, str, Problem]]:
    """Yield stage, name and problem of what a step's own shaders certainly use and nothing provides.

    Warnings are about what a constant condition might exclude.
    """
    uses: tuple[Read | Write, ...] = (*step.reads, *step.writes)
    given = {use.name for use in uses}
    given |= {prefix(each.node) + read.name for each in step.functions for read in each.reads}
    set_names = {name for name, _ in step.uniforms} | {"view_index"}
    set_names |= {prefix(each.node) + name for each in step.functions for name, _ in each.uniforms}
    for text in texts.values():
        blocks = [block for block in text.source.blocks if block.origin.file is not None and not block.origin.shared]
        own = "\n".join("\n".join(block.lines) for block in blocks)
        found = dict(_suspects(step, own, text.text, given, set_names, cls))
        if found:  # mostly in a branch that the step's macros exclude
            macros = [line for block in text.source.blocks if block.origin.file is None for line in block.lines]
            quick = compiled_text("\n".join([*macros, own]), certain=True)
            found = {name: problem for name, problem in found.items() if re.search(rf"\b{name}\b", quick)}
        buffers = [name for kind, name, _ in declared_blocks(own) if kind == "buffer" and name not in given]
        if not found and not buffers:
            continue
        names = reachable_names(text.text, certain=True)
        declared = compiled_text(text.text, certain=True)
        for name, (code, describe) in found.items():
            is_view = name.endswith("_views")
            if name in names and (is_view or re.search(rf"\buniform\b[^;{{}}]*\b{name}\b", declared)):
                one = step.problem(code, describe())
                yield text, name, one if is_view or not _CONSTANT_IF.search(own) else one.as_warning()
        for kind, name, members in declared_blocks(declared) if buffers else ():
            if kind == "buffer" and name in buffers and not names.isdisjoint(members):
                one = step.problem("RG430", unbound_block(step, name))
                yield text, name, one if not _CONSTANT_IF.search(own) else one.as_warning()


def uniform_kinds(step: Step) -> tuple[tuple[str, int, bool], ...]:
    """Return the uniforms of a step with the number of their values, and whether these are floats."""
    found = []
    for name, value in step.uniforms:
        numbers = value if isinstance(value, tuple | list) else (value,)
        found.append((name, len(numbers), any(isinstance(number, float) for number in numbers)))
    return tuple(found)


def unfit_uniforms(step: Step, texts: Mapping[str, StageText]) -> Iterator[tuple[StageText, str, Problem]]:
    """Yield stage, name and problem of uniforms that are declared with another type than the step gives (RG436)."""
    given = {name: (count, floats) for name, count, floats in uniform_kinds(step)}
    values = dict(step.uniforms)
    for text in texts.values():
        blocks = [block for block in text.source.blocks if block.origin.file is not None and not block.origin.shared]
        own = "\n".join("\n".join(block.lines) for block in blocks if not block.origin.prefix)
        declared = [(kind, name) for kind, name in _TYPED.findall(own) if name in given]
        for kind, name in declared if len(dict.fromkeys(name for _, name in declared)) == len(declared) else ():
            count, floats = given[name]
            if count != (int(kind[-1]) if kind[-1].isdigit() else 1):
                what = f"{count} number{'' if count == 1 else 's'}"
            elif floats and kind[0] in "iub":
                value = values[name]
                what = f"floats, {(value[0] if isinstance(value, tuple | list) else value)!r}"
            else:
                continue
            message = f"{_files(step)} declares '{name}' as {kind}, but it is given {what}"
            if name in reachable_names(text.text, certain=True):
                yield text, name, step.problem("RG436", message)


def _suspects(
    step: Step, own: str, whole: str, given: Collection[str], set_names: Collection[str], cls: type[Node]
) -> Iterator[tuple[str, tuple[str, Callable[[], str]]]]:
    """Yield names, with the code of the problem and what returns its text."""
    ports = cls.ports()
    for name in declared_samplers(own).keys() - given:
        if not (name.endswith("_texture") and step.kind == "geometry"):
            yield name, ("RG430", partial(unbound_sampler, step, name, given, cls))
    for stem in set(_VIEWS.findall(own)):
        port = stem.removeprefix("previous_")
        if port in ports and f"{stem}_view_block" not in whole:
            yield f"{stem}_views", ("RG430", partial(_without_views, step, port, given, cls))
    for names in _UNIFORM.findall(own):
        for name in re.findall(r"[A-Za-z_]\w*", names):
            if name not in set_names and name not in given:
                yield name, ("RG434", partial(unset_uniform, step, name))


def _without_views(step: Step, port: str, given: Collection[str], cls: type[Node]) -> str:
    if port in given:
        text = f"{_files(step)} looks at the views of '{port}', but what is linked there was not drawn with a view"
        return f"{text}; use `camera`, or give the linked output `view=`"
    return f"{_files(step)} looks at the views of {_left_out(step, port, cls)}"


def _left_out(step: Step, name: str, cls: type[Node]) -> str:
    """Say why a step does not read a port of its node, and the way out."""
    optional = getattr(cls.ports()[name], "optional", False)
    guard = f"leave it out by #ifdef HAS_{name.upper()}"
    if step.where.caller is None:  # it reads all that is connected
        return f"'{name}', which is not connected here; {guard}" if optional else f"'{name}', which it does not read"
    near = nearest(name, {use.name for use in step.reads} - cls.ports().keys())
    way = f"give it as {name}=…, not {near}=…" if near is not None else f"add {name}=self.{name} to the step"
    more = f", or {guard} where it is not connected" if optional else ""
    return f"'{name}', a port of the node that this step does not read; {way}{more}"


def _files(step: Step) -> str:
    return ", ".join(file for _, file in step.shaders)
