"""Driver messages that name the author's file and line, without the consequences of others.

A misspelt name is one mistake with many consequences.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from itertools import pairwise
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from rendergraph.catalog.types import shared_includes
from rendergraph.errors import Place, Problem
from rendergraph.glsl.globals import globals_of
from rendergraph.glsl.source import Origin, SourceText
from rendergraph.program.text import StageText

_FORMS = (
    re.compile(
        r"\s*\d+:(?P<line>\d+)\((?P<column>\d+)\):\s*(?P<kind>(?:preprocessor )?error|warning)\s*:(?P<text>\s*.*)"
    ),
    re.compile(r"\s*\d+\((?P<line>\d+)\)\s*:\s*(?P<kind>(?:fatal )?error|warning)\s+(?:[A-Z]\d+\s*)?:\s*(?P<text>.*)"),
    re.compile(r"\s*(?P<kind>ERROR|WARNING):\s*\d+:(?P<line>\d+):\s*(?:(?:error|warning)\(#\d+\)\s*)?(?P<text>.*)"),
)
_UNKNOWN = re.compile(r"(?i)undeclared|undefined variable|no function with name|no matching overloaded function")
"""Drivers' phrases for an unknown name."""
_CALL = re.compile(r"(?P<before>.*`\w+\((?P<types>[^()]*)\)'); candidates are:")
_CANDIDATE = re.compile(r"\s{3,}\w+ \w+\((?P<types>[^()]*)\)\s*\Z")
_MOST_CANDIDATES = 3
_CLOSE = 0.75
_ENDS = re.compile(r"[;{}]\s*\Z|^\s*#")
"""Matches the end of a line after which a new statement begins."""
_DEFINES = r"^(?:struct\s+{0}\b|#\s*define\s+{0}\b|\w+\s+{0}\s*\()"
"""Matches a line that declares a struct, a macro or a function with a name."""
_BUILT_IN = """
abs acos acosh all any asin asinh atan atanh barrier bitCount bitfieldExtract ceil clamp cos cosh cross dFdx
dFdxCoarse dFdxFine dFdy dFdyCoarse dFdyFine degrees determinant distance dot equal exp exp2 faceforward findLSB
findMSB floatBitsToInt floatBitsToUint floor fma fract fwidth greaterThan greaterThanEqual imageAtomicAdd
imageAtomicMax imageAtomicMin imageLoad imageSize imageStore intBitsToFloat interpolateAtCentroid
interpolateAtSample inverse inversesqrt isinf isnan length lessThan lessThanEqual log log2 matrixCompMult max
memoryBarrier memoryBarrierBuffer memoryBarrierImage memoryBarrierShared min mix mod modf normalize not notEqual
outerProduct packHalf2x16 packUnorm4x8 pow radians reflect refract round roundEven sign sin sinh smoothstep sqrt
step tan tanh texelFetch texelFetchOffset texture textureGather textureGatherOffset textureGrad textureLod
textureLodOffset textureOffset textureProj textureQueryLevels textureQueryLod textureSamples textureSize transpose
trunc uintBitsToFloat unpackHalf2x16 unpackUnorm4x8 gl_FragCoord gl_FragDepth gl_FrontFacing gl_GlobalInvocationID
gl_InstanceID gl_Layer gl_LocalInvocationID gl_LocalInvocationIndex gl_NumWorkGroups gl_Position gl_PrimitiveID
gl_SampleID gl_VertexID gl_WorkGroupID EmitVertex EndPrimitive
"""
"""Common names of GLSL 4.50, for suggestions."""
_SECTION = re.compile(r"\s*(Vertex|Geometry|Fragment|Compute) info\s*\Z")
_QUOTED = re.compile(r"[`'\"]([A-Za-z_]\w*)['\"`]")
_FUNCTION = re.compile(r"`[^`']*?([A-Za-z_]\w*)\(")
_LACKS = re.compile(r"(vertex|geometry|fragment|compute) shader lacks")
_WORD = re.compile(r"[A-Za-z_]\w*")
_DECLARES = re.compile(r"\b(?:in|out|inout|uniform|buffer|flat|centroid|const|layout|struct)\b|\w+\s+\w+\s*[;(=\[]")


