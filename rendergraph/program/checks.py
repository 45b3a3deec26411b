"""Compare a step's program text with what the step provides, as far as possible without GL.

This depends on the text only: code that a constant condition excludes is known only to the driver.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache, partial

from rendergraph.catalog import NodeType
from rendergraph.declare import Node
from rendergraph.errors import InputError, Place, Problem, nearest, shown_file, suggestion
from rendergraph.glsl.globals import declared_blocks, declared_samplers, globals_of
from rendergraph.glsl.names import compiled_text, reachable_names
from rendergraph.program.text import StageText, TextSources, prefix, stage_texts, text_key
from rendergraph.stamps import FileCache
from rendergraph.steps import Read, Resource, Step, Write
from rendergraph.textures import FORMATS, GLSL_SHAPES, TextureDesc

_PASSED: FileCache[tuple[Problem, ...]] = FileCache()
"""The warnings about texts without errors."""
Texts = Callable[[], Mapping[str, StageText]]
"""Returns a program's texts, generated on demand."""

_MOVING = {
    "camera_block": "the camera",
    "frame_block": "the frame's time and number",
    "light_block": "the scene's lights, which may move",
    "material_block": "the scene's materials, which may change",
    "environment_block": "the intensity and rotation of the environment, which may change",
    "pass_view_block": "the view it is drawn with",
    "scene_previous_block": "the transforms of objects in the previous frame",
}
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
_OF_SCENE_DATA = ("light_block", "material_block")
_OF_SCENE = ("scene.glsl", "previous_scene.glsl", "trace.glsl")


def check_texts(steps: Iterable[Step], sources: TextSources) -> tuple[Problem, ...]:
    """Build the program texts of steps, check them, and return warnings."""
    problems: list[Problem] = []
    warnings: list[Problem] = []
    seen: set[object] = set()
    resources = sources.resources
    for step in steps:
        kinds = tuple((name, sampler_of(read, resources[read.resource])) for name, read in _sampled(step, resources))
        names = _uniform_kinds(step)
        key = step.type, step.shaders, step.defines, step.functions, kinds, names, _kept(step, resources)
        if not step.shaders or key in seen:
            continue  # same text as another step
        seen.add(key)
        try:
            whole = text_key(step, sources), names, _kept(step, resources)
            warnings += _PASSED.get(whole, partial(_check_step, step, sources))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(list(dict.fromkeys(problems)))
    return tuple(dict.fromkeys(warnings))


def _check_step(step: Step, sources: TextSources) -> tuple[Problem, ...]:
    texts, cls, resources = stage_texts(step, sources), sources.types[step.node].cls, sources.resources
    check_scene_includes(step, texts, sources.types)
    check_kept_text(step, lambda: texts, cls, resources)
    _check_samplers(step, texts, resources)
    _check_outs(step, texts, cls, resources)
    found = missing(step, texts, cls)
    if errors := [problem for problem in found if problem.severity == "error"]:
        raise InputError(errors)
    return (*found, *(warning for text in texts.values() for warning in text.warnings))


def sampler_of(read: Read, resource: Resource) -> str:
    """Return the GLSL sampler type of a read: `usampler2D`, `sampler2DArrayShadow`, `sampler2DMS`."""
    assert isinstance(resource.desc, TextureDesc)
    whole = {"uint": "u", "int": "i"}.get(FORMATS[resource.desc.format].family, "")
    name = f"sampler{GLSL_SHAPES[read.kind]}"
    if resource.desc.samples > 1:
        name = name.replace("2D", "2DMS")
    return whole + name + ("Shadow" if read.sampler.compare else "")


def named_reads(step: Step) -> Iterator[tuple[str, Read]]:
    yield from ((read.name, read) for read in step.reads)
    for function in step.functions:
        yield from ((prefix(function.node) + read.name, read) for read in function.reads)


def _sampled(step: Step, resources: Mapping[str, Resource]) -> Iterator[tuple[str, Read]]:
    for name, read in named_reads(step):
        if read.use == "sample" and isinstance(resources[read.resource].desc, TextureDesc):
            yield name, read


def unfit_sampler(step: Step, declared: str, read: Read, resources: Mapping[str, Resource]) -> Problem | None:
    right = sampler_of(read, resources[read.resource])
    if declared == right:
        return None
    desc = resources[read.resource].desc
    assert isinstance(desc, TextureDesc)
    if desc.samples > 1 and declared == right.replace("MS", ""):
        but = f"'{read.resource}' has {desc.samples} samples; resolve it first, or declare it as {right}"
        return step.problem("RG214", f"'{read.name}' is read as one sample per texel ({declared}), but {but}")
    what = f"a {read.kind} of {desc.format}" + (f" with {desc.samples} samples" if desc.samples > 1 else "")
    how = ", read with `compare`," if read.sampler.compare else ""
    text = f"'{read.name}' is declared as {declared}, but '{read.resource}'{how} is {what}; declare it as {right}"
    return step.problem("RG447", text)


def _check_samplers(step: Step, texts: Mapping[str, StageText], resources: Mapping[str, Resource]) -> None:
    reads = dict(_sampled(step, resources))
    problems = []
    for text in texts.values():
        for name, kinds in declared_samplers(text.text).items():
            found = [unfit_sampler(step, kind, reads[name], resources) for kind in kinds] if name in reads else [None]
            if found[0] is not None and None not in found:  # another branch of an `#if` may declare the right type
                problems.append(_placed(found[0], text, [name]))
    if problems:
        raise InputError(list(dict.fromkeys(problems)))


def unfit_outputs(
    step: Step, outs: Mapping[str, str], cls: type[Node], resources: Mapping[str, Resource]
) -> list[Problem]:
    """Return the problems of a fragment shader's outputs, given as name to GLSL type.

    Each must be a target of the step or a port of the node; a single output may have any name.
    """
    problems = []
    targets = {write.name: write.resource for write in step.writes if write.use == "color"}
    for name, kind in outs.items():
        resource = targets.get(name)
        if resource is None and len(outs) == len(targets) == 1:
            resource = next(iter(targets.values()))
        if resource is not None:
            desc = resources[resource].desc
            assert isinstance(desc, TextureDesc)
            right = {"uint": "u", "int": "i"}.get(FORMATS[desc.format].family, "")
            if right != (kind[0] if kind[0] in "iu" else ""):
                text = f"'{name}' is declared as {kind}, but '{resource}' is {desc.format}; declare it as {right}vec4"
                problems.append(step.problem("RG447", text, name))
        elif len(outs) > 1 and name not in cls.ports():
            what = f"{dict(step.shaders)['fragment']} writes '{name}', which the node does not declare"
            problems.append(step.problem("RG448", what + suggestion(name, cls.outputs()), name))
    return problems


def _check_outs(step: Step, texts: Mapping[str, StageText], cls: type[Node], resources: Mapping[str, Resource]) -> None:
    """Check the outputs that a text always declares; an `out` inside `#if` belongs to another step or variant."""
    if "fragment" in texts:
        text = texts["fragment"]
        parts = [part for part in re.split("[;{}]", _always(text.text)) if "out" in part]  # parsing the rest takes long
        declared = globals_of(";\n".join([*parts, ""])).declared
        outs = {found.name: found.type for found in declared if found.storage == "out"}
        problems = unfit_outputs(step, outs, cls, resources)
        if problems:
            raise InputError([_placed(problem, text, [problem.subject]) for problem in problems])


def _traces(step: Step, types: Mapping[str, NodeType]) -> bool:
    nodes = [step.node, *(function.node for function in step.functions)]
    return step.reads_scene and any(port.rays for node in nodes for port in types[node].read.values())


def ray_warnings(steps: Iterable[Step], types: Mapping[str, NodeType]) -> Iterator[Problem]:
    """Yield warnings about what ray tracing misses: vertices that a plugin moves (RG625), narrow highlights (RG626)."""
    traced = [step for step in steps if _traces(step, types)]
    for step in steps if traced else ():
        vertex = dict(step.shaders).get("vertex", "<")
        if step.kind == "geometry" and not step.in_place and vertex[0] != "<" and types[step.node].plugin != "builtin":
            text = f"rays of '{traced[0].node}' miss vertices that {vertex} moves; in_place=True says it moves none"
            yield step.problem("RG625", text).as_warning()
        for _, file in step.includes if "SAMPLES_DIRECTIONS" in dict(step.defines) else ():
            if "HAS_SAMPLED_DIRECTIONS" not in file.read_text(encoding="utf-8"):
                text = f"'{step.node}' samples directions by the cosine, because this model does not choose them"
                yield Problem("RG626", text, Place(shown_file(file)), severity="warning")


def check_scene_includes(step: Step, texts: Mapping[str, StageText], types: Mapping[str, NodeType]) -> None:
    """Refuse includes for the scene's data in steps that do not read it (RG430)."""
    traces, problems = _traces(step, types), []
    for text in texts.values():
        for block in text.source.blocks:
            name, origin = block.origin.file.name if block.origin.file is not None else "", block.origin
            if not origin.shared or name not in _OF_SCENE or traces or (step.reads_scene and name != "trace.glsl"):
                continue
            while origin.by is not None and origin.shared:
                origin = origin.by
            lacks = f"it includes <{name}>, but does not read {'rays' if step.reads_scene else 'the scene'}; "
            in_python, in_header = (", rays=True", ", rays: true") if name == "trace.glsl" else ("", "")
            way = f"declare `scene = Input(SceneData{in_python})` and give the step scene=self.scene"
            if types[step.node].is_shader:
                way = f"add scene: {{semantic: scene_data{in_header}}} to `inputs` of its header"
            problem = step.problem("RG430", lacks + way)
            problems.append(problem.relocate(origin.place(), f"#include <{name}>"))
    if problems:
        raise InputError(list(dict.fromkeys(problems)))