def compile_problems(message: str, text: StageText) -> list[Problem]:
    """Return a driver's messages about one stage, at places that the author knows.

    Understands the formats of Mesa (`0:12(5): error: …`), NVIDIA (`0(12) : error C1008: …`) and AMD, Intel and glslang
    (`ERROR: 0:12: …`). Warnings are dropped if there are errors. A message without a line becomes one problem.
    """
    found = _located(message.splitlines(), text, "RG410")
    if found:
        return found
    plain = " ".join(message.split()) or "the driver refused the shader without a reason"
    return [Problem("RG410", f"{text.who}: {plain}", _first_place(text.source))]


def link_problems(message: str, texts: Mapping[str, StageText]) -> list[Problem]:
    """Return a driver's messages about stages that do not link.

    NVIDIA names lines under the heading of a stage. Other drivers name a variable: the place is the line that declares
    it, in the later stage if both do; else it is the last stage's file.
    """
    rows = [row for row in message.splitlines() if row.strip()]
    heads = [number for number, row in enumerate(rows) if _SECTION.match(row)]
    found: list[Problem] = []
    for start, end in pairwise([*heads, len(rows)]):
        stage = _SECTION.match(rows[start])[1].lower()  # type: ignore[index]  # it has just matched
        if stage in texts:
            found += _located(rows[start + 1 : end], texts[stage], "RG411")
    if found:
        return found
    text = re.sub(r"^error:\s*", "", "; ".join(row.strip() for row in rows))
    text = text or "the driver refused the program without a reason"
    last = list(texts.values())[-1]
    text = f"{last.of_node}the stages {', '.join(texts)} do not link: {text}"
    lacking = _LACKS.search(text)
    if lacking and lacking[1] in texts:  # the message names what is missing
        return [Problem("RG411", text, _first_place(texts[lacking[1]].source))]
    for stage_text in reversed(list(texts.values())):
        if spot := declared_at(stage_text.source, _QUOTED.findall(message)):
            return [Problem("RG411", text, *spot)]
    return [Problem("RG411", text, _first_place(last.source))]


def declared_at(source: SourceText, names: Sequence[str], *, mentions: bool = True) -> tuple[Place, str] | None:
    """Return where an author's file declares one of the names, and that line.

    With `mentions` a line that declares something else with the name counts too, such as a parameter.
    """
    declared = {one.name: one.at for one in globals_of(source.text).declared} if names else {}
    for name in names:
        own, text = source.place(declared[name]) if name in declared else (None, "")
        if own is not None:
            return own, text
        pattern = re.compile(rf"\b{re.escape(name)}\b")
        for line, origin in zip(source.lines, source.origins, strict=True) if mentions else ():
            match = pattern.search(line)
            if match and not origin.shared and _DECLARES.search(line) and (place := origin.place(match.start() + 1)):
                return place, line
    return None


def mentioned_at(source: SourceText, names: Sequence[str]) -> tuple[Place, str] | None:
    """Return the first place in an author's file that contains one of the names, and its line."""
    pattern = re.compile(rf"\b(?:{'|'.join(map(re.escape, names))})\b")
    for line, origin in zip(source.lines, source.origins, strict=True):
        match = None if origin.shared else pattern.search(line)
        if match is not None and (place := origin.place(match.start() + 1)):
            return place, line
    return None


def _located(rows: Sequence[str], text: StageText, code: str) -> list[Problem]:
    return list(dict.fromkeys(_problem(code, message, text) for message in causes(rows, text.source)))