def _always(text: str) -> str:
    """Return a text without the contents of `#if`."""
    depth, kept = 0, []
    for line in text.split("\n"):
        directive = re.match(r"\s*#\s*(ifdef|ifndef|if|endif)\b", line) if "#" in line else None
        depth += 0 if directive is None else -1 if directive[1] == "endif" else 1
        kept.append(line if depth == 0 and directive is None else "")
    return "\n".join(kept)


def check_kept_text(step: Step, texts: Texts, cls: type[Node], resources: Mapping[str, Resource]) -> None:
    """Refuse a step that makes a persistent value from the camera, time, lights, views or a transient input (RG439)."""
    kept = _kept(step, resources)
    if kept is None:
        return
    problems: list[Problem] = []
    for text in texts().values():
        names, samplers, blocks = _reached(text.text)
        given = {read.name for read in step.reads}
        for name in sorted((names & samplers & cls.inputs().keys()) - given):
            problem = step.problem("RG439", f"it makes '{kept}', which is kept, but samples '{name}', which is not")
            problems.append(_placed(problem, text, [name]))
        for _, block, members in blocks:
            used = sorted(names & members)
            follows = step.reads_scene and block in _OF_SCENE_DATA  # the step runs again when those change
            if used and not follows and (block in _MOVING or block.endswith("_view_block")):
                what = _MOVING.get(block, "a view, which `update` sets in each frame")
                problem = step.problem("RG439", f"it makes '{kept}', which is kept, but uses {what} ('{used[0]}')")
                problems.append(_placed(problem, text, used))
    if problems:
        raise InputError(list(dict.fromkeys(problems)))


@lru_cache(maxsize=256)
def _reached(text: str) -> tuple[set[str], set[str], list[tuple[str, str, set[str]]]]:
    return reachable_names(text), set(declared_samplers(text)), list(declared_blocks(text))


def _kept(step: Step, resources: Mapping[str, Resource]) -> str | None:
    return next((write.resource for write in step.writes if resources[write.resource].role == "kept"), None)


used_names = lru_cache(maxsize=256)(reachable_names)
"""The names that `main` of a program text reaches."""


@lru_cache(maxsize=256)
def used_blocks(text: str) -> frozenset[str]:
    """Return the blocks of which `main` of a program text, or a function that it calls, uses a member."""
    names = used_names(text)
    return frozenset(block for _, block, members in declared_blocks(text) if not names.isdisjoint(members))


def _placed(problem: Problem, text: StageText, names: Sequence[str]) -> Problem:
    """Return the problem at the author's line that contains one of the names, if there is one."""
    from rendergraph.program.messages import declared_at, mentioned_at  # needed only if something is wrong

    found = declared_at(text.source, names) or mentioned_at(text.source, names)
    return problem.relocate(*found) if found is not None else problem


# --- names that nothing provides --------------------------------------------------------------------------------------


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


def missing(step: Step, texts: Mapping[str, StageText], cls: type[Node]) -> list[Problem]:
    """Return problems about what authors' shaders use but the step does not provide as declared, at their lines.

    Code that a constant condition might exclude gives warnings.
    """
    problems: list[Problem] = []
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
                problem = _placed(step.problem(code, describe()), text, [name])
                is_certain = name.endswith("_views") or not _CONSTANT_IF.search(own)
                problems.append(problem if is_certain else problem.as_warning())
    return problems


def _uniform_kinds(step: Step) -> tuple[tuple[str, int, bool], ...]:
    """Return the uniforms of a step with their numbers of values, and whether the values are floats."""
    rows = [(name, value if isinstance(value, tuple | list) else (value,)) for name, value in step.uniforms]
    return tuple((name, len(row), any(isinstance(number, float) for number in row)) for name, row in rows)


def _suspects(step: Step, own: str, whole: str, cls: type[Node]) -> Iterator[tuple[str, str, str, Callable[[], str]]]:
    """Yield code, name, a pattern of the line that matters if compiled, and a function that returns the message."""
    uses: tuple[Read | Write, ...] = (*step.reads, *step.writes)
    given = {use.name for use in uses}
    given |= {prefix(each.node) + read.name for each in step.functions for read in each.reads}
    kinds = {name: (count, floats) for name, count, floats in _uniform_kinds(step)}
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