def _problem(code: str, message: DriverMessage, stage: StageText) -> Problem:
    rows, text, line, severity = stage.source, message.text.strip(), message.line, message.severity
    if not 1 <= line <= len(rows.lines):  # about the whole text, such as recursion
        spot = declared_at(rows, _FUNCTION.findall(text)) or (_first_place(rows), "")
        return Problem(code, f"{stage.who}: {text}", *spot, severity)
    origin, shown_line = rows.origins[line - 1], rows.lines[line - 1]
    column = _unsqueezed(shown_line, message.column)
    if origin.prefix:
        text = text.replace(origin.prefix, "")
        column = len(shown_line[: column - 1].replace(origin.prefix, "")) + 1
        shown_line = shown_line.replace(origin.prefix, "")
    if origin.file is None:
        place = _nearest_author(rows, shown_line, text)
        what = f"what rendergraph writes for {origin.purpose}" if origin.purpose else "generated text"
        text += f" (in {what}: {shown_line.strip()})"
        return Problem(code, f"{stage.who}: {text}", place, severity=severity)
    column, where = _macro(rows, shown_line, text) or (_of_name(shown_line, text, column), "")
    text += where + _included(origin)
    return Problem(code, f"{stage.who}: {text}", origin.place(column), shown_line, severity)


def _unsqueezed(line: str, column: int) -> int:
    """Return the column for one reported by Mesa, whose preprocessor collapses blanks; for 0, the column of the text.

    Measured with Mesa 22.3: indents, tabs and blanks inside a line alike, and comments, which are blanks already.
    """
    if column < 1:
        return len(line) - len(line.lstrip()) + 1
    kept = [at for at, sign in enumerate(line) if sign not in " \t" or at == 0 or line[at - 1] not in " \t"]
    return kept[column - 1] + 1 if column <= len(kept) else len(line.rstrip()) + 1


def _of_name(line: str, message: str, column: int) -> int:
    """Return the position of a quoted name closest to the reported column, which macros in the line shift."""
    for name in _QUOTED.findall(message):
        starts = [match.start() + 1 for match in _WORD.finditer(line) if match.group() == name]
        if starts:
            return min(starts, key=lambda start: abs(start - column))
    return column


def _macro(source: SourceText, line: str, message: str) -> tuple[int, str] | None:
    """Return the macro that contains a quoted name: drivers report the line that uses the macro, and wrong columns."""
    words = [(match.group(), match.start()) for match in _WORD.finditer(line)]
    for name in _QUOTED.findall(message):
        if name in (word for word, _ in words):
            return None
        for word, start in words:
            pattern = re.compile(rf"\s*#\s*define\s+{re.escape(word)}\b.*\b{re.escape(name)}\b")
            for text, origin in zip(source.lines, source.origins, strict=True):
                if pattern.match(text):
                    place = origin.place()
                    return start + 1, f" (in macro {word}" + (f" of {place.file}:{place.line})" if place else ")")
    return None


def _included(origin: Origin) -> str:
    """Return where the author includes a file; for nested shared files, the author's own line."""
    by = origin.by
    while by is not None and by.shared and by.by is not None:
        by = by.by
    place = by.place() if by is not None else None
    return f" (included at {place.file}:{place.line})" if place is not None else ""


def _first_place(source: SourceText) -> Place | None:
    """Return the first line of the author's own file, which is last in the text."""
    own = (origin.file for origin in reversed(source.origins) if origin.file is not None and origin.by is None)
    return Origin(next(own, None), 1).place()


def _nearest_author(source: SourceText, line: str, message: str) -> Place | None:
    """Return the first line of an author's file with a name that the driver quotes, else the longest of the line."""
    words = set(_WORD.findall(line)) - {"define", "uniform", "layout", "const", "float", "int"}
    for name in (*_QUOTED.findall(message), *sorted(words, key=len, reverse=True)):
        if found := mentioned_at(source, [name]):
            return replace(found[0], column=1)
    return _first_place(source)


# --- causes -----------------------------------------------------------------------------------------------------------


class DriverMessage(Struct, frozen=True):
    """One message of a driver, with its line in the stage's text and its column, 0 if it names none."""

    text: str
    line: int
    column: int
    severity: Literal["error", "warning"]


def causes(rows: Sequence[str], source: SourceText) -> list[DriverMessage]:
    """Return the messages that name a line, without consequences of others; warnings only if there is no error.

    For each statement, only the first error and unknown names count. An unknown name is reported once, with a similar
    one; only the closest candidates for a call are listed.
    """
    found = list(_with_candidates([message for row in rows if (message := _read(row)) is not None]))
    errors = [message for message in found if message.severity == "error"]
    if not errors:
        return list(dict.fromkeys(found))
    unknown = {name for message in errors if _UNKNOWN.search(message.text) for name in _QUOTED.findall(message.text)}
    known = {*_WORD.findall(source.text), *_BUILT_IN.split()} - unknown
    kept: list[DriverMessage] = []
    reported: set[str] = set()
    begun: set[int] = set()
    for message in errors:
        statement = _statement(source, message.line)
        if _UNKNOWN.search(message.text):
            if message.text not in reported:
                reported.add(message.text)
                kept.append(replace(message, text=message.text + _near(message.text, known)))
        elif statement not in begun and not re.search(r"\berror\b", message.text):
            kept.append(message)
        begun.add(statement)
    if kept or "NEW_IDENTIFIER" not in errors[0].text:
        return kept or errors[:1]
    return [replace(errors[0], text=errors[0].text + _unknown_type(source, errors[0].line))]


def _read(row: str) -> DriverMessage | None:
    match = next((match for form in _FORMS if (match := form.match(row))), None)
    if match is None:
        return None
    column = int(match.groupdict().get("column") or 0)
    severity: Literal["error", "warning"] = "warning" if "warning" in match["kind"].lower() else "error"
    return DriverMessage(match["text"].rstrip(), int(match["line"]), column, severity)


def _with_candidates(found: Sequence[DriverMessage]) -> Iterator[DriverMessage]:
    """Append the overloads that Mesa lists beneath a call, one message each, to the message about the call."""
    at = 0
    while at < len(found):
        message = found[at]
        at += 1
        call = _CALL.match(message.text)
        listed: list[str] = []
        while call and at < len(found) and found[at].line == message.line and _CANDIDATE.match(found[at].text):
            listed.append(found[at].text.strip())
            at += 1
        text = message.text.strip()
        if call and listed:
            types = call["types"]
            near = sorted(listed, key=lambda one: _distance(types, one))[:_MOST_CANDIDATES]
            which = "available:" if len(near) == len(listed) else f"the nearest of {len(listed)} are"
            text = f"{call['before'].strip()}; {which} {'; '.join(near)}"
        yield replace(message, text=text)


def _distance(types: str, candidate: str) -> tuple[int, int, list[bool]]:
    """Return the distance of a candidate from the call: by argument count, then by differing arguments."""
    match = _CANDIDATE.match(f"   {candidate}")
    assert match  # candidates match by construction
    given, taken = types.split(", "), match["types"].split(", ")
    differ = [one != other for one, other in zip(given, taken, strict=False)]
    return abs(len(given) - len(taken)), sum(differ), differ


def _statement(source: SourceText, line: int) -> int:
    """Return the line in which the statement of a line begins."""
    line = min(line, len(source.lines))
    while line > 1 and source.lines[line - 2].strip() and not _ENDS.search(source.lines[line - 2]):
        line -= 1
    return line


def _near(text: str, known: set[str]) -> str:
    for name in _QUOTED.findall(text):
        if include := _include_with(name):
            return f"; #include <{include}> declares it"
        if close := get_close_matches(name, sorted(known), n=1, cutoff=_CLOSE):
            return f"; did you mean '{close[0]}'?"
    return ""


def _unknown_type(source: SourceText, line: int) -> str:
    """Explain Mesa's message about an undeclared name, where it expects a type or has taken one for a value."""
    for name in _WORD.findall(source.lines[line - 1]) if line <= len(source.lines) else ():
        if not re.search(_DEFINES.format(name), source.text, re.MULTILINE) and (include := _include_with(name)):
            return f": nothing declares '{name}'; #include <{include}> does"
    return ": a name that nothing declares"


def _include_with(name: str) -> str:
    """Return the shared include that declares a function, struct or macro with that name; empty if none does."""
    for file in sorted(shared_includes().glob("*.glsl")):
        if re.search(_DEFINES.format(name), file.read_text(encoding="utf-8"), re.MULTILINE):
            return file.name
    return ""
